//! The tables, for a terminal, for Markdown and for programs.

use muslip_analysis::estimate::range_word;
use muslip_report::text::Table;
use serde_json::{Value, json};

use super::reproduce::{Paper, PaperOptions};
use super::statement::{Ours, Statement};
use super::statistics::Band;
use super::yardstick::{Accuracy, Cell, Contender};

fn joined(peak: [String; 3], slip: [String; 3]) -> [String; 6] {
    let ([a, b, c], [d, e, f]) = (peak, slip);
    [a, b, c, d, e, f]
}

impl Accuracy {
    /// RMSE with its standard error, its ratio to the bound, bias.
    fn cells(&self, bound: f64) -> [String; 3] {
        [
            self.rmse_text(),
            format!("{:.2}", self.rmse / bound),
            self.bias_text(),
        ]
    }

    fn rmse_text(&self) -> String {
        // Digits in brackets are the standard error of the last ones, as in tables of constants.
        let error = (self.rmse_standard_error * 1e5).round();
        format!("{:.5}({error})", self.rmse)
    }

    fn bias_text(&self) -> String {
        // Adding zero takes the sign from what rounds to nothing.
        let rounded = (self.bias * 1e5).round() / 1e5 + 0.0;
        format!("{rounded:+.5}").replace('-', "\u{2212}")
    }
}

fn owned<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).into()
}

impl Paper {
    /// The article's statements beside ours, one a row.
    pub fn statements_table(&self) -> Table {
        Table {
            head: owned([
                "about",
                "article",
                "ours: median (5 % to 95 %), article at",
                "verdict",
            ]),
            rows: self.statements.iter().map(Statement::row).collect(),
        }
    }

    /// Errors over the grid: for each curve the bound and every contender.
    pub fn yardstick_table(&self) -> Table {
        let mut rows = Vec::new();
        for cell in &self.yardstick {
            let row = |who: &str, figures: [String; 6]| {
                let mut row = vec![
                    format!("{:.2}", cell.truth.peak_friction),
                    format!("{:.2}", cell.truth.critical_slip),
                    who.to_owned(),
                ];
                row.extend(figures);
                row
            };
            let bounds = (cell.bound.peak_friction_std, cell.bound.critical_slip_std);
            let bound = |std: f64| [format!("{std:.5}"), "1.00".to_owned(), String::new()];
            rows.push(row("bound", joined(bound(bounds.0), bound(bounds.1))));
            for (contender, errors) in &cell.errors {
                rows.push(row(
                    contender.words(),
                    joined(
                        errors.peak_friction.cells(bounds.0),
                        errors.critical_slip.cells(bounds.1),
                    ),
                ));
            }
        }
        Table {
            head: owned([
                "mup",
                "sp",
                "estimator",
                "RMSE mup",
                "/bound",
                "bias mup",
                "RMSE sp",
                "/bound",
                "bias sp",
            ]),
            rows,
        }
    }

    /// Streams of the grid that an estimator gave no estimate for, in a sentence.
    pub fn missing_estimates(&self) -> String {
        let counts: Vec<String> = Contender::ALL
            .iter()
            .enumerate()
            .map(|(index, contender)| {
                let missing: u64 = self
                    .yardstick
                    .iter()
                    .map(|cell| cell.errors[index].1.without_estimate)
                    .sum();
                format!("{} {missing}", contender.words())
            })
            .collect();
        let runs = self.options.streams * self.yardstick.len() as u64;
        format!(
            "Of {runs} runs each, these ended without an estimate and do not count: {}.",
            counts.join(", ")
        )
    }

    /// How the second pass does by the covariance it starts with.
    pub fn second_start_table(&self) -> Table {
        Table {
            head: owned([
                "covariance to start with",
                "RMSE mup",
                "bias mup",
                "RMSE sp",
                "bias sp",
            ]),
            rows: self
                .second_starts
                .iter()
                .map(|(start, errors)| {
                    let (mup, sp) = (errors.peak_friction, errors.critical_slip);
                    vec![
                        start.words().to_owned(),
                        mup.rmse_text(),
                        mup.bias_text(),
                        sp.rmse_text(),
                        sp.bias_text(),
                    ]
                })
                .collect(),
        }
    }

    /// Everything for programs.
    pub fn to_json(&self) -> Value {
        let PaperOptions { seed, streams } = self.options;
        let statements: Vec<Value> = self.statements.iter().map(Statement::to_json).collect();
        let cells: Vec<Value> = self.yardstick.iter().map(cell_json).collect();
        json!({
            "schema": 1,
            "command": self.options.command(),
            "seed": seed,
            "seeds": streams,
            "statements": statements,
            "yardstick": cells,
        })
    }
}

impl Statement {
    fn row(&self) -> Vec<String> {
        let verdict = self.verdict.map_or("-", |verdict| verdict.words());
        vec![
            self.about.to_owned(),
            self.article.clone(),
            self.ours.text(),
            verdict.to_owned(),
        ]
    }

    fn to_json(&self) -> Value {
        let ours = match &self.ours {
            Ours::Exact(text) => json!({ "exact": text }),
            Ours::Figure {
                band: Band { low, median, high },
                share_below,
                ..
            } => json!({
                "median": median, "low_5": low, "high_95": high, "share_below_article": share_below,
            }),
            Ours::Share(share) => json!({ "share_of_streams": share }),
        };
        json!({
            "about": self.about,
            "article": self.article,
            "ours": ours,
            "verdict": self.verdict.map(|verdict| verdict.words()),
        })
    }
}

impl Ours {
    /// In words.
    pub fn text(&self) -> String {
        match self {
            Self::Exact(text) => text.clone(),
            Self::Figure {
                band: Band { low, median, high },
                share_below,
                decimals,
            } => {
                let figures =
                    format!("{median:.decimals$} ({low:.decimals$} to {high:.decimals$})");
                match share_below {
                    Some(share) => format!("{figures}, {:.1}\u{a0}%", 100.0 * share),
                    None => figures,
                }
            }
            Self::Share(share) => format!("in {:.1} % of streams", 100.0 * share),
        }
    }
}

fn cell_json(cell: &Cell) -> Value {
    let accuracy = |it: Accuracy, bound: f64| {
        json!({
            "bound": bound,
            "rmse": it.rmse,
            "rmse_standard_error": it.rmse_standard_error,
            "bias": it.bias,
            "bias_standard_error": it.bias_standard_error,
        })
    };
    let estimators: serde_json::Map<String, Value> = cell
        .errors
        .iter()
        .map(|(contender, errors)| {
            let value = json!({
                "peak_friction": accuracy(errors.peak_friction, cell.bound.peak_friction_std),
                "critical_slip": accuracy(errors.critical_slip, cell.bound.critical_slip_std),
                "without_estimate": errors.without_estimate,
            });
            (contender.key().to_owned(), value)
        })
        .collect();
    json!({
        "peak_friction": cell.truth.peak_friction,
        "critical_slip": cell.truth.critical_slip,
        "start": range_word(cell.range),
        "estimators": estimators,
    })
}
