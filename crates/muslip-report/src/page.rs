//! A report as one HTML page.

use askama::Template;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::convergence::Convergence;
use super::figure::{Figure, Shape};
use super::spec::{alternative, ink_word, of_figure, shape_word, short};
use super::svg::DrawError;
use super::table::{Table, typeset};

/// How a verdict is meant, which is its colour on the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Neither good nor bad.
    Neutral,
    /// The reader should look twice.
    Warning,
}

/// A report.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Heading of the page.
    pub title: String,
    /// What it is about: the recording, the rig.
    pub subject: String,
    /// The answer in one sentence.
    pub verdict: String,
    /// How the verdict is meant.
    pub tone: Tone,
    /// The figures that most readers came for.
    pub key_figures: Vec<KeyFigure>,
    /// The rest, in order.
    pub sections: Vec<Section>,
    /// The command that made the page.
    pub command: String,
}

/// A number to be seen first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyFigure {
    /// What it is.
    pub name: String,
    /// The number with its uncertainty.
    pub value: String,
    /// A remark in small print.
    pub remark: String,
}

/// A part of a report under its heading.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// What stands below it.
    pub blocks: Vec<Block>,
}

/// A piece of a section.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// A heading within the section.
    Heading(String),
    /// The same, which a link may lead to.
    Anchored {
        /// What a link calls it, after the `#`.
        anchor: String,
        /// What it says.
        text: String,
    },
    /// Text.
    Paragraph(String),
    /// A table.
    Table(Table),
    /// A table that the reader unfolds.
    Folded {
        /// What is in it.
        summary: String,
        /// The table.
        table: Table,
    },
    /// A figure with its caption; several in a row share lines where there is room.
    Figure(Figure),
    /// A filter's run, frame by frame, at the reader's pace; one a page.
    Convergence(Box<Convergence>),
    /// A link to a file beside the page, or to a heading on it.
    Link {
        /// What the reader sees.
        text: String,
        /// The file, relative to the page; `#` and the heading's anchor.
        target: String,
    },
}

/// A report that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A figure could not be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// A figure could not be turned into pixels.
    #[error("a figure could not be turned into pixels: {0}")]
    Picture(String),
    /// The page could not be put together.
    #[error("the report could not be put together: {0}")]
    Page(#[from] askama::Error),
}

const STYLE: &str = concat!(
    include_str!("../vendor/uplot/uPlot.min.css"),
    "\n",
    include_str!("../templates/report.css")
);
const UPLOT: &str = include_str!("../vendor/uplot/uPlot.iife.min.js");
const FIGURES: &str = include_str!("../templates/figures.js");
const CONVERGENCE: &str = include_str!("../templates/convergence.js");
const WHAT_IF: &str = include_str!("../templates/what-if.js");
const SORT: &str = include_str!("../templates/sort.js");

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    report: &'a Report,
    verdict: String,
    tone: &'static str,
    sections: Vec<DrawnSection<'a>>,
    policy: String,
    style: &'static str,
    /// Blocks of data: id, type, text.
    data: Vec<(&'static str, &'static str, String)>,
    scripts: Vec<&'static str>,
    version: &'static str,
}

struct DrawnSection<'a> {
    heading: &'a str,
    blocks: Vec<DrawnBlock<'a>>,
}

enum DrawnBlock<'a> {
    Heading(&'a str),
    Anchored {
        anchor: &'a str,
        text: &'a str,
    },
    Paragraph(String),
    Table(DrawnTable<'a>),
    Folded {
        summary: &'a str,
        table: DrawnTable<'a>,
    },
    Figures(Vec<DrawnFigure>),
    Player(Player<'a>),
    Link {
        text: &'a str,
        target: &'a str,
    },
}

#[derive(Template)]
#[template(path = "table.html")]
struct DrawnTable<'a> {
    /// What assistive technology calls it.
    name: &'a str,
    table: &'a Table,
}

#[derive(Template)]
#[template(path = "figure.html")]
struct DrawnFigure {
    id: String,
    figure: Figure,
    /// Shape, ink and label of each entry.
    legend: Vec<(&'static str, &'static str, String)>,
    /// Ends of a map's colours.
    ramp: Option<(String, String)>,
    alternative: String,
}

#[derive(Template)]
#[template(path = "player.html")]
struct Player<'a> {
    figures: Vec<DrawnFigure>,
    last: usize,
    what_if: Option<WhatIf<'a>>,
    /// Why there is none.
    without: Option<&'a str>,
}

struct WhatIf<'a> {
    about: &'a str,
    efficient: bool,
    peak_friction: f64,
    critical_slip: f64,
}

/// What the scripts of a page are given.
#[derive(Default)]
struct PageData {
    figures: Vec<Value>,
    convergence: Option<Value>,
    core: Option<&'static [u8]>,
    sortable: bool,
}

impl PageData {
    fn figure(&mut self, figure: &Figure, id: String) -> DrawnFigure {
        self.figures.push(of_figure(figure, &id));
        let layers = figure.layers.iter();
        DrawnFigure {
            id,
            figure: Figure {
                caption: typeset(&figure.caption),
                ..figure.clone()
            },
            legend: layers
                .clone()
                .filter(|layer| !layer.label.is_empty() && !matches!(layer.shape, Shape::Cells(_)))
                .map(|layer| {
                    (
                        shape_word(&layer.shape),
                        ink_word(layer.ink),
                        layer.label.clone(),
                    )
                })
                .collect(),
            ramp: layers
                .filter_map(|layer| match &layer.shape {
                    Shape::Cells(cells) => Some((
                        format!("\u{2212}{} {}", short(cells.limit), cells.unit),
                        format!("+{} {}", short(cells.limit), cells.unit),
                    )),
                    _ => None,
                })
                .next(),
            alternative: alternative(figure),
        }
    }

    fn player<'a>(&mut self, convergence: &'a Convergence) -> Player<'a> {
        let [curve, close_up] = convergence.figures();
        let figures = vec![
            self.figure(&curve, "player-curve".into()),
            self.figure(&close_up, "player-ellipse".into()),
        ];
        self.convergence = Some(convergence.data());
        self.core = convergence.core();
        let start = convergence.frames.first().map(|frame| frame.peak);
        let what_if = start.filter(|_| self.core.is_some()).map(|start| WhatIf {
            about: &convergence.about_what_if,
            efficient: convergence.again
                == Some(muslip_analysis::estimate::EstimatorKind::Efficient),
            peak_friction: start.peak_friction,
            critical_slip: start.critical_slip,
        });
        Player {
            figures,
            last: convergence.frames.len().saturating_sub(1),
            what_if,
            without: convergence.without_what_if(),
        }
    }

    fn table<'a>(&mut self, name: &'a str, table: &'a Table) -> DrawnTable<'a> {
        self.sortable |= table.sortable;
        DrawnTable { name, table }
    }

    fn scripts(&self) -> Vec<&'static str> {
        let mut scripts = Vec::new();
        if !self.figures.is_empty() {
            scripts.extend([UPLOT, FIGURES]);
        }
        if self.convergence.is_some() {
            scripts.push(CONVERGENCE);
        }
        if self.core.is_some() {
            scripts.push(WHAT_IF);
        }
        if self.sortable {
            scripts.push(SORT);
        }
        scripts
    }

    /// Blocks of data: id, type, text.
    fn blocks(self) -> Vec<(&'static str, &'static str, String)> {
        const JSON: &str = "application/json";
        let mut blocks = Vec::new();
        if !self.figures.is_empty() {
            blocks.push(("figures", JSON, in_script(&Value::Array(self.figures))));
        }
        if let Some(convergence) = &self.convergence {
            blocks.push(("convergence", JSON, in_script(convergence)));
        }
        if let Some(core) = self.core {
            blocks.push(("core", "application/wasm-base64", BASE64.encode(core)));
        }
        blocks
    }
}

/// JSON that cannot end the element that it stands in.
fn in_script(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// A source by its hash, as a content-security policy names it.
fn hash(text: &str) -> String {
    format!("'sha256-{}'", BASE64.encode(Sha256::digest(text)))
}

/// The page's content-security policy: nothing from anywhere, and of what is inside only this.
fn policy(scripts: &[&str], wasm: bool) -> String {
    let mut sources: Vec<String> = scripts.iter().map(|script| hash(script)).collect();
    if wasm {
        sources.push("'wasm-unsafe-eval'".into());
    }
    let scripts = if sources.is_empty() {
        String::new()
    } else {
        format!("; script-src {}", sources.join(" "))
    };
    format!(
        "default-src 'none'; style-src {}{scripts}; base-uri 'none'; form-action 'none'",
        hash(STYLE)
    )
}

impl Report {
    /// The page: self-contained, all text escaped, nothing running but the scripts that its policy names.
    ///
    /// # Errors
    /// [`ReportError`] if the page cannot be put together; that does not depend on what a recording holds.
    pub fn to_html(&self) -> Result<String, ReportError> {
        let mut data = PageData::default();
        let sections: Vec<DrawnSection<'_>> = self
            .sections
            .iter()
            .map(|section| drawn(section, &mut data))
            .collect();
        let scripts = data.scripts();
        let page = Page {
            report: self,
            verdict: typeset(&self.verdict),
            tone: match self.tone {
                Tone::Good => "good",
                Tone::Neutral => "neutral",
                Tone::Warning => "warning",
            },
            policy: policy(&scripts, data.core.is_some()),
            style: STYLE,
            data: data.blocks(),
            scripts,
            sections,
            version: env!("CARGO_PKG_VERSION"),
        };
        Ok(page.render()?)
    }
}

fn drawn<'a>(section: &'a Section, data: &mut PageData) -> DrawnSection<'a> {
    let mut blocks: Vec<DrawnBlock<'_>> = Vec::with_capacity(section.blocks.len());
    let heading = &section.heading;
    for block in &section.blocks {
        let next = match block {
            Block::Heading(text) => DrawnBlock::Heading(text),
            Block::Anchored { anchor, text } => DrawnBlock::Anchored { anchor, text },
            Block::Paragraph(text) => DrawnBlock::Paragraph(typeset(text)),
            Block::Table(table) => DrawnBlock::Table(data.table(heading, table)),
            Block::Folded { summary, table } => DrawnBlock::Folded {
                summary,
                table: data.table(summary, table),
            },
            Block::Figure(figure) => {
                let id = format!("figure-{}", data.figures.len() + 1);
                let figure = data.figure(figure, id);
                if let Some(DrawnBlock::Figures(row)) = blocks.last_mut() {
                    row.push(figure);
                    continue;
                }
                DrawnBlock::Figures(vec![figure])
            }
            Block::Convergence(convergence) => DrawnBlock::Player(data.player(convergence)),
            Block::Link { text, target } => DrawnBlock::Link { text, target },
        };
        blocks.push(next);
    }
    DrawnSection { heading, blocks }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::Axis;
    use crate::figure::Ink;

    fn report(text: &str) -> Report {
        let figure = Figure::new(text, Axis::new(text), Axis::new(text)).with(
            Ink::Measured,
            text,
            Shape::Marker((0.0, 0.0), text.into()),
        );
        let table = Table::new([text], vec![[text.to_owned()]]);
        Report {
            title: text.into(),
            subject: text.into(),
            verdict: text.into(),
            tone: Tone::Good,
            key_figures: vec![KeyFigure {
                name: text.into(),
                value: text.into(),
                remark: text.into(),
            }],
            sections: vec![Section {
                heading: text.into(),
                blocks: vec![
                    Block::Paragraph(text.into()),
                    Block::Table(table.clone()),
                    Block::Folded {
                        summary: text.into(),
                        table,
                    },
                    Block::Link {
                        text: text.into(),
                        target: text.into(),
                    },
                    Block::Figure(figure),
                ],
            }],
            command: text.into(),
        }
    }

    #[test]
    fn text_from_a_recording_cannot_become_markup() {
        let usual = report("text").to_html().unwrap();
        let page = report("</script><script>alert(1)</script>\" onload=\"x")
            .to_html()
            .unwrap();
        assert_eq!(
            page.matches("<script").count(),
            usual.matches("<script").count()
        );
        assert_eq!(
            page.matches("</script").count(),
            usual.matches("</script").count()
        );
        assert!(!page.contains("alert(1)</"));
        assert!(!page.contains("\" onload=\"x"));
    }

    #[test]
    fn the_page_needs_nothing_from_outside_and_says_so() {
        let page = report("text").to_html().unwrap();
        assert!(page.contains("Content-Security-Policy") && page.contains("default-src 'none'"));
        for outside in [
            " src=",
            "url(",
            "@import",
            "fetch(",
            "XMLHttpRequest",
            " style=",
        ] {
            assert!(!page.contains(outside), "{outside}");
        }
    }

    #[test]
    fn the_policy_names_every_script_and_the_style_sheet_by_what_they_are() {
        let page = report("text").to_html().unwrap();
        let (_, rest) = page
            .split_once("Content-Security-Policy\" content=\"")
            .unwrap();
        let policy = rest.split('"').next().unwrap();
        for (open, close) in [("<style>", "</style>"), ("<script>", "</script>")] {
            for part in page.split(open).skip(1) {
                let text = part.split(close).next().unwrap();
                assert!(policy.contains(&hash(text)), "{open}");
            }
        }
        assert!(!policy.contains("unsafe"), "{policy}");
    }

    #[test]
    fn a_page_without_plots_runs_no_script() {
        let mut still = report("text");
        still.sections[0].blocks.truncate(3);
        let page = still.to_html().unwrap();
        assert!(!page.contains("<script") && !page.contains("script-src"));
    }
}
