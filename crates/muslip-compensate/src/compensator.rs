use muslip::filter::FrictionMeasurement;
use muslip::filter::mu_slip::State;
use muslip::law::Expansion;
use muslip::real::Real;
use muslip::sample::{Channel, RigSample, SampleError, SampleLimits, SlipFriction, slip_friction};

use super::config::Compensation;
use super::delay::{DelayLine, Planned};
use super::effect::Relaxation;
use super::error::{CompensationError, NoMeasurement, StepError};
use super::first_order::FirstOrder;

/// The smallest factor on friction that is compensated: beyond, a model says more than a reading can.
const SMALLEST_FACTOR: f64 = 0.02;

/// Friction beyond which a reading is no tyre's: it heats no tread.
const LARGEST_FRICTION: f64 = 3.0;

/// Slowest speed in m/s at which slip and force still relax: below it the tyre would never settle.
const SLOWEST_RELAXATION_M_S: f64 = 0.05;

/// What one step gives.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Compensated<T> {
    /// A measurement for the filter.
    Measurement(CompensatedMeasurement<T>),
    /// The sample was taken (hidden states moved on) and is no measurement.
    Nothing(NoMeasurement),
}

/// One measurement with what is known to distort it accounted for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CompensatedMeasurement<T> {
    /// The slip that the tyre felt when the reading was made, dimensionless, referred to the mean load
    /// where the slip at the peak changes with load.
    pub slip_ratio: T,
    /// Friction read, without what the measuring chain added, over [`Self::friction_factor`];
    /// dimensionless.
    pub friction: T,
    /// The known factor on friction at that instant, dimensionless, ≥ 0.02. Noise is divided by it too.
    pub friction_factor: T,
    /// Normal force when the reading was made, in N.
    pub normal_force_n: T,
    /// What [`Self::friction`] is expected to be at the filter's state, with its derivatives: the law at
    /// [`Self::slip_ratio`], behind the low-pass filters if there are any.
    pub expected: Expansion<T>,
}

impl<T: Real> CompensatedMeasurement<T> {
    /// The measurement as the filter takes it, from the standard deviation of drag over normal force.
    #[inline]
    pub fn measurement(&self, friction_std: T) -> FrictionMeasurement<T> {
        FrictionMeasurement {
            slip_ratio: self.slip_ratio,
            friction: self.friction,
            friction_std: friction_std / self.friction_factor,
        }
    }
}

/// Time since the first step, summed with a carry (W. Kahan, Comm. ACM 8 (1965) 40): single precision
/// alone would lose steps of a millisecond within hours.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Clock<T> {
    seconds: T,
    carry: T,
}

impl<T: Real> Clock<T> {
    fn advanced(self, dt_s: T) -> Self {
        let addend = dt_s - self.carry;
        let seconds = self.seconds + addend;
        Self {
            seconds,
            carry: (seconds - self.seconds) - addend,
        }
    }
}

/// What is carried from one step to the next, but for the delay line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Memory<T> {
    started: bool,
    clock: Clock<T>,
    /// Time since the last sample that came out of the delay line, in s.
    pending_s: T,
    /// Vehicle speed of that sample in m/s.
    vehicle_speed_m_s: T,
    /// Friction power of that sample in W.
    power_w: T,
    /// Temperature surrogate θ in s.
    temperature_s: T,
    slip: Option<FirstOrder<T, 1>>,
    /// The force in the contact: see [`tangent`].
    contact: Option<FirstOrder<T, 5>>,
    /// The same behind the drag channel's filter, and the channel's own additions.
    chain: Option<FirstOrder<T, 6>>,
}

impl<T: Real> Memory<T> {
    fn blank() -> Self {
        Self {
            started: false,
            clock: Clock {
                seconds: T::ZERO,
                carry: T::ZERO,
            },
            pending_s: T::ZERO,
            vehicle_speed_m_s: T::ZERO,
            power_w: T::ZERO,
            temperature_s: T::ZERO,
            slip: None,
            contact: None,
            chain: None,
        }
    }

    fn is_finite(&self) -> bool {
        [
            self.clock.seconds,
            self.pending_s,
            self.vehicle_speed_m_s,
            self.power_w,
            self.temperature_s,
        ]
        .into_iter()
        .all(T::is_finite)
            && self.slip.is_none_or(|lag| lag.is_finite())
            && self.contact.is_none_or(|lag| lag.is_finite())
            && self.chain.is_none_or(|lag| lag.is_finite())
    }
}

/// Compensation at work: the effects and their hidden states.
///
/// Made by [`Compensation::build`]. `N` is the number of samples that the delay line holds, 0 where no
/// delay is compensated. Memory is fixed: 4 N + some 40 numbers; no step allocates or panics.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Compensator<T, const N: usize> {
    compensation: Compensation<T>,
    declared_radius_m: T,
    limits: SampleLimits<T>,
    memory: Memory<T>,
    line: DelayLine<T, N>,
}

impl<T: Real> Compensation<T> {
    /// The compensator, before its first step, with room for `N` samples in its delay line.
    ///
    /// N may be 0 where no delay is compensated; else it must be at least
    /// ⌈[`delay_s`](crate::ForceDelay::delay_s)/[`sampling_step_s`](crate::ForceDelay::sampling_step_s)⌉ + 1, and more
    /// where the step jitters. `declared_radius_m` is the wheel's free-rolling radius in m, > 0, that
    /// relative errors refer to. Memory: 4 N + some 40 numbers.
    ///
    /// # Errors
    /// [`CompensationError::OutOfRange`] naming the first parameter outside its range,
    /// [`CompensationError::DelayDoesNotFit`].
    pub fn build<const N: usize>(
        self,
        declared_radius_m: T,
        limits: SampleLimits<T>,
    ) -> Result<Compensator<T, N>, CompensationError> {
        self.fits::<N>(declared_radius_m)?;
        Ok(Compensator::new(self, declared_radius_m, limits))
    }

    /// Whether [`Compensation::build`] would build it.
    ///
    /// # Errors
    /// Those of [`Compensation::build`].
    pub fn fits<const N: usize>(&self, declared_radius_m: T) -> Result<(), CompensationError> {
        self.check(declared_radius_m)
            .map_err(CompensationError::OutOfRange)?;
        let capacity = u32::try_from(N).unwrap_or(u32::MAX);
        if let Some(delay) = self.force_delay
            && delay.delay_s > T::ZERO
        {
            // A hair of tolerance, so that a delay of whole steps is not lost to rounding.
            let steps = delay.delay_s / delay.sampling_step_s * T::from_f64(1.0 - 1e-6);
            let room = T::from_f64(f64::from(capacity) - 1.0);
            let fits = steps <= room;
            if !fits {
                return Err(CompensationError::DelayDoesNotFit { capacity });
            }
        }
        Ok(())
    }
}

impl<T: Real, const N: usize> Compensator<T, N> {
    fn new(compensation: Compensation<T>, declared_radius_m: T, limits: SampleLimits<T>) -> Self {
        Self {
            compensation,
            declared_radius_m,
            limits,
            memory: Memory::blank(),
            line: DelayLine::empty(),
        }
    }

    /// What is compensated.
    pub fn compensation(&self) -> &Compensation<T> {
        &self.compensation
    }

    /// Compensates something else from its first step on. In place: the delay line may be large, and a copy of it
    /// needs as much stack.
    ///
    /// # Errors
    /// Those of [`Compensation::build`]; the compensator is exactly as it was before the call.
    pub fn replace(
        &mut self,
        compensation: &Compensation<T>,
        declared_radius_m: T,
        limits: SampleLimits<T>,
    ) -> Result<(), CompensationError> {
        compensation.fits::<N>(declared_radius_m)?;
        self.compensation = *compensation;
        self.declared_radius_m = declared_radius_m;
        self.limits = limits;
        self.reset();
        Ok(())
    }

    /// Back to before the first step.
    pub fn reset(&mut self) {
        self.memory = Memory::blank();
        self.line = DelayLine::empty();
    }

    /// Takes one sample and gives what the filter's update needs.
    ///
    /// | argument | meaning | unit | valid range |
    /// |---|---|---|---|
    /// | `sample` | the four channels at one instant, the drag as read | | finite |
    /// | `dt_s` | time since the last step that was taken | s | > 0; ≥ 0 and not used for the first |
    /// | `state` | the filter's present state | - | finite |
    ///
    /// Every sample counts, also at standstill: hidden states live on time and distance. Where a step is
    /// refused nothing has happened, and its time belongs to the next one.
    ///
    /// Equations: see the [crate](crate). Cost without effects: that of
    /// [`slip_friction`] and the law; each relaxation, lag and thermal state an exponential more.
    ///
    /// # Errors
    /// [`StepError`]; the compensator is exactly as it was before the call.
    pub fn step(
        &mut self,
        sample: &RigSample<T>,
        dt_s: T,
        state: &State<T>,
    ) -> Result<Compensated<T>, StepError> {
        for (value, channel) in [
            (sample.wheel_speed_rad_s, Channel::WheelSpeed),
            (sample.vehicle_speed_m_s, Channel::VehicleSpeed),
            (sample.drag_force_n, Channel::DragForce),
            (sample.normal_force_n, Channel::NormalForce),
        ] {
            if !value.is_finite() {
                return Err(StepError::NonFinite { channel });
            }
        }
        if !state.is_finite() {
            return Err(StepError::State);
        }
        let mut memory = self.memory;
        let dt_s = match (memory.started, dt_s) {
            (_, dt) if !dt.is_finite() => return Err(StepError::TimeStep),
            (true, dt) if dt > T::ZERO => dt,
            (false, dt) if dt >= T::ZERO => T::ZERO,
            _ => return Err(StepError::TimeStep),
        };
        let gap = self
            .compensation
            .longest_step_s
            .is_some_and(|longest| dt_s > longest);
        if gap {
            memory.slip = None;
            memory.contact = None;
            memory.chain = None;
        }
        memory.started = true;
        memory.clock = memory.clock.advanced(dt_s);
        memory.pending_s += dt_s;

        let delay_s = self.delay_s();
        let planned = if delay_s > T::ZERO {
            let inputs = [
                sample.wheel_speed_rad_s,
                sample.vehicle_speed_m_s,
                sample.normal_force_n,
            ];
            let planned = self.line.plan(delay_s, dt_s, inputs, gap);
            Some(planned.ok_or(StepError::DelayDoesNotFit)?)
        } else {
            None
        };
        let outcome = match planned.map(|planned| planned.delayed) {
            None => self.measured(sample, state, &mut memory)?,
            Some(Some([omega, v, fz])) => {
                let when_read = RigSample {
                    wheel_speed_rad_s: omega,
                    vehicle_speed_m_s: v,
                    normal_force_n: fz,
                    ..*sample
                };
                self.measured(&when_read, state, &mut memory)?
            }
            Some(None) => Compensated::Nothing(NoMeasurement::DelayLineFilling),
        };
        if !memory.is_finite() {
            return Err(StepError::Overflow);
        }
        self.commit(&memory, planned.as_ref());
        Ok(outcome)
    }

    fn commit(&mut self, memory: &Memory<T>, planned: Option<&Planned<T>>) {
        self.memory = *memory;
        if let Some(planned) = planned {
            self.line.commit(planned);
        }
    }

    fn delay_s(&self) -> T {
        self.compensation
            .force_delay
            .map_or(T::ZERO, |delay| delay.delay_s)
    }

    /// One sample whose channels belong to the same instant; `memory` moves on to it.
    fn measured(
        &self,
        sample: &RigSample<T>,
        state: &State<T>,
        memory: &mut Memory<T>,
    ) -> Result<Compensated<T>, StepError> {
        let effects = &self.compensation;
        let RigSample {
            wheel_speed_rad_s: omega,
            vehicle_speed_m_s: v,
            drag_force_n: reading,
            normal_force_n: fz,
        } = *sample;
        let dt_s = memory.pending_s;
        memory.pending_s = T::ZERO;

        let radius_m = effects
            .effective_radius
            .map_or(self.declared_radius_m, |radius| {
                self.declared_radius_m * radius.factor(fz, v)
            });
        let added_n = self.added_n(fz, memory.clock.seconds);
        let drag_n = reading - added_n;
        let read = RigSample {
            drag_force_n: drag_n,
            ..*sample
        };
        let point = slip_friction(&read, radius_m, &self.limits);
        let rolling = match point {
            Ok(_) | Err(SampleError::SlipOutOfRange) => true,
            Err(SampleError::LowSpeed | SampleError::LowNormalForce) => false,
            // A quotient that is not finite; the core may come to refuse more, and no state is made of that.
            Err(_) => return Err(StepError::Overflow),
        };
        let sliding_m_s = v - radius_m * omega;
        let slip_ratio = if rolling { sliding_m_s / v } else { T::ZERO };

        let mean_speed_m_s = T::HALF * (v.abs() + memory.vehicle_speed_m_s.abs());
        let distance_m = dt_s * mean_speed_m_s.max(T::from_f64(SLOWEST_RELAXATION_M_S));
        memory.vehicle_speed_m_s = v;
        let felt_slip = match effects.relaxation {
            Some(Relaxation::Slip { length_m }) if length_m > T::ZERO => {
                let lag = followed(memory.slip, distance_m / length_m, [slip_ratio]);
                memory.slip = Some(lag);
                let [felt] = lag.output();
                felt
            }
            _ => slip_ratio,
        };

        if let Some(thermal) = effects.thermal_fade {
            memory.temperature_s = thermal.warmed(memory.temperature_s, memory.power_w, dt_s);
            // An outlier of the load cell must not set the tread on fire.
            let most_n = T::from_f64(LARGEST_FRICTION) * fz;
            memory.power_w = if rolling {
                drag_n.max(-most_n).min(most_n) * sliding_m_s
            } else {
                T::ZERO
            };
        }
        let (factor, critical_factor) = if rolling {
            self.factors(felt_slip, v, fz, memory.temperature_s)
        } else {
            (T::ONE, T::ONE)
        };
        let law_slip = felt_slip / critical_factor;
        let law = state.expansion(law_slip);
        let force_n = if rolling { fz * factor } else { T::ZERO };
        let lagged = self.lagged(memory, &law, state, force_n, added_n, dt_s, distance_m);

        let SlipFriction { friction, .. } = match point {
            Ok(point) => point,
            Err(error) => return Ok(Compensated::Nothing(NoMeasurement::Sample(error))),
        };
        let (friction, expected) = match lagged {
            None => (friction / factor, law),
            Some((tangent, added_n)) => {
                let scale = T::ONE / force_n;
                (
                    (reading - added_n) * scale,
                    expansion(tangent, state, scale),
                )
            }
        };
        let sound = law_slip.is_finite() && friction.is_finite() && expected.is_finite();
        if !sound {
            return Err(StepError::Overflow);
        }
        Ok(Compensated::Measurement(CompensatedMeasurement {
            slip_ratio: law_slip,
            friction,
            friction_factor: factor,
            normal_force_n: fz,
            expected,
        }))
    }

    /// What the channel adds to the drag in N, `clock_s` after the first step.
    fn added_n(&self, normal_force_n: T, clock_s: T) -> T {
        let mut added = T::ZERO;
        if let Some(crosstalk) = self.compensation.load_crosstalk {
            added += crosstalk.share * normal_force_n;
        }
        if let Some(drift) = self.compensation.zero_drift {
            added += drift.zero_n(clock_s - self.delay_s());
        }
        added
    }

    /// Factors on friction and on the slip at the peak.
    fn factors(&self, slip_ratio: T, v: T, fz: T, temperature_s: T) -> (T, T) {
        let effects = &self.compensation;
        let (mut factor, mut critical) = (T::ONE, T::ONE);
        if let Some(load) = effects.load_sensitivity {
            (factor, critical) = load.factors(fz);
        }
        if let Some(speed) = effects.speed_sensitivity {
            factor *= speed.factor(slip_ratio, v);
        }
        if let Some(thermal) = effects.thermal_fade {
            factor *= thermal.factor(temperature_s);
        }
        (factor.max(T::from_f64(SMALLEST_FACTOR)), critical)
    }

    /// The tangent of the reading expected, in N, and the channel's additions, both behind the low-pass
    /// filters; `None` where there is no filter.
    #[expect(clippy::too_many_arguments, reason = "one step of the chain, private")]
    fn lagged(
        &self,
        memory: &mut Memory<T>,
        law: &Expansion<T>,
        state: &State<T>,
        force_n: T,
        added_n: T,
        dt_s: T,
        distance_m: T,
    ) -> Option<([T; 5], T)> {
        let effects = &self.compensation;
        let length_m = match effects.relaxation {
            Some(Relaxation::Force { length_m }) if length_m > T::ZERO => Some(length_m),
            _ => None,
        };
        let time_constant_s = effects
            .force_lag
            .map(|lag| lag.time_constant_s)
            .filter(|time_constant_s| *time_constant_s > T::ZERO);
        if length_m.is_none() && time_constant_s.is_none() {
            return None;
        }
        let mut tangent = tangent(law, state, force_n);
        if let Some(length_m) = length_m {
            let lag = followed(memory.contact, distance_m / length_m, tangent);
            memory.contact = Some(lag);
            tangent = lag.output();
        }
        let Some(time_constant_s) = time_constant_s else {
            return Some((tangent, added_n));
        };
        let [a, b, c, d, e] = tangent;
        let lag = followed(
            memory.chain,
            dt_s / time_constant_s,
            [a, b, c, d, e, added_n],
        );
        memory.chain = Some(lag);
        let [a, b, c, d, e, added_n] = lag.output();
        Some(([a, b, c, d, e], added_n))
    }
}

/// A lag after a step, or settled where it begins.
fn followed<T: Real, const C: usize>(
    lag: Option<FirstOrder<T, C>>,
    time_constants: T,
    input: [T; C],
) -> FirstOrder<T, C> {
    match lag {
        Some(lag) => lag.stepped(time_constants, input),
        None => FirstOrder::settled(input),
    }
}

/// The force of the law about the filter's state, in N: the force that the tangent reaches at the state
/// zero, then first and second derivatives.
///
/// The tangent rather than the value, because the state moves while the filter remembers: intercept and
/// slopes of past samples, lagged, give the reading expected at the present state.
fn tangent<T: Real>(law: &Expansion<T>, state: &State<T>, force_n: T) -> [T; 5] {
    let intercept = law.friction
        - law.by_peak_friction * state.peak_friction
        - law.by_critical_slip * state.critical_slip;
    [
        force_n * intercept,
        force_n * law.by_peak_friction,
        force_n * law.by_critical_slip,
        force_n * law.by_both,
        force_n * law.by_critical_slip_twice,
    ]
}

/// The inverse of [`tangent`], at another state and times `scale`.
fn expansion<T: Real>(tangent: [T; 5], state: &State<T>, scale: T) -> Expansion<T> {
    let [
        intercept,
        by_peak_friction,
        by_critical_slip,
        by_both,
        by_critical_slip_twice,
    ] = tangent;
    let force_n =
        intercept + by_peak_friction * state.peak_friction + by_critical_slip * state.critical_slip;
    Expansion {
        friction: scale * force_n,
        by_peak_friction: scale * by_peak_friction,
        by_critical_slip: scale * by_critical_slip,
        by_both: scale * by_both,
        by_critical_slip_twice: scale * by_critical_slip_twice,
    }
}
