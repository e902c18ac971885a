//! The candidates; exactly one feature chooses one.

pub use chosen::{Memory, answer, start, update};

/// (3 · 0.04)²
#[allow(dead_code)]
const INFLATED: f32 = 0.0144;

#[cfg(feature = "article")]
mod chosen {
    use muslip::filter::mu_slip::{Covariance, Range, State};

    pub struct Memory {
        state: State<f32>,
        covariance: Covariance<f32>,
    }

    pub fn start() -> Memory {
        Memory {
            state: Range::Aircraft.initial_state(),
            covariance: Range::Aircraft.initial_covariance(),
        }
    }

    #[inline(never)]
    #[unsafe(no_mangle)]
    pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
        (memory.state, memory.covariance) = muslip::filter::mu_slip::update_unchecked(
            memory.state,
            memory.covariance,
            slip,
            friction,
            super::INFLATED,
        );
    }

    pub fn answer(memory: &Memory) -> [f32; 2] {
        [memory.state.peak_friction, memory.state.critical_slip]
    }
}

#[cfg(feature = "article_report")]
mod chosen {
    use muslip::filter::mu_slip::{Config, Fusion, MuSlipFilter, UpdateError};
    use muslip::filter::{Estimator, FrictionMeasurement};

    pub struct Memory {
        filter: MuSlipFilter<f32>,
        last: Option<Result<Fusion<f32>, UpdateError>>,
    }

    pub fn start() -> Memory {
        Memory {
            filter: Config::default().build().ok().unwrap(),
            last: None,
        }
    }

    #[inline(never)]
    #[unsafe(no_mangle)]
    pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
        memory.last = Some(memory.filter.update(&FrictionMeasurement {
            slip_ratio: slip,
            friction,
            friction_std: 0.04,
        }));
    }

    pub fn answer(memory: &Memory) -> [f32; 2] {
        core::hint::black_box(&memory.last);
        let state = memory.filter.state();
        [state.peak_friction, state.critical_slip]
    }
}

#[cfg(feature = "efficient")]
mod chosen {
    use muslip::filter::efficient::{self, Config, EfficientFilter};

    pub type Memory = EfficientFilter<f32>;

    pub fn start() -> Memory {
        Config::default().build().ok().unwrap()
    }

    #[inline(never)]
    #[unsafe(no_mangle)]
    pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
        efficient::update(memory, slip, friction, 0.0016);
    }

    pub fn answer(memory: &Memory) -> [f32; 2] {
        let state = memory.state();
        [state.peak_friction, state.critical_slip]
    }
}

#[cfg(feature = "slip_friction")]
mod chosen {
    use muslip::sample::{RigSample, SampleError, SampleLimits, SlipFriction, slip_friction};

    pub struct Memory {
        limits: SampleLimits<f32>,
        last: Option<Result<SlipFriction<f32>, SampleError>>,
    }

    pub fn start() -> Memory {
        Memory {
            limits: SampleLimits::for_median_normal_force(4000.0),
            last: None,
        }
    }

    #[inline(never)]
    #[unsafe(no_mangle)]
    pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
        // The raw channels of a wheel that has this much to do with the point.
        let sample = RigSample {
            wheel_speed_rad_s: 60.0 - slip,
            vehicle_speed_m_s: 20.0,
            drag_force_n: friction,
            normal_force_n: 4000.0,
        };
        memory.last = Some(slip_friction(&sample, 0.31, &memory.limits));
    }

    pub fn answer(memory: &Memory) -> [f32; 2] {
        match memory.last {
            Some(Ok(point)) => [point.friction, point.slip_ratio],
            _ => [0.0, 0.0],
        }
    }
}

#[cfg(feature = "nalgebra")]
mod chosen {
    use nalgebra::{Matrix2, RowVector2, Vector2};

    /// The article's filter in matrix notation, the same model function.
    pub struct Memory {
        x: Vector2<f32>,
        p: Matrix2<f32>,
    }

    pub fn start() -> Memory {
        Memory {
            x: Vector2::new(0.6, 0.2),
            p: Matrix2::new(0.36, 0.0, 0.0, 0.04),
        }
    }

    #[inline(never)]
    #[unsafe(no_mangle)]
    pub fn update(memory: &mut Memory, s: f32, z: f32) {
        let (mup, sp) = (memory.x[0], memory.x[1]);
        let (s2, sp2) = (s * s, sp * sp);
        let w = 1.0 / (sp2 + s2);
        let h0 = 2.0 * s * sp * w;
        let mu = mup * h0;
        let by_both = 2.0 * s * (s2 - sp2) * w * w;
        let h = RowVector2::new(h0, mup * by_both);
        let second = mu * (sp2 - 3.0 * s2) * w * w;
        let pd = memory.p[(1, 1)];
        let r =
            super::INFLATED + pd * (by_both * by_both * memory.p[(0, 0)] + second * second * pd);
        let pht = memory.p * h.transpose();
        let k = pht / ((h * pht)[0] + r);
        memory.x += k * (z - mu);
        memory.p = (Matrix2::identity() - k * h) * memory.p;
    }

    pub fn answer(memory: &Memory) -> [f32; 2] {
        [memory.x[0], memory.x[1]]
    }
}
