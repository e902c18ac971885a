//! What repeats with the wheel's angle, in its speed as read and as smoothed.

use core::f64::consts::PI;

/// Largest share that is believed to be smoothed away: beyond it the line in the reading is all noise.
const MOST_TAKEN: f64 = 0.75;
/// Halvings of the interval that the smoothing is looked for in.
const HALVINGS: usize = 50;

/// By exp(-c f^2) a smoother makes what has the angular frequency f smaller: c in s^2, from what repeats once a turn of
/// the wheel, be it a ripple or noise.
#[must_use]
pub fn smoothing(angle: &[f64], raw: &[f64], smooth: &[f64], rolling: &[bool]) -> f64 {
    let trend = mean_of_a_turn(angle, raw);
    let used: Vec<usize> = (0..angle.len())
        .filter(|k| rolling[*k] && (raw[*k] + smooth[*k] + trend[*k]).is_finite())
        .collect();
    let line = |values: &[f64]| {
        let (mut cosine, mut sine) = (0.0, 0.0);
        for &k in &used {
            let (s, c) = angle[k].sin_cos();
            cosine += c * (values[k] - trend[k]);
            sine += s * (values[k] - trend[k]);
        }
        (cosine, sine)
    };
    let (read, left) = (line(raw), line(smooth));
    let share = (read.0 * left.0 + read.1 * left.1) / (read.0 * read.0 + read.1 * read.1);
    if !(share < 1.0) {
        return 0.0;
    }
    let share = share.max(1.0 - MOST_TAKEN);
    // A ripple is a share of the speed: the line holds so much more of it where the wheel is fast.
    let left_by = |c: f64| {
        let (mut sum, mut all) = (0.0, 0.0);
        for speed in used.iter().map(|k| smooth[*k]) {
            sum += speed * (-c * speed * speed).exp();
            all += speed;
        }
        sum / all
    };
    let fastest = used.iter().map(|k| smooth[*k]).fold(0.0, f64::max);
    let (mut low, mut high) = (0.0, 20.0 / (fastest * fastest).max(1e-12));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if left_by(middle) > share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Centred mean over one turn of the wheel: what repeats once a turn is not in it.
fn mean_of_a_turn(angle: &[f64], values: &[f64]) -> Vec<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    let (mut from, mut to) = (0, 0);
    angle
        .iter()
        .map(|centre| {
            while to < values.len() && angle[to] <= centre + PI {
                if values[to].is_finite() {
                    sum += values[to];
                    count += 1.0;
                }
                to += 1;
            }
            while angle[from] < centre - PI {
                if values[from].is_finite() {
                    sum -= values[from];
                    count -= 1.0;
                }
                from += 1;
            }
            sum / f64::max(count, 1.0)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_of_a_turn_holds_the_trend_and_not_the_ripple() {
        let angle: Vec<f64> = (0..2000).map(|k| 0.05 * f64::from(k)).collect();
        let values: Vec<f64> = angle.iter().map(|a| 10.0 + 0.01 * a + a.sin()).collect();
        let trend = mean_of_a_turn(&angle, &values);
        for k in 100..1900 {
            let expected = 10.0 + 0.01 * angle[k];
            assert!((trend[k] - expected).abs() < 0.01, "{k}: {}", trend[k]);
        }
    }

    #[test]
    fn what_a_smoother_takes_from_a_ripple_is_found_at_a_speed_that_falls() {
        let mut at = 0.0;
        let speed: Vec<f64> = (0..4000).map(|k| 90.0 - 0.015 * f64::from(k)).collect();
        let angle: Vec<f64> = speed
            .iter()
            .map(|speed| {
                at += 0.001 * speed;
                at
            })
            .collect();
        let smoother = 6e-5;
        let rippling = |left: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let all = speed.iter().zip(&angle);
            all.map(|(w, a)| w * (1.0 + 0.01 * left(*w) * a.cos()))
                .collect()
        };
        let raw = rippling(&|_| 1.0);
        let smooth = rippling(&|w| (-smoother * w * w).exp());
        let found = smoothing(&angle, &raw, &smooth, &vec![true; 4000]);
        assert!((found / smoother - 1.0).abs() < 0.03, "{found}");
    }
}
