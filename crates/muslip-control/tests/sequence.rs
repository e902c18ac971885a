//! Every transition of a run at the sample and at the value that it belongs to, and not before: the table of
//! `muslip_control::sequence`, row by row.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use muslip_control::interlock::{LOCK_SPEED_M_S, ROLLING_SLIP};
use muslip_control::rates::Rates;
use muslip_control::sequence::{Observed, Sequence};
use muslip_record::{Fault, Profile, Program, State};

const RATES: Rates = Rates::new(1_000, 84_000_000);
const START_SPEED_M_S: f32 = 20.0;
const SKID_SLIP: f32 = 0.25;
/// Exact in binary, as all times here.
const SAMPLES_A_STEP: u32 = 500;
/// As it rolls freely at the speed that an application starts from.
const ROLLING: Observed = Observed {
    slip_ratio: Some(0.0),
    vehicle_speed_m_s: START_SPEED_M_S,
    stop: false,
};
/// With the brake on, and no skid.
const BRAKED: Observed = Observed {
    slip_ratio: Some(0.1),
    ..ROLLING
};

fn slipping(slip: f32) -> Observed {
    Observed {
        slip_ratio: Some(slip),
        ..ROLLING
    }
}

fn at_speed(of: Observed, vehicle_speed_m_s: f32) -> Observed {
    Observed {
        vehicle_speed_m_s,
        ..of
    }
}

fn stopped(of: Observed) -> Observed {
    Observed { stop: true, ..of }
}

fn unknown() -> Observed {
    Observed {
        slip_ratio: None,
        ..ROLLING
    }
}

fn below(x: f32) -> f32 {
    x.next_down()
}

fn above(x: f32) -> f32 {
    x.next_up()
}

fn profile(program: Program) -> Profile {
    Profile {
        program,
        start_speed_m_s: START_SPEED_M_S,
        skid_slip: SKID_SLIP,
        skid_hold_s: 0.125,
        applications: 2,
        cool_s: 0.5,
    }
}

fn ramp() -> Profile {
    profile(Program::Ramp { demand_per_s: 2.0 })
}

/// A sequence with what it demanded last.
struct Run {
    sequence: Sequence,
    demand: f32,
}

impl Run {
    fn armed() -> Self {
        let mut sequence = Sequence::new(RATES);
        sequence.arm().unwrap();
        Self {
            sequence,
            demand: 0.0,
        }
    }

    fn spinning_up(profile: &Profile) -> Self {
        let mut run = Self::armed();
        run.sequence.start(profile).unwrap();
        run
    }

    /// In its ramp, before its first sample there.
    fn ramping(profile: &Profile) -> Self {
        let mut run = Self::spinning_up(profile);
        run.ramps();
        run
    }

    /// From spin-up into the ramp: as long as it takes, and no sooner.
    fn ramps(&mut self) {
        assert_eq!(self.after(199, ROLLING), State::SpinUp);
        assert_eq!(self.after(1, ROLLING), State::Ramp);
    }

    /// In a skid at half of full pressure, before its first sample there.
    fn skidding() -> Self {
        let mut run = Self::ramping(&ramp());
        run.after(249, BRAKED);
        assert_eq!(run.after(1, slipping(SKID_SLIP)), State::Skid);
        run
    }

    /// Released, before its first sample there.
    fn released(profile: &Profile) -> Self {
        let mut run = Self::ramping(profile);
        assert_eq!(run.after(1, stopped(BRAKED)), State::Release);
        run
    }

    /// Cooling after its first application, before its first sample there.
    fn cooling(profile: &Profile) -> Self {
        let mut run = Self::released(profile);
        // One sample with slip, so that rolling is counted from nothing.
        assert_eq!(run.after(1, BRAKED), State::Release);
        assert_eq!(run.after(50, ROLLING), State::Cool);
        run
    }

    fn done() -> Self {
        let mut run = Self::cooling(&ramp());
        assert_eq!(run.after(1, stopped(ROLLING)), State::Done);
        run
    }

    /// So many samples on.
    fn after(&mut self, samples: u32, observed: Observed) -> State {
        for _ in 0..samples {
            self.demand = self.sequence.step(&observed, |_| 0.0);
            let may = matches!(self.sequence.state(), State::Ramp | State::Skid);
            assert!(may || self.demand == 0.0, "{:?}", self.sequence.state());
        }
        self.sequence.state()
    }
}

#[test]
fn only_what_rests_is_armed_only_what_is_armed_starts_only_a_fault_is_cleared() {
    let in_each: [fn() -> Sequence; 8] = [
        || Sequence::new(RATES),
        || Run::armed().sequence,
        || Run::spinning_up(&ramp()).sequence,
        || Run::ramping(&ramp()).sequence,
        || Run::skidding().sequence,
        || {
            let mut run = Run::released(&ramp());
            run.after(1_001, BRAKED);
            assert!(run.sequence.timed_out());
            run.sequence
        },
        || Run::cooling(&ramp()).sequence,
        || Run::done().sequence,
    ];
    for made in in_each {
        let mut one = made();
        let state = one.state();
        let rests = matches!(state, State::Idle | State::Done);
        assert_eq!(one.is_at_rest(), rests);
        assert_eq!(one.is_engaged(), !rests);
        assert_eq!(one.arm(), if rests { Ok(()) } else { Err(state) });
        let mut one = made();
        let starts = state == State::Armed;
        assert_eq!(one.start(&ramp()), if starts { Ok(()) } else { Err(state) });
        let mut one = made();
        assert_eq!(one.clear(), Err(state));
        one.fail(Fault::Timeout);
        assert_eq!(
            (one.state(), one.fault()),
            (State::Fault, Some(Fault::Timeout))
        );
        assert!(!one.is_engaged() && !one.is_at_rest());
        for observed in [ROLLING, stopped(ROLLING), BRAKED] {
            assert_eq!(one.step(&observed, |_| 1.0).to_bits(), 0);
            assert_eq!(one.state(), State::Fault);
        }
        assert_eq!(one.arm(), Err(State::Fault));
        assert_eq!(one.start(&ramp()), Err(State::Fault));
        assert_eq!(one.clear(), Ok(()));
        assert_eq!(
            (one.state(), one.fault(), one.timed_out()),
            (State::Idle, None, false)
        );
    }
}

#[test]
fn armed_ends_by_a_stop_or_after_a_minute_before_a_run_and_after_one() {
    for before in [Sequence::new(RATES), Run::done().sequence] {
        let mut run = Run {
            sequence: before,
            demand: 0.0,
        };
        run.sequence.arm().unwrap();
        assert_eq!(run.after(1, ROLLING), State::Armed);
        assert_eq!(run.after(1, stopped(ROLLING)), State::Idle);
        run.sequence.arm().unwrap();
        assert_eq!(run.after(60_000, ROLLING), State::Armed);
        assert_eq!(run.after(1, ROLLING), State::Idle);
        assert_eq!(run.after(2, stopped(ROLLING)), State::Idle);
    }
}

#[test]
fn the_brake_is_put_on_at_the_start_speed_after_a_fifth_of_a_second_of_rolling() {
    let mut run = Run::spinning_up(&ramp());
    assert_eq!(run.after(199, slipping(ROLLING_SLIP)), State::SpinUp);
    assert_eq!(run.after(1, slipping(-ROLLING_SLIP)), State::Ramp);
    for interrupted in [
        slipping(above(ROLLING_SLIP)),
        slipping(-above(ROLLING_SLIP)),
        unknown(),
    ] {
        let mut run = Run::spinning_up(&ramp());
        run.after(199, ROLLING);
        assert_eq!(run.after(1, interrupted), State::SpinUp);
        assert_eq!(run.after(199, ROLLING), State::SpinUp);
        assert_eq!(run.after(1, ROLLING), State::Ramp);
    }
    let mut run = Run::spinning_up(&ramp());
    let slower = at_speed(ROLLING, below(START_SPEED_M_S));
    assert_eq!(run.after(1_000, slower), State::SpinUp);
    assert_eq!(run.after(1, ROLLING), State::Ramp);
    let mut run = Run::spinning_up(&ramp());
    run.after(199, ROLLING);
    assert_eq!(run.after(1, stopped(ROLLING)), State::Idle);
}

#[test]
fn a_vehicle_that_is_not_up_to_speed_after_two_minutes_has_timed_out() {
    let mut run = Run::spinning_up(&ramp());
    run.after(120_000, at_speed(ROLLING, 1.0));
    assert!(!run.sequence.timed_out());
    run.after(1, at_speed(ROLLING, 1.0));
    assert!(run.sequence.timed_out());
}

#[test]
fn a_ramp_rises_to_full_pressure_and_is_over_half_as_long_again_after_it() {
    let mut run = Run::ramping(&ramp());
    for (sample, demand) in [(125, 0.25), (125, 0.5), (250, 1.0), (249, 1.0)] {
        assert_eq!(run.after(sample, BRAKED), State::Ramp);
        assert!((run.demand - demand).abs() < 1e-6, "{}", run.demand);
    }
    // 0.75 s at two a second.
    assert_eq!(run.after(1, BRAKED), State::Release);
    // One second at 1.5 a second, both of them exact.
    let demand_per_s = 1.5;
    let mut run = Run::ramping(&profile(Program::Ramp { demand_per_s }));
    assert_eq!(run.after(999, BRAKED), State::Ramp);
    assert_eq!(run.after(1, BRAKED), State::Release);
}

#[test]
fn steps_hold_their_levels_one_after_the_other() {
    let mut levels = [0.9; muslip_record::STEPS];
    levels[..3].copy_from_slice(&[0.25, 0.75, 0.5]);
    let steps = Program::Steps {
        levels,
        count: 3,
        hold_s: 0.5,
    };
    let mut run = Run::ramping(&profile(steps));
    // The first sample is one sample's time into the ramp.
    let mut left = SAMPLES_A_STEP - 1;
    for level in [0.25, 0.75, 0.5] {
        for _ in 0..left {
            assert_eq!(run.after(1, BRAKED), State::Ramp);
            assert_eq!(run.demand.to_bits(), f32::to_bits(level));
        }
        left = SAMPLES_A_STEP;
    }
    assert_eq!(run.after(1, BRAKED), State::Release);
}

#[test]
fn a_held_slip_asks_for_its_target_until_its_time_is_over() {
    let hold = Program::SlipHold {
        target_slip: 0.125,
        hold_s: 0.5,
    };
    let mut run = Run::ramping(&profile(hold));
    for _ in 0..499 {
        let demand = run.sequence.step(&BRAKED, |target| 4.0 * target);
        assert_eq!(demand.to_bits(), 0.5_f32.to_bits());
    }
    assert_eq!(run.sequence.step(&BRAKED, |_| 0.5).to_bits(), 0);
    assert_eq!(run.sequence.state(), State::Release);
}

#[test]
fn a_ramp_ends_by_a_stop_by_slip_without_a_meaning_and_below_the_lock_speed() {
    for ended in [
        stopped(BRAKED),
        unknown(),
        at_speed(BRAKED, below(LOCK_SPEED_M_S)),
        // None of it is a skid.
        stopped(slipping(SKID_SLIP)),
        at_speed(slipping(SKID_SLIP), below(LOCK_SPEED_M_S)),
    ] {
        let mut run = Run::ramping(&ramp());
        assert_eq!(
            run.after(100, at_speed(BRAKED, LOCK_SPEED_M_S)),
            State::Ramp
        );
        assert_eq!(run.after(1, ended), State::Release);
        assert_eq!(run.demand.to_bits(), 0);
    }
}

#[test]
fn a_skid_begins_at_its_slip_and_holds_what_it_had_for_its_time() {
    let mut run = Run::ramping(&ramp());
    assert_eq!(run.after(249, slipping(below(SKID_SLIP))), State::Ramp);
    assert_eq!(run.after(1, slipping(SKID_SLIP)), State::Skid);
    assert!((run.demand - 0.5).abs() < 1e-6);
    let held = run.demand;
    assert_eq!(
        run.after(125, at_speed(slipping(0.9), LOCK_SPEED_M_S)),
        State::Skid
    );
    assert_eq!(run.demand.to_bits(), held.to_bits());
    assert_eq!(run.after(1, slipping(0.9)), State::Release);
    for ended in [
        stopped(BRAKED),
        unknown(),
        at_speed(BRAKED, below(LOCK_SPEED_M_S)),
    ] {
        let mut run = Run::skidding();
        assert_eq!(run.after(1, ended), State::Release);
    }
}

#[test]
fn a_released_wheel_has_a_second_to_roll_for_a_twentieth() {
    let mut run = Run::released(&ramp());
    assert_eq!(run.after(1_000, BRAKED), State::Release);
    assert!(!run.sequence.timed_out());
    run.after(1, BRAKED);
    assert!(run.sequence.timed_out());
    let mut run = Run::released(&ramp());
    run.after(1, BRAKED);
    assert_eq!(run.after(49, ROLLING), State::Release);
    assert_eq!(run.after(1, ROLLING), State::Cool);
    // A vehicle that hardly moves tells no slip.
    let mut run = Run::released(&ramp());
    assert_eq!(
        run.after(1, at_speed(unknown(), LOCK_SPEED_M_S)),
        State::Release
    );
    assert_eq!(
        run.after(1, at_speed(unknown(), below(LOCK_SPEED_M_S))),
        State::Cool
    );
}

#[test]
fn applications_follow_each_other_after_a_pause_until_all_are_made() {
    let mut run = Run::cooling(&ramp());
    assert_eq!(run.after(499, BRAKED), State::Cool);
    // What has rolled while it cooled does not count.
    assert_eq!(run.after(1, ROLLING), State::SpinUp);
    run.ramps();
    assert_eq!(run.after(1, unknown()), State::Release);
    assert_eq!(run.after(50, ROLLING), State::Cool);
    assert_eq!(run.after(499, ROLLING), State::Cool);
    assert_eq!(run.after(1, ROLLING), State::Done);
    assert_eq!(run.after(100, ROLLING), State::Done);
    assert_eq!(run.after(1, stopped(ROLLING)), State::Idle);
    // A second run counts anew.
    run.sequence.arm().unwrap();
    run.sequence.start(&ramp()).unwrap();
    run.ramps();
    assert_eq!(run.after(1, unknown()), State::Release);
    assert_eq!(run.after(50, ROLLING), State::Cool);
    assert_eq!(run.after(500, ROLLING), State::SpinUp);
}

#[test]
fn a_stop_while_cooling_ends_the_run() {
    let mut run = Run::cooling(&ramp());
    assert_eq!(run.after(1, stopped(ROLLING)), State::Done);
}
