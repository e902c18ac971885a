//! `cargo xtask estimators`: the accuracy part of `docs/estimators.md`, and what its peers in Python make of it.

use std::fs;
use std::process::Command;

use anyhow::Result;

use crate::figures::replaced_between;
use crate::step::{cargo, command, output, root, run};

/// Where the tables are.
const DOCUMENT: &str = "docs/estimators.md";
const SCRIPT: &str = "docs/scripts/peers.py";
/// Streams a curve that scipy sees at most; a fit of it takes a millisecond.
const MOST_FOR_SCIPY: u64 = 1000;
/// Where the peers' streams are written, below the root.
const STREAMS: &str = "target/streams.jsonl";

/// Prints the tables; `write` puts them into their document, `python` adds scipy and filterpy.
pub fn run_all(streams: u64, write: bool, python: Option<&str>) -> Result<()> {
    let accuracy = output(study(&[&streams.to_string()]))?;
    table("accuracy", &accuracy, write)?;
    let Some(python) = python else {
        return Ok(());
    };
    run(
        "streams for the peers",
        study(&[
            &streams.min(MOST_FOR_SCIPY).to_string(),
            "--export",
            STREAMS,
        ]),
    )?;
    for (name, arguments) in [
        ("peers", vec![SCRIPT, "accuracy", STREAMS]),
        ("rate", vec![SCRIPT, "rate"]),
    ] {
        table(name, &output(command(python, &arguments))?, write)?;
    }
    Ok(())
}

fn study(arguments: &[&str]) -> Command {
    let mut command = cargo(&[
        "run",
        "--release",
        "--locked",
        "--quiet",
        "--package",
        "study-estimators",
        "--",
    ]);
    command.args(arguments);
    command
}

/// Prints a part of the document and, if asked, puts it between the marks of its name.
fn table(name: &str, text: &str, write: bool) -> Result<()> {
    print!("{text}");
    if write {
        let path = root().join(DOCUMENT);
        let marks = marks(name);
        let [begin, end] = &marks;
        let document = fs::read_to_string(&path)?;
        fs::write(path, replaced_between(&document, [begin, end], text)?)?;
    }
    Ok(())
}

fn marks(name: &str) -> [String; 2] {
    [
        format!("<!-- {name} -->"),
        format!("<!-- end of {name} -->"),
    ]
}

#[cfg(test)]
mod tests {
    use super::{DOCUMENT, marks};
    use crate::figures::replaced_between;
    use crate::step::root;

    #[test]
    fn the_document_has_a_place_for_each_table() {
        let document = std::fs::read_to_string(root().join(DOCUMENT)).unwrap();
        for name in ["accuracy", "peers", "rate", "cycles"] {
            let [begin, end] = marks(name);
            let written = replaced_between(&document, [&begin, &end], "a table\n").unwrap();
            assert!(
                written.contains(&format!("{begin}\na table\n{end}")),
                "{name}"
            );
        }
    }
}
