//! Friction differs over a stretch of the track.

use super::prelude::*;

/// Longest stretches that are searched for, as shares of the track.
const LONGEST: [f64; 3] = [1.0, 0.35, 0.12];

/// Search over stretches of track: residual against predicted drag, by bins of distance.
#[derive(Clone)]
struct Scan {
    bin: f64,
    /// Σ w f r and Σ w f² by bin.
    cross: Vec<f64>,
    power: Vec<f64>,
}

impl Scan {
    const BINS: usize = 96;

    fn new(context: &Context, series: &[Series], evidence: &[Residuals]) -> Self {
        let bin = (context.distance / Self::BINS as f64).max(1e-6);
        let mut scan = Self {
            bin,
            cross: vec![0.0; Self::BINS],
            power: vec![0.0; Self::BINS],
        };
        for (run, e) in series.iter().zip(evidence) {
            for k in 0..run.len() {
                let b = ((run.distance[k] / bin) as usize).min(Self::BINS - 1);
                let (f, w) = (e.predicted[k], e.weight[k]);
                if w > 0.0 {
                    scan.cross[b] += w * f * e.residual[k].clamp(-4.0 / w.sqrt(), 4.0 / w.sqrt());
                    scan.power[b] += w * f * f;
                }
            }
        }
        scan
    }

    /// Start, length and relative change of the stretch, no longer than this share of the track, that explains most
    /// beyond a common factor.
    fn best(&self, longest: f64) -> Option<(f64, f64, f64)> {
        let most = (longest * Self::BINS as f64) as usize;
        let all_cross: f64 = self.cross.iter().sum();
        let all_power: f64 = self.power.iter().sum();
        let mut best: Option<(f64, (f64, f64, f64))> = None;
        for from in 0..Self::BINS {
            let (mut c, mut q) = (0.0, 0.0);
            for to in from..Self::BINS.min(from + most) {
                c += self.cross[to];
                q += self.power[to];
                let rest = all_power - q;
                if q < 1e-4 * all_power || rest < 0.1 * all_power {
                    continue;
                }
                let change = c / q - (all_cross - c) / rest;
                let gain = change * change * q * rest / all_power;
                if best.is_none_or(|b| gain > b.0) {
                    let length = (to + 1 - from) as f64 * self.bin;
                    best = Some((gain, (from as f64 * self.bin, length, change)));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// Removes a stretch that has been found.
    fn take(&mut self, from: f64, length: f64, change: f64) {
        for b in 0..Self::BINS {
            let centre = (b as f64 + 0.5) * self.bin;
            if centre >= from && centre < from + length {
                self.cross[b] -= change * self.power[b];
            }
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
                let Some((from, length, change)) = scan.best(longest) else {
                    break;
                };
                start.extend([from, length, 0.8 * change]);
                scan.take(from, length, change);
            }
            if start.len() == 3 * self.patches && !starts.contains(&start) {
                starts.push(start);
            }
        }
        starts
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
            carried: "only to runs that start at the same place of the same track: distance counts from the first sample",
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
