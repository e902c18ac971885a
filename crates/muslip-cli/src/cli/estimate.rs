//! `muslip estimate`.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use muslip::filter::mu_slip::Range;
use muslip_analysis::estimate::{
    EstimateError, EstimateOptions, EstimateResult, EstimatorKind, RangeSource, TraceFormat,
    TraceWriter, estimate, range_word,
};
use muslip_analysis::records::of_result;
use muslip_analysis::wording::{
    consistency_sentence, estimate_sentence, model_sentences, noise_sentence,
};
use muslip_recordings::map_file;
use muslip_recordings::model_file::ModelFile;
use muslip_recordings::output::{OutputError, OutputFile, write_file};
use muslip_recordings::recording::Recording;
use muslip_report::{CurveLabel, FigureFormat, of_estimate, write_figures};

use super::failure::Failure;
use super::mapping::Mapping;
use super::progress::Progress;
use super::records::write_records;
use super::rig_source::{RigOrRadius, RigSource};
use super::terminal::Terminal;

/// The name that stands for standard output.
const PRINTED: &str = "-";

/// Estimate peak friction and the slip of the peak from one recording, sample by sample.
///
/// A row is used where its values are finite, the vehicle speed is at least 0.5 m/s, the normal force is at
/// least 2 % of the recording's median and the slip is between 0 and 1 (with a margin of 0.05 for noise).
/// Other rows are skipped and counted.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip estimate --rig rig.toml run.csv\n  \
muslip estimate --radius 0.31 run.mf4\n  \
muslip estimate --rig rig.toml --report run.html run.csv\n  \
muslip estimate --rig rig.toml --trace trace.csv --json run.csv\n  \
muslip estimate --rig rig.toml --model found/model.toml run.csv")]
pub(super) struct Arguments {
    #[command(flatten)]
    wheel: RigOrRadius,
    #[command(flatten)]
    mapping: Mapping,
    #[command(flatten)]
    choices: Choices,
    /// Compensate the effects that a diagnosis found, sample by sample: the `model.toml` that `diagnose`
    /// wrote. Compensated are radius, delay, lag, zero drift, crosstalk, load and speed sensitivity,
    /// relaxation and tread temperature; other effects are listed and not compensated.
    #[arg(long, value_name = "MODEL.toml")]
    model: Option<PathBuf>,
    /// Write the estimate after every sample: CSV, or JSON where the name ends in .json or .jsonl, or Parquet
    /// where it ends in .parquet; `-` prints CSV on standard output instead of the summary.
    #[arg(long, value_name = "TRACE.csv")]
    trace: Option<PathBuf>,
    /// Write a report with plots.
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Also write the report's plots as image files, into the folder OUT-figures beside it.
    #[arg(long, value_enum, requires = "report")]
    format: Option<FigureFormat>,
    /// Write the result as Parquet as well, one row: what --json prints.
    #[arg(long, value_name = "OUT.parquet")]
    parquet: Option<PathBuf>,
    /// Print one JSON object and nothing else.
    #[arg(long)]
    json: bool,
    /// The recording (CSV, or any format that `muslip channels` lists).
    #[arg(value_name = "RUN.csv")]
    recording: PathBuf,
}

/// How to estimate; the campaign has the same.
#[derive(Debug, Args)]
pub(super) struct Choices {
    /// Tyres to start from: peak friction 0.6 ± 0.6 (aircraft) or 1.0 ± 1.0 (automotive). Default: found from
    /// the recording; with `--estimator article`, aircraft.
    #[arg(long, value_enum)]
    range: Option<RangeChoice>,
    /// The estimator. Default: `efficient`; `article` if `--model` has a low-pass filter on the force.
    #[arg(long, value_enum)]
    estimator: Option<EstimatorChoice>,
}

impl Choices {
    pub(super) fn options(&self) -> EstimateOptions {
        EstimateOptions {
            estimator: self.estimator.map(|choice| match choice {
                EstimatorChoice::Article => EstimatorKind::Article,
                EstimatorChoice::Efficient => EstimatorKind::Efficient,
            }),
            range: self.range.map(Range::from),
        }
    }

    /// The choices as arguments, each with a space after it.
    pub(super) fn words(&self) -> String {
        let options = self.options();
        let range = options
            .range
            .map(|range| format!("--range {} ", range_word(range)));
        let estimator = options
            .estimator
            .map(|estimator| format!("--estimator {} ", estimator.word()));
        range.unwrap_or_default() + &estimator.unwrap_or_default()
    }
}

/// `--range`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum RangeChoice {
    Aircraft,
    Automotive,
}

impl From<RangeChoice> for Range {
    fn from(choice: RangeChoice) -> Self {
        match choice {
            RangeChoice::Aircraft => Self::Aircraft,
            RangeChoice::Automotive => Self::Automotive,
        }
    }
}

/// `--estimator`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum EstimatorChoice {
    /// Extended Kalman filter of Rudd's article: noise inflated three times, pseudonoise.
    Article,
    /// Recursive maximum likelihood, as accurate as a batch fit; learns the noise, rejects outliers.
    Efficient,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let trace_is_printed = arguments.trace.as_deref() == Some(Path::new(PRINTED));
    if trace_is_printed && arguments.json {
        return Err(Failure::Usage(
            "--trace - and --json both write to standard output: give --trace a file name".into(),
        ));
    }
    let job = Job {
        rig: arguments.wheel.source()?,
        map: arguments.mapping.map.as_deref(),
        recording_path: &arguments.recording,
        options: arguments.choices.options(),
        model_path: arguments.model.as_deref(),
        trace: arguments.trace.as_deref(),
        report: arguments.report.as_deref(),
        format: arguments.format,
        beside: None,
    };
    let (result, notes) = job.run_noting()?;
    if let Some(path) = &arguments.parquet {
        let json = result.to_json_noting(&notes);
        let recording = arguments.recording.display().to_string();
        write_records(path, &[of_result(&recording, &json)], &json)?;
    }
    if trace_is_printed {
        return Ok(());
    }
    if arguments.json {
        return terminal.json(&result.to_json_noting(&notes));
    }
    terminal.headline(&format!(
        "{}: {}",
        arguments.recording.display(),
        estimate_sentence(&result)
    ))?;
    terminal.line("")?;
    tell(&result, terminal)?;
    if !notes.is_empty() {
        terminal.line("")?;
    }
    for note in &notes {
        terminal.line(note)?;
    }
    let written = [&arguments.trace, &arguments.report, &arguments.parquet];
    for path in written.into_iter().flatten() {
        terminal.line(&format!("Written: {}", path.display()))?;
    }
    Ok(())
}

/// An estimate with its files; the demo runs one too.
pub(super) struct Job<'a> {
    pub(super) rig: RigSource<'a>,
    pub(super) map: Option<&'a Path>,
    pub(super) recording_path: &'a Path,
    pub(super) options: EstimateOptions,
    pub(super) model_path: Option<&'a Path>,
    pub(super) trace: Option<&'a Path>,
    pub(super) report: Option<&'a Path>,
    pub(super) format: Option<FigureFormat>,
    pub(super) beside: Option<CurveLabel>,
}

impl Job<'_> {
    pub(super) fn run(&self) -> Result<EstimateResult, Failure> {
        self.run_noting().map(|(result, _)| result)
    }

    /// As [`Job::run`], with what was done to read a file of another format.
    fn run_noting(&self) -> Result<(EstimateResult, Vec<String>), Failure> {
        let bytes = 2 * Recording::announced_length_bytes(self.recording_path)?;
        let mut progress = Progress::bytes("estimate", bytes);
        self.run_all(&mut |bytes| progress.done(bytes))
    }

    /// As [`Job::run`]; `progress` receives the bytes read so far, of twice the recording's length.
    pub(super) fn run_reporting(
        &self,
        progress: &mut dyn FnMut(u64),
    ) -> Result<EstimateResult, Failure> {
        self.run_all(progress).map(|(result, _)| result)
    }

    fn run_all(
        &self,
        progress: &mut dyn FnMut(u64),
    ) -> Result<(EstimateResult, Vec<String>), Failure> {
        let rig = self.rig.read()?;
        let model = match (self.model_path, self.rig.path()) {
            (Some(path), Some(rig_path)) => {
                let model = ModelFile::read(path)?;
                model.check_rig(rig_path, &rig)?;
                Some(model.repaired)
            }
            (Some(_), None) => {
                return Err(Failure::Usage(
                    "--model is of a rig: add --rig RIG.toml in place of --radius".into(),
                ));
            }
            (None, _) => None,
        };
        let map = map_file::chosen(self.map, self.rig.path())?;
        let mut recording = Recording::open_mapped(self.recording_path, map.as_ref())?;
        // Outputs are begun before the work, so that a folder that is not there is told at once.
        let report = self.report.map(OutputFile::create).transpose()?;
        drop(report);
        let mut trace = match self.trace {
            Some(path) => {
                let writer = TraceWriter::new(TraceSink::create(path)?, TraceFormat::of(path));
                Some(writer.map_err(|error| trace_failure(path, error))?)
            }
            None => None,
        };
        let result = estimate(
            &mut recording,
            &rig,
            self.options,
            model.as_ref(),
            trace.as_mut(),
            progress,
        )
        .map_err(|error| self.failure(error))?;
        if let (Some(trace), Some(path)) = (trace, self.trace) {
            let sink = trace.finish().map_err(|error| trace_failure(path, error))?;
            sink.commit()?;
        }
        if let Some(path) = self.report {
            let page = of_estimate(
                self.recording_path,
                &result,
                self.beside.as_ref(),
                &self.command(&result),
            );
            write_file(path, page.to_html()?.as_bytes())?;
            if let Some(format) = self.format {
                let figures = page.figures();
                let figures = figures.iter().map(|(name, figure)| (name.clone(), figure));
                write_figures(&figures_folder(path), figures, format)?;
            }
        }
        Ok((result, recording.notes().to_vec()))
    }

    fn failure(&self, error: EstimateError) -> Failure {
        match (error, self.trace, self.model_path) {
            (EstimateError::Trace(error), Some(path), _) => trace_failure(path, error),
            (EstimateError::Model(what), _, Some(path)) => {
                Failure::Usage(format!("{}: {what}", path.display()))
            }
            (error, _, _) => error.into(),
        }
    }

    /// The command that makes the report again.
    fn command(&self, result: &EstimateResult) -> String {
        let model = match self.model_path {
            Some(path) => format!("--model {} ", path.display()),
            None => String::new(),
        };
        let map = self
            .map
            .map_or(String::new(), |map| format!("--map {} ", map.display()));
        format!(
            "muslip estimate {} --range {} --estimator {} {model}{map}{}",
            self.rig.words(),
            range_word(result.range),
            result.estimator.word(),
            self.recording_path.display()
        )
    }
}

/// The folder of a report's figures: `run.html` has `run-figures`.
fn figures_folder(report: &Path) -> PathBuf {
    let mut name = report.file_stem().unwrap_or_default().to_owned();
    name.push("-figures");
    report.with_file_name(name)
}

/// Where a trace goes.
enum TraceSink {
    File(OutputFile),
    Printed(BufWriter<io::Stdout>),
}

impl TraceSink {
    fn create(path: &Path) -> Result<Self, OutputError> {
        if path == Path::new(PRINTED) {
            return Ok(Self::Printed(BufWriter::new(io::stdout())));
        }
        OutputFile::create(path).map(Self::File)
    }

    fn commit(self) -> Result<(), Failure> {
        match self {
            Self::File(file) => Ok(file.commit()?),
            Self::Printed(mut out) => out.flush().map_err(Failure::Terminal),
        }
    }
}

impl Write for TraceSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Printed(out) => out.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Printed(out) => out.flush(),
        }
    }
}

fn trace_failure(path: &Path, error: io::Error) -> Failure {
    if path == Path::new(PRINTED) {
        Failure::Terminal(error)
    } else {
        OutputError::new(path, error).into()
    }
}

/// Which estimator ran and which range it started from.
fn estimator_words(result: &EstimateResult) -> String {
    let from = match result.range_source() {
        RangeSource::Option => "given",
        RangeSource::Recording => "found from the recording",
        RangeSource::Default => "default",
    };
    format!(
        "{}; range {} ({from})",
        result.estimator.word(),
        range_word(result.range)
    )
}

/// The result below its headline.
pub(super) fn tell(result: &EstimateResult, terminal: &mut Terminal) -> Result<(), Failure> {
    let skipped = match result.skipped.total() {
        0 => "none skipped".to_owned(),
        total => format!("{total} skipped ({})", result.skipped.in_words()),
    };
    let others = vec![
        ("samples", format!("{} used, {skipped}", result.used)),
        ("estimator", estimator_words(result)),
    ];
    terminal.peak_table(&result.peak, others)?;
    terminal.line("")?;
    for sentence in result.model.iter().flat_map(model_sentences) {
        terminal.paragraph(&sentence)?;
    }
    terminal.paragraph(&consistency_sentence(&result.consistency, result.estimator))?;
    terminal.paragraph(&noise_sentence(&result.survey))
}
