//! The same controller on boards that sample and stamp at other rates.

use muslip_control::board::BridgeQuality;
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::Identity;
use muslip_control::rates::Rates;
use muslip_record::{Answer, Command, Fault, State, Telemetry};

use crate::bench::{Bench, IDENTITY, RAMP};

const BOARDS: [Rates; 4] = [
    Rates::new(1_000, 84_000_000),
    Rates::new(1_000, 170_000_000),
    Rates::new(500, 84_000_000),
    Rates::new(250, 1_000_000),
];

fn on(rates: Rates) -> Bench {
    Bench::with(Identity { rates, ..IDENTITY })
}

/// So many ms.
fn wait(bench: &mut Bench, ms: u32) {
    bench.run(ms * bench.rates.sample_hz() / 1_000);
}

#[test]
fn a_run_takes_the_same_time_and_reads_the_same_speeds_at_all_rates() {
    for rates in BOARDS {
        let mut bench = on(rates);
        bench.start(RAMP);
        let (mut samples, mut demand) = (0, 0.0);
        while bench.state() != State::Ramp {
            bench.run(1);
            samples += 1;
            assert!(samples < 1_000, "{rates:?}");
        }
        // Rolling freely for 0.2 s, most of it since before the start.
        assert!(
            samples * 1_000 <= 250 * rates.sample_hz(),
            "{rates:?} {samples}"
        );
        wait(&mut bench, 400);
        for message in &bench.heard {
            if let Telemetry::Sample(sample) = message {
                demand = sample.brake_demand;
            }
        }
        // Half of full pressure a second.
        assert!((demand - 0.2).abs() < 0.005, "{rates:?} {demand}");
        let Some(Telemetry::Sample(sample)) = bench
            .heard
            .iter()
            .rev()
            .find(|message| matches!(message, Telemetry::Sample(_)))
        else {
            panic!("no sample");
        };
        // A tick of a microsecond is a thousandth of what passes between two pulses.
        assert!((sample.vehicle_speed_m_s - 20.0).abs() < 0.05, "{sample:?}");
        assert!((sample.wheel_speed_rad_s - 64.5).abs() < 0.2, "{sample:?}");
        let hello = hello(&mut bench);
        assert_eq!(hello, rates.sample_hz());
    }
}

fn hello(bench: &mut Bench) -> u32 {
    bench.say(Command::Hello);
    let told = bench.heard.iter().rev().find_map(|message| match message {
        Telemetry::Hello(hello) => Some(hello.sample_rate_hz),
        _ => None,
    });
    told.unwrap()
}

#[test]
fn a_silent_host_a_locked_wheel_and_a_bad_bridge_dump_within_the_same_time_at_all_rates() {
    for rates in BOARDS {
        let braking = || {
            let mut bench = on(rates);
            bench.start(RAMP);
            wait(&mut bench, 400);
            assert!(bench.output.hold_pressure, "{rates:?}");
            bench
        };
        let mut bench = braking();
        bench.rig.quality = BridgeQuality::Bad;
        bench.run(1);
        assert_eq!(bench.output, BrakeOutput::DUMPED);

        let mut bench = braking();
        bench.say(Command::KeepAlive);
        bench.keep_alive = false;
        let dumped = (1..).find(|_| {
            bench.run(1);
            bench.output == BrakeOutput::DUMPED
        });
        assert_eq!(bench.controller.fault(), Some(Fault::LinkSilent));
        assert_eq!(dumped, Some(rates.samples(250) + 1));

        let mut bench = on(rates);
        bench.run(20);
        bench.rig.emergency_stop = [true, false];
        wait(&mut bench, 96);
        let stands = 1 << Fault::StopChannels as u32;
        assert_eq!(bench.status().standing & stands, 0);
        wait(&mut bench, 12);
        assert!(bench.status().standing & stands != 0, "{rates:?}");
    }
}

#[test]
fn armed_without_a_start_is_idle_again_after_60_s_at_all_rates() {
    for rates in BOARDS {
        let mut bench = on(rates);
        bench.run(50);
        assert_eq!(bench.say(Command::Arm), Answer::Done);
        wait(&mut bench, 59_500);
        assert_eq!(bench.state(), State::Armed);
        wait(&mut bench, 1_000);
        assert_eq!(bench.state(), State::Idle, "{rates:?}");
    }
}
