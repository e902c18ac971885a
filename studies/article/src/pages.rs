//! The report, the animation and the page of the documentation.

use muslip_report::text::Table;
use muslip_report::{Block, KeyFigure, Report, Section, Tone};

use super::figures::{Part, convergence, figures};
use super::pass::PassError;
use super::reproduce::{Paper, PaperOptions};
use super::statement::Reproduction;

/// Name of the page with the animation, beside the report.
pub const CONVERGENCE_PAGE: &str = "convergence.html";

const TITLE: &str = "The article, reproduced";
const SUBJECT: &str = "R. Rudd, Estimating the Mu Slip Curve via Extended Kalman Filtering, \
                       The Mathematica Journal 11 (2011)";

const ABOUT_VERDICTS: &str = "The article shows one stream of random noise, which we do not have, so each \
    of its figures is held against the same figure of our streams: reproduced where our median is the \
    article's figure to the digits that it gives, within the band where it lies between our 5 and 95 % \
    points, not reproduced elsewhere. What it says of its stream in words is reproduced where it holds in \
    at least 95 % of ours, within the band in 5 to 95 %. \"Article at 29 %\" means that 29 % of our streams \
    give a smaller figure. Statements about equations are asked of the filter itself.";

const ABOUT_YARDSTICK: &str = "Root mean square errors, with the standard error of their last digits \
    in brackets, their ratio to the Cramér-Rao bound of the 41 points, and mean errors, whose \
    standard error is at most the RMSE over the root of the number of streams. The bound holds for estimators without bias and \
    without a prior; the filter has both. Filter and fit start at the article's high end for aircraft \
    (0.6, 0.2) where peak friction is at most 0.6, and at that for cars (1.0, 0.2) where it is 1.0. The \
    second pass runs over the same points again, from the state that the first ended with, each standard \
    deviation as large as that state, which is the rule of the first start. Every curve gets the same \
    streams of noise, so that rows differ by their curve alone and chance moves them together.";

const ABOUT_SECOND_PASS: &str = "The article does not give us the covariance that its second pass starts \
    with. At its curve the choice matters little:";

/// The report with the tables and all figures.
///
/// # Errors
/// [`PassError`] if the filter refuses the stream that the figures show.
pub fn report_page(paper: &Paper) -> Result<Report, PassError> {
    let options = paper.options;
    let counted = |wanted| {
        paper
            .statements
            .iter()
            .filter(|statement| statement.verdict == Some(wanted))
            .count()
    };
    let judged = paper
        .statements
        .iter()
        .filter(|statement| statement.verdict.is_some())
        .count();
    let key = |verdict: Reproduction, remark: &str| KeyFigure {
        name: verdict.words().to_owned(),
        value: counted(verdict).to_string(),
        remark: remark.to_owned(),
    };
    let mut sections = vec![
        Section {
            heading: "Statements".into(),
            blocks: vec![
                Block::Paragraph(ABOUT_VERDICTS.into()),
                table_block(paper.statements_table()),
            ],
        },
        Section {
            heading: "Errors against the Cramér-Rao bound".into(),
            blocks: vec![
                Block::Paragraph(ABOUT_YARDSTICK.into()),
                table_block(paper.yardstick_table()),
                Block::Paragraph(paper.missing_estimates()),
                Block::Paragraph(ABOUT_SECOND_PASS.into()),
                table_block(paper.second_start_table()),
            ],
        },
    ];
    let drawn = figures(options.seed)?;
    for (part, heading) in [
        (Part::Curve, "The curve and the points"),
        (Part::Filter, "Along the measurements"),
        (
            Part::Convergence,
            "How the estimate comes down onto the curve",
        ),
    ] {
        let mut blocks: Vec<Block> = drawn
            .iter()
            .filter(|figure| figure.part == part)
            .map(|figure| Block::Figure(figure.figure.clone()))
            .collect();
        if part == Part::Convergence {
            blocks.push(Block::Link {
                text: "Every measurement, as an animation".into(),
                target: CONVERGENCE_PAGE.into(),
            });
        }
        sections.push(Section {
            heading: heading.into(),
            blocks,
        });
    }
    Ok(Report {
        title: TITLE.into(),
        subject: SUBJECT.into(),
        verdict: format!(
            "Of {judged} statements {} are reproduced, {} lie within the band of our streams, {} are not \
             reproduced.",
            counted(Reproduction::Reproduced),
            counted(Reproduction::WithinTheBand),
            counted(Reproduction::NotReproduced)
        ),
        tone: Tone::Neutral,
        key_figures: vec![
            key(Reproduction::Reproduced, "as the article has it"),
            key(Reproduction::WithinTheBand, "as some streams have it"),
            key(Reproduction::NotReproduced, "see the table"),
        ],
        sections,
        command: options.command(),
    })
}

/// The page with the animation.
///
/// # Errors
/// As for [`report_page`].
pub fn convergence_page(options: PaperOptions) -> Result<Report, PassError> {
    let run = convergence(options.seed)?;
    let (head, rows) = run.table();
    Ok(Report {
        title: TITLE.into(),
        subject: SUBJECT.into(),
        verdict: "The estimate comes down from the high end of the range onto the true curve."
            .into(),
        tone: Tone::Neutral,
        key_figures: Vec::new(),
        sections: vec![Section {
            heading: format!("Convergence, noise of seed {}", options.seed),
            blocks: vec![
                Block::Convergence(Box::new(run)),
                Block::Folded {
                    summary: "The frames as a table".into(),
                    table: muslip_report::Table::new(head, rows),
                },
            ],
        }],
        command: options.command(),
    })
}

/// `docs/article.md`: the tables with the command that prints them.
pub fn article_markdown(paper: &Paper) -> String {
    let options = paper.options;
    let PaperOptions { seed, streams } = options;
    let last = seed.wrapping_add(streams.saturating_sub(1));
    let paragraph = |text: &str| {
        let words: Vec<&str> = text.split_whitespace().collect();
        format!("{}\n", words.join(" "))
    };
    [
        "# The article, reproduced\n".to_owned(),
        paragraph(&format!("{SUBJECT}.")),
        paragraph(
            "True curve mup = 0.35, sp = 0.15; friction noise of standard deviation 0.04, told to the \
             filter and inflated three times by it; slips (i/40)² for i = 0..40; start (0.6, 0.2), each \
             give or take itself.",
        ),
        paragraph(&format!(
            "This page is written by the command below as `study-article/article.md`, with figures beside \
             it. It takes a few seconds and gives the same bytes whatever the number of cores: {streams} \
             streams of noise, ChaCha8 seeded with {seed} to {last}."
        )),
        format!("```\n{}\n```\n", paper.options.command()),
        "## Statements\n".to_owned(),
        paragraph(ABOUT_VERDICTS),
        paper.statements_table().markdown(),
        "## Errors against the Cramér-Rao bound\n".to_owned(),
        paragraph(ABOUT_YARDSTICK),
        paper.yardstick_table().markdown(),
        paragraph(&paper.missing_estimates()),
        "## The second pass\n".to_owned(),
        paragraph(ABOUT_SECOND_PASS),
        paper.second_start_table().markdown(),
    ]
    .join("\n")
}

fn table_block(table: Table) -> Block {
    // Verdicts, names and figures stay on one line; longer text may break.
    let unbroken = |cell: String| match cell.len() {
        ..=16 => cell.replace(' ', "\u{a0}"),
        _ => cell,
    };
    let rows = table.rows.into_iter();
    let rows = rows.map(|row| row.into_iter().map(unbroken));
    Block::Table(muslip_report::Table::new(table.head, rows))
}
