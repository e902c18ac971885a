//! `muslip completions`.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::failure::Failure;
use super::terminal::Terminal;

/// Print a shell's completion script.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
muslip completions bash > ~/.local/share/bash-completion/completions/muslip\n  \
muslip completions fish > ~/.config/fish/completions/muslip.fish")]
pub(super) struct Arguments {
    /// The shell.
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

pub(super) fn run(arguments: &Arguments, terminal: &mut Terminal) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut super::Arguments::command(),
        "muslip",
        &mut script,
    );
    terminal.bytes(&script)
}
