//! Every fault that a rig or a link can have, injected while the brake is at work.

use std::path::Path;

use anyhow::{Result, ensure};
use muslip_control::board::BridgeQuality;
use muslip_control::brake::BrakeOutput;
use muslip_control::interlock::{LOCK_TIME_S, SILENT_MS};
use muslip_record::{Command, Fault, Parameters, Profile, Program, State};

use super::{CYCLES_PER_SAMPLE, Found, LAW, RAMP};
use crate::bench::{Bench, Worst};
use crate::rig::Trouble;

/// One fault and how it comes about.
struct Injection {
    fault: Fault,
    inject: fn(&mut Bench),
    /// Whether its condition, as the interlock states it, held at the last sample; judged from what the simulator
    /// gave, not from what the image said.
    holds: fn(&mut Bench) -> bool,
    /// Samples from the first on which it held to the one that dumped the brake, both counted.
    samples: u32,
}

impl Injection {
    /// A fault whose condition holds from the next sample on, and must dump the brake there.
    const fn at_once(fault: Fault, inject: fn(&mut Bench)) -> Self {
        Self {
            fault,
            inject,
            holds: |_| true,
            samples: 1,
        }
    }
}

fn trouble(bench: &mut Bench, change: impl FnOnce(&mut Trouble)) {
    change(&mut bench.rig.trouble);
}

/// All faults that a rig or a link can have; watchdog and clock are what a chip finds when it starts, and are tested
/// natively.
fn injections() -> Vec<Injection> {
    let at_once = Injection::at_once;
    vec![
        at_once(Fault::EmergencyStop, |b| {
            trouble(b, |t| t.emergency_stop = [true; 2])
        }),
        at_once(Fault::EmergencyStop, |b| {
            trouble(b, |t| t.emergency_stop = [false, true])
        }),
        // Its second sample: a pin needs a moment.
        Injection {
            samples: 2,
            ..at_once(Fault::DumpOutput, |b| trouble(b, |t| t.holds = Some(false)))
        },
        // The 25th time that a code is the same; the first is the sample before.
        Injection {
            samples: 24,
            ..at_once(Fault::BridgeFrozen, |b| trouble(b, |t| t.drag_stuck = true))
        },
        // A contact that chatters: the third jump.
        Injection {
            holds: |b| b.raw.bridge.codes[0] > CHATTER_CODE,
            samples: 3,
            ..at_once(Fault::BridgeOutOfRange, |b| {
                trouble(b, |t| t.drag_chatters = true)
            })
        },
        at_once(Fault::BridgeLost, |b| {
            trouble(b, |t| t.bridge = BridgeQuality::Bad)
        }),
        at_once(Fault::BridgeFrozen, |b| {
            trouble(b, |t| t.bridge = BridgeQuality::Stale)
        }),
        // The fifth time that the codes are the same; the first is the sample before.
        Injection {
            samples: 4,
            ..at_once(Fault::BridgeFrozen, |b| {
                trouble(b, |t| t.bridge_frozen = true)
            })
        },
        at_once(Fault::BridgeOutOfRange, |b| {
            trouble(b, |t| t.drag_offset_n = 20_000.0)
        }),
        at_once(Fault::NormalForceLost, |b| trouble(b, |t| t.lifted = true)),
        at_once(Fault::BrownOut, |b| trouble(b, |t| t.supply_v = Some(19.9))),
        at_once(Fault::WheelSensorLost, |b| {
            trouble(b, |t| t.wheel_lost = true)
        }),
        at_once(Fault::VehicleSensorLost, |b| {
            trouble(b, |t| t.vehicle_lost = true)
        }),
        // 20 more pulses in a millisecond are 250 rad/s.
        at_once(Fault::Overspeed, |b| {
            trouble(b, |t| t.extra_wheel_pulses = 20)
        }),
        at_once(Fault::WheelSensorOutOfRange, |b| {
            trouble(b, |t| t.extra_wheel_pulses = 5)
        }),
        at_once(Fault::VehicleSensorOutOfRange, |b| {
            trouble(b, |t| t.extra_vehicle_pulses = 2)
        }),
        Injection {
            holds: |b| b.host.silent_samples() > u64::from(SILENT_MS),
            ..at_once(Fault::LinkSilent, |b| b.host.alive = false)
        },
        // Burnt in this sample, which only its end can tell: dumped on the next.
        Injection {
            samples: 2,
            ..at_once(Fault::DeadlineMissed, |b| {
                b.burn = CYCLES_PER_SAMPLE + 1_000
            })
        },
        // The wire says the same over and over: nobody's word.
        Injection {
            holds: |b| b.host.silent_samples() > u64::from(SILENT_MS),
            ..at_once(Fault::LinkSilent, |b| b.host.repeats = true)
        },
        Injection {
            holds: |b| b.brake_energy_j > BEARS_J,
            ..at_once(Fault::BrakeHot, |_| {})
        },
        // A brake that grabs: the wheel needs some 40 ms to stop and may then stand for 200.
        Injection {
            holds: |b| b.rig.wheel_pulse_age_s() > f64::from(LOCK_TIME_S),
            ..at_once(Fault::WheelLocked, |b| {
                trouble(b, |t| t.stuck_brake_nm = Some(2_500.0))
            })
        },
        // The same with an encoder that stands on an edge and shakes.
        Injection {
            holds: |b| {
                let locked = b.rig.slip_ratio() >= 1.0;
                trouble(b, |t| t.wheel_rocks = locked);
                b.rig.wheel_pulse_age_s() > f64::from(LOCK_TIME_S)
            },
            ..at_once(Fault::WheelLocked, |b| {
                trouble(b, |t| t.stuck_brake_nm = Some(2_500.0))
            })
        },
        // A drag that is off in either direction, by less than its own interlocks see: five of six readings are left
        // out and one is believed, until 50 more were left out than taken. No demand there, the fault on the next.
        Injection {
            samples: 74,
            ..at_once(Fault::EstimatorFault, |b| {
                trouble(b, |t| t.drag_swings_n = 3_500.0)
            })
        },
        at_once(Fault::PressureLost, |b| {
            trouble(b, |t| t.pressure_v = Some(0.1))
        }),
        // More than the valves were ever told, for the tenth time.
        Injection {
            samples: 10,
            ..at_once(Fault::PressureWrong, |b| {
                trouble(b, |t| t.pressure_v = Some(2.0))
            })
        },
    ]
}

/// Half of what a chattering contact adds to the drag, as a code.
const CHATTER_CODE: i32 = 2_500_000;

/// Energy in J of a ramp's first quarter of a second.
const BEARS_J: f64 = 1_000.0;

/// A run in which a fault can come: with a brake that bears little, or with a filter whose word counts.
fn begin(fault: Fault, bench: &mut Bench) -> Result<()> {
    if fault == Fault::BrakeHot {
        let mut parameters = Parameters::default();
        parameters.brake_heat.maximum_energy_j = BEARS_J as f32;
        bench.run(50)?;
        bench.set_parameters(parameters)?;
    }
    bench.begin(Profile {
        program: if fault == Fault::EstimatorFault {
            Program::SlipHold {
                target_slip: 0.05,
                hold_s: 5.0,
            }
        } else {
            Program::Ramp { demand_per_s: 0.2 }
        },
        // The skid that ends a ramp would end a lock as well.
        skid_slip: 1.0,
        ..RAMP
    })
}

/// Every fault dumps the brake on the sample on which its condition holds, and latches.
pub fn interlocks(image: &Path) -> Result<Found> {
    let mut worst = Worst::default();
    let mut lines = Vec::new();
    for injection in injections() {
        let fault = injection.fault;
        let mut bench = Bench::start(image, LAW, 4)?;
        begin(fault, &mut bench)?;
        bench.until(State::Ramp, 1_000)?;
        bench.run(200)?;
        ensure!(
            bench.brake.hold_pressure,
            "{fault:?}: the brake is not at work"
        );
        (injection.inject)(&mut bench);
        let (mut all, mut held) = (0, 0);
        while bench.brake.hold_pressure {
            bench.sample()?;
            bench.burn = 0;
            all += 1;
            held += u32::from((injection.holds)(&mut bench) || held > 0);
            ensure!(all < 500, "{fault:?}: the brake is not dumped");
        }
        ensure!(bench.brake == BrakeOutput::DUMPED);
        bench.rig.trouble = Trouble::default();
        (bench.host.alive, bench.host.repeats) = (true, false);
        bench.run(50)?;
        ensure!(bench.brake == BrakeOutput::DUMPED, "the dump does not last");
        bench.must(Command::ReadStatus)?;
        let latched = bench.host.heard.status.and_then(|status| status.fault);
        ensure!(
            latched == Some(fault),
            "{fault:?} injected, {latched:?} latched"
        );
        ensure!(
            held == injection.samples,
            "{fault:?}: dumped after {held} samples of its condition, {all} after its cause"
        );
        lines.push(format!("{fault:?} {held} ({all})"));
        worst = worst.most(bench.worst);
    }
    Ok(Found {
        line: format!(
            "samples from the condition (from its cause) to the dump: {}",
            lines.join(", ")
        ),
        worst,
    })
}
