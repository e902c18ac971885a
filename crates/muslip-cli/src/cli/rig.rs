//! `muslip rig`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::{Args, Subcommand};
use muslip::sample::slip_ratio;
use muslip_record::{
    Command, Estimating, Estimator, Event, Fault, Origin, Parameters, Profile, Program, STEPS,
    State, Status, Telemetry,
};
use muslip_recordings::input_error::one_line;
use muslip_recordings::model_file::ModelFile;

use super::failure::Failure;
use super::rig_view::{LiveView, Seen};
use super::terminal::Terminal;
use crate::rig_link::{
    Live, Port, Recorder, RigError, Session, compensated, parse_parameters, write_parameters,
};

/// Operate a rig: set its parameters, record it, run a brake profile.
///
/// The controller releases the brake when it has heard nothing from this program for 0.25 s: killing the program
/// stops the run. Wiring and commissioning: docs/rig.md.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip rig --port /dev/ttyUSB0 status\n  \
muslip rig --port /dev/ttyUSB0 tare\n  \
muslip rig --port /dev/ttyUSB0 parameters > rig-parameters.toml\n  \
muslip rig --port /dev/ttyUSB0 parameters --set rig-parameters.toml\n  \
muslip rig --port /dev/ttyUSB0 parameters --model found/model.toml\n  \
muslip rig --port /dev/ttyUSB0 record --seconds 5 --out rolling.csv\n  \
muslip rig --port /dev/ttyUSB0 run --ramp 0.5 --applications 3 --out run.csv\n  \
muslip rig --port tcp:127.0.0.1:4500 run --slip 0.1 --hold 2 --out hold.csv")]
pub(super) struct Arguments {
    /// Serial port of the controller, tcp:HOST:PORT or unix:PATH.
    #[arg(long)]
    port: String,
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Print state, fault, what prevents arming, estimator, brake energy, worst cycles, stack, last reset and the
    /// link's counters.
    Status,
    /// Zero the load cells, with the rig at rest and the tyre lifted.
    Tare,
    /// Reset a latched fault whose cause has been removed.
    Clear,
    /// Print the parameters. `--set` sets all of them from a file, `--model` only what the estimate compensates.
    Parameters {
        /// File to set them from (TOML, as printed).
        #[arg(long, value_name = "PARAMETERS.toml")]
        set: Option<PathBuf>,
        /// Repaired model from muslip diagnose: the controller compensates what it can of it, in place of what it
        /// compensated before.
        #[arg(long, value_name = "MODEL.toml")]
        model: Option<PathBuf>,
    },
    /// Record without arming, the brake released, and print the means: for force scales, encoders, the rolling radius.
    Record(Record),
    /// Arm, run a brake profile and record it.
    Run(Run),
}

#[derive(Debug, Args)]
struct Record {
    /// How long, in s; an interrupt ends it earlier and keeps the recording.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    seconds: f64,
    /// File for the recording, written row by row.
    #[arg(long, value_name = "RUN.csv")]
    out: PathBuf,
}

#[derive(Debug, Args)]
struct Run {
    /// Pressure ramp, as a share of full pressure per second, until the wheel skids.
    #[arg(long, value_name = "SHARE/S", group = "program")]
    ramp: Option<f32>,
    /// Pressure steps, as shares of full pressure, one after the other; at most eight.
    #[arg(long, value_name = "SHARES", value_delimiter = ',', group = "program", num_args = 1..)]
    steps: Option<Vec<f32>>,
    /// Hold this slip.
    #[arg(long, value_name = "SLIP", group = "program")]
    slip: Option<f32>,
    /// Hold time of each step, or of the slip, in s.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    hold: f32,
    /// Vehicle speed at which the brake is applied, in m/s.
    #[arg(long, value_name = "M/S", default_value_t = 15.0)]
    start_speed: f32,
    /// Slip from which the wheel counts as skidding.
    #[arg(long, value_name = "SLIP", default_value_t = 0.5)]
    skid_slip: f32,
    /// Hold time of a skid in s, at most 0.15.
    #[arg(long, value_name = "S", default_value_t = 0.05)]
    skid_hold: f32,
    /// Brake applications.
    #[arg(long, value_name = "N", default_value_t = 1)]
    applications: u8,
    /// Pause after each application in s.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    cool: f32,
    /// File for the recording, written row by row during the run.
    #[arg(long, value_name = "RUN.csv")]
    out: PathBuf,
}

impl From<RigError> for Failure {
    fn from(error: RigError) -> Self {
        Self::Usage(one_line(&error.to_string()))
    }
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    // Files first: nothing is asked of a rig that a bad file will end.
    let parameters = match &arguments.action {
        Action::Parameters {
            set: Some(path), ..
        } => Some(parse_parameters(path)?),
        _ => None,
    };
    let model = match &arguments.action {
        Action::Parameters {
            model: Some(path), ..
        } => Some(Live::new(&ModelFile::read(path)?.repaired)),
        _ => None,
    };
    let profile = match &arguments.action {
        Action::Run(run) => Some(profile(run)?),
        _ => None,
    };
    if let Action::Record(Record { seconds, .. }) = arguments.action
        && (seconds.is_nan() || seconds <= 0.0)
    {
        return Err(Failure::Usage(format!(
            "--seconds {seconds}: must be positive"
        )));
    }
    let port = Port::open(&arguments.port)
        .map_err(|error| Failure::Usage(one_line(&error.to_string())))?;
    let (mut session, hello) = Session::open(port)?;
    match &arguments.action {
        Action::Status => {
            if hello.emulated {
                terminal.line("emulated controller: sensors and brake are simulated")?;
            }
            let status = status(&mut session)?;
            print_status(&status, terminal)
        }
        Action::Tare => {
            session.ask("tare", Command::Tare, |_| {})?;
            let mut tared = false;
            let start = Instant::now();
            while !tared && start.elapsed() < Duration::from_secs(5) {
                session.listen(|message| {
                    tared |= matches!(
                        message,
                        Telemetry::Event {
                            event: Event::Tared,
                            ..
                        }
                    );
                })?;
            }
            if !tared {
                return Err(RigError::Silent.into());
            }
            let parameters = read_parameters(&mut session)?;
            terminal.line(&format!(
                "zero codes: drag {}, normal force {}",
                parameters.drag.zero_code, parameters.normal.zero_code
            ))
        }
        Action::Clear => {
            session.ask("clear the fault", Command::ClearFault, |_| {})?;
            terminal.line("fault cleared")
        }
        Action::Parameters { .. } => {
            if parameters.is_some() || model.is_some() {
                return set_parameters(parameters, model.as_ref(), &mut session, terminal);
            }
            let text = write_parameters(&read_parameters(&mut session)?)
                .map_err(|error| Failure::Internal(error.to_string()))?;
            terminal.line(text.trim_end())
        }
        Action::Record(what) => record(what, hello.sample_rate_hz, &mut session, terminal),
        Action::Run(what) => match profile {
            Some(profile) => brake(what, profile, hello.sample_rate_hz, &mut session, terminal),
            None => Ok(()),
        },
    }
}

/// Sets parameters from a file or those that the rig has, with what a model compensates in them.
fn set_parameters(
    parameters: Option<Parameters>,
    model: Option<&Live>,
    session: &mut Session,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    let mut parameters = match parameters {
        Some(parameters) => parameters,
        None => read_parameters(session)?,
    };
    if let Some(model) = model {
        parameters.compensation = model.parameters(parameters.wheel.effective_radius_m);
        for line in model.in_words() {
            terminal.line(&line)?;
        }
    }
    let command = Command::SetParameters { parameters };
    session.ask("accept the parameters", command, |_| {})?;
    terminal.line("parameters accepted and stored")
}

fn profile(run: &Run) -> Result<Profile, Failure> {
    let program = match (run.ramp, &run.steps, run.slip) {
        (Some(demand_per_s), None, None) => Program::Ramp { demand_per_s },
        (None, Some(steps), None) => {
            let mut levels = [0.0; STEPS];
            if steps.len() > STEPS {
                return Err(Failure::Usage(format!("more than {STEPS} steps")));
            }
            for (level, &step) in levels.iter_mut().zip(steps) {
                *level = step;
            }
            Program::Steps {
                levels,
                count: steps.len() as u8,
                hold_s: run.hold,
            }
        }
        (None, None, Some(target_slip)) => Program::SlipHold {
            target_slip,
            hold_s: run.hold,
        },
        _ => {
            return Err(Failure::Usage(
                "one of --ramp, --steps and --slip is needed".to_owned(),
            ));
        }
    };
    Ok(Profile {
        program,
        start_speed_m_s: run.start_speed,
        skid_slip: run.skid_slip,
        skid_hold_s: run.skid_hold,
        applications: run.applications,
        cool_s: run.cool,
    })
}

fn status(session: &mut Session) -> Result<Status, RigError> {
    let mut found = None;
    session.ask("report its status", Command::ReadStatus, |message| {
        if let Telemetry::Status(status) = message {
            found = Some(*status);
        }
    })?;
    found.ok_or(RigError::Silent)
}

fn read_parameters(session: &mut Session) -> Result<Parameters, RigError> {
    let mut found = None;
    session.ask(
        "report its parameters",
        Command::ReadParameters,
        |message| {
            if let Telemetry::Parameters(parameters) = message {
                found = Some(*parameters);
            }
        },
    )?;
    found.ok_or(RigError::Silent)
}

fn print_status(status: &Status, terminal: &mut Terminal) -> Result<(), Failure> {
    let fault = status
        .fault
        .map_or_else(|| "none".to_owned(), |fault| format!("{fault:?}"));
    let link = &status.link;
    terminal.table(&[
        ("state", format!("{:?}", status.state)),
        ("fault", fault),
        ("active interlocks", standing(status.standing)),
        (
            "parameters",
            match status.parameters {
                Origin::Stored => "stored",
                Origin::Unstored => "set, but not stored",
                Origin::Previous => "those before the last set, which are damaged: set them again",
                Origin::BuiltIn => "none of this rig: set them",
            }
            .to_owned(),
        ),
        ("estimator", estimating(&status.estimating)),
        ("frames received", link.received.to_string()),
        (
            "frames corrupt, oversized, foreign",
            format!("{}, {}, {}", link.corrupt, link.oversized, link.foreign),
        ),
        (
            "frames repeated, lost; bytes overrun",
            format!("{}, {}, {}", link.duplicate, link.lost, link.overrun_bytes),
        ),
        ("telemetry dropped", link.dropped.to_string()),
        (
            "worst cycles: sampling, link's byte, step",
            format!(
                "{}, {}, {}",
                status.worst_interrupt_cycles,
                status.worst_link_interrupt_cycles,
                status.worst_step_cycles
            ),
        ),
        (
            "energy in the brake",
            format!("{:.1} kJ", f64::from(status.brake_energy_j) * 1e-3),
        ),
        ("last end of the program", end(status)),
        (
            "deepest stack",
            format!("{} bytes", status.stack_used_bytes),
        ),
    ])
}

/// Which estimator runs, and on samples compensated for what.
fn estimating(estimating: &Estimating) -> String {
    let estimator = match estimating.estimator {
        Estimator::Efficient => "efficient",
        Estimator::Article => "article",
    };
    let names: Vec<&str> = compensated(estimating.compensated).collect();
    if names.is_empty() {
        format!("{estimator}, nothing compensated")
    } else {
        format!("{estimator}, compensated: {}", names.join(", "))
    }
}

fn end(status: &Status) -> String {
    let flags = status.reset_flags;
    match &status.end {
        None => format!("none; reset flags {flags:#04x}"),
        Some(end) => format!(
            "{:?} at {:#010x} from {:#010x}, CFSR {:#010x}, HFSR {:#010x}, address {:#010x}, in {:?}, sample {}; reset flags {flags:#04x}",
            end.end,
            end.program_counter,
            end.link_register,
            end.fault_status,
            end.hard_fault_status,
            end.address,
            end.state,
            end.tick
        ),
    }
}

fn standing(bits: u32) -> String {
    let names: Vec<String> = Fault::ALL
        .into_iter()
        .filter(|&fault| bits & (1 << fault as u8) != 0)
        .map(|fault| format!("{fault:?}"))
        .collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

/// Longest wait for a sample, s.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

fn record(
    what: &Record,
    sample_rate_hz: u32,
    session: &mut Session,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    let radius = f64::from(read_parameters(session)?.wheel.effective_radius_m);
    let origin = ["recorded: muslip rig record".to_owned()];
    let mut recorder = Recorder::create(&what.out, &origin, sample_rate_hz)?;
    let wanted = (what.seconds * f64::from(sample_rate_hz)).ceil() as u64;
    let (mut seen, mut view) = (Seen::default(), LiveView::new());
    let (mut sums, mut written, mut heard) = ([0.0; 4], Ok(()), Instant::now());
    // Samples that never came count: it lasts as long as was asked for.
    let ended = |recorder: &Recorder| recorder.counts().0 + recorder.counts().1 >= wanted;
    while written.is_ok() && !ended(&recorder) {
        session.listen(|message| match message {
            Telemetry::Sample(sample) if written.is_ok() && !ended(&recorder) => {
                seen.sample = Some(*sample);
                heard = Instant::now();
                let before = recorder.counts().0;
                written = recorder.add(sample);
                if recorder.counts().0 > before {
                    let measured = [
                        sample.wheel_speed_rad_s,
                        sample.vehicle_speed_m_s,
                        sample.drag_force_n,
                        sample.normal_force_n,
                    ];
                    for (sum, value) in sums.iter_mut().zip(measured) {
                        *sum += f64::from(value);
                    }
                }
            }
            Telemetry::Estimate(estimate) => seen.estimate = Some(*estimate),
            _ => {}
        })?;
        view.show(&seen);
        if heard.elapsed() > LONGEST_WAIT {
            return Err(RigError::Silent.into());
        }
    }
    written?;
    drop(view);
    tell_counts(&what.out, &recorder, session, terminal)?;
    let rows = recorder.counts().0 as f64;
    let [wheel, vehicle, drag, normal] = sums.map(|sum| sum / rows);
    let slip = slip_ratio(wheel, vehicle, radius);
    terminal.table(&[
        ("mean wheel speed", format!("{wheel:.3} rad/s")),
        ("mean vehicle speed", format!("{vehicle:.4} m/s")),
        (
            "slip of these",
            slip.map_or_else(|| "none".to_owned(), |slip| format!("{slip:.4}")),
        ),
        ("mean drag", format!("{drag:.2} N")),
        ("mean normal force", format!("{normal:.2} N")),
    ])
}

/// Rows and losses of a recording.
fn tell_counts(
    path: &Path,
    recorder: &Recorder,
    session: &Session,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    let (rows, missing) = recorder.counts();
    let (lost, bad) = session.losses();
    terminal.line(&format!(
        "{}: {rows} rows, {missing} samples missing; {lost} frames lost, {bad} bad",
        path.display()
    ))
}

fn brake(
    run: &Run,
    profile: Profile,
    sample_rate_hz: u32,
    session: &mut Session,
    terminal: &mut Terminal,
) -> Result<(), Failure> {
    let origin = vec![format!("recorded: muslip rig run, {profile:?}")];
    session.ask("arm", Command::Arm, |_| {})?;
    session.ask("start", Command::Start { profile }, |_| {})?;
    let mut recorder = Recorder::create(&run.out, &origin, sample_rate_hz)?;
    let mut seen = Seen::default();
    let mut view = LiveView::new();
    let mut written = None;
    loop {
        session.listen(|message| match message {
            Telemetry::Sample(sample) => {
                seen.sample = Some(*sample);
                if written.is_none()
                    && sample.state > State::Armed
                    && let Err(error) = recorder.add(sample)
                {
                    written = Some(error);
                }
            }
            Telemetry::Estimate(estimate) => seen.estimate = Some(*estimate),
            Telemetry::Event {
                event: Event::Fault(fault),
                ..
            } => seen.fault = Some(*fault),
            _ => {}
        })?;
        view.show(&seen);
        if let Some(error) = written.take() {
            session.ask("stop", Command::Stop, |_| {})?;
            return Err(error.into());
        }
        let state = seen.sample.map_or(State::SpinUp, |sample| sample.state);
        if matches!(state, State::Done | State::Idle | State::Fault) {
            break;
        }
    }
    drop(view);
    tell_counts(&run.out, &recorder, session, terminal)?;
    if let Some(estimate) = seen.estimate {
        terminal.headline(&format!(
            "peak friction {:.3} ± {:.3} at slip {:.3} ± {:.3} from {} samples",
            estimate.peak_friction,
            estimate.p00.max(0.0).sqrt(),
            estimate.critical_slip,
            estimate.p11.max(0.0).sqrt(),
            estimate.updates
        ))?;
        terminal.line(&format!("estimator: {}", estimating(&estimate.estimating)))?;
    }
    let fault = match seen.fault {
        Some(fault) => Some(fault),
        None => status(session)?.fault,
    };
    match fault {
        None => Ok(()),
        Some(fault) => Err(Failure::Usage(format!(
            "fault {fault:?}: the brake was released; the recording is kept. After removing the cause: muslip rig clear"
        ))),
    }
}
