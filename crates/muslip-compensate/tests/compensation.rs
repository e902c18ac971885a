//! What every compensation keeps to: nothing for null figures, nothing on errors, no NaN, single precision.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failed step fails the test"
)]

use muslip::filter::mu_slip::{Config, Covariance, Input, MuSlipFilter, Range, State, UpdateError};
use muslip::filter::{Estimator, FrictionMeasurement};
use muslip::law::Expansion;
use muslip::real::Real;
use muslip::sample::{Channel, RigSample, SampleError, SampleLimits, slip_friction};
use muslip_compensate::{
    Compensated, CompensatedMeasurement, Compensation, CompensationError, Compensator,
    EffectiveRadius, ForceDelay, ForceLag, LoadCrosstalk, LoadSensitivity, NoMeasurement,
    Parameter, Relaxation, SpeedSensitivity, StepError, ThermalFade, ZeroDrift,
};
use proptest::prelude::*;
use test_support::{Noise, Tolerance};

const RADIUS_M: f64 = 0.31;
const LOAD_N: f64 = 4000.0;
const STEP_S: f64 = 0.002;

fn real<T: Real>(value: f64) -> T {
    T::from_f64(value)
}

fn limits<T: Real>() -> SampleLimits<T> {
    SampleLimits::for_median_normal_force(real(LOAD_N))
}

/// A braked run: slip up and down, speed falling, load swinging; readings with noise.
fn run(seed: u64, samples: u32) -> Vec<RigSample<f64>> {
    let mut noise = Noise::seeded(seed);
    (0..samples)
        .map(|k| {
            let t = STEP_S * f64::from(k);
            let slip = 0.4 * (3.0 * t).sin().powi(2);
            let v = 30.0 - 2.0 * t;
            let load = LOAD_N * (1.0 + 0.2 * (7.0 * t).sin());
            let r = slip / 0.14;
            RigSample {
                wheel_speed_rad_s: v * (1.0 - slip) / RADIUS_M + noise.normal(0.05),
                vehicle_speed_m_s: v,
                drag_force_n: load * 2.0 * 0.8 * r / (1.0 + r * r) + noise.normal(90.0),
                normal_force_n: load + noise.normal(20.0),
            }
        })
        .collect()
}

fn converted<T: Real>(sample: &RigSample<f64>) -> RigSample<T> {
    RigSample {
        wheel_speed_rad_s: real(sample.wheel_speed_rad_s),
        vehicle_speed_m_s: real(sample.vehicle_speed_m_s),
        drag_force_n: real(sample.drag_force_n),
        normal_force_n: real(sample.normal_force_n),
    }
}

fn filter<T: Real>() -> MuSlipFilter<T> {
    Config::for_range(Range::Automotive).build().unwrap()
}

/// A filter that knows its tyre roughly: the readings here do not hold the effects that are compensated,
/// and from far away it would follow them out of the law's range.
fn settled_filter<T: Real>() -> MuSlipFilter<T> {
    Config {
        initial_state: State {
            peak_friction: real(0.8),
            critical_slip: real(0.14),
        },
        initial_covariance: Covariance::from_std(real(0.1), real(0.03)),
        ..Config::default()
    }
    .build()
    .unwrap()
}

/// Every effect at work, in forms that a choice selects among.
fn everything<T: Real>(choice: usize) -> Compensation<T> {
    let radius = [
        EffectiveRadius::Constant {
            relative_error: real(0.02),
        },
        EffectiveRadius::WithLoad {
            relative_error: real(0.01),
            per_relative_load: real(-0.03),
            mean_normal_force_n: real(LOAD_N),
        },
        EffectiveRadius::WithSpeed {
            relative_error: real(-0.01),
            per_relative_speed_squared: real(0.02),
            mean_vehicle_speed_m_s: real(25.0),
        },
    ];
    let speed = [
        SpeedSensitivity::SlidingLinear {
            per_m_s: real(-0.02),
        },
        SpeedSensitivity::SlidingExponential {
            per_m_s: real(-0.02),
        },
        SpeedSensitivity::VehicleLinear {
            per_m_s: real(-0.01),
            mean_vehicle_speed_m_s: real(25.0),
        },
        SpeedSensitivity::VehicleExponential {
            per_m_s: real(-0.01),
            mean_vehicle_speed_m_s: real(25.0),
        },
        SpeedSensitivity::SlidingWithFloor {
            floor: real(0.7),
            speed_scale_m_s: real(3.0),
        },
    ];
    let relaxation = [
        Relaxation::Slip {
            length_m: real(0.3),
        },
        Relaxation::Force {
            length_m: real(0.3),
        },
    ];
    let drift = [
        ZeroDrift::Linear {
            slope_n_s: real(12.0),
            offset_n: real(30.0),
            start_s: real(1.0),
        },
        ZeroDrift::WarmUp {
            rise_n: real(150.0),
            time_constant_s: real(2.0),
            start_s: real(0.5),
        },
    ];
    Compensation {
        effective_radius: Some(radius[choice % 3]),
        force_delay: Some(ForceDelay {
            delay_s: real(0.0133),
            sampling_step_s: real(STEP_S),
        }),
        force_lag: Some(ForceLag {
            time_constant_s: real(0.012),
        }),
        zero_drift: Some(drift[choice % 2]),
        load_crosstalk: Some(LoadCrosstalk { share: real(0.03) }),
        load_sensitivity: Some(LoadSensitivity {
            sensitivity: real(0.25),
            critical_slip_exponent: real(0.1),
            mean_normal_force_n: real(LOAD_N),
        }),
        speed_sensitivity: Some(speed[choice % 5]),
        relaxation: Some(relaxation[choice % 2]),
        thermal_fade: Some(ThermalFade {
            sensitivity_per_s: real(0.3),
            curvature_per_s2: real(0.05),
            time_constant_s: real(1.5),
            reference_power_w: real(2e4),
        }),
        longest_step_s: Some(real(0.05)),
    }
}

/// Every effect with figures at which it vanishes.
fn vanishing<T: Real>(choice: usize) -> Compensation<T> {
    let zero = real(0.0);
    let radius = [
        EffectiveRadius::Constant {
            relative_error: zero,
        },
        EffectiveRadius::WithLoad {
            relative_error: zero,
            per_relative_load: zero,
            mean_normal_force_n: real(LOAD_N),
        },
        EffectiveRadius::WithSpeed {
            relative_error: zero,
            per_relative_speed_squared: zero,
            mean_vehicle_speed_m_s: real(25.0),
        },
    ];
    let speed = [
        SpeedSensitivity::SlidingLinear { per_m_s: zero },
        SpeedSensitivity::SlidingExponential { per_m_s: zero },
        SpeedSensitivity::VehicleLinear {
            per_m_s: zero,
            mean_vehicle_speed_m_s: real(25.0),
        },
        SpeedSensitivity::VehicleExponential {
            per_m_s: zero,
            mean_vehicle_speed_m_s: real(25.0),
        },
        SpeedSensitivity::SlidingWithFloor {
            floor: real(1.0),
            speed_scale_m_s: real(3.0),
        },
    ];
    let relaxation = [
        Relaxation::Slip { length_m: zero },
        Relaxation::Force { length_m: zero },
    ];
    let drift = [
        ZeroDrift::Linear {
            slope_n_s: zero,
            offset_n: zero,
            start_s: real(1.0),
        },
        ZeroDrift::WarmUp {
            rise_n: zero,
            time_constant_s: real(2.0),
            start_s: zero,
        },
    ];
    Compensation {
        effective_radius: Some(radius[choice % 3]),
        force_delay: Some(ForceDelay {
            delay_s: zero,
            sampling_step_s: real(STEP_S),
        }),
        force_lag: Some(ForceLag {
            time_constant_s: zero,
        }),
        zero_drift: Some(drift[choice % 2]),
        load_crosstalk: Some(LoadCrosstalk { share: zero }),
        load_sensitivity: Some(LoadSensitivity {
            sensitivity: zero,
            critical_slip_exponent: zero,
            mean_normal_force_n: real(LOAD_N),
        }),
        speed_sensitivity: Some(speed[choice % 5]),
        relaxation: Some(relaxation[choice % 2]),
        thermal_fade: Some(ThermalFade {
            sensitivity_per_s: zero,
            curvature_per_s2: zero,
            time_constant_s: real(1.5),
            reference_power_w: real(2e4),
        }),
        longest_step_s: None,
    }
}

fn built<T: Real, const N: usize>(compensation: Compensation<T>) -> Compensator<T, N> {
    compensation.build(real(RADIUS_M), limits()).unwrap()
}

fn measured<T: Real>(outcome: Compensated<T>) -> CompensatedMeasurement<T> {
    match outcome {
        Compensated::Measurement(measurement) => measurement,
        Compensated::Nothing(why) => panic!("no measurement: {why:?}"),
    }
}

fn null_is_exact<T: Real>() {
    for choice in 0..30 {
        for compensation in [vanishing(choice), Compensation::none()] {
            let mut compensator = built::<T, 0>(compensation);
            let (mut with, mut without) = (filter::<T>(), filter::<T>());
            for sample in run(choice as u64, 400) {
                let sample = converted::<T>(&sample);
                let std = real::<T>(0.02);
                let outcome = compensator
                    .step(&sample, real(STEP_S), &with.state())
                    .unwrap();
                match (outcome, slip_friction(&sample, real(RADIUS_M), &limits())) {
                    (Compensated::Measurement(m), Ok(point)) => {
                        let got = with
                            .update_expecting(&m.measurement(std), m.expected)
                            .unwrap();
                        let expected = without
                            .update_reporting(&FrictionMeasurement {
                                slip_ratio: point.slip_ratio,
                                friction: point.friction,
                                friction_std: std,
                            })
                            .unwrap();
                        assert_eq!(got, expected);
                        assert_eq!(with.estimate(), without.estimate());
                    }
                    (Compensated::Nothing(NoMeasurement::Sample(why)), Err(error)) => {
                        assert_eq!(why, error);
                    }
                    (got, expected) => panic!("{got:?} where {expected:?}"),
                }
            }
        }
    }
}

#[test]
fn null_figures_give_exactly_the_uncompensated_update() {
    null_is_exact::<f64>();
    null_is_exact::<f32>();
}

/// A compensator in the middle of a run.
fn under_way(choice: usize) -> Compensator<f64, 16> {
    let mut compensator = built(everything(choice));
    let state = filter().state();
    for sample in run(9, 300) {
        compensator.step(&sample, STEP_S, &state).unwrap();
    }
    compensator
}

#[test]
fn a_refused_step_leaves_the_compensator_as_it_was() {
    let good = run(1, 1)[0];
    let state = filter::<f64>().state();
    for choice in 0..6 {
        let before = under_way(choice);
        let refused = |sample: &RigSample<f64>, dt: f64, state: &State<f64>| {
            let mut compensator = before;
            let error = compensator.step(sample, dt, state).unwrap_err();
            assert_eq!(compensator, before, "{error}");
            error
        };
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for (change, channel) in [
                (
                    (|s: &mut RigSample<f64>, bad| s.wheel_speed_rad_s = bad)
                        as fn(&mut RigSample<f64>, f64),
                    Channel::WheelSpeed,
                ),
                (|s, bad| s.vehicle_speed_m_s = bad, Channel::VehicleSpeed),
                (|s, bad| s.drag_force_n = bad, Channel::DragForce),
                (|s, bad| s.normal_force_n = bad, Channel::NormalForce),
            ] {
                let mut sample = good;
                change(&mut sample, bad);
                assert_eq!(
                    refused(&sample, STEP_S, &state),
                    StepError::NonFinite { channel }
                );
            }
            assert_eq!(refused(&good, bad, &state), StepError::TimeStep);
            let broken = State {
                critical_slip: bad,
                ..state
            };
            assert_eq!(refused(&good, STEP_S, &broken), StepError::State);
        }
        for dt in [0.0, -STEP_S] {
            assert_eq!(refused(&good, dt, &state), StepError::TimeStep);
        }
    }
    // 1e308 N times the law's second derivative, which is -25 at slip 0.2.
    let mut compensator = built::<f64, 0>(Compensation {
        force_delay: None,
        load_sensitivity: None,
        relaxation: None,
        ..everything(0)
    });
    compensator.step(&good, STEP_S, &state).unwrap();
    let before = compensator;
    let absurd = RigSample {
        wheel_speed_rad_s: 0.8 * good.wheel_speed_rad_s,
        normal_force_n: 1e308,
        ..good
    };
    let refused = compensator.step(&absurd, STEP_S, &state);
    assert_eq!(refused, Err(StepError::Overflow));
    assert_eq!(compensator, before);
}

#[test]
fn samples_too_close_for_the_delay_line_are_refused_and_later_ones_taken() {
    let mut compensator = under_way(0);
    let (sample, state) = (run(1, 1)[0], filter().state());
    let mut taken = 0;
    let error = loop {
        let before = compensator;
        match compensator.step(&sample, 1e-5, &state) {
            Ok(_) => taken += 1,
            Err(error) => {
                assert_eq!(compensator, before);
                break error;
            }
        }
        assert!(taken < 20);
    };
    assert_eq!(error, StepError::DelayDoesNotFit);
    assert!(compensator.step(&sample, 0.01, &state).is_ok());
}

#[test]
fn a_standstill_a_light_wheel_and_slip_out_of_range_are_no_measurement_but_are_taken() {
    let state = filter::<f64>().state();
    let good = run(1, 1)[0];
    for (sample, why) in [
        (
            RigSample {
                vehicle_speed_m_s: 0.0,
                wheel_speed_rad_s: 0.0,
                ..good
            },
            SampleError::LowSpeed,
        ),
        (
            RigSample {
                normal_force_n: 10.0,
                ..good
            },
            SampleError::LowNormalForce,
        ),
        (
            RigSample {
                wheel_speed_rad_s: 1.2 * good.wheel_speed_rad_s,
                ..good
            },
            SampleError::SlipOutOfRange,
        ),
    ] {
        let mut compensator = built::<f64, 0>(Compensation {
            force_delay: None,
            ..everything(1)
        });
        compensator.step(&good, STEP_S, &state).unwrap();
        let before = compensator;
        assert_eq!(
            compensator.step(&sample, STEP_S, &state).unwrap(),
            Compensated::Nothing(NoMeasurement::Sample(why))
        );
        assert_ne!(compensator, before);
    }
}

#[test]
fn a_gap_starts_line_and_filters_anew() {
    let state = filter::<f64>().state();
    let samples = run(4, 60);
    let mut late = under_way(1);
    let mut fresh = built::<f64, 16>(Compensation {
        thermal_fade: None,
        zero_drift: None,
        ..everything(1)
    });
    let mut after = built::<f64, 16>(*fresh.compensation());
    for sample in run(9, 300) {
        after.step(&sample, STEP_S, &state).unwrap();
    }
    let mut compared = 0;
    for (k, sample) in samples.iter().enumerate() {
        let dt = if k == 0 { 0.5 } else { STEP_S };
        let got = after.step(sample, dt, &state).unwrap();
        assert_eq!(got, fresh.step(sample, dt, &state).unwrap());
        let with_heat = late.step(sample, dt, &state).unwrap();
        if k * 2 < 13 {
            let filling = Compensated::Nothing(NoMeasurement::DelayLineFilling);
            assert_eq!(got, filling);
            assert_eq!(with_heat, filling);
        } else {
            compared += 1;
            // The tread stays warm over the gap.
            assert!(measured(with_heat).friction_factor < measured(got).friction_factor);
        }
    }
    assert_eq!(compared, 53);
}

/// Numbers of every size, most of them ones that a rig could read.
fn any_number() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => -50.0_f32..100.0,
        3 => -1e4_f32..1e4,
        1 => any::<f32>(),
        1 => Just(0.0),
    ]
}

proptest! {
    #[test]
    fn nothing_that_comes_out_is_nan_or_infinite(
        choice in 0_usize..30,
        scale in -40.0_f64..40.0,
        inputs in proptest::collection::vec(
            (any_number(), any_number(), any_number(), any_number(), prop_oneof![5 => 1e-3_f32..0.02, 1 => any_number()]),
            1..60,
        ),
    ) {
        // The figures of the thermal state are those without bounds.
        let mut compensation = everything::<f32>(choice);
        if let Some(thermal) = &mut compensation.thermal_fade {
            thermal.sensitivity_per_s = (scale.exp() * scale.signum()) as f32;
            thermal.curvature_per_s2 = (scale * 1e3) as f32;
        }
        let mut compensator = built::<f32, 12>(compensation);
        let mut filter = filter::<f32>();
        for (omega, v, drag, load, dt) in inputs {
            let sample = RigSample {
                wheel_speed_rad_s: omega,
                vehicle_speed_m_s: v,
                drag_force_n: drag,
                normal_force_n: load,
            };
            let before = compensator;
            match compensator.step(&sample, dt, &filter.state()) {
                Ok(Compensated::Measurement(m)) => {
                    prop_assert!(m.slip_ratio.is_finite() && m.friction.is_finite());
                    prop_assert!(m.friction_factor.is_finite() && m.friction_factor >= 0.02);
                    prop_assert!(m.expected.is_finite() && m.normal_force_n > 0.0);
                    // The filter may refuse, and then stays as it was.
                    let _ = filter.update_expecting(&m.measurement(0.02), m.expected);
                    prop_assert!(filter.state().is_finite());
                }
                Ok(Compensated::Nothing(_)) => {}
                Err(_) => prop_assert!(compensator == before, "changed by a refused step"),
            }
        }
    }
}

#[test]
fn single_precision_stays_close_to_double() {
    // Relative to the numbers' own size; the noise of friction is 0.02.
    let close = Tolerance {
        absolute: 2e-4,
        relative: 2e-4,
    };
    for choice in 0..30 {
        let (mut c32, mut c64) = (
            built::<f32, 16>(everything(choice)),
            built::<f64, 16>(everything(choice)),
        );
        let (mut f32s, mut f64s) = (settled_filter::<f32>(), settled_filter::<f64>());
        let mut measurements = 0;
        for sample in run(choice as u64, 3000) {
            let single = c32
                .step(&converted(&sample), STEP_S as f32, &f32s.state())
                .unwrap();
            let double = c64.step(&sample, STEP_S, &f64s.state()).unwrap();
            if let (Compensated::Measurement(a), Compensated::Measurement(b)) = (single, double) {
                measurements += 1;
                close.check("slip", a.slip_ratio.into(), b.slip_ratio);
                close.check("friction", a.friction.into(), b.friction);
                close.check("expected", a.expected.friction.into(), b.expected.friction);
                f32s.update_expecting(&a.measurement(0.02), a.expected)
                    .unwrap();
                f64s.update_expecting(&b.measurement(0.02), b.expected)
                    .unwrap();
            }
        }
        assert!(measurements > 2500);
        let (a, b) = (f32s.peak(), f64s.peak());
        let share = (f64::from(a.peak_friction) - b.peak_friction).abs() / b.peak_friction_std;
        assert!(share < 0.02, "{choice}: {share}");
        let share = (f64::from(a.critical_slip) - b.critical_slip).abs() / b.critical_slip_std;
        assert!(share < 0.02, "{choice}: {share}");
    }
}

#[test]
fn a_drift_of_an_hour_is_known_to_a_thousandth_in_single_precision() {
    let mut compensator = built::<f32, 0>(Compensation {
        zero_drift: Some(ZeroDrift::Linear {
            slope_n_s: 1.0,
            offset_n: 0.0,
            start_s: 0.0,
        }),
        ..Compensation::none()
    });
    let state = filter::<f32>().state();
    let sample = converted::<f32>(&run(1, 50)[49]);
    let mut last = 0.0;
    for _ in 0..=3_600_000 {
        last = measured(compensator.step(&sample, 0.001, &state).unwrap()).friction;
    }
    let zero = sample.drag_force_n - last * sample.normal_force_n;
    Tolerance::relative(1e-3).check("zero", zero.into(), 3600.0);
}

#[test]
fn derivatives_behind_the_filters_are_those_of_the_expected_reading() {
    for choice in 0..2 {
        let at = |mup: f64, sp: f64| {
            let mut compensator = built::<f64, 16>(everything(choice));
            let state = State {
                peak_friction: mup,
                critical_slip: sp,
            };
            let mut last = None;
            for sample in run(2, 200) {
                last = Some(compensator.step(&sample, STEP_S, &state).unwrap());
            }
            measured(last.unwrap()).expected
        };
        let (mup, sp, d) = (0.8, 0.14, 1e-4);
        let here = at(mup, sp);
        let (up, down) = (at(mup + d, sp), at(mup - d, sp));
        let (right, left) = (at(mup, sp + d), at(mup, sp - d));
        let close = Tolerance::relative(1e-5);
        let check = |what: &str, found: f64, more: f64, less: f64| {
            close.check(what, found, (more - less) / (2.0 * d));
        };
        check("by mup", here.by_peak_friction, up.friction, down.friction);
        check(
            "by sp",
            here.by_critical_slip,
            right.friction,
            left.friction,
        );
        check(
            "by both",
            here.by_both,
            right.by_peak_friction,
            left.by_peak_friction,
        );
        check(
            "by sp twice",
            here.by_critical_slip_twice,
            right.by_critical_slip,
            left.by_critical_slip,
        );
    }
}

#[test]
fn behind_a_lag_the_expectation_follows_the_state_at_once() {
    // The estimate moves on the last sample only: what the filter remembers of earlier ones must count
    // with the new state, to first order.
    let mut moving = built::<f64, 0>(Compensation {
        force_lag: Some(ForceLag {
            time_constant_s: 0.05,
        }),
        ..Compensation::none()
    });
    let mut settled = moving;
    let old = State {
        peak_friction: 0.8,
        critical_slip: 0.14,
    };
    let new = State {
        peak_friction: 0.81,
        critical_slip: 0.141,
    };
    let samples = run(3, 120);
    let (mut a, mut b) = (None, None);
    for (k, sample) in samples.iter().enumerate() {
        let state = if k + 1 == samples.len() { new } else { old };
        a = Some(moving.step(sample, STEP_S, &state).unwrap());
        b = Some(settled.step(sample, STEP_S, &new).unwrap());
    }
    let (a, b) = (measured(a.unwrap()).expected, measured(b.unwrap()).expected);
    let moved = (0.01 * b.by_peak_friction + 0.001 * b.by_critical_slip).abs();
    assert!(moved > 2e-3);
    assert!((a.friction - b.friction).abs() < 0.02 * moved);
}

#[test]
fn expecting_the_law_is_the_reporting_update_and_bad_expectations_are_named() {
    let mut noise = Noise::seeded(5);
    for _ in 0..1000 {
        let state = State {
            peak_friction: noise.uniform(0.1, 1.2) as f32,
            critical_slip: noise.uniform(0.05, 0.4) as f32,
        };
        let slip = noise.uniform(-0.05, 1.05) as f32;
        let friction = noise.uniform(-0.2, 1.4) as f32;
        let law = state.law().unwrap().expansion(slip);
        let measurement = FrictionMeasurement {
            slip_ratio: slip,
            friction,
            friction_std: 0.04,
        };
        let mut filter = Config {
            initial_state: state,
            ..Config::for_range(Range::Automotive)
        }
        .build()
        .unwrap();
        let before = filter;
        let (mut expecting, mut reporting) = (filter, filter);
        assert_eq!(
            expecting.update_expecting(&measurement, law),
            reporting.update_reporting(&measurement)
        );
        assert_eq!(expecting, reporting);
        for change in [
            |e: &mut Expansion<f32>| e.friction = f32::NAN,
            |e: &mut Expansion<f32>| e.by_peak_friction = f32::INFINITY,
            |e: &mut Expansion<f32>| e.by_critical_slip = f32::NAN,
            |e: &mut Expansion<f32>| e.by_both = f32::NAN,
            |e: &mut Expansion<f32>| e.by_critical_slip_twice = f32::NEG_INFINITY,
        ] {
            let mut broken = law;
            change(&mut broken);
            let refused = filter.update_expecting(&measurement, broken);
            assert_eq!(
                refused.unwrap_err(),
                UpdateError::NonFinite(Input::Expected)
            );
            assert_eq!(filter, before);
        }
    }
}

#[test]
fn a_figure_outside_its_range_is_named() {
    fn refused(change: fn(&mut Compensation<f64>)) -> CompensationError {
        let mut compensation = everything(0);
        change(&mut compensation);
        compensation
            .build::<16>(RADIUS_M, limits())
            .map(|_| ())
            .unwrap_err()
    }
    let out = CompensationError::OutOfRange;
    type Change = fn(&mut Compensation<f64>);
    let cases: [(Change, Parameter); 10] = [
        (
            |c| {
                c.effective_radius = Some(EffectiveRadius::Constant {
                    relative_error: 0.6,
                });
            },
            Parameter::EffectiveRadius,
        ),
        (
            |c| c.force_delay.as_mut().unwrap().delay_s = -1e-3,
            Parameter::Delay,
        ),
        (
            |c| c.force_delay.as_mut().unwrap().sampling_step_s = 0.0,
            Parameter::SamplingStep,
        ),
        (
            |c| {
                c.force_lag = Some(ForceLag {
                    time_constant_s: f64::NAN,
                });
            },
            Parameter::LagTimeConstant,
        ),
        (
            |c| {
                c.zero_drift = Some(ZeroDrift::WarmUp {
                    rise_n: 1.0,
                    time_constant_s: 0.0,
                    start_s: 0.0,
                });
            },
            Parameter::ZeroDrift,
        ),
        (
            |c| c.load_crosstalk = Some(LoadCrosstalk { share: 1.5 }),
            Parameter::CrosstalkShare,
        ),
        (
            |c| c.load_sensitivity.as_mut().unwrap().mean_normal_force_n = 0.0,
            Parameter::LoadSensitivity,
        ),
        (
            |c| {
                c.relaxation = Some(Relaxation::Slip {
                    length_m: f64::INFINITY,
                });
            },
            Parameter::RelaxationLength,
        ),
        (
            |c| c.thermal_fade.as_mut().unwrap().reference_power_w = -1.0,
            Parameter::ThermalFade,
        ),
        (
            |c| c.longest_step_s = Some(f64::NAN),
            Parameter::LongestStep,
        ),
    ];
    for (change, figure) in cases {
        assert_eq!(refused(change), out(figure));
    }
    let radius = everything::<f64>(0).build::<16>(0.0, limits());
    assert_eq!(radius.unwrap_err(), out(Parameter::DeclaredRadius));
}

#[test]
fn a_delay_that_does_not_fit_is_refused_at_the_start() {
    // 13.3 ms at 2 ms: seven steps back, eight samples.
    let compensation = everything::<f32>(0);
    assert!(compensation.build::<8>(0.31, limits()).is_ok());
    assert_eq!(
        compensation.build::<7>(0.31, limits()).map(|_| ()),
        Err(CompensationError::DelayDoesNotFit { capacity: 7 })
    );
    assert!(compensation.build::<0>(0.31, limits()).is_err());
}
