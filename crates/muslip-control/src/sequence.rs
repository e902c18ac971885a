//! The state machine of a run.
//!
//! ```text
//! Idle -> Armed -> SpinUp -> Ramp -> Skid -> Release -> Cool -> (SpinUp | Done)        any -> Fault
//! ```
//!
//! | state | brake | entry | exit | time-out |
//! |---|---|---|---|---|
//! | `Idle` | dumped | reset; stop from `Armed`, `SpinUp` or `Done`; a fault cleared | `Arm`, with no interlock standing | none |
//! | `Armed` | dumped | `Arm` | `Start` -> `SpinUp`; `Stop` -> `Idle` | 60 s -> `Idle` |
//! | `SpinUp` | dumped | `Start`; after a pause | start speed, and slip within ±0.05 for 0.2 s -> `Ramp` | 120 s -> `Fault(Timeout)` |
//! | `Ramp` | by the program | speed reached | slip at the profile's skid slip -> `Skid`; program over, `Stop`, slip without a meaning, or vehicle below 5 m/s -> `Release` | the program's length |
//! | `Skid` | holds what it had | skid slip | after the profile's hold, `Stop`, slip without a meaning, or vehicle below 5 m/s -> `Release` | 0.15 s at most |
//! | `Release` | dumped | above | slip within ±0.05 for 50 ms, or vehicle below 5 m/s -> `Cool` | 1 s -> `Fault(Timeout)` |
//! | `Cool` | dumped | wheel rolls | after the pause: more to do -> `SpinUp`, else -> `Done`; `Stop` -> `Done` | the profile's pause |
//! | `Done` | dumped | all applications made | `Arm` -> `Armed`; `Stop` -> `Idle` | none |
//! | `Fault` | dumped | any interlock while not `Idle` or `Done` | `ClearFault` with its cause gone, and the button at the rig pressed since -> `Idle` | none |
//!
//! Interlocks stand in every state; they latch from `Armed` to `Cool`, where the brake may be at work, and
//! forbid arming elsewhere. A brake demand exists in `Ramp` and `Skid` only.

use muslip_record::{Fault, Profile, Program, State};

use crate::interlock::{LOCK_SPEED_M_S, ROLLING_SLIP};
use crate::number::{nearest, whole_u16};
use crate::rates::Rates;

const ARMED_MS: u32 = 60_000;
const SPIN_UP_MS: u32 = 120_000;
const ROLLING_MS_BEFORE_RAMP: u32 = 200;
const ROLLING_MS_AFTER_RELEASE: u32 = 50;
const RELEASE_MS: u32 = 1_000;

/// What moves the machine on at a sample.
#[derive(Debug, Clone, Copy)]
pub struct Observed {
    /// Slip; none where it has no meaning.
    pub slip_ratio: Option<f32>,
    /// Vehicle speed in m/s.
    pub vehicle_speed_m_s: f32,
    /// The host asked to stop.
    pub stop: bool,
}

/// The machine.
#[derive(Debug, Clone, Copy)]
pub struct Sequence {
    rates: Rates,
    state: State,
    fault: Option<Fault>,
    profile: Option<Profile>,
    samples: u32,
    rolling_samples: u32,
    applications: u8,
    timed_out: bool,
    held_demand: f32,
}

impl Sequence {
    /// Idle.
    #[must_use]
    pub const fn new(rates: Rates) -> Self {
        Self {
            rates,
            state: State::Idle,
            fault: None,
            profile: None,
            samples: 0,
            rolling_samples: 0,
            applications: 0,
            timed_out: false,
            held_demand: 0.0,
        }
    }

    /// Where it is.
    pub fn state(&self) -> State {
        self.state
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// True once a state has lasted too long; cleared by [`Sequence::clear`].
    pub fn timed_out(&self) -> bool {
        self.timed_out
    }

    /// Whether interlocks latch in this state.
    pub fn is_engaged(&self) -> bool {
        !matches!(self.state, State::Idle | State::Done | State::Fault)
    }

    /// Whether nothing runs: parameters and zeros may change.
    pub fn is_at_rest(&self) -> bool {
        matches!(self.state, State::Idle | State::Done)
    }

    /// Latches a fault, in any state.
    pub fn fail(&mut self, fault: Fault) {
        self.fault = Some(fault);
        self.enter(State::Fault);
    }

    /// Idle or done to armed.
    ///
    /// # Errors
    /// The present state, where it is another.
    pub fn arm(&mut self) -> Result<(), State> {
        if !self.is_at_rest() {
            return Err(self.state);
        }
        self.enter(State::Armed);
        Ok(())
    }

    /// Armed to a run of a checked profile.
    ///
    /// # Errors
    /// The present state, where it is another.
    pub fn start(&mut self, profile: &Profile) -> Result<(), State> {
        if self.state != State::Armed {
            return Err(self.state);
        }
        self.profile = Some(*profile);
        self.applications = 0;
        self.enter(State::SpinUp);
        Ok(())
    }

    /// Fault to idle; the caller has seen that the cause is gone.
    ///
    /// # Errors
    /// The present state, where it is another.
    pub fn clear(&mut self) -> Result<(), State> {
        if self.state != State::Fault {
            return Err(self.state);
        }
        self.fault = None;
        self.timed_out = false;
        self.enter(State::Idle);
        Ok(())
    }

    /// Moves on by a sample and answers the share of full pressure to demand. `slip_hold` makes the demand
    /// of a program that holds slip, from target and seconds into it.
    pub fn step(&mut self, observed: &Observed, slip_hold: impl FnOnce(f32) -> f32) -> f32 {
        self.samples = self.samples.saturating_add(1);
        let rolls = observed
            .slip_ratio
            .is_some_and(|slip| slip.abs() <= ROLLING_SLIP);
        self.rolling_samples = if rolls { self.rolling_samples + 1 } else { 0 };
        let slow = observed.vehicle_speed_m_s < LOCK_SPEED_M_S;
        let Some(profile) = self.profile.filter(|_| self.state > State::Armed) else {
            if self.state == State::Armed && (observed.stop || self.lasts(ARMED_MS)) {
                self.enter(State::Idle);
            }
            return 0.0;
        };
        match self.state {
            State::SpinUp => {
                if observed.stop {
                    self.enter(State::Idle);
                } else if observed.vehicle_speed_m_s >= profile.start_speed_m_s
                    && self.rolling_samples >= self.rates.samples(ROLLING_MS_BEFORE_RAMP)
                {
                    self.enter(State::Ramp);
                } else if self.lasts(SPIN_UP_MS) {
                    self.timed_out = true;
                }
            }
            State::Ramp => {
                let into_s = self.seconds();
                let demand = match &profile.program {
                    Program::Ramp { demand_per_s } => Some((demand_per_s * into_s).min(1.0))
                        .filter(|_| into_s * demand_per_s < 1.5),
                    Program::Steps {
                        levels,
                        count,
                        hold_s,
                    } => levels
                        .iter()
                        .take(usize::from(*count))
                        .nth(usize::from(whole_u16(into_s / hold_s)))
                        .copied(),
                    Program::SlipHold {
                        target_slip,
                        hold_s,
                    } => (into_s < *hold_s).then(|| slip_hold(*target_slip)),
                };
                // Slip that nobody knows may be any: the brake must not go on rising on it.
                let skids = observed.slip_ratio.map(|slip| slip >= profile.skid_slip);
                match (demand, skids) {
                    (Some(demand), Some(skids)) if !observed.stop && !slow => {
                        self.held_demand = demand;
                        if skids {
                            self.enter(State::Skid);
                        }
                        return demand;
                    }
                    _ => self.enter(State::Release),
                }
            }
            State::Skid => {
                let unknown = observed.slip_ratio.is_none();
                if observed.stop || slow || unknown || self.seconds() > profile.skid_hold_s {
                    self.enter(State::Release);
                } else {
                    return self.held_demand;
                }
            }
            State::Release => {
                if slow || self.rolling_samples >= self.rates.samples(ROLLING_MS_AFTER_RELEASE) {
                    self.applications = self.applications.saturating_add(1);
                    self.enter(State::Cool);
                } else if self.lasts(RELEASE_MS) {
                    self.timed_out = true;
                }
            }
            State::Cool => {
                if observed.stop {
                    self.enter(State::Done);
                } else if self.seconds() >= profile.cool_s {
                    if self.applications < profile.applications {
                        self.enter(State::SpinUp);
                    } else {
                        self.enter(State::Done);
                    }
                }
            }
            State::Done => {
                if observed.stop {
                    self.enter(State::Idle);
                }
            }
            State::Idle | State::Armed | State::Fault => {}
        }
        0.0
    }

    /// Seconds in this state.
    fn seconds(&self) -> f32 {
        nearest(self.samples) * self.rates.sample_s()
    }

    /// Whether this state has lasted longer than so many ms.
    fn lasts(&self, ms: u32) -> bool {
        self.samples > self.rates.samples(ms)
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.samples = 0;
        self.rolling_samples = 0;
    }
}
