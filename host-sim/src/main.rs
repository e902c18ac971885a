//! The `muslip` command.
fn main() {}
