//! Friction differs over a stretch of the track.

use super::prelude::*;

/// Longest stretches that are searched for, as shares of the track.
const LONGEST: [f64; 3] = [1.0, 0.35, 0.12];

/// Farthest that a reading counts, in standard deviations of all that is left: a stray one is no stretch.
const FARTHEST_STDS: f64 = 4.0;

/// Search over stretches of track: residual against predicted drag, by bins of distance, first coarsely.
#[derive(Clone)]
struct Scan {
    bin: f64,
    /// Σ w f r and Σ w f² up to each bin, and over all of them.
    cross: Vec<f64>,
    power: Vec<f64>,
}

/// A stretch by its first bin and the one behind its last, how much friction changes on it, and what that explains beyond
/// a common factor.
#[derive(Clone, Copy)]
struct Stretch {
    bins: [usize; 2],
    change: f64,
    gain: f64,
}

/// Standard deviation of what is left, in those of the drag's sensor.
fn spread(evidence: &[Residuals]) -> f64 {
    let squares = evidence.iter().flat_map(|e| {
        let weighed = e.residual.iter().zip(&e.weight);
        let squares = weighed.map(|(r, w)| r * r * w);
        squares.filter(|square| square.is_finite() && *square > 0.0)
    });
    let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}

impl Scan {
    /// Bins of the search, and fine ones in each of these: an edge that starts farther from its place than it is wide has no
    /// slope to follow.
    const COARSE: usize = 96;
    const FINE: usize = 16;
    const BINS: usize = Self::COARSE * Self::FINE;
    /// Fewest fine bins of a stretch: no shorter one may be named.
    const SHORTEST: usize = 4;

    fn new(context: &Context, series: &[Series], evidence: &[Residuals]) -> Self {
        let bin = (context.distance / Self::BINS as f64).max(1e-6);
        let mut scan = Self {
            bin,
            cross: vec![0.0; Self::BINS + 1],
            power: vec![0.0; Self::BINS + 1],
        };
        let farthest = FARTHEST_STDS * spread(evidence).max(1.0);
        for (run, e) in series.iter().zip(evidence) {
            for k in 0..run.len() {
                let b = ((run.distance[k] / bin) as usize).min(Self::BINS - 1);
                let (f, w) = (e.predicted[k], e.weight[k]);
                if w > 0.0 {
                    let most = farthest / w.sqrt();
                    scan.cross[b + 1] += w * f * e.residual[k].clamp(-most, most);
                    scan.power[b + 1] += w * f * f;
                }
            }
        }
        for sums in [&mut scan.cross, &mut scan.power] {
            for b in 0..Self::BINS {
                sums[b + 1] += sums[b];
            }
        }
        scan
    }

    /// The stretch of these bins; nothing where there is too little on it, or beside it.
    fn stretch(&self, from: usize, to: usize) -> Option<Stretch> {
        let [all_cross, all_power] = [&self.cross, &self.power].map(|sums| sums[Self::BINS]);
        let [c, q] = [&self.cross, &self.power].map(|sums| sums[to] - sums[from]);
        let rest = all_power - q;
        if q < 1e-4 * all_power || rest < 0.1 * all_power {
            return None;
        }
        let change = c / q - (all_cross - c) / rest;
        Some(Stretch {
            bins: [from, to],
            change,
            gain: change * change * q * rest / all_power,
        })
    }

    /// The stretch, no longer than this share of the track, that explains most.
    fn best(&self, longest: f64) -> Option<Stretch> {
        let most = (longest * Self::COARSE as f64) as usize;
        let coarse = (0..Self::COARSE).flat_map(|from| {
            (from + 1..=Self::COARSE.min(from + most))
                .map(move |to| [from, to].map(|b| b * Self::FINE))
        });
        let best = self.best_of(coarse)?;
        let about = |b: usize| b.saturating_sub(Self::FINE)..=(b + Self::FINE).min(Self::BINS);
        let fine =
            about(best.bins[0]).flat_map(|from| about(best.bins[1]).map(move |to| [from, to]));
        let lengths = Self::SHORTEST..=most * Self::FINE;
        self.best_of(fine.filter(|[from, to]| lengths.contains(&to.saturating_sub(*from))))
    }

    fn best_of(&self, bins: impl Iterator<Item = [usize; 2]>) -> Option<Stretch> {
        bins.filter_map(|[from, to]| self.stretch(from, to))
            .max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    /// Removes a stretch that has been found.
    fn take(&mut self, found: Stretch) {
        let [from, to] = found.bins;
        for b in from + 1..=Self::BINS {
            let power = self.power[b.min(to)] - self.power[from];
            self.cross[b] -= found.change * power;
        }
    }
}

/// Friction differs over a stretch of the track.
pub struct SurfacePatch {
    /// Number of stretches.
    pub patches: usize,
}

impl Describe for SurfacePatch {
    fn facts(&self) -> Facts {
        Facts {
            form: if self.patches == 1 { "one" } else { "two" },
            amplitude: Some(2),
            ..Facts::of(
                Id::SurfacePatch,
                Stage::Friction,
                "friction = mu(slip) * (1 + change) where start <= distance < end",
            )
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let mut all = Vec::new();
        for i in 1..=self.patches {
            all.push(Parameter::new(
                &format!("start{i}"),
                "m",
                -1.0,
                context.distance,
            ));
            all.push(Parameter::new(
                &format!("length{i}"),
                "m",
                0.002 * context.distance,
                context.distance,
            ));
            all.push(Parameter::new(&format!("change{i}"), "1", -0.95, 2.0));
        }
        all
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        let fresh = Scan::new(search.context, search.series, search.residuals);
        let mut starts: Vec<Vec<f64>> = Vec::new();
        // What differs over most of the track hides shorter stretches.
        for longest in LONGEST {
            let mut scan = fresh.clone();
            let mut start = Vec::new();
            for _ in 0..self.patches {
                let Some(found) = scan.best(longest) else {
                    break;
                };
                let [from, to] = found.bins.map(|b| b as f64 * scan.bin);
                start.extend([from, to - from, 0.8 * found.change]);
                scan.take(found);
            }
            if start.len() == 3 * self.patches && !starts.contains(&start) {
                starts.push(start);
            }
        }
        starts
    }
    fn begins_with_recordings(&self, parameters: &[f64]) -> bool {
        let stretches = parameters.chunks_exact(3);
        stretches.map(|own| own[0]).any(|start| start <= 0.0)
    }
    fn statement(&self, reported: &[Reported<f64>], p: &[f64]) -> String {
        format!(
            "friction is {:.1} % {} from {:.1} m to {:.1} m of the track",
            100.0 * p[2].abs(),
            if p[2] < 0.0 { "lower" } else { "higher" },
            reported[0].value,
            p[0] + p[1]
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A stretch of the track is wetter, dustier or smoother than the rest, and friction changes where the tyre enters it and where it leaves. It belongs to the place and not to the tyre.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::ThermalFade,
                    why: "A patch late in the run takes friction where heat does.",
                    run: runs::TRACK_AGAIN,
                },
                Alias {
                    with: Id::ZeroDrift,
                    why: "Both begin somewhere along the run.",
                    run: runs::TRACK_AGAIN,
                },
                Alias {
                    with: Id::SpeedSensitivity,
                    why: "A vehicle that slows down alike in every run is as fast at the patch each time.",
                    run: runs::TRACK_AGAIN,
                },
            ],
            smallest: "three percent of friction over a few metres",
            smallest_size: |_| 0.03,
            compensation: Compensation::Not("a property of the track, not of the tyre"),
            carried: "only to runs that start at the same place of the same track: distance counts from the first sample, without gaps that begin at a standstill",
            example: Example::of("one", &[20.0, 15.0, -0.15]),
        }
    }
}

impl<T: Number> Mechanism<T> for SurfacePatch {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        // Edges as wide as a contact patch, so that their places have a slope to follow.
        let edge = (0.4 * context.radius).max(context.mean_speed * context.dt);
        for (f, x) in state.friction.iter_mut().zip(&series.distance) {
            let mut factor = T::constant(1.0);
            for part in p.chunks_exact(3) {
                let rise = (-(part[0] - *x) / edge).tanh();
                let fall = (-(part[0] + part[1] - *x) / edge).tanh();
                factor += part[2] * (rise - fall) * 0.5;
            }
            *f = *f * factor;
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let first = p
            .chunks_exact(3)
            .min_by(|a, b| a[0].value().total_cmp(&b[0].value()))
            .map_or(T::constant(0.0), |part| part[0]);
        vec![Reported::new("start", "m", first)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_from_before_the_recordings_begins_with_them() {
        let patch = SurfacePatch { patches: 2 };
        assert!(patch.begins_with_recordings(&[20.0, 5.0, 0.2, -0.5, 4.0, -0.3]));
        assert!(!patch.begins_with_recordings(&[20.0, 5.0, 0.2, 0.5, 4.0, -0.3]));
    }

    #[test]
    fn edges_of_a_stretch_are_found_to_a_fine_bin() {
        // Two stretches of 10 m, whose edges lie within bins of 0.1 m.
        let distance: Vec<f64> = (0..5000).map(|k| 0.002 * f64::from(k)).collect();
        let change = |x: f64| match x {
            2.537..4.171 => -0.2,
            7.262..7.813 => 0.15,
            _ => 0.0,
        };
        // Beside a sensor of 10 N, and one of 1 N, of which what is missing is twenty standard deviations.
        let residuals = |weight: f64| Residuals {
            predicted: vec![100.0; distance.len()],
            residual: distance.iter().map(|x| 100.0 * change(*x)).collect(),
            weight: vec![weight; distance.len()],
        };
        let residuals = [1e-2, 1.0].map(residuals);
        let context = Context {
            distance: 10.0,
            ..Context::default()
        };
        let series = Series {
            time: distance.clone(),
            distance,
            ..Series::default()
        };
        let two = SurfacePatch { patches: 2 };
        let fine = 10.0 / Scan::BINS as f64;
        let near = |a: f64, b: f64| (a - b).abs() < 1.5 * fine;
        let found = |s: &Vec<f64>| {
            near(s[0], 2.537)
                && near(s[0] + s[1], 4.171)
                && near(s[3], 7.262)
                && near(s[3] + s[4], 7.813)
                && (s[2] + 0.8 * 0.2).abs() < 0.04
        };
        for residuals in residuals {
            let starts = two.starts(&Search {
                context: &context,
                series: core::slice::from_ref(&series),
                residuals: &[residuals],
            });
            assert!(starts.iter().any(found), "{starts:?}");
        }
    }
}
