//! The three balances of one run as rows, nothing differentiated: the tyre's as a force, the wheel's and the
//! vehicle's in level (integrated) form.
//!
//! tyre e = reading − model of the reading, in N; wheel z = J ω − ∫(R F − T − opposing) dt, in N m s; vehicle
//! z = m v + ∫(F + opposing) dt, in N s; F is the reading less what the model says that the load cell adds to the
//! force in the contact. A constant of z means nothing: the whitening takes each stretch's level as unknown.

use crate::data::{Catalogue, Data, Listed};
use crate::mechanism::{Balance, Context, Stage, State};
use crate::model::{Model, tyre};
use crate::series::Series;

/// Rows of one run by balance, in the order tyre, wheel, vehicle.
pub type Triple = [Vec<f64>; 3];

/// Residuals of the three balances on one run, one value a sample; empty where the balance cannot be formed.
pub struct Rows<T> {
    /// In N.
    pub tyre: Vec<T>,
    /// In N m s.
    pub wheel: Vec<T>,
    /// In N s.
    pub vehicle: Vec<T>,
}

impl<T> Rows<T> {
    /// Those of one balance.
    #[must_use]
    pub fn of(&self, balance: Balance) -> &[T] {
        match balance {
            Balance::Tyre => &self.tyre,
            Balance::Wheel => &self.wheel,
            Balance::Vehicle => &self.vehicle,
        }
    }
}

/// Rows of a model at its own parameters on one run of a campaign.
#[must_use]
pub fn rows_of(data: &Data, model: &Model, run: usize) -> Rows<f64> {
    let p = model.vector();
    rows(&data.catalogue, model, &p, &data.series[run], &data.context)
}

/// The force by a law where there is one, else the reading less its noise, in N.
#[must_use]
pub fn quiet_force(series: &Series, law: &[f64]) -> Vec<f64> {
    (0..series.len())
        .map(|k| match law.get(k) {
            Some(f) if series.rolling[k] && f.is_finite() && !series.tyre.is_empty() => *f,
            _ => series.drag_smooth[k],
        })
        .collect()
}

/// Rows of a model. Terms act on every balance that they touch.
pub fn rows<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
) -> Rows<T> {
    let n = series.len();
    let zero = T::constant(0.0);
    let state = tyre(catalogue, model, p, series, context);
    let chain: Option<Vec<T>> = state
        .contact
        .as_ref()
        .map(|contact| (0..n).map(|k| state.force[k] - contact[k]).collect());
    let of_chain = |k: usize| chain.as_ref().map_or(zero, |c| c[k]);
    let by_law: Vec<f64> = state.force.iter().map(|f| f.value()).collect();
    let wanted = |stage: Stage| {
        let mut state = State::empty();
        state.opposing = vec![zero; n];
        if let Some(torque) = &series.torque {
            state.brake = torque.smooth.iter().map(|t| T::constant(*t)).collect();
        }
        let mut at = model.base.len();
        for term in &model.terms {
            let own = &p[at..at + term.parameters.len()];
            at += term.parameters.len();
            let mechanism = T::entry(catalogue, term.entry);
            if mechanism.acts_at(stage) {
                mechanism.apply(own, series, context, &mut state);
            }
        }
        state
    };
    // Deviations from the base are made of what does not hold the residual's own noise, or a parameter could buy
    // noise by scaling it: the drag's by the model's reading, the speeds' by their slow part.
    let quiet = quiet_force(series, &by_law);
    let force = |gain: T, k: usize| {
        (T::constant(1.0) / (gain + 1.0) - 1.0) * (-of_chain(k) + quiet[k])
            + (-of_chain(k) + series.drag[k])
    };
    let integral = |rate: &dyn Fn(usize) -> T, level: &dyn Fn(usize) -> T| -> Vec<T> {
        let mut sum = zero;
        let mut before = zero;
        (0..n)
            .map(|k| {
                let now = rate(k);
                let now = if now.value().is_finite() { now } else { before };
                if k > 0 {
                    sum += (now + before) * (0.5 * series.dt[k].min(10.0 * series.typical_dt));
                }
                before = now;
                level(k) + sum
            })
            .collect()
    };
    let wheel = match (&series.torque, series.wheel_balance.is_empty()) {
        (Some(torque), false) => {
            let wheel = wanted(Stage::Wheel);
            let rolling = state.rolling_moment.as_ref();
            integral(
                &|k| {
                    let brake = wheel.brake[k] + (torque.raw[k] - torque.smooth[k]);
                    let rolling = rolling.map_or(zero, |r| r[k]);
                    brake + wheel.opposing[k] + rolling
                        - force(wheel.gain_change, k) * context.radius
                },
                &|k| {
                    // What the reading is off by, an encoder's ripple, is off in the level as well.
                    let beyond = state.read_off.as_ref().map_or(zero, |off| off[k]);
                    let off = state.omega[k] - series.wheel.smooth[k] + beyond;
                    let off = if off.value().is_finite() { off } else { zero };
                    wheel.inertia_change * (context.inertia * series.wheel.slow[k])
                        + (off + series.wheel.raw[k]) * context.inertia
                },
            )
        }
        _ => Vec::new(),
    };
    let vehicle = if series.vehicle_balance.is_empty() {
        Vec::new()
    } else {
        let vehicle = wanted(Stage::Vehicle);
        // A mass in error scales what slows it: by the model's force, for the speed's own errors are in the level.
        let lighter = T::constant(1.0) / (vehicle.inertia_change + 1.0) - 1.0;
        integral(
            &|k| {
                let slowing = -of_chain(k) + quiet[k] + vehicle.opposing[k];
                force(vehicle.gain_change, k) + vehicle.opposing[k] + lighter * slowing
            },
            &|k| T::constant(context.mass * series.speed.raw[k]),
        )
    };
    let mut tyre = state.force;
    if series.tyre.is_empty() {
        tyre.clear();
    }
    for (f, y) in tyre.iter_mut().zip(&series.drag) {
        *f = -*f + *y;
    }
    Rows {
        tyre,
        wheel,
        vehicle,
    }
}
