//! What the road is: the law that is true, and the one that a filter which knows the road is told.

use std::sync::OnceLock;

use host_sim::RigLaw;
use muslip::law::TyreLaw;
use muslip_laws::burckhardt::{DRY_ASPHALT, PublishedSet, SNOW, WET_ASPHALT};
use muslip_laws::{Burckhardt, MagicFormula};

use super::search::compass_search;

/// A surface under the tyre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// The law that is true.
    pub truth: RigLaw,
    /// The law that a filter which knows the road is told.
    pub told: Burckhardt<f64>,
}

impl From<PublishedSet> for Surface {
    fn from(set: PublishedSet) -> Self {
        Self {
            truth: RigLaw::Burckhardt(set.law()),
            told: set.law(),
        }
    }
}

/// The Magic Formula on dry tarmac, wet tarmac and snow: B, C, D, E as commonly used (MathWorks, Tire-Road
/// Interaction (Magic Formula), after H. B. Pacejka; wet tarmac's C is 2 in place of 2.3, the largest that the law
/// takes here), with the published set from which the fit of what a filter is told begins.
const MAGIC: [([f64; 4], PublishedSet); 3] = [
    ([10.0, 1.9, 1.0, 0.97], DRY_ASPHALT),
    ([12.0, 2.0, 0.82, 1.0], WET_ASPHALT),
    ([5.0, 2.0, 0.3, 1.0], SNOW),
];

impl Surface {
    /// Dry tarmac, wet tarmac and snow under a tyre of the Magic Formula; a filter is told the Burckhardt law that
    /// comes nearest to it.
    pub fn magic() -> [Self; 3] {
        static FITTED: OnceLock<[Surface; 3]> = OnceLock::new();
        *FITTED.get_or_init(|| {
            MAGIC.map(|([b, c, d, e], like)| {
                match MagicFormula::new(b, c, d, e) {
                    Ok(law) => Self::fitted(RigLaw::MagicFormula(law), like),
                    // The constants above are in range; a test says so.
                    Err(_) => like.into(),
                }
            })
        })
    }

    /// A law, and the Burckhardt law of least squared distance to it.
    fn fitted(truth: RigLaw, like: PublishedSet) -> Self {
        let (c1, c2, c3) = like.law::<f64>().coefficients();
        // In logarithms: the coefficients stay positive, and steps are shares.
        let law = |x: &[f64]| {
            let [c1, c2, c3] = [0, 1, 2].map(|i| x.get(i).copied().unwrap_or(0.0).exp());
            Burckhardt::new(c1, c2, c3).ok()
        };
        let cost = |x: &[f64]| law(x).map_or(f64::INFINITY, |told| distance(&truth, &told));
        let start = vec![c1.ln(), c2.ln(), c3.ln()];
        let (best, _) = compass_search(cost, start, vec![0.1; 3], 12);
        Self {
            truth,
            told: law(&best).unwrap_or(like.law()),
        }
    }

    /// Root mean square difference of the two laws over the slips of a controlled stop.
    pub fn misfit(&self) -> f64 {
        distance(&self.truth, &self.told)
    }
}

/// Slips up to which laws are compared: a controlled stop is hardly ever beyond.
const COMPARED_UP_TO: f64 = 0.4;
const COMPARED: u32 = 80;

fn distance(truth: &RigLaw, told: &Burckhardt<f64>) -> f64 {
    let squares: f64 = (1..=COMPARED)
        .map(|step| COMPARED_UP_TO * f64::from(step) / f64::from(COMPARED))
        .map(|slip| (truth.friction(slip) - told.friction(slip)).powi(2))
        .sum();
    (squares / f64::from(COMPARED)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_filter_is_told_is_near_the_tyre_and_not_the_tyre() {
        for (surface, ([.., d, _], like)) in Surface::magic().into_iter().zip(MAGIC) {
            assert!(matches!(surface.truth, RigLaw::MagicFormula(_)));
            let misfit = surface.misfit();
            assert!((0.001 * d..0.06 * d).contains(&misfit), "{misfit} of {d}");
            assert!(misfit < distance(&surface.truth, &like.law()), "{misfit}");
        }
    }
}
