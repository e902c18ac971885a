//! The `muslip` command; everything it does is in `muslip_cli`.
#![forbid(unsafe_code)]

/// The analyses allocate and free columns of a run's length all the time; the system's allocator hands such pages
/// back at once and faults them in again, which costs a third of the time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    muslip_cli::main()
}
