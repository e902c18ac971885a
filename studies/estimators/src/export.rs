//! Streams and what each estimator made of them, for other programs to be run on the same.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::json;

use super::contenders::{article_run, batch, efficient_run};
use super::kalman::{iterated_run, unscented_run};
use super::streams::{Disturbance, SIGMA, article_slips, bound, grid, range, stream};
use muslip::filter::mu_slip::State;

/// Writes JSON, one object a line: first the slips and the noise, then a stream a line, in full precision. An
/// estimate is `[mup, sp]`, or null where the likelihood has no peak.
pub fn export(path: &Path, seeds: u64) -> Result<()> {
    let file = File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut file = BufWriter::new(file);
    let slips = article_slips();
    writeln!(file, "{}", json!({"slips": slips, "sigma": SIGMA}))?;
    for truth in grid() {
        let start: State<f64> = range(truth).initial_state();
        let limit = bound(truth, &slips);
        for seed in 0..seeds {
            let stream = stream(truth, &slips, Disturbance::default(), seed);
            let line = json!({
                "mup": truth.peak_friction,
                "sp": truth.critical_slip,
                "seed": seed,
                "start": [start.peak_friction, start.critical_slip],
                "bound": limit,
                "frictions": stream.frictions,
                "ml": batch(truth, &stream).map(|outcome| outcome.estimate),
                "efficient": efficient_run(truth, &stream, 1.0).estimate,
                "article": article_run(truth, &stream).estimate,
                "iterated": iterated_run(truth, &stream).estimate,
                "unscented": unscented_run(truth, &stream).estimate,
            });
            writeln!(file, "{line}")?;
        }
    }
    file.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::export;
    use crate::contenders::batch;
    use crate::streams::{Disturbance, SIGMA, article_slips, grid, stream};
    use serde_json::json;

    #[test]
    fn what_is_written_is_the_very_stream_that_the_estimators_saw() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("streams");
        export(&path, 2).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1 + 25 * 2);
        let (truth, line) = (grid()[7], lines[1 + 2 * 7 + 1]);
        let stream = stream(truth, &article_slips(), Disturbance::default(), 1);
        // As text: digit by digit.
        assert_eq!(
            lines[0],
            json!({"slips": stream.slips, "sigma": SIGMA}).to_string()
        );
        for (key, value) in [
            ("mup", json!(truth.peak_friction)),
            ("seed", json!(1)),
            ("frictions", json!(stream.frictions)),
            ("ml", json!(batch(truth, &stream).unwrap().estimate)),
        ] {
            assert!(line.contains(&format!("\"{key}\":{value}")), "{key}");
        }
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let error = export(std::path::Path::new("/nowhere/streams"), 1).unwrap_err();
        assert!(error.to_string().contains("/nowhere/streams"));
    }
}
