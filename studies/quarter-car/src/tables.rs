//! The tables, for a terminal, for Markdown and for programs.

use muslip_report::text::Table;
use serde_json::{Value, json};

use super::drivers::Channels;
use super::rows::{LOCK_BAR_S, Ratios, Row};
use super::study::{Reference, Study};

fn ratio(value: f64) -> String {
    if value.is_finite() {
        format!("{value:.3}")
    } else {
        "does not stop".into()
    }
}

fn percent(share: f64) -> String {
    if share.is_finite() {
        format!("{:.0} %", 100.0 * share)
    } else {
        "-".into()
    }
}

fn verdict(row: &Row) -> String {
    match row.keeps() {
        None => String::new(),
        Some(true) => "kept".into(),
        Some(false) => "missed".into(),
    }
}

fn head(columns: &[&str]) -> Vec<String> {
    columns.iter().map(|column| (*column).to_owned()).collect()
}

impl Study {
    /// The references of each road.
    pub fn references_table(&self) -> Table {
        references_table(&self.references)
    }

    /// The same under a tyre that no filter has.
    pub fn foreign_references_table(&self) -> Table {
        references_table(&self.foreign_references)
    }

    /// Rows (a) to (f) on every road.
    pub fn comparison_table(&self) -> Table {
        comparison_table(&self.comparison)
    }

    /// The same under a tyre that no filter has.
    pub fn foreign_table(&self) -> Table {
        comparison_table(&self.foreign)
    }

    /// Other speeds, dead time.
    pub fn variants_table(&self) -> Table {
        spread_table(&self.variants)
    }

    /// Vehicles and sensors drawn at random.
    pub fn monte_carlo_table(&self) -> Table {
        spread_table(&self.monte_carlo)
    }

    /// What a user meets on the first day.
    pub fn faults_table(&self) -> Table {
        Table {
            head: head(&["what", "road", "distance / (e)", "worst", "locked, s"]),
            rows: self
                .faults
                .iter()
                .map(|row| {
                    vec![
                        row.variant.clone(),
                        row.road.to_owned(),
                        ratio(row.ratios.median),
                        ratio(row.ratios.worst),
                        format!("{:.2}", row.ratios.longest_lock_s),
                    ]
                })
                .collect(),
        }
    }

    /// What five samples tell.
    pub fn observability_table(&self) -> Table {
        Table {
            head: head(&[
                "slip",
                "road",
                "channels",
                "directions seen, of 5",
                "not seen",
            ]),
            rows: self
                .observability
                .iter()
                .map(|row| {
                    let road = if row.road_known { "known" } else { "unknown" };
                    let channels = match row.channels {
                        Channels::WheelSpeed => "wheel speed",
                        Channels::Rig => "four",
                    };
                    vec![
                        row.point.to_owned(),
                        road.to_owned(),
                        channels.to_owned(),
                        row.rank.to_string(),
                        row.unseen.join(", "),
                    ]
                })
                .collect(),
        }
    }

    /// Rows that have a bar.
    pub(super) fn judged(&self) -> impl Iterator<Item = &Row> {
        self.comparison
            .iter()
            .chain(&self.variants)
            .chain(&self.monte_carlo)
            .filter(|row| row.bar.is_some())
    }

    /// Rows of drivers that are to keep the wheel rolling; the tutorial's filter with a wrong mass is
    /// printed, not judged.
    fn rolling(&self) -> impl Iterator<Item = &Row> {
        self.comparison
            .iter()
            .chain(&self.variants)
            .chain(&self.monte_carlo)
            .chain(&self.faults)
    }

    /// The answer on a tyre that no filter has, in one sentence; it counts for no verdict.
    pub fn foreign_verdict(&self) -> String {
        let judged = || self.foreign.iter().filter_map(Row::keeps);
        let rolling = self
            .foreign
            .iter()
            .filter(|row| !row.keeps_rolling())
            .count();
        format!(
            "With a tyre law that no filter has, {} of the same {} bars are kept; in {rolling} rows a controlled \
             wheel is locked above 3 m/s for longer than {LOCK_BAR_S} s.",
            judged().filter(|kept| *kept).count(),
            judged().count()
        )
    }

    /// The answer in one sentence.
    pub fn verdict(&self) -> String {
        let judged = self.judged().count();
        let kept = self
            .judged()
            .filter(|row| row.keeps() == Some(true))
            .count();
        let locked = self.rolling().filter(|row| !row.keeps_rolling()).count();
        let bars = format!("{kept} of {judged} bars on stopping distance are kept");
        if locked == 0 {
            format!(
                "{bars}; no controlled wheel is locked above 3 m/s for longer than {LOCK_BAR_S} s."
            )
        } else {
            format!(
                "{bars}; in {locked} rows a controlled wheel is locked above 3 m/s for longer than {LOCK_BAR_S} s."
            )
        }
    }

    /// Whether every bar is kept.
    pub fn keeps_all(&self) -> bool {
        self.judged().all(|row| row.keeps() == Some(true)) && self.rolling().all(Row::keeps_rolling)
    }

    /// All figures for programs; a ratio is null where the vehicle does not stop.
    pub fn to_json(&self) -> Value {
        let rows = |rows: &[Row]| -> Vec<Value> {
            rows.iter()
                .map(|row| {
                    json!({
                        "row": row.who.letter(),
                        "who": row.who.name(),
                        "road": row.road,
                        "variant": row.variant,
                        "stops": row.ratios.count,
                        "median": row.ratios.median,
                        "worst_tenth": row.ratios.worst_tenth,
                        "worst": row.ratios.worst,
                        "share_near_peak": row.ratios.near_peak,
                        "share_deep": row.ratios.deep,
                        "longest_lock_s": row.ratios.longest_lock_s,
                        "bar": row.bar,
                        "kept": row.keeps(),
                    })
                })
                .collect()
        };
        let references = |references: &[Reference]| -> Vec<Value> {
            references
                .iter()
                .map(|reference| {
                    json!({
                        "road": reference.road,
                        "optimum_m": reference.optimum_m,
                        "bound_m": reference.bound_m,
                        "constant_slip_m": reference.constant_m,
                        "constant_slip_over_peak": reference.constant_factor,
                    })
                })
                .collect()
        };
        let observability: Vec<Value> = self
            .observability
            .iter()
            .map(|row| {
                json!({
                    "slip": row.point,
                    "road_known": row.road_known,
                    "four_channels": row.channels == Channels::Rig,
                    "rank": row.rank,
                    "weakest_over_strongest": row.weakest,
                    "not_seen": row.unseen,
                })
            })
            .collect();
        json!({
            "command": self.options.command(),
            "keeps_all_bars": self.keeps_all(),
            "references": references(&self.references),
            "comparison": rows(&self.comparison),
            "foreign_references": references(&self.foreign_references),
            "foreign": rows(&self.foreign),
            "variants": rows(&self.variants),
            "monte_carlo": rows(&self.monte_carlo),
            "faults": rows(&self.faults),
            "believes_wet_on_dry": self.mistaken.median,
            "observability": observability,
        })
    }
}

fn references_table(references: &[Reference]) -> Table {
    Table {
        head: head(&[
            "road",
            "(e) best stop, m",
            "bound / (e)",
            "best constant slip / (e)",
            "that slip over the peak's",
        ]),
        rows: references
            .iter()
            .map(|reference| {
                vec![
                    reference.road.to_owned(),
                    format!("{:.2}", reference.optimum_m),
                    ratio(reference.bound_m / reference.optimum_m),
                    ratio(reference.constant_m / reference.optimum_m),
                    format!("{:.2}", reference.constant_factor),
                ]
            })
            .collect(),
    }
}

fn comparison_table(rows: &[Row]) -> Table {
    Table {
        head: head(&[
            "row",
            "who",
            "road",
            "distance / (e)",
            "worst",
            "near the peak",
            "deep slip",
            "locked, s",
            "bar",
            "verdict",
        ]),
        rows: rows
            .iter()
            .map(|row| {
                let Ratios {
                    median,
                    worst,
                    near_peak,
                    deep,
                    longest_lock_s,
                    ..
                } = row.ratios;
                vec![
                    row.who.letter().to_owned(),
                    row.who.name().to_owned(),
                    row.road.to_owned(),
                    ratio(median),
                    ratio(worst),
                    percent(near_peak),
                    percent(deep),
                    format!("{longest_lock_s:.2}"),
                    row.bar.map_or(String::new(), |bar| format!("{bar:.2}")),
                    verdict(row),
                ]
            })
            .collect(),
    }
}

fn spread_table(rows: &[Row]) -> Table {
    Table {
        head: head(&[
            "what",
            "row",
            "who",
            "road",
            "median",
            "worst tenth from",
            "worst",
            "locked, s",
            "bar",
            "verdict",
        ]),
        rows: rows
            .iter()
            .map(|row| {
                vec![
                    row.variant.clone(),
                    row.who.letter().to_owned(),
                    row.who.name().to_owned(),
                    row.road.to_owned(),
                    ratio(row.ratios.median),
                    ratio(row.ratios.worst_tenth),
                    ratio(row.ratios.worst),
                    format!("{:.2}", row.ratios.longest_lock_s),
                    row.bar.map_or(String::new(), |bar| format!("{bar:.2}")),
                    verdict(row),
                ]
            })
            .collect(),
    }
}
