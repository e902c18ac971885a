//! The page that is printed: sections, and what each bar came to.

use super::summary::Ratio;

/// A condition of the specification beside its figure.
struct Bar {
    condition: String,
    limit: String,
    figure: String,
    met: bool,
}

/// Sections in the order in which they are made; the bars are printed above them.
#[derive(Default)]
pub struct Page {
    text: String,
    bars: Vec<Bar>,
}

impl Page {
    /// A heading, with a word to whoever waits.
    pub fn section(&mut self, heading: &str) {
        eprintln!("{heading}");
        self.line(format!("### {heading}\n"));
    }

    pub fn line(&mut self, line: impl AsRef<str>) {
        self.text += line.as_ref();
        self.text.push('\n');
    }

    pub fn paragraph(&mut self, text: impl AsRef<str>) {
        self.line(text);
        self.line("");
    }

    /// The head of a table.
    pub fn columns(&mut self, names: &[&str]) {
        self.line(format!("| {} |", names.join(" | ")));
        self.line(format!("|{}", " --- |".repeat(names.len())));
    }

    pub fn row(&mut self, cells: &[String]) {
        self.line(format!("| {} |", cells.join(" | ")));
    }

    pub fn bar(&mut self, condition: &str, limit: &str, figure: impl Into<String>, met: bool) {
        self.bars.push(Bar {
            condition: condition.to_owned(),
            limit: limit.to_owned(),
            figure: figure.into(),
            met,
        });
    }

    pub fn into_text(self) -> String {
        let mut page = Self::default();
        page.line("### Bars\n");
        page.columns(&["condition", "bar", "figure", ""]);
        for bar in self.bars {
            let verdict = if bar.met { "met" } else { "**missed**" };
            page.row(&[bar.condition, bar.limit, bar.figure, verdict.to_owned()]);
        }
        page.line("");
        page.text + &self.text
    }
}

/// A ratio with the standard error of its last digits in brackets.
pub fn with_error(ratio: Ratio) -> String {
    format!("{:.3}({:.0})", ratio.value, 1000.0 * ratio.error)
}

pub fn pair(cells: [f64; 2], digits: usize) -> String {
    format!("{:.digits$}, {:.digits$}", cells[0], cells[1])
}

pub fn signed(cells: [f64; 2], digits: usize) -> String {
    format!("{:+.digits$}, {:+.digits$}", cells[0], cells[1])
}
