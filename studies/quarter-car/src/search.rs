//! A search without derivatives, for costs that are simulated.

/// Hooke and Jeeves' exploratory moves alone: along each coordinate both ways, halving the steps when
/// none of them helps, `halvings` times.
pub(super) fn compass_search(
    cost: impl Fn(&[f64]) -> f64,
    start: Vec<f64>,
    mut steps: Vec<f64>,
    halvings: u32,
) -> (Vec<f64>, f64) {
    let mut best = start;
    let mut lowest = cost(&best);
    for _ in 0..=halvings {
        loop {
            let mut helped = false;
            for coordinate in 0..best.len() {
                for way in [1.0, -1.0] {
                    let mut tried = best.clone();
                    if let (Some(value), Some(step)) =
                        (tried.get_mut(coordinate), steps.get(coordinate))
                    {
                        *value += way * step;
                    }
                    let costs = cost(&tried);
                    if costs < lowest {
                        (best, lowest, helped) = (tried, costs, true);
                        break;
                    }
                }
            }
            if !helped {
                break;
            }
        }
        for step in &mut steps {
            *step *= 0.5;
        }
    }
    (best, lowest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_search_finds_the_bottom_of_a_bowl() {
        let cost = |x: &[f64]| (x[0] - 0.3).powi(2) + 2.0 * (x[1] + 0.7).powi(2);
        let (best, lowest) = compass_search(cost, vec![0.0, 0.0], vec![0.5, 0.5], 12);
        assert!((best[0] - 0.3).abs() < 1e-3 && (best[1] + 0.7).abs() < 1e-3);
        assert!(lowest < 1e-6);
    }
}
