//! `muslip explain`.

use std::path::PathBuf;

use clap::Args;
use muslip_analysis::diagnose::wording::either;
use muslip_diagnose::mechanism::Id;
use muslip_report::guide::{GuideError, markdown, named, near, pictures, section};
use muslip_report::{FigureFormat, write_figures};

use super::failure::Failure;
use super::terminal::Terminal;

/// Explain a mechanism that a diagnosis may name: physics, equation, alternatives and the test that separates them.
///
/// Without a name: list all mechanisms, one per line. With pictures: docs/mechanisms.md.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip explain\n  \
muslip explain thermal_fade\n  \
muslip explain force_lag relaxation_length")]
pub(super) struct Arguments {
    /// Names of mechanisms, as a diagnosis writes them.
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    /// Print the whole guide as Markdown.
    #[arg(long, hide = true, conflicts_with = "names")]
    markdown: bool,
    /// Write the guide's pictures into this folder.
    #[arg(long, hide = true, value_name = "FOLDER", requires = "markdown")]
    pictures: Option<PathBuf>,
}

impl From<GuideError> for Failure {
    fn from(error: GuideError) -> Self {
        Self::Internal(error.to_string())
    }
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    if let Some(folder) = &arguments.pictures {
        let pictures = pictures()?;
        let named = pictures
            .iter()
            .map(|(id, figure)| (id.as_str().to_owned(), figure));
        write_figures(folder, named, FigureFormat::Svg)?;
    }
    if arguments.markdown {
        return terminal.bytes(markdown().as_bytes());
    }
    let ids = arguments
        .names
        .iter()
        .map(|word| named(word).ok_or_else(|| unknown(word)))
        .collect::<Result<Vec<Id>, Failure>>()?;
    if ids.is_empty() {
        let rows: Vec<(&str, String)> = Id::ALL
            .iter()
            .map(|id| (id.as_str(), id.what().to_owned()))
            .collect();
        return terminal.table(&rows);
    }
    for (place, id) in ids.into_iter().enumerate() {
        if place > 0 {
            terminal.line("")?;
        }
        let section = section(id);
        terminal.headline(&format!("{} ({})", section.title, id.as_str()))?;
        terminal.paragraph(section.physics)?;
        let rows: Vec<(&str, String)> = section
            .rows
            .iter()
            .map(|row| (row.label, row.text.clone()))
            .collect();
        terminal.table(&rows)?;
    }
    Ok(())
}

fn unknown(word: &str) -> Failure {
    let near: Vec<String> = near(word).iter().map(|id| id.as_str().to_owned()).collect();
    let meant = if near.is_empty() {
        String::new()
    } else {
        format!("; did you mean {}?", either(&near))
    };
    Failure::Usage(format!(
        "no mechanism \"{word}\"{meant} (all of them: muslip explain)"
    ))
}
