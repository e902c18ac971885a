//! Exact discrete updates of the hidden states: first- and second-order, with the input taken as a
//! straight line between samples.

use crate::number::Number;

/// First-order response y' = (u − y)/τ to an input that is a straight line between samples.
/// `step_over_tau(k)` is Δt/τ of the step that ends at sample k. Starts settled on the first input.
pub fn first_order<T: Number>(input: &mut [T], step_over_tau: impl Fn(usize) -> T) {
    let Some(first) = input.first().copied() else {
        return;
    };
    let (mut y, mut before) = (first, first);
    let zero = T::constant(0.0);
    let mut cached = (T::constant(f64::NAN), zero, zero);
    for (k, u) in input.iter_mut().enumerate().skip(1) {
        let a = step_over_tau(k);
        if a != cached.0 {
            let (stay, share) = coefficients(a);
            cached = (a, stay, share);
        }
        let (_, stay, share) = cached;
        let now = *u;
        y = y * stay + before * (-stay + 1.0) + (now - before) * share;
        before = now;
        *u = y;
    }
}

/// e^{−a} and 1 − (1 − e^{−a})/a, with the series where a is small and the limits where it is large.
fn coefficients<T: Number>(a: T) -> (T, T) {
    let stay = (-a).exp();
    let share = if a.value() < 1e-3 {
        a * 0.5 - a.squared() / 6.0
    } else {
        -((-stay + 1.0) / a) + 1.0
    };
    (stay, share)
}

/// Second-order response y'' + 2ζΩ y' + Ω² y = Ω² u, exact for an input that is a straight line between
/// samples. Starts settled on the first input.
pub fn second_order<T: Number>(input: &mut [T], dt: &[f64], frequency_hz: T, damping: T) {
    let Some(first) = input.first().copied() else {
        return;
    };
    let omega = frequency_hz * core::f64::consts::TAU;
    let decay = omega * damping;
    let ringing = omega * (-(damping.squared()) + 1.0).sqrt();
    // How far the response trails a ramp, per unit of slope.
    let trail = damping * 2.0 / omega;
    let mut y = first;
    let mut velocity = T::constant(0.0);
    let mut before = first;
    let mut step = f64::NAN;
    let mut m = [T::constant(0.0); 4];
    for (k, u) in input.iter_mut().enumerate().skip(1) {
        if (dt[k] - step).abs() > 1e-7 * step.abs() || step.is_nan() {
            step = dt[k];
            let e = (-(decay * step)).exp();
            let (sin, cos) = (ringing * step).sin_cos();
            let s = sin / ringing;
            m = [
                e * (cos + decay * s),
                e * s,
                -(e * omega.squared() * s),
                e * (cos - decay * s),
            ];
        }
        let now = *u;
        let slope = (now - before) / step;
        let deviation = y - before + trail * slope;
        let relative = velocity - slope;
        y = m[0] * deviation + m[1] * relative + now - trail * slope;
        velocity = m[2] * deviation + m[3] * relative + slope;
        before = now;
        *u = y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_order_follows_a_ramp_exactly() {
        // y' = (u − y)/τ with u = t: y = t − τ + τ e^{−t/τ}.
        let (tau, dt) = (0.05, 0.01);
        let mut u: Vec<f64> = (0..100).map(|k| f64::from(k) * dt).collect();
        let t = u.clone();
        first_order(&mut u, |_| dt / tau);
        for (y, t) in u.iter().zip(t) {
            assert!((y - (t - tau + tau * (-t / tau).exp())).abs() < 1e-12);
        }
    }

    #[test]
    fn second_order_rings_at_its_frequency() {
        let dt = vec![0.001; 2000];
        let mut u: Vec<f64> = (0..2000).map(|k| if k < 10 { 0.0 } else { 1.0 }).collect();
        second_order(&mut u, &dt, 20.0, 0.05);
        // First overshoot of a step: 1 + exp(−πζ/√(1−ζ²)), half a period after it.
        let (at, peak) = u
            .iter()
            .enumerate()
            .fold((0, 0.0), |b, (k, &y)| if y > b.1 { (k, y) } else { b });
        let expected = 1.0 + (-core::f64::consts::PI * 0.05 / (1.0f64 - 0.0025).sqrt()).exp();
        assert!((peak - expected).abs() < 0.01, "{peak} {expected}");
        assert!((at as i32 - 35).abs() <= 1, "{at}");
    }
}
