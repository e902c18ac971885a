//! The rig simulator behind the sensors' counts and codes, and in front of the valves.

use anyhow::{Result, anyhow};
use host_sim::{Plant, PlantParameters, RigLaw};
use muslip_control::board::{BridgeQuality, BridgeReading, EncoderReading, RawSample};
use muslip_control::brake::BrakeOutput;
use muslip_record::Parameters;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::target::RATES;

/// Steps of the simulator in a sample.
const STEPS: u32 = 10;
const SAMPLE_S: f64 = 1e-3;
/// Hydraulics: first-order lag towards the demand, and the dump valve's.
const LAG_S: f64 = 0.015;
const DUMP_LAG_S: f64 = 0.005;
/// 1-sigma noise of the bridges in N.
const DRAG_NOISE_N: f64 = 60.0;
const NORMAL_NOISE_N: f64 = 20.0;

/// Something wrong with the rig or its sensors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Trouble {
    /// A channel of the emergency stop is open.
    pub emergency_stop: [bool; 2],
    /// The dump valve's output stays at this level: true holds pressure.
    pub holds: Option<bool>,
    /// The button that confirms a fault is pressed.
    pub confirm: bool,
    /// No pulses from the wheel's encoder.
    pub wheel_lost: bool,
    /// No pulses from the vehicle's encoder.
    pub vehicle_lost: bool,
    /// The wheel's encoder counts this many pulses too many in each sample.
    pub extra_wheel_pulses: u16,
    /// The wheel's encoder stands on an edge and shakes: captures come, and nothing is counted.
    pub wheel_rocks: bool,
    /// Too many pulses of the vehicle's encoder in each sample.
    pub extra_vehicle_pulses: u16,
    /// The bridge converter's answers are bad or old.
    pub bridge: BridgeQuality,
    /// The bridge converter repeats its codes.
    pub bridge_frozen: bool,
    /// The drag's code stays as it is.
    pub drag_stuck: bool,
    /// The drag's contact opens on every other sample.
    pub drag_chatters: bool,
    /// The drag reads wrong by so many N, on every other sample in the other direction.
    pub drag_swings_n: f64,
    /// Drag in N added by a broken bridge.
    pub drag_offset_n: f64,
    /// The tyre is lifted.
    pub lifted: bool,
    /// Supply in V instead of 24.
    pub supply_v: Option<f64>,
    /// What the pressure transmitter reads in V.
    pub pressure_v: Option<f64>,
    /// Both valves stay as they are, and so does the pressure.
    pub valves_stuck: bool,
    /// The brake holds this torque in N m whatever the valves do.
    pub stuck_brake_nm: Option<f64>,
    /// The drum is driven to this speed in m/s.
    pub driven_m_s: Option<f64>,
    /// The wheel's encoder is driven at this speed in rad/s.
    pub wheel_rad_s: Option<f64>,
    /// The drag reads this in N.
    pub drag_n: Option<f64>,
}

/// A rig at speed.
pub struct Rig {
    plant: Plant,
    parameters: Parameters,
    normal_force_n: f64,
    torque_nm: f64,
    wheel: Encoder,
    vehicle: Encoder,
    /// Angle of the wheel's encoder in rad beyond the plant's.
    wheel_rad: f64,
    /// Angle of the vehicle's encoder in rad where the drum is driven and the plant does not say.
    vehicle_rad: f64,
    random: ChaCha8Rng,
    bridge: BridgeReading,
    samples: u64,
    /// What is wrong.
    pub trouble: Trouble,
}

#[derive(Debug, Clone, Copy)]
struct Encoder {
    pulses_per_radian: f64,
    /// Pulses counted, of the one before as well.
    pulses: f64,
    counted: f64,
    /// When the last pulse came, and when the last edge was captured: the same, unless the encoder shakes.
    edge_s: f64,
    capture_s: f64,
}

impl Encoder {
    fn new(pulses_per_revolution: u16) -> Self {
        Self {
            pulses_per_radian: f64::from(pulses_per_revolution) / std::f64::consts::TAU,
            pulses: 0.25,
            counted: 0.0,
            edge_s: 0.0,
            capture_s: 0.0,
        }
    }

    /// Turns to an angle over a step that ends now.
    fn turn(&mut self, angle_rad: f64, now_s: f64, step_s: f64, lost: bool) {
        let end = 0.25 + angle_rad * self.pulses_per_radian;
        let whole = end.floor();
        if !lost && whole > self.pulses.floor() {
            self.edge_s = now_s - step_s * (end - whole) / (end - self.pulses);
            self.capture_s = self.edge_s;
            self.counted += whole - self.pulses.floor();
        }
        self.pulses = end;
    }

    fn reading(&self, now_s: f64) -> EncoderReading {
        let ticks = |s: f64| (s * f64::from(RATES.edge_timer_hz())) as u64;
        EncoderReading {
            edges: (self.counted as u64 * 2 + 1) as u16,
            edge_ticks: ticks(self.capture_s) as u32,
            age_ticks: (ticks(now_s) - ticks(self.capture_s)) as u32,
        }
    }
}

impl Rig {
    /// A wheel rolling freely at a vehicle speed in m/s on a road of the law, the speed held.
    ///
    /// # Errors
    /// The law's text makes no law.
    pub fn rolling(
        law: &str,
        vehicle_m_s: f64,
        seed: u64,
        parameters: &Parameters,
    ) -> Result<Self> {
        let law: RigLaw = law.parse().map_err(|error| anyhow!("{law}: {error}"))?;
        let wheel = &parameters.wheel;
        let plant = Plant::rolling(
            PlantParameters {
                radius_m: f64::from(wheel.effective_radius_m),
                inertia_kg_m2: f64::from(wheel.inertia_kg_m2),
                mass_kg: f64::from(wheel.vehicle_mass_kg),
                coasting: false,
                law,
            },
            vehicle_m_s,
        );
        Ok(Self {
            plant,
            parameters: *parameters,
            normal_force_n: f64::from(wheel.vehicle_mass_kg) * 9.806_65,
            torque_nm: 0.0,
            wheel: Encoder::new(parameters.wheel_encoder.pulses_per_revolution),
            vehicle: Encoder::new(parameters.vehicle_encoder.pulses_per_revolution),
            wheel_rad: 0.0,
            vehicle_rad: 0.0,
            random: ChaCha8Rng::seed_from_u64(seed),
            bridge: BridgeReading::default(),
            samples: 0,
            trouble: Trouble::default(),
        })
    }

    /// Time since the wheel's encoder last gave a pulse that turned it, in s.
    pub fn wheel_pulse_age_s(&self) -> f64 {
        self.samples as f64 * SAMPLE_S - self.wheel.edge_s
    }

    /// True slip now.
    pub fn slip_ratio(&self) -> f64 {
        self.plant.contact(self.normal_force_n).slip_ratio
    }

    /// Moves on by a sample under what the valves were told, and reads the sensors.
    pub fn sample(&mut self, brake: BrakeOutput) -> RawSample {
        let trouble = self.trouble;
        let step_s = SAMPLE_S / f64::from(STEPS);
        let demand_nm = self.demand_nm(brake);
        let lag_s = if brake.hold_pressure {
            LAG_S
        } else {
            DUMP_LAG_S
        };
        let normal_force_n = if trouble.lifted {
            0.0
        } else {
            self.normal_force_n
        };
        for step in 0..STEPS {
            if !trouble.valves_stuck {
                self.torque_nm = demand_nm + (self.torque_nm - demand_nm) * (-step_s / lag_s).exp();
            }
            let torque_nm = trouble.stuck_brake_nm.unwrap_or(self.torque_nm);
            self.plant.step(step_s, torque_nm, normal_force_n.max(1.0));
            let now_s = self.samples as f64 * SAMPLE_S + f64::from(step + 1) * step_s;
            let state = self.plant.state();
            if let Some(driven_rad_s) = trouble.wheel_rad_s {
                self.wheel_rad += (driven_rad_s - state.wheel_speed_rad_s) * step_s;
            }
            let angle_rad = state.wheel_angle_rad + self.wheel_rad;
            self.wheel
                .turn(angle_rad, now_s, step_s, trouble.wheel_lost);
            let speed_m_s = trouble.driven_m_s.unwrap_or(state.vehicle_speed_m_s);
            self.vehicle_rad +=
                speed_m_s * step_s / f64::from(self.parameters.vehicle_encoder_radius_m);
            self.vehicle
                .turn(self.vehicle_rad, now_s, step_s, trouble.vehicle_lost);
        }
        self.samples += 1;
        if trouble.wheel_rocks {
            self.wheel.capture_s = self.samples as f64 * SAMPLE_S - 1e-4;
        }
        self.wheel.counted += f64::from(trouble.extra_wheel_pulses);
        self.vehicle.counted += f64::from(trouble.extra_vehicle_pulses);
        self.read(normal_force_n, brake)
    }

    /// Power in W of the torque that the valves ask for.
    pub fn brake_power_w(&self, brake: BrakeOutput) -> f64 {
        self.demand_nm(brake) * self.plant.state().wheel_speed_rad_s
    }

    /// What the transmitter reads in V where nothing is wrong with it: torque goes with pressure.
    fn pressure_v(&self) -> f64 {
        let pressure = &self.parameters.pressure;
        let (zero, full) = (
            f64::from(pressure.volt_at_zero),
            f64::from(pressure.volt_at_full),
        );
        let share = self.torque_nm / f64::from(self.parameters.brake.torque_at_full_nm);
        zero + (full - zero) * share
    }

    fn demand_nm(&self, brake: BrakeOutput) -> f64 {
        if !brake.hold_pressure {
            return 0.0;
        }
        let calibration = &self.parameters.brake;
        let duty = f64::from(brake.valve_duty) / 65535.0;
        let (zero, full) = (
            f64::from(calibration.duty_at_zero),
            f64::from(calibration.duty_at_full),
        );
        ((duty - zero) / (full - zero)).clamp(0.0, 1.0) * f64::from(calibration.torque_at_full_nm)
    }

    fn read(&mut self, normal_force_n: f64, brake: BrakeOutput) -> RawSample {
        let mut noise = |sigma: f64| {
            let draw: f64 = StandardNormal.sample(&mut self.random);
            sigma * draw
        };
        let contact = self.plant.contact(normal_force_n.max(1.0));
        let drag_n = self
            .trouble
            .drag_n
            .unwrap_or_else(|| self.plant.drag_n(&contact))
            + self.trouble.drag_offset_n
            + if self.samples.is_multiple_of(2) {
                let chatter_n = f64::from(u8::from(self.trouble.drag_chatters)) * 10_000.0;
                chatter_n + self.trouble.drag_swings_n
            } else {
                -self.trouble.drag_swings_n
            }
            + noise(DRAG_NOISE_N);
        let normal_n = normal_force_n + noise(NORMAL_NOISE_N);
        let code = |force: f64, scale: f32| {
            (force / f64::from(scale))
                .round()
                .clamp(-8_388_608.0, 8_388_607.0) as i32
        };
        if !self.trouble.bridge_frozen {
            let [drag, _] = self.bridge.codes;
            self.bridge.codes = [
                if self.trouble.drag_stuck {
                    drag
                } else {
                    code(drag_n, self.parameters.drag.newton_per_code)
                },
                code(normal_n, self.parameters.normal.newton_per_code),
            ];
        }
        self.bridge.quality = self.trouble.bridge;
        let now_s = self.samples as f64 * SAMPLE_S;
        RawSample {
            wheel: self.wheel.reading(now_s),
            vehicle: self.vehicle.reading(now_s),
            bridge: self.bridge,
            supply_mv: (self.trouble.supply_v.unwrap_or(24.0) * 1000.0) as u16,
            pressure_mv: (self.trouble.pressure_v.unwrap_or_else(|| self.pressure_v()) * 1000.0)
                as u16,
            // Somebody tests it when the rig is switched on.
            emergency_stop: if (2..5).contains(&self.samples) {
                [true; 2]
            } else {
                self.trouble.emergency_stop
            },
            holds: self.trouble.holds.unwrap_or(brake.hold_pressure),
            confirm: self.trouble.confirm,
            late: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use muslip_control::conversion::Conversion;

    #[test]
    fn the_controllers_own_conversion_reads_the_plants_speeds_and_forces_back() {
        let parameters = Parameters::default();
        let mut rig = Rig::rolling("rudd:0.85,0.14", 20.0, 1, &parameters).unwrap();
        let mut conversion = Conversion::new(&parameters, RATES);
        let brake = BrakeOutput::for_demand(0.25, &parameters.brake);
        let mut drag = 0.0;
        for index in 0..600 {
            let sample = conversion.convert(&rig.sample(brake)).sample;
            if index < 100 {
                continue;
            }
            let truth = rig.plant.state();
            let wheel = f64::from(sample.wheel_speed_rad_s) / truth.wheel_speed_rad_s - 1.0;
            let vehicle = f64::from(sample.vehicle_speed_m_s) / 20.0 - 1.0;
            assert!(
                wheel.abs() < 1e-3 && vehicle.abs() < 1e-4,
                "{wheel} {vehicle}"
            );
            drag += f64::from(sample.drag_force_n) / 500.0;
        }
        // In equilibrium the tyre's torque is the brake's: a quarter of 2000 N m.
        assert!((drag - 500.0 / 0.31).abs() < 10.0, "{drag}");
    }
}
