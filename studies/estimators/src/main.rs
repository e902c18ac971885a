//! The estimators side by side: prints `docs/estimators.md`'s part on accuracy.
//!
//! `cargo run -p study-estimators --release -- [STREAMS] [--export FILE]`; `cargo xtask estimators --write`
//! puts the page where it belongs. A quarter of an hour with 10,000 streams on two cores.
#![allow(clippy::unwrap_used, reason = "a program that may end by panicking")]

mod accuracy;
mod conditions;
mod contenders;
mod export;
mod innovations;
mod kalman;
mod page;
mod particle;
mod posterior;
mod robust;
mod sparse;
mod streams;
mod summary;
mod tracking;
mod truth;

use std::path::PathBuf;

use clap::Parser;
use muslip::filter::efficient::EfficientFilter;
use page::Page;

/// The estimators side by side, on the same streams of noise.
#[derive(Parser)]
struct Arguments {
    /// Streams of noise a curve.
    #[arg(default_value_t = 10_000)]
    streams: u64,
    /// Instead of the page: write streams and estimates for other programs, JSON, one stream a line.
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let Arguments { streams, export } = Arguments::parse();
    if let Some(path) = export {
        return export::export(&path, streams);
    }
    let mut page = Page::default();
    accuracy::accuracy(&mut page, streams);
    conditions::conditions(&mut page, streams);
    tracking::tracking(&mut page, streams);
    sparse::sparse(&mut page);
    truth::truth(&mut page, streams);
    let bytes = size_of::<EfficientFilter<f32>>();
    page.bar(
        "state, configuration included, `f32`",
        "at most 512 bytes",
        format!("{bytes} bytes"),
        bytes <= 512,
    );
    println!("ChaCha8 streams, seeds from 0.\n");
    print!("{}", page.into_text());
    Ok(())
}
