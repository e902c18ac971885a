//! The true tyre: the two-parameter law, and whatever physics is concealed in the contact.

use crate::generate::effect::{Effect, Scale};
use crate::generate::form::Form;

/// Room for each effect's hidden state.
const SLOTS: usize = 18;
/// At most so many effects in one campaign.
pub const MOST_EFFECTS: usize = 3;
const BRUSH_CELLS: usize = 14;

/// What the contact sees at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    /// Time since the recording began, s.
    pub time: f64,
    pub speed: f64,
    pub wheel: f64,
    pub load: f64,
    pub angle: f64,
    pub distance: f64,
    /// The recorded extra column, scaled to order one.
    pub column: f64,
}

/// The tyre of one run.
#[derive(Clone)]
pub struct Tyre<'a> {
    effects: &'a [Effect],
    scale: Scale,
    peak_friction: f64,
    critical_slip: f64,
    run: f64,
    memory: Memory,
}

/// Hidden states, small enough to copy at every step.
#[derive(Clone, Copy)]
struct Memory {
    slots: [[f64; SLOTS]; MOST_EFFECTS],
    /// Slip and load one step ago; not a number before the first step.
    slip: f64,
    load: f64,
    /// Sliding energy and sliding distance of all runs so far.
    energy: f64,
    slid: f64,
    friction: f64,
}

/// Wear that a run hands to the next one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wear {
    pub energy: f64,
    pub slid: f64,
}

/// The two-parameter law at relative slip `x`, for unit peak friction.
pub fn law(x: f64) -> f64 {
    2.0 * x / (1.0 + x * x)
}

/// First-order approach: the share of the distance covered in `dt`.
fn approach(dt: f64, time_constant: f64) -> f64 {
    if time_constant <= 1e-12 {
        1.0
    } else {
        -(-dt / time_constant).exp_m1()
    }
}

impl<'a> Tyre<'a> {
    /// The tyre at the start of a run.
    pub fn new(
        effects: &'a [Effect],
        scale: Scale,
        truth: (f64, f64),
        run: usize,
        wear: Wear,
    ) -> Self {
        Tyre {
            effects,
            scale,
            peak_friction: truth.0,
            critical_slip: truth.1,
            run: run as f64,
            memory: Memory {
                slots: [[0.0; SLOTS]; MOST_EFFECTS],
                slip: f64::NAN,
                load: f64::NAN,
                energy: wear.energy,
                slid: wear.slid,
                friction: 0.0,
            },
        }
    }

    /// Wear so far.
    pub fn wear(&self) -> Wear {
        Wear {
            energy: self.memory.energy,
            slid: self.memory.slid,
        }
    }

    /// The rolling moment about the wheel's axle that does not pass through the brake, N m.
    pub fn rolling_moment(&self, contact: &Contact) -> f64 {
        let mut moment = 0.0;
        for effect in self.effects {
            if matches!(effect.form, Form::RollConstant | Form::RollSpeed) && effect.p[5] > 0.5 {
                moment += self.scale.radius * rolling(effect, contact, &self.scale);
            }
        }
        moment
    }

    /// Goes on by `dt` to a new instant and gives the drag there, in newton.
    pub fn advance(&mut self, dt: f64, contact: &Contact) -> f64 {
        if contact.speed < 0.05 {
            return 0.0;
        }
        let Tyre {
            effects,
            scale,
            memory,
            ..
        } = self;
        let mut radius = scale.radius;
        for effect in *effects {
            radius *= 1.0 + radius_change(effect, contact, scale);
        }
        let slip_now = (contact.speed - radius * contact.wheel) / contact.speed;
        let first = !memory.slip.is_finite();
        let since = |before: f64, now: f64| if first { 0.0 } else { now - before };
        let step = Step {
            dt,
            first,
            contact,
            scale,
            slip: since(memory.slip, slip_now),
            load: since(memory.load, contact.load),
            run: self.run,
            energy: memory.energy,
            slid: memory.slid,
        };
        memory.slip = slip_now;
        memory.load = contact.load;

        let mut slip = slip_now;
        for (effect, slots) in effects.iter().zip(memory.slots.iter_mut()) {
            slip = slip_dynamics(effect, slots, slip, &step);
        }
        let mut peak = self.peak_friction;
        let mut critical = self.critical_slip;
        for effect in *effects {
            let (peak_factor, critical_factor) = curve_scaling(effect, contact, scale);
            peak *= peak_factor;
            critical *= critical_factor;
        }
        let x = slip / critical;
        let mut friction = peak * law(x);
        for effect in *effects {
            friction += effect.a * peak * curve_change(effect, x, slip, critical);
        }
        let sliding = (contact.speed - radius * contact.wheel).abs();
        for (effect, slots) in effects.iter().zip(memory.slots.iter_mut()) {
            friction *= friction_factor(effect, slots, slip, sliding, &step);
        }
        let mut drag = friction * contact.load;
        for (effect, slots) in effects.iter().zip(memory.slots.iter_mut()) {
            if effect.form == Form::RelaxForce {
                slots[0] += step.share(effect.a) * (drag - slots[0]);
                drag = slots[0];
            }
        }
        // Heat and wear follow from the force just found.
        let power = (drag * sliding).max(0.0);
        memory.energy += power * dt;
        memory.slid += sliding * dt;
        memory.friction = friction;
        for (effect, slots) in effects.iter().zip(memory.slots.iter_mut()) {
            heat(effect, slots, power / scale.power, dt, contact, scale);
        }
        for effect in *effects {
            match effect.form {
                Form::RollConstant | Form::RollSpeed => drag += rolling(effect, contact, scale),
                Form::RunOutAdditive => {
                    drag += effect.a
                        * 0.5
                        * self.peak_friction
                        * contact.load
                        * (contact.angle + effect.p[0]).cos()
                }
                _ => {}
            }
        }
        drag
    }
}

fn rolling(effect: &Effect, contact: &Contact, scale: &Scale) -> f64 {
    match effect.form {
        Form::RollConstant => effect.a * contact.load,
        Form::RollSpeed => {
            effect.a * contact.load * (1.0 + effect.p[0] * (contact.speed / scale.speed).powi(2))
        }
        _ => 0.0,
    }
}

/// Relative change of the free-rolling radius.
pub fn radius_change(effect: &Effect, contact: &Contact, scale: &Scale) -> f64 {
    match effect.form {
        Form::RadiusConstant => effect.a,
        Form::RadiusLoad => effect.a * (effect.p[0] + contact.load / scale.load - 1.0),
        Form::RadiusSpeed => effect.a * (effect.p[0] + (contact.speed / scale.speed).powi(2) - 0.8),
        Form::RunOutRadius => effect.a * 0.3 * scale.critical * (contact.angle + effect.p[0]).cos(),
        _ => 0.0,
    }
}

/// Factors on peak friction and critical slip.
pub fn curve_scaling(effect: &Effect, contact: &Contact, scale: &Scale) -> (f64, f64) {
    let load = (contact.load / scale.load).max(1e-3);
    match effect.form {
        Form::LoadPower => (load.powf(-effect.a), 1.0),
        Form::LoadLinear => (1.0 - effect.a * (load - 1.0), 1.0),
        Form::LoadPowerStiff => (load.powf(-effect.a), load.powf(effect.a * effect.p[0])),
        Form::OutColumnFriction => ((1.0 + effect.a * contact.column).max(0.05), 1.0),
        Form::OutColumnSlip => (1.0, (1.0 + effect.a * contact.column).max(0.05)),
        Form::OutColumnSteer => (
            (1.0 - effect.a * contact.column * contact.column).max(0.05),
            1.0,
        ),
        _ => (1.0, 1.0),
    }
}

/// What the form's curve has beyond the two-parameter law, for unit peak friction.
fn curve_change(effect: &Effect, x: f64, slip: f64, critical: f64) -> f64 {
    let size = x.abs();
    let other = match effect.form {
        Form::CurveMagic => {
            let stretched = effect.p[2] * size;
            (effect.p[0] * (stretched - effect.p[1] * (stretched - stretched.atan())).atan()).sin()
        }
        Form::CurveBurckhardt => {
            let k = effect.p[0];
            let (linear, at_peak) = (k * (-k).exp(), 1.0 - (-k).exp() - k * (-k).exp());
            (1.0 - (-k * size).exp() - linear * size) / at_peak
        }
        Form::CurveBrush => {
            let stretched = size / effect.p[0];
            if stretched < 1.0 {
                3.0 * stretched - 3.0 * stretched * stretched + stretched.powi(3)
            } else {
                let beyond = (slip.abs() - critical * effect.p[0]).max(0.0);
                1.0 - effect.p[1] * (1.0 - (-beyond / effect.p[2]).exp())
            }
        }
        Form::CurveBroad => {
            let n = effect.p[0];
            n * size / (n - 1.0 + size.powf(n))
        }
        _ => return 0.0,
    };
    x.signum() * (other - law(size))
}

/// Static friction curve of the concealed tyre at a slip, at mean load and without any state.
pub fn static_curve(effects: &[Effect], truth: (f64, f64), slip: f64) -> f64 {
    let x = slip / truth.1;
    truth.0
        * (law(x)
            + effects
                .iter()
                .map(|effect| effect.a * curve_change(effect, x, slip, truth.1))
                .sum::<f64>())
}

/// From one instant to the next.
struct Step<'a> {
    dt: f64,
    /// There is no instant before.
    first: bool,
    contact: &'a Contact,
    scale: &'a Scale,
    /// By how much the wheel's slip and the load have changed.
    slip: f64,
    load: f64,
    /// What the tyre has behind it: runs, sliding energy, sliding distance.
    run: f64,
    energy: f64,
    slid: f64,
}

impl Step<'_> {
    /// How much of the way a lag of this length goes.
    fn share(&self, length: f64) -> f64 {
        if self.first {
            1.0
        } else {
            approach(self.dt, length / self.contact.speed)
        }
    }
}

/// Relaxation and play: what the contact's slip is, given the wheel's.
fn slip_dynamics(effect: &Effect, slots: &mut [f64; SLOTS], slip: f64, step: &Step<'_>) -> f64 {
    let Step {
        dt,
        first,
        contact,
        scale,
        ..
    } = *step;
    match effect.form {
        Form::RelaxSlip | Form::RelaxLoadSlip => {
            let length = if effect.form == Form::RelaxSlip {
                effect.a
            } else {
                slip_length(effect, slip, contact.load, scale)
            };
            slots[0] += step.share(length) * (slip - slots[0]);
            slots[0]
        }
        Form::RelaxBrush => {
            let cell = (3.0 * effect.a / BRUSH_CELLS as f64).max(1e-9);
            let mut sum = 0.0;
            let mut weight = 0.0;
            let mut upstream = 0.0;
            for (index, deflection) in slots.iter_mut().take(BRUSH_CELLS).enumerate() {
                let place = cell * (index + 1) as f64;
                let travel = contact.speed * dt;
                *deflection = if first {
                    slip * place
                } else {
                    (*deflection + travel * (slip + upstream / cell)) / (1.0 + travel / cell)
                };
                upstream = *deflection;
                sum += *deflection;
                weight += place;
            }
            sum / weight
        }
        Form::HysteresisPlay => {
            let half = effect.a * scale.critical;
            if first {
                slots[0] = slip;
            }
            slots[0] = slots[0].clamp(slip - half, slip + half);
            slots[0]
        }
        _ => slip,
    }
}

/// Relaxation length that grows with load and shrinks towards sliding.
pub fn slip_length(effect: &Effect, slip: f64, load: f64, scale: &Scale) -> f64 {
    let x = slip / scale.critical;
    effect.a * load / scale.load * (0.4 + 0.6 / (1.0 + x * x))
}

/// Everything that multiplies friction.
fn friction_factor(
    effect: &Effect,
    slots: &mut [f64; SLOTS],
    slip: f64,
    sliding: f64,
    step: &Step<'_>,
) -> f64 {
    let Step {
        dt,
        first,
        contact,
        scale,
        slip: slip_step,
        load: load_step,
        run,
        energy,
        slid,
    } = *step;
    let a = effect.a;
    let p = &effect.p;
    let rate = |slots: &mut [f64; SLOTS], step: f64, smoothing: f64| {
        let now = if first || dt <= 0.0 { 0.0 } else { step / dt };
        slots[0] += approach(dt, smoothing) * (now - slots[0]);
        slots[0]
    };
    let factor = match effect.form {
        Form::SpeedSlideExponential => (-a * sliding / scale.sliding).exp(),
        Form::SpeedVehicleLinear => 1.0 - a * (contact.speed / scale.speed - 1.0),
        Form::SpeedStribeck => 1.0 - a * -(-(sliding / (scale.sliding * p[1])).powf(p[0])).exp_m1(),
        Form::SpeedSlideRational => 1.0 / (1.0 + a * sliding / scale.sliding),
        Form::ThermalOneNode => 1.0 - a * slots[0],
        Form::ThermalTwoNode => 1.0 - a * (0.6 * slots[0] + 0.4 * slots[0] * slots[0]),
        Form::ThermalAirCooled => (-a * slots[0]).exp(),
        Form::PatchHard | Form::PatchSmooth | Form::PatchSeveral => {
            1.0 - a * patch(effect, contact.distance)
        }
        Form::WearEnergy => {
            (-a * energy / (0.25 * scale.power * scale.duration * scale.runs)).exp()
        }
        Form::WearRun => 1.0 - a * run.min(scale.runs - 1.0) / (scale.runs - 1.0).max(1.0),
        Form::WearDistance => {
            1.0 - a * -(-slid / (0.15 * scale.sliding * scale.duration * scale.runs)).exp_m1()
        }
        Form::HysteresisDahl => {
            let sign = slip_step.signum();
            slots[0] =
                sign + (slots[0] - sign) * (-slip_step.abs() / (p[0] * scale.critical)).exp();
            1.0 + a * slots[0]
        }
        Form::HysteresisSign => 1.0 + a * (rate(slots, slip_step, 0.006) / p[0]).tanh(),
        Form::RunOutLoad => {
            1.0 + a * ((contact.angle + p[0]).cos() + p[1] * (2.0 * contact.angle + p[2]).cos())
        }
        Form::OutBrakeTime => {
            if slip > 0.3 * scale.critical {
                slots[0] += dt;
            } else {
                slots[0] = 0.0;
            }
            1.0 - a * (-slots[0] / p[0]).exp()
        }
        Form::OutSlipBand => 1.0 + a * (-((slip / scale.critical - p[0]) / p[1]).powi(2)).exp(),
        Form::OutSlipRate => 1.0 + a * (rate(slots, slip_step, 0.006) / p[0]).clamp(-1.5, 1.5),
        Form::OutTrackWave => {
            1.0 + a * (std::f64::consts::TAU * contact.distance / p[0] + p[1]).sin()
        }
        Form::OutLoadRate => {
            1.0 + a * (rate(slots, load_step, 0.006) / (p[0] * scale.load)).clamp(-1.5, 1.5)
        }
        Form::OutTimeStep => 1.0 + if contact.time > p[0] { a } else { 0.0 },
        _ => 1.0,
    };
    factor.max(0.02)
}

/// Tread temperature, scaled so that steady ordinary braking gives one.
fn heat(
    effect: &Effect,
    slots: &mut [f64; SLOTS],
    power: f64,
    dt: f64,
    contact: &Contact,
    scale: &Scale,
) {
    let p = &effect.p;
    match effect.form {
        Form::ThermalOneNode => slots[0] += approach(dt, p[0]) * (power - slots[0]),
        Form::ThermalTwoNode => {
            let surface = slots[0];
            slots[0] += dt / p[0] * (power - (surface - slots[1]));
            slots[1] += dt / p[1] * ((surface - slots[1]) * 2.0 * p[2] - slots[1]);
        }
        Form::ThermalAirCooled => {
            slots[0] += dt / p[0] * (power - slots[0] * 0.5 * (1.0 + contact.speed / scale.speed))
        }
        _ => {}
    }
}

/// How much of the patch is under the wheel.
pub fn patch(effect: &Effect, distance: f64) -> f64 {
    let p = &effect.p;
    match effect.form {
        Form::PatchHard => f64::from(u8::from((p[0]..p[1]).contains(&distance))),
        Form::PatchSmooth => {
            0.5 * (((distance - p[0]) / p[2]).tanh() - ((distance - p[1]) / p[2]).tanh())
        }
        Form::PatchSeveral => {
            let one = f64::from(u8::from((p[0]..p[1]).contains(&distance)));
            let two = f64::from(u8::from((p[2]..p[3]).contains(&distance)));
            one + p[4] * two
        }
        _ => 0.0,
    }
}
