//! Whether a trial is seen: on unseen runs at the noise as fitted, or at the sensors' where the runs' own differences hide it.

use super::trial::{Claim, Trial, worth_of};
use crate::constants::{
    AGREED_PREDICTED, CLEARLY_PREDICTED, CLEARLY_WITHIN_RUNS, DEPENDENCE_WORTH, FEWEST_RUNS_AGREED,
    INDIFFERENT_NATS, LARGE_GAIN_AT_SENSORS, LARGE_GAIN_NOT_FED, LARGE_GAIN_OF_RING,
    LARGE_GAIN_ON_UNSEEN, LARGE_TO_WORTH, LARGELY_PREDICTED, LEAST_GAIN, LEAST_GAIN_AT_SENSORS,
    LEAST_GAIN_OF_AGREED, LEAST_GAIN_OF_DEPENDENCE_AT_SENSORS, LEAST_PREDICTED_BY_DEPENDENCE,
    LEAST_T, LEAST_T_AT_SENSORS, LEAST_T_AT_SENSORS_NOT_FED, LEAST_T_NOT_FED, LEAST_T_OF_AGREED,
    LEAST_T_OF_DEPENDENCE, LEAST_T_OF_DEPENDENCE_AT_SENSORS, LEAST_T_OF_LARGE,
    LEAST_T_OF_PREDICTED, LINED_UP_PREDICTED, PREDICTED_APART, WITHIN_RUNS,
};

/// Gain of the least effect that is worth a name, nats.
#[must_use]
pub fn worth(trial: &Trial) -> f64 {
    worth_of(trial.readings)
}

/// What it is worth in nats that so many runs agree so well, whatever their own noise is: the logarithm of Student's
/// likelihood ratio.
#[must_use]
pub fn of_agreement(trial: &Trial) -> f64 {
    let runs = trial.runs as f64;
    0.5 * runs * (trial.unseen.1.powi(2) / (runs - 1.0).max(1.0)).ln_1p()
}

/// Whether unseen runs together gain more by a name that works through the force than a measuring chain leaves, of fewer
/// recordings as much less; or much by what rings longer than any filter of a chain.
#[must_use]
pub fn gains_beyond_chain(trial: &Trial) -> bool {
    let of_runs = trial.unseen.0 * trial.runs as f64;
    let of_chain = LARGE_GAIN_ON_UNSEEN * trial.share;
    let least = of_chain.max(LARGE_TO_WORTH * worth(trial));
    let outgains = trial.mechanism().is_some() && trial.predicts.is_finite() && of_runs > least;
    outgains || rings_out(trial)
}

/// Whether several unseen runs together gain much, and the drag is predicted better.
fn gains_much(trial: &Trial) -> bool {
    let of_runs = trial.unseen.0 * trial.runs as f64;
    let much = of_runs > (LARGE_GAIN_NOT_FED * trial.share).max(LARGE_TO_WORTH * worth(trial));
    let several = trial.runs >= FEWEST_RUNS_AGREED;
    much && several && lowers_drag_s_error(trial.predicts, PREDICTED_APART)
}

/// Gain from which a name that unseen runs bear out is seen, nats.
#[must_use]
pub fn least_gain_of_name(trial: &Trial) -> f64 {
    if unseen_runs_agree(trial) {
        LEAST_GAIN_OF_AGREED
    } else {
        LEAST_GAIN
    }
}

/// Whether a trial is seen, by the noise as fitted or by the sensors'.
#[must_use]
pub fn is_seen(trial: &Trial) -> bool {
    let least_gain = if trial.mechanism().is_some() {
        least_gain_of_name(trial)
    } else {
        DEPENDENCE_WORTH * worth(trial)
    };
    trial.gain > least_gain && seen_on_unseen_runs(trial) || hidden(trial)
}

/// Whether the runs' own differences hide what all runs show at the sensors' noise: then the fitted noise, which may be
/// theirs, is indifferent.
#[must_use]
pub fn hidden(trial: &Trial) -> bool {
    let indifferent = trial.gain > -trial.price - INDIFFERENT_NATS;
    let gains = trial.gain > 0.0 || (indifferent && trial.mechanism().is_some());
    trial.first && gains && seen_at_sensors(trial) && shows_within_runs(trial)
}

/// Whether a name predicts the drag better where each run has a peak friction of its own, or none is predicted by it: what does
/// not is one of the runs' own differences.
fn shows_within_runs(trial: &Trial) -> bool {
    trial.mechanism().is_none() || trial.predicts_within > WITHIN_RUNS
}

/// Whether what unseen runs say is enough by itself: several, alike, of the drag, of what no measuring chain leaves, nor the
/// form of what was named before, which is the same in all runs.
#[must_use]
pub fn unseen_runs_agree(trial: &Trial) -> bool {
    let alike = several_name(trial, LEAST_T_OF_AGREED) && trial.first;
    let gains = trial.gain > LEAST_GAIN_OF_AGREED;
    let predicts = lowers_drag_s_error(trial.predicts, AGREED_PREDICTED);
    alike && gains && predicts && shows_within_runs(trial)
}

/// Whether several unseen runs gain by a name that no measuring chain leaves, with a larger t than this.
#[must_use]
pub fn several_name(trial: &Trial, least_t: f64) -> bool {
    let (mean, t) = trial.unseen;
    let several = trial.runs >= FEWEST_RUNS_AGREED && mean > 0.0 && t > least_t;
    several && trial.mechanism().is_some() && !trial.fed_by_chain
}

/// Whether unseen runs gain, and alike, where their own differences are no larger than sensors make plausible.
fn seen_at_sensors(trial: &Trial) -> bool {
    let (sum, t) = trial.at_sensors;
    if trial.mechanism().is_some() {
        let large = sum > LARGE_GAIN_AT_SENSORS && t > LEAST_T_OF_LARGE;
        let plain = trial.gain > 0.0 && t > LEAST_T_AT_SENSORS_NOT_FED;
        let within = t > LEAST_T_OF_LARGE && clearly_within_runs(trial);
        let alike = t > LEAST_T_AT_SENSORS || !trial.fed_by_chain && (large || plain || within);
        return sum > LEAST_GAIN_AT_SENSORS && (alike || lined_up(trial));
    }
    trial.predicts > LEAST_PREDICTED_BY_DEPENDENCE && dependence_at_sensors(trial)
}

/// Whether a name that does not remember predicts the drag clearly better within each run.
fn clearly_within_runs(trial: &Trial) -> bool {
    !trial.remembers && lowers_drag_s_error(trial.predicts_within, CLEARLY_WITHIN_RUNS)
}

/// Whether unseen runs gain by a free dependence at the sensors' noise.
#[must_use]
pub fn dependence_at_sensors(trial: &Trial) -> bool {
    let (sum, t) = trial.at_sensors;
    sum > LEAST_GAIN_OF_DEPENDENCE_AT_SENSORS && t > LEAST_T_OF_DEPENDENCE_AT_SENSORS
}

/// Whether unseen runs gain, and alike, or much.
#[must_use]
pub fn seen_on_unseen_runs(trial: &Trial) -> bool {
    let (mean, t) = trial.unseen;
    match trial.claim {
        Claim::Mechanism(..) => {
            let clearly = lowers_drag_s_error(trial.predicts, CLEARLY_PREDICTED);
            let large = gains_beyond_chain(trial);
            let least = if large || (clearly || gains_much(trial)) && !trial.fed_by_chain {
                LEAST_T_NOT_FED
            } else {
                LEAST_T
            };
            mean > 0.0 && (t >= least || few_show(trial)) || largely_predicts(trial)
        }
        // What says nothing of what it is has to be seen at the sensors' noise as well: fitted noise may have left it.
        Claim::Dependence(_) => {
            let at_sensors = trial.at_sensors.1 > LEAST_T_OF_DEPENDENCE_AT_SENSORS;
            mean > 0.0 && t >= LEAST_T_OF_DEPENDENCE && at_sensors
        }
    }
}

/// Whether a name leaves so little of what runs differ by that chance, which has no order, does not do it.
fn lined_up(trial: &Trial) -> bool {
    let lowers = lowers_drag_s_error(trial.predicts, LINED_UP_PREDICTED);
    trial.unanimous[1] && trial.gain > 0.0 && lowers
}

/// Whether gains are uneven because few runs reach what a name is of, or show most of it: they say no less for it.
#[must_use]
pub fn few_reach(trial: &Trial) -> bool {
    let several = trial.runs >= FEWEST_RUNS_AGREED;
    let of_several = several && !trial.fed_by_chain && lined_up(trial);
    undisputed(trial) || few_show(trial) || of_several || largely_predicts(trial)
}

/// Whether few runs that gain are enough for a name: hardly any speaks against it, and it predicts clearly or gains more than a
/// chain leaves; or it is undisputed, or rings.
fn few_show(trial: &Trial) -> bool {
    let several = trial.runs >= FEWEST_RUNS_AGREED;
    let clearly = lowers_drag_s_error(trial.predicts, CLEARLY_PREDICTED);
    let of_few = trial.unanimous[0] && (clearly || several && gains_beyond_chain(trial));
    of_few || several && undisputed(trial) || rings_out(trial)
}

/// Whether what rings longer than any filter of a chain gains much at both levels of the noise, on more than one of several runs:
/// those that hardly excite it are as many as not, and where its frequency is a little off they lose.
#[must_use]
pub fn rings_out(trial: &Trial) -> bool {
    let least = (LARGE_GAIN_OF_RING * trial.share).max(LARGE_TO_WORTH * worth(trial));
    let of_runs = trial.unseen.0 * trial.runs as f64;
    let much = of_runs.min(trial.at_sensors.0) > least && trial.gain > least;
    let of_more_than_one = trial.without_best.iter().all(|gain| *gain > 0.0);
    trial.rings && much && of_more_than_one && trial.runs >= FEWEST_RUNS_AGREED
}

/// Whether a name that no measuring chain leaves gains much at both levels of the noise, and hardly a run speaks against it:
/// what few runs reach, a channel's limit, makes gains so uneven that no t shows it.
fn undisputed(trial: &Trial) -> bool {
    let least = LARGE_TO_WORTH * worth(trial);
    let much = trial.gain > least && trial.at_sensors.0 > least;
    much && trial.unanimous == [true; 2] && !trial.fed_by_chain
}

/// Whether a name that no measuring chain leaves gains on several unseen runs, and takes so much of the error of the drag that
/// it need not gain alike on them: what wears off shows most on the first and the last.
#[must_use]
pub fn largely_predicts(trial: &Trial) -> bool {
    trial.gain > LEAST_GAIN && takes_two_fifths(trial)
}

/// Whether several unseen runs bear out a name that no measuring chain leaves, and that takes two fifths of the error of the drag.
#[must_use]
pub fn takes_two_fifths(trial: &Trial) -> bool {
    let speaks = several_name(trial, LEAST_T_OF_PREDICTED) && !trial.remembers;
    speaks && lowers_drag_s_error(trial.predicts, LARGELY_PREDICTED)
}

/// Whether the drag's mean square error falls by more than this logarithm. What does not work through the force predicts
/// no drag, however well it does.
#[must_use]
pub fn lowers_drag_s_error(predicts: f64, least: f64) -> bool {
    predicts.is_finite() && predicts > least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_predicts_no_drag_lowers_no_error_of_it() {
        assert!(lowers_drag_s_error(0.3, CLEARLY_PREDICTED));
        assert!(!lowers_drag_s_error(0.2, CLEARLY_PREDICTED));
        assert!(!lowers_drag_s_error(f64::INFINITY, CLEARLY_PREDICTED));
    }
}
