//! Which campaigns a trial is made of.

use anyhow::{Result, bail};

use crate::generate::campaign::{Campaign, NULL_KINDS, Order, make};
use crate::draw::Draw;
use crate::generate::form::{Form, OUTSIDE, VOCABULARY, may_pair, mechanism};

/// Sizes of effect, in sigma RMS after the base was refitted, that single effects are ordered at.
pub const STRENGTHS: [f64; 5] = [0.6, 1.0, 2.0, 4.0, 0.3];

/// What to generate.
#[derive(Clone, Debug)]
pub struct Request {
    /// `null`, `single`, `pair` or `outside`.
    pub stratum: String,
    /// Campaigns.
    pub count: usize,
    /// Only this mechanism, or pairs with it.
    pub mechanism: Option<String>,
    /// Size of each effect in sigma, instead of the ladder.
    pub strength: Option<f64>,
}

/// Writes down the orders of one stratum.
pub fn orders(request: &Request, seed: u64) -> Result<Vec<Order>> {
    let mut draw = Draw::new(seed, &[0x0c0de, request.stratum.len() as u64]);
    let mut out = Vec::new();
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
                null: Some(NULL_KINDS[index % NULL_KINDS.len()]),
            },
            "single" => {
                let entry = match &request.mechanism {
                    Some(id) => match mechanism(id) {
                        Some(entry) => entry,
                        None => bail!("`{id}` is no mechanism of the vocabulary"),
                    },
                    None => &VOCABULARY[index % VOCABULARY.len()],
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
                    .unwrap_or(STRENGTHS[(step + index % VOCABULARY.len()) % STRENGTHS.len()]);
                Order {
                    stratum: "single".into(),
                    forms: vec![form],
                    strength: vec![strength],
                    null: None,
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
                    };
                }
            },
            "outside" => Order {
                stratum: "outside".into(),
                forms: vec![match &request.mechanism {
                    Some(word) => outside_form(word)?,
                    None => OUTSIDE[index % OUTSIDE.len()].0,
                }],
                strength: vec![strength(&mut draw, &[1.0, 2.0, 4.0])],
                null: None,
            },
            other => bail!("no stratum `{other}`: null, single, pair or outside"),
        };
        out.push(order);
    }
    Ok(out)
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
