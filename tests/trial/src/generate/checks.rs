//! What the generator itself must keep.

use rayon::prelude::*;

use crate::generate::campaign::{Campaign, NULL_KINDS, NullKind, Order, make};
use crate::generate::form::{OUTSIDE, VOCABULARY};
use crate::generate::measure::{refit, residual, rms};
use crate::generate::noise::Written;

fn null(kind: NullKind, seed: u64) -> Campaign {
    let order = Order {
        stratum: "null".into(),
        forms: vec![],
        strength: vec![],
        null: Some(kind),
    };
    make("campaign-0000", seed, &order).unwrap()
}

#[test]
fn nulls_satisfy_every_balance_and_give_back_the_base() {
    NULL_KINDS.par_iter().for_each(|kind| {
        for seed in 0..4 {
            let truth = null(*kind, 900 + seed).truth;
            for (balance, size) in &truth.size {
                assert!(
                    *size < 0.06,
                    "{kind:?} seed {seed}: {balance} off by {size} sigma"
                );
            }
            assert!(
                truth.intervals.is_empty(),
                "{kind:?}: {:?}",
                truth.intervals
            );
            let off = (truth.base_refitted.peak_friction / truth.base.peak_friction - 1.0).abs()
                + (truth.base_refitted.critical_slip / truth.base.critical_slip - 1.0).abs();
            assert!(
                off < 1e-4,
                "{kind:?}: base refitted {off} away from its truth"
            );
        }
    });
}

#[test]
fn written_errors_have_the_size_that_the_rig_claims() {
    for seed in 0..6 {
        let campaign = null(NullKind::White, 40 + seed);
        let rig = &campaign.truth.rig;
        let errors =
            |pick: &dyn Fn(&Written) -> &Vec<f64>,
             clean: &dyn Fn(&crate::generate::chain::Readings) -> &Vec<f64>| {
                let all: Vec<f64> = campaign
                    .fit
                    .iter()
                    .flat_map(|run| {
                        pick(&run.written)
                            .iter()
                            .zip(clean(&run.clean))
                            .map(|(a, b)| a - b)
                            .collect::<Vec<_>>()
                    })
                    .collect();
                rms(all.iter())
            };
        let near = |measured: f64, claimed: f64| {
            assert!(
                (measured / claimed - 1.0).abs() < 0.05,
                "{measured} against {claimed}"
            )
        };
        near(errors(&|w| &w.drag, &|r| &r.drag), rig.sigmas.drag_force_n);
        near(
            errors(&|w| &w.load, &|r| &r.load),
            rig.sigmas.normal_force_n,
        );
        near(
            errors(&|w| &w.wheel, &|r| &r.wheel),
            rig.sigmas.wheel_speed_rad_s,
        );
        near(
            errors(&|w| &w.speed, &|r| &r.speed),
            rig.sigmas.vehicle_speed_m_s,
        );
    }
}

#[test]
fn recordings_have_the_length_that_was_promised() {
    for seed in 0..4 {
        let campaign = null(NULL_KINDS[seed as usize], 60 + seed);
        assert!((4..=8).contains(&campaign.fit.len()));
        for run in campaign.fit.iter().chain(&campaign.fresh) {
            assert!(
                (700..=7000).contains(&run.written.time.len()),
                "{} samples",
                run.written.time.len()
            );
            assert!(
                run.written.time.windows(2).all(|pair| pair[1] > pair[0]),
                "time rises"
            );
        }
    }
}

#[test]
fn every_form_leaves_its_balance_off_by_the_ordered_size() {
    let mut forms: Vec<_> = VOCABULARY
        .iter()
        .flat_map(|entry| entry.2.iter().map(|form| (*form, entry.1)))
        .collect();
    forms.extend(OUTSIDE.iter().map(|entry| (entry.0, entry.1)));
    forms.par_iter().for_each(|(form, balance)| {
        let order = Order {
            stratum: "single".into(),
            forms: vec![*form],
            strength: vec![1.0],
            null: None,
        };
        let campaign = make("campaign-0000", 17, &order).unwrap();
        let truth = &campaign.truth;
        let clean: Vec<_> = campaign.fit.iter().map(|run| run.clean.clone()).collect();
        let base = refit(&truth.rig, &clean);
        let sigma = match *balance {
            "wheel" => truth.sigma.wheel,
            "vehicle" => truth.sigma.vehicle,
            _ => truth.sigma.tyre,
        };
        let left: Vec<f64> = clean
            .iter()
            .flat_map(|run| residual(balance, &truth.rig, base, run))
            .collect();
        let size = rms(left.iter()) / sigma;
        assert!(
            (size - 1.0).abs() < 0.06,
            "{form:?}: {size} sigma instead of 1"
        );
        for figure in &truth.concealed[0].figures {
            assert!(
                figure.values.iter().all(|value| value.is_finite()),
                "{form:?}: {figure:?}"
            );
        }
        assert!(
            truth
                .fresh
                .iter()
                .all(|fresh| fresh.floor.is_finite() && fresh.floor_best <= fresh.floor),
            "{form:?}: no floor"
        );
    });
}

#[test]
fn the_oracle_beats_the_base_where_the_effect_is_large() {
    use crate::generate::form::Form;
    for form in [
        Form::RelaxBrush,
        Form::ThermalTwoNode,
        Form::LagTwoPoles,
        Form::CurveMagic,
        Form::LoadPower,
        Form::RadiusConstant,
        Form::PatchHard,
    ] {
        let order = Order {
            stratum: "single".into(),
            forms: vec![form],
            strength: vec![4.0],
            null: None,
        };
        // A single run may lie where the effect happens to vanish.
        let (mut floor, mut base) = (0.0, 0.0);
        for seed in 0..4 {
            let truth = crate::generate::strata::fulfil("campaign-0000", seed, &order)
                .unwrap()
                .truth;
            for fresh in &truth.fresh {
                floor += fresh.floor / truth.rig.peak_drag_n().powi(2);
                base += fresh.base / truth.rig.peak_drag_n().powi(2);
            }
        }
        assert!(floor < 0.5 * base, "{form:?}: floor {floor} base {base}");
    }
}
