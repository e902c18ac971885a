//! The three balances side by side, and what they say together.

use muslip::law::Rudd;
use muslip::real::Real;

use crate::detection::{Band, BandLimits, Bands, Limits, Statistics, Window};
use crate::level::{Level, Noise, Rate, Step};
use crate::reading::{Reading, StepError};
use crate::settings::{Coloured, Setting, Settings, SettingsError};
use crate::tyre::Tyre;
use crate::whitener::Innovation;

/// A balance of the braked wheel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Balance {
    /// Drag against the tyre's law.
    Tyre,
    /// Wheel speed against drag and brake torque.
    Wheel,
    /// Vehicle speed against drag.
    Vehicle,
}

impl Balance {
    /// All, in the order in which they are looked at.
    pub const ALL: [Self; 3] = [Self::Tyre, Self::Wheel, Self::Vehicle];
}

/// What the latest full windows say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Verdict {
    /// No window has been full yet.
    NotFormed,
    /// All are within their limits.
    Consistent,
    /// At least one is not; of several the one that is farthest beyond its limit.
    Inconsistent {
        /// Whose.
        balance: Balance,
        /// Of which innovations.
        band: Band,
    },
}

/// The innovations of one step, each over its standard deviation; dimensionless, of mean 0 and variance 1 under the
/// right model. `None` where the balance is not formed at this sample. Readings that the gate refused are told at
/// their full size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovations<T> {
    /// Of the tyre's balance.
    pub tyre: Option<T>,
    /// Of the wheel's.
    pub wheel: Option<T>,
    /// Of the vehicle's.
    pub vehicle: Option<T>,
}

/// Live innovations of a rig's balances and their evidence. Made by [`Settings::build`].
///
/// Plain data of fixed size: about 2 kB in `f32`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monitor<T> {
    settings: Settings<T>,
    limits: BandLimits<T>,
    balances: Balances<T>,
    tyre: Bands<T>,
    wheel: Bands<T>,
    vehicle: Bands<T>,
}

/// All that a step of time changes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Balances<T> {
    tyre: Tyre<T>,
    wheel: Level<T>,
    vehicle: Level<T>,
    /// The last vehicle speed is too low, or there was none.
    slow: bool,
    /// The last wheel speed is too low.
    locked: bool,
    started: bool,
}

impl<T: Real> Settings<T> {
    /// The monitor, before its first step.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] naming the first setting outside its range.
    pub fn build(self) -> Result<Monitor<T>, SettingsError> {
        self.check().map_err(SettingsError::OutOfRange)?;
        Monitor::new(self).map_err(SettingsError::OutOfRange)
    }
}

impl<T: Real> Monitor<T> {
    fn new(settings: Settings<T>) -> Result<Self, Setting> {
        Ok(Self {
            balances: Balances::new(&settings)?,
            limits: BandLimits::new(&settings.detection),
            settings,
            tyre: Bands::empty(),
            wheel: Bands::empty(),
            vehicle: Bands::empty(),
        })
    }

    /// One sample, `dt_s` after the one before (> 0; of the first step: >= 0 and without meaning).
    ///
    /// A refused step has not happened: the time that it took belongs to the next.
    ///
    /// # Errors
    /// In this order: [`StepError::TimeStep`], [`StepError::NonFinite`] naming the channel, [`StepError::Overflow`].
    pub fn step(&mut self, dt_s: T, reading: &Reading<T>) -> Result<Innovations<T>, StepError> {
        let first = !self.balances.started;
        let forward = dt_s > T::ZERO || (first && dt_s >= T::ZERO);
        if !(forward && dt_s.is_finite()) {
            return Err(StepError::TimeStep);
        }
        reading.check()?;
        let before = self.balances;
        let dt_s = if first { T::ZERO } else { dt_s };
        let [tyre, wheel, vehicle] = self.balances.step(dt_s, reading, &self.settings);
        let of = |innovation: Option<Innovation<T>>| {
            innovation.map(|innovation| innovation.normalised())
        };
        let innovations = Innovations {
            tyre: of(tyre),
            wheel: of(wheel),
            vehicle: of(vehicle),
        };
        if !(self.balances.is_finite() && innovations.is_finite()) {
            self.balances = before;
            return Err(StepError::Overflow);
        }
        self.weigh(&innovations);
        Ok(innovations)
    }

    /// What the latest full windows of all balances say.
    pub fn verdict(&self) -> Verdict {
        let mut verdict = Verdict::NotFormed;
        let mut farthest = T::ONE;
        for balance in Balance::ALL {
            for band in [Band::Fast, Band::Slow] {
                let Some(statistics) = self.statistics(balance, band) else {
                    continue;
                };
                let share = self.limits(band).share(&statistics);
                if share > farthest {
                    farthest = share;
                    verdict = Verdict::Inconsistent { balance, band };
                } else if verdict == Verdict::NotFormed {
                    verdict = Verdict::Consistent;
                }
            }
        }
        verdict
    }

    /// What the latest full windows of one balance say.
    pub fn verdict_of(&self, balance: Balance) -> Verdict {
        let share = |band| {
            let statistics = self.statistics(balance, band)?;
            Some((self.limits(band).share(&statistics), band))
        };
        let shares = [share(Band::Fast), share(Band::Slow)];
        let farthest = shares.into_iter().flatten();
        match farthest.reduce(|a, b| if b.0 > a.0 { b } else { a }) {
            None => Verdict::NotFormed,
            Some((share, band)) if share > T::ONE => Verdict::Inconsistent { balance, band },
            Some(_) => Verdict::Consistent,
        }
    }

    /// Statistics of the latest full window; `None` before the first.
    pub fn statistics(&self, balance: Balance, band: Band) -> Option<Statistics<T>> {
        self.window(balance, band).latest
    }

    /// Windows that were inconsistent since the start of the run.
    pub fn alarms(&self, balance: Balance, band: Band) -> u32 {
        self.window(balance, band).alarms
    }

    /// What statistics of this band are held against.
    pub fn limits(&self, band: Band) -> Limits<T> {
        match band {
            Band::Fast => self.limits.fast,
            Band::Slow => self.limits.slow,
        }
    }

    /// The settings as built; the law is that in use.
    pub fn settings(&self) -> &Settings<T> {
        &self.settings
    }

    /// Holds the drag against another law from the next step on, an estimator's for instance.
    pub fn set_law(&mut self, law: Rudd<T>) {
        self.settings.law = law;
    }

    /// Begins another run: constants of the run, levels, evidence and counts are forgotten.
    pub fn restart(&mut self) {
        // Settings that were valid once stay so.
        if let Ok(fresh) = Self::new(self.settings) {
            *self = fresh;
        }
    }

    fn window(&self, balance: Balance, band: Band) -> &Window<T> {
        let bands = match balance {
            Balance::Tyre => &self.tyre,
            Balance::Wheel => &self.wheel,
            Balance::Vehicle => &self.vehicle,
        };
        match band {
            Band::Fast => &bands.fast,
            Band::Slow => &bands.slow,
        }
    }

    /// Adds innovations to the evidence; a reading that was refused counts by the gate.
    fn weigh(&mut self, innovations: &Innovations<T>) {
        let gate = self.settings.forming.gate_stds;
        let each = [
            (innovations.tyre, &mut self.tyre),
            (innovations.wheel, &mut self.wheel),
            (innovations.vehicle, &mut self.vehicle),
        ];
        for (innovation, bands) in each {
            if let Some(innovation) = innovation {
                bands.add(innovation.min(gate).max(-gate), &self.limits);
            }
        }
    }
}

impl<T: Real> Innovations<T> {
    fn is_finite(&self) -> bool {
        let finite = |innovation: Option<T>| innovation.is_none_or(T::is_finite);
        finite(self.tyre) && finite(self.wheel) && finite(self.vehicle)
    }
}

impl<T: Real> Balances<T> {
    fn new(settings: &Settings<T>) -> Result<Self, Setting> {
        Ok(Self {
            tyre: Tyre::new(settings)?,
            wheel: Level::new(&wheel_noise(settings)).map_err(|_| Setting::WheelNoise)?,
            vehicle: Level::new(&vehicle_noise(settings)).map_err(|_| Setting::VehicleNoise)?,
            slow: true,
            locked: false,
            started: false,
        })
    }

    fn step(
        &mut self,
        dt_s: T,
        reading: &Reading<T>,
        settings: &Settings<T>,
    ) -> [Option<Innovation<T>>; 3] {
        let (rig, forming) = (&settings.rig, &settings.forming);
        let step = Step {
            dt_s,
            longest_step_s: forming.longest_step_s,
            gate_stds: forming.gate_stds,
        };
        self.started = true;
        if let Some(speed) = reading.vehicle_speed_m_s {
            self.slow = speed < forming.sample.minimum_vehicle_speed_m_s;
        }
        // A wheel that stands is held by as much torque as it takes.
        if let Some(speed) = reading.wheel_speed_rad_s {
            self.locked = speed < forming.minimum_wheel_speed_rad_s;
        }
        let drag = reading.drag_force_n.filter(|_| !self.slow);
        let torque = reading.brake_torque_nm.filter(|_| !self.locked);
        let turned = drag.zip(torque).map(|(drag, torque)| Rate {
            total: rig.effective_radius_m * drag - torque,
            scaled: torque,
        });
        let slowed = drag
            .filter(|_| rig.vehicle_mass_kg.is_some())
            .map(|drag| Rate {
                total: -drag,
                scaled: drag,
            });
        let spin = reading
            .wheel_speed_rad_s
            .map(|speed| rig.wheel_inertia_kg_m2 * speed);
        let speed = reading.vehicle_speed_m_s;
        let momentum = rig
            .vehicle_mass_kg
            .zip(speed)
            .map(|(mass, speed)| mass * speed);
        let sample = reading.sample();
        [
            self.tyre.step(dt_s, sample.as_ref(), settings),
            self.wheel.step(&step, turned, spin),
            self.vehicle.step(&step, slowed, momentum),
        ]
    }

    fn is_finite(&self) -> bool {
        self.tyre.whitener.is_finite() && self.wheel.is_finite() && self.vehicle.is_finite()
    }
}

/// J ω, driven by R F − T.
fn wheel_noise<T: Real>(settings: &Settings<T>) -> Noise<T> {
    let (rig, sensors, own) = (&settings.rig, &settings.sensors, &settings.unmodelled);
    let inertia = rig.wheel_inertia_kg_m2;
    let radius = rig.effective_radius_m;
    Noise {
        level_std: inertia * sensors.wheel_speed_std_rad_s,
        level_coloured: scaled(inertia, sensors.wheel_speed_coloured_rad_s),
        rate_std: both(
            radius * sensors.drag_force_std_n,
            sensors.brake_torque_std_nm,
        ),
        rates: [
            scaled(radius, sensors.drag_force_coloured_n),
            own.torque_fast_nm,
            own.torque_slow_nm,
            own.torque_drift_nm,
        ],
        scale_std: own.torque_scale_run_std,
        zero_std: both(radius * own.drag_zero_run_std_n, own.torque_zero_run_std_nm),
    }
}

/// m v, driven by −F.
fn vehicle_noise<T: Real>(settings: &Settings<T>) -> Noise<T> {
    let (rig, sensors, own) = (&settings.rig, &settings.sensors, &settings.unmodelled);
    let mass = rig.vehicle_mass_kg.unwrap_or(T::ONE);
    Noise {
        level_std: mass * sensors.vehicle_speed_std_m_s,
        level_coloured: scaled(mass, sensors.vehicle_speed_coloured_m_s),
        rate_std: sensors.drag_force_std_n,
        rates: [
            sensors.drag_force_coloured_n,
            own.force_fast_n,
            own.force_slow_n,
            own.force_drift_n,
        ],
        scale_std: own.drag_scale_run_std,
        zero_std: both(own.drag_zero_run_std_n, own.force_run_std_n),
    }
}

/// Of two that are independent.
fn both<T: Real>(a: T, b: T) -> T {
    (a.squared() + b.squared()).sqrt()
}

fn scaled<T: Real>(by: T, part: Coloured<T>) -> Coloured<T> {
    Coloured {
        std: by * part.std,
        ..part
    }
}
