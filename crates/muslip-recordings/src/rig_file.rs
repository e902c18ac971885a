//! The rig file: what the recording does not say about the wheel, the vehicle, the brake, the tyre
//! and the noise of each channel.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use crate::input_error::{InputError, InputProblem, one_line, quoted, shown};
use crate::toml_file;

/// Smallest wheel radius that is taken for a wheel, in m.
pub const SMALLEST_RADIUS_M: f64 = 0.005;
/// Largest wheel radius that is taken for a wheel, in m.
pub const LARGEST_RADIUS_M: f64 = 2.0;

/// A rig, every value checked: finite and positive, the radius that of a wheel.
#[derive(Debug, Clone, PartialEq)]
pub struct RigFile {
    /// The braked wheel.
    pub wheel: Wheel,
    /// What the braked tyre slows.
    pub vehicle: Vehicle,
    /// The brake, where the file has one.
    pub brake: Option<Brake>,
    /// The tyre law that the base simulation starts from.
    pub tyre: Tyre,
    /// 1-sigma white noise of each channel in the channel's unit, by the name of its column.
    pub noise: BTreeMap<String, f64>,
}

/// The braked wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wheel {
    /// Free-rolling radius in m, 0.005 to 2: slip = (v - radius omega) / v.
    pub radius_m: f64,
    /// Moment of inertia about the axle in kg m2.
    pub inertia_kg_m2: f64,
}

/// What the braked tyre slows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vehicle {
    /// Translating mass in kg, or a drum's inertia divided by its radius squared.
    pub mass_kg: f64,
    /// True where only this tyre's drag slows the vehicle (m dv/dt = -drag); false where the speed is
    /// held or driven.
    pub coasting: bool,
}

/// The brake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brake {
    /// Torque for each pascal of pressure, in N m / Pa.
    pub torque_per_pressure_nm_pa: f64,
}

/// The two-parameter law mu = 2 mup s / (sp (1 + (s/sp)^2)) that the base simulation starts from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tyre {
    /// Friction at the peak, mup.
    pub peak_friction: f64,
    /// Slip at the peak, sp.
    pub critical_slip: f64,
    /// True where the two are not to be refitted.
    pub fixed: bool,
}

impl RigFile {
    /// Reads and checks a rig file.
    ///
    /// # Errors
    /// [`InputError`], one line with file, line and column: the file is missing or not UTF-8, is not
    /// TOML, lacks a required key, names an unknown tyre law, or has a value that is not finite, not
    /// positive, or no wheel's radius.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(path, &toml_file::bytes_of(path)?)
    }

    /// A rig of which only the wheel's radius is known, in m: enough for slip and friction. The rest is `NaN`, and the tyre's start that of no
    /// tyre; nothing that needs them takes such a rig.
    #[must_use]
    pub fn of_radius(radius_m: f64) -> Self {
        Self {
            wheel: Wheel {
                radius_m,
                inertia_kg_m2: f64::NAN,
            },
            vehicle: Vehicle {
                mass_kg: f64::NAN,
                coasting: false,
            },
            brake: None,
            tyre: Tyre {
                peak_friction: f64::NAN,
                critical_slip: f64::NAN,
                fixed: false,
            },
            noise: BTreeMap::new(),
        }
    }

    /// Checks the text of a rig file; `path` is only named in errors.
    ///
    /// # Errors
    /// As [`RigFile::read`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, InputError> {
        let text = toml_file::text_of(path, bytes)?;
        let written: Written = toml_file::parsed(path, text)?;
        written.checked(|at, problem| toml_file::error_at(path, text, at, problem))
    }
}

/// The rig as a repaired model's file has it.
pub fn of_engine(rig: &muslip_diagnose::campaign::Rig) -> RigFile {
    RigFile {
        wheel: Wheel {
            radius_m: rig.radius_m,
            inertia_kg_m2: rig.wheel_inertia_kg_m2,
        },
        vehicle: Vehicle {
            mass_kg: rig.mass_kg,
            coasting: rig.coasting,
        },
        brake: rig
            .torque_per_pressure_nm_pa
            .map(|torque_per_pressure_nm_pa| Brake {
                torque_per_pressure_nm_pa,
            }),
        tyre: Tyre {
            peak_friction: rig.peak_friction,
            critical_slip: rig.critical_slip,
            fixed: rig.law_fixed,
        },
        noise: rig.declared_noise.clone(),
    }
}

/// The file as serde sees it: every value that is checked keeps its place.
#[derive(Deserialize)]
struct Written {
    wheel: WrittenWheel,
    vehicle: WrittenVehicle,
    brake: Option<WrittenBrake>,
    tyre: WrittenTyre,
    #[serde(default)]
    noise: BTreeMap<String, Spanned<f64>>,
}

#[derive(Deserialize)]
struct WrittenWheel {
    radius_m: Spanned<f64>,
    inertia_kg_m2: Spanned<f64>,
}

#[derive(Deserialize)]
struct WrittenVehicle {
    mass_kg: Spanned<f64>,
    coasting: bool,
}

#[derive(Deserialize)]
struct WrittenBrake {
    torque_per_pressure_nm_pa: Spanned<f64>,
}

#[derive(Deserialize)]
struct WrittenTyre {
    law: Spanned<String>,
    peak_friction: Spanned<f64>,
    critical_slip: Spanned<f64>,
    #[serde(default)]
    fixed: bool,
}

impl Written {
    fn checked(
        self,
        fail: impl Fn(usize, InputProblem) -> InputError,
    ) -> Result<RigFile, InputError> {
        let positive = |key: &str, value: &Spanned<f64>| {
            let number = *value.get_ref();
            if number.is_finite() && number > 0.0 {
                return Ok(number);
            }
            let problem = InputProblem::NotPositive {
                key: one_line(key),
                value: shown(number),
            };
            Err(fail(value.span().start, problem))
        };
        let radius_m = positive("wheel.radius_m", &self.wheel.radius_m)?;
        if !(SMALLEST_RADIUS_M..=LARGEST_RADIUS_M).contains(&radius_m) {
            return Err(fail(
                self.wheel.radius_m.span().start,
                InputProblem::RadiusOutOfRange(shown(radius_m)),
            ));
        }
        let law = &self.tyre.law;
        if law.get_ref() != "rudd" {
            return Err(fail(
                law.span().start,
                InputProblem::UnknownTyreLaw(quoted(law.get_ref())),
            ));
        }
        let brake = match &self.brake {
            None => None,
            Some(brake) => Some(Brake {
                torque_per_pressure_nm_pa: positive(
                    "brake.torque_per_pressure_nm_pa",
                    &brake.torque_per_pressure_nm_pa,
                )?,
            }),
        };
        let mut noise = BTreeMap::new();
        for (channel, sigma) in &self.noise {
            noise.insert(
                channel.clone(),
                positive(&format!("noise.{channel}"), sigma)?,
            );
        }
        Ok(RigFile {
            wheel: Wheel {
                radius_m,
                inertia_kg_m2: positive("wheel.inertia_kg_m2", &self.wheel.inertia_kg_m2)?,
            },
            vehicle: Vehicle {
                mass_kg: positive("vehicle.mass_kg", &self.vehicle.mass_kg)?,
                coasting: self.vehicle.coasting,
            },
            brake,
            tyre: Tyre {
                peak_friction: positive("tyre.peak_friction", &self.tyre.peak_friction)?,
                critical_slip: positive("tyre.critical_slip", &self.tyre.critical_slip)?,
                fixed: self.tyre.fixed,
            },
            noise,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GOOD: &str = r#"
[wheel]
radius_m = 0.310
inertia_kg_m2 = 1.25

[vehicle]
mass_kg = 420
coasting = true

[brake]
torque_per_pressure_nm_pa = 3.2e-4

[tyre]
law = "rudd"
peak_friction = 0.85
critical_slip = 0.14

[noise]
drag_force_n = 90.0
"#;

    fn complaint(text: &str) -> String {
        RigFile::parse(Path::new("rig.toml"), text.as_bytes())
            .expect_err("must be refused")
            .to_string()
    }

    #[test]
    fn a_complete_file_is_read_as_written() {
        let rig = RigFile::parse(Path::new("rig.toml"), GOOD.as_bytes()).unwrap();
        assert_eq!(rig.wheel.radius_m, 0.31);
        assert_eq!(rig.vehicle.mass_kg, 420.0);
        assert!(rig.vehicle.coasting && !rig.tyre.fixed);
        assert_eq!(rig.brake.unwrap().torque_per_pressure_nm_pa, 3.2e-4);
        assert_eq!(rig.noise["drag_force_n"], 90.0);
    }

    #[test]
    fn each_bad_value_is_named_with_its_place() {
        for (from, to, expected) in [
            (
                "radius_m = 0.310",
                "radius_m = 310.0",
                "rig.toml:3:12: wheel.radius_m = 310: must be between 0.005 and 2 m",
            ),
            (
                "radius_m = 0.310",
                "radius_m = nan",
                "rig.toml:3:12: wheel.radius_m = NaN: must be finite and positive",
            ),
            (
                "radius_m = 0.310",
                "radius_m = \"a\"",
                "rig.toml:3:12: invalid type: string \"a\", expected f64",
            ),
            (
                "mass_kg = 420",
                "mass_kg = -1",
                "rig.toml:7:11: vehicle.mass_kg = -1: must be finite and positive",
            ),
            (
                "mass_kg = 420",
                "mass_kg = inf",
                "rig.toml:7:11: vehicle.mass_kg = inf: must be finite and positive",
            ),
            ("mass_kg = 420", "", "rig.toml:6:1: missing field `mass_kg`"),
            (
                "coasting = true",
                "coasting = 1",
                "rig.toml:8:12: invalid type: integer `1`, expected a boolean",
            ),
            (
                "3.2e-4",
                "0.0",
                "rig.toml:11:29: brake.torque_per_pressure_nm_pa = 0: must be finite and positive",
            ),
            (
                "\"rudd\"",
                "\"dugoff\"",
                "rig.toml:14:7: tyre.law = \"dugoff\": unknown tyre law (known: \"rudd\")",
            ),
            (
                "drag_force_n = 90.0",
                "  drag_force_n = 0",
                "rig.toml:19:18: noise.drag_force_n = 0: must be finite and positive",
            ),
        ] {
            assert!(GOOD.contains(from), "{from}");
            assert_eq!(complaint(&GOOD.replace(from, to)), expected);
        }
    }

    #[test]
    fn text_that_is_not_toml_is_refused_in_one_line() {
        let text = complaint("[wheel\nradius_m = 0.3\n");
        assert!(text.starts_with("rig.toml:1:7: "), "{text}");
        assert_eq!(text.lines().count(), 1);
        assert!(complaint("").contains("missing field `wheel`"));
    }

    #[test]
    fn bytes_that_are_not_utf8_are_placed() {
        let mut bytes = b"[wheel]\nradius_m = 0.3 # caf".to_vec();
        bytes.push(0xe9);
        let error = RigFile::parse(Path::new("rig.toml"), &bytes).unwrap_err();
        assert_eq!(error.to_string(), "rig.toml:2:21: not UTF-8 text");
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = RigFile::parse(Path::new("rig.toml"), &bytes);
        }

        #[test]
        fn a_damaged_file_never_panics(at in 0usize..GOOD.len(), with in any::<u8>()) {
            let mut bytes = GOOD.as_bytes().to_vec();
            bytes[at] = with;
            if let Err(error) = RigFile::parse(Path::new("rig.toml"), &bytes) {
                prop_assert_eq!(error.to_string().lines().count(), 1);
            }
        }
    }
}
