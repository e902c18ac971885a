//! The figures of a report as files for a document: SVG, or PNG drawn from it.

use std::path::{Path, PathBuf};

use muslip_recordings::output::{OutputError, create_folder, write_file};

use super::bitmap::png;
use super::figure::Figure;
use super::page::{Block, Report, ReportError};
use super::svg::stand_alone;

/// How figures are written for a document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum FigureFormat {
    /// Vector graphics.
    Svg,
    /// Bitmap, 1520 pixels wide.
    Png,
}

impl FigureFormat {
    fn ending(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
        }
    }

    /// A figure as the bytes of such a file.
    ///
    /// # Errors
    /// [`ReportError`] if it cannot be drawn, which no figure is known to bring about.
    pub fn bytes_of(self, figure: &Figure) -> Result<Vec<u8>, ReportError> {
        let svg = stand_alone(figure)?;
        match self {
            Self::Svg => Ok(svg.into_bytes()),
            Self::Png => png(&svg).map_err(ReportError::Picture),
        }
    }
}

/// Figures that could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A figure could not be drawn.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Writes figures into a folder, which is made; a figure's name is its file's.
///
/// # Errors
/// [`ExportError`]; files written before are whole.
pub fn write_figures<'a>(
    folder: &Path,
    figures: impl IntoIterator<Item = (String, &'a Figure)>,
    format: FigureFormat,
) -> Result<(), ExportError> {
    create_folder(folder)?;
    for (name, figure) in figures {
        let path: PathBuf = folder.join(format!("{name}.{}", format.ending()));
        write_file(&path, &format.bytes_of(figure)?)?;
    }
    Ok(())
}

impl Report {
    /// The figures of the page in its order, each with a name of its own.
    pub fn figures(&self) -> Vec<(String, Figure)> {
        let mut figures: Vec<(String, Figure)> = Vec::new();
        let blocks = self.sections.iter().flat_map(|section| &section.blocks);
        for block in blocks {
            match block {
                Block::Figure(figure) => add(&mut figures, figure.clone()),
                Block::Convergence(run) => {
                    run.figures()
                        .into_iter()
                        .for_each(|figure| add(&mut figures, figure));
                }
                _ => {}
            }
        }
        figures
    }
}

fn add(figures: &mut Vec<(String, Figure)>, figure: Figure) {
    let number = figures.len() + 1;
    let taken = figures.iter().any(|(name, _)| *name == figure.name);
    let name = if figure.name.is_empty() || taken {
        format!("figure-{number:02}")
    } else {
        figure.name.clone()
    };
    figures.push((name, figure));
}

#[cfg(test)]
mod tests {
    use tiny_skia::Pixmap;

    use super::*;
    use crate::axis::Axis;
    use crate::figure::{Ink, Shape};

    #[test]
    fn a_picture_has_its_figure_s_size_ink_and_letters() {
        let figure = |label: &str| {
            Figure::new("caption", Axis::new(label), Axis::new("y")).with(
                Ink::Estimate,
                "line",
                Shape::Line(vec![(0.0, 0.0), (1.0, 1.0)]),
            )
        };
        let [plain, worded] = ["", "friction of the tyre \u{3bc}"].map(|label| {
            let bytes = FigureFormat::Png.bytes_of(&figure(label)).unwrap();
            Pixmap::decode_png(&bytes).unwrap()
        });
        assert_eq!(worded.width(), 1520);
        let inked = |pixels: &Pixmap| {
            pixels
                .pixels()
                .iter()
                .filter(|pixel| (pixel.red(), pixel.green(), pixel.blue()) == (0xc8, 0x28, 0x1e))
                .count()
        };
        assert!(inked(&worded) > 500);
        let dark = |pixels: &Pixmap| {
            let pixels = pixels.pixels().iter();
            pixels.filter(|pixel| pixel.green() < 0xa0).count()
        };
        assert!(dark(&worded) > dark(&plain) + 300);
    }

    #[test]
    fn every_figure_of_a_page_has_a_name_of_its_own() {
        let mut figures = Vec::new();
        for name in ["curve", "", "curve"] {
            let figure = Figure::new("", Axis::new(""), Axis::new("")).named(name);
            add(&mut figures, figure);
        }
        let names: Vec<_> = figures.into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["curve", "figure-02", "figure-03"]);
    }
}
