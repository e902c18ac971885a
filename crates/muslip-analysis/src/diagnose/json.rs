//! `diagnosis.json`: the diagnosis as text, with every number finite.
//!
//! JSON has no word for a number that is not finite, and the contract wants numbers. So where a
//! computation had no answer, the file says what a reader must not mistake for one: an unknown standard
//! deviation is the largest number there is, an unknown value is 0 with that standard deviation, an
//! unknown strength or gain is 0, an unknown smallest effect is absent.

use muslip_diagnose::outcome::{BeforeAfter, Diagnosis, Score};

/// Makes every number of a diagnosis finite, every standard deviation non-negative and every share and
/// probability lie from 0 to 1.
pub fn make_finite(diagnosis: &mut Diagnosis) {
    for noise in diagnosis.noise.values_mut() {
        spread(&mut noise.sigma);
        noise.declared = noise.declared.filter(|sigma| sigma.is_finite());
    }
    for estimate in diagnosis.base.values_mut() {
        value(&mut estimate.value, &mut estimate.std);
    }
    for interval in &mut diagnosis.r#where {
        numbers([&mut interval.start_s, &mut interval.end_s, &mut interval.z]);
    }
    for region in &mut diagnosis.regions {
        numbers([&mut region.low, &mut region.high, &mut region.z]);
        share(&mut region.share);
    }
    for mechanism in &mut diagnosis.mechanisms {
        for figure in &mut mechanism.parameters {
            value(&mut figure.value, &mut figure.std);
        }
        let evidence = &mut mechanism.evidence;
        numbers([
            &mut evidence.delta_bic,
            &mut evidence.holdout_nll_gain_per_sample,
            &mut mechanism.effect_sigma,
        ]);
        share(&mut evidence.confidence);
        for alternative in &mut mechanism.confusable_with {
            share(&mut alternative.confidence);
        }
    }
    for rest in &mut diagnosis.unexplained {
        numbers([&mut rest.z, &mut rest.share]);
    }
    for looked_for in &mut diagnosis.looked_for {
        looked_for.minimum_detectable = looked_for
            .minimum_detectable
            .take()
            .filter(|least| least.value.is_finite());
    }
    for fault in &mut diagnosis.data_faults {
        numbers([&mut fault.start_s, &mut fault.end_s]);
    }
    for finding in &mut diagnosis.chain {
        value(&mut finding.value, &mut finding.std);
    }
    let fit = &mut diagnosis.fit;
    for BeforeAfter { before, after } in [&mut fit.fit, &mut fit.holdout] {
        for score in [before, after] {
            let Score {
                rmse_n,
                nll_per_sample,
                whiteness_p,
            } = score;
            numbers([rmse_n, nll_per_sample]);
            *whiteness_p = whiteness_p.filter(|p| p.is_finite());
        }
    }
}

/// A number that says nothing where it is not finite.
fn numbers<const N: usize>(numbers: [&mut f64; N]) {
    for number in numbers {
        if number.is_nan() {
            *number = 0.0;
        }
        *number = number.clamp(f64::MIN, f64::MAX);
    }
}

fn value(value: &mut f64, std: &mut f64) {
    if !value.is_finite() {
        *value = 0.0;
        *std = f64::MAX;
    }
    spread(std);
}

fn spread(std: &mut f64) {
    if !(0.0..=f64::MAX).contains(std) {
        *std = f64::MAX;
    }
}

fn share(share: &mut f64) {
    *share = if share.is_nan() {
        0.0
    } else {
        share.clamp(0.0, 1.0)
    };
}

/// The text of `diagnosis.json`: indented, numbers with all their digits, keys in the contract's order.
///
/// # Errors
/// What `serde_json` answers; a [`Diagnosis`] holds nothing that it refuses.
pub fn to_text(diagnosis: &Diagnosis) -> Result<String, serde_json::Error> {
    let mut text = serde_json::to_string_pretty(diagnosis)?;
    text.push('\n');
    Ok(text)
}
