//! docs/safety.md knows every fault, and every test that it names is there.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use std::fs;
use std::path::{Path, PathBuf};

use muslip_record::Fault;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn page() -> String {
    fs::read_to_string(Path::new(ROOT).join("docs/safety.md")).unwrap()
}

/// The cells of every row of the tables before this heading, or of those after it.
fn rows(part: &str) -> Vec<Vec<&str>> {
    part.lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| fault |"))
        .filter(|line| !line.starts_with("| ---"))
        .map(|line| {
            let cells = line.trim_matches('|').split(" | ");
            cells.map(str::trim).collect()
        })
        .collect()
}

/// All sources in which a test may be.
fn sources() -> String {
    let mut text = String::new();
    let mut folders: Vec<PathBuf> = [
        "crates/muslip-control",
        "firmware",
        "tests/pil",
        "crates/muslip/tests",
    ]
    .iter()
    .map(|folder| Path::new(ROOT).join(folder))
    .collect();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                text += &fs::read_to_string(path).unwrap();
            }
        }
    }
    text
}

#[test]
fn every_fault_has_its_row() {
    let page = page();
    for fault in Fault::ALL {
        let name = format!("`{fault:?}`");
        assert!(page.contains(&name), "docs/safety.md does not know {name}");
    }
}

#[test]
fn every_row_has_what_shows_it_or_why_nothing_does_and_what_must_be_outside() {
    let page = page();
    let (found, not_found) = page.split_once("## Not detected").unwrap();
    let (found, not_found) = (rows(found), rows(not_found));
    assert!(found.len() > 40 && not_found.len() > 8);
    for row in found {
        assert_eq!(row.len(), 4, "{row:?}");
        let shown = [
            "pil ",
            "pil: ",
            "control ",
            "firmware ",
            "cargo test",
            "by review",
            "see below",
            "the same",
        ];
        let is_shown = shown.iter().any(|way| row[3].contains(way));
        assert!(is_shown, "nothing shows {row:?}");
    }
    for row in not_found {
        assert!(
            row.len() == 3 && row.iter().all(|cell| cell.len() > 5),
            "{row:?}"
        );
    }
}

#[test]
fn every_test_that_the_page_names_is_there() {
    let (page, sources) = (page(), sources());
    // Names in backticks with more than one underscore are tests, but for one that is cut short.
    let named = page.split('`').skip(1).step_by(2);
    let mut tests = 0;
    for name in named.filter(|name| name.matches('_').count() > 2 && !name.contains(' ')) {
        let name = name.trim_end_matches('.');
        assert!(
            sources.contains(&format!("fn {name}")),
            "no test is called {name}"
        );
        tests += 1;
    }
    assert!(tests > 25, "{tests}");
}
