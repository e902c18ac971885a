//! A recording as it happens: every line is in the file before the next one is made.

use std::fs::File;
use std::io;
use std::path::Path;

use muslip_record::Sample;
use muslip_recordings::output::OutputError;
use muslip_recordings::recording::{Channel, RecordingWriter};

/// Writes samples into a recording. Unlike other outputs it is under its name from the first line: a kill
/// loses at most the line being written.
pub struct Recorder {
    writer: RecordingWriter<File>,
    path: std::path::PathBuf,
    sample_rate_hz: u32,
    first_tick: Option<u32>,
    last_tick: Option<u32>,
    rows: u64,
    missing: u64,
}

impl Recorder {
    /// Starts a recording of so many samples a second, in place of one that may be there.
    ///
    /// # Errors
    /// [`OutputError`] if the file cannot be made.
    pub fn create(
        path: &Path,
        origin: &[String],
        sample_rate_hz: u32,
    ) -> Result<Self, OutputError> {
        let fail = |error| OutputError::new(path, error);
        let file = File::create(path).map_err(fail)?;
        let mut columns: Vec<&str> = Channel::ALL.iter().take(5).map(|c| c.name()).collect();
        columns.push("brake_demand");
        Ok(Self {
            writer: RecordingWriter::new(file, origin, &columns).map_err(fail)?,
            path: path.to_owned(),
            sample_rate_hz,
            first_tick: None,
            last_tick: None,
            rows: 0,
            missing: 0,
        })
    }

    /// Adds a sample; one that is not later than the last is left out.
    ///
    /// # Errors
    /// [`OutputError`].
    pub fn add(&mut self, sample: &Sample) -> Result<(), OutputError> {
        let since = |tick: u32| sample.tick.wrapping_sub(tick);
        match self.last_tick.map(since) {
            Some(0) => return Ok(()),
            // Backwards: the controller has started anew.
            Some(step) if step > u32::MAX / 2 => return Ok(()),
            Some(step) => self.missing += u64::from(step - 1),
            None => {}
        }
        let first = *self.first_tick.get_or_insert(sample.tick);
        self.last_tick = Some(sample.tick);
        let row = [
            f64::from(since(first)) / f64::from(self.sample_rate_hz),
            f64::from(sample.wheel_speed_rad_s),
            f64::from(sample.vehicle_speed_m_s),
            f64::from(sample.drag_force_n),
            f64::from(sample.normal_force_n),
            f64::from(sample.brake_demand),
        ];
        self.rows += 1;
        // The file is not buffered: a row is one write.
        self.writer
            .row(&row)
            .map_err(|error: io::Error| OutputError::new(&self.path, error))
    }

    /// Rows written, and samples that never came.
    pub fn counts(&self) -> (u64, u64) {
        (self.rows, self.missing)
    }
}
