//! Whether the standard deviations of reported figures are true, and no wider than they must be.

use std::collections::BTreeMap;

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use crate::judge::case::{Case, FigureCase};
use crate::judge::family::{Family, families, resampled};
use crate::judge::headline::{Better, Headline};
use crate::share::{Share, percent, quantile};
use crate::table::Table;

/// Continuous ranked probability score of a normal forecast: 0 for a sure and right one, the error's size for a sure
/// one, in the figure's unit. Closed form of Gneiting and Raftery, "Strictly proper scoring rules, prediction, and
/// estimation", J. Am. Stat. Assoc. 102 (2007), 359-378, equation 21 with its sign turned.
pub fn crps(error: f64, std: f64) -> f64 {
    if !(std.is_finite() && std > 1e-12 * error.abs()) {
        return error.abs();
    }
    let normal = Normal::standard();
    let z = error / std;
    std * (z * (2.0 * normal.cdf(z) - 1.0) + 2.0 * normal.pdf(z)
        - 1.0 / std::f64::consts::PI.sqrt())
}

/// Share of normal errors within one and two standard deviations.
const NORMAL: [f64; 2] = [0.6827, 0.9545];

/// Factors on the standard deviations that are tried, in steps of 5 %, 1 in the middle.
const STEPS: i32 = 61;

fn factor(step: usize) -> f64 {
    1.05f64.powi(step as i32 - STEPS)
}

/// What an error of a figure is told in: the true figure, or what is known of it where that is more, so that figures
/// whose truth is next to nothing do not outweigh all others.
fn scale(figure: &FigureCase) -> f64 {
    [figure.truth.abs(), figure.std]
        .into_iter()
        .chain(figure.attainable_std)
        .filter(|part| part.is_finite())
        .fold(0.0, f64::max)
}

/// How well the standard deviations of some figures suit their errors.
#[derive(Clone, Debug)]
pub struct Sharpness {
    /// For each campaign the CRPS of its figures, in their scale, at each factor.
    costs: Vec<Vec<f64>>,
    figures: usize,
}

impl Sharpness {
    fn of<'a>(campaigns: impl IntoIterator<Item = Vec<&'a FigureCase>>) -> Sharpness {
        let mut sharpness = Sharpness {
            costs: Vec::new(),
            figures: 0,
        };
        for figures in campaigns {
            let mut cost = vec![0.0; 2 * STEPS as usize + 1];
            for figure in figures {
                let error = figure.value - figure.truth;
                let scale = scale(figure);
                // A score relative to nothing is none.
                if !error.is_finite() || scale < 1e-12 {
                    continue;
                }
                sharpness.figures += 1;
                for (step, sum) in cost.iter_mut().enumerate() {
                    *sum += crps(error, factor(step) * figure.std) / scale;
                }
            }
            sharpness.costs.push(cost);
        }
        sharpness
    }

    fn total(&self, places: &mut dyn Iterator<Item = usize>) -> Vec<f64> {
        let mut total = vec![0.0; 2 * STEPS as usize + 1];
        for place in places {
            for (sum, cost) in total.iter_mut().zip(&self.costs[place]) {
                *sum += cost;
            }
        }
        total
    }

    /// Mean CRPS, in the figures' scale.
    pub fn relative(&self) -> f64 {
        self.total(&mut (0..self.costs.len()))[STEPS as usize] / self.figures as f64
    }

    /// CRPS over what the same errors would have with the best single factor on all standard deviations, with the 95 %
    /// interval by campaigns drawn anew: 1 is as good as one factor can make it, and too wide costs like too narrow.
    pub fn ratio(&self) -> (f64, f64, f64) {
        let of = |total: &[f64]| {
            total[STEPS as usize] / total.iter().copied().fold(f64::INFINITY, f64::min)
        };
        let (low, high) = resampled(&[self.costs.len()], |places| {
            of(&self.total(&mut places[0].iter().copied()))
        });
        (of(&self.total(&mut (0..self.costs.len()))), low, high)
    }

    /// The best single factor: above 1 where the standard deviations are too small.
    pub fn best_factor(&self) -> f64 {
        self.total(&mut (0..self.costs.len()))
            .iter()
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(b.1))
            .map_or(f64::NAN, |best| factor(best.0))
    }
}

fn all_figures(cases: &[Case], family: Family) -> Vec<Vec<&FigureCase>> {
    family
        .of(cases)
        .map(|case| case.figures.iter().collect::<Vec<_>>())
        .filter(|figures| !figures.is_empty())
        .collect()
}

/// Standard deviations in units of what the data allow, where that is known.
fn widths<'a>(figures: impl IntoIterator<Item = &'a FigureCase>) -> Vec<f64> {
    figures
        .into_iter()
        .filter_map(|figure| Some(figure.std / figure.attainable_std.filter(|std| *std > 0.0)?))
        .filter(|width| width.is_finite())
        .collect()
}

fn within<'a>(figures: impl IntoIterator<Item = &'a FigureCase>, limit: f64) -> Share {
    Share::count(figures, |figure| figure.pull.abs() <= limit)
}

/// Reported figures: how often the truth lies within their standard deviations, and how wide these are.
pub fn table(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Calibration of figures",
        &[
            "figure",
            "sensors",
            "n",
            "within 1 std",
            "95 % interval",
            "within 2",
            "95 % interval",
            "within 3",
            "95 % interval",
            "std / attainable, median",
            "error, median",
            "std, median",
            "CRPS",
            "CRPS / best",
            "best factor",
        ],
    );
    let mut row = |key: String, family: Family, campaigns: Vec<Vec<&FigureCase>>| {
        let figures: Vec<&FigureCase> = campaigns.iter().flatten().copied().collect();
        if figures.is_empty() {
            return;
        }
        let number = |value: f64| {
            if value.is_finite() {
                format!("{value:.2}")
            } else {
                "-".to_owned()
            }
        };
        let middle = |value: &dyn Fn(&FigureCase) -> f64| {
            let values: Vec<f64> = figures
                .iter()
                .map(|figure| value(figure) / scale(figure).max(1e-12))
                .collect();
            percent(quantile(&values, 0.5))
        };
        let share = |limit| within(figures.iter().copied(), limit);
        let [
            [one, one_interval, _],
            [two, two_interval, _],
            [three, interval, _],
        ] = [1.0, 2.0, 3.0].map(|limit| share(limit).cells());
        let sharpness = Sharpness::of(campaigns);
        let total = sharpness.total(&mut (0..sharpness.costs.len()));
        // One factor for a handful of figures follows their luck.
        let of_several = |value: f64| {
            if figures.len() < 5 { f64::NAN } else { value }
        };
        let best = total.iter().copied().fold(f64::INFINITY, f64::min);
        table.row([
            key,
            family.name().to_owned(),
            figures.len().to_string(),
            one,
            one_interval,
            two,
            two_interval,
            three,
            interval,
            number(quantile(&widths(figures.iter().copied()), 0.5)),
            middle(&|figure| (figure.value - figure.truth).abs()),
            middle(&|figure| figure.std),
            percent(sharpness.relative()),
            number(of_several(total[STEPS as usize] / best)),
            number(of_several(sharpness.best_factor())),
        ]);
    };
    let told = families(cases);
    for family in &told {
        row("(all)".to_owned(), *family, all_figures(cases, *family));
    }
    // By mechanism, the pooled row says nothing beside those of its parts.
    let parts = if told.len() > 1 { &told[1..] } else { &told };
    let mut groups: BTreeMap<String, Vec<(&Case, &FigureCase)>> = BTreeMap::new();
    for case in cases {
        for figure in &case.figures {
            groups
                .entry(format!("{} {}", figure.mechanism, figure.name))
                .or_default()
                .push((case, figure));
        }
    }
    for name in ["peak_friction", "critical_slip"] {
        for family in parts {
            let own = family.of(cases).flat_map(|case| &case.base);
            let own = own.filter(|figure| figure.name == name);
            row(
                format!("base {name}, nothing missing"),
                *family,
                own.map(|figure| vec![figure]).collect(),
            );
        }
    }
    for (key, group) in groups {
        for family in parts {
            let own = group.iter().filter(|pair| family.holds(pair.0));
            row(key.clone(), *family, own.map(|pair| vec![pair.1]).collect());
        }
    }
    table.note = Some(
        "A normal error lies within 1, 2 and 3 of its standard deviations in 68, 95 and 99.7 % of cases. Attainable: what least squares with the true form could reach on the same recordings. CRPS: of the stated normal forecast (Gneiting and Raftery 2007), mean; error, std and CRPS relative to the true figure, or to its std where that is more. CRPS / best: over that of the same errors with all standard deviations multiplied by the best single factor, so that wide and narrow both cost."
            .to_owned(),
    );
    table
}

/// The figures for the bars and the ratchet.
pub fn headlines(cases: &[Case]) -> Vec<Headline> {
    use Better::{Higher, Lower};
    let mut all = Vec::new();
    for family in families(cases) {
        let campaigns = all_figures(cases, family);
        let figures: Vec<&FigureCase> = campaigns.iter().flatten().copied().collect();
        for (limit, nominal, half) in [(1, NORMAL[0], 0.08), (2, NORMAL[1], 0.03)] {
            all.push(Headline::share_off_nominal(
                &family.key(&format!("figures.within{limit}")),
                &family.what(&format!("figures within {limit} of their std")),
                Some(half),
                nominal,
                within(figures.iter().copied(), f64::from(limit)),
            ));
        }
        all.push(Headline::share(
            &family.key("figures.within3"),
            &family.what("figures within 3 of their std"),
            Higher,
            Some(0.985),
            within(figures.iter().copied(), 3.0),
        ));
        all.push(Headline::share_off_nominal(
            &family.key("base.within2"),
            &family.what("nothing missing: base parameters within 2 of their std"),
            Some(0.03),
            NORMAL[1],
            within(family.of(cases).flat_map(|case| &case.base), 2.0),
        ));
        all.push(Headline::quantile(
            &family.key("figures.sharpness"),
            &family.what("std of figures over the attainable, median"),
            Lower,
            Some(1.3),
            &widths(figures.iter().copied()),
            0.5,
        ));
        let sharpness = Sharpness::of(campaigns);
        all.push(Headline::number(
            &family.key("figures.crps_ratio"),
            &family.what("CRPS of figures over that with the best factor on the stds"),
            Lower,
            None,
            sharpness.ratio(),
            sharpness.figures,
        ));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;
    use crate::judge::family::toy;

    #[test]
    fn crps_is_the_integral_that_it_stands_for() {
        let normal = Normal::standard();
        for (error, std) in [(0.0, 1.0), (0.7, 1.0), (-3.0, 0.5), (2.0, 10.0)] {
            let step = 1e-3f64;
            let sum: f64 = (-80_000..80_000)
                .map(|i| {
                    let x = (f64::from(i) + 0.5) * step;
                    // The forecast around 0, the truth at -error.
                    let beyond = f64::from(u8::from(x >= -error));
                    (normal.cdf(x / std) - beyond).powi(2) * step
                })
                .sum();
            assert!((crps(error, std) - sum).abs() < 1e-5, "{error} {std}");
        }
        assert!((crps(0.3, 0.0) - 0.3).abs() < 1e-12);
        assert!((crps(0.3, f64::NAN) - 0.3).abs() < 1e-12);
        // At no error (sqrt(2) - 1) / sqrt(pi).
        assert!((crps(0.0, 1.0) - (2f64.sqrt() - 1.0) / std::f64::consts::PI.sqrt()).abs() < 1e-9);
    }

    /// Figures with normal errors of 0.1 whose standard deviations are so many times that.
    fn figures(stated: f64) -> Vec<Case> {
        let mut draw = Draw::new(9, &[]);
        (0..4000)
            .map(|_| {
                let mut case = toy::case("single", false);
                case.figures = vec![toy::figure(0.1 * draw.normal(), 0.1 * stated, Some(0.1))];
                case
            })
            .collect()
    }

    #[test]
    fn true_intervals_cover_and_false_ones_cost() {
        let honest = headlines(&figures(1.0));
        assert!(toy::value(&honest, "figures.within1") < 0.02);
        assert!(toy::value(&honest, "figures.within2") < 0.01);
        assert!((toy::value(&honest, "figures.within3") - 0.997).abs() < 0.003);
        assert!((toy::value(&honest, "figures.sharpness") - 1.0).abs() < 1e-9);
        assert!(toy::value(&honest, "figures.crps_ratio") < 1.002);
        for stated in [0.4, 2.5] {
            let told = headlines(&figures(stated));
            // Too wide is as wrong as too narrow.
            assert!(toy::value(&told, "figures.within1") > 0.25);
            assert!((toy::value(&told, "figures.sharpness") - stated).abs() < 1e-9);
            assert!(toy::value(&told, "figures.crps_ratio") > 1.1);
            let cases = figures(stated);
            let sharpness = Sharpness::of(all_figures(&cases, Family::Together));
            assert!((sharpness.best_factor() * stated - 1.0).abs() < 0.06);
        }
    }

    #[test]
    fn a_truth_of_next_to_nothing_does_not_outweigh_all_others() {
        let mut cases = figures(1.0);
        let before = Sharpness::of(all_figures(&cases, Family::Together));
        // Right within its std, where the truth is next to nothing, and where it is nothing.
        let mut tiny = toy::figure(0.1, 0.1, Some(0.1));
        tiny.truth = 1e-9;
        tiny.value = 0.1;
        let mut none = tiny.clone();
        none.truth = 0.0;
        cases[0].figures.extend([tiny, none]);
        let after = Sharpness::of(all_figures(&cases, Family::Together));
        assert_eq!(after.figures, before.figures + 2);
        assert!((after.relative() / before.relative() - 1.0).abs() < 0.01);
        assert!((after.ratio().0 / before.ratio().0 - 1.0).abs() < 0.01);
    }

    #[test]
    fn base_parameters_of_nulls_are_held_to_their_std() {
        let mut case = toy::case("null", false);
        case.base = vec![toy::figure(0.1, 0.1, None), toy::figure(0.5, 0.1, None)];
        case.base[1].name = "critical_slip".into();
        let told = headlines(&[case.clone()]);
        assert!((toy::value(&told, "base.within2") - 0.4545).abs() < 1e-12);
        let rows = table(&[case]).rows;
        assert_eq!(rows[0][0], "base critical_slip, nothing missing");
    }

    #[test]
    fn families_stand_apart_where_there_is_more_than_one() {
        let mut cases = figures(1.0);
        cases.truncate(4);
        assert_eq!(families(&cases), [Family::Together]);
        cases[0].real_chain = true;
        let keys: Vec<String> = headlines(&cases).into_iter().map(|h| h.key).collect();
        for key in [
            "figures.within1",
            "figures.within1.ideal",
            "figures.within1.chains",
        ] {
            assert!(keys.iter().any(|k| k == key), "{key}");
        }
    }
}
