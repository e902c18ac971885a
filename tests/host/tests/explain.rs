//! `muslip explain`, and the field guide that is made of the same words.

use std::path::Path;

use crate::common::Scratch;
use muslip_diagnose::mechanism::Id;
use muslip_report::guide::{markdown, pictures};

fn docs() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

#[test]
fn the_page_in_the_repository_is_what_the_command_prints() {
    let page = std::fs::read_to_string(docs().join("mechanisms.md")).unwrap();
    let printed = Scratch::new().output(&["explain", "--markdown"]);
    assert_eq!(printed, markdown());
    assert!(
        page == printed,
        "docs/mechanisms.md is behind: cargo xtask mechanisms"
    );
}

#[test]
fn every_mechanism_has_a_picture_that_shows_it() {
    let pictures = pictures().unwrap();
    assert_eq!(pictures.len(), Id::ALL.len());
    for (id, figure) in pictures {
        let file = docs().join(format!("mechanisms/{}.svg", id.as_str()));
        assert!(file.exists(), "{}: cargo xtask mechanisms", file.display());
        let drawn = muslip_report::FigureFormat::Svg.bytes_of(&figure);
        assert!(drawn.unwrap().len() > 2000, "{}", id.as_str());
    }
}

#[test]
fn a_name_is_explained_however_it_is_written() {
    let scratch = Scratch::new();
    let told = scratch.output(&["explain", "thermal_fade"]);
    assert!(told.starts_with("Thermal fade (thermal_fade)\n"), "{told}");
    for part in [
        "equation",
        "mistaken for",
        "speed sensitivity:",
        "estimator",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    assert_eq!(scratch.output(&["explain", "Thermal-fade"]), told);
    let both = scratch.output(&["explain", "thermal_fade", "brake_lag"]);
    assert!(both.starts_with(&told) && both.contains("Brake lag (brake_lag)"));
}

#[test]
fn without_a_name_all_are_listed_one_a_line() {
    let told = Scratch::new().output(&["explain"]);
    assert_eq!(told.lines().count(), Id::ALL.len());
    for (line, id) in told.lines().zip(Id::ALL) {
        assert!(line.trim_start().starts_with(id.as_str()), "{line}");
    }
}

#[test]
fn an_unknown_name_is_refused_with_those_near_it() {
    for (word, said) in [
        ("termal_fade", "did you mean thermal_fade?"),
        ("lag", "force_lag"),
        ("xyzzyx", "no mechanism \"xyzzyx\" (all of them"),
    ] {
        let told = Scratch::new().complaint(&["explain", "brake_lag", word]);
        assert!(told.contains(said), "{told}");
    }
}
