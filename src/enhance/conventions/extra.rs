//! Values of further inputs, from the table `[extra]` of a sidecar: [`ExtraValue`].

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::expressions::Expression;

/// Maximum length of a list of numbers; chosen.
const MAX_NUMBERS: usize = 4096;

/// Value of a further input.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ExtraValue {
    /// One number: `ratio = 3`.
    Number(SidecarNumber),
    /// A vector: `alpha = [1, 2, 3]`.
    List(Vec<SidecarNumber>),
    /// A tensor of the image's size, filled with this number: `ratio = { map = 5.0 }`.
    Map(SidecarNumber),
    /// Normal noise: `z = { noise = "normal", std = 0.9, seed = 0, divide = 8 }`.
    Noise(NoiseStatement),
    /// An expression of the dark image: `gray = { from = "1 - max(image)" }`.
    From(Expression),
}

/// A number or boolean of the sidecar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SidecarNumber {
    Bool(bool),
    Integer(i64),
    Float(f64),
}

impl fmt::Display for SidecarNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => value.fmt(f),
            Self::Integer(value) => value.fmt(f),
            Self::Float(value) => write!(f, "{value:?}"),
        }
    }
}

/// Parameters of the noise for a further input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NoiseStatement {
    /// Standard deviation.
    pub(crate) std: f64,
    /// Seed of the noise.
    pub(crate) seed: u64,
    /// Divisor of the image's height and width, which are rounded up.
    pub(crate) divide: usize,
}

/// TOML table that states a map, noise or an expression.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SidecarTable {
    map: Option<SidecarNumber>,
    noise: Option<Distribution>,
    std: Option<f64>,
    seed: Option<u64>,
    divide: Option<usize>,
    from: Option<Expression>,
}

/// Distribution of noise.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Distribution {
    Normal,
}

impl TryFrom<SidecarTable> for ExtraValue {
    type Error = String;

    fn try_from(table: SidecarTable) -> Result<Self, String> {
        let has_noise_keys = table.std.is_some() || table.seed.is_some() || table.divide.is_some();
        match (table.map, table.noise, table.from) {
            (Some(map), None, None) if !has_noise_keys => Ok(Self::Map(map)),
            (None, None, Some(from)) if !has_noise_keys => Ok(Self::From(from)),
            (None, Some(Distribution::Normal), None) => {
                let std = table.std.unwrap_or(1.0);
                let divide = table.divide.unwrap_or(1);
                if !(0.0..=f64::from(f32::MAX)).contains(&std) || divide == 0 {
                    return Err(format!(
                        "noise with std = {std}, divide = {divide}; std must be 0 or more, divide a whole number of at least 1"
                    ));
                }
                Ok(Self::Noise(NoiseStatement { std, seed: table.seed.unwrap_or(0), divide }))
            }
            _ => Err(format!("a table in [extra] must be {FORMS}")),
        }
    }
}

/// Accepted forms of a table, for messages.
const FORMS: &str = "`{ map = NUMBER }`, `{ noise = \"normal\", std = NUMBER, seed = NUMBER, divide = NUMBER }` or `{ from = \"EXPRESSION\" }`";

impl Serialize for SidecarNumber {
    /// Writes an integer as a float if that is exact, so that `1` and `1.0` give the same digest.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Bool(value) => serializer.serialize_bool(*value),
            Self::Integer(value) if *value as f64 as i128 == i128::from(*value) => {
                serializer.serialize_f64(*value as f64)
            }
            Self::Integer(value) => serializer.serialize_i64(*value),
            Self::Float(value) => serializer.serialize_f64(*value),
        }
    }
}

impl Serialize for ExtraValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Number(number) => number.serialize(serializer),
            Self::List(numbers) => numbers.serialize(serializer),
            Self::Map(number) => SidecarTable { map: Some(*number), ..SidecarTable::default() }.serialize(serializer),
            Self::Noise(noise) => SidecarTable {
                noise: Some(Distribution::Normal),
                std: Some(noise.std),
                seed: Some(noise.seed),
                divide: Some(noise.divide),
                ..SidecarTable::default()
            }
            .serialize(serializer),
            Self::From(expression) => {
                SidecarTable { from: Some(expression.clone()), ..SidecarTable::default() }.serialize(serializer)
            }
        }
    }
}

/// Visitor of every form of an [`ExtraValue`].
struct ExtraValueVisitor;

impl<'de> Visitor<'de> for ExtraValueVisitor {
    type Value = ExtraValue;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a number, true, false, a list of these, {FORMS} (other keys stand above [extra])")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<ExtraValue, E> {
        Ok(ExtraValue::Number(SidecarNumber::Bool(value)))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<ExtraValue, E> {
        Ok(ExtraValue::Number(SidecarNumber::Integer(value)))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<ExtraValue, E> {
        Ok(ExtraValue::Number(SidecarNumber::Float(value)))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<ExtraValue, A::Error> {
        let mut numbers = Vec::new();
        while let Some(number) = list.next_element()? {
            numbers.push(number);
            if numbers.len() > MAX_NUMBERS {
                return Err(A::Error::custom(format!("a list can have at most {MAX_NUMBERS} numbers")));
            }
        }
        Ok(ExtraValue::List(numbers))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ExtraValue, A::Error> {
        let table = SidecarTable::deserialize(MapAccessDeserializer::new(map))?;
        ExtraValue::try_from(table).map_err(A::Error::custom)
    }
}

impl<'de> Deserialize<'de> for ExtraValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ExtraValueVisitor)
    }
}

impl<'de> Deserialize<'de> for SidecarNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match ExtraValue::deserialize(deserializer)? {
            ExtraValue::Number(number) => Ok(number),
            _ => Err(D::Error::custom("expected a number, true or false")),
        }
    }
}

impl ExtraValue {
    /// Checks, without a graph, that numbers are finite and that an expression uses only known names.
    ///
    /// # Errors
    /// A message about the faulty value of the key `name`.
    pub(super) fn check(&self, name: &str) -> Result<(), String> {
        match self {
            Self::Number(SidecarNumber::Float(value)) | Self::Map(SidecarNumber::Float(value))
                if !value.is_finite() =>
            {
                Err(format!("extra.{name} is {value}; expected a finite number"))
            }
            Self::List(numbers) => {
                match numbers.iter().find(|n| matches!(n, SidecarNumber::Float(value) if !value.is_finite())) {
                    None => Ok(()),
                    Some(value) => Err(format!("extra.{name} has {value}; expected finite numbers")),
                }
            }
            Self::From(expression) => expression.check_names(&format!("extra.{name}.from"), &["image"]),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for ExtraValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::List(numbers) => {
                let numbers: Vec<String> = numbers.iter().map(SidecarNumber::to_string).collect();
                write!(f, "[{}]", numbers.join(", "))
            }
            Self::Map(number) => write!(f, "map of {number}"),
            Self::Noise(NoiseStatement { std, seed, divide }) => {
                write!(f, "normal noise, std {std}, seed {seed}, divide {divide}")
            }
            Self::From(expression) => write!(f, "from {expression}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Parses and checks the value of a key `a`.
    fn parse(text: &str) -> Result<ExtraValue, String> {
        let mut all: BTreeMap<String, ExtraValue> =
            toml::from_str(&format!("a = {text}")).map_err(|e| e.message().to_owned())?;
        let value = all.remove("a").unwrap();
        value.check("a").map(|()| value)
    }

    #[test]
    fn every_form_is_parsed() {
        let rows = [
            ("3", ExtraValue::Number(SidecarNumber::Integer(3))),
            ("0.8", ExtraValue::Number(SidecarNumber::Float(0.8))),
            ("true", ExtraValue::Number(SidecarNumber::Bool(true))),
            ("[1, 2.5]", ExtraValue::List(vec![SidecarNumber::Integer(1), SidecarNumber::Float(2.5)])),
            ("{ map = 5.0 }", ExtraValue::Map(SidecarNumber::Float(5.0))),
            (
                "{ noise = \"normal\", std = 0.9, seed = 7, divide = 8 }",
                ExtraValue::Noise(NoiseStatement { std: 0.9, seed: 7, divide: 8 }),
            ),
            ("{ noise = \"normal\" }", ExtraValue::Noise(NoiseStatement { std: 1.0, seed: 0, divide: 1 })),
            ("{ from = \"1 - max(image)\" }", ExtraValue::From("1 - max(image)".parse().unwrap())),
        ];
        for (text, value) in rows {
            assert_eq!(parse(text), Ok(value), "{text}");
        }
    }

    #[test]
    fn error_about_a_wrong_form_names_the_accepted_forms() {
        for (text, part) in [
            ("\"3\"", "a number, true, false"),
            ("{ }", "{ map = NUMBER }"),
            ("{ map = 1, from = \"image\" }", "{ map = NUMBER }"),
            ("{ map = 1, seed = 3 }", "{ map = NUMBER }"),
            ("{ chart = 1 }", "chart"),
            ("{ map = { map = 1 } }", "a number, true or false"),
            ("{ noise = \"uniform\" }", "normal"),
            ("{ noise = \"normal\", std = -1 }", "std must be"),
            ("{ noise = \"normal\", std = inf }", "std must be"),
            ("{ noise = \"normal\", divide = 0 }", "divide a whole number"),
            ("{ from = \"image +\" }", "the end"),
            ("{ from = \"input\" }", "the names are `image`"),
            ("nan", "extra.a is NaN"),
            ("{ map = inf }", "extra.a is inf"),
        ] {
            let message = parse(text).unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
    }

    #[test]
    fn integers_are_serialized_as_floats_where_that_is_exact() {
        for (value, json) in
            [("1", "1.0"), ("0.8", "0.8"), ("1e-7", "1e-7"), ("true", "true"), ("9007199254740993", "9007199254740993")]
        {
            assert_eq!(serde_json::to_string(&parse(value).unwrap()).unwrap(), json);
        }
    }
}
