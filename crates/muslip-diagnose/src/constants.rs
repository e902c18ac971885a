//! Every figure by which the engine decides, with what it is for and where it comes from; `audit::constants` has those of
//! the audit. Steps and tolerances of a numerical method stand beside it: they cost time, and decide nothing.

// What a gain is worth: nats of log likelihood.

/// Price of a free parameter, nats: half the logarithm of some 3,000 independent readings of a campaign (Schwarz 1978, Ann.
/// Stat. 6).
pub const PRICE_OF_PARAMETER: f64 = 4.0;
/// Price of a choice among the vocabulary, nats: the logarithm of 29 mechanisms.
pub const PRICE_OF_NAME: f64 = 3.4;
/// Least gain, nats, all prices taken off: one chance in 150 of a campaign.
pub const LEAST_GAIN: f64 = 5.0;
/// Least effect that is worth a name, as a share of one whitened reading's standard deviation: of the gain, half its
/// square a reading. What no engineer would correct.
pub const LEAST_EFFECT: f64 = 0.07;
/// Least t of the gains on unseen runs: about Student's at five percent, one-sided, for as many runs as campaigns have.
/// On development campaigns between 1 and 1.5 seventeen standing trials were false and one true.
pub const LEAST_T: f64 = 2.0;
/// As [`LEAST_T`], of what no measuring chain leaves anything like and predicts the drag clearly better
/// ([`CLEARLY_PREDICTED`]): of 260 development campaigns all false names with less than [`LEAST_T`] lowered the mean square
/// error by less than a sixth, all true ones by a third and more.
pub const LEAST_T_NOT_FED: f64 = 1.5;
/// As [`LEAST_T_NOT_FED`], from which unseen runs agree, whatever the noise of a run leaves of the gain on all of them: Student's
/// at some two percent, one-sided.
pub const LEAST_T_OF_AGREED: f64 = 3.0;
/// As [`LEAST_T_OF_AGREED`]: least gain on all runs, prices taken off, nats. Noise of a run, whose size nobody knows, takes
/// the most of what all runs show alike: six with a t of three are worth three nats, and a name costs seven.
pub const LEAST_GAIN_OF_AGREED: f64 = -2.0;
/// As [`LEAST_T_OF_AGREED`]: least logarithm by which the name lowers the mean square error of the drag.
pub const AGREED_PREDICTED: f64 = 0.1;
/// As [`LEAST_T_OF_AGREED`], from which a name need not lower the mean square error of the drag by as much as others, only not
/// enlarge it.
pub const LEAST_T_OF_SURE: f64 = 5.0;
/// As [`LEAST_T_OF_AGREED`]: fewest unseen runs. With fewer a t of three is chance.
pub const FEWEST_RUNS_AGREED: usize = 4;
/// Gain on all unseen runs together, nats, beyond which a measuring chain leaves nothing: with a t of [`LEAST_T_NOT_FED`] or
/// more, or without one where hardly any run speaks against it, what does not stand by less gained at most 194 on 220
/// development campaigns with nothing missing.
pub const LARGE_GAIN_ON_UNSEEN: f64 = 300.0;
/// As [`LARGE_GAIN_ON_UNSEEN`], of what no measuring chain leaves and predicts the drag better by [`PREDICTED_APART`], with a t
/// of [`LEAST_T_NOT_FED`].
pub const LARGE_GAIN_NOT_FED: f64 = 60.0;
/// Gain on all unseen runs together, nats, at both levels of the noise, from which what rings longer than any filter of a chain need
/// not gain alike, for few runs excite it; [`LARGE_TO_WORTH`] holds, too. Of 352 development campaigns that lack nothing, 208 behind chains, none has a mode of
/// such damping with more than 50.
pub const LARGE_GAIN_OF_RING: f64 = 100.0;
/// Gain on all unseen runs together, nats, at both levels of the noise, from which a lag of the brake is one however its
/// reading and the other channels are timed: of 232 development campaigns that lack nothing, 88 behind chains, none that this would
/// name gains more than 47.
pub const LARGE_GAIN_OF_BRAKE: f64 = 60.0;
/// As [`LARGE_GAIN_OF_BRAKE`], in times what the least effect worth a name gains: gains grow with the readings.
pub const WORTHS_OF_BRAKE: f64 = 3.0;
/// As [`LARGE_GAIN_ON_UNSEEN`], in times what the least effect worth a name gains: gains grow with the readings.
pub const LARGE_TO_WORTH: f64 = 10.0;
/// Least t of a name that all recordings together make clearly likelier than one that stands.
pub const LEAST_T_OF_LIKELIER: f64 = 1.0;
/// Where the runs' own differences hide an effect: least gain at the noise that the sensors make plausible, nats. What
/// measuring chains leave gains less, or unevenly.
pub const LEAST_GAIN_AT_SENSORS: f64 = 20.0;
/// As [`LEAST_GAIN_AT_SENSORS`]: least t of the gains' signed roots, which is about twice a plain t.
pub const LEAST_T_AT_SENSORS: f64 = 4.0;
/// As [`LEAST_T_AT_SENSORS`], of what no measuring chain leaves anything like and fitted noise lets gain:
/// on those campaigns the largest was 2.2.
pub const LEAST_T_AT_SENSORS_NOT_FED: f64 = 3.0;
/// As [`LEAST_GAIN_AT_SENSORS`], of the same where the runs are uneven: on those
/// campaigns the largest was 69 nats, with a t of 1.
pub const LARGE_GAIN_AT_SENSORS: f64 = 80.0;
/// As [`LARGE_GAIN_AT_SENSORS`]: least t of the gains' signed roots.
pub const LEAST_T_OF_LARGE: f64 = 1.5;
/// Nats by which fitted noise may be against what it hides: a likelihood never falls by a term, but for how far the search
/// for the noise has come.
pub const INDIFFERENT_NATS: f64 = 10.0;

/// Most that unseen runs speak against a name, as a share of what the others speak for it, where its gains are uneven
/// because few runs show it.
pub const MOST_AGAINST: f64 = 0.05;
/// As [`MOST_AGAINST`]: least logarithm by which the name lowers the mean square error of the drag. Of false names of 250
/// development campaigns none has both.
pub const CLEARLY_PREDICTED: f64 = 0.25;
/// As [`CLEARLY_PREDICTED`], of what need not gain alike: by two fifths. Of 226 development campaigns that lack nothing none
/// has such a name that no chain feeds, with more than [`LEAST_GAIN`]; of 111 that lack a thing one, a true one.
pub const LARGELY_PREDICTED: f64 = 0.5;
/// As [`LARGELY_PREDICTED`]: least t of the gains on unseen runs, which speak more for it than against.
pub const LEAST_T_OF_PREDICTED: f64 = 0.5;
/// Least logarithm by which a name that fitted noise hides lowers the mean square error of the drag where its gains at the
/// sensors' noise are uneven: to a half. Of 204 development campaigns that lack nothing one has such a name at all, with 0.52.
pub const LINED_UP_PREDICTED: f64 = 0.7;

/// Most names beside the chain's: a campaign of a few runs tells no more apart.
pub const MOST_NAMES: usize = 3;
/// Added to a threshold in standard deviations, so that four in five effects of that size are seen.
pub const POWER: f64 = 0.84;
/// Largest share of a parameter's range that is still a size to be found.
pub const PLAUSIBLE_SHARE: f64 = 0.5;

// What stood before.

/// Least share of what spoke for a name that still has to once another was taken up.
pub const STILL_SPEAKS: f64 = 0.5;

// Names that gain alike.

/// Gains that differ by less are alike, nats.
pub const ALIKE_NATS: f64 = 0.5;
/// Softness of the choice between two names, nats: no model of this kind is exactly true.
pub const SOFTNESS: f64 = 4.0;
/// As [`SOFTNESS`], as a share of what the better one gains.
pub const SOFT_SHARE: f64 = 0.03;
/// Share of another's gain from which a memory that predicts the drag clearly better comes first, and a name that the other's
/// parameters say as well.
pub const ALIKE_SHARE: f64 = 0.7;
/// Most confidence in what works through the force where unseen runs do not bear it out: on nine development sets 14 of 19
/// such names were true.
pub const DOUBTED: f64 = 0.5;
/// Confidence from which a name is not refuted by the argument without the kept runs: the false ones that were had at most
/// 0.86, and a true one of 0.98 did not come out again.
pub const BEYOND_REFUTATION: f64 = 0.9;
/// What speaks for a name that is no memory, nats, below which it has to come out without the kept runs, too, where a chain shows or a
/// speed is surely out of step: what so little speaks for may be chosen by the errors of the runs (stability selection: Meinshausen and
/// Buhlmann 2010, J. R. Stat. Soc. B 72). Of five names that do not on 590 development campaigns behind chains, 174 with one
/// effect, four are false and one is of 0.3 sigma. What [`LARGELY_PREDICTED`] bears out is not weak.
pub const WEAK_NATS: f64 = 16.0;
/// Least confidence of a name that is said, unless an alias is as likely: of 8 below it on the same sets 2 were true.
pub const LEAST_CONFIDENCE: f64 = 0.45;
/// As [`LEAST_CONFIDENCE`], of a name and all its aliases together: that one of them is missing is nearly sure.
pub const LEAST_CONFIDENCE_OF_ALIASES: f64 = 0.7;
/// Confidence from which a name that says what a channel does is told among the findings of the chain, too: there nothing is
/// said to be likely. Three runs make nothing as sure.
pub const TOLD_OF_CHANNEL: f64 = 0.9;
/// Least standard deviations by which a figure of a name differs from none for the name to be said: of 255 names on 338
/// development campaigns five had less, three false ones and two ripples of a sensor.
pub const LEAST_STDS_OF_FIGURE: f64 = 3.0;
/// What so many runs can make sure, at least, for an unlikely name to be left unsaid: four do. With fewer no name gets far.
pub const FEW_RUNS_SURE: f64 = 0.9;
/// Share of a name's likelihood from which nothing in the recordings tells an alias from it.
pub const TIED: f64 = 0.99;
/// Share of a name's likelihood from which another has a fair chance: the name is the less sure by it, and that it comes out of fewer
/// recordings contradicts nothing.
pub const FAIR_CHANCE: f64 = 0.2;
/// Likelihood of what is rare as a share of that of what is common and looks the same.
pub const RARE_SHARE: f64 = 0.05;
/// Least logarithm by which a name that works through the force lowers the mean square error of the drag within the runs, a
/// peak friction of each free, for their differences to hide it: what tells runs from each other alone is one of their
/// differences, and hidden by nothing. Of 320 development campaigns behind chains that lack nothing five have such a name all the
/// same, of 133 with one effect none has.
pub const WITHIN_RUNS: f64 = 0.05;
/// As [`WITHIN_RUNS`], from which uneven runs say nothing against a name that no chain leaves: of those 320 campaigns one has
/// such a name.
pub const CLEARLY_WITHIN_RUNS: f64 = 0.15;
/// Logarithm of the mean square error by which a prediction is clearly better, or worse.
pub const PREDICTED_APART: f64 = 0.1;
/// Share of a name's weight below which its alias, weighed beside it, is what its own form leaves, and a dependence too: forms
/// of the vocabulary are within some five percent of what they stand for.
pub const FORM_LEFT: f64 = 0.1;

// Memories of the chain's.

/// By how many times another memory of the chain's outweighs one of which no more counts than what it gains beside that
/// other: more than the forms of one memory differ by.
pub const FAR_HEAVIER: f64 = 2.0;

// Free dependences.

/// A free dependence is told instead of a mechanism where it gains so many times as much: a mechanism in the wrong form
/// leaves less than a quarter.
pub const DEPENDENCE_SHARE: f64 = 1.33;
/// As [`DEPENDENCE_SHARE`], so many nats more: the price of its further parameters.
pub const DEPENDENCE_NATS: f64 = 15.0;
/// Least gain of a free dependence over that of the least effect worth a name.
pub const DEPENDENCE_WORTH: f64 = 3.0;
/// Least t of a free dependence's gains on unseen runs: it says nothing of what it is.
pub const LEAST_T_OF_DEPENDENCE: f64 = 3.0;
/// Least gain of a free dependence at the sensors' noise, nats: it has more parameters than a mechanism and follows more of
/// what chains leave. None of 64 development campaigns that lack nothing has one.
pub const LEAST_GAIN_OF_DEPENDENCE_AT_SENSORS: f64 = 150.0;
/// As [`LEAST_GAIN_OF_DEPENDENCE_AT_SENSORS`]: least t of the gains' signed roots, of one that stands, too.
pub const LEAST_T_OF_DEPENDENCE_AT_SENSORS: f64 = 2.4;
/// Least logarithm by which a dependence lowers the mean square error of the drag, where few runs reach what it depends on and
/// none speaks against it: no t shows that. None of 120 development campaigns that lack nothing has more than 0.37.
pub const LINED_UP_PREDICTED_BY_DEPENDENCE: f64 = 0.5;
/// As [`LINED_UP_PREDICTED_BY_DEPENDENCE`], nats at the sensors' noise from which [`LEAST_PREDICTED_BY_DEPENDENCE`] is enough:
/// none of those campaigns has 300.
pub const LARGE_GAIN_OF_DEPENDENCE_AT_SENSORS: f64 = 500.0;
/// Logarithm by which a hidden dependence lowers the mean square error of the drag at least.
pub const LEAST_PREDICTED_BY_DEPENDENCE: f64 = 0.05;

// What works through the force, and what remembers.

/// Least logarithm by which a name that works through the force lowers the mean square error of the drag: that of an effect
/// of a fifth of the noise.
pub const LEAST_PREDICTED: f64 = 0.04;
/// Logarithm by which a memory as short as the chain's lowers the mean square error of the drag where it is real: kernels
/// that differ lower none. True ones lower it by 0.2 to 0.4.
pub const REAL_MEMORY_PREDICTED: f64 = 0.25;
/// As [`REAL_MEMORY_PREDICTED`]: least t of the signed roots of its gains.
pub const REAL_MEMORY_T: f64 = 2.5;
/// Least memory that is told from a chain without any error of timing, s.
pub const LEAST_MEMORY_S: f64 = 2.5e-3;
/// Shortest memory in steps of the recording that is told where no chain shows, nor a channel is out of step: a fifth was true of
/// those on which that was seen, and below it the steps themselves are what errs.
pub const STEPS_UNCHAINED: f64 = 0.1;
/// Damping ratio below which a response rings longer than any filter of a chain: the least damped pole of a fourth-order
/// Butterworth filter has 0.38.
pub const RINGING: f64 = 0.12;

// Noise, and what is known before any reading.

/// Prior standard deviation of the logarithm of a noise part's size about where it starts: wide, so that a part that the data
/// say nothing of stays plausible.
pub const LOG_SIZE_STD: f64 = 3.0;
/// As [`LOG_SIZE_STD`], of how far it lies beyond what the sensors make plausible: what belongs to a run or goes slowly could
/// otherwise take up any effect at no cost.
pub const LOG_SIZE_STD_BEYOND: f64 = 0.8;
/// What is known of a parameter without any reading: its standard deviation as a share of its range.
pub const UNREAD_SHARE_OF_RANGE: f64 = 0.3;
/// Least gain of the rig file's law over no force at all, nats, where a drag says anything of friction.
pub const LEAST_GAIN_OF_LAW: f64 = 60.0;
/// Largest friction, as a share of the rig file's peak, up to which recordings are said to hold no braking: the law is a
/// straight line there, from which neither its peak nor its slip can be read.
pub const LEAST_BRAKING: f64 = 0.3;
/// Least share of samples that only repeat the one before in a channel that is held.
pub const LEAST_REPEATED: f64 = 0.4;

// Timing of the channels.

/// Standard deviations of the audit's lateness within which it is refined.
pub const AUDIT_REACH: f64 = 2.0;
/// Standard deviation of the audit's lateness, s, from which it holds no fit that knows it far better.
pub const VAGUE_AUDIT_S: f64 = 5e-3;
/// Share of the audit's standard deviation up to which the fit's is far better.
pub const FAR_BETTER: f64 = 0.2;
/// By what share of the drag's lateness the others may differ in being early, where it is the drag that is late.
pub const ALIKE_LATE: f64 = 0.35;
/// As [`ALIKE_LATE`], by how many seconds more.
pub const ALIKE_LATE_S: f64 = 1.5e-3;
/// Least lateness of the drag, and earliness of the wheel speed, that is left to be explained, s.
pub const LEAST_DRAG_LATE_S: f64 = 2e-3;
/// As [`LEAST_DRAG_LATE_S`], where no chain shows, s: of 240 development campaigns on ideal sensors that lack nothing the audit
/// finds none late by as much and by [`LATE_STDS`].
pub const LEAST_DRAG_LATE_UNCHAINED_S: f64 = 1e-3;
/// Standard deviations from which a lateness stands out of its own error.
pub const LATE_STDS: f64 = 4.0;
/// Least time by which a brake is read before its torque that no filters of the channels account for, s.
pub const LEAST_BRAKE_EARLY_S: f64 = 0.02;
/// As [`LEAST_BRAKE_EARLY_S`], where the speeds are in step with the drag: the smallest lag that is worth a name.
pub const LEAST_BRAKE_EARLY_IN_STEP_S: f64 = 5e-3;
/// Lateness of a speed up to which its logger is in step with the drag's, s: one that is out of step by up to 20 ms is so
/// little off in one case of seven.
pub const IN_STEP_S: f64 = 1.5e-3;
/// Longest memory of the brake, in times what its reading is early by: a lag of one pole is as early as it is long.
pub const LONGEST_TO_EARLY: f64 = 3.0;
/// Largest standard deviation of a lateness that says anything against another channel's, s.
pub const HEARD_S: f64 = 0.01;
/// Largest standard deviation of a lateness that says anything of the drag's, s.
pub const VAGUE_S: f64 = 2e-3;
/// Standard deviations that timing may be off by without being seen.
pub const UNKNOWN_STDS: f64 = 3.0;
/// Best to which timing is ever known, s.
pub const LEAST_STD_S: f64 = 5e-4;
/// Least share of a speed's rate that is taken for the speed's.
pub const LEAST_RELIABLE: f64 = 0.02;
/// Standard deviations by which a vehicle's lateness has to differ from the wheel's before a fresh run's speeds are moved
/// against each other.
pub const LEAST_STDS_TOLD: f64 = 2.0;
/// A delay is named where it is so many standard deviations from none, beyond [`FORM_OF_DELAY_S`], and a speed is surely out of step
/// where it is, beyond [`IN_STEP_S`].
pub const SURE_DELAY: f64 = 5.0;
/// What a delay may be off by because channels differ in the form of their kernels, too, s: of six development campaigns
/// whose wheel speed was named late and is not, four were within it.
pub const FORM_OF_DELAY_S: f64 = 1e-3;
/// As [`SURE_DELAY`], from this size, s: what no engineer would correct.
pub const LEAST_DELAY_S: f64 = 1.5e-3;
/// Largest standard deviation of a delay that is named, s.
pub const VAGUE_DELAY_S: f64 = 4e-3;
/// Standard deviations by which the audit, too, has to find a delay: on development recordings three of eight that it did
/// not find were false.
pub const AUDITED: f64 = 2.0;

// The repaired model.

/// Fewest usable runs of which whole ones are kept for the proof; of fewer, blocks of each.
pub const FEWEST_RUNS_TO_KEEP: usize = 4;
/// Usable runs for each one that is kept.
pub const RUNS_FOR_ONE_KEPT: usize = 5;
/// Least mean logarithm by which a repaired model lowers the square of a prediction's error: less is chance.
pub const LEAST_GAIN_OF_PREDICTION: f64 = 0.02;
/// Standard deviations of what the next recording gains by which the mean gain has to exceed nothing.
pub const LEAST_STDS_GAINED: f64 = 1.0;
/// As [`LEAST_STDS_GAINED`], of what the error falls by as a share of itself, before the model is exported for recordings to
/// come: of 520 fresh runs of 260 development campaigns it then predicts 3 worse by a percent than the base, and 11 without.
pub const LEAST_STDS_EXPORTED: f64 = 1.6;
/// Factor on the square of an error that is still no worse: one percent, as the bench has it.
pub const MOST_WORSE: f64 = 1.01;
/// Fewest samples of a run from which its tyre balance says anything.
pub const LEAST_OF_TYRE: usize = 30;
/// Fewest samples of all balances that anything can be said of.
pub const LEAST_USABLE: usize = 60;
