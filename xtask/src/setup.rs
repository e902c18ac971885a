//! What the tests need beyond a Rust toolchain: rustup targets and system packages.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::step::{cargo, command, run, target};

/// Targets that the core is built for.
pub const TARGETS: [&str; 3] = [
    "thumbv7em-none-eabihf",
    "thumbv6m-none-eabi",
    "wasm32-unknown-unknown",
];

/// The version of cargo-deny that `deny.toml` is written for.
const CARGO_DENY: &str = "0.20.2";
/// The version of cargo-mutants that `.cargo/mutants.toml` is written for.
const CARGO_MUTANTS: &str = "27.1.0";

/// A program from a system package.
struct Tool {
    /// Name on the search path.
    program: &'static str,
    /// Debian's package that has it.
    package: &'static str,
    /// What cannot run without it.
    needed_for: &'static str,
}

/// Programs that the tests call.
const TOOLS: &[Tool] = &[
    Tool {
        program: "qemu-system-arm",
        package: "qemu-system-arm",
        needed_for: "the firmware's runs",
    },
    Tool {
        program: "chromium",
        package: "chromium",
        needed_for: "the tests of the pages",
    },
];

/// Programs that the cycles table calls.
const CYCLES_TOOLS: &[Tool] = &[
    Tool {
        program: "qemu-system-arm",
        package: "qemu-system-arm",
        needed_for: "running the candidates",
    },
    Tool {
        program: "arm-none-eabi-objdump",
        package: "binutils-arm-none-eabi",
        needed_for: "reading what was executed",
    },
];

/// What Python environments are made with.
const PYTHON_TOOLS: &[Tool] = &[Tool {
    program: "python3",
    package: "python3-venv",
    needed_for: "the files that the readers are held against, and the Python package",
}];

/// What Spark runs on.
const SPARK_TOOLS: &[Tool] = &[Tool {
    program: "java",
    package: "openjdk-17-jre-headless",
    needed_for: "a fleet of recordings through Spark",
}];

/// What runs programs of another processor.
const EMULATION_TOOLS: &[Tool] = &[Tool {
    program: "qemu-aarch64",
    package: "qemu-user",
    needed_for: "running a wheel for aarch64",
}];

/// The interpreter of a virtual environment below the target folder that has these requirements; made once, and again
/// where they change.
pub fn python_environment(name: &str, requirements: &Path) -> Result<PathBuf> {
    Machine::this().tools(PYTHON_TOOLS)?;
    python_environment_by(Path::new("python3"), name, requirements)
}

/// As [`python_environment`], of this interpreter.
pub fn python_environment_by(
    interpreter: &Path,
    name: &str,
    requirements: &Path,
) -> Result<PathBuf> {
    let pinned =
        fs::read_to_string(requirements).with_context(|| requirements.display().to_string())?;
    let wanted = format!("# {}\n{pinned}", interpreter.display());
    let environment = target().join("tools").join(name);
    let stamp = environment.join("installed.txt");
    let python = environment.join("bin").join("python");
    if fs::read_to_string(&stamp).ok().as_ref() != Some(&wanted) {
        let mut make = command(&interpreter.to_string_lossy(), &["-m", "venv", "--clear"]);
        make.arg(&environment);
        set_up_step(&format!("make the Python environment {name}"), make)?;
        let mut install = command(
            &python.to_string_lossy(),
            &[
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "-r",
            ],
        );
        install.arg(requirements);
        set_up_step(&format!("install what {name} needs"), install)?;
        fs::write(&stamp, &wanted)?;
    }
    Ok(python)
}

/// The interpreter of a Python, as "3.10": on the search path, or one of pyenv's.
pub fn python_of(version: &str) -> Result<PathBuf> {
    let pyenv = std::env::var_os("PYENV_ROOT")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".pyenv")));
    Machine::this().python_of(version, pyenv.as_deref())
}

/// As [`run_all`], for wheels of another processor.
pub fn for_emulation() -> Result<()> {
    Machine::this().tools(EMULATION_TOOLS)
}

/// Adds what rustup has for this target, where it is not there.
pub fn rust_target(target: &str) -> Result<()> {
    Machine::this().targets(&[target])
}

/// As [`run_all`], for a fleet through Spark.
pub fn for_spark() -> Result<()> {
    Machine::this().tools(SPARK_TOOLS)
}

/// As [`run_all`], for `cargo xtask cycles`.
pub fn for_cycles() -> Result<()> {
    Machine::this().set_up(CYCLES_TOOLS)
}

/// As [`run_all`], for `cargo xtask what-if`.
pub fn for_what_if() -> Result<()> {
    Machine::this().set_up(&[])
}

/// Installs what is missing, or says exactly what to install.
pub fn run_all() -> Result<()> {
    Machine::this().set_up(TOOLS)
}

/// The program cargo-deny.
pub fn cargo_deny() -> Result<PathBuf> {
    built("cargo-deny", CARGO_DENY)
}

/// The program cargo-mutants.
pub fn cargo_mutants() -> Result<PathBuf> {
    built("cargo-mutants", CARGO_MUTANTS)
}

/// A program of cargo's, built below the target folder where it is not there yet: takes some minutes.
fn built(name: &str, version: &str) -> Result<PathBuf> {
    let folder = target().join("tools").join(format!("{name}-{version}"));
    let program = folder.join(format!("bin/{name}{}", std::env::consts::EXE_SUFFIX));
    if !program.exists() {
        let mut install = cargo(&["install", "--locked", "--quiet", "--root"]);
        install.arg(&folder).args(["--version", version, name]);
        set_up_step(&format!("build {name} {version}"), install)?;
    }
    Ok(program)
}

/// As [`run`], with all that the command prints on standard error: a set-up is no result.
fn set_up_step(name: &str, mut command: Command) -> Result<()> {
    command.stdout(std::io::stderr());
    run(name, command)
}

/// A machine, as far as it is found along a search path.
struct Machine {
    path: OsString,
}

impl Machine {
    fn this() -> Self {
        Self {
            path: std::env::var_os("PATH").unwrap_or_default(),
        }
    }

    fn set_up(&self, wanted: &[Tool]) -> Result<()> {
        self.targets(&TARGETS)?;
        self.tools(wanted)
    }

    fn python_of(&self, version: &str, pyenv: Option<&Path>) -> Result<PathBuf> {
        let name = format!("python{version}");
        let on_path = std::env::split_paths(&self.path).map(|folder| folder.join(&name));
        let mut of_pyenv: Vec<PathBuf> = pyenv
            .and_then(|root| fs::read_dir(root.join("versions")).ok())
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path().join("bin").join(&name))
            .collect();
        of_pyenv.sort();
        on_path
            .chain(of_pyenv)
            .find(|candidate| {
                // A shim of pyenv is there and runs nothing.
                Command::new(candidate)
                    .args(["-c", "import ensurepip, venv"])
                    .stderr(std::process::Stdio::null())
                    .status()
                    .is_ok_and(|status| status.success())
            })
            .with_context(|| {
                format!(
                    "no Python {version} that can make virtual environments: install {name} and {name}-venv, or \
                     `pyenv install {version}`"
                )
            })
    }

    /// A program of this machine.
    fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = command(program, arguments);
        command.env("PATH", &self.path);
        command
    }

    fn targets(&self, wanted: &[&str]) -> Result<()> {
        let Ok(listed) = self
            .command("rustup", &["target", "list", "--installed"])
            .output()
        else {
            // A toolchain without rustup: its targets are somebody else's work, and the builds will tell.
            return Ok(());
        };
        let installed = String::from_utf8_lossy(&listed.stdout).into_owned();
        let missing: Vec<&str> = wanted
            .iter()
            .copied()
            .filter(|target| !installed.lines().any(|line| line.trim() == *target))
            .collect();
        if missing.is_empty() {
            return Ok(());
        }
        let mut install = self.command("rustup", &["target", "add"]);
        install.args(&missing);
        set_up_step(&format!("install {}", missing.join(", ")), install)
    }

    fn tools(&self, wanted: &[Tool]) -> Result<()> {
        let missing: Vec<&Tool> = wanted
            .iter()
            .filter(|tool| !self.has(tool.program))
            .collect();
        if missing.is_empty() {
            return Ok(());
        }
        let packages: Vec<&str> = missing.iter().map(|tool| tool.package).collect();
        let packages = packages.join(" ");
        if !(self.has("apt-get") && self.is_root()) {
            let reasons: Vec<String> = missing
                .iter()
                .map(|tool| format!("{} for {}", tool.program, tool.needed_for))
                .collect();
            bail!(
                "missing {}; install with: sudo apt-get install {packages}",
                reasons.join(", ")
            );
        }
        set_up_step(
            "update package lists",
            self.command("apt-get", &["update", "-q"]),
        )?;
        let mut install = self.command(
            "apt-get",
            &["install", "-q", "-y", "--no-install-recommends"],
        );
        install
            .args(packages.split(' '))
            .env("DEBIAN_FRONTEND", "noninteractive");
        set_up_step(&format!("install {packages}"), install)
            .with_context(|| format!("install by hand: {packages}"))?;
        match missing.iter().find(|tool| !self.has(tool.program)) {
            None => Ok(()),
            Some(tool) => bail!(
                "package {} is installed but {} is not on the search path",
                tool.package,
                tool.program
            ),
        }
    }

    fn has(&self, program: &str) -> bool {
        std::env::split_paths(&self.path).any(|folder| folder.join(program).is_file())
    }

    fn is_root(&self) -> bool {
        self.command("id", &["-u"])
            .output()
            .is_ok_and(|id| id.stdout.trim_ascii() == b"0")
    }
}

#[cfg(test)]
mod tests {
    use super::{Machine, TARGETS, TOOLS};
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use tempfile::TempDir;

    /// A machine with these programs alone, scripts of a shell; each writes its arguments into a log.
    struct Bare {
        folder: TempDir,
        machine: Machine,
    }

    impl Bare {
        fn new(programs: &[(&str, &str)]) -> Self {
            let folder = tempfile::tempdir().unwrap();
            for (name, script) in programs {
                let path = folder.path().join(name);
                let text = format!(
                    "#!/bin/sh\nhere='{}'\necho \"{name} $*\" >> \"$here/log\"\n{script}\n",
                    folder.path().display()
                );
                fs::write(&path, text).unwrap();
                fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
            }
            let machine = Machine {
                path: folder.path().into(),
            };
            Self { folder, machine }
        }

        fn log(&self) -> String {
            fs::read_to_string(self.folder.path().join("log")).unwrap_or_default()
        }
    }

    const ROOT: (&str, &str) = ("id", "echo 0");
    const INSTALLS: (&str, &str) = (
        "apt-get",
        "[ \"$1\" = install ] && : > \"$here/qemu-system-arm\" && : > \"$here/chromium\"; exit 0",
    );

    #[test]
    fn programs_are_found_on_the_search_path_only() {
        assert!(Machine::this().has("cargo"));
        assert!(!Machine::this().has("no-such-program"));
    }

    #[test]
    fn nothing_is_installed_where_nothing_is_missing() {
        let list = format!("echo '{}'", TARGETS.join("\n"));
        let there = [
            ("qemu-system-arm", ""),
            ("chromium", ""),
            ("rustup", list.as_str()),
            ROOT,
            INSTALLS,
        ];
        let bare = Bare::new(&there);
        bare.machine.set_up(TOOLS).unwrap();
        assert_eq!(bare.log(), "rustup target list --installed\n");
    }

    #[test]
    fn a_bare_machine_gets_the_missing_targets_and_packages() {
        let bare = Bare::new(&[("rustup", "echo thumbv6m-none-eabi"), ROOT, INSTALLS]);
        bare.machine.set_up(TOOLS).unwrap();
        assert_eq!(
            bare.log(),
            "rustup target list --installed\n\
             rustup target add thumbv7em-none-eabihf wasm32-unknown-unknown\n\
             id -u\n\
             apt-get update -q\n\
             apt-get install -q -y --no-install-recommends qemu-system-arm chromium\n"
        );
    }

    #[test]
    fn a_python_is_one_that_runs_on_the_path_or_of_pyenv() {
        // As a shim of pyenv does for a version that is not chosen.
        let shim = Bare::new(&[("python3.10", "exit 127")]);
        let root = shim.folder.path().join("pyenv");
        let error = shim.machine.python_of("3.10", Some(&root)).unwrap_err();
        assert!(error.to_string().contains("pyenv install 3.10"), "{error}");

        let bin = root.join("versions/3.10.13/bin");
        fs::create_dir_all(&bin).unwrap();
        fs::copy("/bin/true", bin.join("python3.10")).unwrap();
        let found = shim.machine.python_of("3.10", Some(&root)).unwrap();
        assert_eq!(found, bin.join("python3.10"));

        let whole = Bare::new(&[("python3.10", "")]);
        let found = whole.machine.python_of("3.10", Some(&root)).unwrap();
        assert_eq!(found, whole.folder.path().join("python3.10"));
    }

    #[test]
    fn who_may_not_install_is_told_what_to_install() {
        for programs in [&[("id", "echo 1000"), INSTALLS][..], &[ROOT]] {
            let bare = Bare::new(programs);
            let told = bare.machine.tools(TOOLS).unwrap_err().to_string();
            assert!(
                told.ends_with("install with: sudo apt-get install qemu-system-arm chromium"),
                "{told}"
            );
            assert!(!bare.log().contains("apt-get"));
        }
    }

    #[test]
    fn an_installation_that_fails_or_brings_nothing_is_an_error() {
        for apt in ["[ \"$1\" = update ]", "exit 0", "exit 1"] {
            let bare = Bare::new(&[ROOT, ("apt-get", apt)]);
            assert!(bare.machine.tools(TOOLS).is_err(), "{apt}");
        }
    }
}
