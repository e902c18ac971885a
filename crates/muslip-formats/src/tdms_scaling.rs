//! From a TDMS channel's raw values to its readings: the chain of scales in its properties.
//!
//! Linear, polynomial, table, sum and difference, and those of sensors; any other is refused by name: a raw voltage passed off as a temperature would
//! be wrong in silence.

use std::collections::BTreeMap;

use crate::error::Problem;
use crate::tdms_property::Property;
use crate::tdms_sensor::Sensor;

/// The input that is the raw value.
const RAW: u32 = 0xffff_ffff;
/// Most terms of a polynomial or a table.
const MOST_TERMS: f64 = 65_536.0;

/// One scale of the chain.
#[derive(Debug, Clone, PartialEq)]
enum Scale {
    Linear {
        slope: f64,
        intercept: f64,
        input: u32,
    },
    Polynomial {
        terms: Vec<f64>,
        input: u32,
    },
    /// Readings at raw values, in rising order of these; between them a line, beyond them the end's.
    Table {
        points: Vec<(f64, f64)>,
        input: u32,
    },
    Add {
        left: u32,
        right: u32,
    },
    /// Right less left: so the format's own tools compute it.
    Subtract {
        left: u32,
        right: u32,
    },
    Sensor {
        sensor: Sensor,
        input: u32,
    },
    /// A value of a DAQmx row.
    Scaler(u32),
    /// The input as it is.
    Same(u32),
}

/// The scales of a channel, the last of which gives its readings; none where readings are the raw values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scaling {
    scales: Vec<Scale>,
}

type Properties = BTreeMap<String, Property>;

fn number(properties: &Properties, key: &str) -> Option<f64> {
    match properties.get(key) {
        Some(Property::Number(value)) => Some(*value),
        _ => None,
    }
}

impl Scaling {
    pub(crate) fn of(properties: &Properties) -> Result<Self, Problem> {
        // Values that were scaled before they were written are not scaled again.
        let status = properties.get("NI_Scaling_Status");
        let scaled = matches!(status, Some(Property::Text(text)) if text == "scaled");
        let listed = properties.keys().filter_map(|key| {
            let index = key
                .strip_prefix("NI_Scale[")?
                .strip_suffix("]_Scale_Type")?;
            index.parse::<u8>().ok()
        });
        let listed = listed.max().map_or(0.0, |last| f64::from(last) + 1.0);
        let count = number(properties, "NI_Number_Of_Scales").unwrap_or(listed);
        if scaled || count < 1.0 {
            return Ok(Self { scales: Vec::new() });
        }
        if count > 256.0 {
            return Err(Problem::whole(format!("{count} scales are not supported")));
        }
        let scales = (0..count as usize)
            .map(|index| scale(properties, index))
            .collect::<Result<_, _>>()?;
        Ok(Self { scales })
    }

    /// Whether readings are the raw values.
    pub(crate) fn is_none(&self) -> bool {
        self.scales.is_empty()
    }

    /// The readings. `raw` gives the raw values: of a DAQmx scaler, or with `None` the only ones.
    pub(crate) fn apply(
        &self,
        raw: &dyn Fn(Option<u32>) -> Result<Vec<f64>, Problem>,
    ) -> Result<Vec<f64>, Problem> {
        match self.scales.len().checked_sub(1) {
            None => raw(None).or_else(|_| raw(Some(0))),
            Some(last) => self.output(last as u32, raw, 0),
        }
    }

    fn output(
        &self,
        index: u32,
        raw: &dyn Fn(Option<u32>) -> Result<Vec<f64>, Problem>,
        depth: usize,
    ) -> Result<Vec<f64>, Problem> {
        if index == RAW {
            return raw(None);
        }
        if depth > self.scales.len() {
            return Err(Problem::whole("its scales feed each other in a ring"));
        }
        let scale = usize::try_from(index)
            .ok()
            .and_then(|index| self.scales.get(index));
        let scale = scale.ok_or_else(|| Problem::whole(format!("scale {index} is not there")))?;
        let input = |index: u32| self.output(index, raw, depth + 1);
        let mapped = |index: u32, by: &dyn Fn(f64) -> f64| {
            let mut values = input(index)?;
            values.iter_mut().for_each(|value| *value = by(*value));
            Ok(values)
        };
        match scale {
            Scale::Same(from) => input(*from),
            Scale::Scaler(id) => raw(Some(*id)).or_else(|_| raw(None)),
            Scale::Linear {
                slope,
                intercept,
                input,
            } => mapped(*input, &|value| value * slope + intercept),
            Scale::Polynomial { terms, input } => mapped(*input, &|value| {
                terms.iter().rev().fold(0.0, |sum, term| sum * value + term)
            }),
            Scale::Table { points, input } => mapped(*input, &|value| between(points, value)),
            Scale::Sensor { sensor, input } => mapped(*input, &|value| sensor.reading(value)),
            Scale::Add { left, right } | Scale::Subtract { left, right } => {
                let sign = if matches!(scale, Scale::Add { .. }) {
                    1.0
                } else {
                    -1.0
                };
                let (left, mut right) = (input(*left)?, input(*right)?);
                if left.len() != right.len() {
                    return Err(Problem::whole("the two inputs of a scale differ in length"));
                }
                right
                    .iter_mut()
                    .zip(left)
                    .for_each(|(value, left)| *value += sign * left);
                Ok(right)
            }
        }
    }
}

fn between(points: &[(f64, f64)], value: f64) -> f64 {
    let after = points.partition_point(|&(x, _)| x < value);
    match (
        after.checked_sub(1).and_then(|before| points.get(before)),
        points.get(after),
    ) {
        _ if value.is_nan() => value,
        (None, Some(&(_, y))) | (Some(&(_, y)), None) => y,
        (Some(&(x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) / (x1 - x0) * (value - x0),
        (None, None) => f64::NAN,
    }
}

fn scale(properties: &Properties, index: usize) -> Result<Scale, Problem> {
    let prefix = format!("NI_Scale[{index}]");
    let kind = match properties.get(&format!("{prefix}_Scale_Type")) {
        Some(Property::Text(kind)) => kind.as_str(),
        // Scales of the measuring card are not among the properties: their number is that of the value in a row.
        _ => return Ok(Scale::Scaler(index as u32)),
    };
    let needed = |key: &str| {
        let key = format!("{prefix}_{key}");
        number(properties, &key).ok_or_else(|| Problem::whole(format!("property {key} is missing")))
    };
    let input = |key: &str| {
        number(properties, &format!("{prefix}_{key}")).map_or(RAW, |value| value as u32)
    };
    let list = |size: f64, key: &str| -> Result<Vec<f64>, Problem> {
        if !(0.0..=MOST_TERMS).contains(&size) {
            return Err(Problem::whole(format!(
                "{size} terms of a scale are not supported"
            )));
        }
        (0..size as usize)
            .map(|k| needed(&format!("{key}[{k}]")))
            .collect()
    };
    Ok(match kind {
        "Linear" => Scale::Linear {
            slope: needed("Linear_Slope")?,
            intercept: needed("Linear_Y_Intercept")?,
            input: input("Linear_Input_Source"),
        },
        "Polynomial" => Scale::Polynomial {
            terms: list(
                needed("Polynomial_Coefficients_Size").unwrap_or(4.0),
                "Polynomial_Coefficients",
            )?,
            input: input("Polynomial_Input_Source"),
        },
        "Table" => {
            let raw = list(
                needed("Table_Pre_Scaled_Values_Size")?,
                "Table_Pre_Scaled_Values",
            )?;
            let readings = list(needed("Table_Scaled_Values_Size")?, "Table_Scaled_Values")?;
            let mut points: Vec<(f64, f64)> =
                raw.iter().copied().zip(readings.iter().copied()).collect();
            if points
                .first()
                .zip(points.last())
                .is_some_and(|(first, last)| first.0 > last.0)
            {
                points.reverse();
            }
            if raw.len() != readings.len()
                || points.is_empty()
                || points.windows(2).any(|pair| pair[0].0 >= pair[1].0)
            {
                return Err(Problem::whole("a table of a scale is not in order"));
            }
            Scale::Table {
                points,
                input: input("Table_Input_Source"),
            }
        }
        "Add" => Scale::Add {
            left: needed("Add_Left_Operand_Input_Source")? as u32,
            right: needed("Add_Right_Operand_Input_Source")? as u32,
        },
        "Subtract" => Scale::Subtract {
            left: needed("Subtract_Left_Operand_Input_Source")? as u32,
            right: needed("Subtract_Right_Operand_Input_Source")? as u32,
        },
        "AdvancedAPI" => Scale::Same(input("AdvancedAPI_Input_Source")),
        other => {
            let given = |key: &str| number(properties, &format!("{prefix}_{key}"));
            let sensor = Sensor::of(other, &needed, &given)?;
            Scale::Sensor {
                sensor: sensor
                    .ok_or_else(|| Problem::whole(format!("scale {other:?} is not supported")))?,
                input: input(&format!("{other}_Input_Source")),
            }
        }
    })
}
