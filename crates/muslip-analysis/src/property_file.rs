//! The fitted law as a tyre property file (`.tir`), for simulations that run the Magic Formula.
//!
//! The longitudinal coefficients of version 5.2 (H. B. Pacejka, "Tire and Vehicle Dynamics", 3rd ed. 2012, equations 4.E9 to 4.E18) are fitted to
//! the law over the range that was measured. With kappa the tyre's slip (negative in braking) and dfz = (Fz - FNOMIN)/FNOMIN:
//!
//! Fx = mu Fz sin(C atan(B kappa - E (B kappa - atan(B kappa)))), mu = PDX1 + PDX2 dfz, C = PCX1, E = PEX1, B = (PKX1 + PKX2 dfz)/(C mu)
//!
//! The two-parameter law is the case C = 2, E = 0, B = 1/(slip at the peak), exactly; a law of another shape is met as well as those can, and by
//! how much they miss it is said in the file. So is what no property file of this kind can hold.

use std::fmt::Write as _;

use muslip_diagnose::mechanism::Law;
use muslip_diagnose::repaired::{Repaired, RepairedTerm};
use nalgebra::{SMatrix, SVector};

use crate::fit::FitResult;

/// Slips and loads at which coefficients are held against the law.
const SLIPS: usize = 200;
const LOADS: usize = 9;
/// Largest shape factor: up to there the sine's argument stays within ±π, and the curve does not turn back through zero.
const LARGEST_C: f64 = 2.0;
/// Accepted steps of the fit, at most.
const MOST_STEPS: usize = 400;
/// A step that gains less of the sum of squares than this share ends the fit.
const LEAST_GAIN: f64 = 1e-13;
/// Loads within this share of each other say nothing of a dependence on load.
const ONE_LOAD: f64 = 0.05;

/// A law with the range in which it was measured.
pub struct MeasuredLaw<'a> {
    /// Friction at a braking slip and a normal force in N.
    pub friction: &'a dyn Fn(f64, f64) -> f64,
    /// Peak friction at the nominal load, to start from.
    pub peak_friction: f64,
    /// Slip at the peak at the nominal load, to start from.
    pub critical_slip: f64,
    /// Whether friction depends on the normal force.
    pub of_load: bool,
    /// Smallest and largest braking slip.
    pub slip: [f64; 2],
    /// Smallest and largest normal force in N.
    pub normal_force_n: [f64; 2],
    /// Nominal load in N.
    pub nominal_force_n: f64,
    /// Free-rolling radius in m.
    pub radius_m: f64,
    /// What it is from, one line each.
    pub from: Vec<String>,
    /// What of it the file cannot hold, one line each.
    pub left_out: Vec<String>,
}

/// Why there is no property file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PropertyFileError {
    /// The balance of the tyre could not be fitted: the values are the rig file's.
    #[error("the tyre's law was not fitted, so there is none to write")]
    NotFitted,
    /// The recordings do not brake, or have no load.
    #[error(
        "the recordings have no braking slip or no normal force, so the law was measured nowhere"
    )]
    NoRange,
}

/// Longitudinal coefficients, by their names in the file; all that are not here are 0, scale factors 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// Nominal load in N.
    pub fnomin: f64,
    /// Shape factor C.
    pub pcx1: f64,
    /// Friction at the nominal load.
    pub pdx1: f64,
    /// Its change with load.
    pub pdx2: f64,
    /// Curvature E.
    pub pex1: f64,
    /// Slip stiffness over load at the nominal load.
    pub pkx1: f64,
    /// Its change with load.
    pub pkx2: f64,
}

impl Coefficients {
    /// Friction at a braking slip and a normal force in N.
    #[must_use]
    pub fn friction(&self, slip: f64, normal_force_n: f64) -> f64 {
        let dfz = (normal_force_n - self.fnomin) / self.fnomin;
        let peak = self.pdx1 + self.pdx2 * dfz;
        let x = (self.pkx1 + self.pkx2 * dfz) / (self.pcx1 * peak) * slip;
        peak * (self.pcx1 * (x - self.pex1 * (x - x.atan())).atan()).sin()
    }

    fn as_array(&self) -> [f64; 6] {
        [
            self.pcx1, self.pdx1, self.pex1, self.pkx1, self.pdx2, self.pkx2,
        ]
    }

    /// The same with other values, kept where they have a meaning.
    fn with(&self, [pcx1, pdx1, pex1, pkx1, pdx2, pkx2]: [f64; 6]) -> Self {
        Self {
            fnomin: self.fnomin,
            pcx1: pcx1.clamp(0.1, LARGEST_C),
            pdx1: pdx1.max(1e-6),
            pex1: pex1.clamp(-20.0, 1.0),
            pkx1: pkx1.max(1e-6),
            pdx2,
            pkx2,
        }
    }
}

/// A property file, and how well it holds the law.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyFile {
    /// Its coefficients.
    pub coefficients: Coefficients,
    /// Largest difference of its friction to the law's within the measured range.
    pub largest_difference: f64,
    /// The slip where that is.
    pub at_slip: f64,
    /// What it cannot hold, one line each.
    pub left_out: Vec<String>,
    /// Its text.
    pub text: String,
}

impl PropertyFile {
    /// The law of a fit.
    ///
    /// # Errors
    /// [`PropertyFileError::NoRange`].
    pub fn of_fit(result: &FitResult, radius_m: f64) -> Result<Self, PropertyFileError> {
        let curve = result.fit.curve;
        let [low, nominal, high] = result.normal_force_n;
        let slip = result
            .slips
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &slip| {
                [low.min(slip), high.max(slip)]
            });
        let mut left_out = Vec::new();
        if high > low * (1.0 + ONE_LOAD) {
            left_out.push(
                "friction is taken as the same at all loads: the two-parameter law knows no load"
                    .to_owned(),
            );
        }
        let names = result.runs.iter().map(|run| run.path.display().to_string());
        Self::of(MeasuredLaw {
            friction: &|slip, _| curve.friction(slip),
            peak_friction: curve.peak_friction,
            critical_slip: curve.critical_slip,
            of_load: false,
            slip,
            normal_force_n: [low, high],
            nominal_force_n: nominal,
            radius_m,
            from: names.collect(),
            left_out,
        })
    }

    /// The law of a diagnosis: base law, shape of the curve and dependence on load; the other mechanisms are listed as left out.
    ///
    /// # Errors
    /// [`PropertyFileError`].
    pub fn of_model(model: &Repaired) -> Result<Self, PropertyFileError> {
        let [Some(peak), Some(critical)] = [0, 1].map(|k| model.base.get(k)) else {
            return Err(PropertyFileError::NotFitted);
        };
        if model.noise.likelihood.is_none() {
            return Err(PropertyFileError::NotFitted);
        }
        let range = |name: &str| model.domain.ranges.get(name).copied();
        let (Some(slip), Some(normal_force_n)) = (range("slip"), range("normal_force_n")) else {
            return Err(PropertyFileError::NoRange);
        };
        let mut law = Law::rudd(peak.exp(), critical.exp());
        let (mut of_peak, mut of_critical) = (0.0, 0.0);
        let mut left_out = Vec::new();
        for term in &model.tyre {
            let value = |name: &str| parameter(term, name);
            match term.id.as_str() {
                "curve_shape" => {
                    law.rise = value("rising_shape");
                    law.fall = value("falling_shape").map(|fall| (fall, value("falling_stretch")));
                }
                "load_sensitivity" => {
                    of_peak = value("load_sensitivity").unwrap_or(0.0);
                    of_critical = value("critical_slip_exponent").unwrap_or(0.0);
                }
                id => left_out.push(format!("{id} ({})", term.equation)),
            }
        }
        for correction in &model.corrections {
            left_out.push(format!(
                "the unnamed dependence on {} ({})",
                correction.variable, correction.acts_on
            ));
        }
        let nominal = model.context.mean_load;
        let names = model.recordings.iter().map(|run| run.path.clone());
        Self::of(MeasuredLaw {
            friction: &|slip, load| {
                let ratio = load / nominal;
                let critical = law.critical * ratio.powf(of_critical);
                ratio.powf(-of_peak) * law.friction(slip / critical)
            },
            peak_friction: law.peak,
            critical_slip: law.critical,
            of_load: of_peak != 0.0 || of_critical != 0.0,
            slip,
            normal_force_n,
            nominal_force_n: nominal,
            radius_m: model.context.radius,
            from: names.collect(),
            left_out,
        })
    }

    /// Any law.
    ///
    /// # Errors
    /// [`PropertyFileError::NoRange`].
    pub fn of(law: MeasuredLaw<'_>) -> Result<Self, PropertyFileError> {
        let MeasuredLaw {
            slip: [_, deepest],
            normal_force_n: [lightest, heaviest],
            nominal_force_n,
            ..
        } = law;
        let is_range = [deepest, lightest, heaviest, nominal_force_n]
            .iter()
            .all(|value| value.is_finite() && *value > 0.0);
        if !is_range {
            return Err(PropertyFileError::NoRange);
        }
        let grid = grid(&law);
        let unknowns = if law.of_load { 6 } else { 4 };
        let start = |c: f64, e: f64| Coefficients {
            fnomin: nominal_force_n,
            pcx1: c,
            pdx1: law.peak_friction,
            pdx2: 0.0,
            pex1: e,
            // The slope at the origin of the two-parameter law is 2 mup/sp.
            pkx1: 2.0 * law.peak_friction / law.critical_slip,
            pkx2: 0.0,
        };
        let fitted = [(2.0, 0.0), (1.6, 0.3), (1.3, -1.0)]
            .map(|(c, e)| fitted(start(c, e), &grid, unknowns))
            .into_iter()
            .reduce(|best, next| if next.1 < best.1 { next } else { best });
        let Some((coefficients, _)) = fitted else {
            return Err(PropertyFileError::NoRange);
        };
        let (largest_difference, at_slip) = grid.iter().fold((0.0, 0.0), |worst, point| {
            let off = (coefficients.friction(point.slip, point.load) - point.friction).abs();
            if off > worst.0 {
                (off, point.slip)
            } else {
                worst
            }
        });
        let mut file = Self {
            coefficients,
            largest_difference,
            at_slip,
            left_out: law.left_out.clone(),
            text: String::new(),
        };
        file.text = file.text(&law);
        Ok(file)
    }

    /// How well it holds the law, in a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        if self.largest_difference < 1e-9 {
            return "the coefficients hold the law exactly".to_owned();
        }
        format!(
            "within the measured range friction differs from the law's by {:.4} at most, at slip {:.3}",
            self.largest_difference, self.at_slip
        )
    }

    fn text(&self, law: &MeasuredLaw<'_>) -> String {
        let Coefficients {
            fnomin,
            pcx1,
            pdx1,
            pdx2,
            pex1,
            pkx1,
            pkx2,
        } = self.coefficients;
        let [least, deepest] = law.slip;
        let [lightest, heaviest] = law.normal_force_n;
        let mut text = String::from(
            "[MDI_HEADER]\nFILE_TYPE                = 'tir'\nFILE_VERSION             = 3.0\nFILE_FORMAT              = 'ASCII'\n",
        );
        let mut comment = |line: &str| {
            // An equals sign, even behind the mark of a comment, is a key to some readers.
            for part in wrapped(&line.replace('=', "is")) {
                // Writing to a String cannot fail.
                let _ = writeln!(text, "! {part}");
            }
        };
        comment(
            "Longitudinal coefficients of the Magic Formula 5.2, written by muslip. Measured in straight braking:",
        );
        for from in &law.from {
            comment(&format!("  {from}"));
        }
        comment(&format!(
            "Slip {:.4} to {deepest:.4}, normal force {lightest:.1} to {heaviest:.1} N; {}.",
            least.max(0.0),
            self.sentence()
        ));
        comment("Not in this file:");
        comment(
            "  lateral force, moments, combined slip, camber and inflation pressure, none of which was measured",
        );
        comment("  driving, which the coefficients take for the mirror image of braking");
        comment(
            "  the tyre's size but for its free-rolling radius, which stands for the unloaded one",
        );
        for left_out in &law.left_out {
            comment(&format!("  {left_out}"));
        }
        let mut section = |name: &str, rows: &[(&str, String, &str)]| {
            let _ = writeln!(text, "[{name}]");
            for (key, value, what) in rows {
                let what = if what.is_empty() {
                    String::new()
                } else {
                    format!("   ${what}")
                };
                let row = format!("{key:<24} = {value:<22}{what}");
                let _ = writeln!(text, "{}", row.trim_end());
            }
        };
        let number = |value: f64| format!("{value:?}");
        let word = |word: &str| format!("'{word}'");
        section(
            "UNITS",
            &[
                ("LENGTH", word("meter"), ""),
                ("FORCE", word("newton"), ""),
                ("ANGLE", word("radians"), ""),
                ("MASS", word("kg"), ""),
                ("TIME", word("second"), ""),
            ],
        );
        section(
            "MODEL",
            &[
                ("PROPERTY_FILE_FORMAT", word("MF_05"), ""),
                ("FITTYP", "6".to_owned(), "Magic Formula 5.2"),
                ("USE_MODE", "1".to_owned(), "longitudinal force alone"),
            ],
        );
        section(
            "DIMENSION",
            &[(
                "UNLOADED_RADIUS",
                number(law.radius_m),
                "Free-rolling radius",
            )],
        );
        section(
            "VERTICAL",
            &[("FNOMIN", number(fnomin), "Nominal wheel load")],
        );
        section(
            "LONG_SLIP_RANGE",
            &[
                ("KPUMIN", number(-deepest), "Deepest measured slip"),
                ("KPUMAX", number(deepest), "Mirror image, not measured"),
            ],
        );
        section(
            "VERTICAL_FORCE_RANGE",
            &[
                ("FZMIN", number(lightest), "Lightest measured load"),
                ("FZMAX", number(heaviest), "Heaviest measured load"),
            ],
        );
        let scales = ["LFZO", "LCX", "LMUX", "LEX", "LKX", "LHX", "LVX", "LGAX"];
        section(
            "SCALING_COEFFICIENTS",
            &scales.map(|key| (key, "1.0".to_owned(), "")),
        );
        let zero = || number(0.0);
        section(
            "LONGITUDINAL_COEFFICIENTS",
            &[
                ("PCX1", number(pcx1), "Shape factor Cfx"),
                ("PDX1", number(pdx1), "Friction at FNOMIN"),
                ("PDX2", number(pdx2), "Change of friction with load"),
                ("PDX3", zero(), "Change of friction with camber"),
                ("PEX1", number(pex1), "Curvature Efx at FNOMIN"),
                ("PEX2", zero(), "Change of curvature with load"),
                ("PEX3", zero(), "Change of curvature with load squared"),
                ("PEX4", zero(), "Change of curvature while driving"),
                ("PKX1", number(pkx1), "Slip stiffness over load at FNOMIN"),
                ("PKX2", number(pkx2), "Change of slip stiffness with load"),
                ("PKX3", zero(), "Exponent of that change"),
                ("PHX1", zero(), "Horizontal shift"),
                ("PHX2", zero(), "Change of horizontal shift with load"),
                ("PVX1", zero(), "Vertical shift over load"),
                ("PVX2", zero(), "Change of vertical shift with load"),
            ],
        );
        text
    }
}

fn parameter(term: &RepairedTerm, name: &str) -> Option<f64> {
    let mut parameters = term.parameters.iter();
    Some(parameters.find(|parameter| parameter.name == name)?.value)
}

/// A line as lines of a hundred letters: some readers take no more than 200 bytes at a time.
fn wrapped(line: &str) -> Vec<String> {
    const LONGEST: usize = 100;
    let indent: String = line.chars().take_while(|c| *c == ' ').collect();
    let mut lines = vec![indent.clone()];
    for word in line.split_whitespace() {
        let mut last = lines.last().cloned().unwrap_or_default();
        if last.chars().count() + word.chars().count() > LONGEST && last.trim() != "" {
            last = format!("{indent}  ");
            lines.push(last.clone());
        }
        if !last.ends_with(' ') && !last.is_empty() {
            last.push(' ');
        }
        last.push_str(word);
        if let Some(end) = lines.last_mut() {
            *end = last;
        }
    }
    lines
}

/// A point that coefficients are held against.
struct Point {
    slip: f64,
    load: f64,
    friction: f64,
}

fn grid(law: &MeasuredLaw<'_>) -> Vec<Point> {
    let [least, deepest] = [law.slip[0].max(0.0), law.slip[1]];
    let loads = if law.of_load { LOADS } else { 1 };
    let [lightest, heaviest] = law.normal_force_n;
    let share = |k: usize, of: usize| k as f64 / (of.max(2) - 1) as f64;
    let mut points = Vec::with_capacity(SLIPS * loads);
    for j in 0..loads {
        let load = if law.of_load {
            lightest + (heaviest - lightest) * share(j, loads)
        } else {
            law.nominal_force_n
        };
        for k in 0..SLIPS {
            let slip = least + (deepest - least) * share(k, SLIPS);
            points.push(Point {
                slip,
                load,
                friction: (law.friction)(slip, load),
            });
        }
    }
    points
}

fn squares(coefficients: &Coefficients, grid: &[Point]) -> f64 {
    let off = |point: &Point| coefficients.friction(point.slip, point.load) - point.friction;
    let sum: f64 = grid.iter().map(|point| off(point).powi(2)).sum();
    if sum.is_finite() { sum } else { f64::INFINITY }
}

/// Levenberg and Marquardt's method with derivatives by differences; the first so many of the six are free.
fn fitted(start: Coefficients, grid: &[Point], unknowns: usize) -> (Coefficients, f64) {
    let mut best = start;
    let mut cost = squares(&best, grid);
    let mut damping = 1e-3;
    for _ in 0..MOST_STEPS {
        let at = best.as_array();
        let mut normal = SMatrix::<f64, 6, 6>::zeros();
        let mut right = SVector::<f64, 6>::zeros();
        let columns: Vec<(f64, Coefficients)> = (0..unknowns)
            .map(|k| {
                let mut moved = at;
                // Inwards, where a bound is on the other side.
                let step = -1e-6 * at[k].abs().max(0.1);
                moved[k] += step;
                (step, best.with(moved))
            })
            .collect();
        for point in grid {
            let here = best.friction(point.slip, point.load);
            let off = point.friction - here;
            let mut row = SVector::<f64, 6>::zeros();
            for (cell, (step, moved)) in row.iter_mut().zip(&columns) {
                *cell = (moved.friction(point.slip, point.load) - here) / step;
            }
            right += row * off;
            normal += row * row.transpose();
        }
        let before = cost;
        // Longer and longer strides towards the gradient until one gains.
        while damping < 1e12 {
            let mut damped = normal;
            for k in 0..6 {
                // What is not free stays where it is.
                damped[(k, k)] = if k < unknowns {
                    damped[(k, k)] * (1.0 + damping)
                } else {
                    1.0
                };
            }
            let step = damped.lu().solve(&right);
            let step = step.filter(|step| step.iter().all(|dx| dx.is_finite()));
            let next = step.map(|step| best.with((SVector::from(at) + step).into()));
            let then = next.map_or(f64::INFINITY, |next| squares(&next, grid));
            if let (Some(next), true) = (next, then < cost) {
                (best, cost) = (next, then);
                damping *= 0.2;
                break;
            }
            damping *= 4.0;
        }
        if cost >= before * (1.0 - LEAST_GAIN) {
            break;
        }
    }
    (best, cost)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law<'a>(friction: &'a dyn Fn(f64, f64) -> f64, of_load: bool) -> MeasuredLaw<'a> {
        MeasuredLaw {
            friction,
            peak_friction: 0.9,
            critical_slip: 0.12,
            of_load,
            slip: [-0.02, 0.6],
            normal_force_n: [3000.0, 5000.0],
            nominal_force_n: 4000.0,
            radius_m: 0.31,
            from: vec!["run.csv".to_owned()],
            left_out: vec!["thermal_fade (x = y)".to_owned()],
        }
    }

    fn rudd(slip: f64) -> f64 {
        let x = slip / 0.12;
        0.9 * 2.0 * x / (1.0 + x * x)
    }

    #[test]
    fn the_two_parameter_law_is_held_exactly() {
        let file = PropertyFile::of(law(&|slip, _| rudd(slip), false)).unwrap();
        assert!(file.largest_difference < 1e-12, "{file:?}");
        assert!((file.coefficients.pcx1 - 2.0).abs() < 1e-9 && file.coefficients.pex1.abs() < 1e-9);
        assert!((file.coefficients.pkx1 - 15.0).abs() < 1e-9);
        assert!(
            file.text.contains("PDX1                     = 0.9"),
            "{}",
            file.text
        );
        assert!(
            file.text.contains("!   thermal_fade (x is y)"),
            "{}",
            file.text
        );
        let lines = file.text.lines();
        assert!(lines.clone().all(|line| line.len() < 200));
        assert!(
            lines
                .filter(|line| line.starts_with('!'))
                .all(|line| !line.contains('='))
        );
    }

    #[test]
    fn a_magic_formula_is_found_again_with_its_load() {
        let truth = Coefficients {
            fnomin: 4000.0,
            pcx1: 1.55,
            pdx1: 1.05,
            pdx2: -0.12,
            pex1: 0.4,
            pkx1: 22.0,
            pkx2: 1.5,
        };
        let friction = |slip: f64, load: f64| truth.friction(slip, load);
        let file = PropertyFile::of(law(&friction, true)).unwrap();
        assert!(file.largest_difference < 1e-6, "{file:?}");
        assert!((file.coefficients.pcx1 - 1.55).abs() < 1e-3, "{file:?}");
        assert!((file.coefficients.pdx2 + 0.12).abs() < 1e-4, "{file:?}");
    }

    #[test]
    fn what_the_coefficients_cannot_hold_is_said_by_how_much() {
        // A curve with a notch that no Magic Formula has.
        let notched =
            |slip: f64, _: f64| rudd(slip) - 0.1 * (-((slip - 0.3) / 0.02_f64).powi(2)).exp();
        let file = PropertyFile::of(law(&notched, false)).unwrap();
        assert!((0.05..0.1).contains(&file.largest_difference), "{file:?}");
        assert!((file.at_slip - 0.3).abs() < 0.02);
        assert!(file.text.contains(&file.sentence()[..40]));
    }

    #[test]
    fn nothing_measured_gives_no_file() {
        let friction = |slip: f64, _: f64| rudd(slip);
        let mut nowhere = law(&friction, false);
        nowhere.slip = [f64::INFINITY, f64::NEG_INFINITY];
        assert_eq!(PropertyFile::of(nowhere), Err(PropertyFileError::NoRange));
        assert_eq!(
            PropertyFile::of_model(&Repaired::default()),
            Err(PropertyFileError::NotFitted)
        );
    }
}
