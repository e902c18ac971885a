//! Predictions of unseen runs: better than the base's, and as sure as they say.

use crate::judge::case::Case;
use crate::judge::family::{Family, families};
use crate::judge::gain::GainCase;
use crate::judge::headline::{Better, Headline, Shown};
use crate::share::{Share, mean, percent, quantile};
use crate::table::Table;

const PLACES: [&str; 3] = ["first", "middle", "last"];

fn gains<'a>(cases: &'a [Case], family: Family, place: &str) -> Vec<&'a GainCase> {
    family
        .of(cases)
        .flat_map(|case| &case.gains)
        .filter(|gain| place.is_empty() || gain.place == place)
        .collect()
}

/// Interval score of the 90 % band over that of a band around the base, as wide as the base's residuals are: run by run.
fn band_scores(gains: &[&GainCase]) -> Vec<f64> {
    gains
        .iter()
        .filter_map(|gain| gain.band_score)
        .map(|(repaired, base)| repaired / base)
        // A prediction that is missing is as bad as any.
        .map(|ratio| {
            if ratio.is_finite() {
                ratio.min(WORST)
            } else {
                WORST
            }
        })
        .collect()
}

/// A band is not told to be worse than so many times the base's.
const WORST: f64 = 100.0;

/// Share of the scored samples whose written reading lies within the 90 % band, run by run.
fn bands(gains: &[&GainCase]) -> Vec<f64> {
    gains
        .iter()
        .filter(|gain| gain.in_band.1 > 0)
        .map(|gain| gain.in_band.0 as f64 / gain.in_band.1 as f64)
        .collect()
}

/// Predictions of unseen runs, by where they stand in their campaign.
pub fn table(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Predictions of unseen runs",
        &[
            "sensors",
            "runs",
            "n",
            "worse than base by 1 %",
            "95 % interval",
            "base worse than least squares",
            "95 % interval",
            "written reading within the 90 % band",
            "95 % interval",
            "score of the band over the base's, median",
        ],
    );
    for family in families(cases) {
        for place in PLACES.into_iter().chain([""]) {
            let runs = gains(cases, family, place);
            if runs.is_empty() {
                continue;
            }
            let [worse, worse_interval, _] = Share::count(&runs, |gain| gain.worse).cells();
            let [base, base_interval, _] = Share::count(&runs, |gain| gain.base_worse).cells();
            let shares = bands(&runs);
            let (band, error) = mean(&shares);
            let (band, band_interval) = if shares.is_empty() {
                ("-".to_owned(), "-".to_owned())
            } else {
                let (low, high) = (band - 1.96 * error, (band + 1.96 * error).min(1.0));
                (
                    percent(band),
                    format!("{}..{}", percent(low), percent(high)),
                )
            };
            table.row([
                family.name().to_owned(),
                if place.is_empty() { "all" } else { place }.to_owned(),
                runs.len().to_string(),
                worse,
                worse_interval,
                base,
                base_interval,
                band,
                band_interval,
                match band_scores(&runs) {
                    scores if scores.is_empty() => "-".to_owned(),
                    scores => format!("{:.2}", quantile(&scores, 0.5)),
                },
            ]);
        }
    }
    table.note = Some(
        "The band is for the reading as it was written, with its noise: the predicted drag and 1.645 of `drag_force_sigma_n`. Its score: mean width, and twenty times what lies outside (Gneiting and Raftery 2007); the base's band is as wide as the RMS of what the base misses on that very run."
            .to_owned(),
    );
    table
}

/// The figures for the bars and the ratchet.
pub fn headlines(cases: &[Case]) -> Vec<Headline> {
    use Better::Lower;
    let mut all = Vec::new();
    for family in families(cases) {
        for place in [""].into_iter().chain(PLACES) {
            let runs = gains(cases, family, place);
            let (end, of) = if place.is_empty() {
                (String::new(), "unseen runs".to_owned())
            } else {
                (format!(".{place}"), format!("{place} runs unseen"))
            };
            all.push(Headline::share(
                &family.key(&format!("predictions.worse{end}")),
                &family.what(&format!("{of}: repaired worse than base by 1 %")),
                Lower,
                Some(0.005),
                Share::count(&runs, |gain| gain.worse),
            ));
            if place.is_empty() {
                all.push(Headline::share(
                    &family.key("predictions.base_worse"),
                    &family.what(&format!("{of}: base worse than least squares by 1 %")),
                    Lower,
                    None,
                    Share::count(&runs, |gain| gain.base_worse),
                ));
            }
            let bands = bands(&runs);
            let (value, error) = mean(&bands);
            all.push(Headline::off_nominal(
                &family.key(&format!("predictions.band90{end}")),
                &family.what(&format!("{of}: written reading within the 90 % band")),
                None,
                Shown {
                    nominal: 0.90,
                    value,
                    low: value - 1.96 * error,
                    high: (value + 1.96 * error).min(1.0),
                },
                bands.len(),
            ));
            if place.is_empty() {
                all.push(Headline::quantile(
                    &family.key("predictions.band_score"),
                    &family.what(&format!(
                        "{of}: score of the 90 % band over the base's, median"
                    )),
                    Lower,
                    None,
                    &band_scores(&runs),
                    0.5,
                ));
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::family::toy;

    #[test]
    fn predictions_are_told_by_place() {
        let mut case = toy::case("single", false);
        case.gains = PLACES
            .iter()
            .map(|place| GainCase {
                file: String::new(),
                repaired: 1.0,
                base: 1.0,
                floor: 0.0,
                floor_best: 0.0,
                share: None,
                share_of_best: None,
                worse: *place == "first",
                base_worse: false,
                place: (*place).to_owned(),
                in_band: (if *place == "last" { 80 } else { 100 }, 100),
                band_score: Some((
                    if *place == "first" {
                        f64::INFINITY
                    } else {
                        1.0
                    },
                    2.0,
                )),
            })
            .collect();
        let told = headlines(&[case]);
        assert!((toy::value(&told, "predictions.worse") - 1.0 / 3.0).abs() < 1e-12);
        assert!((toy::value(&told, "predictions.worse.first") - 1.0).abs() < 1e-12);
        // A band that holds all is as far off as one that holds too few.
        assert!((toy::value(&told, "predictions.band90") - 0.1 / 3.0).abs() < 1e-12);
        assert!((toy::value(&told, "predictions.band90.last") - 0.1).abs() < 1e-12);
        assert!((toy::value(&told, "predictions.band90.first") - 0.1).abs() < 1e-12);
        assert!((toy::value(&told, "predictions.band_score") - 0.5).abs() < 1e-12);
    }
}
