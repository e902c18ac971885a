//! Scales of sensors in TDMS: resistance thermometers, thermistors, strain gauges and thermocouples, from volts to °C, K and strain.
//!
//! The formulas are those of the sensors and their circuits; the tests hold them against npTDMS, whose order of operations they keep.

use crate::error::Problem;
use crate::tdms_thermocouple::{TYPES, Thermocouple};

/// Codes of the kinds of excitation.
const BY_CURRENT: f64 = 10134.0;
const BY_VOLTAGE: f64 = 10322.0;
/// Newton's steps to the temperature of a cold resistance thermometer: its curve is nearly straight, and a few are enough.
const MOST_STEPS: usize = 50;

/// How strain gauges are put together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Bridge {
    Full1,
    Full2,
    Full3,
    Half1,
    Half2,
    Quarter,
}

/// The scale of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sensor {
    /// R = R0 (1 + a T + b T² + c (T - 100 °C) T³), the last term below 0 °C (Callendar and Van Dusen).
    Rtd {
        current_a: f64,
        r0_ohm: f64,
        a: f64,
        b: f64,
        c: f64,
        wires_ohm: f64,
    },
    /// 1/T = a + b ln R + c (ln R)³ (Steinhart and Hart).
    Thermistor {
        by_current: bool,
        excitation: f64,
        reference_ohm: f64,
        a: f64,
        b: f64,
        c: f64,
        offset: f64,
        wires_ohm: f64,
    },
    /// A bridge of strain gauges.
    Strain {
        bridge: Bridge,
        poisson: f64,
        /// Share of a gauge's factor that the wires leave.
        left_by_wires: f64,
        initial_v: f64,
        factor: f64,
        gain: f64,
        excitation_v: f64,
    },
    /// By its place among the types; from °C to µV, or back.
    Thermocouple { place: usize, to_voltage: bool },
}

/// Resistance of the wires in what is measured as the sensor's: of three wires once, of two that carry the current twice, of four not at all.
fn wires_ohm(by_current: bool, wires: f64, ohm: f64) -> f64 {
    if wires == 3.0 {
        ohm
    } else if wires == 2.0 && by_current {
        2.0 * ohm
    } else {
        0.0
    }
}

impl Sensor {
    /// The scale of a kind; `None` where it is of no sensor. `needed` and `given` give properties by the end of their names.
    pub(crate) fn of(
        kind: &str,
        needed: &dyn Fn(&str) -> Result<f64, Problem>,
        given: &dyn Fn(&str) -> Option<f64>,
    ) -> Result<Option<Self>, Problem> {
        Ok(Some(match kind {
            "RTD" => Self::Rtd {
                current_a: needed("RTD_Current_Excitation")?,
                r0_ohm: needed("RTD_R0_Nominal_Resistance")?,
                a: needed("RTD_A")?,
                b: needed("RTD_B")?,
                c: needed("RTD_C")?,
                wires_ohm: wires_ohm(
                    true,
                    needed("RTD_Resistance_Configuration")?,
                    needed("RTD_Lead_Wire_Resistance")?,
                ),
            },
            "Thermistor" => {
                let excited = needed("Thermistor_Excitation_Type")?;
                if excited != BY_CURRENT && excited != BY_VOLTAGE {
                    return Err(Problem::whole(format!(
                        "a thermistor's excitation {excited} is not supported"
                    )));
                }
                let by_current = excited == BY_CURRENT;
                Self::Thermistor {
                    by_current,
                    excitation: needed("Thermistor_Excitation_Value")?,
                    reference_ohm: needed("Thermistor_R1_Reference_Resistance")?,
                    a: needed("Thermistor_A")?,
                    b: needed("Thermistor_B")?,
                    c: needed("Thermistor_C")?,
                    offset: needed("Thermistor_Temperature_Offset")?,
                    wires_ohm: wires_ohm(
                        by_current,
                        needed("Thermistor_Resistance_Configuration")?,
                        needed("Thermistor_Lead_Wire_Resistance")?,
                    ),
                }
            }
            "Strain" => {
                let code = needed("Strain_Configuration")?;
                let bridge = match code as u32 {
                    10183 => Bridge::Full1,
                    10184 => Bridge::Full2,
                    10185 => Bridge::Full3,
                    10188 => Bridge::Half1,
                    10189 => Bridge::Half2,
                    10271 | 10272 => Bridge::Quarter,
                    _ => {
                        return Err(Problem::whole(format!(
                            "a strain bridge of configuration {code} is not supported"
                        )));
                    }
                };
                let gauge_ohm = needed("Strain_Gage_Resistance")?;
                Self::Strain {
                    bridge,
                    poisson: needed("Strain_Poisson_Ratio")?,
                    left_by_wires: 1.0 / (1.0 + needed("Strain_Lead_Wire_Resistance")? / gauge_ohm),
                    initial_v: needed("Strain_Initial_Bridge_Voltage")?,
                    factor: needed("Strain_Gage_Factor")?,
                    gain: needed("Strain_Bridge_Shunt_Calibration_Gain_Adjustment")?,
                    excitation_v: needed("Strain_Voltage_Excitation")?,
                }
            }
            "Thermocouple" => {
                // Type J where it says none.
                let code = given("Thermocouple_Thermocouple_Type").unwrap_or(10072.0);
                let place = TYPES.iter().position(|one| f64::from(one.code) == code);
                Self::Thermocouple {
                    place: place.ok_or_else(|| {
                        Problem::whole(format!("a thermocouple of type {code} is not supported"))
                    })?,
                    to_voltage: given("Thermocouple_Scaling_Direction") == Some(1.0),
                }
            }
            _ => return Ok(None),
        }))
    }

    /// The reading at a raw value; `NaN` where the sensor can give no such value.
    pub(crate) fn reading(&self, raw: f64) -> f64 {
        match *self {
            Self::Rtd {
                current_a,
                r0_ohm,
                a,
                b,
                c,
                wires_ohm,
            } => rtd((raw / current_a - wires_ohm) / r0_ohm, [a, b, c]),
            Self::Thermistor {
                by_current,
                excitation,
                reference_ohm,
                a,
                b,
                c,
                offset,
                wires_ohm,
            } => {
                let ohm = if by_current {
                    raw / excitation
                } else {
                    // A divider of the sensor and a reference.
                    reference_ohm * (1.0 / (excitation * (1.0 / raw) - 1.0))
                };
                let ln = (ohm - wires_ohm).ln();
                1.0 / (a + (b + c * ln * ln) * ln) - offset
            }
            Self::Strain {
                bridge,
                poisson,
                left_by_wires,
                initial_v,
                factor,
                gain,
                excitation_v,
            } => {
                let v = raw - initial_v;
                match bridge {
                    Bridge::Full1 => v * (-gain / (excitation_v * factor)),
                    Bridge::Full2 => v * (-gain * 2.0 / (excitation_v * factor * (1.0 + poisson))),
                    Bridge::Full3 => {
                        let common = -0.5 / gain;
                        v / (v * (common * (1.0 - poisson) * factor)
                            + common * excitation_v * factor * (1.0 + poisson))
                    }
                    Bridge::Half1 => {
                        let common = -factor * excitation_v * left_by_wires / (4.0 * gain);
                        v / (v * (common * 2.0 * (1.0 - poisson) / excitation_v)
                            + common * (1.0 + poisson))
                    }
                    Bridge::Half2 => v * (-2.0 * gain / (factor * excitation_v * left_by_wires)),
                    Bridge::Quarter => {
                        (1.0 / (v * (2.0 / excitation_v) + 1.0) - 1.0)
                            * (2.0 * gain / (factor * left_by_wires))
                    }
                }
            }
            Self::Thermocouple { place, to_voltage } => {
                // The polynomials are of millivolts, TDMS of microvolts.
                TYPES.get(place).map_or(f64::NAN, |one: &Thermocouple| {
                    if to_voltage {
                        1000.0 * one.millivolts(raw)
                    } else {
                        one.celsius(raw / 1000.0)
                    }
                })
            }
        }
    }
}

/// Temperature in °C of a resistance thermometer whose resistance is so many times that at 0 °C.
fn rtd(ratio: f64, [a, b, c]: [f64; 3]) -> f64 {
    let warm = if b == 0.0 {
        (ratio - 1.0) / a
    } else {
        (-a + (a * a - 4.0 * b * (1.0 - ratio)).sqrt()) / (2.0 * b)
    };
    if ratio >= 1.0 || warm.is_nan() {
        return warm;
    }
    // From the curve without its term of the cold to the one with it.
    let mut t = warm;
    for _ in 0..MOST_STEPS {
        let miss = 1.0 + t * (a + t * (b + t * c * (t - 100.0))) - ratio;
        let slope = a + t * (2.0 * b + t * c * (4.0 * t - 300.0));
        let step = miss / slope;
        t -= step;
        if step.abs() <= 1e-15 * t.abs() {
            break;
        }
    }
    if t.is_finite() && t < 0.0 {
        t
    } else {
        f64::NAN
    }
}
