//! A report as one HTML page.

use askama::Template;

use super::figure::Figure;
use super::svg::{DrawError, Size, for_page};

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
    /// Text.
    Paragraph(String),
    /// A table with a head; all rows are as long as the head.
    Table {
        /// Heads of the columns.
        head: Vec<String>,
        /// Rows.
        rows: Vec<Vec<String>>,
    },
    /// A figure with its caption.
    Figure(Figure),
    /// Figures one after the other, at the reader's pace.
    Animation(Vec<AnimationFrame>),
    /// A link to a file beside the page.
    Link {
        /// What the reader sees.
        text: String,
        /// The file, relative to the page.
        target: String,
    },
}

/// One picture of an animation.
#[derive(Debug, Clone, PartialEq)]
pub struct AnimationFrame {
    /// The picture; all frames of an animation should have the same axes and legend.
    pub figure: Figure,
    /// What the reader is told below it.
    pub note: String,
}

/// Plays animations; the only script that a page may hold.
const ANIMATION_SCRIPT: &str = include_str!("../../templates/animation.js");

/// What the page's content security policy lets run: this script and no other.
const ANIMATION_SCRIPT_HASH: &str = "sha256-FKBn/1121JJdcHjHY1QEL3LNvF78AsGHa0xfNPsPzbk=";

/// A report that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A figure could not be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The page could not be put together.
    #[error("the report could not be put together: {0}")]
    Page(#[from] askama::Error),
}

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    report: &'a Report,
    verdict: String,
    tone: &'static str,
    sections: Vec<DrawnSection<'a>>,
    animated: bool,
    script: &'static str,
    script_hash: &'static str,
    version: &'static str,
}

struct DrawnSection<'a> {
    heading: &'a str,
    blocks: Vec<DrawnBlock<'a>>,
}

enum DrawnBlock<'a> {
    Paragraph(&'a str),
    Table {
        head: &'a [String],
        rows: &'a [Vec<String>],
    },
    Figure {
        wide: String,
        narrow: String,
        caption: &'a str,
    },
    Animation(Vec<DrawnFrame<'a>>),
    Link {
        text: &'a str,
        target: &'a str,
    },
}

struct DrawnFrame<'a> {
    wide: String,
    narrow: String,
    note: &'a str,
}

impl Report {
    /// The page: self-contained, all text escaped, without script unless it holds an animation.
    ///
    /// # Errors
    /// [`ReportError`] if a figure cannot be drawn or the page cannot be put together; neither depends
    /// on what a recording holds.
    pub fn to_html(&self) -> Result<String, ReportError> {
        let mut sections = Vec::with_capacity(self.sections.len());
        for section in &self.sections {
            let mut blocks = Vec::with_capacity(section.blocks.len());
            for block in &section.blocks {
                blocks.push(match block {
                    Block::Paragraph(text) => DrawnBlock::Paragraph(text),
                    Block::Table { head, rows } => DrawnBlock::Table { head, rows },
                    Block::Figure(figure) => DrawnBlock::Figure {
                        wide: for_page(figure, Size::Wide)?,
                        narrow: for_page(figure, Size::Narrow)?,
                        caption: &figure.caption,
                    },
                    Block::Animation(frames) => DrawnBlock::Animation(drawn_frames(frames)?),
                    Block::Link { text, target } => DrawnBlock::Link { text, target },
                });
            }
            sections.push(DrawnSection {
                heading: &section.heading,
                blocks,
            });
        }
        let page = Page {
            report: self,
            // A value and its uncertainty stay on one line.
            verdict: self.verdict.replace(" \u{b1} ", "\u{a0}\u{b1}\u{a0}"),
            tone: match self.tone {
                Tone::Good => "good",
                Tone::Neutral => "neutral",
                Tone::Warning => "warning",
            },
            animated: self.is_animated(),
            script: ANIMATION_SCRIPT,
            script_hash: ANIMATION_SCRIPT_HASH,
            sections,
            version: env!("CARGO_PKG_VERSION"),
        };
        Ok(page.render()?)
    }

    fn is_animated(&self) -> bool {
        self.sections
            .iter()
            .flat_map(|section| &section.blocks)
            .any(|block| matches!(block, Block::Animation(_)))
    }
}

fn drawn_frames(frames: &[AnimationFrame]) -> Result<Vec<DrawnFrame<'_>>, DrawError> {
    frames
        .iter()
        .map(|frame| {
            Ok(DrawnFrame {
                wide: for_page(&frame.figure, Size::Wide)?,
                narrow: for_page(&frame.figure, Size::Narrow)?,
                note: &frame.note,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Axis, Ink, Shape};

    fn report(text: &str) -> Report {
        let figure = Figure::new(text, Axis::new(text), Axis::new(text)).with(
            Ink::Measured,
            text,
            Shape::Marker((0.0, 0.0), text.into()),
        );
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
                    Block::Table {
                        head: vec![text.into()],
                        rows: vec![vec![text.into()]],
                    },
                    Block::Figure(figure),
                ],
            }],
            command: text.into(),
        }
    }

    #[test]
    fn text_from_a_recording_cannot_become_markup() {
        let page = report("<script>alert(1)</script>\" onload=\"x")
            .to_html()
            .unwrap();
        assert!(!page.contains("<script"), "{page}");
        assert!(!page.contains("\" onload=\"x"));
    }

    #[test]
    fn the_page_needs_nothing_from_outside_and_says_so() {
        let page = report("text").to_html().unwrap();
        assert!(page.contains("Content-Security-Policy") && page.contains("default-src 'none'"));
        for outside in ["http://", "https://", "src=", "url(", "@import"] {
            assert!(!page.contains(outside), "{outside}");
        }
    }

    #[test]
    fn the_only_script_is_the_one_that_the_policy_names() {
        use base64::Engine;
        use sha2::Digest;
        let digest = sha2::Sha256::digest(ANIMATION_SCRIPT);
        let hash = base64::engine::general_purpose::STANDARD.encode(digest);
        assert_eq!(ANIMATION_SCRIPT_HASH, format!("sha256-{hash}"));

        let mut still = report("text");
        assert!(!still.to_html().unwrap().contains("script"));
        let frame = AnimationFrame {
            figure: Figure::new("<b>", Axis::new("x"), Axis::new("y")),
            note: "<script>alert(1)</script>".into(),
        };
        still.sections[0].blocks = vec![Block::Animation(vec![frame.clone(), frame])];
        let page = still.to_html().unwrap();
        assert!(page.contains(&format!("script-src '{ANIMATION_SCRIPT_HASH}';")));
        assert!(page.contains(&format!("<script>{ANIMATION_SCRIPT}</script>")));
        assert_eq!(page.matches("<script").count(), 1);
        // All frames but the last are hidden, for readers whose browser runs no script.
        assert_eq!(page.matches("class=\"frame\" hidden").count(), 1);
    }
}
