//! The engine's sources with constants that can be set from outside.
//!
//! What users run has no such thing: a copy of the workspace is changed. Each scalar constant of the two tables becomes one
//! that is [kept](super::kept): where it stands by itself on one side of a comparison that is said, so that the constant can
//! tell whether another value of it would have changed anything.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::step::{command, output, root};

/// What a constant becomes.
const KEPT: &str = include_str!("kept.rs");

/// The engine's sources, ...
const ENGINE: &str = "crates/muslip-diagnose/src";
/// ... its tables of constants there, each with the path that a setting names.
const TABLES: [(&str, &str); 2] = [
    ("constants.rs", "constants"),
    ("audit/constants.rs", "audit::constants"),
];

/// One constant.
#[derive(Debug, PartialEq)]
pub struct Constant {
    table: &'static str,
    name: String,
    kind: String,
    /// Its value.
    pub value: f64,
}

impl Constant {
    /// Table and name.
    pub fn path(&self) -> String {
        format!("{}::{}", self.table, self.name)
    }

    /// Whether its name holds this, or its path begins with it: `audit::`, `constants::LEAST`.
    pub fn is_called(&self, this: &str) -> bool {
        self.name.contains(this) || self.path().starts_with(this)
    }

    /// Halved and doubled; of what is a share or a probability, which doubled would be more than one, its odds are; a count is no
    /// less than one.
    pub fn varied(&self) -> [f64; 2] {
        let factors = [0.5, 2.0];
        if self.kind != "f64" {
            factors.map(|factor| (factor * self.value).round().max(1.0))
        } else if self.is_share() {
            let odds = self.value / (1.0 - self.value);
            factors.map(|factor| factor * odds / (1.0 + factor * odds))
        } else {
            factors.map(|factor| factor * self.value)
        }
    }

    /// Whether it is a number from 0.4 to one without a unit: by its name no time, speed, gain or standard deviation.
    fn is_share(&self) -> bool {
        let of_unit = ["_NATS", "PREDICTED", "STD", "POWER", "SIGMA"];
        let has_unit =
            self.name.ends_with("_S") || of_unit.iter().any(|unit| self.name.contains(unit));
        !has_unit && (0.4..1.0).contains(&self.value)
    }
}

/// Writes the workspace into a folder with constants that can be set, and says which.
///
/// # Errors
/// Where a file cannot be read or written, or a table holds no constant.
pub fn write(folder: &Path) -> Result<Vec<Constant>> {
    let mut constants = Vec::new();
    for (file, table) in TABLES {
        constants.extend(of_table(file, table)?);
    }
    for file in output(command("git", &["ls-files", "-z"]))?.split_terminator('\0') {
        let to = folder.join(file);
        fs::create_dir_all(to.parent().context("a file without a folder")?)?;
        let bytes = fs::read(root().join(file)).with_context(|| file.to_owned())?;
        let of_engine = file.strip_prefix(ENGINE).map(|file| &file[1..]);
        let bytes = match of_engine.filter(|file| file.ends_with(".rs")) {
            Some(file) => changed(file, &String::from_utf8(bytes)?, &constants).into_bytes(),
            None => bytes,
        };
        write_new(&to, &bytes)?;
    }
    Ok(constants)
}

/// The scalar constants of a table of the engine.
fn of_table(file: &str, table: &'static str) -> Result<Vec<Constant>> {
    let file = root().join(ENGINE).join(file);
    let text = fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    let found = found_in(&text, table).with_context(|| file.display().to_string())?;
    ensure!(!found.is_empty(), "no constants in {}", file.display());
    Ok(found)
}

/// A file of the engine with constants that can be set.
fn changed(file: &str, text: &str, constants: &[Constant]) -> String {
    match TABLES.iter().find(|(table, _)| *table == file) {
        Some((_, table)) => settable(text, table, constants),
        None => calling(text, constants),
    }
}

/// Writes what is not there yet: what is stays as old as it is, for whoever builds it.
fn write_new(to: &Path, bytes: &[u8]) -> Result<()> {
    if fs::read(to).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    fs::write(to, bytes).with_context(|| to.display().to_string())
}

/// The scalar constants in the text of a table. Each has a literal for a value: of one that is made of others the function would
/// not compile.
fn found_in(text: &str, table: &'static str) -> Result<Vec<Constant>> {
    let mut found = Vec::new();
    for line in text.lines() {
        let scalar = line.strip_prefix("pub const ").and_then(|line| {
            let (name, rest) = line.split_once(": ")?;
            let (kind, value) = rest.strip_suffix(';')?.split_once(" = ")?;
            matches!(kind, "f64" | "usize" | "isize").then_some((name, kind, value))
        });
        let Some((name, kind, value)) = scalar else {
            continue;
        };
        let value = value.replace('_', "").parse();
        found.push(Constant {
            table,
            name: name.to_owned(),
            kind: kind.to_owned(),
            value: value.with_context(|| format!("{name} has no literal for a value"))?,
        });
    }
    Ok(found)
}

/// A table with functions in place of these constants, and in the first of them what they are made of.
fn settable(text: &str, table: &str, constants: &[Constant]) -> String {
    let of_line = |line: &str| {
        let named = |c: &&Constant| {
            c.table == table && line.starts_with(&format!("pub const {}: ", c.name))
        };
        constants.iter().find(named)
    };
    let mut all = String::new();
    for line in text.lines() {
        match of_line(line) {
            Some(constant) => all.push_str(&functions(constant)),
            None => all.push_str(line),
        }
        all.push('\n');
    }
    if table == TABLES[0].1 {
        all.push_str(&format!("/// Kept constants.\npub mod kept {{\n{KEPT}}}\n"));
    }
    all
}

/// The functions of a constant, by its name: its value, and the constant to be compared.
fn functions(constant: &Constant) -> String {
    let Constant {
        name, kind, value, ..
    } = constant;
    let path = constant.path();
    let [low, high] = constant.varied();
    format!(
        r#"#[must_use]
#[allow(dead_code, non_snake_case, clippy::all, clippy::pedantic)]
pub fn {name}() -> {kind} {{
    {name}_compared().0.taken()
}}
/// The same, to be compared.
#[must_use]
#[allow(dead_code, non_snake_case, clippy::all, clippy::pedantic)]
pub fn {name}_compared() -> crate::constants::kept::Compared<{kind}> {{
    use crate::constants::kept::{{Compared, Kept}};
    static KEPT: std::sync::LazyLock<Kept<{kind}>> = std::sync::LazyLock::new(|| {{
        let varied = [{low:?} as {kind}, {high:?} as {kind}];
        Kept::new("{path}", {value:?} as {kind}, varied, |value| value as {kind})
    }});
    Compared(&KEPT)
}}"#
    )
}

/// Sources that call what they import of a table.
fn calling(text: &str, constants: &[Constant]) -> String {
    let imported = imported(text, constants);
    let mut all = String::new();
    let mut importing = false;
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let code = line.trim_start();
        importing |= is_import(code);
        if importing || code.starts_with("//") {
            all.push_str(line);
        } else {
            let next = lines.peek().map_or("", |next| next.trim_start());
            all.push_str(&called(line, next, &imported));
        }
        importing &= !code.ends_with(';');
        all.push('\n');
    }
    all
}

fn is_import(code: &str) -> bool {
    code.starts_with("use ") || code.starts_with("pub use ")
}

/// Constants that a file imports of a table, by name.
fn imported<'a>(text: &'a str, constants: &'a [Constant]) -> BTreeMap<&'a str, &'a Constant> {
    let mut names = BTreeMap::new();
    for statement in text.split(';') {
        let import = statement.rfind("use ").map(|at| &statement[at..]);
        let Some((of, list)) = import.and_then(|import| import.split_once("constants::")) else {
            continue;
        };
        // Both tables may have a constant of the same name; only the audit imports its own by another path than the crate's.
        let of_audit = !of.ends_with("crate::");
        let [(_, table), (_, of_audit_table)] = TABLES;
        let table = if of_audit { of_audit_table } else { table };
        for name in list.split(|c: char| !is_of_name(c)) {
            let constant = constants
                .iter()
                .find(|c| c.name == name && c.table == table);
            names.extend(constant.map(|constant| (name, constant)));
        }
    }
    names
}

fn is_of_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// A line that calls these constants; with the line that comes after it.
fn called(line: &str, next: &str, constants: &BTreeMap<&str, &Constant>) -> String {
    let mut all = String::new();
    let mut rest = line;
    while let Some(start) = rest.find(is_of_name) {
        let name = &rest[start..];
        let end = name.find(|c| !is_of_name(c)).unwrap_or(name.len());
        let before = line[..line.len() - name.len()].trim_end();
        let after = match name[end..].trim_start() {
            "" => next,
            after => after,
        };
        all.push_str(&rest[..start]);
        match constants.get(&name[..end]) {
            Some(constant) if is_compared(before, after) => {
                let (table, name) = (constant.table, &constant.name);
                all.push_str(&format!("crate::{table}::{name}_compared()"));
            }
            Some(constant) => all.push_str(&format!("{}()", constant.name)),
            None => all.push_str(&name[..end]),
        }
        rest = &name[end..];
    }
    all.push_str(rest);
    all
}

/// Whether what stands between these is one side of a comparison, all of it. Where it cannot be told it is not.
fn is_compared(before: &str, after: &str) -> bool {
    let ends = |text: &str, with: &[&str]| with.iter().any(|end| text.ends_with(end));
    let starts = |text: &str, with: &[&str]| with.iter().any(|start| text.starts_with(start));
    let on_the_right = ends(before, &[" <", " >", " <=", " >="])
        && starts(after, &[")", ",", ";", "&&", "||", "{", "}", "=>"]);
    let on_the_left = starts(after, &["< ", "> ", "<= ", ">= "])
        && ends(before, &["(", "{", "&&", "||", " =", ",", ";", "|"]);
    on_the_right || on_the_left
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "/// Steps.\npub const STEPS: usize = 6_000;\npub const SHARE: f64 = 0.7;\npub const RANGE: (f64, f64) = (0.0, 1.0);\n";

    #[test]
    fn constants_with_a_literal_are_found_and_become_functions() {
        let found = found_in(TABLE, "constants").unwrap();
        let paths: Vec<String> = found.iter().map(Constant::path).collect();
        assert_eq!(paths, ["constants::STEPS", "constants::SHARE"]);
        assert!(found[0].is_called("TEP") && found[0].is_called("constants::"));
        let of_audit = &found_in(TABLE, "audit::constants").unwrap()[0];
        assert!(of_audit.is_called("audit::") && !of_audit.is_called("constants::"));
        let set = settable(TABLE, "constants", &found);
        assert!(set.contains("pub fn STEPS() -> usize"));
        assert!(set.contains("let varied = [3000.0 as usize, 12000.0 as usize];"));
        assert!(set.contains("pub mod kept {"));
        assert!(set.contains("pub const RANGE: (f64, f64)"));
        assert!(!set.contains("pub const STEPS"));
    }

    #[test]
    fn each_scalar_of_the_engine_s_tables_can_be_set() {
        for (file, table) in TABLES {
            of_table(file, table).unwrap();
        }
        let made_of_another = "pub const LEAST_T: f64 = 2.0;\npub const AGREED: f64 = LEAST_T;\n";
        assert!(found_in(made_of_another, "constants").is_err());
    }

    #[test]
    fn a_share_stays_below_one_and_a_count_above_nothing() {
        let of = |name: &str, kind: &str, value| {
            Constant {
                table: "constants",
                name: name.into(),
                kind: kind.into(),
                value,
            }
            .varied()
        };
        assert_eq!(of("LEAST_T", "f64", 3.0), [1.5, 6.0]);
        assert_eq!(of("MOST_NAMES", "usize", 1.0), [1.0, 2.0]);
        // Odds of nine to one become four and a half and eighteen to one.
        let [lower, higher] = of("TIED", "f64", 0.9);
        assert!((lower - 9.0 / 11.0).abs() < 1e-12 && (higher - 18.0 / 19.0).abs() < 1e-12);
        assert_eq!(of("OWN_LAG_S", "f64", 0.8), [0.4, 1.6]);
    }

    #[test]
    fn only_what_a_file_imports_of_a_table_is_called() {
        let table = "pub const LEAST_T: f64 = 2.0;\npub const SHARE: f64 = 0.7;\n";
        let constants = found_in(table, "constants").unwrap();
        let text = "use crate::constants::{\n    LEAST_T, RANGE, SHARE,\n};\n// LEAST_T\nconst STEP_SHARE: f64 = 0.5;\nlet t = LEAST_T * STEP_SHARE + SHARES + SHARE + RANGE.0;\n";
        let all = calling(text, &constants);
        assert!(all.ends_with(
            "// LEAST_T\nconst STEP_SHARE: f64 = 0.5;\nlet t = LEAST_T() * STEP_SHARE + SHARES + SHARE() + RANGE.0;\n"
        ));
        assert!(all.starts_with("use crate::constants::{\n    LEAST_T, RANGE, SHARE,\n};\n"));
    }

    #[test]
    fn what_is_all_of_one_side_of_a_comparison_is_compared() {
        let constants = found_in("pub const LEAST_T: f64 = 2.0;\n", "audit::constants").unwrap();
        let is = |code: &str| {
            let text = format!("use super::constants::LEAST_T;\n{code}\n");
            calling(&text, &constants).contains("crate::audit::constants::LEAST_T_compared()")
        };
        for code in [
            "if t > LEAST_T && u {",
            "(t >= LEAST_T).then(f)",
            "a > 0.0\n    && t < LEAST_T\n    && b",
            "let seen = LEAST_T <= t;",
            "all.filter(|t| LEAST_T < *t)",
        ] {
            assert!(is(code), "{code}");
        }
        for code in [
            "if t > LEAST_T * u {",
            "if t > LEAST_T as f64 {",
            "if t > LEAST_T.max(u) {",
            "a > LEAST_T\n    * b",
            "let seen = 2.0 * LEAST_T <= t;",
            "f(LEAST_T)",
            "let least: Vec<LEAST_T> = of;",
        ] {
            assert!(!is(code), "{code}");
        }
    }
}
