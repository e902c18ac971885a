//! What the command-line tests share: the command, a scratch folder, recordings, measured data.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// What a JSON schema has against a value.
pub fn complaint(schema: Value, value: &Value) -> Option<String> {
    const HERE: &str = "memory:///schema.json";
    let (mut compiler, mut schemas) = (boon::Compiler::new(), boon::Schemas::new());
    compiler
        .add_resource(HERE, schema)
        .expect("the schema is JSON");
    let schema = compiler
        .compile(HERE, &mut schemas)
        .unwrap_or_else(|error| panic!("the schema is one: {error:#}"));
    let complaint = schemas.validate(value, schema).err();
    complaint.map(|error| format!("{error:#}"))
}

/// A rig with a brake and no declared noise.
pub const RIG: &str = "\
[wheel]
radius_m = 0.31
inertia_kg_m2 = 1.25

[vehicle]
mass_kg = 420.0
coasting = true

[brake]
torque_per_pressure_nm_pa = 3.2e-4

[tyre]
law = \"rudd\"
peak_friction = 0.85
critical_slip = 0.14
";

/// The header of a recording's required columns.
pub const HEADER: &str = "time_s,wheel_speed_rad_s,vehicle_speed_m_s,drag_force_n,normal_force_n";

/// A folder of its own for a test, in which commands are run.
pub struct Scratch {
    folder: TempDir,
}

impl Scratch {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// A folder with `rig.toml` in it.
    pub fn with_rig(rig: &str) -> Self {
        let scratch = Self::new();
        scratch.write("rig.toml", rig);
        scratch
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        fs::write(self.path(name), contents).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Names of all files in the folder, sorted.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// The command, run in this folder.
    pub fn muslip(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_muslip-under-test"));
        command
            .current_dir(self.folder.path())
            .env_remove("NO_COLOR")
            .env_remove("CLICOLOR_FORCE")
            .env("COLUMNS", "100")
            .args(arguments);
        command
    }

    /// Standard output of a command that must succeed and say nothing on standard error.
    pub fn output(&self, arguments: &[&str]) -> String {
        let output = self.muslip(arguments).output().unwrap();
        let complaint = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {complaint}");
        assert_eq!(complaint, "", "{arguments:?}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// The JSON that a command prints, which must be all that it prints.
    pub fn json(&self, arguments: &[&str]) -> serde_json::Value {
        serde_json::from_str(&self.output(arguments)).unwrap()
    }

    /// The one line of complaint of a command that must end with status 2 and print nothing.
    pub fn complaint(&self, arguments: &[&str]) -> String {
        let output = self.muslip(arguments).output().unwrap();
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {complaint}");
        assert_eq!(output.stdout, b"", "{arguments:?}");
        assert_eq!(complaint.lines().count(), 1, "{complaint}");
        assert!(complaint.ends_with('\n'));
        complaint.trim_end().to_owned()
    }
}

/// A command line as its arguments; none of them has a space in it.
pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Points of the article's run as a recording at 30 m/s under 1000 N.
pub fn recording_of(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let mut text = format!("{HEADER}\n");
    for (index, (slip, friction)) in points.into_iter().enumerate() {
        let wheel_speed = 30.0 * (1.0 - slip) / 0.31;
        text += &format!(
            "{},{wheel_speed},30,{},1000\n",
            0.01 * index as f64,
            1000.0 * friction
        );
    }
    text
}

/// A number of a JSON document by its path, `a.b.c`.
pub fn number(value: &serde_json::Value, path: &str) -> f64 {
    path.split('.')
        .fold(value, |value, key| &value[key])
        .as_f64()
        .unwrap_or_else(|| panic!("{path} is no number in {value}"))
}

/// The folder of measured recordings, which lies beside the project and is not part of it.
///
/// Where it is absent a test has nothing to test: it says so and ends, but on a machine that calls
/// itself `CI` the folder must be there. `MUSLIP_SHARED` names it where it lies elsewhere.
pub fn measured_data(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("MUSLIP_SHARED").map_or(beside, PathBuf::from);
    let folder = shared.join("data").join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "measured data is missing: {}",
        folder.display()
    );
    eprintln!("not tested: no measured data at {}", folder.display());
    None
}
