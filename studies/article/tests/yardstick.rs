//! Errors over the grid of curves against the Cramér-Rao bound, and the command.
#![expect(clippy::unwrap_used, reason = "a failed step fails the test")]

use std::path::Path;
use std::process::{Command, Output};

use nalgebra::{Matrix2, SVector};
use num_dual::{DualNum, DualSVec64, gradient};
use study_article::{Contender, Paper, PaperOptions, article_markdown, reproduce, slips, work};
use test_support::Tolerance;

/// The command, run in a folder as wide as a page.
fn study(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_study-article"))
        .current_dir(folder)
        .env("COLUMNS", "100")
        .args(arguments)
        .output()
        .unwrap()
}

/// What it prints; it must succeed and complain of nothing.
fn told(folder: &Path, arguments: &[&str]) -> String {
    let output = study(folder, arguments);
    assert!(output.status.success() && output.stderr.is_empty());
    String::from_utf8(output.stdout).unwrap()
}

fn paper(streams: u64) -> Paper {
    reproduce(PaperOptions { seed: 5, streams }, &mut |_| {})
}

#[test]
fn the_bound_is_that_of_automatic_derivatives() {
    for cell in paper(2).yardstick {
        let truth = SVector::from([cell.truth.peak_friction, cell.truth.critical_slip]);
        let mut information = Matrix2::zeros();
        for slip in slips() {
            let (_, h) = gradient(
                |v: SVector<DualSVec64<2>, 2>| {
                    let [mup, sp] = v.data.0[0];
                    let r = sp.recip() * slip;
                    mup * r * 2.0 / (r * r + 1.0)
                },
                &truth,
            );
            information += h * h.transpose() / (0.04 * 0.04);
        }
        let covariance = information.try_inverse().unwrap();
        let near = Tolerance::relative(1e-10);
        near.check(
            "mup",
            cell.bound.peak_friction_std,
            covariance[(0, 0)].sqrt(),
        );
        near.check(
            "sp",
            cell.bound.critical_slip_std,
            covariance[(1, 1)].sqrt(),
        );
    }
}

#[test]
fn the_batch_fit_meets_the_bound_and_the_second_pass_comes_nearer_to_it_than_the_first() {
    for cell in paper(2000).yardstick {
        let [filter, second, fit] = cell.errors.map(|(_, errors)| errors);
        assert_eq!(
            [filter, second, fit].map(|errors| errors.without_estimate),
            [0, 0, 0]
        );
        let ratio = fit.peak_friction.rmse / cell.bound.peak_friction_std;
        let chance = 4.0 * fit.peak_friction.rmse_standard_error / cell.bound.peak_friction_std;
        assert!((ratio - 1.0).abs() < chance, "{:?}: {ratio}", cell.truth);
        assert!(fit.peak_friction.bias.abs() < 0.1 * cell.bound.peak_friction_std);
        // A filter that starts within reach of its prior has nothing to gain; elsewhere it must.
        if filter.peak_friction.rmse > 1.2 * cell.bound.peak_friction_std {
            assert!(second.peak_friction.rmse < filter.peak_friction.rmse);
            assert!(second.critical_slip.rmse < filter.critical_slip.rmse);
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_digit() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let paper = pool.install(|| paper(300));
        (paper.to_json().to_string(), article_markdown(&paper))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn progress_ends_where_the_work_does() {
    let options = PaperOptions {
        seed: 1,
        streams: 1500,
    };
    let mut told = Vec::new();
    reproduce(options, &mut |done| told.push(done));
    assert!(told.is_sorted());
    assert_eq!(told.last(), Some(&work(options)));
}

#[test]
fn the_command_writes_pages_that_need_no_network_and_prints_a_line_a_statement() {
    let folder = tempfile::tempdir().unwrap();
    let told = told(folder.path(), &["--seeds", "20", "--out", "out"]);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    for verdict in ["reproduced", "within the band", "not reproduced"] {
        assert!(told.contains(verdict), "{told}");
    }
    assert_eq!(
        told.lines()
            .filter(|line| line.starts_with("filter's "))
            .count(),
        2
    );
    assert_eq!(
        told.lines()
            .filter(|line| line.contains("batch fit  "))
            .count(),
        12
    );
    let widest = told.lines().map(|line| line.chars().count()).max().unwrap();
    assert!(widest <= 120, "{widest}");

    for page in ["out/report.html", "out/convergence.html"] {
        let page = read(page);
        assert!(page.contains("default-src 'none'") && page.ends_with("</html>"));
        for outside in [" src=", "url(", "@import"] {
            assert!(!page.contains(outside), "{outside}");
        }
    }
    let report = read("out/report.html");
    assert!(report.contains("href=\"convergence.html\""));
    assert!(read("out/convergence.html").contains("id=\"player\""));
    assert!(read("out/article.md").starts_with("# The article"));
    let drawings = std::fs::read_dir(folder.path().join("out/figures")).unwrap();
    for drawing in drawings {
        let drawing = std::fs::read_to_string(drawing.unwrap().path()).unwrap();
        assert!(drawing.starts_with("<svg xmlns") && !drawing.contains("NaN"));
    }
}

#[test]
fn the_command_prints_json_with_every_figure() {
    let folder = tempfile::tempdir().unwrap();
    let told = told(folder.path(), &["--seeds", "20", "--seed", "9", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!(json["seeds"], 20);
    let statements = json["statements"].as_array().unwrap();
    assert!(statements.iter().all(|it| it["about"].is_string()));
    let cells = json["yardstick"].as_array().unwrap();
    assert_eq!(cells.len(), 12);
    for cell in cells {
        for contender in Contender::ALL {
            for quantity in ["peak_friction", "critical_slip"] {
                let rmse = &cell["estimators"][contender.key()][quantity]["rmse"];
                assert!(rmse.as_f64().unwrap() > 0.0);
            }
        }
    }
    assert!(folder.path().join("study-article/report.html").is_file());
    let refused = study(folder.path(), &["--seeds", "1"]);
    let complaint = String::from_utf8(refused.stderr).unwrap();
    assert!(complaint.contains("--seeds"), "{complaint}");
}

#[test]
fn the_documentation_has_every_statement_and_names_its_command() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/article.md");
    let page = std::fs::read_to_string(path).unwrap();
    assert!(page.contains("cargo run -p study-article --release -- --seeds 10000 --seed 1\n"));
    // Text and labels are those of the present code; figures are the command's.
    let fresh = article_markdown(&reproduce(
        PaperOptions {
            seed: 1,
            streams: 50,
        },
        &mut |_| {},
    ));
    // Rows by their first cell, prose as it is but for the sentences that count streams.
    let frame = |text: &str| -> Vec<String> {
        text.lines()
            .filter(|line| {
                !["This page", "cargo run", "Of "]
                    .iter()
                    .any(|it| line.starts_with(it))
            })
            .map(|line| match line.strip_prefix("| ") {
                Some(row) => row.split(" | ").next().unwrap_or("").to_owned(),
                None => line.to_owned(),
            })
            .collect()
    };
    assert_eq!(frame(&page), frame(&fresh));
}
