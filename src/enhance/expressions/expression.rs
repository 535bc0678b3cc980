//! Pixelwise arithmetic expression of a sidecar, such as `L ^ 0.2 * R`: [`Expression`].
//!
//! An expression has numbers, names (in backticks unless made of letters, digits and `_`), `+ - * / ^ ( )`, and the
//! functions `min`, `max`, `clip(x, low, high)`, `mean(x)` (the mean over the channels) and `curves(x, a, b, …)` (the
//! curves of Zero-DCE). `x[4:7]` selects three channels of the output `x`. `^` is right-associative, with negative
//! bases taken as 0. One channel is broadcast to three where the other argument has three. All arithmetic is in 32-bit
//! floats.

use std::fmt;
use std::str::FromStr;

use super::parser;
use super::term::{Sample, Term};
use crate::planes::Planes;
use darkqa_base::types::text::words::as_text;

/// Parsed expression, evaluated at each pixel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Expression {
    text: String,
    terms: Vec<Term>,
    names: Vec<String>,
}

impl FromStr for Expression {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = parser::parse(text).map_err(|problem| format!("{text:?}: {problem}"))?;
        Ok(Self { text: text.trim().to_owned(), terms: parsed.terms, names: parsed.names })
    }
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

as_text!(Expression);

impl Expression {
    /// Distinct names in the expression, in the order of their first use.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// True if the expression is just this name.
    pub(crate) fn is_name(&self, name: &str) -> bool {
        self.terms == [Term::Name(0)] && self.names[0] == name
    }

    /// Checks that each name is one of `known`; `key` is the sidecar's key of the expression.
    ///
    /// # Errors
    /// A message with the unknown names and the known ones.
    pub(crate) fn check_names(&self, key: &str, known: &[&str]) -> Result<(), String> {
        let unknown: Vec<String> =
            self.names.iter().filter(|n| !known.contains(&n.as_str())).map(|name| format!("`{name}`")).collect();
        if unknown.is_empty() {
            return Ok(());
        }
        let known: Vec<String> = known.iter().map(|name| format!("`{name}`")).collect();
        Err(format!(
            "{key} = {:?} names {}, which is unknown; the names are {}",
            self.text,
            unknown.join(", "),
            known.join(", ")
        ))
    }

    /// Evaluates the expression on images of one size, given in the order of [`Expression::names`].
    pub(crate) fn evaluate(&self, images: &[&Planes], [height, width]: [usize; 2]) -> Planes {
        let plane = height * width;
        let mut values = vec![Sample::One(0.0); images.len()];
        let mut stack = Vec::with_capacity(self.terms.len());
        let channels = if plane == 0 {
            1
        } else {
            let first_pixel: Vec<Sample> = images.iter().map(|image| image.sample(0)).collect();
            match self.value(&first_pixel, &mut stack) {
                Sample::One(_) => 1,
                Sample::Three(_) => 3,
            }
        };
        let mut samples = vec![0.0; channels * plane];
        for pixel in 0..plane {
            for (value, image) in values.iter_mut().zip(images) {
                *value = image.sample(pixel);
            }
            let value = self.value(&values, &mut stack).spread();
            for (channel, value) in value.into_iter().take(channels).enumerate() {
                samples[channel * plane + pixel] = value;
            }
        }
        Planes { height, width, samples }
    }

    /// Number of channels of the result, for images with these numbers of channels in the order of
    /// [`Expression::names`].
    pub(crate) fn channels(&self, image_channels: &[usize]) -> usize {
        let samples: Vec<Sample> = image_channels
            .iter()
            .map(|channels| match channels {
                1 => Sample::One(0.0),
                _ => Sample::Three([0.0; 3]),
            })
            .collect();
        match self.value(&samples, &mut Vec::new()) {
            Sample::One(_) => 1,
            Sample::Three(_) => 3,
        }
    }

    /// Value at one pixel; `names` holds the values of the names. The stack is empty before and after.
    fn value(&self, names: &[Sample], stack: &mut Vec<Sample>) -> Sample {
        for term in &self.terms {
            let first = stack.len() - term.arguments();
            let value = term.value(names, &stack[first..]);
            stack.truncate(first);
            stack.push(value);
        }
        stack.pop().unwrap_or(Sample::One(f32::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value of an expression for c = (0.5, 0.25, 1) and 0.25 for any other name.
    fn value(text: &str) -> Sample {
        let expression: Expression = text.parse().unwrap();
        let names: Vec<Sample> = expression
            .names
            .iter()
            .map(|name| match name.as_str() {
                "c" => Sample::Three([0.5, 0.25, 1.0]),
                _ => Sample::One(0.25),
            })
            .collect();
        expression.value(&names, &mut Vec::new())
    }

    #[test]
    fn operators_have_the_usual_precedence() {
        for (text, expected) in [
            ("1 + 2 * 3", 7.0),
            ("(1 + 2) * 3", 9.0),
            ("7 - 2 - 1", 4.0),
            ("8 / 4 / 2", 1.0),
            ("2 ^ 3 ^ 2", 512.0),
            ("-2 ^ 2", -4.0),
            ("2 ^ -1", 0.5),
            ("2 * -3", -6.0),
            ("(0 - 4) ^ 0.5", 0.0),
            ("(0 - 4) ^ 0", 1.0),
            ("1e-1 + .5 + 2E+0", 2.6),
            ("x", 0.25),
            ("`x:0/y` * 4", 1.0),
            ("mean", 0.25),
            ("min(3, 1, 2) + max(1, 2)", 3.0),
            ("clip(5, 0, 1) + clip(0 - 5, 0, 1)", 1.0),
            ("mean(c * 4 - 1)", 4.0 / 3.0),
            ("curves(x, 0 - 1, 2)", 0.25 + 0.1875 + 2.0 * (0.4375 * 0.4375 - 0.4375)),
            ("max(c) - min(c)", 0.75),
            ("mean(3)", 3.0),
        ] {
            assert_eq!(value(text), Sample::One(expected), "{text}");
        }
    }

    #[test]
    fn one_channel_is_broadcast_to_three() {
        assert_eq!(value("c * x"), Sample::Three([0.125, 0.0625, 0.25]));
        assert_eq!(value("1 - c"), Sample::Three([0.5, 0.75, 0.0]));
        assert_eq!(value("min(c, 0.5)"), Sample::Three([0.5, 0.25, 0.5]));
        let expression: Expression = "a * b".parse().unwrap();
        assert_eq!([[1, 1], [1, 3], [3, 1]].map(|n| expression.channels(&n)), [1, 3, 3]);
    }

    #[test]
    fn nan_is_propagated() {
        for text in ["max(0 / 0, 1)", "min(1, 0 / 0)", "clip(0 / 0, 0, 1)", "(0 / 0) ^ 1", "mean(c / 0 - c / 0)"] {
            let Sample::One(found) = value(text) else { panic!("{text}") };
            assert!(found.is_nan(), "{text}: {found}");
        }
    }

    #[test]
    fn syntax_errors_name_position_and_expected_element() {
        let cases = [
            ("", "at character 1, found the end"),
            ("1 +", "at character 4"),
            ("1 2", "an operator or the end at character 3"),
            ("(1", "a closing parenthesis"),
            ("1 & 2", "'&'"),
            ("sqrt(2)", "clip(x, low, high)"),
            ("clip(1, 2)", "clip(x, low, high)"),
            ("curves(x)", "curves(x, a, …)"),
            ("x[4]", "[4:7]"),
            ("mean(1, 2)", "mean(x)"),
            ("`a", "backtick"),
            ("``", "backtick"),
            ("1.2.3", "a finite number"),
            ("1e99", "a finite number"),
            ("1e", "a finite number"),
            ("é", "a name"),
        ];
        for (text, part) in cases {
            let message = Expression::from_str(text).unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
    }

    #[test]
    fn depth_and_length_are_bounded() {
        for text in ["(".repeat(900), "-".repeat(900), "2^".repeat(400) + "2", "min(".repeat(200)] {
            let message = Expression::from_str(&text).unwrap_err();
            assert!(message.contains("deeper than 50"), "{message}");
        }
        let message = Expression::from_str(&"1+".repeat(600)).unwrap_err();
        assert!(message.contains("at most 1000"), "{message}");
        let long = "1+".repeat(499) + "1";
        assert_eq!(value(&long), Sample::One(500.0));
    }

    #[test]
    fn unknown_names_are_listed_with_the_known_ones() {
        let expression: Expression = "L ^ 0.2 * R".parse().unwrap();
        assert_eq!(expression.check_names("image", &["R", "L"]), Ok(()));
        let message = expression.check_names("image", &["input", "R"]).unwrap_err();
        assert!(message.contains("names `L`") && message.ends_with("the names are `input`, `R`"), "{message}");
    }
}
