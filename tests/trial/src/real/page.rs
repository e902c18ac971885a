//! The tables, and the page of measured recordings.

use std::fmt::Write as _;

use super::curve::left_of_drag;
use super::placebo::{self, Fate, Placebo};
use super::recording::Recording;
use super::{Found, Tried, holds, picture, rows, told};
use crate::judge::headline::Headline;
use crate::table::Table;

/// Where each folder comes from, its licence, what is certain of it and what is not.
const SOURCES: [[&str; 5]; 5] = [
    [
        "dart-coastdown",
        "Lorenzo-Lyons/DART, MIT",
        "a 1:10 scale car rolls out: speed from motion capture, 100 Hz, no load cell (drag is 0)",
        "a nearly constant 1.1 to 1.3 m/s² slows it, hardly any of it with speed squared",
        "how the smoothing of the speed colours its noise",
    ],
    [
        "dart-friction",
        "Lorenzo-Lyons/DART, MIT",
        "the same car in circles on rubber and drifting on tape; the force is its mass times its acceleration",
        "friction of rubber 0.77 at slip 0.2, of tape 0.32 to 0.36; the force was made from the acceleration columns",
        "what bends the low-slip part: encoder at 10 Hz, axle position, the car taken as one wheel",
    ],
    [
        "rav4-drive",
        "commaai/comma2k19, MIT",
        "60 s of a road car: wheel speeds from its bus, speed from satellites, drag from its accelerometer",
        "vehicle speed comes 0.08 s after the wheel's; radius 0.353 m for a nominal 0.35 m; no tyre physics in it",
        "the mass (assumed); how much of the 0.08 s is drive slip of the front wheel, since the rear wheels show 0.01 s",
    ],
    [
        "f110-slides",
        "AhmadAmine998/FrictionMaps, MIT",
        "a 1:10 car slides indoors: motor controller, lidar pose, an accelerometer that is mostly vibration",
        "the force channel is of no use, the pose is late by 0.06 s, the speeds of DS4 disagree by a quarter",
        "why those of DS4 do; mass, radius and inertia (assumed)",
    ],
    [
        "rock-friction",
        "pgiacomel/steadystate, MIT",
        "a basalt slider at 3 to 10 µm/s",
        "no wheel, and far below any speed of which the simulation could say something",
        "the area (assumed; only the ratio of the forces was measured)",
    ],
];

/// All tables but that of effects put in.
pub(super) fn tables(found: &[Found]) -> Vec<Table> {
    vec![expectations(found), placebos(found), folds(found)]
}

fn expectations(found: &[Found]) -> Table {
    let mut table = Table::new(
        "What is said of measured recordings",
        &["recordings", "what must come out", "what came out", "holds"],
    );
    for row in found.iter().flat_map(rows) {
        table.row([row.what, row.must, row.came, holds(row.holds)]);
    }
    table.note = Some("`-`: nobody knows, and nothing is counted.".to_owned());
    table
}

fn join(names: &[&str]) -> String {
    names
        .iter()
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

fn verdict_on(tried: &Tried) -> String {
    let mut bad = Vec::new();
    let survivors = tried.names(Fate::Survives);
    if !survivors.is_empty() {
        bad.push(format!("**survives**: {}", join(&survivors)));
    }
    if !tried.used.is_empty() {
        bad.push(format!("**column used**: {}", tried.used.join(", ")));
    }
    let arisen = tried.names(Fate::Arises);
    if !arisen.is_empty() {
        bad.push(format!("arises: {}", join(&arisen)));
    }
    if tried.placebo == Placebo::CopiedDrag {
        bad.push(if tried.copy_told {
            "copy told".to_owned()
        } else {
            "copy not told".to_owned()
        });
    }
    let gone = tried.names(Fate::Gone);
    if !gone.is_empty() {
        bad.push(format!("gone: {}", join(&gone)));
    }
    if bad.is_empty() {
        "clean".to_owned()
    } else {
        bad.join("; ")
    }
}

fn placebos(found: &[Found]) -> Table {
    let mut table = Table::new(
        "The same recordings with what could be said of them destroyed",
        &["set", "placebo", "what is said", "so"],
    );
    for set in found {
        let name = set.loaded.set.name;
        table.row([
            name.to_owned(),
            "as recorded".to_owned(),
            told(&set.whole.value),
            String::new(),
        ]);
        for tried in &set.tried {
            let (said, so) = match tried.senseless {
                Some(why) => (format!("not tried: {why}"), "-".to_owned()),
                None => (tried.told.clone(), verdict_on(tried)),
            };
            table.row([name.to_owned(), tried.placebo.name().to_owned(), said, so]);
        }
    }
    let left: Vec<String> = found
        .iter()
        .filter(|set| set.loaded.runs.iter().any(Recording::has_drag))
        .map(|set| {
            let left = left_of_drag(&set.loaded);
            let ends = (
                left.iter().copied().fold(f64::INFINITY, f64::min),
                left.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            );
            if left.len() > 1 {
                format!("{} {:.2} to {:.2}", set.loaded.set.name, ends.0, ends.1)
            } else {
                format!("{} {:.2}", set.loaded.set.name, ends.0)
            }
        })
        .collect();
    table.note = Some(format!(
        "Correlation of a swapped drag with the one that was recorded: {}.",
        left.join("; ")
    ));
    table
}

fn folds(found: &[Found]) -> Table {
    let mut table = Table::new(
        "Each run predicted from the others of its set",
        &[
            "set",
            "run left out",
            "what is said of the others",
            "RMS error of the base, N",
            "of the repaired model, N",
            "ratio of the squares",
            "no worse",
        ],
    );
    for set in found {
        if let Some(why) = set.loaded.no_folds() {
            table.row([
                set.loaded.set.name.to_owned(),
                "-".to_owned(),
                format!("not tried: {why}"),
                String::new(),
                String::new(),
                String::new(),
                "-".to_owned(),
            ]);
        }
        for fold in &set.folds {
            let cell = |x: f64, digits: usize| {
                if x.is_finite() {
                    format!("{x:.digits$}")
                } else {
                    "none".to_owned()
                }
            };
            table.row([
                set.loaded.set.name.to_owned(),
                fold.run.clone(),
                fold.told.clone(),
                cell(fold.base.sqrt(), 3),
                cell(fold.repaired.sqrt(), 3),
                cell(fold.ratio(), 3),
                holds(Some(!fold.worse())),
            ]);
        }
    }
    table.note = Some(
        "Worse: the squared error of the repaired model exceeds that of the base, refitted to the same runs, by more than 1 %."
            .to_owned(),
    );
    table
}

/// The headlines as a table.
pub(super) fn figures(headlines: &[Headline]) -> Table {
    let mut table = Table::new(
        "In figures",
        &["what", "bar", "measured", "95 % interval", "n", "so"],
    );
    for headline in headlines {
        table.row(headline.cells());
    }
    table.note = Some(
        "The intervals are Clopper and Pearson's, as if the cases were drawn at random; they are few and of five sources."
            .to_owned(),
    );
    table
}

/// The page.
pub(super) fn page(
    found: &[Found],
    tables: &[Table],
    headlines: &[Headline],
    pictures: &[(String, String)],
    small: bool,
) -> String {
    let mut text = String::from(
        "# The diagnosis on measured recordings\n\n\
         A sealed trial knows what it concealed; of a measured recording nobody knows the whole truth. Three things can be held \
         against a diagnosis all the same: what is certain of the recordings by other means; that a name does not survive the loss of \
         what it claims (placebos); and that the repaired model predicts runs which nothing of it has seen no worse than the base. \
         This page has all three, right or wrong.\n\n\
         Written whole by `cargo run --release -p sealed-trial -- measured --out docs`, and by `cargo xtask trial`; nothing here is \
         edited by hand. The recordings lie outside the project, in `../shared/data`, under the licences of their authors.\n\n",
    );
    if small {
        text.push_str("A small study: fewer circles, no effects put in.\n\n");
    }
    let mut sources = Table::new(
        "The recordings",
        &["folder", "source", "what it is", "certain", "not certain"],
    );
    for row in SOURCES {
        sources.row(row.map(str::to_owned));
    }
    sources.note = Some(
        "The hard stops of a road car and the coast-down of a drum, of earlier measurements, are not among the recordings in reach, \
         so they are not here."
            .to_owned(),
    );
    text.push_str(&sources.markdown());
    text.push_str(&figures(headlines).markdown());
    text.push_str("![Sets and placebos](reality/placebos.svg)\n\n");
    text.push_str("## Pictures\n\n");
    for set in found {
        let key = set.loaded.set.key;
        if pictures
            .iter()
            .any(|(name, _)| *name == format!("{key}.svg"))
        {
            let name = set.loaded.set.name;
            let _ = write!(
                text,
                "### {}\n\n{} run{}, {} samples. {}\n\n![{name}](reality/{key}.svg)\n\n",
                capital(name),
                set.loaded.runs.len(),
                if set.loaded.runs.len() == 1 { "" } else { "s" },
                set.loaded.samples(),
                picture::caption(key),
            );
        }
    }
    let mut kinds = Table::new(
        "The placebos",
        &["placebo", "what is done", "what it destroys"],
    );
    for placebo in placebo::ALL {
        kinds.row([placebo.name(), placebo.what(), placebo.destroys_what()].map(str::to_owned));
    }
    kinds.note = Some(
        "A name of the destroyed kind that is given with the original and again with the placebo **survives**: a failure. One that is \
         given with the placebo alone **arises**, and is counted apart. The swapped drag is taken half a run off because the circles all \
         rise alike: the drag of the next run at the same place correlates with the own one by 0.91 to 0.99, and destroys nothing. \
         The copy may be named in `chain` (`leaks`), and there it must be. \
         `slip_hysteresis` is not judged in reversed time: a loop run through backwards is a loop still, with other curves for rising and \
         falling slip, and `loop_share`, half its height over friction, has no sense that would have to turn. A delay must turn: what came \
         late comes early. `zero_drift` is not judged in another order: a zero that drifts in each run anew does so in any order, one that \
         drifts through all runs does not, and no field of the contract tells the two apart. A mass is the ratio of drag to deceleration, \
         and so is a wheel's inertia unless a brake torque moves, which would give it without the drag."
            .to_owned(),
    );
    text.push_str(&kinds.markdown());
    for table in tables {
        text.push_str(&table.markdown());
    }
    while text.ends_with("\n\n") {
        text.pop();
    }
    text
}

fn capital(name: &str) -> String {
    let mut letters = name.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}
