//! Families of campaigns by what their recordings came through, and intervals by resampling whole campaigns.

use serde::Serialize;

use crate::draw::Draw;
use crate::judge::case::Case;
use crate::share::quantile;

/// Recordings of ideal sensors, of real measuring chains, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    Together,
    Ideal,
    Chains,
}

/// All families.
pub const FAMILIES: [Family; 3] = [Family::Together, Family::Ideal, Family::Chains];

/// The two that are told apart.
pub const APART: [Family; 2] = [Family::Ideal, Family::Chains];

impl Family {
    /// What a reader calls it.
    pub fn name(self) -> &'static str {
        match self {
            Family::Together => "all",
            Family::Ideal => "ideal",
            Family::Chains => "chains",
        }
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Family::Together => "all sensors",
            Family::Ideal => "ideal sensors",
            Family::Chains => "real chains",
        }
    }

    /// End of a headline's key.
    pub fn suffix(self) -> &'static str {
        match self {
            Family::Together => "",
            Family::Ideal => ".ideal",
            Family::Chains => ".chains",
        }
    }

    /// Key of a family's headline.
    pub fn key(self, stem: &str) -> String {
        format!("{stem}{}", self.suffix())
    }

    /// What a reader calls a family's figure.
    pub fn what(self, words: &str) -> String {
        match self {
            Family::Together => words.to_owned(),
            _ => format!("{words}, {}", self.name()),
        }
    }

    pub fn holds(self, case: &Case) -> bool {
        match self {
            Family::Together => true,
            Family::Ideal => !case.real_chain,
            Family::Chains => case.real_chain,
        }
    }

    pub fn of(self, cases: &[Case]) -> impl Iterator<Item = &Case> + Clone {
        cases.iter().filter(move |case| self.holds(case))
    }
}

/// The families worth telling apart: all, and each by itself where there is more than one.
pub fn families(cases: &[Case]) -> Vec<Family> {
    let both = APART.iter().all(|family| family.of(cases).next().is_some());
    FAMILIES
        .into_iter()
        .filter(|family| *family == Family::Together || both)
        .collect()
}

/// How often a population is drawn anew.
const RESAMPLES: usize = 2000;

/// 95 % interval of a statistic: each population is drawn anew from itself, and the statistic sees the places drawn
/// (the percentile bootstrap). Not a number where no draw gives one.
pub fn resampled(sizes: &[usize], statistic: impl Fn(&[Vec<usize>]) -> f64) -> (f64, f64) {
    let mut draw = Draw::new(2_000, &[0xb007]);
    let mut places: Vec<Vec<usize>> = sizes.iter().map(|size| vec![0; *size]).collect();
    let mut values = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        for population in &mut places {
            let last = population.len().saturating_sub(1);
            for place in population.iter_mut() {
                *place = draw.whole(0, last);
            }
        }
        let value = statistic(&places);
        if value.is_finite() {
            values.push(value);
        }
    }
    (quantile(&values, 0.025), quantile(&values, 0.975))
}

#[cfg(test)]
pub mod toy {
    use std::sync::OnceLock;

    use super::*;
    use crate::generate::campaign::{NullKind, Order, Truth, make};
    use crate::generate::effect::Effect;
    use crate::generate::figures::{Concealed, Figure};
    use crate::generate::form::Form;
    use crate::generate::instrument::ChainKind;
    use crate::judge::case::{FigureCase, Named};
    use crate::judge::headline::Headline;

    /// Truth of a campaign on ideal sensors, with one effect of one figure unless the mechanism is empty.
    pub fn truth(stratum: &str, mechanism: &str, figure: &str, value: f64) -> Truth {
        static PLAIN: OnceLock<Truth> = OnceLock::new();
        let plain = PLAIN.get_or_init(|| {
            let order = Order {
                stratum: "null".into(),
                forms: vec![],
                strength: vec![],
                null: Some(NullKind::White),
                chain: ChainKind::Ideal,
            };
            make("campaign-0000", 5, &order).unwrap().truth
        });
        let mut truth = plain.clone();
        truth.stratum = stratum.to_owned();
        if !mechanism.is_empty() {
            truth.concealed = vec![Concealed {
                effect: Effect {
                    id: mechanism.to_owned(),
                    balance: "tyre".into(),
                    form: Form::DelayPure,
                    a: value,
                    a_range: (0.0, 1.0),
                    p: [0.0; 6],
                    strength_sigma: 1.0,
                },
                figures: vec![Figure {
                    name: figure.to_owned(),
                    unit: String::new(),
                    values: vec![value],
                    attainable_std: None,
                }],
                accept: vec![mechanism.to_owned()],
                tolerated: vec![],
                variables: vec![],
            }];
        }
        truth
    }

    /// A campaign that nothing is known of.
    pub fn case(stratum: &str, real_chain: bool) -> Case {
        Case {
            campaign: "campaign-0000".into(),
            stratum: stratum.into(),
            kind: String::new(),
            wheel_sensor: "ideal".into(),
            vehicle_sensor: "ideal".into(),
            real_chain,
            of_the_chain: false,
            timing_right: None,
            late: vec![],
            false_findings: vec![],
            truth: vec![],
            forms: vec![],
            strength: vec![],
            verdict: "consistent".into(),
            named: vec![],
            unexplained: vec![],
            whiteness_p: None,
            finding: None,
            false_physics: false,
            breaches: vec![],
            first_right: false,
            in_set: false,
            f1: 0.0,
            honest: false,
            variable_right: None,
            figures: vec![],
            base: vec![],
            gains: vec![],
            iou: None,
            iou_all: None,
            local: false,
            seconds: 0.0,
            processor_s: 0.0,
            samples: 0,
            complaints: vec![],
        }
    }

    /// A name with its confidence and score.
    pub fn named(confidence: f64, score: f64, right: bool) -> Named {
        Named {
            id: "force_lag".into(),
            confidence,
            confusable_with: vec![],
            score,
            accepted: right,
            right,
        }
    }

    /// Value of the headline of a key.
    pub fn value(headlines: &[Headline], key: &str) -> f64 {
        headlines
            .iter()
            .find(|headline| headline.key == key)
            .unwrap()
            .value
    }

    /// A figure whose truth is 1.
    pub fn figure(error: f64, std: f64, attainable_std: Option<f64>) -> FigureCase {
        FigureCase {
            mechanism: "force_lag".into(),
            name: "time_constant".into(),
            truth: 1.0,
            value: 1.0 + error,
            std,
            pull: error / std,
            attainable_std,
        }
    }

    #[test]
    fn the_interval_of_a_mean_is_that_of_the_central_limit() {
        let mut draw = Draw::new(3, &[]);
        let values: Vec<f64> = (0..400).map(|_| draw.normal()).collect();
        let mean = |places: &[usize]| {
            places.iter().map(|place| values[*place]).sum::<f64>() / places.len() as f64
        };
        let (low, high) = resampled(&[values.len()], |places| mean(&places[0]));
        let centre = values.iter().sum::<f64>() / 400.0;
        assert!((centre - low - 1.96 / 20.0).abs() < 0.012);
        assert!((high - centre - 1.96 / 20.0).abs() < 0.012);
    }
}
