//! Slip, friction and the two-state filter, sample by sample.

use muslip::filter::mu_slip::{Config, ConfigError, MuSlipFilter, Range};
use muslip::filter::{Estimator, FrictionMeasurement};
use muslip::sample::{RigSample, SampleLimits, SlipFriction, slip_friction};
use muslip_record::{Estimate, Parameters, TyreRange};

/// The estimate and what it is made with.
#[derive(Debug, Clone, Copy)]
pub struct Estimation {
    filter: MuSlipFilter<f32>,
    limits: SampleLimits<f32>,
    effective_radius_m: f32,
    friction_std: f32,
    slip_minimum: f32,
    slip_maximum: f32,
    point: Option<SlipFriction<f32>>,
    updates: u32,
    failed: bool,
}

impl Estimation {
    /// At the filter's start.
    ///
    /// # Errors
    /// [`ConfigError`] where checked parameters still make no filter: a noise beyond single precision.
    pub fn new(parameters: &Parameters) -> Result<Self, ConfigError> {
        let estimator = &parameters.estimator;
        let range = match estimator.tyre_range {
            TyreRange::Aircraft => Range::Aircraft,
            TyreRange::Automotive => Range::Automotive,
        };
        let config = Config {
            noise_inflation: estimator.noise_inflation,
            ..Config::for_range(range)
        };
        Ok(Self {
            filter: config.build()?,
            limits: SampleLimits::new(parameters.limits.minimum_normal_force_n),
            effective_radius_m: parameters.wheel.effective_radius_m,
            friction_std: estimator.friction_std,
            slip_minimum: estimator.skid_slip_minimum,
            slip_maximum: estimator.skid_slip_maximum,
            point: None,
            updates: 0,
            failed: false,
        })
    }

    /// Back to the filter's start, for a new run.
    pub fn reset(&mut self) {
        self.filter.reset();
        self.updates = 0;
        self.failed = false;
    }

    /// True once the filter has refused an update, until the next reset.
    pub fn failed(&self) -> bool {
        self.failed
    }

    /// Says that another estimator has failed: a fault like its own.
    pub fn fail(&mut self) {
        self.failed = true;
    }

    /// Slip and friction of the sample, none where it is no measurement.
    pub fn observe(&mut self, sample: &RigSample<f32>) -> Option<SlipFriction<f32>> {
        self.point = slip_friction(sample, self.effective_radius_m, &self.limits).ok();
        self.point
    }

    /// Gives the sample observed last to the filter, where its slip is in the skid range.
    pub fn update(&mut self) {
        let Some(point) = self.point else { return };
        if point.slip_ratio < self.slip_minimum || point.slip_ratio > self.slip_maximum {
            return;
        }
        let measurement = FrictionMeasurement {
            slip_ratio: point.slip_ratio,
            friction: point.friction,
            friction_std: self.friction_std,
        };
        match self.filter.update(&measurement) {
            Ok(_) => self.updates = self.updates.saturating_add(1),
            Err(_) => self.failed = true,
        }
    }

    /// As it is sent.
    pub fn report(&self, tick: u32) -> Estimate {
        let (state, covariance) = (self.filter.state(), self.filter.covariance());
        Estimate {
            tick,
            slip_ratio: self.point.map_or(f32::NAN, |point| point.slip_ratio),
            friction: self.point.map_or(f32::NAN, |point| point.friction),
            peak_friction: state.peak_friction,
            critical_slip: state.critical_slip,
            p00: covariance.p00,
            p01: covariance.p01,
            p11: covariance.p11,
            updates: self.updates,
        }
    }
}
