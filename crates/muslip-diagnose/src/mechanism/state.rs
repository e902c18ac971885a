//! What mechanisms change: the quantities of one run, in chain order, and the friction law among them.

use crate::number::Number;

/// The friction law: mu = peak (2 + b) x/(1 + b x + x²), x = (slip/critical)^p, with its own b (and p) on the
/// falling side. b = 0, p = 1 is the two-parameter law mu = 2 peak x/(1 + x²).
#[derive(Clone, Copy, Debug)]
pub struct Law<T> {
    /// Peak friction.
    pub peak: T,
    /// Slip at the peak.
    pub critical: T,
    /// b on the rising side, as ln(1 + b/2).
    pub rise: Option<T>,
    /// b on the falling side, as ln(1 + b/2), and ln p there.
    pub fall: Option<(T, Option<T>)>,
}

impl<T: Number> Law<T> {
    /// The two-parameter law.
    #[must_use]
    pub fn rudd(peak: T, critical: T) -> Self {
        Self {
            peak,
            critical,
            rise: None,
            fall: None,
        }
    }

    /// Friction at a slip over the slip at the peak; odd in slip.
    #[inline]
    #[must_use]
    pub fn friction(&self, relative_slip: T) -> T {
        self.peak * self.shape(relative_slip)
    }

    /// Friction over peak friction.
    #[must_use]
    pub fn shape(&self, x: T) -> T {
        let magnitude = x.abs();
        let falling = magnitude.value() > 1.0;
        let w = match (falling, self.rise, self.fall) {
            (false, Some(rise), _) => rational(magnitude, rise),
            (true, _, Some((fall, None))) => rational(magnitude, fall),
            (true, _, Some((fall, Some(stretch)))) => {
                rational((magnitude.ln() * stretch.exp()).exp(), fall)
            }
            _ => return x * 2.0 / (x.squared() + 1.0),
        };
        if x.value() < 0.0 { -w } else { w }
    }
}

fn rational<T: Number>(x: T, log_b: T) -> T {
    let b = (log_b.exp() - 1.0) * 2.0;
    (b + 2.0) * x / (b * x + x.squared() + 1.0)
}

/// The quantities of one run that mechanisms change, in chain order.
#[derive(Clone, Debug)]
pub struct State<T> {
    /// Wheel speed in rad/s.
    pub omega: Vec<T>,
    /// By what the wheel speed as read is off beyond the smoothed one, in rad/s, where it is.
    pub read_off: Option<Vec<T>>,
    /// Vehicle speed in m/s.
    pub speed: Vec<T>,
    /// Normal force in N.
    pub load: Vec<T>,
    /// Free-rolling radius in m where it is not the rig file's.
    pub radius: Option<Vec<T>>,
    /// Slip.
    pub slip: Vec<T>,
    /// Friction law.
    pub law: Law<T>,
    /// Factor on the slip at the peak, where it varies.
    pub critical_factor: Option<Vec<T>>,
    /// Factor on the peak friction, where it varies.
    pub peak_factor: Option<Vec<T>>,
    /// Friction coefficient.
    pub friction: Vec<T>,
    /// Force: in the contact, then as read.
    pub force: Vec<T>,
    /// Contact force as it was before the measuring chain (kept from stage `Contact`).
    pub contact: Option<Vec<T>>,
    /// What of the force in N is faster than the smoother leaves of it, where filters are asked what they make of all of it.
    pub fast_force: Vec<f64>,
    /// What of the reading in N follows from that.
    pub read_of_fast: Vec<T>,
    /// The force in N as it enters the filters between contact and reading, where there are such.
    pub entered: Option<Vec<T>>,
    /// Relative change of inertia (wheel) or mass (vehicle).
    pub inertia_change: T,
    /// Relative error of the drag channel's scale, at no force.
    pub gain_change: T,
    /// By how much that error grows with the reading's size, 1/N.
    pub gain_bend: T,
    /// Force on the vehicle (N) or torque on the wheel (N m) beside the base model's.
    pub opposing: Vec<T>,
    /// Brake torque in N m.
    pub brake: Vec<T>,
    /// Moment of the rolling resistance on the wheel in N m, where there is one.
    pub rolling_moment: Option<Vec<T>>,
}

impl<T: Number> State<T> {
    /// A state with nothing in it.
    #[must_use]
    pub fn empty() -> Self {
        let zero = T::constant(0.0);
        Self {
            omega: Vec::new(),
            read_off: None,
            speed: Vec::new(),
            load: Vec::new(),
            radius: None,
            slip: Vec::new(),
            law: Law::rudd(zero, zero),
            critical_factor: None,
            peak_factor: None,
            friction: Vec::new(),
            force: Vec::new(),
            contact: None,
            fast_force: Vec::new(),
            read_of_fast: Vec::new(),
            entered: None,
            inertia_change: zero,
            gain_change: zero,
            gain_bend: zero,
            opposing: Vec::new(),
            brake: Vec::new(),
            rolling_moment: None,
        }
    }
}

impl<T: Number> State<T> {
    /// What of a reading of the drag in N is the drag, by the error of the channel's scale, which is as bent either way.
    pub fn true_share(&self, reading: f64) -> T {
        T::constant(1.0) / (self.gain_bend * reading.abs() + self.gain_change + 1.0)
    }

    /// Multiplies the peak friction by a factor a sample.
    pub fn scale_friction(&mut self, factor: &[T]) {
        multiply(&mut self.peak_factor, factor);
    }
    /// Multiplies the slip at the peak by a factor a sample.
    pub fn scale_critical(&mut self, factor: &[T]) {
        multiply(&mut self.critical_factor, factor);
    }
}

fn multiply<T: Number>(into: &mut Option<Vec<T>>, factor: &[T]) {
    match into {
        Some(present) => {
            for (a, b) in present.iter_mut().zip(factor) {
                *a = *a * *b;
            }
        }
        None => *into = Some(factor.to_vec()),
    }
}
