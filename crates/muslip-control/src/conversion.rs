//! From counts and codes to SI units: the one place where scale, zero and sign are applied.

use muslip::sample::RigSample;
use muslip_record::{ForceParameters, Parameters};

use crate::board::RawSample;
use crate::encoder::{Speed, SpeedMeter};
use crate::number::nearest_signed;
use crate::rates::Rates;

/// Samples that a tare averages.
pub const TARE_SAMPLES: u16 = 256;

/// Converts samples; holds the speed meters' state.
#[derive(Debug, Clone, Copy)]
pub struct Conversion {
    wheel: SpeedMeter,
    vehicle: SpeedMeter,
    vehicle_radius_m: f32,
    drag: ForceParameters,
    normal: ForceParameters,
}

/// One sample in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converted {
    /// The four channels.
    pub sample: RigSample<f32>,
    /// The wheel's encoder.
    pub wheel: Speed,
    /// The vehicle's encoder, in rad/s of its own wheel or drum.
    pub vehicle: Speed,
}

impl Conversion {
    /// For these parameters, at standstill.
    pub fn new(parameters: &Parameters, rates: Rates) -> Self {
        Self {
            wheel: SpeedMeter::new(&parameters.wheel_encoder, rates),
            vehicle: SpeedMeter::new(&parameters.vehicle_encoder, rates),
            vehicle_radius_m: parameters.vehicle_encoder_radius_m,
            drag: parameters.drag,
            normal: parameters.normal,
        }
    }

    /// Takes parameters; the encoders turn on.
    pub fn take(&mut self, parameters: &Parameters) {
        self.wheel.take(&parameters.wheel_encoder);
        self.vehicle.take(&parameters.vehicle_encoder);
        self.vehicle_radius_m = parameters.vehicle_encoder_radius_m;
        self.drag = parameters.drag;
        self.normal = parameters.normal;
    }

    /// Takes new zeros.
    pub fn set_zero_codes(&mut self, drag: i32, normal: i32) {
        self.drag.zero_code = drag;
        self.normal.zero_code = normal;
    }

    /// Converts the next sample.
    pub fn convert(&mut self, raw: &RawSample) -> Converted {
        let wheel = self.wheel.update(&raw.wheel);
        let vehicle = self.vehicle.update(&raw.vehicle);
        let [drag, normal] = raw.bridge.codes;
        Converted {
            sample: RigSample {
                wheel_speed_rad_s: wheel.rad_s,
                vehicle_speed_m_s: vehicle.rad_s * self.vehicle_radius_m,
                drag_force_n: force_n(drag, &self.drag),
                normal_force_n: force_n(normal, &self.normal),
            },
            wheel,
            vehicle,
        }
    }
}

/// Force in N: (code - zero) · scale. Codes of 24 bits and their differences are exact in `f32`'s 24.
fn force_n(code: i32, force: &ForceParameters) -> f32 {
    nearest_signed(code.saturating_sub(force.zero_code)) * force.newton_per_code
}

/// The mean of bridge codes over [`TARE_SAMPLES`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Tare {
    /// 256 codes of 24 bits are 32 bits at most.
    sums: [i32; 2],
    samples: u16,
}

impl Tare {
    /// Takes a sample; both zeros once there are enough.
    pub fn push(&mut self, codes: [i32; 2]) -> Option<[i32; 2]> {
        for (sum, code) in self.sums.iter_mut().zip(codes) {
            *sum = sum.saturating_add(code);
        }
        self.samples += 1;
        // Rounds towards minus infinity: half a code is far below the converter's noise.
        (self.samples >= TARE_SAMPLES).then(|| self.sums.map(|sum| sum >> 8))
    }
}

const _: () = assert!(TARE_SAMPLES == 256);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_is_code_less_zero_times_scale() {
        let mut parameters = Parameters::default();
        parameters.drag.newton_per_code = -0.25;
        parameters.normal.newton_per_code = 0.5;
        parameters.drag.zero_code = -500;
        let mut conversion = Conversion::new(&parameters, Rates::new(1_000, 84_000_000));
        let mut raw = RawSample::default();
        raw.bridge.codes = [3_500, 8_240];
        let sample = conversion.convert(&raw).sample;
        assert_eq!(sample.drag_force_n, -1000.0);
        assert_eq!(sample.normal_force_n, 4120.0);
        conversion.set_zero_codes(3_500, 0);
        assert_eq!(conversion.convert(&raw).sample.drag_force_n, 0.0);
        parameters.normal.newton_per_code = 2.0;
        conversion.take(&parameters);
        let sample = conversion.convert(&raw).sample;
        assert_eq!(sample.drag_force_n, -1000.0);
        assert_eq!(sample.normal_force_n, 16_480.0);
    }

    #[test]
    fn a_tare_is_the_mean_of_its_samples() {
        let mut tare = Tare::default();
        for index in 0..255 {
            assert_eq!(tare.push([index % 2 * 2 + 99, -7]), None);
        }
        assert_eq!(tare.push([101, -7]), Some([100, -7]));
    }
}
