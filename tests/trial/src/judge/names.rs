//! What a name is worth against a campaign's truth: one rule for the tool, other builds of it and textbook methods.

use crate::generate::campaign::Truth;

/// How a name stands to what is concealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// It names a concealed effect.
    Accepted,
    /// It may stand beside a concealed effect without being wrong, but is not the answer.
    Beside,
    /// The measuring chain itself makes it true: neither the answer nor in its way.
    OfTheChain,
    False,
}

/// How a name stands.
pub fn standing(truth: &Truth, id: &str) -> Standing {
    let any = |names: &[String]| names.iter().any(|name| name == id);
    if truth
        .concealed
        .iter()
        .any(|concealed| any(&concealed.accept))
    {
        Standing::Accepted
    } else if any(&truth.tolerated) {
        Standing::OfTheChain
    } else if truth
        .concealed
        .iter()
        .any(|concealed| any(&concealed.tolerated))
    {
        Standing::Beside
    } else {
        Standing::False
    }
}

/// Place of the first name that is an answer at all: what the chain makes true is passed over.
pub fn first(standings: &[Standing]) -> Option<usize> {
    standings
        .iter()
        .position(|standing| *standing != Standing::OfTheChain)
}

/// F1 of names with their standing; those that may stand beside the truth are left out of it.
pub fn f1(truth: &Truth, names: &[(&str, Standing)]) -> f64 {
    let hits = truth
        .concealed
        .iter()
        .filter(|concealed| {
            names
                .iter()
                .any(|(id, _)| concealed.accept.iter().any(|name| name == id))
        })
        .count();
    let judged = names
        .iter()
        .filter(|(_, standing)| matches!(standing, Standing::Accepted | Standing::False))
        .count();
    let wanted = truth
        .concealed
        .iter()
        .filter(|concealed| concealed.effect.id != "outside")
        .count();
    if judged + wanted == 0 {
        1.0
    } else {
        2.0 * hits as f64 / (judged + wanted) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::family::toy;

    #[test]
    fn what_the_chain_makes_true_is_neither_the_answer_nor_in_its_way() {
        let mut truth = toy::truth("single", "force_lag", "time_constant", 0.02);
        truth.tolerated = vec!["vehicle_speed_delay".into(), "force_lag".into()];
        let told: Vec<Standing> = ["vehicle_speed_delay", "force_lag", "run_out"]
            .iter()
            .map(|id| standing(&truth, id))
            .collect();
        assert_eq!(
            told,
            [Standing::OfTheChain, Standing::Accepted, Standing::False]
        );
        assert_eq!(first(&told), Some(1));
        assert_eq!(first(&told[..1]), None);
        let with = |names: &[&'static str]| {
            let names: Vec<_> = names.iter().map(|id| (*id, standing(&truth, id))).collect();
            f1(&truth, &names)
        };
        assert!((with(&["vehicle_speed_delay", "force_lag"]) - 1.0).abs() < 1e-12);
        assert!((with(&["force_lag", "run_out"]) - 2.0 / 3.0).abs() < 1e-12);
    }
}
