//! `muslip channels`.

use std::path::PathBuf;

use clap::Args;
use muslip_analysis::channels::{Listing, listing};
use muslip_formats::listing::Listed;
use muslip_formats::roles::{Refused, Roles, TIME, role};
use muslip_recordings::map_file;
use muslip_recordings::output::write_file;

use super::failure::Failure;
use super::progress::Progress;
use super::terminal::Terminal;

/// List the channels of a file: group, name, unit, rate, samples, times, invalid readings, and what column each would be.
///
/// Reads MDF 3 and 4, TDMS, MAT v4 to v7.3, HDF5, Parquet, Arrow, Feather v2 and CSV of any dialect; the format is told by the file's bytes. Damaged
/// parts are listed; intact channels are read.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip channels run.mf4\n  \
muslip channels run.mf4 --write-map map.toml\n  \
muslip channels run.mf4 --map map.toml --json | jq '.channels[] | select(.role)'")]
pub(super) struct Arguments {
    /// Map of channels (TOML), to check which channels it selects.
    #[arg(long, value_name = "MAP.toml")]
    map: Option<PathBuf>,
    /// Write the roles that were found or guessed as a map, to be edited.
    #[arg(long, value_name = "MAP.toml")]
    write_map: Option<PathBuf>,
    /// Print one JSON object and nothing else.
    #[arg(long)]
    json: bool,
    /// The file.
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Parts of the bar.
const PARTS: f64 = 1000.0;

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let map = arguments.map.as_deref().map(map_file::read).transpose()?;
    let mut progress = Progress::new("read", PARTS as u64);
    let listing = listing(&arguments.file, map.as_ref(), &mut |share| {
        progress.done((share * PARTS) as u64);
    })?;
    drop(progress);
    let Listing {
        channels,
        roles,
        faults,
        ..
    } = &listing;
    if let Some(path) = &arguments.write_map {
        let mut text = listing.map.to_toml();
        for refused in worth_a_word(roles).filter(|_| roles.guessed) {
            text.push_str(&format!("# {}\n", refused.reason));
        }
        write_file(path, text.as_bytes())?;
    }
    if arguments.json {
        return terminal.json(&listing.to_json());
    }
    let start = listing
        .start_time
        .as_ref()
        .map_or(String::new(), |start| format!(", started {start}"));
    let count = channels.len();
    terminal.headline(&format!(
        "{}: {}{start}, {count} channels",
        arguments.file.display(),
        listing.format.word()
    ))?;
    terminal.line("")?;
    table(channels, terminal)?;
    for fault in faults {
        terminal.line(&format!("fault: {fault}"))?;
    }
    if roles.guessed {
        terminal.line("")?;
        terminal.line(
            "Columns are guessed from names and units; --write-map map.toml saves the guess.",
        )?;
        for refused in worth_a_word(roles) {
            terminal.paragraph(&refused.reason)?;
        }
    }
    if let Some(path) = &arguments.write_map {
        terminal.line(&format!("Written: {}", path.display()))?;
    }
    Ok(())
}

/// The columns that an estimate cannot do without and no channel became, and those that several may be.
fn worth_a_word(roles: &Roles) -> impl Iterator<Item = &Refused> {
    let needed = |refused: &&Refused| {
        refused.column != TIME
            && (refused.ambiguous || role(refused.column).is_some_and(|role| role.required))
    };
    roles.refused.iter().filter(needed)
}

/// One row a channel, under a header.
fn table(channels: &[Listed], terminal: &mut Terminal) -> Result<(), Failure> {
    let number = |value: Option<f64>| {
        value.map_or(String::new(), |value| {
            format!("{}", (value * 1e6).round() / 1e6)
        })
    };
    let mut rows = vec![
        [
            "group", "name", "unit", "Hz", "samples", "from s", "to s", "invalid", "kind",
            "column", "comment",
        ]
        .map(str::to_owned)
        .to_vec(),
    ];
    for one in channels {
        let channel = &one.channel;
        rows.push(vec![
            channel.group.clone(),
            channel.name.clone(),
            channel.unit.clone(),
            number(one.rate_hz),
            one.samples.to_string(),
            number(one.first_s),
            number(one.last_s),
            one.invalid.to_string(),
            channel.kind.word().to_owned(),
            one.role.clone().unwrap_or_default(),
            channel.comment.clone(),
        ]);
    }
    let shown: Vec<Vec<String>> = rows
        .iter()
        .map(|row| {
            row.iter()
                .map(|cell| {
                    muslip_recordings::input_error::one_line(cell)
                        .chars()
                        .take(40)
                        .collect()
                })
                .collect()
        })
        .collect();
    let columns = shown.first().map_or(0, Vec::len);
    let widths: Vec<usize> = (0..columns)
        .map(|column| {
            shown
                .iter()
                .filter_map(|row| row.get(column))
                .map(|cell: &String| cell.chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    for row in &shown {
        let line: Vec<String> = row
            .iter()
            .zip(&widths)
            .map(|(cell, &width)| format!("{cell:<width$}"))
            .collect();
        terminal.line(line.join("  ").trim_end())?;
    }
    Ok(())
}
