//! What the sensors read: a wheel that follows its brake, and everything that can be wrong with it.

use muslip_control::board::{BridgeQuality, BridgeReading, EncoderReading, RawSample};
use muslip_control::brake::BrakeOutput;
use muslip_record::Parameters;

use crate::random::Random;

#[derive(Default)]
struct Encoder {
    pulses: f64,
    edge_s: f64,
}

impl Encoder {
    fn turn(&mut self, now_s: f64, rate: f64) -> EncoderReading {
        let end = self.pulses + rate * 1e-3;
        if end.floor() > self.pulses.floor() {
            self.edge_s = now_s - (end - end.floor()) / rate;
        }
        self.pulses = end;
        let ticks = |s: f64| (s * 84e6) as u64 as u32;
        EncoderReading {
            edges: (self.pulses as u64 * 2 + 1) as u16,
            edge_ticks: ticks(self.edge_s),
            age_ticks: ticks(now_s).wrapping_sub(ticks(self.edge_s)),
        }
    }
}

/// Something that is wrong for a while.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Trouble {
    Stop([bool; 2]),
    Quality(BridgeQuality),
    Supply(u16),
    Pressure(u16),
    Late,
    Code(usize, i32),
    Wheel(EncoderReading),
    Vehicle(EncoderReading),
    Holds(bool),
    Standing,
}

pub struct Rig {
    wheel: Encoder,
    vehicle: Encoder,
    vehicle_m_s: f64,
    slip: f64,
    samples: u64,
    trouble: Option<(Trouble, u64)>,
    pressed: bool,
    /// Mean samples between two troubles.
    calm: u64,
}

impl Rig {
    pub fn new(random: &mut Random) -> Self {
        Self {
            wheel: Encoder::default(),
            vehicle: Encoder::default(),
            vehicle_m_s: random.one_of(&[0.0, 10.0, 20.0, 20.0, 20.0, 20.0]),
            slip: 0.0,
            samples: 0,
            trouble: None,
            pressed: false,
            calm: random.one_of(&[50, 500, 3_000, u64::MAX]),
        }
    }

    pub fn stand(&mut self, stands: bool) {
        self.vehicle_m_s = if stands { 0.0 } else { 20.0 };
    }

    /// The next sample, under what the valves were told.
    pub fn sample(
        &mut self,
        random: &mut Random,
        output: BrakeOutput,
        parameters: &Parameters,
    ) -> RawSample {
        self.samples += 1;
        let brake = &parameters.brake;
        let duty = f64::from(output.valve_duty) / 65535.0;
        let demand = if output.hold_pressure {
            (duty - f64::from(brake.duty_at_zero))
                / f64::from(brake.duty_at_full - brake.duty_at_zero)
        } else {
            0.0
        };
        let target = if demand > 0.4 { 0.95 } else { demand * 0.3 };
        self.slip += (target - self.slip).clamp(-0.02, 0.02);
        let raw = self.well(random, output, demand, parameters);
        self.worse(random, raw)
    }

    fn well(
        &mut self,
        random: &mut Random,
        output: BrakeOutput,
        demand: f64,
        parameters: &Parameters,
    ) -> RawSample {
        let now_s = self.samples as f64 * 1e-3;
        let rate = |m_s: f64, radius_m: f32, pulses: u16| {
            m_s / f64::from(radius_m) / std::f64::consts::TAU * f64::from(pulses)
        };
        let wheel_m_s = self.vehicle_m_s * (1.0 - self.slip);
        let wheel_rate = rate(
            wheel_m_s,
            parameters.wheel.effective_radius_m,
            parameters.wheel_encoder.pulses_per_revolution,
        );
        let vehicle_rate = rate(
            self.vehicle_m_s,
            parameters.vehicle_encoder_radius_m,
            parameters.vehicle_encoder.pulses_per_revolution,
        );
        let normal_n = 4120.0 + 40.0 * random.share();
        let ratio = self.slip / 0.14;
        let drag_n = normal_n * 1.7 * ratio / (1.0 + ratio * ratio) + 60.0 * random.share();
        let code = |force_n: f64, newton_per_code: f32, zero_code: i32| {
            let code = force_n / f64::from(newton_per_code) + f64::from(zero_code);
            code.clamp(-8_388_608.0, 8_388_607.0) as i32
        };
        if random.once_in(60) {
            self.pressed = !self.pressed;
        }
        let (drag, normal) = (&parameters.drag, &parameters.normal);
        RawSample {
            wheel: self.wheel.turn(now_s, wheel_rate),
            vehicle: self.vehicle.turn(now_s, vehicle_rate),
            bridge: BridgeReading {
                codes: [
                    code(drag_n, drag.newton_per_code, drag.zero_code),
                    code(normal_n, normal.newton_per_code, normal.zero_code),
                ],
                quality: BridgeQuality::Fresh,
            },
            supply_mv: 24_000,
            pressure_mv: pressure_mv(demand, parameters),
            emergency_stop: [(2..5).contains(&self.samples); 2],
            holds: output.hold_pressure,
            confirm: self.pressed,
            late: false,
        }
    }

    fn worse(&mut self, random: &mut Random, mut raw: RawSample) -> RawSample {
        if let Some((_, left)) = &mut self.trouble {
            *left -= 1;
        }
        self.trouble = self.trouble.filter(|&(_, left)| left > 0);
        if self.trouble.is_none() && random.once_in(self.calm) {
            let samples = 1 + random.one_of(&[1, 3, 30, 300]);
            self.trouble = Some((trouble(random), samples));
        }
        match self.trouble.map(|(trouble, _)| trouble) {
            None => {}
            Some(Trouble::Stop(open)) => raw.emergency_stop = open,
            Some(Trouble::Quality(quality)) => raw.bridge.quality = quality,
            Some(Trouble::Supply(mv)) => raw.supply_mv = mv,
            Some(Trouble::Pressure(mv)) => raw.pressure_mv = mv,
            Some(Trouble::Late) => raw.late = true,
            Some(Trouble::Code(channel, code)) => raw.bridge.codes[channel] = code,
            Some(Trouble::Wheel(reading)) => raw.wheel = reading,
            Some(Trouble::Vehicle(reading)) => raw.vehicle = reading,
            Some(Trouble::Holds(level)) => raw.holds = level,
            Some(Trouble::Standing) => self.slip = 1.0,
        }
        raw
    }
}

/// The pressure transmitter's mV in a line that follows at once.
fn pressure_mv(demand: f64, parameters: &Parameters) -> u16 {
    let pressure = &parameters.pressure;
    let zero = f64::from(pressure.volt_at_zero);
    let span = f64::from(pressure.volt_at_full) - zero;
    (1000.0 * (zero + span * demand)) as u16
}

fn trouble(random: &mut Random) -> Trouble {
    let reading = EncoderReading {
        edges: random.bits() as u16,
        edge_ticks: random.bits() as u32,
        age_ticks: random.bits() as u32,
    };
    match random.below(11) {
        0 => Trouble::Stop(random.one_of(&[[true; 2], [true, false], [false, true]])),
        1 => Trouble::Quality(random.one_of(&[BridgeQuality::Bad, BridgeQuality::Stale])),
        2 => Trouble::Supply(random.below(24_000) as u16),
        3 => Trouble::Late,
        4 | 5 => Trouble::Code(
            random.below(2) as usize,
            random.below(1 << 24) as i32 - (1 << 23),
        ),
        6 => Trouble::Wheel(reading),
        7 => Trouble::Vehicle(reading),
        8 => Trouble::Holds(random.once_in(2)),
        9 => Trouble::Pressure(random.below(4_000) as u16),
        _ => Trouble::Standing,
    }
}
