//! The `muslip` command, built for the tests of this package.
#![forbid(unsafe_code)]

/// That of the command.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    muslip_cli::main()
}
