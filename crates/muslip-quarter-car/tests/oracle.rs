//! The quarter-car filter against dense matrices, automatic derivatives and a literal transcription of the
//! tutorial's code.
#![expect(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip_laws::Burckhardt;
use muslip_laws::burckhardt::{DRY_ASPHALT, SNOW, WET_ASPHALT};
use muslip_quarter_car::filter::{
    Channel, Config, Covariance, Estimate, Filter, Measurement, Motion, Road, State, Vehicle,
    law_of_bracketed_coefficients,
};
use nalgebra::{SMatrix, SVector};
use num_dual::{DualNum, DualSVec64, jacobian};
use test_support::{Noise, Tolerance};

type Matrix = SMatrix<f64, 5, 5>;
type Vector = SVector<f64, 5>;

const VEHICLE: Vehicle<f64> = Vehicle {
    radius_m: 0.31,
    inertia_kg_m2: 1.2,
    gravity_m_s2: 9.81,
};
const TS: f64 = 0.005;

fn filter(road: Road<f64>) -> Filter<f64> {
    let mut config = Config::tuned(VEHICLE, road, 20.0);
    config.nis_gate = None;
    config.keeps_slip_positive = false;
    config.build().unwrap()
}

fn random_state(noise: &mut Noise) -> State<f64> {
    let v = noise.log_uniform(0.6, 40.0);
    State {
        wheel_speed_rad_s: noise.uniform(0.0, 1.02) * v / VEHICLE.radius_m,
        vehicle_speed_m_s: v,
        slip_ratio: noise.uniform(-0.2, 1.0),
        friction: noise.uniform(-0.2, 1.3),
        mass_kg: noise.uniform(250.0, 700.0),
    }
}

/// A covariance of full rank, each state in its own unit.
fn random_covariance(noise: &mut Noise) -> Matrix {
    let scales = Vector::new(0.5, 0.5, 0.05, 0.1, 40.0);
    let root = Matrix::from_fn(|row, _| scales[row] * noise.normal(0.5));
    root * root.transpose()
}

fn covariance_of(matrix: &Matrix) -> Covariance<f64> {
    Covariance::from_rows(std::array::from_fn(|i| {
        std::array::from_fn(|j| matrix[(i, j)])
    }))
}

/// The model written again for dual numbers.
fn model<D: DualNum<Primitive = f64> + Copy>(
    x: &[D; 5],
    torque: f64,
    law: Option<(f64, f64, f64)>,
) -> [D; 5] {
    let [omega, v, lambda, mu, m] = *x;
    let (r, j, g) = (0.31, 1.2, 9.81);
    let friction = match law {
        // Odd in slip, as the published law is continued.
        Some((c1, c2, c3)) if lambda.re() < 0.0 => {
            -((-((lambda * c2).exp()) + 1.0) * c1 + lambda * c3)
        }
        Some((c1, c2, c3)) => (-((-lambda * c2).exp()) + 1.0) * c1 - lambda * c3,
        None => mu,
    };
    [
        omega + (mu * m * (r * g) - torque) * (TS / j),
        v - mu * (TS * g),
        (v - omega * r) / v,
        friction,
        m,
    ]
}

#[test]
fn model_and_jacobian_are_those_of_automatic_derivatives() {
    let tight = Tolerance {
        absolute: 1e-12,
        relative: 1e-12,
    };
    let mut noise = Noise::seeded(41);
    for round in 0..2000 {
        let (road, law) = match round % 3 {
            0 => (Road::Unknown, None),
            1 => (
                Road::Known(DRY_ASPHALT.law()),
                Some(DRY_ASPHALT.coefficients()),
            ),
            _ => (Road::Known(SNOW.law()), Some(SNOW.coefficients())),
        };
        let filter = filter(road);
        let state = random_state(&mut noise);
        let torque = noise.uniform(0.0, 3000.0);
        let predicted = filter.transition(&state, torque);
        if predicted.wheel_speed_rad_s <= 0.0 {
            continue;
        }
        let (value, derivative) = jacobian(
            |x: SVector<DualSVec64<5>, 5>| {
                SVector::from(model(&[x[0], x[1], x[2], x[3], x[4]], torque, law))
            },
            &SVector::from(state.to_array()),
        );
        let ours = filter.transition_jacobian(&state, torque);
        for i in 0..5 {
            tight.check("state", predicted.to_array()[i], value[i]);
            for j in 0..5 {
                tight.check("F", ours[i][j], derivative[(i, j)]);
            }
        }
    }
}

#[test]
fn the_sparse_prediction_is_the_dense_one() {
    let mut noise = Noise::seeded(42);
    let mut seen = [0; 3];
    for round in 0..3000 {
        let road = if round % 2 == 0 {
            Road::Known(WET_ASPHALT.law())
        } else {
            Road::Unknown
        };
        let mut filter = filter(road);
        let mut state = random_state(&mut noise);
        match round % 5 {
            0 => state.vehicle_speed_m_s = noise.uniform(0.0, 0.49),
            1 => state.wheel_speed_rad_s = noise.uniform(-0.5, 0.5),
            _ => {}
        }
        let torque = noise.uniform(0.0, 3000.0);
        let before = random_covariance(&mut noise);
        let estimate = Estimate {
            state,
            covariance: covariance_of(&before),
        };
        filter.restore(estimate).unwrap();
        let f = Matrix::from(filter.transition_jacobian(&state, torque)).transpose();
        let motion = filter.predict(torque).unwrap();
        seen[motion as usize] += 1;
        let mut q = Vector::from(filter.config().process_std.variances());
        if motion == Motion::Standstill {
            q[0] += (0.5 / VEHICLE.radius_m).powi(2);
        }
        let dense = f * before * f.transpose() + Matrix::from_diagonal(&q);
        let ours = filter.estimate().covariance.rows();
        for i in 0..5 {
            for j in 0..5 {
                // Rounding is relative to the terms before they cancel: the standard deviations' product
                // bounds the result, not always the terms, hence the margin of 1e4 roundings.
                let scale = (dense[(i, i)] * dense[(j, j)]).sqrt();
                Tolerance::absolute(1e-11 * scale.max(1e-9)).check("P", ours[i][j], dense[(i, j)]);
            }
        }
        assert_eq!(ours, std::array::from_fn(|i| ours.map(|row| row[i])));
    }
    assert!(seen.iter().all(|count| *count > 100), "{seen:?}");
}

#[test]
fn every_channel_corrects_as_dense_matrices_do() {
    let mut noise = Noise::seeded(43);
    for round in 0..2000 {
        let mut filter = filter(Road::Unknown);
        let state = random_state(&mut noise);
        let before = random_covariance(&mut noise);
        filter
            .restore(Estimate {
                state,
                covariance: covariance_of(&before),
            })
            .unwrap();
        let (mu, m, g) = (state.friction, state.mass_kg, 9.81);
        let (channel, h, predicted, sigma) = match round % 4 {
            0 => (
                Channel::WheelSpeed,
                [1.0, 0.0, 0.0, 0.0, 0.0],
                state.wheel_speed_rad_s,
                0.1,
            ),
            1 => (
                Channel::VehicleSpeed,
                [0.0, 1.0, 0.0, 0.0, 0.0],
                state.vehicle_speed_m_s,
                0.02,
            ),
            2 => (
                Channel::DragForce,
                [0.0, 0.0, 0.0, m * g, mu * g],
                mu * m * g,
                90.0,
            ),
            _ => (Channel::NormalForce, [0.0, 0.0, 0.0, 0.0, g], m * g, 20.0),
        };
        let h = Vector::from(h);
        let value = predicted + noise.normal(2.0 * sigma);
        let fusion = filter
            .update(&Measurement {
                channel,
                value,
                variance: sigma * sigma,
            })
            .unwrap();
        let s = (h.transpose() * before * h)[0] + sigma * sigma;
        let k = before * h / s;
        let x = Vector::from(state.to_array()) + k * (value - predicted);
        let joseph = Matrix::identity() - k * h.transpose();
        let p = joseph * before * joseph.transpose() + k * sigma * sigma * k.transpose();
        let close = Tolerance::relative(1e-9);
        close.check("innovation variance", fusion.innovation_variance, s);
        close.check("NIS", fusion.nis, (value - predicted).powi(2) / s);
        let after = filter.estimate();
        for i in 0..5 {
            if i != 1 || x[1] > 0.0 {
                Tolerance {
                    absolute: 1e-9,
                    relative: 1e-10,
                }
                .check("state", after.state.to_array()[i], x[i]);
            }
            for j in 0..5 {
                let scale = (before[(i, i)] * before[(j, j)]).sqrt();
                Tolerance::absolute(1e-11 * scale).check(
                    "P",
                    after.covariance.rows()[i][j],
                    p[(i, j)],
                );
            }
        }
    }
}

/// The tutorial's function as its text has it, signs restored, bracket and all.
struct Tutorial {
    x: Vector,
    p: Matrix,
    bracket: (f64, f64, f64),
}

impl Tutorial {
    fn step(&mut self, measured: f64, torque: f64) {
        let (r, j, g) = (0.31, 1.2, 9.81);
        let (c1, c2, c3) = self.bracket;
        let [omega, v, lambda, mu, m] = std::array::from_fn(|i| self.x[i]);
        let x = Vector::new(
            omega + TS / j * (r * g * mu * m - omega.signum() * torque),
            v - TS * g * mu,
            (v - r * omega) / v,
            c1 * (1.0 - (-c2 * lambda).exp() - c3 * lambda),
            m,
        );
        let mut f = Matrix::zeros();
        f[(0, 0)] = 1.0;
        f[(0, 3)] = TS * r * g * m / j;
        f[(0, 4)] = TS * r * g * mu / j;
        f[(1, 1)] = 1.0;
        f[(1, 3)] = -TS * g;
        f[(2, 0)] = -r / v;
        f[(2, 1)] = r * omega / (v * v);
        f[(3, 2)] = c1 * (c2 * (-c2 * lambda).exp() - c3);
        f[(4, 4)] = 1.0;
        let q = Matrix::from_diagonal(&Vector::new(1e-4, 1e-4, 1.0, 1.0, 1e-6));
        let p = f * self.p * f.transpose() + q;
        let s = p[(0, 0)] + 0.005 / TS;
        let k = p.column(0) / s;
        self.x = x + k * (measured - x[0]);
        self.p = p - k * p.row(0);
    }
}

#[test]
fn the_tutorial_s_code_gives_the_same_course() {
    let bracket = (1.2801, 23.99, 0.4);
    let law = law_of_bracketed_coefficients(bracket.0, bracket.1, bracket.2).unwrap();
    let mut ours = Config::tutorial(VEHICLE, law, 30.0).build().unwrap();
    let mut theirs = Tutorial {
        x: Vector::new(30.0 / 0.31, 30.0, 0.0, 0.0, 450.0),
        p: Matrix::zeros(),
        bracket,
    };
    let mut noise = Noise::seeded(44);
    let mut compared = 0;
    for step in 0..450 {
        let t = f64::from(step) * TS;
        // A wheel that slips into some 0.14 and slows; the odd law is not met at negative slip.
        let v = 30.0 - 10.0 * t;
        let slip = 0.14 * (1.0 - (-t / 0.1).exp()) + 0.02;
        let measured = v * (1.0 - slip) / 0.31 + noise.normal(0.1);
        let torque = 1400.0 * (1.0 - (-t / 0.05).exp());
        ours.predict(torque).unwrap();
        theirs.step(measured, torque);
        ours.update(&Measurement {
            channel: Channel::WheelSpeed,
            value: measured,
            variance: Config::<f64>::tutorial_variance(),
        })
        .unwrap();
        if theirs.x[2] < 0.0 {
            // The published law is odd in slip, the tutorial's runs on below zero: put right, go on.
            theirs.x = SVector::from(ours.estimate().state.to_array());
            theirs.p = SMatrix::from(ours.estimate().covariance.rows());
            continue;
        }
        compared += 1;
        for i in 0..5 {
            Tolerance {
                absolute: 1e-7,
                relative: 1e-7,
            }
            .check("state", ours.estimate().state.to_array()[i], theirs.x[i]);
        }
    }
    assert!(compared > 400, "{compared}");
}

#[test]
fn the_bracket_s_linear_term_is_c1_times_c3() {
    let law = law_of_bracketed_coefficients(1.2801, 23.99, 0.52 / 1.2801).unwrap();
    let published = DRY_ASPHALT.law::<f64>();
    let (c1, c2, c3) = law.coefficients();
    let (d1, d2, d3) = published.coefficients();
    assert_eq!((c1, c2), (d1, d2));
    Tolerance::relative(1e-15).check("c3", c3, d3);
    assert!(law_of_bracketed_coefficients(1.0, 2.0, f64::NAN).is_err());
    assert!(Burckhardt::new(1.0, 2.0, 3.0).is_err());
}

#[test]
fn single_precision_follows_double_through_a_stop() {
    let single = Vehicle {
        radius_m: 0.31_f32,
        inertia_kg_m2: 1.2,
        gravity_m_s2: 9.81,
    };
    let mut narrow = Config::tuned(single, Road::Known(WET_ASPHALT.law()), 20.0)
        .build()
        .unwrap();
    let mut wide = Config::tuned(VEHICLE, Road::Known(WET_ASPHALT.law()), 20.0)
        .build()
        .unwrap();
    let mut noise = Noise::seeded(45);
    for step in 0..480 {
        let t = f64::from(step) * TS;
        let v = 20.0 - 7.8 * t;
        let slip = 0.1 * (1.0 - (-t / 0.05).exp());
        let measured = (v * (1.0 - slip) / 0.31 + noise.normal(0.1)) as f32;
        let torque = (1000.0 * (1.0 - (-t / 0.03).exp())) as f32;
        narrow.predict(torque).unwrap();
        wide.predict(f64::from(torque)).unwrap();
        let channel = Channel::WheelSpeed;
        narrow
            .update(&Measurement {
                channel,
                value: measured,
                variance: 0.01,
            })
            .unwrap();
        wide.update(&Measurement {
            channel,
            value: f64::from(measured),
            variance: 0.01,
        })
        .unwrap();
        let (a, b) = (narrow.estimate().state, wide.estimate().state);
        let near = |what, got: f32, expected, absolute| {
            Tolerance::absolute(absolute).check(what, f64::from(got), expected)
        };
        near("ω", a.wheel_speed_rad_s, b.wheel_speed_rad_s, 2e-2);
        near("v", a.vehicle_speed_m_s, b.vehicle_speed_m_s, 2e-2);
        near("m", a.mass_kg, b.mass_kg, 0.5);
    }
}
