//! The result of a diagnosis by innovations, put together from what each stage found.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::audit::{Audit, audit};
use crate::campaign::{Rig, Run};
use crate::chain::timing::{Timing, timed};
use crate::confidence::figures;
use crate::data::Data;
use crate::decide::{Claim, Decision, Trial, decide, stands, through_force};
use crate::innovations::candidates::slopes_in;
use crate::innovations::dependence::Dependence;
use crate::innovations::hypothesis::Judged;
use crate::innovations::rows::rows;
use crate::locate::{intervals, regions};
use crate::mechanism::{Balance, Id, Reported, Stage};
use crate::model::{Model, TYRE_BASE};
use crate::omnibus::finite_or_zero;
use crate::outcome::{
    Alternative, BeforeAfter, ChannelNoise, Diagnosis, Estimate, Evidence, Fault, Figure, Fit,
    Interval, LookedFor, NamedMechanism, Recording, Region, Role, Score, Trace, Unexplained,
    Verdict,
};
use crate::repaired::{Correction, Domain, KnownRecording, NoiseModel, Repaired};

/// Softness of the choice between two names in nats: no model of this kind is exactly true.
const SOFTNESS: f64 = 4.0;
/// The same as a share of what the chosen name gains.
const SOFT_SHARE: f64 = 0.03;
/// A delay is named where it is so many standard deviations and so many seconds from none.
const SURE_DELAY: f64 = 5.0;
const LEAST_DELAY_S: f64 = 1.5e-3;
/// Largest standard deviation in s of a delay that is named.
const VAGUE_DELAY_S: f64 = 4e-3;
/// Points of a trace.
const TRACE_POINTS: usize = 1200;

/// Diagnoses a campaign: the chain first, then physics on innovations.
#[must_use]
pub fn diagnose(rig: &Rig, runs: &[Run], progress: &(dyn Fn(f64, &str) + Sync)) -> Diagnosis {
    progress(0.05, "auditing the measuring chain");
    let audit = audit(rig, runs);
    progress(0.15, "bringing the channels to one time");
    let Some((data, timing, base)) = timed(rig, runs, &audit) else {
        return undecided(rig, runs, audit);
    };
    progress(0.4, "weighing mechanisms");
    // Delays of the speeds are the chain's: they are named by what the timing shows.
    let decision = decide(
        &data,
        base,
        &[Id::VehicleSpeedDelay, Id::WheelSpeedDelay],
        timing.off_by(),
    );
    progress(0.9, "report");
    Answer {
        rig,
        runs,
        audit,
        data: &data,
        timing,
        decision,
    }
    .assemble()
}

fn undecided(rig: &Rig, runs: &[Run], audit: Audit) -> Diagnosis {
    let fault = |r: &Run| Fault {
        recording: r.name.clone(),
        channel: "drag_force_n".to_owned(),
        start_s: finite_or_zero(r.time_s.first().copied().unwrap_or(0.0)),
        end_s: finite_or_zero(r.time_s.last().copied().unwrap_or(0.0)),
        what: "too few usable samples in every balance".to_owned(),
    };
    let estimate = |value: f64| Estimate { value, std: value };
    Diagnosis {
        schema: "muslip.diagnosis/1",
        verdict: Verdict::Undecided,
        recordings: runs
            .iter()
            .map(|r| Recording {
                path: r.name.clone(),
                samples: r.len(),
                role: Role::Fit,
            })
            .collect(),
        noise: BTreeMap::new(),
        base: [
            ("peak_friction".to_owned(), estimate(rig.peak_friction)),
            ("critical_slip".to_owned(), estimate(rig.critical_slip)),
        ]
        .into(),
        r#where: Vec::new(),
        regions: Vec::new(),
        mechanisms: Vec::new(),
        unexplained: Vec::new(),
        looked_for: Id::ALL
            .iter()
            .map(|id| LookedFor {
                id: id.as_str(),
                identifiable: false,
                minimum_detectable: None,
            })
            .collect(),
        data_faults: runs.iter().map(fault).collect(),
        chain: audit.findings,
        fit: Fit::default(),
        caveats: Vec::new(),
        traces: Vec::new(),
        repaired: Repaired {
            schema: "muslip.model/1".to_owned(),
            rig: rig.clone(),
            base_alone: law_of(rig),
            base: law_of(rig),
            ..Repaired::default()
        },
    }
}

fn law_of(rig: &Rig) -> Vec<f64> {
    let mut base = vec![0.0; TYRE_BASE];
    base[0] = rig.peak_friction.ln();
    base[1] = rig.critical_slip.ln();
    base
}

struct Answer<'a> {
    rig: &'a Rig,
    runs: &'a [Run],
    audit: Audit,
    data: &'a Data,
    timing: Timing,
    decision: Decision,
}

impl Answer<'_> {
    fn assemble(self) -> Diagnosis {
        let plain = plain_law(self.rig, self.runs);
        let mut mechanisms = self.named();
        mechanisms.extend(self.named_delays());
        let better = self.predicts_better(&plain);
        if !better {
            for named in &mut mechanisms {
                if Id::parse(named.id).is_some_and(through_force) {
                    named.evidence.confidence = named.evidence.confidence.min(0.5);
                }
            }
        }
        mechanisms.sort_by(|a, b| b.evidence.delta_bic.total_cmp(&a.evidence.delta_bic));
        let unexplained = self.unexplained();
        let verdict = match (mechanisms.is_empty(), unexplained.is_empty()) {
            (true, true) => Verdict::Consistent,
            (false, true) => Verdict::Explained,
            (false, false) => Verdict::PartlyExplained,
            (true, false) => Verdict::Unexplained,
        };
        let (r#where, regions) = if mechanisms.is_empty() && unexplained.is_empty() {
            (Vec::new(), Vec::new())
        } else {
            self.located()
        };
        Diagnosis {
            schema: "muslip.diagnosis/1",
            verdict,
            recordings: self
                .runs
                .iter()
                .map(|r| Recording {
                    path: r.name.clone(),
                    samples: r.len(),
                    role: Role::Fit,
                })
                .collect(),
            noise: self.noise(),
            base: self.base(),
            r#where,
            regions,
            mechanisms,
            unexplained,
            looked_for: self.looked_for(),
            data_faults: self.faults(),
            chain: self.audit.findings.clone(),
            fit: self.fit(),
            caveats: self.caveats(),
            traces: self.traces(),
            repaired: self.repaired(&plain, better),
        }
    }

    /// Covariance in the order of the model's whole vector.
    fn covariance(&self, judged: &Judged) -> DMatrix<f64> {
        let n = judged.model.vector().len();
        let own: Vec<usize> = [0, 1].into_iter().chain(TYRE_BASE..n).collect();
        let mut all = DMatrix::zeros(n, n);
        for (i, &a) in own.iter().enumerate() {
            for (j, &b) in own.iter().enumerate() {
                all[(a, b)] = finite_or_zero(judged.covariance[(i, j)]);
            }
        }
        all
    }

    fn named(&self) -> Vec<NamedMechanism> {
        let chosen = &self.decision.chosen;
        let covariance = self.covariance(chosen);
        chosen
            .model
            .terms
            .iter()
            .enumerate()
            .filter_map(|(place, term)| {
                let mechanism = self.data.catalogue.get(term.entry);
                let id = mechanism.id();
                let (trial, round) = self.decision.rounds.iter().find_map(|round| {
                    round
                        .iter()
                        .find(|t| t.mechanism().is_some_and(|m| m.1 == term.entry))
                        .map(|t| (t, round))
                })?;
                let reported = figures(self.data, &chosen.model, &covariance, place);
                let values: Vec<Reported<f64>> = reported.iter().map(|(r, _)| r.clone()).collect();
                let (confidence, others) = confidence(trial, round, self.data.series.len());
                let samples: usize = self.data.series.iter().map(|s| s.len()).sum();
                Some(NamedMechanism {
                    id: id.as_str(),
                    balance: id.balance().as_str(),
                    statement: sentence(&mechanism.statement(&values, &term.parameters)),
                    equation: mechanism.equation().to_owned(),
                    parameters: reported
                        .iter()
                        .map(|(r, std)| Figure {
                            name: r.name.to_owned(),
                            value: finite_or_zero(r.value),
                            std: finite_or_zero(*std),
                            unit: r.unit.to_owned(),
                        })
                        .collect(),
                    evidence: Evidence {
                        delta_bic: 2.0 * trial.gain,
                        holdout_nll_gain_per_sample: finite_or_zero(
                            trial.unseen.0 * self.data.series.len() as f64 / samples.max(1) as f64,
                        ),
                        confidence,
                    },
                    separating_test: others
                        .first()
                        .filter(|o| o.confidence > 0.05)
                        .and_then(|o| Id::parse(o.id))
                        .map_or(String::new(), |other| {
                            crate::separating::separating_test(id, other).to_owned()
                        }),
                    confusable_with: others,
                    effect_sigma: finite_or_zero(
                        (2.0 * trial.gain.max(0.0) / samples.max(1) as f64).sqrt(),
                    ),
                })
            })
            .collect()
    }

    /// Coefficients of each free dependence.
    fn dependences(&self) -> Vec<(&Dependence, Vec<f64>)> {
        let chosen = &self.decision.chosen;
        let mut at = 2 + chosen.model.vector().len() - TYRE_BASE;
        chosen
            .extra
            .iter()
            .map(|own| {
                let from = at;
                at += own.knots.len();
                (
                    own,
                    (from..at).map(|i| finite_or_zero(chosen.left[i])).collect(),
                )
            })
            .collect()
    }

    fn corrections(&self) -> Vec<Correction> {
        self.dependences()
            .into_iter()
            .filter(|(own, _)| own.balance == Balance::Tyre)
            .map(|(own, coefficients)| own.correction(self.data, &coefficients))
            .collect()
    }

    fn unexplained(&self) -> Vec<Unexplained> {
        let gained: f64 = (self.decision.base.loss - self.decision.chosen.loss).max(1e-9);
        self.decision
            .chosen
            .extra
            .iter()
            .map(|own| {
                let gain = self
                    .decision
                    .rounds
                    .iter()
                    .flatten()
                    .find_map(|t| match &t.claim {
                        Claim::Dependence(d)
                            if d.variable == own.variable && d.balance == own.balance =>
                        {
                            Some(t.gain)
                        }
                        _ => None,
                    })
                    .unwrap_or(0.0);
                Unexplained {
                    balance: own.balance.as_str(),
                    variable: own.variable.word(self.data),
                    form: String::new(),
                    z: finite_or_zero((2.0 * gain.max(0.0)).sqrt()),
                    share: (gain / gained).clamp(0.0, 1.0),
                }
            })
            .collect()
    }

    /// Delays that the base simulation's residuals show: of one speed, or of the drag where all others are early alike.
    fn named_delays(&self) -> Vec<NamedMechanism> {
        let runs = self.data.series.len();
        let known: Vec<(&str, f64, f64)> = self
            .timing
            .estimates
            .iter()
            .copied()
            .filter(|(_, _, std)| *std < VAGUE_DELAY_S)
            .collect();
        let seen = |value: f64, std: f64| {
            value.abs() > SURE_DELAY * std.max(1e-4) && value.abs() > LEAST_DELAY_S
        };
        let mut all = Vec::new();
        // Where all others are early it is the drag that is late, by what the least early of them says.
        let speeds: Vec<&(&str, f64, f64)> = known.iter().filter(|k| k.0 != "brake").collect();
        if !speeds.is_empty()
            && speeds.iter().all(|(_, v, s)| *v < 0.0 && seen(*v, *s))
            && let Some((_, value, std)) = speeds.iter().max_by(|a, b| a.1.total_cmp(&b.1))
        {
            all.push(delay(Id::ForceDelay, -value, *std, runs));
        }
        for (name, id) in [
            ("wheel", Id::WheelSpeedDelay),
            ("vehicle", Id::VehicleSpeedDelay),
        ] {
            if let Some((_, value, std)) = known
                .iter()
                .find(|(n, v, s)| *n == name && *v > 0.0 && seen(*v, *s))
            {
                all.push(delay(id, *value, *std, runs));
            }
        }
        all
    }

    /// Whether the repaired model predicts the drag of unseen runs no worse than the law fitted to raw channels.
    fn predicts_better(&self, plain: &[f64]) -> bool {
        let base = self.repaired(plain, false);
        let with = self.repaired(plain, true);
        let mut better = 0;
        let mut worse = 0;
        for (run, given) in self.runs.iter().enumerate() {
            let mut given = given.clone();
            // As a run that the model has not seen.
            given.name = format!("unseen {run}");
            let drag = given.drag_force_n.clone();
            let error = |model: &Repaired| -> Option<f64> {
                let p = model
                    .predict(&given, crate::repaired::Which::Repaired)
                    .ok()?;
                let e: Vec<f64> = p
                    .drag_force_n
                    .iter()
                    .zip(&drag)
                    .map(|(a, b)| (a - b).powi(2))
                    .filter(|e| e.is_finite())
                    .collect();
                Some(e.iter().sum::<f64>() / e.len().max(1) as f64)
            };
            let (Some(a), Some(b)) = (error(&base), error(&with)) else {
                return false;
            };
            if b < a {
                better += 1
            } else if b > 1.002 * a {
                worse += 1
            }
        }
        better > worse && worse * 4 <= self.runs.len()
    }

    /// The law's two parameters that predict best beside the named terms: by plain least squares, for a prediction has
    /// noisy inputs, too.
    fn predicting_base(&self) -> Vec<f64> {
        let data = self.data;
        let mut model = self.decision.chosen.model.clone();
        for _ in 0..6 {
            let (mut a, mut b, mut c, mut u, mut v) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (run, s) in data.series.iter().enumerate() {
                let e =
                    rows::<f64>(&data.catalogue, &model, &model.vector(), s, &data.context).tyre;
                if e.is_empty() {
                    continue;
                }
                let slopes = slopes_in(data, &model, run, &[0, 1]);
                for k in s.tyre.iter().flat_map(Clone::clone) {
                    let (x, y) = (slopes[0][0][k], slopes[1][0][k]);
                    if !(x + y + e[k]).is_finite() {
                        continue;
                    }
                    a += x * x;
                    b += x * y;
                    c += y * y;
                    u -= x * e[k];
                    v -= y * e[k];
                }
            }
            let determinant = a * c - b * b;
            if !(determinant > 1e-9 * a * c) {
                break;
            }
            let step = [(c * u - b * v) / determinant, (a * v - b * u) / determinant];
            model.base[0] += step[0].clamp(-0.2, 0.2);
            model.base[1] += step[1].clamp(-0.2, 0.2);
            if step.iter().all(|s| s.abs() < 1e-5) {
                break;
            }
        }
        model.base
    }

    fn located(&self) -> (Vec<Interval>, Vec<Region>) {
        let data = self.data;
        let (base, chosen) = (&self.decision.base.model, &self.decision.chosen.model);
        let of = |model: &Model, run: usize| {
            rows::<f64>(
                &data.catalogue,
                model,
                &model.vector(),
                &data.series[run],
                &data.context,
            )
        };
        let both: Vec<_> = (0..data.series.len())
            .map(|run| (of(base, run), of(chosen, run)))
            .collect();
        let free = self.dependences();
        let mut found = Vec::new();
        let mut where_regions = Vec::new();
        let drag = self.white(Balance::Tyre).unwrap_or(data.context.drag_sigma);
        let mean_speed_noise = |f: &dyn Fn(&crate::prepare::Series) -> f64| {
            data.series.iter().map(f).sum::<f64>() / data.series.len() as f64
        };
        for balance in [Balance::Tyre, Balance::Wheel, Balance::Vehicle] {
            let touched = chosen
                .terms
                .iter()
                .any(|t| data.catalogue.get(t.entry).id().balance() == balance)
                || self
                    .decision
                    .chosen
                    .extra
                    .iter()
                    .any(|e| e.balance == balance);
            if !touched {
                continue;
            }
            let usable: Vec<_> = data
                .series
                .iter()
                .map(|s| match balance {
                    Balance::Tyre => s.tyre.clone(),
                    Balance::Wheel => s.wheel_balance.clone(),
                    Balance::Vehicle => s.vehicle_balance.clone(),
                })
                .collect();
            let difference: Vec<Vec<f64>> = both
                .iter()
                .enumerate()
                .map(|(run, (a, b))| {
                    let s = &data.series[run];
                    let pick = |r: &crate::innovations::rows::Rows<f64>| match balance {
                        Balance::Tyre => r.tyre.clone(),
                        Balance::Wheel => r.wheel.clone(),
                        Balance::Vehicle => r.vehicle.clone(),
                    };
                    let mut d: Vec<f64> = pick(a).iter().zip(pick(b)).map(|(a, b)| b - a).collect();
                    for (own, coefficients) in &free {
                        for (triple, c) in own.columns[run].iter().zip(coefficients) {
                            for (d, x) in d.iter_mut().zip(&triple[balance as usize]) {
                                *d += c * x;
                            }
                        }
                    }
                    if d.is_empty() {
                        return vec![0.0; s.len()];
                    }
                    if balance == Balance::Tyre {
                        return d;
                    }
                    (0..d.len())
                        .map(|k| {
                            if k == 0 {
                                0.0
                            } else {
                                (d[k] - d[k - 1]) / s.dt[k]
                            }
                        })
                        .collect()
                })
                .collect();
            let acceleration = |sigma: f64| {
                let samples = (0.05 / data.context.dt).max(2.0);
                sigma * (12.0 / samples).sqrt() / 0.05
            };
            let (sigma, channel) = match balance {
                Balance::Tyre => (drag, "drag_force_n"),
                Balance::Wheel => {
                    let torque = mean_speed_noise(&|s| s.torque.as_ref().map_or(0.0, |t| t.sigma));
                    let turning =
                        data.context.inertia * acceleration(mean_speed_noise(&|s| s.wheel.sigma));
                    (
                        (drag * data.context.radius).hypot(torque).hypot(turning),
                        "wheel_speed_rad_s",
                    )
                }
                Balance::Vehicle => (
                    drag.hypot(
                        data.context.mass * acceleration(mean_speed_noise(&|s| s.speed.sigma)),
                    ),
                    "vehicle_speed_m_s",
                ),
            };
            for (run, s) in data.series.iter().enumerate() {
                for (start_s, end_s, z) in
                    intervals(&s.time, &difference[run], &usable[run], sigma, sigma)
                {
                    found.push(Interval {
                        recording: s.name.clone(),
                        balance: balance.as_str(),
                        channel: channel.to_owned(),
                        start_s,
                        end_s,
                        z,
                    });
                }
            }
            where_regions.extend(regions(data, balance.as_str(), &difference, &usable, sigma));
        }
        (found, where_regions)
    }

    /// White noise of a balance's readings as fitted.
    fn white(&self, balance: Balance) -> Option<f64> {
        let parts = self
            .decision
            .chosen
            .parts
            .iter()
            .find(|p| p.balance == balance)?;
        parts
            .sources
            .iter()
            .find(|s| s.kind.is_none())
            .map(|s| s.log_std.exp())
    }

    fn noise(&self) -> BTreeMap<String, ChannelNoise> {
        let data = self.data;
        let mean = |f: &dyn Fn(&crate::prepare::Series) -> f64| {
            let all: Vec<f64> = data
                .series
                .iter()
                .map(f)
                .filter(|x| x.is_finite())
                .collect();
            finite_or_zero(
                (all.iter().map(|x| x * x).sum::<f64>() / all.len().max(1) as f64).sqrt(),
            )
        };
        let white = (data.averaged as f64).sqrt();
        [
            (
                "drag_force_n",
                self.white(Balance::Tyre).unwrap_or(data.context.drag_sigma),
            ),
            ("normal_force_n", mean(&|s| s.load.sigma)),
            ("wheel_speed_rad_s", mean(&|s| s.wheel.sigma)),
            ("vehicle_speed_m_s", mean(&|s| s.speed.sigma)),
        ]
        .into_iter()
        .map(|(name, sigma)| {
            (
                name.to_owned(),
                ChannelNoise {
                    sigma: sigma * white,
                    declared: data.rig.declared_noise.get(name).copied(),
                },
            )
        })
        .collect()
    }

    fn base(&self) -> BTreeMap<String, Estimate> {
        let mut all = BTreeMap::new();
        for (judged, prefix) in [
            (&self.decision.base, ""),
            (&self.decision.chosen, "repaired_"),
        ] {
            if !prefix.is_empty() && judged.model.terms.is_empty() {
                continue;
            }
            let covariance = self.covariance(judged);
            for (i, name) in ["peak_friction", "critical_slip"].into_iter().enumerate() {
                let value = judged.model.base[i].exp();
                all.insert(
                    format!("{prefix}{name}"),
                    Estimate {
                        value: finite_or_zero(value),
                        std: finite_or_zero(value * covariance[(i, i)].max(0.0).sqrt()),
                    },
                );
            }
        }
        all
    }

    fn looked_for(&self) -> Vec<LookedFor> {
        Id::ALL
            .iter()
            .map(|id| LookedFor {
                id: id.as_str(),
                identifiable: match id.balance() {
                    Balance::Tyre => self.data.series.iter().any(|s| !s.tyre.is_empty()),
                    Balance::Wheel => self.data.series.iter().any(|s| s.torque.is_some()),
                    Balance::Vehicle => self.data.rig.coasting,
                },
                minimum_detectable: None,
            })
            .collect()
    }

    fn faults(&self) -> Vec<Fault> {
        self.data
            .faults
            .iter()
            .map(|f| Fault {
                recording: f.recording.clone(),
                channel: f.channel.clone(),
                start_s: finite_or_zero(f.start_s),
                end_s: finite_or_zero(f.end_s),
                what: f.what.clone(),
            })
            .collect()
    }

    fn caveats(&self) -> Vec<String> {
        let mut all = vec!["A wrong scale of slip or of the normal force, or a constant camber or surface, cannot be told from another peak friction or slip at the peak.".to_owned()];
        if !self.rig.coasting {
            all.push("The speed is held or driven: the vehicle balance says nothing.".to_owned());
        }
        if self.data.series.iter().all(|s| s.torque.is_none()) {
            all.push("No brake column: the wheel balance could not be formed.".to_owned());
        }
        all
    }

    fn fit(&self) -> Fit {
        let data = self.data;
        let score = |model: &Model, judged: &Judged, unseen: bool| {
            let (mut square, mut count) = (0.0, 0.0);
            for s in &data.series {
                let r = rows::<f64>(&data.catalogue, model, &model.vector(), s, &data.context);
                if r.tyre.is_empty() {
                    continue;
                }
                for k in s.tyre.iter().flat_map(Clone::clone) {
                    square += r.tyre[k] * r.tyre[k];
                    count += 1.0;
                }
            }
            let rows: usize = judged.grams.iter().flatten().map(|g| g.count).sum();
            let nll = if unseen {
                judged.unseen.iter().sum::<f64>()
            } else {
                judged.loss
            };
            Score {
                rmse_n: finite_or_zero((square / f64::max(count, 1.0)).sqrt()),
                nll_per_sample: finite_or_zero(nll / rows.max(1) as f64),
                whiteness_p: None,
            }
        };
        let of = |unseen| BeforeAfter {
            before: score(&self.decision.base.model, &self.decision.base, unseen),
            after: score(&self.decision.chosen.model, &self.decision.chosen, unseen),
        };
        Fit {
            fit: of(false),
            holdout: of(true),
        }
    }

    fn traces(&self) -> Vec<Trace> {
        let data = self.data;
        data.series
            .iter()
            .map(|s| {
                let of = |model: &Model| {
                    rows::<f64>(&data.catalogue, model, &model.vector(), s, &data.context).tyre
                };
                let (before, after) = (
                    of(&self.decision.base.model),
                    of(&self.decision.chosen.model),
                );
                let step = s.len().div_ceil(TRACE_POINTS).max(1);
                let usable: Vec<usize> = if before.is_empty() {
                    Vec::new()
                } else {
                    s.tyre.iter().flat_map(Clone::clone).step_by(step).collect()
                };
                Trace {
                    recording: s.name.clone(),
                    holdout: false,
                    time_s: usable.iter().map(|k| s.time[*k]).collect(),
                    slip: usable
                        .iter()
                        .map(|k| s.slip(*k, data.context.radius))
                        .collect(),
                    measured_n: usable.iter().map(|k| s.drag[*k]).collect(),
                    before_n: usable.iter().map(|k| s.drag[*k] - before[*k]).collect(),
                    after_n: usable.iter().map(|k| s.drag[*k] - after[*k]).collect(),
                }
            })
            .collect()
    }

    fn repaired(&self, plain: &[f64], better: bool) -> Repaired {
        let data = self.data;
        let chosen = &self.decision.chosen;
        let covariance = self.covariance(chosen);
        let split = |tyre: bool| {
            let mut model = Model {
                base: chosen.model.base.clone(),
                terms: Vec::new(),
            };
            for term in &chosen.model.terms {
                let stage = data.catalogue.get(term.entry).stage();
                let dynamic = matches!(stage, Stage::Wheel | Stage::Vehicle);
                if dynamic != tyre {
                    model.terms.push(term.clone());
                }
            }
            Repaired::terms(
                &data.catalogue,
                &data.context,
                &model,
                &vec![0.0; model.vector().len()],
            )
        };
        let mut domain = Domain::default();
        domain.ranges.insert(
            "vehicle_speed_m_s".to_owned(),
            [0.0, data.context.max_speed],
        );
        domain
            .ranges
            .insert("drag_force_n".to_owned(), [0.0, data.context.max_drag]);
        Repaired {
            schema: "muslip.model/1".to_owned(),
            averaged: 1,
            proof_by_blocks: false,
            rig: data.rig.clone(),
            late: if better {
                self.timing.late
            } else {
                crate::chain::correct::Lateness::default()
            },
            base_alone: plain.to_vec(),
            base: if better {
                self.predicting_base()
            } else {
                plain.to_vec()
            },
            tyre: if better { split(true) } else { Vec::new() },
            dynamics: split(false),
            corrections: if better {
                self.corrections()
            } else {
                Vec::new()
            },
            covariance: (0..covariance.nrows())
                .map(|i| covariance.row(i).iter().copied().collect())
                .collect(),
            dynamics_covariance: Vec::new(),
            noise: NoiseModel {
                sigma_n: finite_or_zero(self.fit().fit.after.rmse_n),
                share_of_force: 0.0,
                step_s: Some(finite_or_zero(data.context.dt)),
                channels: self
                    .noise()
                    .into_iter()
                    .map(|(n, c)| (n, c.sigma))
                    .collect(),
                likelihood: None,
            },
            domain,
            context: data.context.clone(),
            recordings: self
                .runs
                .iter()
                .map(|r| KnownRecording {
                    path: r.name.clone(),
                    first_time_s: finite_or_zero(r.time_s.first().copied().unwrap_or(0.0)),
                    samples: r.len(),
                    holdout: false,
                })
                .collect(),
        }
    }
}

/// How sure a name is: against the other finalists of its round, against none, and by what so many runs can show.
fn confidence(trial: &Trial, round: &[Trial], runs: usize) -> (f64, Vec<Alternative>) {
    let softness = SOFTNESS + SOFT_SHARE * trial.gain.max(0.0);
    let weight = |t: &Trial| ((t.gain - trial.gain) / softness).min(0.0).exp();
    let mut by_id: BTreeMap<Id, f64> = BTreeMap::new();
    let own = trial.mechanism().map(|m| m.0);
    let mut outside = 0.0f64;
    for other in round
        .iter()
        .filter(|t| stands(t) || t.mechanism().map(|m| m.0) == own)
    {
        match other.mechanism() {
            Some((id, _)) => {
                let w = by_id.entry(id).or_insert(0.0);
                *w = w.max(weight(other));
            }
            None => outside = outside.max(0.5 * weight(other)),
        }
    }
    let none = (-(trial.gain / softness)).exp();
    let total = by_id.values().sum::<f64>() + none + outside;
    let most = 1.0 - 0.5f64.powf(1.0 + 0.75 * runs as f64);
    let steady = 1.0 - (-0.8 * (trial.unseen.1 - 0.5)).exp();
    let own_share = own.and_then(|id| by_id.get(&id).copied()).unwrap_or(1.0) / total;
    let mut others: Vec<Alternative> = by_id
        .iter()
        .filter(|(id, _)| Some(**id) != own)
        .map(|(id, w)| Alternative {
            id: id.as_str(),
            confidence: w / total,
        })
        .filter(|a| a.confidence > 0.01)
        .collect();
    others.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    ((own_share * most * steady).clamp(0.01, 0.99), others)
}

/// A delay as a mechanism.
fn delay(id: Id, value: f64, std: f64, runs: usize) -> NamedMechanism {
    let z = value.abs() / std.max(1e-5);
    let (statement, equation) = match id {
        Id::ForceDelay => (
            format!("The drag channel reports {:.1} ms late.", 1e3 * value),
            "reading(t) = drag(t - delay)",
        ),
        Id::WheelSpeedDelay => (
            format!(
                "The wheel speed reports {:.1} ms late against drag, load and brake.",
                1e3 * value
            ),
            "wheel_speed_reading(t) = wheel_speed(t - delay)",
        ),
        _ => (
            format!(
                "The vehicle speed reports {:.1} ms late against drag, load and brake.",
                1e3 * value
            ),
            "vehicle_speed_reading(t) = vehicle_speed(t - delay)",
        ),
    };
    NamedMechanism {
        id: id.as_str(),
        balance: id.balance().as_str(),
        statement,
        equation: equation.to_owned(),
        parameters: vec![Figure {
            name: "delay".to_owned(),
            value,
            std,
            unit: "s".to_owned(),
        }],
        evidence: Evidence {
            delta_bic: z * z,
            holdout_nll_gain_per_sample: 1e-3,
            confidence: (1.0 - 0.5f64.powf(1.0 + 0.75 * runs as f64)).min(0.97),
        },
        confusable_with: Vec::new(),
        separating_test: String::new(),
        effect_sigma: 0.0,
    }
}

/// First letter large, full stop at the end.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => format!("{}{}.", first.to_uppercase(), letters.as_str()),
        None => String::new(),
    }
}

/// The law fitted to the channels as recorded by plain least squares.
fn plain_law(rig: &Rig, runs: &[Run]) -> Vec<f64> {
    let data = Data::new(rig, runs, crate::ablation::Ablation::default());
    let mut base = law_of(rig);
    let square = |base: &[f64]| -> (f64, f64) {
        // The best peak friction at this slip at the peak.
        let critical = base[1].exp();
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for s in &data.series {
            for k in s.tyre.iter().flat_map(Clone::clone) {
                if !s.rolling[k] {
                    continue;
                }
                let x = s.slip(k, rig.radius_m) / critical;
                let shape = s.load.smooth[k] * 2.0 * x / (1.0 + x * x);
                let y = s.drag[k];
                if shape.is_finite() && y.is_finite() {
                    xx += shape * shape;
                    xy += shape * y;
                    yy += y * y;
                }
            }
        }
        if xx > 0.0 {
            (yy - xy * xy / xx, xy / xx)
        } else {
            (yy, rig.peak_friction)
        }
    };
    let start = base[1];
    let mut best = (f64::INFINITY, start, rig.peak_friction);
    let mut width = 1.6;
    for _ in 0..5 {
        let centre = best.1;
        for i in -6..=6 {
            let at = centre + width * f64::from(i) / 6.0;
            let (value, peak) = square(&[0.0, at]);
            if value < best.0 && peak > 0.0 {
                best = (value, at, peak);
            }
        }
        width /= 4.0;
    }
    base[0] = best.2.ln();
    base[1] = best.1;
    base
}
