//! Pixelwise arithmetic expressions of sidecars.
//!
//! Range of an output's channels, written `x[4:7]` in a sidecar: [`ChannelSlice`].
//!
//! Pixelwise arithmetic expression of a sidecar, such as `L ^ 0.2 * R`: [`Expression`].
//!
//! An expression has numbers, names (in backticks unless made of letters, digits and `_`), `+ - * / ^ ( )`, and the
//! functions `min`, `max`, `clip(x, low, high)`, `mean(x)` (the mean over the channels) and `curves(x, a, b, …)` (the
//! curves of Zero-DCE). `x[4:7]` selects three channels of the output `x`. `^` is right-associative, with negative
//! bases taken as 0. One channel is broadcast to three where the other argument has three. All arithmetic is in 32-bit
//! floats.
//!
//! Recursive-descent parser of a sidecar's expression: [`parse`].
//!
//! ```text
//! sum     = product { ("+" | "-") product }
//! product = signed { ("*" | "/") signed }
//! signed  = "-" signed | power
//! power   = atom [ "^" signed ]
//! atom    = number | name [ "[" first ":" end "]" ] | function "(" sum { "," sum } ")" | "(" sum ")"
//! ```

mod term;

use std::fmt;
use std::str::FromStr;

use super::planes::Planes;
use darkqa_base::types::text::words::as_text;
use term::StackElement;

pub(super) use term::PixelValue;

/// Range of channels, counted from 0; `end` is excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ChannelSlice {
    pub(crate) first: usize,
    pub(crate) end: usize,
}

impl ChannelSlice {
    /// Splits `x[4:7]` into the output's name and the slice; `None` if the text does not end with a slice.
    pub(crate) fn split(text: &str) -> Option<(&str, Self)> {
        let (name, slice) = text.trim_end().strip_suffix(']')?.rsplit_once('[')?;
        let (first, end) = slice.split_once(':')?;
        let (first, end) = (first.trim().parse().ok()?, end.trim().parse().ok()?);
        (first < end).then_some((name, Self { first, end }))
    }

    /// Number of channels.
    pub(crate) fn count(self) -> usize {
        self.end - self.first
    }
}

/// Parsed expression, evaluated at each pixel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Expression {
    text: String,
    terms: Vec<StackElement>,
    names: Vec<String>,
}

impl FromStr for Expression {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = parse(text).map_err(|problem| format!("{text:?}: {problem}"))?;
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
        self.terms == [StackElement::Name(0)] && self.names[0] == name
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
        let mut values = vec![PixelValue::One(0.0); images.len()];
        let mut stack = Vec::with_capacity(self.terms.len());
        let channels = if plane == 0 {
            1
        } else {
            let first_pixel: Vec<PixelValue> = images.iter().map(|image| image.sample(0)).collect();
            match self.value(&first_pixel, &mut stack) {
                PixelValue::One(_) => 1,
                PixelValue::Three(_) => 3,
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
        let samples: Vec<PixelValue> = image_channels
            .iter()
            .map(|channels| match channels {
                1 => PixelValue::One(0.0),
                _ => PixelValue::Three([0.0; 3]),
            })
            .collect();
        match self.value(&samples, &mut Vec::new()) {
            PixelValue::One(_) => 1,
            PixelValue::Three(_) => 3,
        }
    }

    /// Value at one pixel; `names` holds the values of the names. The stack is empty before and after.
    fn value(&self, names: &[PixelValue], stack: &mut Vec<PixelValue>) -> PixelValue {
        for term in &self.terms {
            let first = stack.len() - term.arguments();
            let value = term.value(names, &stack[first..]);
            stack.truncate(first);
            stack.push(value);
        }
        stack.pop().unwrap_or(PixelValue::One(f32::NAN))
    }
}

/// Maximum length of an expression, in characters; chosen.
const MAX_CHARACTERS: usize = 1000;

/// Maximum nesting of parentheses, signs and powers, so that no text overflows the stack; chosen.
const DEEPEST: usize = 50;

/// Terms of an expression in postfix order, and its names in the order of their first use.
pub(super) struct Parsed {
    terms: Vec<StackElement>,
    names: Vec<String>,
}

/// Parses an expression.
///
/// # Errors
/// A message with the expected element and its position in characters.
fn parse(text: &str) -> Result<Parsed, String> {
    let characters: Vec<char> = text.chars().collect();
    if characters.len() > MAX_CHARACTERS {
        return Err(format!(
            "the expression has {} characters; at most {MAX_CHARACTERS} are allowed",
            characters.len()
        ));
    }
    let mut parser =
        Parser { characters, position: 0, depth: 0, parsed: Parsed { terms: Vec::new(), names: Vec::new() } };
    parser.sum()?;
    match parser.peek() {
        None => Ok(parser.parsed),
        Some(_) => Err(parser.error("an operator or the end")),
    }
}

struct Parser {
    characters: Vec<char>,
    position: usize,
    depth: usize,
    parsed: Parsed,
}

impl Parser {
    fn sum(&mut self) -> Result<(), String> {
        self.product()?;
        while let Some(term) = self.operator(&[('+', StackElement::Add), ('-', StackElement::Subtract)]) {
            self.product()?;
            self.parsed.terms.push(term);
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), String> {
        self.signed()?;
        while let Some(term) = self.operator(&[('*', StackElement::Multiply), ('/', StackElement::Divide)]) {
            self.signed()?;
            self.parsed.terms.push(term);
        }
        Ok(())
    }

    /// Parses an operand with its signs and powers. All nesting passes through this function, which limits its depth.
    fn signed(&mut self) -> Result<(), String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("it is nested deeper than {DEEPEST} levels"));
        }
        if self.accept('-') {
            self.signed()?;
            self.parsed.terms.push(StackElement::Negate);
        } else {
            self.atom()?;
            if self.accept('^') {
                self.signed()?;
                self.parsed.terms.push(StackElement::Power);
            }
        }
        self.depth -= 1;
        Ok(())
    }

    fn atom(&mut self) -> Result<(), String> {
        match self.peek() {
            Some('(') => {
                self.position += 1;
                self.sum()?;
                self.close()
            }
            Some('`') => {
                self.position += 1;
                let name = self.take_while(|c| c != '`');
                if self.peek() != Some('`') || name.is_empty() {
                    return Err(self.error("a name that ends with a backtick"));
                }
                self.position += 1;
                self.name(name)
            }
            Some(c) if is_digit_or_point(c) => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => {
                let start = self.position;
                let word = self.take_while(|c| c.is_ascii_alphanumeric() || c == '_');
                if self.accept('(') { self.function(&word, start) } else { self.name(word) }
            }
            _ => Err(self.error("a number, a name or an opening parenthesis")),
        }
    }

    fn number(&mut self) -> Result<(), String> {
        let start = self.position;
        let mut digits = self.take_while(is_digit_or_point);
        if let Some(exponent @ ('e' | 'E')) = self.characters.get(self.position).copied() {
            digits.push(exponent);
            self.position += 1;
            if let Some(sign @ ('+' | '-')) = self.characters.get(self.position).copied() {
                digits.push(sign);
                self.position += 1;
            }
            digits.push_str(&self.take_while(is_digit_or_point));
        }
        match digits.parse::<f32>() {
            Ok(number) if number.is_finite() => {
                self.parsed.terms.push(StackElement::Number(number));
                Ok(())
            }
            _ => {
                self.position = start;
                Err(self.error("a finite number"))
            }
        }
    }

    /// Parses the arguments of the function `name`, which starts at `start`, after the opening parenthesis.
    fn function(&mut self, name: &str, start: usize) -> Result<(), String> {
        self.sum()?;
        let mut arguments = 1;
        while self.accept(',') {
            self.sum()?;
            arguments += 1;
        }
        self.close()?;
        let term = match (name, arguments) {
            ("min", count) => StackElement::Min(count),
            ("max", count) => StackElement::Max(count),
            ("clip", 3) => StackElement::Clip,
            ("mean", 1) => StackElement::Mean,
            ("curves", 2..) => StackElement::Curves(arguments),
            _ => {
                self.position = start;
                return Err(self.error("min(…), max(…), clip(x, low, high), mean(x) or curves(x, a, …)"));
            }
        };
        self.parsed.terms.push(term);
        Ok(())
    }

    /// Parses the optional channel slice after a name, and adds the name's term.
    fn name(&mut self, mut name: String) -> Result<(), String> {
        if self.accept('[') {
            let slice = self.take_while(|c| c != ']');
            name = format!("{name}[{slice}]");
            if !self.accept(']') || ChannelSlice::split(&name).is_none() {
                return Err(self.error("channels such as [4:7] (from 0, end excluded)"));
            }
        }
        let names = &mut self.parsed.names;
        let index = names.iter().position(|known| *known == name).unwrap_or_else(|| {
            names.push(name);
            names.len() - 1
        });
        self.parsed.terms.push(StackElement::Name(index));
        Ok(())
    }

    fn close(&mut self) -> Result<(), String> {
        if self.accept(')') { Ok(()) } else { Err(self.error("an operator or a closing parenthesis")) }
    }

    /// Skips white space and returns the next character without consuming it.
    fn peek(&mut self) -> Option<char> {
        while self.characters.get(self.position).is_some_and(|c| c.is_whitespace()) {
            self.position += 1;
        }
        self.characters.get(self.position).copied()
    }

    /// Consumes the next character if it is `wanted`; returns whether it was.
    fn accept(&mut self, wanted: char) -> bool {
        let is_next = self.peek() == Some(wanted);
        self.position += usize::from(is_next);
        is_next
    }

    fn operator(&mut self, operators: &[(char, StackElement)]) -> Option<StackElement> {
        operators.iter().find(|(c, _)| self.accept(*c)).map(|(_, term)| *term)
    }

    /// Consumes and returns the following characters that satisfy `accepts`.
    fn take_while(&mut self, accepts: impl Fn(char) -> bool) -> String {
        let text: String = self.characters[self.position..].iter().take_while(|c| accepts(**c)).collect();
        self.position += text.chars().count();
        text
    }

    fn error(&self, expected: &str) -> String {
        let found = match self.characters.get(self.position) {
            None => "the end".to_owned(),
            Some(c) => format!("{c:?}"),
        };
        format!("expected {expected} at character {}, found {found}", self.position + 1)
    }
}

fn is_digit_or_point(c: char) -> bool {
    c.is_ascii_digit() || c == '.'
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slice_follows_the_name_in_brackets() {
        let slice = ChannelSlice { first: 4, end: 7 };
        assert_eq!(slice.count(), 3);
        assert_eq!(ChannelSlice::split("x[4:7]"), Some(("x", slice)));
        let spaced = ChannelSlice { first: 1, end: 2 };
        assert_eq!(ChannelSlice::split("a[0][ 1 : 2 ]"), Some(("a[0]", spaced)));
        for text in ["x", "x[4]", "x[7:4]", "x[-1:2]"] {
            assert_eq!(ChannelSlice::split(text), None, "{text}");
        }
    }

    /// Value of an expression for c = (0.5, 0.25, 1) and 0.25 for any other name.
    fn value(text: &str) -> PixelValue {
        let expression: Expression = text.parse().unwrap();
        let names: Vec<PixelValue> = expression
            .names
            .iter()
            .map(|name| match name.as_str() {
                "c" => PixelValue::Three([0.5, 0.25, 1.0]),
                _ => PixelValue::One(0.25),
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
            assert_eq!(value(text), PixelValue::One(expected), "{text}");
        }
    }

    #[test]
    fn one_channel_is_broadcast_to_three() {
        assert_eq!(value("c * x"), PixelValue::Three([0.125, 0.0625, 0.25]));
        assert_eq!(value("1 - c"), PixelValue::Three([0.5, 0.75, 0.0]));
        assert_eq!(value("min(c, 0.5)"), PixelValue::Three([0.5, 0.25, 0.5]));
        let expression: Expression = "a * b".parse().unwrap();
        assert_eq!([[1, 1], [1, 3], [3, 1]].map(|n| expression.channels(&n)), [1, 3, 3]);
    }

    #[test]
    fn nan_is_propagated() {
        for text in ["max(0 / 0, 1)", "min(1, 0 / 0)", "clip(0 / 0, 0, 1)", "(0 / 0) ^ 1", "mean(c / 0 - c / 0)"] {
            let PixelValue::One(found) = value(text) else { panic!("{text}") };
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
        assert_eq!(value(&long), PixelValue::One(500.0));
    }

    #[test]
    fn unknown_names_are_listed_with_the_known_ones() {
        let expression: Expression = "L ^ 0.2 * R".parse().unwrap();
        assert_eq!(expression.check_names("image", &["R", "L"]), Ok(()));
        let message = expression.check_names("image", &["input", "R"]).unwrap_err();
        assert!(message.contains("names `L`") && message.ends_with("the names are `input`, `R`"), "{message}");
    }
}
