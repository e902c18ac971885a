//! Whether what looks like a stretch of track is a stretch of time: runs at the same speed cannot tell, runs at
//! different speeds can.

use crate::choose::{Search, evidence};
use crate::data::Data;
use crate::fit::{Fitted, Joint, Problem};
use crate::mechanism::Id;
use crate::model::Term;

/// Nats, and share of what the stretch explains, by which time must fit better than place.
const MARGIN: (f64, f64) = (10.0, 0.002);
/// Steps of the fit in time.
const STEPS: usize = 15;

/// The chosen model without its surface patch where a change that comes and goes at the same time of every run fits
/// better than one at the same place.
#[must_use]
pub fn better_in_time(joint: &Joint<'_>, found: &Search) -> Option<Fitted> {
    let data = joint.data();
    let chosen = &found.chosen.fitted;
    let patch = chosen
        .model
        .terms
        .iter()
        .position(|term| data.catalogue.get(term.entry).id() == Id::SurfacePatch)?;
    let without = joint.without(found, patch);
    let clocked = by_the_clock(data);
    let other = Joint {
        parts: joint
            .parts
            .iter()
            .map(|part| Problem {
                data: &clocked,
                ..*part
            })
            .collect(),
    };
    let entry = chosen.model.terms[patch].entry;
    let left = evidence(&other, &without.model);
    let best = data
        .catalogue
        .get(entry)
        .starts(&clocked.context, &clocked.series, &left)
        .into_iter()
        .map(|parameters| {
            let mut model = without.model.clone();
            model.terms.push(Term { entry, parameters });
            other.fit(&model, STEPS).loss
        })
        .fold(f64::INFINITY, f64::min);
    let explained = (without.loss - chosen.loss).max(0.0);
    (best + MARGIN.0 + MARGIN.1 * explained < chosen.loss).then_some(without)
}

/// The campaign with the time since each run's start in the place of distance, on the same scale.
fn by_the_clock(data: &Data) -> Data {
    let mut clocked = data.clone();
    let duration = |time: &[f64]| match time {
        [first, .., last] => last - first,
        _ => 0.0,
    };
    let longest = data
        .series
        .iter()
        .map(|s| duration(&s.time))
        .fold(f64::MIN_POSITIVE, f64::max);
    let speed = data.context.distance / longest;
    for series in &mut clocked.series {
        let start = series.time.first().copied().unwrap_or(0.0);
        series.distance = series.time.iter().map(|t| (t - start) * speed).collect();
    }
    clocked
}
