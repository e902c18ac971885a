//! Multi-step project commands.
fn main() {}
