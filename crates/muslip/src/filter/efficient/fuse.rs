//! What a sample does to the estimate.

use super::bins::{Bins, Term};
use super::config::{Config, SLIPS};
use super::estimate::{
    DECLARED_NOISE_SAMPLES, Estimate, FIRST_RENEWAL, LARGEST_USUAL_FACTOR, SUSPECT, moved,
};
use super::judge::{MOST_SAMPLES, judge};
use super::sums::Sums;
use crate::filter::Decision;
use crate::filter::mu_slip::State;
use crate::real::Real;

/// Longest step of ln sp between two passes over the bins.
const LONGEST_STEP: f64 = 0.3;
/// Weight of not having learnt the noise yet: the gate takes the noise variance as 1 + this over the
/// samples times what it seems.
const UNLEARNT_NOISE: f64 = 8.0;
/// The gate believes the noise to be at most this many times the declared variance (twice its deviation):
/// outliers that were let in must not open it to others.
const LARGEST_GATE_FACTOR: f64 = 4.0;
/// Growth of the learnt noise variance from which outliers are searched for.
const GROWN: f64 = 1.6;
/// Ratio of the apparent noise variance to the declared one from which outliers are searched for.
const DOUBTFUL_FACTOR: f64 = 2.5;
/// The same ratio from which outliers are taken as certain: the noise is declared to ±50 %.
const CONTAMINATED_FACTOR: f64 = 5.0;
/// Most samples between two renewals.
const MOST_SAMPLES_BETWEEN: u16 = 8192;
/// Noise variance over the start's mup squared below which a weight of one does not go.
const LEAST_UNIT: f64 = 1e-6;
/// Times that the bins are judged for one suspect, at most.
const ROUNDS: u8 = 3;
/// Samples without a new suspect before the bins are judged.
const PATIENCE: u8 = 5;

impl<T: Real> Estimate<T> {
    /// One update, in place. The measurement is not checked.
    #[inline(always)]
    pub(super) fn fuse(
        &mut self,
        config: &Config<T>,
        slip: T,
        friction: T,
        variance: T,
    ) -> Decision {
        let term = self.term(slip, friction, variance);
        // At s0 in place of sp: near enough to see what must be looked at closely.
        let innovation = friction - self.peak_friction * term.sech;
        let squared = innovation * innovation;
        if squared > self.suspect_level * variance {
            return self.look_closely(config, slip, friction, variance);
        }
        self.take(config, &term);
        Decision::Accepted
    }

    /// The law and the weights of a sample.
    #[inline(always)]
    fn term(&self, slip: T, friction: T, variance: T) -> Term<T> {
        let reference = self.reference;
        let (square, about) = (slip * slip, reference * reference);
        let about_peak = square + about;
        // Two reciprocals by one division.
        let inverse = T::ONE / (about_peak * variance);
        let (index, middle) = slip.quarter_binade();
        let by_peak = inverse * variance;
        let by_slip = slip * by_peak;
        Term {
            index,
            ratio: by_slip * (middle * middle + about),
            weight: self.unit * (inverse * about_peak),
            friction,
            sech: by_slip * (reference + reference),
            tanh: (square - about) * by_peak,
        }
    }

    /// Adds a sample, and moves the estimate.
    #[inline(always)]
    fn take(&mut self, config: &Config<T>, term: &Term<T>) {
        self.bins.add(term);
        let weighted_friction = term.weight * term.friction;
        self.sums
            .add(term.sech, term.tanh, term.weight, weighted_friction);
        self.solve();
        self.quiet = self.quiet.wrapping_sub(1);
        if self.quiet == 0 {
            self.attend(config);
        } else if self.shift * self.shift > self.far {
            self.pass(config);
        }
    }

    /// One step of Gauss and Newton from s0: mup and b = mup shift are those of the straight line
    /// z = sech (mup + b tanh) through the samples, and the priors.
    #[inline(always)]
    fn solve(&mut self) {
        let Sums {
            friction,
            friction_slope,
            law,
            law_slope,
            law_curvature,
            ..
        } = self.sums;
        let slip_weight = self.prior.slip_weight;
        // Gradient and curvature in ln sp are friction G/law² and friction² K/law³; one division for all.
        let k = law * law_curvature - law_slope * law_slope;
        let g = friction_slope * law - law_slope * friction;
        let square = law * law;
        let curvature = friction * friction * k + slip_weight * (square * law);
        let inverse = T::ONE / (curvature * law);
        let shift = (friction * g + slip_weight * self.start_log_slip * square) * square * inverse;
        let by_law = curvature * inverse;
        let m = friction * by_law;
        self.shift = shift;
        // d mup/d ln sp = (C' - mup D')/D
        self.peak_friction = m + shift * (friction_slope - (m + m) * law_slope) * by_law;
    }

    /// The sums about where sp is now, and what follows from them.
    #[cold]
    #[inline(never)]
    fn pass(&mut self, config: &Config<T>) {
        let longest = T::from_f64(LONGEST_STEP);
        let step = self.shift.min(longest).max(-longest);
        let reference = moved(self.reference, step);
        let (least, most) = SLIPS;
        if reference > T::from_f64(least) && reference < T::from_f64(most) {
            self.reference = reference;
            self.start_log_slip += -step;
        }
        self.sums = self.prior_sums(config);
        self.bins.add_about(self.reference, &mut self.sums);
        self.solve();
        self.shift = self.shift.min(longest).max(-longest);
    }

    /// Judges the bins, and takes the sums of those that are not left out.
    fn judge_bins(&mut self, config: &Config<T>) {
        let State {
            peak_friction,
            critical_slip,
        } = self.state();
        judge(
            &mut self.bins,
            peak_friction,
            critical_slip,
            self.noise_factor,
            self.unit,
        );
        self.dissent.keep_only(self.bins.left_out);
        self.pass(config);
        self.renew(config);
    }

    /// What is not done after every sample.
    #[cold]
    #[inline(never)]
    fn attend(&mut self, config: &Config<T>) {
        let mut next = self.rest;
        if next == 0 {
            let before = self.noise_factor;
            self.keep_in_range();
            self.renew(config);
            let factor = self.noise_factor;
            let grown = factor > T::from_f64(GROWN) * before && self.seen > FIRST_RENEWAL;
            if (grown || factor > T::from_f64(DOUBTFUL_FACTOR)) && self.due == 0 {
                self.due = 1;
            }
            if self.bins.left_out != 0 {
                self.judge_bins(config);
            }
            next = match config.memory {
                Some(_) => 1,
                None if factor > T::from_f64(CONTAMINATED_FACTOR) => {
                    (self.seen / 4 + 1).min(MOST_SAMPLES_BETWEEN)
                }
                None => self.seen.min(MOST_SAMPLES_BETWEEN - 1) + 1,
            };
            self.seen = self.seen.saturating_add(next);
        }
        if self.due > 0 {
            self.reconsider(config);
        }
        if self.shift * self.shift > self.far {
            self.pass(config);
        }
        (self.quiet, self.rest) = if self.due > 0 {
            (1, next - 1)
        } else {
            (next, 0)
        };
    }

    /// The whole of an update for a sample that is not taken as it comes.
    #[cold]
    #[inline(never)]
    fn look_closely(&mut self, config: &Config<T>, slip: T, friction: T, variance: T) -> Decision {
        if self.bins.occupied == 0 {
            let start = config.initial_state.peak_friction;
            self.unit = variance.max(T::from_f64(LEAST_UNIT) * start * start);
            self.renew(config);
        }
        let expected = self.expected(slip, variance);
        let innovation = friction - expected.friction;
        let squared = innovation * innovation;
        let term = self.term(slip, friction, variance);
        let in_bin = self.bins.get(term.index).count;
        let mut suspect = false;
        if let Some(gate) = config.nis_gate {
            let usual = self.noise_factor.min(T::from_f64(LARGEST_USUAL_FACTOR));
            suspect = squared > T::from_f64(SUSPECT) * usual * variance;
            let degrees = T::from_f64(DECLARED_NOISE_SAMPLES) + (self.count - T::TWO).max(T::ZERO);
            let believed = self.noise_factor.min(T::from_f64(LARGEST_GATE_FACTOR));
            let noise = believed * variance * (T::ONE + T::from_f64(UNLEARNT_NOISE) / degrees);
            let reading = [expected.by_peak_friction, friction];
            let known = [self.peak_friction, expected.noise];
            if suspect && squared > gate * (expected.signal + noise) {
                let seen = (self.seen, config.memory);
                if !self.dissent.take(seen, reading, known) {
                    if in_bin <= T::ZERO && config.memory.is_none() {
                        // Alone in its bin it costs nothing to keep it in mind.
                        self.bins.add(&term);
                        self.bins.left_out |= 1 << term.index;
                        self.dissent.keep(term.index);
                        self.doubt();
                    }
                    self.watch(config);
                    return Decision::Rejected;
                }
                if config.memory.is_some() {
                    // The curve has changed: what is known of the old one misleads.
                    self.bins = Bins::NONE;
                    self.dissent.keep_only(0);
                    self.sums = self.prior_sums(config);
                    self.due = 0;
                    self.renew(config);
                    suspect = false;
                }
            } else if !self.dissent.is_none()
                && !self
                    .dissent
                    .is_undecided(reading, known, T::from_f64(SUSPECT) * expected.noise)
            {
                // It has passed: those rejected before it were glitches, and one in its own bin stays no longer.
                if self.dissent.end(term.index) {
                    self.bins.empty(term.index);
                }
                self.watch(config);
            }
        }
        if let Some(memory) = config.memory {
            self.scale(T::ONE - T::ONE / memory);
        }
        self.take(config, &term);
        if suspect
            && in_bin < T::from_f64(MOST_SAMPLES)
            && squared > T::from_f64(SUSPECT) * (expected.signal + expected.noise)
        {
            self.doubt();
        }
        Decision::Accepted
    }

    /// Has the bins judged a few samples later.
    fn doubt(&mut self) {
        self.due = ROUNDS;
        self.since_suspect = 0;
        self.rest += self.quiet.saturating_sub(1);
        self.quiet = 1;
    }

    /// Judges the bins if it is time, and the peak known well enough to judge by.
    fn reconsider(&mut self, config: &Config<T>) {
        self.since_suspect = self.since_suspect.saturating_add(1);
        let known = self.covariance().p00 < self.noise_factor * self.unit;
        if self.since_suspect < PATIENCE || !known {
            return;
        }
        let before = self.bins.left_out;
        self.judge_bins(config);
        self.due = if self.bins.left_out == before {
            0
        } else {
            self.due - 1
        };
    }
}
