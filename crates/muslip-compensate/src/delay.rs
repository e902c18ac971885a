//! A line of the last samples, read back a fixed time with a straight line between samples.

use muslip::real::Real;

/// One sample in the line: how long after its predecessor, and what was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Entry<T> {
    /// Time since the entry before in s; of the oldest one it says nothing.
    pub step_s: T,
    /// What is delayed.
    pub inputs: Inputs<T>,
}

/// What the reading is late against: wheel speed, vehicle speed, normal force.
pub(super) type Inputs<T> = [T; 3];

/// Up to `N` samples, the oldest of them the last one that is at least the delay old.
///
/// Times are kept as differences, so that single precision does not tire over a day's run: the age of
/// the oldest sample is raised and lowered by steps and stays of the size of the delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DelayLine<T, const N: usize> {
    entries: [Entry<T>; N],
    oldest: usize,
    count: usize,
    /// Age of the oldest entry in s.
    age_s: T,
}

// By hand: defmt has arrays of any length, but not derived with a length of the type's own.
#[cfg(feature = "defmt")]
impl<T: defmt::Format, const N: usize> defmt::Format for DelayLine<T, N> {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(
            f,
            "DelayLine {{ count: {}, age_s: {} }}",
            self.count,
            self.age_s
        );
    }
}

/// The line after a step that may still be dropped.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planned<T> {
    oldest: usize,
    count: usize,
    age_s: T,
    entry: Entry<T>,
    /// The inputs of `delay_s` ago; `None` while the line does not reach back that far.
    pub delayed: Option<Inputs<T>>,
}

impl<T: Real, const N: usize> DelayLine<T, N> {
    pub(super) fn empty() -> Self {
        Self {
            entries: [Entry {
                step_s: T::ZERO,
                inputs: [T::ZERO; 3],
            }; N],
            oldest: 0,
            count: 0,
            age_s: T::ZERO,
        }
    }

    /// What adding a sample, `step_s` after the one before, would do; `None` where there is no room.
    /// A `fresh` start forgets what the line holds.
    pub(super) fn plan(
        &self,
        delay_s: T,
        step_s: T,
        inputs: Inputs<T>,
        fresh: bool,
    ) -> Option<Planned<T>> {
        let entry = Entry { step_s, inputs };
        let (mut oldest, mut count) = (self.oldest, if fresh { 0 } else { self.count });
        let mut age_s = if count == 0 {
            T::ZERO
        } else {
            self.age_s + step_s
        };
        // The entry after the oldest: stored, or the new one.
        let after = |oldest: usize, count: usize| {
            if count > 1 {
                self.entries.get(next::<N>(oldest)).copied()
            } else {
                Some(entry)
            }
        };
        while count > 0 {
            let second_age_s = age_s - after(oldest, count)?.step_s;
            if second_age_s < delay_s {
                break;
            }
            age_s = second_age_s;
            oldest = next::<N>(oldest);
            count -= 1;
        }
        if count == 0 {
            // The new entry is the oldest; where it is none too young, nothing is delayed.
            age_s = T::ZERO;
        }
        let delayed = if age_s < delay_s {
            None
        } else if count == 0 {
            Some(inputs)
        } else {
            let first = self.entries.get(oldest)?.inputs;
            let second = after(oldest, count)?;
            let share = (age_s - delay_s) / second.step_s;
            let mut between = first;
            for (x, end) in between.iter_mut().zip(second.inputs) {
                *x += share * (end - *x);
            }
            Some(between)
        };
        if count >= N {
            return None;
        }
        Some(Planned {
            oldest,
            count,
            age_s,
            entry,
            delayed,
        })
    }

    /// Adds the sample of a plan made from this very line.
    pub(super) fn commit(&mut self, planned: &Planned<T>) {
        let at = wrapped::<N>(planned.oldest + planned.count);
        if let Some(slot) = self.entries.get_mut(at) {
            *slot = planned.entry;
            self.oldest = planned.oldest;
            self.count = planned.count + 1;
            self.age_s = planned.age_s;
        }
    }
}

fn next<const N: usize>(index: usize) -> usize {
    wrapped::<N>(index + 1)
}

/// An index below 2 N into the ring; a division is a library call on small targets.
fn wrapped<const N: usize>(index: usize) -> usize {
    if index >= N { index - N } else { index }
}

#[cfg(test)]
mod tests {
    use super::DelayLine;

    /// Runs a line of capacity 8 over samples of 2 t, 3 t, 5 t and returns what came out.
    fn delayed(delay_s: f64, steps: &[f64]) -> Vec<Option<[f64; 3]>> {
        let mut line = DelayLine::<f64, 8>::empty();
        let mut t = 0.0;
        steps
            .iter()
            .map(|step| {
                t += step;
                let planned = line
                    .plan(delay_s, *step, [2.0 * t, 3.0 * t, 5.0 * t], false)
                    .unwrap();
                line.commit(&planned);
                planned.delayed
            })
            .collect()
    }

    use std::vec::Vec;
    extern crate std;

    #[test]
    fn a_straight_line_comes_back_late_by_the_delay_at_any_step() {
        for delay in [0.0, 0.3, 1.0, 2.0, 4.7] {
            for steps in [
                [1.0; 30],
                core::array::from_fn(|k| if k % 3 == 0 { 0.7 } else { 1.3 }),
                core::array::from_fn(|k| if k == 20 { 60.0 } else { 0.9 }),
            ] {
                let mut t = 0.0;
                let mut had = 0;
                for (step, out) in steps.iter().zip(delayed(delay, &steps)) {
                    t += step;
                    // Nothing is known from before the first sample.
                    assert_eq!(out.is_some(), t - delay >= steps[0] - 1e-9, "{t} {delay}");
                    if let Some(out) = out {
                        had += 1;
                        for (x, rate) in out.iter().zip([2.0, 3.0, 5.0]) {
                            assert!((x - rate * (t - delay)).abs() < 1e-9, "{t} {delay}: {x}");
                        }
                    }
                }
                assert!(had > 15);
            }
        }
    }

    #[test]
    fn a_line_that_is_full_refuses_and_keeps_what_it_has() {
        let mut line = DelayLine::<f32, 3>::empty();
        for _ in 0..3 {
            let planned = line.plan(10.0, 1.0, [1.0; 3], false).unwrap();
            line.commit(&planned);
        }
        let before = line;
        assert!(line.plan(10.0, 1.0, [1.0; 3], false).is_none());
        assert_eq!(line, before);
        // A fresh start, or a pause that lets the old ones go, makes room.
        assert!(line.plan(10.0, 1.0, [1.0; 3], true).is_some());
        assert!(line.plan(10.0, 30.0, [1.0; 3], false).is_some());
        assert!(
            DelayLine::<f32, 0>::empty()
                .plan(1.0, 1.0, [1.0; 3], false)
                .is_none()
        );
    }

    #[test]
    fn the_smallest_line_that_spans_the_delay_is_enough() {
        // ⌈2.5/1⌉ + 1
        let mut line = DelayLine::<f64, 4>::empty();
        for k in 0..40 {
            let planned = line.plan(2.5, 1.0, [f64::from(k); 3], false).unwrap();
            line.commit(&planned);
            if k > 2 {
                let [x, ..] = planned.delayed.unwrap();
                assert!((x - (f64::from(k) - 2.5)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn single_precision_does_not_tire() {
        let mut line = DelayLine::<f32, 16>::empty();
        let step = 0.001_f32;
        let mut last = 0.0;
        for k in 0_u32..2_000_000 {
            #[expect(clippy::cast_precision_loss, reason = "small remainder")]
            let saw = (k % 64) as f32;
            let jitter = if k % 7 == 0 { 1.1e-3 } else { step };
            let planned = line.plan(0.0102, jitter, [saw; 3], false).unwrap();
            line.commit(&planned);
            last = line.age_s;
        }
        // Age of the oldest from the entries themselves.
        let mut age = 0.0;
        for offset in 1..line.count {
            age += f64::from(line.entries[(line.oldest + offset) % 16].step_s);
        }
        assert!((f64::from(last) - age).abs() < 2e-6, "{last} {age}");
    }
}
