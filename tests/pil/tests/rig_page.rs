//! docs/rig.md prints what the controller's own tables say.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use std::fmt::Write;

use muslip_control::ceiling::{CEILINGS, Ceiling, RANGES};

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rig.md");

/// A table of the page: its marks, its last column, and what is in it.
struct Printed {
    marks: [&'static str; 2],
    beyond: &'static str,
    ranges: &'static [Ceiling],
}

const TABLES: [Printed; 2] = [
    Printed {
        marks: ["<!-- ceilings -->\n", "<!-- end of ceilings -->"],
        beyond: "beyond it would never fire",
        ranges: &CEILINGS,
    },
    Printed {
        marks: ["<!-- ranges -->\n", "<!-- end of ranges -->"],
        beyond: "beyond it would end a run",
        ranges: &RANGES,
    },
];

fn table(printed: &Printed) -> String {
    let mut table = format!(
        "| parameter | from | to | unit | {} |\n| --- | --- | --- | --- | --- |\n",
        printed.beyond
    );
    for ceiling in printed.ranges {
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
fn the_ranges_of_the_parameters_are_those_of_the_controller() {
    for printed in &TABLES {
        let page = std::fs::read_to_string(PAGE).unwrap();
        let [start, end] = printed.marks;
        let (before, rest) = page.split_once(start).unwrap();
        let (found, after) = rest.split_once(end).unwrap();
        let table = table(printed);
        if std::env::var_os("MUSLIP_BLESS").is_some() {
            std::fs::write(PAGE, format!("{before}{start}{table}{end}{after}")).unwrap();
            continue;
        }
        assert_eq!(
            found, table,
            "MUSLIP_BLESS=1 cargo test -p pil --test rig_page writes it anew"
        );
    }
}
