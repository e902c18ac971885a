//! Columns of everything that a linear decision weighs: base law, nuisances of the measuring chain, mechanisms.

use rayon::prelude::*;

use super::dependence::{Dependence, width};
use super::derivatives::slopes_in;
use super::gram::Columns;
use super::noise::Slopes;
use super::nuisances::nuisances;
use super::rows::{Rows, Triple, moved_rows, rows_of};
use crate::correction::Levers;
use crate::data::Data;
use crate::mechanism::{Id, Residuals, Search};
use crate::model::{Model, Term};

/// A mechanism at one place of its nonlinear parameters, or a free dependence.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Entry of the catalogue; `None` for a free dependence.
    pub entry: Option<usize>,
    /// Its id; `None` for a free dependence.
    pub id: Option<Id>,
    /// Parameters at which the columns were taken.
    pub start: Vec<f64>,
    /// Parameters that the columns belong to; empty where the one column is the whole effect at the start.
    pub free: Vec<usize>,
    /// First of its columns, counted from the first candidate's, and their number.
    pub columns: core::ops::Range<usize>,
}

/// Columns of one run that every model has, as means over blocks.
struct OfRun {
    /// Residual, base, terms and free dependences.
    columns: Vec<Triple>,
    nuisances: Vec<(f64, Triple)>,
    /// The residual sample by sample, where candidates are asked for.
    here: Option<Triple>,
}

/// A mechanism's own columns as means over blocks: the parameters that they belong to, and the columns by run.
type Own = (Vec<usize>, Vec<Vec<Triple>>);

/// Everything that enters, by run: `[balance][run][column]`; the residual first, then base, nuisances, candidates.
pub struct Table {
    /// Columns by balance and run.
    pub columns: [Vec<Columns>; 3],
    /// Columns of the base law, of terms and of free dependences.
    pub base: usize,
    /// Those of free dependences among them, the last ones.
    pub free: usize,
    /// Prior standard deviations of the coefficients of the measuring chain's nuisances, one column each.
    pub nuisances: Vec<f64>,
    /// Mechanisms.
    pub candidates: Vec<Candidate>,
}

fn values(rows: Rows<f64>) -> Triple {
    [rows.tyre, rows.wheel, rows.vehicle]
}

/// Means over the blocks of one run.
fn means(data: &Data, run: usize, triple: &Triple) -> Triple {
    core::array::from_fn(|b| data.blocks[run][b].mean(&triple[b]))
}

fn plain(data: &Data, model: &Model, run: usize) -> Triple {
    values(rows_of(data, model, run))
}

/// All columns of a campaign about a model; the chain's nuisances are of its slopes and, in the levels, of a force in N.
#[must_use]
pub fn table(
    data: &Data,
    model: &Model,
    chain: (&Slopes, &[Vec<f64>]),
    evidence: &[Residuals],
    extra: &[Dependence],
    free: &[Dependence],
    wanted: &dyn Fn(Id) -> bool,
) -> Table {
    let runs = data.series.len();
    let fixed = model.free_places();
    let levers = (extra.len() + free.len() > 0).then(|| Levers::new(data, model));
    let columns_of = |dependence: &Dependence, run: usize| {
        let levers = levers.as_ref();
        levers.map_or(Vec::new(), |levers| dependence.columns(data, levers, run))
    };
    let starts = starts(data, model, evidence, wanted);
    let per_run: Vec<OfRun> = (0..runs)
        .into_par_iter()
        .map(|run| {
            let mut all = vec![plain(data, model, run)];
            all.extend(slopes_in(data, model, run, &fixed));
            for dependence in extra {
                all.extend(columns_of(dependence, run));
            }
            OfRun {
                columns: all.iter().map(|own| means(data, run, own)).collect(),
                nuisances: nuisances(data, model, chain, run),
                // What candidates change.
                here: (!starts.is_empty()).then(|| all.swap_remove(0)),
            }
        })
        .collect();
    let mut here: Vec<Triple> = Vec::new();
    let mut table = Table {
        columns: core::array::from_fn(|_| vec![Vec::new(); runs]),
        base: fixed.len() + width(extra),
        free: width(extra),
        nuisances: per_run.first().map_or(Vec::new(), |own| {
            own.nuisances.iter().map(|n| n.0).collect()
        }),
        candidates: Vec::new(),
    };
    for (run, own) in per_run.into_iter().enumerate() {
        let nuisances = own.nuisances.into_iter().map(|(_, triple)| triple);
        table.enter(run, own.columns.into_iter().chain(nuisances));
        here.extend(own.here);
    }
    table.offer_mechanisms(data, model, starts, &here);
    let of_run = |dependence: &Dependence, run: usize| -> Vec<Triple> {
        let columns = columns_of(dependence, run);
        columns.iter().map(|own| means(data, run, own)).collect()
    };
    let made: Vec<Vec<Vec<Triple>>> = free
        .par_iter()
        .map(|dependence| (0..runs).map(|run| of_run(dependence, run)).collect())
        .collect();
    for (dependence, by_run) in free.iter().zip(made) {
        let own = (0..dependence.width()).collect();
        table.offer(None, Vec::new(), own, by_run);
    }
    table
}

impl Table {
    /// Enters columns of one run.
    fn enter(&mut self, run: usize, triples: impl IntoIterator<Item = Triple>) {
        for triple in triples {
            for (b, column) in triple.into_iter().enumerate() {
                self.columns[b][run].push(column);
            }
        }
    }

    /// Enters every mechanism at every start, where it changes anything of the residual here.
    fn offer_mechanisms(
        &mut self,
        data: &Data,
        model: &Model,
        starts: Vec<(usize, Vec<f64>)>,
        here: &[Triple],
    ) {
        let made: Vec<Option<Own>> = starts
            .par_iter()
            .map(|(entry, start)| column_of(data, model, *entry, start, here))
            .collect();
        for ((entry, start), made) in starts.into_iter().zip(made) {
            if let Some((free, by_run)) = made {
                let id = data.catalogue.get(entry).id();
                self.offer(Some((entry, id)), start, free, by_run);
            }
        }
    }

    /// Enters a candidate behind the last one.
    fn offer(
        &mut self,
        mechanism: Option<(usize, Id)>,
        start: Vec<f64>,
        free: Vec<usize>,
        by_run: Vec<Vec<Triple>>,
    ) {
        let from = self.candidates.last().map_or(0, |c| c.columns.end);
        let width = by_run.first().map_or(0, Vec::len);
        for (run, triples) in by_run.into_iter().enumerate() {
            self.enter(run, triples);
        }
        self.candidates.push(Candidate {
            entry: mechanism.map(|(entry, _)| entry),
            id: mechanism.map(|(_, id)| id),
            start,
            free,
            columns: from..from + width,
        });
    }
}

/// Where a search may start for each mechanism that is wanted and not in the model.
fn starts(
    data: &Data,
    model: &Model,
    residuals: &[Residuals],
    wanted: &dyn Fn(Id) -> bool,
) -> Vec<(usize, Vec<f64>)> {
    let search = Search {
        context: &data.context,
        series: &data.series,
        residuals,
    };
    let entries = data.catalogue.entries().iter().enumerate();
    let asked: Vec<_> = entries
        .filter(|(entry, m)| wanted(m.id()) && !model.terms.iter().any(|t| t.entry == *entry))
        .collect();
    asked
        .into_par_iter()
        .flat_map_iter(|(entry, m)| m.starts(&search).into_iter().map(move |s| (entry, s)))
        .collect()
}

/// Columns of one mechanism at one start, by run; `None` where it changes nothing.
fn column_of(
    data: &Data,
    model: &Model,
    entry: usize,
    start: &[f64],
    here: &[Triple],
) -> Option<Own> {
    let mut with = model.clone();
    with.terms.push(Term {
        entry,
        parameters: start.to_vec(),
    });
    let first = model.vector().len();
    let difference: Vec<Triple> = (0..data.series.len())
        .map(|run| {
            let p = with.vector();
            let series = &data.series[run];
            let with = moved_rows(&data.catalogue, &with, &p, series, &data.context);
            let (a, b) = (values(with), &here[run]);
            core::array::from_fn(|i| a[i].iter().zip(&b[i]).map(|(a, b)| a - b).collect())
        })
        .collect();
    let energy = |t: &[Triple]| {
        t.iter()
            .flat_map(|t| t.iter().flatten())
            .filter(|x| x.is_finite())
            .map(|x| x * x)
            .sum::<f64>()
    };
    if energy(&difference) > 0.0 {
        let by_run = difference.iter().enumerate();
        let by_run = by_run.map(|(run, t)| vec![means(data, run, t)]);
        return Some((Vec::new(), by_run.collect()));
    }
    let which: Vec<usize> = (first..first + start.len()).collect();
    let all: Vec<Vec<Triple>> = (0..data.series.len())
        .map(|run| slopes_in(data, &with, run, &which))
        .collect();
    let free: Vec<usize> = (0..start.len())
        .filter(|i| {
            all.iter()
                .any(|run| run[*i].iter().flatten().any(|x| x.is_finite() && *x != 0.0))
        })
        .collect();
    if free.is_empty() {
        return None;
    }
    let kept = all
        .iter()
        .enumerate()
        .map(|(run, own)| free.iter().map(|i| means(data, run, &own[*i])).collect())
        .collect();
    Some((free, kept))
}
