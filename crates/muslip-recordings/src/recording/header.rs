//! The columns of a recording.

use muslip::sample::RigSample;

/// A column whose meaning and unit the recording's format fixes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// `time_s`, strictly increasing.
    Time,
    /// `wheel_speed_rad_s`, angular speed of the braked wheel.
    WheelSpeed,
    /// `vehicle_speed_m_s`, speed of road, drum surface or fifth wheel.
    VehicleSpeed,
    /// `drag_force_n`, positive when it slows the vehicle.
    DragForce,
    /// `normal_force_n`, positive in compression.
    NormalForce,
    /// `brake_torque_nm`, positive when it slows the wheel.
    BrakeTorque,
    /// `brake_pressure_pa`.
    BrakePressure,
}

impl Channel {
    /// All channels, in the order in which recordings are written.
    pub const ALL: [Self; 7] = [
        Self::Time,
        Self::WheelSpeed,
        Self::VehicleSpeed,
        Self::DragForce,
        Self::NormalForce,
        Self::BrakeTorque,
        Self::BrakePressure,
    ];

    /// The header of the channel's column.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time_s",
            Self::WheelSpeed => "wheel_speed_rad_s",
            Self::VehicleSpeed => "vehicle_speed_m_s",
            Self::DragForce => "drag_force_n",
            Self::NormalForce => "normal_force_n",
            Self::BrakeTorque => "brake_torque_nm",
            Self::BrakePressure => "brake_pressure_pa",
        }
    }
}

/// Which channels a job cannot do without.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Required {
    /// Time, both speeds and both forces.
    DragIncluded,
    /// The same without the drag, for jobs that predict it.
    DragOptional,
}

impl Required {
    /// The channels, in the order in which a missing one is reported.
    pub fn channels(self) -> impl Iterator<Item = Channel> {
        Channel::ALL
            .into_iter()
            .take(5)
            .filter(move |&channel| self == Self::DragIncluded || channel != Channel::DragForce)
    }
}

/// The header row: the names of all columns and where the known channels are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    names: Vec<String>,
    known: [Option<usize>; Channel::ALL.len()],
}

impl Header {
    pub(super) fn new(names: Vec<String>) -> Self {
        let known =
            Channel::ALL.map(|channel| names.iter().position(|name| name == channel.name()));
        Self { names, known }
    }

    /// Names of all columns in file order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Column of a channel, counted from 0, where the recording has it.
    pub fn index(&self, channel: Channel) -> Option<usize> {
        self.known[channel as usize]
    }

    /// Columns that are no known channel: candidates to explain a mismatch.
    pub fn extra(&self) -> impl Iterator<Item = (usize, &str)> {
        self.names
            .iter()
            .map(String::as_str)
            .enumerate()
            .filter(|(index, _)| !self.known.contains(&Some(*index)))
    }

    pub(super) fn value(&self, cells: &[f64], channel: Channel) -> f64 {
        self.index(channel)
            .and_then(|index| cells.get(index))
            .copied()
            .unwrap_or(f64::NAN)
    }

    pub(super) fn rig_sample(&self, cells: &[f64]) -> RigSample<f64> {
        RigSample {
            wheel_speed_rad_s: self.value(cells, Channel::WheelSpeed),
            vehicle_speed_m_s: self.value(cells, Channel::VehicleSpeed),
            drag_force_n: self.value(cells, Channel::DragForce),
            normal_force_n: self.value(cells, Channel::NormalForce),
        }
    }
}
