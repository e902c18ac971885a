//! Whether p-values of the null are uniform: where nothing is concealed, a test at 5 % must reject one in twenty.

use std::collections::BTreeMap;

use crate::judge::case::Case;
use crate::judge::family::{APART, Family};
use crate::judge::headline::{Better, Headline};
use crate::judge::tally::of;
use crate::share::Share;
use crate::table::Table;

/// p-values of the residuals' whiteness in null campaigns of one family.
#[derive(Clone, Debug)]
pub struct Uniformity {
    /// `ideal`, `chains`, or the wheel's and the vehicle's sensor.
    pub family: String,
    /// In rising order.
    pub values: Vec<f64>,
    /// Kolmogorov and Smirnov's distance from the uniform distribution.
    pub distance: f64,
    /// Of that distance.
    pub p: f64,
    /// Of the values, those below 0.05.
    pub rejected: Share,
}

impl Uniformity {
    fn of(family: String, mut values: Vec<f64>) -> Uniformity {
        values.sort_by(f64::total_cmp);
        let distance = distance(&values);
        Uniformity {
            family,
            distance,
            p: kolmogorov(distance, values.len()),
            rejected: Share::count(&values, |p| **p < 0.05),
            values,
        }
    }
}

/// Largest distance between the values' distribution and the uniform one on 0..1; the values in rising order.
fn distance(sorted: &[f64]) -> f64 {
    let n = sorted.len() as f64;
    sorted
        .iter()
        .enumerate()
        .map(|(index, value)| {
            let index = index as f64;
            (value - index / n).max((index + 1.0) / n - value)
        })
        .fold(0.0, f64::max)
}

/// P value of the distance of so many values: Kolmogorov's limit at Stephens' argument (J. R. Stat. Soc. B 32 (1970),
/// 115-122), good to a few percent of p from five values on.
pub fn kolmogorov(distance: f64, count: usize) -> f64 {
    if count == 0 {
        return f64::NAN;
    }
    let root = (count as f64).sqrt();
    let x = (root + 0.12 + 0.11 / root) * distance;
    if x < 1e-3 {
        return 1.0;
    }
    // Two forms of the same theta function; each converges at once on its side.
    let p = if x < 1.0 {
        let sum: f64 = (1..=6)
            .map(|k| {
                let odd = f64::from(2 * k - 1) * std::f64::consts::PI;
                (-odd * odd / (8.0 * x * x)).exp()
            })
            .sum();
        1.0 - (2.0 * std::f64::consts::PI).sqrt() / x * sum
    } else {
        2.0 * (1..=6)
            .map(|k| {
                let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
                sign * (-2.0 * f64::from(k * k) * x * x).exp()
            })
            .sum::<f64>()
    };
    p.clamp(0.0, 1.0)
}

/// The families of null campaigns that gave p-values: ideal sensors, all chains, then each pair of sensors.
pub fn families(cases: &[Case]) -> Vec<Uniformity> {
    let p = |case: &Case| case.whiteness_p.filter(|p| p.is_finite());
    let pooled = |family: Family| {
        let values: Vec<f64> = of(cases, "null")
            .filter(|case| family.holds(case))
            .filter_map(p)
            .collect();
        (!values.is_empty()).then(|| Uniformity::of(family.name().to_owned(), values))
    };
    let mut sensors: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for case in of(cases, "null").filter(|case| case.real_chain) {
        sensors
            .entry(format!("{} x {}", case.wheel_sensor, case.vehicle_sensor))
            .or_default()
            .extend(p(case));
    }
    APART
        .into_iter()
        .filter_map(pooled)
        .chain(
            sensors
                .into_iter()
                .filter(|pair| !pair.1.is_empty())
                .map(|(family, values)| Uniformity::of(family, values)),
        )
        .collect()
}

/// Uniformity by family.
pub fn table(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "p-values of the null",
        &[
            "sensors (wheel x vehicle)",
            "n",
            "distance",
            "p of the distance",
            "below 0.05",
            "95 % interval",
        ],
    );
    for family in families(cases) {
        let [share, interval, _] = family.rejected.cells();
        table.row([
            family.family,
            family.values.len().to_string(),
            format!("{:.3}", family.distance),
            if family.p < 1e-4 {
                format!("{:.0e}", family.p)
            } else {
                format!("{:.4}", family.p)
            },
            share,
            interval,
        ]);
    }
    table.note = Some(
        "Whiteness of the residuals on null campaigns, runs that were fitted: one p-value a campaign, uniform if the noise model is right. Distance: Kolmogorov and Smirnov's, p with Stephens' correction."
            .to_owned(),
    );
    table
}

/// Distance that one uniform sample in a hundred of so many values exceeds: the inverse of [`kolmogorov`].
fn critical(count: usize) -> f64 {
    let root = (count as f64).sqrt();
    1.6276 / (root + 0.12 + 0.11 / root)
}

/// The figures for the bars and the ratchet: the distance from uniform, with the 1 % level as its bar (the distance's own
/// p-value is a random number where all is well), and how many lie below 0.05.
pub fn headlines(cases: &[Case]) -> Vec<Headline> {
    families(cases)
        .into_iter()
        .filter(|family| matches!(family.family.as_str(), "ideal" | "chains"))
        .flat_map(|family| {
            let name = &family.family;
            [
                Headline {
                    step: 1.0 / family.values.len().max(1) as f64,
                    ..Headline::number(
                        &format!("nulls.distance.{name}"),
                        &format!("distance of the null's p-values from uniform, {name}"),
                        Better::Lower,
                        Some(critical(family.values.len())),
                        (family.distance, f64::NAN, f64::NAN),
                        family.values.len(),
                    )
                },
                Headline::share(
                    &format!("nulls.p_below_0.05.{name}"),
                    &format!("p-values of the null below 0.05, {name}"),
                    Better::Lower,
                    None,
                    family.rejected,
                ),
            ]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;
    use crate::judge::family::toy;

    #[test]
    fn kolmogorov_agrees_with_published_critical_values() {
        // Limits: 1.2238, 1.3581 and 1.6276 for 10, 5 and 1 %, and 0.82757 for 50 %.
        let many = 100_000_000;
        for (limit, p) in [
            (1.2238, 0.1),
            (1.3581, 0.05),
            (1.6276, 0.01),
            (0.82757, 0.5),
        ] {
            assert!(
                (kolmogorov(limit / 1e4, many) - p).abs() < 2e-3 * p,
                "{limit}"
            );
        }
        // Exact critical values for few (Miller, J. Am. Stat. Assoc. 51 (1956), 111-121).
        for (count, critical, p) in [
            (5, 0.56328, 0.05),
            (10, 0.40925, 0.05),
            (10, 0.48893, 0.01),
            (20, 0.29408, 0.05),
            (50, 0.18845, 0.05),
        ] {
            assert!(
                (kolmogorov(critical, count) - p).abs() < 0.05 * p,
                "{count} {critical}: {}",
                kolmogorov(critical, count)
            );
        }
        for count in [8, 64, 500] {
            assert!((kolmogorov(critical(count), count) - 0.01).abs() < 1e-4);
        }
        // The two forms meet.
        assert!((kolmogorov(0.99999e-4, many) - kolmogorov(1.00001e-4, many)).abs() < 1e-4);
    }

    #[test]
    fn distance_of_a_few_values_is_what_the_hand_gives() {
        assert!((distance(&[0.1, 0.4, 0.9]) - (2.0 / 3.0 - 0.4)).abs() < 1e-12);
        assert!((distance(&[0.9]) - 0.9).abs() < 1e-12);
    }

    #[test]
    fn uniform_values_pass_and_squared_ones_do_not() {
        let mut draw = Draw::new(4, &[]);
        let cases: Vec<Case> = (0..400)
            .map(|index| {
                let mut case = toy::case("null", index % 2 == 1);
                let p = draw.between(0.0, 1.0);
                case.whiteness_p = Some(if case.real_chain { p * p } else { p });
                if case.real_chain {
                    case.wheel_sensor = "tone_ring".into();
                    case.vehicle_sensor = "gps".into();
                }
                case
            })
            .collect();
        let found = families(&cases);
        let names: Vec<&str> = found.iter().map(|family| family.family.as_str()).collect();
        assert_eq!(names, ["ideal", "chains", "tone_ring x gps"]);
        assert!(found[0].p > 0.05 && found[1].p < 1e-4);
        assert!(found[1].rejected.value() > 0.15);
        let told = headlines(&cases);
        let verdict = |key: &str| told.iter().find(|h| h.key == key).unwrap().verdict();
        assert!(verdict("nulls.distance.ideal").starts_with("met"));
        assert!(verdict("nulls.distance.chains").starts_with("**missed**"));
    }
}
