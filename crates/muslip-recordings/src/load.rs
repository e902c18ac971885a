//! From a rig file and recordings to what the engine takes.

use std::collections::HashMap;
use std::fs;
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use muslip_diagnose::campaign::{self, How, Resampled};
use muslip_diagnose::outcome::Fault;
use muslip_formats::made;
use muslip_formats::map::{Map, Method};
use muslip_formats::raster::{Done, interval_s};
use rayon::prelude::*;

use crate::input_error::{InputError, InputProblem};
use crate::recording::{Channel, Header, Memory, Recording, Required};
use crate::rig_file::RigFile;

/// Rows between two reports of progress.
const ROWS_A_REPORT: usize = 1 << 14;
/// A channel whose own interval is longer than the recording's by this factor has fewer readings than the recording has rows; below, jitter
/// alone may make it.
const COARSER_BY: f64 = 1.2;

/// The rig as the engine takes it.
#[must_use]
pub fn rig(file: &RigFile) -> campaign::Rig {
    campaign::Rig {
        radius_m: file.wheel.radius_m,
        wheel_inertia_kg_m2: file.wheel.inertia_kg_m2,
        mass_kg: file.vehicle.mass_kg,
        coasting: file.vehicle.coasting,
        torque_per_pressure_nm_pa: file.brake.map(|b| b.torque_per_pressure_nm_pa),
        peak_friction: file.tyre.peak_friction,
        critical_slip: file.tyre.critical_slip,
        law_fixed: file.tyre.fixed,
        declared_noise: file.noise.clone(),
    }
}

/// A recording as the engine takes it, and what had to be mended for that.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The columns; time is finite and strictly increasing.
    pub run: campaign::Run,
    /// Rows whose time stamp the file leaves out (it is filled in).
    pub untimed: Vec<usize>,
    /// What of the file's time cannot be used as it is.
    pub faults: Vec<Fault>,
}

impl Loaded {
    /// Times in s as the file has them: `NaN` where one was filled in, which was for a model's sake only.
    #[must_use]
    pub fn recorded_time_s(&self) -> Vec<f64> {
        let mut time_s = self.run.time_s.clone();
        for &row in &self.untimed {
            if let Some(time) = time_s.get_mut(row) {
                *time = f64::NAN;
            }
        }
        time_s
    }
}

/// Reads a whole recording.
///
/// # Errors
/// [`InputError`] as for [`Recording::open`], [`Recording::rows`] and
/// [`crate::recording::Rows::next_row`].
pub fn recording(path: &Path, required: Required) -> Result<Loaded, InputError> {
    recording_mapped(path, required, None)
}

/// As [`recording`], of a file whose channels a map names.
///
/// # Errors
/// As [`recording`], and [`Recording::open_mapped`].
pub fn recording_mapped(
    path: &Path,
    required: Required,
    map: Option<&Map>,
) -> Result<Loaded, InputError> {
    of_recording(Recording::open_mapped(path, map)?, required, &|_| {})
}

/// As [`recording`], of a recording that is open.
///
/// # Errors
/// As [`Recording::rows`] and [`crate::recording::Rows::next_row`].
pub fn opened(recording: Recording, required: Required) -> Result<Loaded, InputError> {
    of_recording(recording, required, &|_| {})
}

/// As [`recording`], without what had to be mended.
///
/// # Errors
/// As [`recording`].
pub fn run(path: &Path, required: Required) -> Result<campaign::Run, InputError> {
    recording(path, required).map(|loaded| loaded.run)
}

/// As [`recording`]; `bytes_read` receives the number of bytes read since its last call.
fn of_recording(
    mut recording: Recording,
    required: Required,
    bytes_read: &(dyn Fn(u64) + Sync),
) -> Result<Loaded, InputError> {
    let path = recording.path().to_owned();
    let name = path.display().to_string();
    let made: made::Made = recording.made().clone();
    let conversion: Vec<Fault> = made
        .faults
        .into_iter()
        .map(|fault| Fault {
            recording: name.clone(),
            channel: fault.column,
            start_s: fault.start_s,
            end_s: fault.end_s,
            what: fault.what,
        })
        .collect();
    let mut rows = recording.rows(required)?;
    let header = rows.header().clone();
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); header.names().len()];
    let mut told = 0;
    loop {
        for _ in 0..ROWS_A_REPORT {
            let Some(row) = rows.next_row()? else {
                for column in &mut columns {
                    column.shrink_to_fit();
                }
                let mut loaded = in_order(&path, &header, columns);
                let step_s = interval_s(&loaded.run.time_s).unwrap_or(f64::INFINITY);
                // A recording may have lost a column since it was converted.
                let here = made.resampled.iter();
                let here = here.filter(|one| header.names().contains(&one.column));
                let told = here.filter_map(|one| brought(one, step_s));
                loaded.run.resampled = told.collect();
                loaded.faults.extend(conversion);
                return Ok(loaded);
            };
            for (column, &value) in columns.iter_mut().zip(row.cells()) {
                column.push(value);
            }
        }
        let now = rows.bytes_read();
        bytes_read(now - told);
        told = now;
    }
}

/// What was done to a column, as the engine takes it; nothing where it has as many readings as rows.
fn brought(one: &made::Resampled, step_s: f64) -> Option<Resampled> {
    let coarser = one.interval_s > COARSER_BY * step_s;
    let how = match one.done {
        Done::Interpolated(Method::Linear) if coarser => How::Interpolated,
        Done::Interpolated(Method::Hold) if coarser => How::Held,
        Done::Decimated { edge_hz } => How::Decimated { edge_hz },
        Done::Kept | Done::Interpolated(_) => return None,
    };
    Some(Resampled {
        column: one.column.clone(),
        interval_s: one.interval_s,
        how,
    })
}

/// Hands every column to its place without copying it.
fn in_order(path: &Path, header: &Header, mut columns: Vec<Vec<f64>>) -> Loaded {
    let rows = columns.first().map_or(0, Vec::len);
    let extra = header
        .extra()
        .map(|(index, name)| (name.to_owned(), column(&mut columns, Some(index))))
        .filter_map(|(name, values)| Some((name, values?)))
        .collect();
    let mut of = |channel| column(&mut columns, header.index(channel));
    let mut needed = |channel| of(channel).unwrap_or_else(|| vec![f64::NAN; rows]);
    let mut run = campaign::Run {
        name: path.display().to_string(),
        time_s: needed(Channel::Time),
        wheel_speed_rad_s: needed(Channel::WheelSpeed),
        vehicle_speed_m_s: needed(Channel::VehicleSpeed),
        normal_force_n: needed(Channel::NormalForce),
        drag_force_n: of(Channel::DragForce).unwrap_or_default(),
        brake_torque_nm: of(Channel::BrakeTorque),
        brake_pressure_pa: of(Channel::BrakePressure),
        extra,
        resampled: Vec::new(),
    };
    let (untimed, faults) = mend_time(&mut run);
    Loaded {
        run,
        untimed,
        faults,
    }
}

fn column(columns: &mut [Vec<f64>], index: Option<usize>) -> Option<Vec<f64>> {
    columns.get_mut(index?).map(take)
}

/// Fills in missing time stamps: between two known ones in equal steps, at the ends in the step beside
/// them. Where hardly any is known, nothing measured then can be used, and all of it becomes missing.
fn mend_time(run: &mut campaign::Run) -> (Vec<usize>, Vec<Fault>) {
    let rows = run.len();
    let known: Vec<usize> = (0..rows).filter(|&k| is_time(run, k)).collect();
    if known.len() == rows {
        return (Vec::new(), Vec::new());
    }
    let untimed: Vec<usize> = (0..rows).filter(|&k| !is_time(run, k)).collect();
    let fault = |start_s: f64, end_s: f64, what: String| Fault {
        recording: run.name.clone(),
        channel: Channel::Time.name().to_owned(),
        start_s,
        end_s,
        what,
    };
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else {
        let faults = vec![fault(0.0, 0.0, "no time stamp at all".to_owned())];
        make_missing(run);
        return (untimed, faults);
    };
    if known.len() < 2 {
        let at = run.time_s[first];
        let faults = vec![fault(at, at, "a single time stamp".to_owned())];
        make_missing(run);
        return (untimed, faults);
    }
    for pair in known.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let (start, end) = (run.time_s[from], run.time_s[to]);
        for k in from + 1..to {
            let share = (k - from) as f64 / (to - from) as f64;
            run.time_s[k] = start * (1.0 - share) + end * share;
        }
    }
    let step_in = run.time_s[first + 1] - run.time_s[first];
    for k in (0..first).rev() {
        run.time_s[k] = run.time_s[k + 1] - step_in;
    }
    let step_out = run.time_s[last] - run.time_s[last - 1];
    for k in last + 1..rows {
        run.time_s[k] = run.time_s[k - 1] + step_out;
    }
    // Stamps so close (or so large) that no number lies between them cannot be filled in.
    if !run.time_s.windows(2).all(|pair| pair[0] < pair[1])
        || !run.time_s.iter().all(|t| t.is_finite())
    {
        let faults = vec![fault(
            0.0,
            0.0,
            "time stamps missing between equal ones".to_owned(),
        )];
        make_missing(run);
        return (untimed, faults);
    }
    let at = |k: Option<&usize>| k.and_then(|&k| run.time_s.get(k)).copied().unwrap_or(0.0);
    let faults = vec![fault(
        at(untimed.first()),
        at(untimed.last()),
        format!("{} time stamps missing, filled in", untimed.len()),
    )];
    (untimed, faults)
}

fn is_time(run: &campaign::Run, row: usize) -> bool {
    run.time_s.get(row).is_some_and(|t| t.is_finite())
}

/// Rows counted in seconds, and nothing measured in them.
fn make_missing(run: &mut campaign::Run) {
    run.time_s = (0..run.len()).map(|k| k as f64).collect();
    let columns = [
        &mut run.wheel_speed_rad_s,
        &mut run.vehicle_speed_m_s,
        &mut run.drag_force_n,
        &mut run.normal_force_n,
    ];
    let optional = run.brake_torque_nm.iter_mut();
    let optional = optional.chain(&mut run.brake_pressure_pa);
    let extra = run.extra.iter_mut().map(|(_, values)| values);
    for values in columns.into_iter().chain(optional).chain(extra) {
        values.fill(f64::NAN);
    }
}

/// A rig and its recordings, read.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// The rig.
    pub rig: campaign::Rig,
    /// The recordings, in the order given.
    pub runs: Vec<campaign::Run>,
    /// What had to be mended in them to be read at all.
    pub faults: Vec<Fault>,
}

/// Reads everything that a diagnosis takes, several recordings at a time; `progress` is told the share
/// of the bytes read.
///
/// # Errors
/// The first [`InputError`] in the order given, whichever recording is done first: a recording given
/// twice, then the rig file, then the recordings.
pub fn campaign(
    rig_path: &Path,
    recordings: &[PathBuf],
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Campaign, InputError> {
    campaign_mapped(rig_path, recordings, None, progress)
}

/// As [`campaign()`], of files whose channels the map at a path names, or else the rig file.
///
/// # Errors
/// As [`campaign()`]; the map comes after the rig file.
pub fn campaign_mapped(
    rig_path: &Path,
    recordings: &[PathBuf],
    map_path: Option<&Path>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Campaign, InputError> {
    refuse_twice(recordings)?;
    let rig = RigFile::read(rig_path)?;
    let map = crate::map_file::chosen(map_path, Some(rig_path))?;
    let sources: Vec<Source> = recordings.iter().cloned().map(Source::File).collect();
    campaign_of(&rig, &sources, map.as_ref(), progress)
}

/// Where a recording is.
#[derive(Debug, Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "one a recording, beside all its samples"
)]
pub enum Source {
    /// In a file of any format.
    File(PathBuf),
    /// In memory.
    Memory(Memory),
}

impl Source {
    /// Opens it; a map names the channels of a file.
    ///
    /// # Errors
    /// As [`Recording::open_mapped`].
    pub fn open(&self, map: Option<&Map>) -> Result<Recording, InputError> {
        match self {
            Self::File(path) => Recording::open_mapped(path, map),
            Self::Memory(memory) => Ok(Recording::of_memory(memory.clone())),
        }
    }

    /// The file, or the name that stands for one.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::File(path) => path,
            Self::Memory(memory) => memory.path(),
        }
    }

    /// Bytes of its file, or of its values in memory; 0 where it is no file with an end, or none at all.
    #[must_use]
    pub fn length_bytes(&self) -> u64 {
        match self {
            Self::File(path) => Recording::announced_length_bytes(path).unwrap_or(0),
            Self::Memory(memory) => Recording::of_memory(memory.clone()).length_bytes(),
        }
    }
}

/// As [`campaign()`], of recordings wherever they are, and of a rig that was read.
///
/// # Errors
/// The first [`InputError`] of the recordings in the order given.
pub fn campaign_of(
    rig_file: &RigFile,
    sources: &[Source],
    map: Option<&Map>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Campaign, InputError> {
    let total: u64 = sources.iter().map(Source::length_bytes).sum();
    let done = AtomicU64::new(0);
    let bytes_read = |bytes: u64| {
        let now = done.fetch_add(bytes, Ordering::Relaxed) + bytes;
        progress((now as f64 / total.max(1) as f64).min(1.0));
    };
    let loaded: Vec<Result<Loaded, InputError>> = sources
        .par_iter()
        .map(|source| of_recording(source.open(map)?, Required::DragIncluded, &bytes_read))
        .collect();
    let mut campaign = Campaign {
        rig: rig(rig_file),
        runs: Vec::with_capacity(loaded.len()),
        faults: Vec::new(),
    };
    for one in loaded {
        let one = one?;
        campaign.runs.push(one.run);
        campaign.faults.extend(one.faults);
    }
    campaign
        .faults
        .extend(super::optional::screen(&mut campaign.runs));
    Ok(campaign)
}

/// One file under two names would be fitted and then serve as its own proof.
///
/// # Errors
/// [`InputError`] of a file that is given a second time.
pub fn refuse_twice(recordings: &[PathBuf]) -> Result<(), InputError> {
    let mut seen: HashMap<PathBuf, &PathBuf> = HashMap::new();
    for path in recordings {
        let file = fs::canonicalize(path).unwrap_or_else(|_| path.clone());
        if let Some(before) = seen.insert(file, path) {
            let problem = InputProblem::GivenTwice(before.display().to_string());
            return Err(InputError::whole_file(path, problem));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Loaded {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        fs::write(&path, text).unwrap();
        recording(&path, Required::DragIncluded).unwrap()
    }

    const HEADER: &str =
        "temperature,time_s,vehicle_speed_m_s,wheel_speed_rad_s,normal_force_n,drag_force_n\n";

    #[test]
    fn every_column_finds_its_place_whatever_its_order() {
        let loaded = read(&format!("{HEADER}20,0,10,30,4000,5\n21,0.1,11,31,4001,\n"));
        let run = loaded.run;
        assert_eq!(run.time_s, [0.0, 0.1]);
        assert_eq!(run.vehicle_speed_m_s, [10.0, 11.0]);
        assert_eq!(run.wheel_speed_rad_s, [30.0, 31.0]);
        assert_eq!(run.normal_force_n, [4000.0, 4001.0]);
        assert_eq!(run.drag_force_n[0], 5.0);
        assert!(run.drag_force_n[1].is_nan());
        assert_eq!(run.extra, [("temperature".to_owned(), vec![20.0, 21.0])]);
        assert!(run.brake_torque_nm.is_none() && loaded.faults.is_empty());
    }

    #[test]
    fn missing_time_stamps_are_filled_in_and_told() {
        let loaded = read(&format!(
            "{HEADER}1,,1,1,1,1\n1,1,1,1,1,1\n1,nan,1,1,1,1\n1,,1,1,1,1\n1,4,1,1,1,1\n1,inf,1,1,1,1\n"
        ));
        assert_eq!(loaded.run.time_s, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(loaded.untimed, [0, 2, 3, 5]);
        assert_eq!(loaded.faults.len(), 1);
        assert_eq!(loaded.faults[0].channel, "time_s");
        assert!(loaded.faults[0].what.starts_with("4 time stamps missing"));
        assert_eq!(loaded.run.drag_force_n, [1.0; 6]);
    }

    #[test]
    fn without_time_nothing_measured_is_used() {
        for rows in ["1,,1,1,1,1\n1,,1,1,1,1\n", "1,3,1,1,1,1\n1,,1,1,1,1\n"] {
            let loaded = read(&format!("{HEADER}{rows}"));
            assert_eq!(loaded.run.time_s, [0.0, 1.0]);
            assert!(loaded.run.drag_force_n.iter().all(|v| v.is_nan()));
            assert!(loaded.run.extra[0].1.iter().all(|v| v.is_nan()));
            assert_eq!(loaded.faults.len(), 1);
        }
    }

    #[test]
    fn the_first_error_in_the_order_given_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let rig = file(
            "rig.toml",
            "[wheel]\nradius_m = 0.31\ninertia_kg_m2 = 1.25\n[vehicle]\nmass_kg = 420.0\ncoasting = true\n\
             [tyre]\nlaw = \"rudd\"\npeak_friction = 0.85\ncritical_slip = 0.14\n",
        );
        let good = file("good.csv", &format!("{HEADER}1,0,1,1,1,1\n"));
        let long_and_bad = file(
            "a.csv",
            &format!("{HEADER}{}x\n", "1,nan,1,1,1,1\n".repeat(20_000)),
        );
        let bad = file("b.csv", "");
        let complaint = |recordings: &[&PathBuf]| {
            let recordings: Vec<PathBuf> = recordings.iter().map(|&path| path.clone()).collect();
            campaign(&rig, &recordings, &|_| {})
                .expect_err("must be refused")
                .to_string()
        };
        for _ in 0..5 {
            let text = complaint(&[&good, &long_and_bad, &bad]);
            assert!(text.contains("a.csv:20002:2: 1 cells"), "{text}");
        }
        let text = complaint(&[&bad, &good, &folder.path().join("./good.csv")]);
        assert!(text.contains("good.csv:1:1: given twice"), "{text}");
    }
}
