//! Slip, friction and the estimate of the peak, sample by sample.
//!
//! As `muslip estimate` does it: the efficient estimator, on samples compensated by a diagnosed model where the
//! parameters hold one; the article's filter where that model has a low-pass filter on the force. What the state
//! machine and the interlocks look at is never compensated.

use muslip::filter::efficient::{self, EfficientFilter};
use muslip::filter::mu_slip::{self, Covariance, MuSlipFilter, Range, State};
use muslip::filter::{Decision, Estimator as _, FrictionMeasurement};
use muslip::law::Expansion;
use muslip::sample::{RigSample, SampleLimits, SlipFriction, slip_friction};
use muslip_compensate::{Compensated, StepError};
use muslip_record::{Estimate, Estimating, Estimator, Parameters, TyreRange};

use crate::compensation::{self, RigCompensator};
use crate::rates::Rates;

/// Checked parameters that still make no estimator: a noise beyond single precision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unestimable;

/// The estimate and what it is made with.
#[derive(Debug, Clone, Copy)]
pub struct Estimation {
    filter: Filter,
    compensator: RigCompensator,
    settings: Settings,
    sample_s: f32,
    measured: Option<Measured>,
    updates: u32,
    failed: bool,
}

/// What of the parameters each sample needs.
#[derive(Debug, Clone, Copy)]
struct Settings {
    limits: SampleLimits<f32>,
    effective_radius_m: f32,
    friction_std: f32,
    slip_minimum: f32,
    slip_maximum: f32,
    compensated: u8,
}

impl Settings {
    fn of(parameters: &Parameters) -> Self {
        let estimator = &parameters.estimator;
        Self {
            limits: SampleLimits::new(parameters.limits.minimum_normal_force_n),
            effective_radius_m: parameters.wheel.effective_radius_m,
            friction_std: estimator.friction_std,
            slip_minimum: estimator.skid_slip_minimum,
            slip_maximum: estimator.skid_slip_maximum,
            compensated: compensation::compensated(&parameters.compensation),
        }
    }
}

#[derive(Debug, Clone, Copy)]
#[expect(
    clippy::large_enum_variant,
    reason = "one of it, and no heap to box it in"
)]
enum Filter {
    Efficient(EfficientFilter<f32>),
    Article(MuSlipFilter<f32>),
}

/// A sample as the estimator takes it.
#[derive(Debug, Clone, Copy)]
struct Measured {
    measurement: FrictionMeasurement<f32>,
    /// What the reading is expected to be; none where it reads the law at its slip.
    expected: Option<Expansion<f32>>,
}

impl Filter {
    fn new(parameters: &Parameters) -> Result<Self, Unestimable> {
        let estimator = &parameters.estimator;
        let range = match estimator.tyre_range {
            TyreRange::Aircraft => Range::Aircraft,
            TyreRange::Automotive => Range::Automotive,
        };
        if compensation::filters_force(&parameters.compensation) {
            let config = mu_slip::Config {
                noise_inflation: estimator.noise_inflation,
                ..mu_slip::Config::for_range(range)
            };
            config.build().map(Self::Article).map_err(|_| Unestimable)
        } else {
            let config = efficient::Config::for_range(range);
            config.build().map(Self::Efficient).map_err(|_| Unestimable)
        }
    }

    fn estimator(&self) -> Estimator {
        match self {
            Self::Efficient(_) => Estimator::Efficient,
            Self::Article(_) => Estimator::Article,
        }
    }

    fn reset(&mut self) {
        match self {
            Self::Efficient(filter) => filter.reset(),
            Self::Article(filter) => filter.reset(),
        }
    }

    fn state(&self) -> State<f32> {
        match self {
            Self::Efficient(filter) => filter.state(),
            Self::Article(filter) => filter.state(),
        }
    }

    fn covariance(&self) -> Covariance<f32> {
        match self {
            Self::Efficient(filter) => filter.covariance(),
            Self::Article(filter) => filter.covariance(),
        }
    }

    fn update(&mut self, measured: &Measured) -> Result<Decision, mu_slip::UpdateError> {
        match (self, measured.expected) {
            // Without a low-pass filter on the force a compensated reading is the law at its slip.
            (Self::Efficient(filter), _) => filter.update(&measured.measurement),
            (Self::Article(filter), None) => filter.update(&measured.measurement),
            (Self::Article(filter), Some(expected)) => filter
                .update_expecting(&measured.measurement, expected)
                .map(|fusion| fusion.decision),
        }
    }
}

impl Estimation {
    /// At the estimator's start.
    ///
    /// # Errors
    /// [`Unestimable`] where checked parameters still make no estimator.
    pub fn new(parameters: &Parameters, rates: Rates) -> Result<Self, Unestimable> {
        let sample_s = rates.sample_s();
        let settings = Settings::of(parameters);
        let (radius_m, limits) = (settings.effective_radius_m, settings.limits);
        Ok(Self {
            filter: Filter::new(parameters)?,
            compensator: compensation::effects(&parameters.compensation, sample_s)
                .build(radius_m, limits)
                .map_err(|_| Unestimable)?,
            settings,
            sample_s,
            measured: None,
            updates: 0,
            failed: false,
        })
    }

    /// At the start of an estimator with other parameters. In place: it is large, and copies are dear.
    ///
    /// # Errors
    /// As [`Estimation::new`], which checked parameters do not meet; part of them may have been taken then.
    pub fn take(&mut self, parameters: &Parameters) -> Result<(), Unestimable> {
        self.filter = Filter::new(parameters)?;
        self.settings = Settings::of(parameters);
        self.measured = None;
        self.updates = 0;
        self.failed = false;
        let effects = compensation::effects(&parameters.compensation, self.sample_s);
        self.compensator
            .replace(
                &effects,
                self.settings.effective_radius_m,
                self.settings.limits,
            )
            .map_err(|_| Unestimable)
    }

    /// Back to the estimator's start, for a new run. What is compensated goes on: the tread is as warm as it was.
    pub fn reset(&mut self) {
        self.filter.reset();
        self.updates = 0;
        self.failed = false;
    }

    /// True once the estimator has refused an update, until the next reset.
    pub fn failed(&self) -> bool {
        self.failed
    }

    /// Says that another estimator has failed: a fault like its own.
    pub fn fail(&mut self) {
        self.failed = true;
    }

    /// What estimates.
    pub fn estimating(&self) -> Estimating {
        Estimating {
            estimator: self.filter.estimator(),
            compensated: self.settings.compensated,
        }
    }

    /// Takes the next sample, every one: hidden states of the compensation live on time. Its slip and friction as they
    /// are read, none where it is no measurement.
    pub fn observe(&mut self, sample: &RigSample<f32>) -> Option<SlipFriction<f32>> {
        let settings = &self.settings;
        let point = slip_friction(sample, settings.effective_radius_m, &settings.limits).ok();
        self.measured = if settings.compensated == 0 {
            point.map(|point| Measured {
                measurement: FrictionMeasurement {
                    slip_ratio: point.slip_ratio,
                    friction: point.friction,
                    friction_std: settings.friction_std,
                },
                expected: None,
            })
        } else {
            let state = self.filter.state();
            match self.compensator.step(sample, self.sample_s, &state) {
                Ok(Compensated::Measurement(measured)) => Some(Measured {
                    measurement: measured.measurement(settings.friction_std),
                    expected: Some(measured.expected),
                }),
                Ok(Compensated::Nothing(_)) => None,
                Err(StepError::State) => {
                    self.failed = true;
                    None
                }
                // The sample cannot be compensated; the compensator is what it was.
                Err(_) => None,
            }
        };
        point
    }

    /// Gives the sample observed last to the estimator, where its slip is in the skid range.
    pub fn update(&mut self) {
        let Some(measured) = self.measured else {
            return;
        };
        let slip = measured.measurement.slip_ratio;
        if slip < self.settings.slip_minimum || slip > self.settings.slip_maximum {
            return;
        }
        match self.filter.update(&measured) {
            Ok(Decision::Accepted) => self.updates = self.updates.saturating_add(1),
            Ok(Decision::Rejected) => {}
            Err(_) => self.failed = true,
        }
    }

    /// As it is sent.
    pub fn report(&self, tick: u32) -> Estimate {
        let (state, covariance) = (self.filter.state(), self.filter.covariance());
        let measurement = self.measured.map(|measured| measured.measurement);
        Estimate {
            tick,
            slip_ratio: measurement.map_or(f32::NAN, |measurement| measurement.slip_ratio),
            friction: measurement.map_or(f32::NAN, |measurement| measurement.friction),
            peak_friction: state.peak_friction,
            critical_slip: state.critical_slip,
            p00: covariance.p00,
            p01: covariance.p01,
            p11: covariance.p11,
            updates: self.updates,
            estimating: self.estimating(),
        }
    }
}
