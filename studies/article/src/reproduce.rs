//! The whole of it: how much is computed, and what comes out.

use std::ops::Range as Span;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::monte_carlo::{self, ArticleStream, SecondStart};
use super::statement::{self, Statement};
use super::yardstick::{self, Cell, Errors};

/// How much is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PaperOptions {
    /// Seed of the first stream of noise; the others follow it one by one.
    pub seed: u64,
    /// Number of streams, at least 2.
    pub streams: u64,
}

impl Default for PaperOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            streams: 10_000,
        }
    }
}

impl PaperOptions {
    /// The command that computes the same.
    pub fn command(&self) -> String {
        format!(
            "cargo run -p study-article --release -- --seeds {} --seed {}",
            self.streams, self.seed
        )
    }

    /// The seeds; the numbers start again at 0 after the largest.
    fn seeds(&self) -> impl Fn(u64) -> u64 {
        let first = self.seed;
        move |index| first.wrapping_add(index)
    }
}

/// All that was computed.
#[derive(Debug, Clone)]
pub struct Paper {
    /// How much.
    pub options: PaperOptions,
    /// The article's statements beside ours.
    pub statements: Vec<Statement>,
    /// How the second pass does at the article's curve, by the covariance that it starts with.
    pub second_starts: Vec<(SecondStart, Errors)>,
    /// Errors against the bound over the grid of curves.
    pub yardstick: Vec<Cell>,
}

/// Units of work that [`reproduce`] tells of: streams over the article's curve and each of the grid's.
pub fn work(options: PaperOptions) -> u64 {
    options.streams * (1 + yardstick::grid().len() as u64)
}

/// Computes the table of statements and the yardstick, over all cores. `progress` is told how much of
/// [`work`] is done.
pub fn reproduce(options: PaperOptions, progress: &mut dyn FnMut(u64)) -> Paper {
    let done = AtomicU64::new(0);
    let mut tell = |count: u64| {
        progress(done.fetch_add(count, Ordering::Relaxed) + count);
    };
    let streams = over_streams(options, ArticleStream::of, &mut tell);
    let yardstick = yardstick::grid()
        .into_iter()
        .map(|case| {
            let errors = over_streams(options, |seed| case.errors(seed), &mut tell);
            case.summarised(&errors)
        })
        .collect();
    Paper {
        options,
        statements: statement::all(&streams),
        second_starts: monte_carlo::second_starts(&streams),
        yardstick,
    }
}

/// The article's curve alone, for those who want the streams themselves.
pub fn article_streams(options: PaperOptions) -> Vec<ArticleStream> {
    over_streams(options, ArticleStream::of, &mut |_| {})
}

/// The statements about these streams and about the equations.
pub fn statements(streams: &[ArticleStream]) -> Vec<Statement> {
    statement::all(streams)
}

/// One result a seed, in the order of the seeds whichever thread computed it.
fn over_streams<R: Send>(
    options: PaperOptions,
    job: impl Fn(u64) -> R + Sync,
    tell: &mut dyn FnMut(u64),
) -> Vec<R> {
    const AT_ONCE: u64 = 1000;
    let seed = options.seeds();
    let mut results = Vec::with_capacity(usize::try_from(options.streams).unwrap_or(0));
    let mut next = 0;
    while next < options.streams {
        let span: Span<u64> = next..options.streams.min(next + AT_ONCE);
        let seeds: Vec<u64> = span.clone().map(&seed).collect();
        results.par_extend(seeds.into_par_iter().map(&job));
        tell(span.end - span.start);
        next = span.end;
    }
    results
}
