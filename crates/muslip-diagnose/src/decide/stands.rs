//! Whether a trial stands: whether it is seen, and could be what it claims.

use super::seen::{
    dependence_at_sensors, gains_beyond_chain, hidden, is_seen, largely_predicts,
    least_gain_of_name, lowers_drag_s_error, of_agreement, rings_out, seen_on_unseen_runs,
    several_name, takes_two_fifths, unseen_runs_agree, worth,
};
use super::trial::Trial;
use crate::constants::{
    CLEARLY_PREDICTED, LARGE_GAIN_OF_DEPENDENCE_AT_SENSORS, LEAST_GAIN_OF_DEPENDENCE_AT_SENSORS,
    LEAST_PREDICTED, LEAST_PREDICTED_BY_DEPENDENCE, LEAST_T_OF_LIKELIER, LEAST_T_OF_SURE,
    LINED_UP_PREDICTED_BY_DEPENDENCE, PREDICTED_APART, WEAK_NATS,
};

impl Trial {
    /// Gain that counts, in nats: fitted noise that is indifferent to what it hides counts for one, and what unseen runs agree
    /// on for what that is worth.
    #[must_use]
    pub fn gain_that_counts(&self) -> f64 {
        let least = if unseen_runs_agree(self) {
            of_agreement(self)
        } else if hidden(self) {
            1.0
        } else {
            0.0
        };
        self.gain.max(least)
    }

    /// How much speaks for it at both levels of the noise: the geometric mean of its gains.
    #[must_use]
    pub fn weight(&self) -> f64 {
        (self.gain_that_counts() * self.at_sensors.0.max(0.0)).sqrt()
    }

    /// Whether so little speaks for it that the errors of the runs may have chosen it, and it takes no two fifths of the drag's
    /// error either.
    #[must_use]
    pub fn is_weak(&self) -> bool {
        self.weight() < WEAK_NATS && !takes_two_fifths(self)
    }

    /// What all unseen runs gain by it in nats, at the noise at which it stands: as fitted, or at the sensors' where the
    /// runs' own differences hide it.
    #[must_use]
    pub fn gain_on_unseen_runs(&self, runs: usize) -> f64 {
        if hidden(self) && !seen_on_unseen_runs(self) {
            self.at_sensors.0
        } else {
            self.unseen.0 * runs as f64
        }
    }
}

/// Whether a trial could be named, were it seen: large enough, by what it gains or by the drag that it predicts, itself,
/// neither a memory of the chain's nor what one leaves, and better at predicting, or hardly worse where it gains much.
fn could_be_named(trial: &Trial) -> bool {
    let large = trial.size > worth(trial) || unseen_runs_agree(trial);
    large && is_plausible(trial)
}

/// Whether nothing says that a trial is something else than its claim.
fn is_plausible(trial: &Trial) -> bool {
    let not_of_chain = trial.outlasts_chain && trial.beside_chain;
    trial.own && not_of_chain && trial.predicts > least_predicted(trial)
}

/// Least logarithm by which a trial has to lower the mean square error of the drag. Of what gains more than any chain leaves a
/// prediction says little: what a mode makes of the slip's noise spoils that of the true one, too. Where slip sets in, what
/// sensors and smoothing take off it looks like another curve, a play or a length of the tyre, and predicts little: of 165
/// development campaigns that lack a thing no true name of the tyre that a chain feeds lowers it by less. Where several runs
/// are so alike for what no chain leaves, how little it is beside the noise says nothing against it. What goes by the load as
/// read has to predict it clearly, however much it gains: of the six false ones on 416 campaigns behind chains that lack
/// nothing one lowers the error by more than 0.16, of 18 true ones one by less than 0.43.
fn least_predicted(trial: &Trial) -> f64 {
    if trial.like_noise_of_load {
        CLEARLY_PREDICTED
    } else if gains_beyond_chain(trial) {
        -PREDICTED_APART
    } else if several_name(trial, LEAST_T_OF_SURE) && trial.first && !trial.remembers {
        0.0
    } else if trial.fed_by_chain && trial.of_tyre {
        PREDICTED_APART
    } else {
        LEAST_PREDICTED
    }
}

/// Whether a trial stands.
#[must_use]
pub fn stands(trial: &Trial) -> bool {
    is_seen(trial) && could_be_named(trial)
}

/// Whether a trial is as good as one that stands but for how alike unseen runs speak for it.
#[must_use]
pub fn could_stand(trial: &Trial) -> bool {
    gains_on_unseen_runs(trial) && could_be_named(trial)
}

/// Whether a trial takes of the likelihood of one that stands: it stands itself, or does not for its size alone, which may
/// be little beside nothing but is much beside what is hardly larger.
#[must_use]
pub fn rivals(trial: &Trial) -> bool {
    let small = trial.mechanism().is_some() && is_plausible(trial);
    stands(trial) || small && is_seen(trial)
}

/// Whether unseen runs gain, alike or not.
fn gains_on_unseen_runs(trial: &Trial) -> bool {
    let (mean, t) = trial.unseen;
    let alike = mean > 0.0 && t > LEAST_T_OF_LIKELIER;
    let speaks = alike || rings_out(trial) || largely_predicts(trial);
    trial.gain > least_gain_of_name(trial) && speaks
}

/// Whether a name is of use beside others that were named: whatever it is worth alone was settled when it was taken up. Of
/// what a measuring chain leaves, too, the others may have left the rest.
#[must_use]
pub fn needed(trial: &Trial) -> bool {
    let (mean, t) = trial.unseen;
    let still_gains = !trial.fed_by_chain && trial.gain > 0.0 && mean > 0.0;
    still_gains && t > LEAST_T_OF_LIKELIER || gains_on_unseen_runs(trial) || hidden(trial)
}

/// Whether a free dependence that does not stand is still to be told: noise that the sensors do not make plausible
/// swallows it, and the drag is predicted no better with it, but all runs show it; or few runs reach it, hardly any speaks
/// against it, and the drag is predicted much better, or better and the gain is large.
#[must_use]
pub fn left_open(trial: &Trial) -> bool {
    let shows = |nats: f64, predicted: f64| {
        trial.at_sensors.0 > nats && lowers_drag_s_error(trial.predicts, predicted)
    };
    let few_reach_it = trial.unanimous[1]
        && (shows(
            LEAST_GAIN_OF_DEPENDENCE_AT_SENSORS,
            LINED_UP_PREDICTED_BY_DEPENDENCE,
        ) || shows(
            LARGE_GAIN_OF_DEPENDENCE_AT_SENSORS,
            LEAST_PREDICTED_BY_DEPENDENCE,
        ));
    let shown = dependence_at_sensors(trial) || few_reach_it;
    trial.mechanism().is_none() && !stands(trial) && shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decide::seen::few_reach;
    use crate::decide::toy::of_name;
    use crate::decide::trial::Claim;
    use crate::innovations::dependence;
    use crate::innovations::toy::{self, Noise, stop};
    use crate::mechanism::Id;

    #[test]
    fn a_gain_that_no_chain_leaves_needs_neither_even_runs_nor_a_better_prediction() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        // So many nats on each of six unseen runs.
        let fed = |nats: f64, t: f64| Trial {
            fed_by_chain: true,
            predicts: 0.5,
            ..of_name(&data, &base, Id::StructuralResonance, nats, t)
        };
        assert!(stands(&fed(60.0, 1.6)));
        assert!(!stands(&fed(60.0, 1.4)) && !stands(&fed(40.0, 1.6)));
        assert!(stands(&fed(40.0, 2.1)));
        // Without what is kept for the proof there is less to gain.
        let without_kept = Trial {
            share: 0.75,
            ..fed(40.0, 1.6)
        };
        assert!(stands(&without_kept));
        // Nor a better prediction: the noise of the slip is worth more behind a mode. Clearly worse is another matter.
        let predicting = |nats: f64, predicts: f64| Trial {
            predicts,
            ..fed(nats, 2.1)
        };
        assert!(stands(&predicting(60.0, -0.05)) && !stands(&predicting(40.0, -0.05)));
        assert!(!stands(&predicting(60.0, -0.15)));
        // Nor even runs, where few reach what none speaks against.
        let few = |nats: f64| Trial {
            unanimous: [true, false],
            predicts: 0.2,
            ..fed(nats, 1.2)
        };
        assert!(stands(&few(60.0)) && !stands(&few(40.0)));
        let on_three = Trial {
            runs: 3,
            ..few(120.0)
        };
        assert!(!stands(&on_three));
        // An inertia predicts no drag, and of a long campaign any effect that is worth a name gains as much.
        let of_wheel = Trial {
            predicts: f64::INFINITY,
            ..few(60.0)
        };
        let long = Trial {
            readings: 20_000,
            ..few(60.0)
        };
        assert!(!stands(&of_wheel) && !stands(&long));
    }

    #[test]
    fn a_name_of_the_tyre_that_a_chain_feeds_has_to_predict_clearly() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let stands_at = |predicts: f64, of_tyre: bool, nats: f64| {
            stands(&Trial {
                fed_by_chain: true,
                of_tyre,
                predicts,
                ..of_name(&data, &base, Id::CurveShape, nats, 3.0)
            })
        };
        assert!(stands_at(0.11, true, 20.0) && !stands_at(0.09, true, 20.0));
        assert!(stands_at(0.09, false, 20.0) && !stands_at(0.03, false, 20.0));
        // Six runs of 60 nats are more than a chain leaves.
        assert!(stands_at(0.0, true, 60.0));
    }

    #[test]
    fn what_rings_longer_than_any_filter_need_not_gain_alike_on_more_than_one_run() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let mode = |nats: f64| Trial {
            rings: true,
            fed_by_chain: true,
            readings: 2000,
            unseen: (nats / 6.0, 0.6),
            at_sensors: (nats, 1.1),
            predicts: -0.05,
            without_best: [20.0, 10.0],
            ..of_name(&data, &base, Id::StructuralResonance, nats, 0.6)
        };
        assert!(stands(&mode(120.0)) && few_reach(&mode(120.0)) && needed(&mode(120.0)));
        let refused = [
            mode(90.0),
            Trial {
                rings: false,
                ..mode(120.0)
            },
            Trial {
                without_best: [20.0, -1.0],
                ..mode(120.0)
            },
            Trial {
                runs: 3,
                unseen: (40.0, 0.6),
                ..mode(120.0)
            },
            Trial {
                predicts: -0.15,
                ..mode(120.0)
            },
        ];
        assert!(refused.iter().all(|trial| !stands(trial)));
    }

    #[test]
    fn what_goes_by_the_load_as_read_has_to_predict_clearly_however_much_it_gains() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let stands_at = |predicts: f64, nats: f64, t: f64| {
            stands(&Trial {
                like_noise_of_load: true,
                predicts,
                first: true,
                ..of_name(&data, &base, Id::LoadSensitivity, nats, t)
            })
        };
        assert!(stands_at(0.26, 20.0, 3.0));
        assert!(!stands_at(0.24, 20.0, 3.0) && !stands_at(0.24, 600.0, 9.0));
    }

    #[test]
    fn several_runs_that_are_very_alike_need_not_predict_much_better() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let trial = |t: f64, predicts: f64| Trial {
            predicts,
            first: true,
            at_sensors: (2.0, 1.0),
            ..of_name(&data, &base, Id::LoadCrosstalk, 20.0, t)
        };
        assert!(stands(&trial(5.1, 0.02)) && !stands(&trial(4.9, 0.02)));
        assert!(!stands(&trial(9.0, -0.01)), "but no worse");
        let fed = Trial {
            fed_by_chain: true,
            ..trial(9.0, 0.02)
        };
        let on_three = Trial {
            runs: 3,
            ..trial(9.0, 0.02)
        };
        // What a name's form leaves is the same in all runs, too.
        let beside_another = Trial {
            first: false,
            ..trial(9.0, 0.02)
        };
        assert!(!stands(&fed) && !stands(&on_three) && !stands(&beside_another));
    }

    #[test]
    fn a_large_gain_that_no_chain_leaves_needs_less_even_runs_where_it_predicts_better() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        // So many nats on each of six unseen runs.
        let trial = |nats: f64, predicts: f64| Trial {
            predicts,
            ..of_name(&data, &base, Id::ForceSaturation, nats, 1.6)
        };
        assert!(stands(&trial(11.0, 0.11)));
        assert!(!stands(&trial(9.0, 0.11)) && !stands(&trial(11.0, 0.09)));
        let fed = Trial {
            fed_by_chain: true,
            ..trial(11.0, 0.11)
        };
        assert!(!stands(&fed));
    }

    #[test]
    fn runs_that_line_up_make_a_name_stand_whose_gains_are_uneven() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let trial = |predicts: f64, against: bool| Trial {
            gain: 4.0,
            at_sensors: (60.0, 1.2),
            first: true,
            predicts,
            unanimous: [false, !against],
            ..of_name(&data, &base, Id::EffectiveRadius, 5.0, 1.3)
        };
        // To less than a half of the drag's mean square error, and hardly a run against it.
        assert!(stands(&trial(0.75, false)) && few_reach(&trial(0.75, false)));
        assert!(!stands(&trial(0.65, false)) && !few_reach(&trial(0.65, false)));
        assert!(!stands(&trial(0.75, true)));
    }

    #[test]
    fn a_dependence_that_few_runs_reach_is_left_open_where_none_speaks_against_it() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let free = dependence::all(&data).swap_remove(0);
        let is_open = |nats, predicts, against: bool| {
            left_open(&Trial {
                claim: Claim::Dependence(free.clone()),
                gain: -5.0,
                at_sensors: (nats, 1.0),
                predicts,
                unanimous: [false, !against],
                ..of_name(&data, &base, Id::LoadSensitivity, nats, 0.5)
            })
        };
        assert!(is_open(200.0, 0.6, false));
        assert!(!is_open(200.0, 0.6, true));
        assert!(!is_open(200.0, 0.4, false) && !is_open(100.0, 0.6, false));
        // Of a large gain less is asked.
        assert!(is_open(600.0, 0.1, false));
        assert!(!is_open(600.0, 0.1, true) && !is_open(600.0, 0.04, false));
    }

    #[test]
    fn several_runs_that_agree_on_the_drag_are_enough_where_no_chain_leaves_the_like() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let wear = |t: f64, predicts: f64| Trial {
            first: true,
            predicts,
            at_sensors: (2.0, 1.0),
            ..of_name(&data, &base, Id::WearDrift, 2.0, t)
        };
        assert!(stands(&wear(3.6, 0.32)) && needed(&wear(3.6, 0.32)));
        let refused = [
            wear(2.9, 0.32),
            wear(3.6, 0.09),
            // An inertia predicts no drag.
            wear(3.6, f64::INFINITY),
            Trial {
                fed_by_chain: true,
                ..wear(3.6, 0.32)
            },
            Trial {
                runs: 3,
                ..wear(3.6, 0.32)
            },
            Trial {
                gain: -2.1,
                ..wear(3.6, 0.32)
            },
        ];
        assert!(refused.iter().all(|trial| !stands(trial)));
    }

    #[test]
    fn what_all_runs_show_is_worth_its_agreement_however_much_noise_of_a_run_takes_of_it() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let radius = |t: f64, gain: f64| Trial {
            gain,
            first: true,
            runs: 6,
            predicts: 0.2,
            at_sensors: (4.0, 1.8),
            // Less than the least effect that is worth a name gains.
            size: 1.0,
            readings: 20_000,
            ..of_name(&data, &base, Id::EffectiveRadius, 4.0, t)
        };
        assert!(stands(&radius(3.2, -1.0)) && !stands(&radius(3.2, -3.0)));
        assert!(!stands(&radius(2.8, -1.0)) && !stands(&radius(2.8, 4.0)));
        // Six runs with a t of 4: 3 ln(1 + 16/5) = 4.3 nats.
        let agreed = radius(4.0, -1.0);
        assert!((of_agreement(&agreed) - 4.305).abs() < 1e-3);
        assert!((agreed.weight() - (4.305f64 * 4.0).sqrt()).abs() < 1e-3);
        assert_eq!(radius(2.8, -1.0).weight(), 0.0);
        assert_eq!(radius(4.0, -3.0).weight(), 0.0);
        // What another name's form leaves is the same in all runs, too.
        let left = Trial {
            first: false,
            ..radius(4.0, -1.0)
        };
        assert!(!stands(&left));
    }

    #[test]
    fn what_tells_only_the_runs_from_each_other_is_hidden_by_nothing() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let trial = |id: Id, predicts_within: f64| Trial {
            first: true,
            at_sensors: (90.0, 5.0),
            predicts_within,
            ..of_name(&data, &base, id, 2.0, 3.6)
        };
        let load = |within: f64| trial(Id::LoadSensitivity, within);
        assert!(stands(&load(0.06)) && !stands(&load(0.04)));
        // Nor is it what runs agree on.
        let agreed = |within: f64| Trial {
            at_sensors: (2.0, 1.0),
            ..load(within)
        };
        assert!(stands(&agreed(0.06)) && !stands(&agreed(0.04)));
        // An inertia predicts no drag; what fitted noise leaves is seen by itself.
        assert!(stands(&trial(Id::WheelInertia, f64::INFINITY)));
        assert!(stands(&of_name(
            &data,
            &base,
            Id::LoadSensitivity,
            20.0,
            3.6
        )));
    }

    #[test]
    fn what_each_run_shows_clearly_need_not_gain_alike_at_the_sensors_noise() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let radius = |nats: f64, t: f64, predicts_within: f64| Trial {
            gain: -2.0,
            first: true,
            at_sensors: (nats, t),
            predicts_within,
            ..of_name(&data, &base, Id::EffectiveRadius, 1.0, 0.4)
        };
        assert!(stands(&radius(30.0, 1.6, 0.2)));
        let fed = Trial {
            fed_by_chain: true,
            ..radius(30.0, 1.6, 0.2)
        };
        let refused = [
            fed,
            radius(15.0, 1.6, 0.2),
            radius(30.0, 1.4, 0.2),
            radius(30.0, 1.6, 0.1),
        ];
        assert!(refused.iter().all(|trial| !stands(trial)));
    }

    #[test]
    fn what_takes_two_fifths_of_the_drag_s_error_need_not_gain_alike() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let wear = |nats: f64, predicts: f64| Trial {
            predicts,
            at_sensors: (7.0, 1.1),
            unanimous: [false, false],
            ..of_name(&data, &base, Id::WearDrift, nats, 0.8)
        };
        let largely = wear(12.0, 0.55);
        assert!(stands(&largely) && few_reach(&largely) && needed(&largely));
        assert!(!stands(&wear(12.0, 0.45)) && !stands(&wear(4.0, 0.55)));
        let fed = Trial {
            fed_by_chain: true,
            ..wear(12.0, 0.55)
        };
        let memory = Trial {
            remembers: true,
            ..wear(12.0, 0.55)
        };
        let of_three = Trial {
            runs: 3,
            ..wear(12.0, 0.55)
        };
        // As many nats against it as for it.
        let disputed = Trial {
            unseen: (2.0, 0.4),
            ..wear(12.0, 0.55)
        };
        let refused = [fed, memory, of_three, disputed];
        assert!(refused.iter().all(|trial| !stands(trial)));
    }

    #[test]
    fn what_takes_two_fifths_of_the_drag_s_error_is_not_weak_however_little_it_gains() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let radius = |nats: f64, predicts: f64| Trial {
            at_sensors: (nats, 3.0),
            predicts,
            ..of_name(&data, &base, Id::EffectiveRadius, nats, 3.0)
        };
        assert!(radius(15.0, 0.4).is_weak() && !radius(17.0, 0.4).is_weak());
        assert!(!radius(11.0, 0.58).is_weak());
        // An inertia predicts no drag.
        assert!(radius(11.0, f64::INFINITY).is_weak());
    }

    #[test]
    fn what_stands_by_few_runs_is_as_sure_as_they_are_even() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let mode = |nats: f64, undisputed: bool| Trial {
            fed_by_chain: true,
            readings: 2000,
            predicts: 0.0,
            unanimous: [undisputed, false],
            ..of_name(&data, &base, Id::StructuralResonance, nats, 1.2)
        };
        // Six runs of 60 nats are more than a chain leaves.
        assert!(stands(&mode(60.0, true)) && few_reach(&mode(60.0, true)));
        assert!(!few_reach(&mode(60.0, false)) && !few_reach(&mode(20.0, true)));
    }

    #[test]
    fn a_name_that_still_gains_is_needed_unless_a_chain_leaves_as_much() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let wear = |nats: f64, t: f64| Trial {
            at_sensors: (2.0, 1.0),
            ..of_name(&data, &base, Id::WearDrift, nats, t)
        };
        assert!(needed(&wear(2.0, 2.6)));
        assert!(!needed(&wear(-0.1, 2.6)) && !needed(&wear(2.0, 0.9)));
        let fed = |nats: f64| Trial {
            fed_by_chain: true,
            ..wear(nats, 2.6)
        };
        assert!(!needed(&fed(2.0)) && needed(&fed(9.0)));
    }

    #[test]
    fn what_few_runs_reach_and_none_disputes_stands_where_no_chain_leaves_the_like() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let limit = |nats: f64| Trial {
            // Of so many, five nats are worth a name.
            readings: 2000,
            unseen: (nats / 6.0, 1.2),
            predicts: 0.08,
            unanimous: [true, true],
            at_sensors: (80.0, 1.1),
            ..of_name(&data, &base, Id::ForceSaturation, nats, 1.2)
        };
        assert!(stands(&limit(60.0)));
        let refused = [
            limit(5.0),
            Trial {
                at_sensors: (5.0, 1.1),
                ..limit(60.0)
            },
            Trial {
                unanimous: [true, false],
                ..limit(60.0)
            },
            Trial {
                fed_by_chain: true,
                ..limit(60.0)
            },
            Trial {
                runs: 3,
                ..limit(60.0)
            },
        ];
        assert!(refused.iter().all(|trial| !stands(trial)));
    }

    #[test]
    fn what_does_not_stand_for_its_size_alone_is_a_rival_of_what_stands() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let radius = |nats: f64, t: f64| Trial {
            at_sensors: (nats, 1.0),
            predicts: 0.2,
            ..of_name(&data, &base, Id::EffectiveRadius, nats, t)
        };
        let small = |trial: Trial| Trial { size: 0.0, ..trial };
        assert!(stands(&radius(9.0, 3.0)) && rivals(&radius(9.0, 3.0)));
        assert!(!stands(&small(radius(9.0, 3.0))) && rivals(&small(radius(9.0, 3.0))));
        // As large as may be, but not seen.
        assert!(!rivals(&radius(9.0, 1.2)) && !rivals(&radius(3.0, 2.9)));
        // Small, and hidden by the runs' own differences.
        let hidden = Trial {
            first: true,
            at_sensors: (60.0, 9.0),
            ..radius(1.0, 0.0)
        };
        assert!(!stands(&small(hidden.clone())) && rivals(&small(hidden)));
        let refuted = Trial {
            own: false,
            ..radius(9.0, 3.0)
        };
        assert!(!rivals(&refuted));
    }
}
