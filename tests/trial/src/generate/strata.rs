//! Which campaigns a trial is made of.

use anyhow::{Result, bail};

use crate::generate::campaign::{Campaign, NULL_KINDS, NullKind, Order, make};
use crate::draw::Draw;
use crate::generate::instrument::ChainKind;
use crate::generate::instrument::finding::FINDING_KINDS;
use crate::generate::form::{Form, OUTSIDE, VOCABULARY, may_pair, mechanism};

/// Sizes of effect, in sigma RMS after the base was refitted, that single effects are ordered at.
pub const STRENGTHS: [f64; 6] = [0.6, 1.5, 1.0, 4.0, 0.3, 2.0];

/// What to generate.
#[derive(Clone, Debug)]
pub struct Request {
    /// `null`, `chain`, `single`, `pair` or `outside`.
    pub stratum: String,
    /// Through real measuring chains rather than ideal sensors.
    pub real_chain: bool,
    /// Campaigns.
    pub count: usize,
    /// Only this mechanism, or pairs with it.
    pub mechanism: Option<String>,
    /// Size of each effect in sigma, instead of the ladder.
    pub strength: Option<f64>,
}

/// Writes down the orders of one stratum.
pub fn orders(request: &Request, seed: u64) -> Result<Vec<Order>> {
    let mut draw = Draw::new(
        seed,
        &[
            0x0c0de,
            request.stratum.len() as u64,
            u64::from(request.real_chain),
        ],
    );
    let chain = if request.real_chain {
        ChainKind::Real
    } else {
        ChainKind::Ideal
    };
    let mut out = Vec::new();
    // Each round in an order of its own, so that a part of one is no fixed part of the vocabulary.
    let mechanisms = rounds(request.count, VOCABULARY.len(), &mut draw);
    let outside = rounds(request.count, OUTSIDE.len(), &mut draw);
    for index in 0..request.count {
        let round = index / VOCABULARY.len();
        let strength = |draw: &mut Draw, ladder: &[f64]| {
            request.strength.unwrap_or_else(|| draw.one_of(ladder))
        };
        let order = match request.stratum.as_str() {
            "null" => Order {
                stratum: "null".into(),
                forms: vec![],
                strength: vec![],
                null: Some(if request.real_chain {
                    NullKind::RealChain
                } else {
                    NULL_KINDS[index % NULL_KINDS.len()]
                }),
                chain,
            },
            "chain" => Order {
                stratum: "chain".into(),
                forms: vec![],
                strength: vec![],
                null: None,
                chain: ChainKind::Only(match &request.mechanism {
                    Some(word) => *FINDING_KINDS
                        .iter()
                        .find(|kind| &kind.word() == word)
                        .ok_or_else(|| anyhow::anyhow!("`{word}` is no effect of a chain"))?,
                    None => FINDING_KINDS[index % FINDING_KINDS.len()],
                }),
            },
            "single" => {
                let entry = match &request.mechanism {
                    Some(id) => match mechanism(id) {
                        Some(entry) => entry,
                        None => bail!("`{id}` is no mechanism of the vocabulary"),
                    },
                    None => &VOCABULARY[mechanisms[index]],
                };
                let step = if request.mechanism.is_some() {
                    index
                } else {
                    round
                };
                // A coprime stride, so that no form is tied to one strength.
                let form = entry.2[(step + step / STRENGTHS.len()) % entry.2.len()];
                let strength = request
                    .strength
                    .unwrap_or(STRENGTHS[(step + mechanisms[index]) % STRENGTHS.len()]);
                Order {
                    stratum: "single".into(),
                    forms: vec![form],
                    strength: vec![strength],
                    null: None,
                    chain,
                }
            }
            "pair" => loop {
                let first = match &request.mechanism {
                    Some(id) => mechanism(id).ok_or_else(|| {
                        anyhow::anyhow!("`{id}` is no mechanism of the vocabulary")
                    })?,
                    None => &VOCABULARY[draw.whole(0, VOCABULARY.len() - 1)],
                };
                let second = &VOCABULARY[draw.whole(0, VOCABULARY.len() - 1)];
                if may_pair(first.0, second.0) {
                    let forms = vec![draw.one_of(first.2), draw.one_of(second.2)];
                    let strength = vec![
                        strength(&mut draw, &[1.0, 2.0, 4.0]),
                        strength(&mut draw, &[1.0, 2.0, 4.0]),
                    ];
                    break Order {
                        stratum: "pair".into(),
                        forms,
                        strength,
                        null: None,
                        chain,
                    };
                }
            },
            "outside" => Order {
                stratum: "outside".into(),
                forms: vec![match &request.mechanism {
                    Some(word) => outside_form(word)?,
                    None => OUTSIDE[outside[index]].0,
                }],
                strength: vec![strength(&mut draw, &[1.0, 2.0, 4.0])],
                null: None,
                chain,
            },
            other => bail!("no stratum `{other}`: null, chain, single, pair or outside"),
        };
        out.push(order);
    }
    Ok(out)
}

/// So many places of so many kinds: whole rounds, each shuffled.
fn rounds(count: usize, kinds: usize, draw: &mut Draw) -> Vec<usize> {
    let mut places = Vec::new();
    while places.len() < count {
        let mut round: Vec<usize> = (0..kinds).collect();
        for last in (1..kinds).rev() {
            round.swap(last, draw.whole(0, last));
        }
        places.extend(round);
    }
    places
}

/// A form outside the vocabulary by its own word.
fn outside_form(word: &str) -> Result<Form> {
    OUTSIDE
        .iter()
        .map(|entry| entry.0)
        .find(|form| serde_json::to_value(form).is_ok_and(|value| value == word))
        .ok_or_else(|| anyhow::anyhow!("`{word}` is no effect outside the vocabulary"))
}

/// Makes a campaign; where no rig can show an effect of that size, a weaker one or another form.
pub fn fulfil(name: &str, seed: u64, order: &Order) -> Result<Campaign> {
    let mut order = order.clone();
    let mut draw = Draw::new(seed, &[0xfa11]);
    let mut last = None;
    for attempt in 0..6u64 {
        match make(name, Draw::new(seed, &[attempt]).seed(), &order) {
            Ok(campaign) => return Ok(campaign),
            Err(error) => last = Some(error),
        }
        for strength in &mut order.strength {
            *strength *= 0.6;
        }
        if order.stratum == "pair" && attempt % 2 == 1 {
            for form in &mut order.forms {
                if let Some(entry) = VOCABULARY.iter().find(|entry| entry.2.contains(form)) {
                    *form = draw.one_of(entry.2);
                }
            }
        }
    }
    match last {
        Some(error) => Err(error),
        None => bail!("no attempt was made"),
    }
}
