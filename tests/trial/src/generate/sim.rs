//! The true rig in motion: wheel and vehicle integrated by Heun's rule at ten times the recording
//! rate or finer, with the brake, its controller and the tyre in the loop.

use crate::draw::Draw;
use crate::generate::effect::{Effect, Scale};
use crate::generate::form::Form;
use crate::generate::plan::{RunPlan, through};
use crate::generate::rig::{Actuation, Rig};
use crate::generate::tyre::{Contact, Tyre, Wear};

/// One unbroken stretch of a run on the fine grid.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// Time since the recording began at the first point, s.
    pub start: f64,
    pub dt: f64,
    pub speed: Vec<f64>,
    pub wheel: Vec<f64>,
    pub load: Vec<f64>,
    pub drag: Vec<f64>,
    /// Torque of the brake on the wheel.
    pub torque: Vec<f64>,
    /// Torque that the pressure stands for.
    pub command: Vec<f64>,
    pub angle: Vec<f64>,
    pub distance: Vec<f64>,
    pub column: Vec<f64>,
}

impl Stretch {
    /// Points on the fine grid.
    pub fn len(&self) -> usize {
        self.speed.len()
    }

    /// The last instant.
    pub fn end(&self) -> f64 {
        self.start + self.dt * self.len().saturating_sub(1) as f64
    }
}

/// A recorded column beyond the contract's own, scaled to order one.
#[derive(Clone, Debug)]
pub struct ColumnSignal {
    pub level: f64,
    pub waves: [(f64, f64, f64); 2],
}

impl ColumnSignal {
    /// A slow signal with a level of its own for this run.
    pub fn draw(duration: f64, draw: &mut Draw) -> Self {
        let wave = |draw: &mut Draw, size: f64| {
            (
                size * draw.between(0.5, 1.0),
                draw.between(0.6, 2.2) / duration,
                draw.between(0.0, std::f64::consts::TAU),
            )
        };
        ColumnSignal {
            level: draw.between(-0.9, 0.9),
            waves: [wave(draw, 0.5), wave(draw, 0.2)],
        }
    }

    /// The value at a time.
    pub fn at(&self, time: f64) -> f64 {
        self.level
            + self
                .waves
                .iter()
                .map(|(size, hz, phase)| size * (std::f64::consts::TAU * hz * time + phase).sin())
                .sum::<f64>()
    }
}

/// What a run needs beside its plan.
pub struct Setting<'a> {
    pub rig: &'a Rig,
    pub effects: &'a [Effect],
    pub scale: Scale,
    pub run: usize,
    pub wear: Wear,
    pub column: Option<&'a ColumnSignal>,
    /// Noise of wheel and vehicle speed that a slip controller sees, one pair a sample.
    pub seen_noise: &'a [(f64, f64)],
    /// Relative change of peak friction in this run.
    pub friction: f64,
}

/// A run as it truly went.
pub struct Motion {
    pub stretches: Vec<Stretch>,
    pub wear: Wear,
    /// The wheel locked under a brake: the torque was then the tyre's, not the pressure's.
    pub locked: bool,
    /// Largest relative loss of brake torque.
    pub torque_loss: f64,
}

/// Runs one plan.
pub fn run(plan: &RunPlan, setting: &Setting) -> Motion {
    let rig = setting.rig;
    let mut stretches = Vec::new();
    let mut start = 0.0;
    if plan.standstill_s > 0.0 {
        stretches.push(standstill(plan, setting));
        start = plan.standstill_s + 3.0;
    }
    let slowest = if rig.coasting {
        rig.mean_speed_m_s * 0.14
    } else {
        plan.speed.iter().map(|k| k.1).fold(f64::INFINITY, f64::min)
    };
    let slowest = slowest.max(rig.slowest_m_s());
    let stiffness = rig.radius_m.powi(2) * plan.load_n * 2.0 * rig.peak_friction
        / (rig.critical_slip * rig.inertia_kg_m2 * slowest);
    let period = 1.0 / rig.rate_hz;
    let substeps = match rig.actuation {
        Actuation::Servo => 10,
        Actuation::Brake => (stiffness * period / 0.25).ceil().clamp(10.0, 150.0) as usize,
    };
    let mut rider = Rider::new(
        plan,
        setting,
        start,
        period / substeps as f64,
        substeps,
        slowest,
    );
    let steps = (plan.duration_s * rig.rate_hz) as usize * substeps;
    for step in 0..steps {
        if !rider.step(step) {
            break;
        }
    }
    rider.finish(&mut stretches)
}

fn standstill(plan: &RunPlan, setting: &Setting) -> Stretch {
    let dt = 0.1 / setting.rig.rate_hz;
    let mut stretch = Stretch {
        start: 0.0,
        dt,
        ..Stretch::default()
    };
    let points = (plan.standstill_s / dt) as usize;
    for index in 0..points {
        let time = index as f64 * dt;
        stretch.push(
            0.0,
            0.0,
            plan.load_n * (1.0 + 0.002 * (6.0 * time).sin()),
            0.0,
            0.0,
            0.0,
            plan.angle_rad,
            0.0,
        );
        stretch
            .column
            .push(setting.column.map_or(0.0, |column| column.at(time)));
    }
    stretch
}

impl Stretch {
    #[expect(clippy::too_many_arguments, reason = "one value for each channel")]
    fn push(
        &mut self,
        speed: f64,
        wheel: f64,
        load: f64,
        drag: f64,
        torque: f64,
        command: f64,
        angle: f64,
        distance: f64,
    ) {
        self.speed.push(speed);
        self.wheel.push(wheel);
        self.load.push(load);
        self.drag.push(drag);
        self.torque.push(torque);
        self.command.push(command);
        self.angle.push(angle);
        self.distance.push(distance);
    }
}

/// The rig between two instants.
struct Rider<'a> {
    plan: &'a RunPlan,
    setting: &'a Setting<'a>,
    tyre: Tyre<'a>,
    stretch: Stretch,
    substeps: usize,
    slowest: f64,
    speed: f64,
    wheel: f64,
    angle: f64,
    distance: f64,
    drag: f64,
    transfer: f64,
    ordered: f64,
    servo_error: f64,
    command: f64,
    torque: f64,
    brake: Brake,
    locked: bool,
    gain: f64,
    smoothing: f64,
}

/// Hidden states of the brake.
#[derive(Clone, Debug, Default)]
struct Brake {
    first: f64,
    second: f64,
    waiting: std::collections::VecDeque<f64>,
    heat: f64,
    worst_loss: f64,
}

impl<'a> Rider<'a> {
    fn new(
        plan: &'a RunPlan,
        setting: &'a Setting<'a>,
        start: f64,
        dt: f64,
        substeps: usize,
        slowest: f64,
    ) -> Self {
        let rig = setting.rig;
        let speed = through(&plan.speed, 0.0);
        let ordered = through(&plan.slip, 0.0);
        let tyre = Tyre::new(
            setting.effects,
            setting.scale,
            (
                rig.peak_friction * (1.0 + setting.friction),
                rig.critical_slip,
            ),
            setting.run,
            setting.wear,
        );
        let runaway = 0.25 * rig.radius_m.powi(2) * plan.load_n * rig.peak_friction
            / (rig.critical_slip * rig.inertia_kg_m2 * slowest);
        Rider {
            plan,
            setting,
            tyre,
            stretch: Stretch {
                start,
                dt,
                ..Stretch::default()
            },
            substeps,
            slowest,
            speed,
            wheel: speed * (1.0 - ordered) / rig.radius_m,
            angle: plan.angle_rad,
            distance: 0.0,
            drag: 0.0,
            transfer: 0.0,
            ordered,
            servo_error: 0.0,
            command: 0.0,
            torque: 0.0,
            brake: Brake::default(),
            locked: false,
            gain: 40.0 + 0.4 * runaway,
            smoothing: (0.15 / runaway).clamp(3e-4, 4e-3),
        }
    }

    fn load(&self, time: f64) -> f64 {
        let plan = self.plan;
        let bounce: f64 = plan
            .bounce
            .iter()
            .map(|(size, hz, phase)| size * (std::f64::consts::TAU * hz * time + phase).sin())
            .sum();
        plan.load_n * (through(&plan.load_steps, time) + bounce)
            + plan.weight_transfer * self.transfer
    }

    fn contact(&self, time: f64, speed: f64, wheel: f64) -> Contact {
        let recorded = time + self.stretch.start;
        Contact {
            time: recorded,
            speed,
            wheel,
            load: self.load(time),
            angle: self.angle,
            distance: self.distance,
            column: self
                .setting
                .column
                .map_or(0.0, |column| column.at(recorded)),
        }
    }

    /// One fine step; false when the vehicle has become too slow to go on.
    fn step(&mut self, step: usize) -> bool {
        let rig = self.setting.rig;
        let dt = self.stretch.dt;
        let time = step as f64 * dt;
        if step == 0 {
            let contact = self.contact(0.0, self.speed, self.wheel);
            self.drag = self.tyre.advance(0.0, &contact);
            if rig.actuation == Actuation::Brake {
                self.command = (rig.radius_m * self.drag).max(0.0);
                self.brake.first = self.command;
                self.brake.second = self.command;
                self.torque = self.command;
            }
        }
        self.record(time);
        if rig.coasting && self.speed < self.slowest {
            return false;
        }
        let next = time + dt;
        let ordered_before = self.ordered;
        self.ordered += -(-dt / self.plan.slip_smoothing_s).exp_m1()
            * (through(&self.plan.slip, next) - self.ordered);
        let slip_rate = (self.ordered - ordered_before) / dt;
        self.transfer += -(-dt / 0.12).exp_m1() * (self.drag - self.transfer);

        let deceleration = self.deceleration(self.drag, self.speed);
        let held =
            |time: f64| through(&self.plan.speed, time) * (1.0 + 0.0015 * (1.7 * time).sin());
        let speed_guess = if rig.coasting {
            self.speed - dt * deceleration
        } else {
            held(next)
        };
        let speed_rate = if rig.coasting {
            -deceleration
        } else {
            (speed_guess - self.speed) / dt
        };
        let sample = step / self.substeps;
        let (seen_wheel, seen_speed) = if rig.feedback {
            self.setting
                .seen_noise
                .get(sample)
                .copied()
                .unwrap_or((0.0, 0.0))
        } else {
            (0.0, 0.0)
        };
        match rig.actuation {
            Actuation::Servo => {
                let seen = seen_wheel - seen_speed * (1.0 - self.ordered) / rig.radius_m;
                self.servo_error += -(-dt * 60.0).exp_m1() * (-seen - self.servo_error);
                let wheel_next =
                    speed_guess * (1.0 - self.ordered) / rig.radius_m + self.servo_error;
                let contact = self.contact(next, speed_guess, wheel_next);
                let mut trial = self.tyre.clone();
                let drag_guess = trial.advance(dt, &contact);
                let speed_next = if rig.coasting {
                    self.speed
                        - 0.5 * dt * (deceleration + self.deceleration(drag_guess, speed_guess))
                } else {
                    speed_guess
                };
                let wheel_next =
                    speed_next * (1.0 - self.ordered) / rig.radius_m + self.servo_error;
                self.move_to(next, speed_next, wheel_next);
            }
            Actuation::Brake => {
                let wanted = self.speed * (1.0 - self.ordered) / rig.radius_m;
                let wanted_rate =
                    (speed_rate * (1.0 - self.ordered) - self.speed * slip_rate) / rig.radius_m;
                let seen =
                    self.wheel + seen_wheel - seen_speed * (1.0 - self.ordered) / rig.radius_m;
                let needed = rig.radius_m * self.drag - rig.inertia_kg_m2 * wanted_rate
                    + rig.inertia_kg_m2 * self.gain * (seen - wanted);
                let most = 3.0 * rig.radius_m * self.setting.scale.drag;
                self.command +=
                    -(-dt / self.smoothing).exp_m1() * (needed.clamp(0.0, most) - self.command);
                let torque_next = self.brake_torque(dt);
                let inertia = self.inertia(self.wheel);
                let accelerate =
                    |rider: &Self, drag: f64, torque: f64, contact: &Contact, wheel: f64| {
                        (rig.radius_m * drag
                            - torque
                            - rider.tyre.rolling_moment(contact)
                            - rider.losses(contact, wheel))
                            / inertia
                    };
                let here = self.contact(time, self.speed, self.wheel);
                let rate = accelerate(self, self.drag, self.torque, &here, self.wheel);
                let wheel_guess = (self.wheel + dt * rate).max(0.0);
                let contact = self.contact(next, speed_guess, wheel_guess);
                let mut trial = self.tyre.clone();
                let drag_guess = trial.advance(dt, &contact);
                let rate_guess = accelerate(self, drag_guess, torque_next, &contact, wheel_guess);
                let mut wheel_next = self.wheel + 0.5 * dt * (rate + rate_guess);
                let speed_next = if rig.coasting {
                    self.speed
                        - 0.5 * dt * (deceleration + self.deceleration(drag_guess, speed_guess))
                } else {
                    speed_guess
                };
                self.torque = torque_next;
                if wheel_next <= 0.0 {
                    wheel_next = 0.0;
                    self.locked = true;
                }
                self.move_to(next, speed_next, wheel_next);
                if wheel_next == 0.0 {
                    self.torque = rig.radius_m * self.drag;
                }
            }
        }
        true
    }

    fn move_to(&mut self, time: f64, speed: f64, wheel: f64) {
        let dt = self.stretch.dt;
        self.angle += 0.5 * dt * (self.wheel + wheel);
        self.distance += 0.5 * dt * (self.speed + speed);
        self.speed = speed;
        self.wheel = wheel;
        let contact = self.contact(time, speed, wheel);
        self.drag = self.tyre.advance(dt, &contact);
    }

    fn record(&mut self, time: f64) {
        let contact = self.contact(time, self.speed, self.wheel);
        self.stretch.push(
            self.speed,
            self.wheel,
            contact.load,
            self.drag,
            self.torque,
            self.command,
            self.angle,
            self.distance,
        );
        self.stretch.column.push(contact.column);
    }

    /// m dv/dt = -(drag + what else slows the vehicle).
    fn deceleration(&self, drag: f64, speed: f64) -> f64 {
        let scale = &self.setting.scale;
        let mut mass = self.setting.rig.mass_kg;
        let mut force = drag;
        let column = self.setting.column.map_or(0.0, |column| {
            column.at(self.stretch.start + self.stretch.dt * self.stretch.len() as f64)
        });
        for effect in self.setting.effects {
            match effect.form {
                Form::AeroStill => force += effect.a * scale.drag * (speed / scale.speed).powi(2),
                Form::AeroHeadwind => {
                    force += effect.a * scale.drag * ((speed + effect.p[0]) / scale.speed).powi(2)
                }
                Form::GradeConstant => force += effect.a * scale.drag,
                Form::GradeDrive => force -= effect.a * scale.drag,
                Form::MassConstant => mass *= 1.0 + effect.a,
                Form::MassFuel => {
                    mass *= (1.0 + effect.a)
                        * (1.0 - effect.p[0] * (self.setting.run as f64 / scale.runs - 0.5))
                }
                Form::OutColumnWind => force += effect.a * scale.drag * column,
                _ => {}
            }
        }
        force / mass
    }

    fn inertia(&self, wheel: f64) -> f64 {
        let scale = &self.setting.scale;
        let mut inertia = self.setting.rig.inertia_kg_m2;
        for effect in self.setting.effects {
            match effect.form {
                Form::InertiaConstant => inertia *= 1.0 + effect.a,
                Form::InertiaGrowth => {
                    inertia *=
                        1.0 + effect.a * (0.7 + 0.3 * (wheel * scale.radius / scale.speed).powi(2))
                }
                _ => {}
            }
        }
        inertia
    }

    /// Torque that slows the wheel beside brake and tyre.
    fn losses(&self, contact: &Contact, wheel: f64) -> f64 {
        let scale = &self.setting.scale;
        let torque = scale.radius * scale.drag;
        let turning = (wheel * scale.radius / (0.01 * scale.speed)).tanh();
        self.setting
            .effects
            .iter()
            .map(|effect| turning * bearing(effect, contact, wheel, torque, scale))
            .sum()
    }

    /// Torque of the brake after `dt`, given the pressure.
    fn brake_torque(&mut self, dt: f64) -> f64 {
        let scale = &self.setting.scale;
        let mut torque = self.command;
        for effect in self.setting.effects {
            let (a, p) = (effect.a.abs(), &effect.p);
            let brake = &mut self.brake;
            let towards = |from: &mut f64, to: f64, time_constant: f64| {
                *from += if time_constant <= 1e-9 {
                    1.0
                } else {
                    -(-dt / time_constant).exp_m1()
                } * (to - *from);
                *from
            };
            match effect.form {
                Form::BrakeLagOne => torque = towards(&mut brake.first, torque, a),
                Form::BrakeLagTwo => {
                    let middle = towards(&mut brake.first, torque, a * p[0]);
                    torque = towards(&mut brake.second, middle, a * (1.0 - p[0]));
                }
                Form::BrakeLagDead => {
                    brake.waiting.push_back(torque);
                    let wait = (a * p[0] / dt) as usize;
                    let late = if brake.waiting.len() > wait {
                        brake.waiting.pop_front().unwrap_or(torque)
                    } else {
                        brake.first
                    };
                    torque = towards(&mut brake.first, late, a * (1.0 - p[0]));
                }
                Form::FadeTemperature | Form::FadeEnergy => {
                    let loss = -a * (-brake.heat).exp_m1();
                    brake.worst_loss = brake.worst_loss.max(loss);
                    torque *= 1.0 - loss;
                    let typical = scale.radius * scale.drag * scale.speed / scale.radius;
                    brake.heat += dt / p[0] * (torque * self.wheel / typical);
                    if effect.form == Form::FadeTemperature {
                        brake.heat -= dt / p[1] * brake.heat;
                    }
                }
                Form::OutDiscWave => torque *= 1.0 + a * (self.angle + p[0]).cos(),
                _ => {}
            }
        }
        torque
    }

    fn finish(mut self, stretches: &mut Vec<Stretch>) -> Motion {
        let rig = self.setting.rig;
        if rig.actuation == Actuation::Servo {
            let acceleration = derivative(&self.stretch.wheel, self.stretch.dt);
            for (index, rate) in acceleration.iter().enumerate() {
                let stretch = &self.stretch;
                let contact = Contact {
                    speed: stretch.speed[index],
                    load: stretch.load[index],
                    column: stretch.column[index],
                    ..Contact::default()
                };
                let wheel = stretch.wheel[index];
                let torque = rig.radius_m * stretch.drag[index]
                    - self.inertia(wheel) * rate
                    - self.tyre.rolling_moment(&contact)
                    - self.losses(&contact, wheel);
                self.stretch.torque[index] = torque;
                self.stretch.command[index] = torque;
            }
        }
        stretches.push(self.stretch);
        Motion {
            stretches: std::mem::take(stretches),
            wear: self.tyre.wear(),
            locked: self.locked,
            torque_loss: self.brake.worst_loss,
        }
    }
}

/// Bearing and seal losses of one effect, N m.
pub fn bearing(effect: &Effect, contact: &Contact, wheel: f64, torque: f64, scale: &Scale) -> f64 {
    match effect.form {
        Form::BearingConstant => effect.a * torque,
        Form::BearingSpeed => effect.a * torque * (0.3 + 0.7 * wheel * scale.radius / scale.speed),
        Form::BearingLoad => effect.a * torque * contact.load / scale.load,
        Form::OutColumnOil => effect.a * torque * contact.column,
        _ => 0.0,
    }
}

/// Central differences.
pub fn derivative(values: &[f64], dt: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|index| {
            let (a, b) = (index.saturating_sub(1), (index + 1).min(last));
            if a == b {
                0.0
            } else {
                (values[b] - values[a]) / (dt * (b - a) as f64)
            }
        })
        .collect()
}
