//! The quarter car in its loop: bars on stopping distance, and every situation that the tutorial leaves out.
//!
//! A few stops each; the command runs many.

use std::process::Command;

use muslip_report::Shape;
use study_quarter_car::{
    Banked, Car, Driver, FaultKind, Filtered, PerfectState, RigDriven, Road, Scenario, Setpoint,
    Stop, StudyOptions, WrongStart, draw, fault, figures, listeners, observability, optimum, stop,
    study, traced,
};

/// The longest time with a locked wheel above 3 m/s that any loop may allow, s.
const LOCK_BAR_S: f64 = 0.2;

fn ratio(stop: &Stop, scenario: &Scenario) -> f64 {
    assert!(
        stop.longest_lock_s <= LOCK_BAR_S,
        "locked for {} s",
        stop.longest_lock_s
    );
    let undisturbed = Scenario {
        fault: None,
        ..scenario.clone()
    };
    stop.distance_m / optimum(&undisturbed).distance_m
}

#[test]
fn the_tuned_filter_stops_within_five_percent_of_the_optimum() {
    for road in [Road::dry(), Road::wet()] {
        for (speed, seed) in [(30.0, 31), (20.0, 32), (45.0, 33)] {
            let mut scenario = Scenario::usual(road.clone(), seed);
            scenario.from_m_s = speed;
            let mut driver = Filtered::tuned(&scenario).unwrap();
            let ratio = ratio(&stop(&scenario, &mut driver), &scenario);
            assert!(
                (1.0..1.05).contains(&ratio),
                "{} {speed}: {ratio}",
                road.name
            );
            assert_eq!(driver.refused, 0);
        }
    }
}

#[test]
fn it_still_does_with_another_mass_radius_noise_and_a_late_sample() {
    for road in [Road::dry(), Road::wet()] {
        let mut ratios: Vec<f64> = (0..9)
            .map(|seed| {
                let scenario = draw(&road, 900 + seed, 0.3);
                let mut driver = Filtered::tuned(&scenario).unwrap();
                ratio(&stop(&scenario, &mut driver), &scenario)
            })
            .collect();
        ratios.sort_by(f64::total_cmp);
        assert!(ratios[4] < 1.05, "{} {ratios:?}", road.name);
    }
}

#[test]
fn it_still_does_on_dry_and_wet_under_a_tyre_law_that_it_does_not_have() {
    let [dry, wet, ..] = Road::all_foreign();
    for road in [dry, wet] {
        let scenario = Scenario::foreign(road, 31);
        let stop = stop(&scenario, &mut Filtered::tuned(&scenario).unwrap());
        let ratio = ratio(&stop, &scenario);
        assert!(ratio < 1.05, "{}: {ratio}", scenario.road.name);
    }
}

#[test]
fn the_force_of_a_relaxed_tyre_follows_its_slip_and_then_is_its_law_s() {
    let [dry, ..] = Road::all_foreign();
    let law = dry.truth_at(0.0);
    let mut car = Car::new(&Scenario::foreign(dry, 1));
    let mut while_rising = f64::INFINITY;
    for sample in 0..200 {
        car.sample(700.0, |truth| {
            let steady = law.friction(truth.slip_ratio);
            // 0.15 m at 30 m/s are 5 ms.
            if sample == 1 {
                while_rising = while_rising.min(truth.friction / steady);
            }
        });
    }
    let truth = car.truth();
    let steady = law.friction(truth.slip_ratio);
    assert!(while_rising < 0.8, "{while_rising}");
    assert!(
        (truth.friction / steady - 1.0).abs() < 0.01,
        "{} {steady}",
        truth.friction
    );
    // The forces on wheel and vehicle are those of one tyre: R F = T + J dω/dt, nearly steady.
    assert!((0.30 * truth.friction * 450.0 * 9.81 - 700.0).abs() < 25.0);
}

#[test]
fn perfect_state_comes_within_one_percent() {
    for road in Road::all() {
        let scenario = Scenario::usual(road, 1);
        let mut driver = PerfectState::new(&scenario).unwrap();
        let ratio = ratio(&stop(&scenario, &mut driver), &scenario);
        assert!(
            (1.0..1.01).contains(&ratio),
            "{} {ratio}",
            scenario.road.name
        );
    }
}

#[test]
fn an_unknown_road_costs_less_than_a_tenth_with_four_channels() {
    for road in Road::all() {
        let bar = if road.patches.len() > 1 { 1.15 } else { 1.10 };
        for setpoint in [Setpoint::Sought, Setpoint::Fixed] {
            let scenario = Scenario::usual(road.clone(), 34);
            let mut driver = RigDriven::new(&scenario, setpoint).unwrap();
            let ratio = ratio(&stop(&scenario, &mut driver), &scenario);
            assert!(ratio < bar, "{} {setpoint:?} {ratio}", road.name);
            assert_eq!(driver.refused, 0);
        }
    }
}

#[test]
fn the_bank_stops_on_roads_that_it_is_not_told() {
    for road in Road::all() {
        let scenario = Scenario::usual(road, 35);
        let mut driver = Banked::new(&scenario, 22.5).unwrap();
        let ratio = ratio(&stop(&scenario, &mut driver), &scenario);
        assert!(ratio < 1.05, "{} {ratio}", scenario.road.name);
        assert_eq!(driver.refused, 0);
    }
}

#[test]
fn a_filter_that_believes_in_another_road_does_not_lock_but_stops_late() {
    let scenario = Scenario::usual(Road::dry(), 36);
    let wet = Road::wet().law_at(0.0);
    let mut driver = Filtered::mistaken(&scenario, wet).unwrap();
    assert!(ratio(&stop(&scenario, &mut driver), &scenario) > 1.3);
    let scenario = Scenario::usual(Road::wet(), 36);
    let mut driver = Filtered::mistaken(&scenario, Road::dry().law_at(0.0)).unwrap();
    let late = ratio(&stop(&scenario, &mut driver), &scenario);
    assert!(late.is_finite());
}

#[test]
fn a_wrong_mass_or_speed_at_the_start_costs_little() {
    for road in [Road::dry(), Road::wet()] {
        let scenario = Scenario::usual(road, 37);
        for mass in [300.0, 600.0] {
            let mut driver = Filtered::tuned_with(&scenario, |c| c.initial_mass_kg = mass).unwrap();
            let ratio = ratio(&stop(&scenario, &mut driver), &scenario);
            assert!(ratio < 1.05, "{mass} {ratio}");
        }
        for error in [-1.0, 1.0] {
            let mut driver = Filtered::tuned_with(&scenario, |c| {
                c.initial_vehicle_speed_m_s += error;
                c.initial_std.vehicle_speed_m_s = 1.0;
            })
            .unwrap();
            let ratio = ratio(&stop(&scenario, &mut driver), &scenario);
            assert!(ratio < 1.05, "{error} {ratio}");
        }
    }
}

#[test]
fn a_sensor_that_fails_for_50_ms_costs_little() {
    for road in [Road::dry(), Road::wet()] {
        for kind in [FaultKind::Missing, FaultKind::Frozen] {
            let mut scenario = Scenario::usual(road.clone(), 38);
            scenario.fault = Some(fault(kind));
            let mut driver = Filtered::tuned(&scenario).unwrap();
            let ratio = ratio(&stop(&scenario, &mut driver), &scenario);
            assert!(ratio < 1.05, "{} {kind:?} {ratio}", road.name);
        }
    }
}

#[test]
fn a_saturated_brake_gives_what_it_has_and_does_not_wind_up() {
    let mut scenario = Scenario::usual(Road::step(), 39);
    // Too weak for the dry peak, strong enough to lock the wheel on the wet patch.
    scenario.actuator.maximum_torque_nm = 1300.0;
    let mut driver = Filtered::tuned(&scenario).unwrap();
    let trace = traced(&scenario, &mut driver, 3.0);
    let most = trace
        .samples
        .iter()
        .map(|sample| sample.truth.brake_torque_nm)
        .fold(0.0, f64::max);
    assert_eq!(most, 1300.0);
    assert!(trace.longest_lock_s == 0.0 && trace.share_deep < 0.1);
}

#[test]
fn a_stop_ends_in_a_typed_standstill_without_a_number_that_is_none() {
    let scenario = Scenario::usual(Road::dry(), 40);
    let mut driver = Filtered::tuned(&scenario).unwrap();
    let samples = traced(&scenario, &mut driver, 3.5).samples;
    assert_eq!(driver.refused, 0);
    let last = samples.last().unwrap();
    assert_eq!(last.truth.vehicle_speed_m_s, 0.0);
    assert!(last.belief.slip_ratio.is_nan(), "slip at standstill");
    for sample in &samples {
        let belief = sample.belief;
        assert!(belief.vehicle_speed_m_s.is_finite() && belief.vehicle_speed_m_s >= 0.0);
        assert!(belief.wheel_speed_rad_s.is_finite() && belief.friction.is_finite());
        // Slip is a number exactly where the believed speed gives it a meaning.
        if belief.vehicle_speed_m_s < 0.5 {
            assert!(belief.slip_ratio.is_nan());
        }
    }
}

#[test]
fn a_wheel_locked_by_a_false_standstill_is_freed() {
    // A filter that believes in a dry road on snow takes the vehicle for standing long before it does.
    let scenario = Scenario::usual(Road::snow(), 41);
    let dry = Road::dry().law_at(0.0);
    let mut driver = Filtered::mistaken(&scenario, dry).unwrap();
    let stop = stop(&scenario, &mut driver);
    assert!(stop.longest_lock_s <= LOCK_BAR_S, "{}", stop.longest_lock_s);
    assert!(stop.distance_m.is_finite());
}

#[test]
fn mass_converges_where_the_readings_can_tell_it_and_nowhere_else() {
    let start = WrongStart {
        mass_kg: 600.0,
        speed_error_m_s: 0.0,
    };
    let all = listeners(start, 42).unwrap();
    let mass = |index: usize, time_s: f64| {
        let belief = all[index].at(time_s).unwrap().belief;
        (belief.mass_kg, belief.mass_std_kg)
    };
    let [tutorial, certain, known, unknown, rig] = [0, 1, 2, 3, 4].map(|index| mass(index, 2.0));
    assert!((tutorial.0 - 600.0).abs() < 60.0, "{tutorial:?}");
    // It moves by what little process noise the mass has, and is off by many of its own sigmas.
    assert!(certain.0 > 500.0 && certain.1 < 5.0, "{certain:?}");
    assert!((known.0 - 450.0).abs() < 15.0, "{known:?}");
    assert!(
        (unknown.0 - 450.0).abs() > 30.0 || unknown.1 > 30.0,
        "{unknown:?}"
    );
    assert!((rig.0 - 450.0).abs() < 5.0 && rig.1 < 5.0, "{rig:?}");
    // And at once.
    assert!((mass(4, 0.1).0 - 450.0).abs() < 5.0);
}

#[test]
fn rank_of_observability_is_as_the_equations_have_it() {
    for row in observability().unwrap() {
        let expected = match (row.point, row.road_known, row.channels) {
            (_, false, study_quarter_car::Channels::WheelSpeed) => Some(2),
            (_, false, study_quarter_car::Channels::Rig) => Some(4),
            ("λ = 0.03", true, _) => Some(5),
            ("the peak", true, study_quarter_car::Channels::WheelSpeed) => Some(3),
            _ => None,
        };
        if let Some(expected) = expected {
            assert_eq!(row.rank, expected, "{row:?}");
        }
        assert_eq!(row.unseen.is_empty(), row.rank == 5, "{row:?}");
    }
}

#[test]
fn half_the_plant_s_step_changes_a_stop_by_less_than_a_thousandth() {
    // The same torque, sample by sample, on steps of half the length.
    use host_sim::{Plant, PlantParameters, RigLaw};
    let scenario = Scenario::usual(Road::dry(), 43);
    let mut driver = Filtered::tuned(&scenario).unwrap();
    let trace = traced(&scenario, &mut driver, 2.0);
    let distance = |steps: u32| {
        let mut plant = Plant::rolling(
            PlantParameters {
                radius_m: 0.3,
                inertia_kg_m2: 1.0,
                mass_kg: 450.0,
                coasting: true,
                law: RigLaw::Burckhardt(scenario.road.law_at(0.0)),
            },
            30.0,
        );
        for pair in trace.samples.windows(2) {
            let (from, to) = (pair[0].truth.brake_torque_nm, pair[1].truth.brake_torque_nm);
            for step in 0..steps {
                let share = (f64::from(step) + 0.5) / f64::from(steps);
                plant.step(
                    0.005 / f64::from(steps),
                    from + share * (to - from),
                    450.0 * 9.81,
                );
            }
        }
        plant.state().distance_m
    };
    let (coarse, fine) = (distance(20), distance(40));
    assert!((coarse / fine - 1.0).abs() < 1e-3, "{coarse} {fine}");
}

#[test]
#[ignore = "the whole comparison twice; cargo xtask test runs it in release"]
fn the_same_options_give_the_same_study_and_figures() {
    let options = StudyOptions {
        seed: 5,
        stops: 1,
        draws: 1,
    };
    let first = study(options, &mut |_| {}).unwrap();
    let again = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap()
        .install(|| study(options, &mut |_| {}).unwrap());
    // Not by equality: what does not stop has shares that are no numbers.
    assert_eq!(format!("{first:?}"), format!("{again:?}"));
    let drawn = figures(5).unwrap();
    assert_eq!(drawn.len(), 6);
    for named in drawn {
        for layer in named.figure.layers {
            if let Shape::Line(points) = layer.shape {
                assert!(points.len() > 100, "{} {}", named.name, layer.label);
            }
        }
    }
}

#[test]
fn the_command_writes_report_tables_and_figures() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_study-quarter-car"))
        .current_dir(folder.path())
        .env("COLUMNS", "100")
        .args(["--stops", "1", "--draws", "1", "--out", "made"])
        .output()
        .unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
    let words = String::from_utf8(output.stdout).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(words.contains("(c)  tuned"), "{words}");
    let page = read("made/quarter-car.md");
    // Wrapped nowhere, unlike on the terminal.
    assert!(page.contains("tuned filter, road known"), "{page}");
    assert!(
        page.contains(
            "cargo run -p study-quarter-car --release -- --seed 700001 --stops 1 --draws 1"
        )
    );
    assert!(!page.contains("NaN"));
    let report = read("made/report.html");
    for heading in ["True signals", "Estimated signals", "Mass", "Monte Carlo"] {
        assert!(report.contains(heading), "{heading}");
    }
    for figure in [
        "true-speeds",
        "true-slip-friction",
        "estimated-speeds",
        "estimated-slip-friction",
        "mass",
        "mass-from-a-wrong-start",
    ] {
        let svg = read(&format!("made/figures/{figure}.svg"));
        assert!(svg.contains("</svg>") && !svg.contains("NaN"), "{figure}");
    }
}

/// A driver is an object: the loop knows nothing of what is behind it.
#[test]
fn any_driver_can_be_put_behind_the_wheel() {
    struct Gentle;
    impl Driver for Gentle {
        fn demand(&mut self, _: &study_quarter_car::Readings, _: &study_quarter_car::Truth) -> f64 {
            600.0
        }
    }
    let scenario = Scenario::usual(Road::dry(), 44);
    let stop = stop(&scenario, &mut Gentle);
    // 600 N m on 0.30 m stop the vehicle and 11 kg of wheel: v² / 2a.
    let deceleration = 2000.0 / (450.0 + 1.0 / 0.09);
    let expected = (900.0 - 1.0) / (2.0 * deceleration);
    assert!((stop.distance_m / expected - 1.0).abs() < 0.02);
}
