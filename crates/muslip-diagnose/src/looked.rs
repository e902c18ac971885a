//! What was looked for: whether the recordings could have shown a mechanism, and the smallest that they would
//! have shown. A verdict of "consistent" is only as good as this list.

use rayon::prelude::*;

use crate::choose::{Limits, belongs, evidence, required};
use crate::confidence::inverse;
use crate::fit::Joint;
use crate::mechanism::Id;
use crate::model::{Model, Term};
use crate::outcome::{LookedFor, MinimumDetectable};

/// A column of which less than this share is left after refitting the base law cannot be told from it.
const VISIBILITY: f64 = 0.002;
/// Added to the threshold in standard deviations, so that four in five effects of that size are seen.
const POWER: f64 = 0.84;

/// Every mechanism of the vocabulary; `joints` are the balances that the recordings allow, with their base models.
#[must_use]
pub fn looked_for(joints: &[(&Joint<'_>, &Model)], limits: &Limits) -> Vec<LookedFor> {
    Id::ALL
        .par_iter()
        .map(|&id| {
            joints
                .iter()
                .find_map(|(joint, base)| one(joint, base, id, limits))
                .unwrap_or(LookedFor {
                    id: id.as_str(),
                    identifiable: false,
                    minimum_detectable: None,
                })
        })
        .collect()
}

fn one(joint: &Joint<'_>, base: &Model, id: Id, limits: &Limits) -> Option<LookedFor> {
    let data = joint.data();
    let entry = (0..data.catalogue.entries().len())
        .find(|e| data.catalogue.get(*e).id() == id && belongs(joint, *e))?;
    let mechanism = data.catalogue.get(entry);
    let found = evidence(joint, base);
    let starts = mechanism.starts(&data.context, &data.series, &found);
    let absent = LookedFor {
        id: id.as_str(),
        identifiable: false,
        minimum_detectable: None,
    };
    let Some(start) = starts.get(starts.len() / 3) else {
        return Some(absent);
    };
    let mut model = base.clone();
    model.terms.push(Term {
        entry,
        parameters: start.clone(),
    });
    let threshold = (2.0 * required(limits, joint.count(), 0.0)).sqrt() + POWER;
    let parameters = mechanism.parameters(&data.context);
    let Some(amplitude) = mechanism.amplitude() else {
        // No parameter of this mechanism is its size: would the start have been seen?
        let change = joint.loss(&model) - joint.loss(base);
        return Some(LookedFor {
            identifiable: change.abs() > required(limits, joint.count(), 0.0),
            ..absent
        });
    };
    let (information, _, _) = joint.normal(&model);
    let at = base.vector().len() + amplitude;
    let keep: Vec<usize> = (0..base.vector().len()).chain([at]).collect();
    let reduced = nalgebra::DMatrix::from_fn(keep.len(), keep.len(), |i, j| {
        information[(keep[i], keep[j])]
    });
    let raw = information[(at, at)];
    let last = keep.len() - 1;
    let variance = inverse(&reduced)[(last, last)];
    let visible = raw > 0.0 && variance > 0.0 && 1.0 / (variance * raw) > VISIBILITY;
    let smallest = threshold * variance.max(0.0).sqrt();
    let parameter = parameters.get(amplitude)?;
    let plausible = smallest.is_finite() && smallest < 0.5 * (parameter.high - parameter.low);
    Some(LookedFor {
        id: id.as_str(),
        identifiable: visible && plausible,
        minimum_detectable: (visible && smallest.is_finite()).then(|| MinimumDetectable {
            name: parameter.name.clone(),
            value: smallest,
            unit: parameter.unit.to_owned(),
        }),
    })
}
