//! What the generator itself must keep.

use rayon::prelude::*;

use crate::draw::Draw;
use crate::generate::campaign::{Campaign, FreshTruth, NULL_KINDS, NullKind, Order, make};
use crate::generate::form::Needs;
use crate::generate::form::{OUTSIDE, VOCABULARY};
use crate::generate::instrument::finding::{FINDING_KINDS, FindingKind};
use crate::generate::instrument::{ChainKind, Instruments};
use crate::generate::measure::{refit, residual, rms, usable};
use crate::generate::noise::Written;
use crate::generate::plan::Plan;
use crate::generate::rig::Rig;

fn null(kind: NullKind, seed: u64) -> Campaign {
    let order = Order {
        stratum: "null".into(),
        forms: vec![],
        strength: vec![],
        null: Some(kind),
        chain: ChainKind::Ideal,
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
            chain: ChainKind::Ideal,
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
            chain: ChainKind::Ideal,
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

fn through(chain: ChainKind, seed: u64) -> Campaign {
    let order = Order {
        stratum: "null".into(),
        forms: vec![],
        strength: vec![],
        null: Some(NullKind::RealChain),
        chain,
    };
    make("campaign-0000", seed, &order).unwrap()
}

#[test]
fn nothing_is_missing_behind_a_real_chain_and_its_errors_have_the_size_that_counts() {
    (0..12u64).into_par_iter().for_each(|seed| {
        let campaign = through(ChainKind::Real, 300 + seed);
        let truth = &campaign.truth;
        for (balance, size) in &truth.size {
            assert!(*size < 0.06, "seed {seed}: {balance} off by {size} sigma");
        }
        assert!(truth.intervals.is_empty());
        assert!(truth.findings.is_empty() && truth.concealed.is_empty());
        let errors: Vec<f64> = campaign
            .fit
            .iter()
            .flat_map(|run| {
                (0..run.reading.len())
                    .filter(|index| usable(&truth.rig, &run.clean, *index))
                    .map(|index| run.written.drag[index] - run.reading[index])
                    .collect::<Vec<_>>()
            })
            .collect();
        let ratio = rms(errors.iter()) / truth.rig.sigmas.drag_force_n;
        // Slow noise differs from ride to ride.
        assert!((0.5..2.0).contains(&ratio), "seed {seed}: {ratio}");
        // The truth with the chain's delays taken back predicts no worse than the base without.
        let sum = |of: fn(&FreshTruth) -> f64| truth.fresh.iter().map(of).sum::<f64>();
        let (floor, base) = (sum(|fresh| fresh.floor_best), sum(|fresh| fresh.base));
        assert!(
            floor < 1.05 * base,
            "seed {seed}: floor {floor}, base {base}"
        );
        // What the chain does to the drag is small beside the drag, but it is something.
        let off: Vec<f64> = campaign
            .fit
            .iter()
            .flat_map(|run| {
                run.reading
                    .iter()
                    .zip(&run.clean.drag)
                    .map(|(a, b)| a - b)
                    .collect::<Vec<_>>()
            })
            .collect();
        assert!(rms(off.iter()) < 0.4 * truth.rig.peak_drag_n());
    });
}

#[test]
fn sensors_of_every_sort_meet_each_other_and_fresh_runs_stand_everywhere() {
    let mut met = std::collections::BTreeSet::new();
    let mut places = std::collections::BTreeSet::new();
    for seed in 0..300 {
        let mut draw = Draw::new(seed, &[1]);
        let rig = Rig::draw(Needs::default(), &mut draw);
        let chain = Instruments::draw(ChainKind::Real, &rig, &mut draw);
        met.insert((chain.wheel.word(), chain.vehicle.word()));
        let plan = Plan::draw(Needs::default(), &rig, false, &mut draw);
        places.extend(plan.fresh.map(|index| plan.place(index)));
        assert!(plan.fitted().count() + 2 == plan.runs.len());
    }
    assert_eq!(met.len(), 3 * 4, "{met:?}");
    assert_eq!(places.len(), 3, "{places:?}");
}

#[test]
fn an_effect_of_the_chain_stands_alone_in_its_campaign() {
    FINDING_KINDS.into_par_iter().for_each(|kind| {
        let campaign = through(ChainKind::Only(kind), 500);
        let truth = &campaign.truth;
        assert!(
            truth
                .findings
                .iter()
                .all(|finding| finding.value.is_finite()),
            "{kind:?}: {:?}",
            truth.findings
        );
        // Runs do not differ, and ideal readings satisfy every balance.
        assert!(
            truth.size.iter().all(|(_, size)| *size < 0.06),
            "{kind:?}: {:?}",
            truth.size
        );
        assert!(truth.spread.iter().all(|spread| spread.friction == 0.0));
        if kind == FindingKind::LeakingColumn {
            assert!(truth.findings[0].value > 0.95, "{:?}", truth.findings);
        }
    });
}
