//! The `muslip` command, built for the tests of this package.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    muslip_cli::main()
}
