//! The filters of the core crate as a page of the host runs them: one run at a time, numbers in, numbers out.
//!
//! Compiled to WebAssembly by `cargo xtask what-if` and carried in every page of an estimate, so
//! that the reader's own assumptions go through the code that the rig runs. On other targets it is a plain
//! library, which the tests hold against `muslip estimate`.

#[cfg(target_arch = "wasm32")]
mod exports;

use muslip::filter::efficient::{self, EfficientFilter};
use muslip::filter::mu_slip::{Config, Covariance, Fusion, MuSlipFilter, Range, State};
use muslip::filter::{Decision, Estimator, FrictionMeasurement, PeakEstimate};

/// What a run starts from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// The efficient filter; else the article's.
    pub efficient: bool,
    /// Peak friction, > 0.
    pub peak_friction: f64,
    /// Critical slip, > 0; the efficient filter takes 1/64 to 2.
    pub critical_slip: f64,
    /// Standard deviation of the peak friction, > 0; the article's filter alone has one to start from.
    pub peak_friction_std: f64,
    /// Standard deviation of the critical slip, > 0; as above.
    pub critical_slip_std: f64,
    /// Whether the article's filter adds its second-order pseudonoise.
    pub pseudonoise: bool,
}

/// A filter's run.
#[derive(Debug, Clone)]
pub struct Run {
    filter: Filter,
    last: Option<Fusion<f64>>,
}

#[derive(Debug, Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "one of it in a page")]
enum Filter {
    Article(MuSlipFilter<f64>),
    Efficient(EfficientFilter<f64>),
}

/// Number of figures that [`Run::value`] knows.
pub const VALUES: u32 = 11;

impl Run {
    /// A run at its start; `None` where the filter does not take it.
    #[must_use]
    pub fn new(start: &Start) -> Option<Self> {
        let state = State {
            peak_friction: start.peak_friction,
            critical_slip: start.critical_slip,
        };
        let filter = if start.efficient {
            let config = efficient::Config {
                initial_state: state,
                ..efficient::Config::for_range(Range::default())
            };
            Filter::Efficient(config.build().ok()?)
        } else {
            let config = Config {
                initial_state: state,
                initial_covariance: Covariance::from_std(
                    start.peak_friction_std,
                    start.critical_slip_std,
                ),
                pseudonoise: start.pseudonoise,
                ..Config::for_range(Range::default())
            };
            Filter::Article(config.build().ok()?)
        };
        Some(Self { filter, last: None })
    }

    /// Corrects with one measurement; whether the filter used it. Otherwise it is what it was before.
    pub fn update(&mut self, slip_ratio: f64, friction: f64, friction_std: f64) -> bool {
        let measurement = FrictionMeasurement {
            slip_ratio,
            friction,
            friction_std,
        };
        let before = self.filter;
        let fusion = match &mut self.filter {
            Filter::Article(filter) => filter.update_reporting(&measurement).ok(),
            Filter::Efficient(filter) => filter.update_reporting(&measurement).ok(),
        };
        // A squared innovation that overflows makes no figure that is one.
        let sound = fusion.filter(|fusion| fusion.nis.is_finite());
        if sound.is_none() {
            self.filter = before;
        }
        match sound {
            Some(fusion) if fusion.decision == Decision::Accepted => {
                self.last = Some(fusion);
                true
            }
            _ => false,
        }
    }

    /// A figure by its number, in the order of the page's frames: peak friction and its standard deviation,
    /// critical slip and its, correlation; of the last measurement used: innovation and its standard
    /// deviation, normalised innovation squared, noise variance, signal before and after. NaN elsewhere.
    #[must_use]
    pub fn value(&self, index: u32) -> f64 {
        let peak = self.peak();
        let last = |of: fn(&Fusion<f64>) -> f64| self.last.as_ref().map_or(f64::NAN, of);
        match index {
            0 => peak.peak_friction,
            1 => peak.peak_friction_std,
            2 => peak.critical_slip,
            3 => peak.critical_slip_std,
            4 => peak.correlation,
            5 => last(|fusion| fusion.innovation),
            6 => last(|fusion| fusion.innovation_variance.sqrt()),
            7 => last(|fusion| fusion.nis),
            8 => last(|fusion| fusion.noise_variance),
            9 => last(|fusion| fusion.signal_before),
            10 => last(|fusion| fusion.signal_after),
            _ => f64::NAN,
        }
    }

    /// The estimate.
    #[must_use]
    pub fn peak(&self) -> PeakEstimate<f64> {
        match &self.filter {
            Filter::Article(filter) => filter.peak(),
            Filter::Efficient(filter) => filter.peak(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARTICLE: Start = Start {
        efficient: false,
        peak_friction: 0.6,
        critical_slip: 0.2,
        peak_friction_std: 0.6,
        critical_slip_std: 0.2,
        pseudonoise: true,
    };

    #[test]
    fn a_run_is_that_of_the_core_crate_bit_for_bit() {
        let mut run = Run::new(&ARTICLE).unwrap();
        let mut filter = Config::<f64>::for_range(Range::Aircraft).build().unwrap();
        for step in 1..40 {
            let slip_ratio = f64::from(step) / 40.0;
            let friction = 0.3 + 0.01 * f64::from(step % 7);
            assert!(run.update(slip_ratio, friction, 0.04));
            let fusion = filter
                .update_reporting(&FrictionMeasurement {
                    slip_ratio,
                    friction,
                    friction_std: 0.04,
                })
                .unwrap();
            assert_eq!(run.peak(), filter.peak());
            assert_eq!(run.value(5), fusion.innovation);
            assert_eq!(run.value(7), fusion.nis);
        }
    }

    #[test]
    fn assumptions_change_the_estimate() {
        let others = [
            Start {
                pseudonoise: false,
                ..ARTICLE
            },
            Start {
                peak_friction: 1.0,
                ..ARTICLE
            },
            Start {
                efficient: true,
                ..ARTICLE
            },
        ];
        let ended = |start: &Start| {
            let mut run = Run::new(start).unwrap();
            for step in 1..20 {
                run.update(f64::from(step) / 40.0, 0.35, 0.04);
            }
            run.peak()
        };
        for other in &others {
            assert_ne!(ended(other), ended(&ARTICLE));
        }
    }

    #[test]
    fn what_is_no_start_and_no_measurement_is_refused_and_changes_nothing() {
        for peak_friction in [0.0, -1.0, f64::NAN] {
            assert!(
                Run::new(&Start {
                    peak_friction,
                    ..ARTICLE
                })
                .is_none()
            );
        }
        let mut run = Run::new(&ARTICLE).unwrap();
        let before = run.peak();
        assert!(!run.update(f64::NAN, 0.3, 0.04));
        assert!(!run.update(0.1, 1e308, 1e-300));
        assert_eq!(run.peak(), before);
        assert!(run.value(VALUES).is_nan());
    }
}
