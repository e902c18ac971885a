//! The contract that other programs read our files by: its words and its schema are in `docs/contract`, and what we
//! write keeps to them.

use crate::diagnosis::{assert_valid, contract, partly_explained, shared_contract, with_chain};
use muslip_analysis::diagnose::json::{make_finite, to_text};
use muslip_diagnose::mechanism::Id;
use serde_json::Value;

/// The contract's files.
const FILES: [&str; 5] = [
    "CHANNELS.md",
    "DIAGNOSIS.md",
    "ESTIMATE.md",
    "PYTHON.md",
    "diagnosis.schema.json",
];

/// Lines of one text that the other lacks.
fn lacking<'a>(of: &'a str, from: &str) -> Vec<&'a str> {
    of.lines()
        .filter(|line| !line.trim().is_empty() && !from.lines().any(|other| other == *line))
        .collect()
}

#[test]
fn a_diagnosis_is_one_by_the_repository_s_schema_and_by_the_shared_one() {
    let mut diagnosis = with_chain(partly_explained());
    make_finite(&mut diagnosis);
    assert_valid(&to_text(&diagnosis).unwrap());
}

#[test]
fn the_vocabulary_is_the_schema_s_in_its_order() {
    let schema: Value = serde_json::from_str(&contract("diagnosis.schema.json")).unwrap();
    let words: Vec<&str> = schema["$defs"]["mechanism_id"]["enum"]
        .as_array()
        .unwrap()
        .iter()
        .map(|word| word.as_str().unwrap())
        .collect();
    let ours: Vec<&str> = Id::ALL.iter().map(|id| id.as_str()).collect();
    assert_eq!(ours, words);
    let said = contract("DIAGNOSIS.md");
    for id in Id::ALL {
        let row = format!("| `{}` | {} |", id.as_str(), id.balance().as_str());
        assert!(said.contains(&row), "{row}");
    }
}

/// Prints what the two copies of the contract say differently, for whoever brings them together: words may be ahead
/// on either side, and are no reason to fail.
#[test]
fn differences_of_the_words_are_printed() {
    for name in FILES {
        let ours = contract(name);
        let Some(theirs) = shared_contract(name) else {
            println!("{name}: no shared copy to compare with");
            continue;
        };
        for line in lacking(&ours, &theirs) {
            println!("{name}, here only:   {line}");
        }
        for line in lacking(&theirs, &ours) {
            println!("{name}, shared only: {line}");
        }
    }
}

#[test]
fn lines_that_the_other_text_lacks_are_differences() {
    assert_eq!(lacking("a\nb\n\nc", "c\na"), ["b"]);
    assert!(lacking("a\n", "b\na\n").is_empty());
}
