//! Sentences of the results, the same in the terminal and in reports.

use muslip::filter::PeakEstimate;

use crate::estimate::{Consistency, EstimateResult, EstimatorKind, ModelUse, Operation, Verdict};
use crate::measure::{FrictionNoise, Survey};

/// Probability below which innovations are not believed to be white.
const WHITE_FROM: f64 = 0.01;

/// A value and its 1-sigma with as many decimals as the latter justifies.
pub fn plus_minus(value: f64, std: f64) -> String {
    let decimals = decimals_for(std);
    format!("{value:.decimals$} \u{b1} {std:.decimals$}")
}

/// Decimals that show two digits of a standard deviation, or one where the first of them is 4 or more.
pub fn decimals_for(std: f64) -> usize {
    if std.is_finite() && std > 0.0 {
        (1.0 - (2.5 * std).log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        4
    }
}

/// Peak friction and critical slip of an estimate or a fit, in a sentence.
pub fn verdict_sentence(peak: &PeakEstimate<f64>) -> String {
    let friction = plus_minus(peak.peak_friction, peak.peak_friction_std);
    let slip = plus_minus(peak.critical_slip, peak.critical_slip_std);
    if peak.peak_friction > 0.0 && peak.critical_slip > 0.0 {
        format!("Friction peaks at {friction}, at a slip of {slip}.")
    } else {
        format!(
            "No peak found: the estimate left the law's range (peak friction {friction}, critical slip {slip})."
        )
    }
}

/// The same of an estimate, with a warning where the innovations contradict its uncertainty.
pub fn estimate_sentence(result: &EstimateResult) -> String {
    let sentence = verdict_sentence(&result.peak);
    match result.consistency.verdict {
        Verdict::Overconfident => {
            format!("{sentence} The measurements scatter more than this uncertainty allows.")
        }
        Verdict::Consistent | Verdict::Conservative => sentence,
    }
}

/// Result and meaning of the consistency tests.
pub fn consistency_sentence(consistency: &Consistency, estimator: EstimatorKind) -> String {
    let Consistency {
        mean_nis,
        nis_low,
        nis_high,
        whiteness_p,
        verdict,
    } = *consistency;
    let meaning = match (verdict, estimator) {
        (Verdict::Consistent, _) => "the innovations agree with the stated uncertainty",
        (Verdict::Conservative, EstimatorKind::Article) => {
            "expected of the article's filter, which inflates the measurement sigma three times and adds pseudonoise"
        }
        (Verdict::Conservative, EstimatorKind::Efficient) => {
            "the measurements scatter less than declared, and the learnt variance is held above 0.15 times the declared one"
        }
        (Verdict::Overconfident, _) => {
            "the measurements scatter about the curve more than their noise explains: the tyre's curve has another shape, or the noise is larger than declared. Do not rely on the 1-sigma values"
        }
    };
    let colour = if whiteness_p >= WHITE_FROM {
        format!("Innovations are white (p = {whiteness_p:.2}).")
    } else {
        "Innovations are correlated (p < 0.01): neighbouring samples share an error (a tyre curve of another shape, or filtered noise) that the 1-sigma values do not include.".to_owned()
    };
    format!(
        "{}: mean NIS {mean_nis:.3} (95 % band {nis_low:.3} to {nis_high:.3}); {meaning}. {colour}",
        capitalised(verdict.word())
    )
}

/// What of a model was compensated, what was not and why, and what operation the estimate holds at.
pub fn model_sentences(model: &ModelUse) -> Vec<String> {
    let names: Vec<String> = model
        .compensated()
        .map(|mechanism| {
            let parameters: Vec<String> = mechanism
                .parameters
                .iter()
                .map(|(name, value, unit)| {
                    let unit = if unit == "1" { "" } else { unit };
                    format!("{name} {value:.4} {unit}").trim_end().to_owned()
                })
                .collect();
            format!("{} ({})", mechanism.id, parameters.join(", "))
        })
        .collect();
    let mut sentences = vec![if names.is_empty() {
        "Compensated: none of the model's effects.".to_owned()
    } else {
        format!("Compensated: {}.", names.join("; "))
    }];
    let rest: Vec<String> = model
        .not_compensated()
        .map(|(mechanism, reason)| format!("{}: {reason}", mechanism.name()))
        .collect();
    if !rest.is_empty() {
        sentences.push(format!("Not compensated: {}.", rest.join("; ")));
    }
    if !model.holds_at.is_empty() {
        sentences.push(format!(
            "The peak friction is that at {}.",
            model
                .holds_at
                .iter()
                .map(Operation::in_words)
                .collect::<Vec<_>>()
                .join(" and ")
        ));
    }
    sentences
}

/// Where the noise of a measurement came from.
pub fn noise_sentence(survey: &Survey) -> String {
    let median = survey.median_normal_force_n;
    match survey.noise {
        FrictionNoise::Declared { drag_std_n } => format!(
            "Friction noise {:.4} (1-sigma): {drag_std_n} N of drag, declared in the rig file, over a median normal force of {median:.0} N.",
            drag_std_n / median
        ),
        FrictionNoise::Estimated { friction_std } => format!(
            "Friction noise {friction_std:.4} (1-sigma), estimated from the scatter of the recording: the rig file declares none for drag_force_n."
        ),
        FrictionNoise::Modelled { drag_std_n, .. } => format!(
            "Friction noise {:.4} (1-sigma): {drag_std_n:.4} N of drag, from the model, over a median normal force of {median:.0} N.",
            drag_std_n / median
        ),
    }
}

/// The first letter large.
#[must_use]
pub fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_uncertainty_decides_how_many_digits_are_shown() {
        assert_eq!(plus_minus(0.338894, 0.0112), "0.339 \u{b1} 0.011");
        assert_eq!(plus_minus(0.338894, 0.00093), "0.3389 \u{b1} 0.0009");
        assert_eq!(plus_minus(1.0, 0.25), "1.00 \u{b1} 0.25");
        assert_eq!(plus_minus(123.4, 25.0), "123 \u{b1} 25");
        assert_eq!(plus_minus(0.5, 0.0), "0.5000 \u{b1} 0.0000");
    }
}
