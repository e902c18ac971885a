//! docs/rig.md prints what the controller's own tables say.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use std::fmt::Write;

use muslip_control::ceiling::CEILINGS;

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rig.md");
const MARKS: [&str; 2] = ["<!-- ceilings -->\n", "<!-- end of ceilings -->"];

fn table() -> String {
    let mut table = String::from(
        "| parameter | from | to | unit | beyond it would never fire |\n| --- | --- | --- | --- | --- |\n",
    );
    for ceiling in CEILINGS {
        let interlocks: Vec<String> = ceiling
            .interlock
            .split(", ")
            .map(|name| format!("`{name}`"))
            .collect();
        writeln!(
            table,
            "| `{}` | {} | {} | {} | {} |",
            ceiling.parameter,
            ceiling.lowest,
            ceiling.highest,
            ceiling.unit,
            interlocks.join(", ")
        )
        .unwrap();
    }
    table
}

#[test]
fn the_ceilings_of_the_parameters_are_those_of_the_controller() {
    let page = std::fs::read_to_string(PAGE).unwrap();
    let (before, rest) = page.split_once(MARKS[0]).unwrap();
    let (printed, after) = rest.split_once(MARKS[1]).unwrap();
    if std::env::var_os("MUSLIP_BLESS").is_some() {
        let new = format!("{before}{}{}{}{after}", MARKS[0], table(), MARKS[1]);
        std::fs::write(PAGE, new).unwrap();
        return;
    }
    assert_eq!(
        printed,
        table(),
        "MUSLIP_BLESS=1 cargo test -p pil --test rig_page writes it anew"
    );
}
