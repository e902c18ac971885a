//! What a reader may compare with: textbook ways to look for what a simulation lacks, on the same files.
//!
//! | method | module |
//! | --- | --- |
//! | regression with BIC: accelerations over 50 ms, inputs taken as exact, every sample as independent | [`regression`] |
//! | output-error fit: the balances integrated, every channel's error white at its output, BIC | [`output_error`] |
//! | best single: the one signature that lowers the training error most, always named | [`regression`] |
//! | whiteness: Ljung and Box's test of the base's residual, which names nothing | [`select`] |
//!
//! The first two see the tyre balance alike, through [`tyre`]; recordings come in by [`record`].

pub mod output_error;
pub mod record;
pub mod regression;
pub mod select;
pub mod tyre;

use std::path::Path;

use anyhow::Result;

use crate::baseline::record::{Record, records};
use crate::baseline::select::{Selection, ljung_box, select};
use crate::generate::campaign::Truth;
use crate::generate::chain::Readings;
use crate::generate::measure::refit;
use crate::generate::rig::{BrakeColumn, Rig};

/// What the baselines say of one campaign.
#[derive(Clone, Debug)]
pub struct Verdicts {
    /// Mechanisms that the regression selected, strongest first.
    pub regression: Vec<&'static str>,
    /// Those that the output-error fit selected.
    pub output_error: Vec<&'static str>,
    /// Empty where the recordings held nothing to fit.
    pub best_single: &'static str,
    /// The residual of the base is white at the 5 % level.
    pub white: bool,
}

/// Applies the baselines to the recordings of a campaign.
pub fn verdicts(campaigns: &Path, truth: &Truth) -> Result<Verdicts> {
    Ok(judged(
        &truth.rig,
        &records(&campaigns.join(&truth.campaign), &truth.rig)?,
    ))
}

fn judged(rig: &Rig, runs: &[Record]) -> Verdicts {
    let readings: Vec<Readings> = runs.iter().map(|run| run.readings.clone()).collect();
    let problem = tyre::problem(rig, refit(rig, &readings), runs);
    let tyre = select(&problem);
    let mut regression = vec![tyre.clone()];
    let mut output_error = vec![tyre];
    if rig.brake != BrakeColumn::None {
        regression.push(select(&regression::wheel(rig, runs)));
        output_error.push(select(&output_error::wheel(rig, runs)));
    }
    if rig.coasting {
        let gain_is_off = |balances: &[Selection]| {
            balances
                .iter()
                .any(|balance| balance.chosen.iter().any(|chosen| chosen.0 == "force_gain"))
        };
        let (by_rates, by_integrals) = (gain_is_off(&regression), gain_is_off(&output_error));
        regression.push(select(&regression::vehicle(rig, runs, by_rates)));
        output_error.push(select(&output_error::vehicle(rig, runs, by_integrals)));
    }
    Verdicts {
        best_single: regression
            .iter()
            .map(|selection| selection.best)
            .fold(("", f64::NEG_INFINITY), |best, next| {
                if next.1 > best.1 { next } else { best }
            })
            .0,
        regression: names(&regression),
        output_error: names(&output_error),
        white: ljung_box(&problem.residual, 20) > 0.05,
    }
}

/// What was chosen in any balance, strongest first, each once.
fn names(selections: &[Selection]) -> Vec<&'static str> {
    let mut chosen: Vec<_> = selections
        .iter()
        .flat_map(|selection| selection.chosen.iter().copied())
        .collect();
    chosen.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut names = Vec::new();
    for (id, _) in chosen {
        if !names.contains(&id) {
            names.push(id);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;
    use crate::generate::campaign::{NullKind, Order, make};
    use crate::generate::form::VOCABULARY;

    /// A coast-down of 3 s at 200 Hz whose mass is so many times the rig file's: force all but exact, speed with
    /// white noise of 0.03 m/s.
    fn coast_down(rig: &Rig, mass_factor: f64) -> Record {
        let mut draw = Draw::new(5, &[]);
        let period = 0.005;
        let (mut speed, mut readings) = (30.0, Readings::default());
        for index in 0..600 {
            let time = f64::from(index) * period;
            let drag = rig.mass_kg * (5.0 + 3.0 * (4.0 * time).sin());
            readings.time.push(time);
            readings.speed.push(speed + 0.03 * draw.normal());
            readings.wheel.push(0.9 * speed / rig.radius_m);
            readings
                .drag
                .push(drag + 1e-3 * rig.mass_kg * draw.normal());
            readings.load.push(rig.mean_load_n);
            readings.torque.push(0.0);
            // The next reading stands where the mean of two forces takes it.
            let middle = rig.mass_kg * (5.0 + 3.0 * (4.0 * (time + 0.5 * period)).sin());
            speed -= middle / (mass_factor * rig.mass_kg) * period;
        }
        Record::new(readings)
    }

    fn rig() -> Rig {
        let order = Order {
            stratum: "null".into(),
            forms: vec![],
            strength: vec![],
            chain: crate::generate::instrument::ChainKind::Ideal,
            null: Some(NullKind::White),
        };
        let mut rig = make("campaign-0000", 5, &order).unwrap().truth.rig;
        rig.coasting = true;
        rig.rate_hz = 200.0;
        rig
    }

    #[test]
    fn a_mass_error_drowned_in_accelerations_stands_out_in_the_integral() {
        let rig = rig();
        let heavy = [coast_down(&rig, 1.03)];
        let chosen = |selection: Selection| -> Vec<&'static str> {
            selection.chosen.iter().map(|chosen| chosen.0).collect()
        };
        // Over 50 ms the noise of the speed is 0.8 m/s2 of acceleration, the error 0.15.
        assert!(chosen(select(&regression::vehicle(&rig, &heavy, false))).is_empty());
        assert_eq!(
            chosen(select(&output_error::vehicle(&rig, &heavy, false))),
            ["vehicle_inertia"]
        );
        assert!(
            chosen(select(&output_error::vehicle(
                &rig,
                &[coast_down(&rig, 1.0)],
                false
            )))
            .is_empty()
        );
    }

    #[test]
    fn the_vocabulary_is_the_contract_s() {
        let rig = rig();
        let runs = [coast_down(&rig, 1.0)];
        let base = refit(&rig, std::slice::from_ref(&runs[0].readings));
        let mut ids: Vec<&str> = [
            tyre::problem(&rig, base, &runs),
            regression::wheel(&rig, &runs),
            regression::vehicle(&rig, &runs, false),
        ]
        .iter()
        .flat_map(|problem| problem.candidates.iter().map(|candidate| candidate.0))
        .collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), 29);
        assert!(VOCABULARY.iter().all(|entry| ids.contains(&entry.0)));
    }

    #[test]
    fn holes_held_values_and_dead_channels_are_borne() {
        let rig = rig();
        let whole = coast_down(&rig, 1.0).readings;
        let mut held = whole.clone();
        for index in 0..held.speed.len() {
            held.speed[index] = whole.speed[index - index % 20];
        }
        let mut dead = whole.clone();
        dead.wheel.fill(f64::NAN);
        let mut still = whole.clone();
        for channel in [
            &mut still.speed,
            &mut still.wheel,
            &mut still.drag,
            &mut still.load,
        ] {
            channel.fill(0.0);
        }
        for readings in [held, dead, still, Readings::default()] {
            let verdict = judged(&rig, &[Record::new(readings)]);
            assert!(verdict.output_error.len() <= 29);
        }
    }
}
