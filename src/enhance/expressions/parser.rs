//! Recursive-descent parser of a sidecar's expression: [`parse`].
//!
//! ```text
//! sum     = product { ("+" | "-") product }
//! product = signed { ("*" | "/") signed }
//! signed  = "-" signed | power
//! power   = atom [ "^" signed ]
//! atom    = number | name [ "[" first ":" end "]" ] | function "(" sum { "," sum } ")" | "(" sum ")"
//! ```

use super::channel_slice::ChannelSlice;
use super::term::Term;

/// Maximum length of an expression, in characters; chosen.
const MAX_CHARACTERS: usize = 1000;
/// Maximum nesting of parentheses, signs and powers, so that no text overflows the stack; chosen.
const DEEPEST: usize = 50;

/// Terms of an expression in postfix order, and its names in the order of their first use.
pub(super) struct Parsed {
    pub(super) terms: Vec<Term>,
    pub(super) names: Vec<String>,
}

/// Parses an expression.
///
/// # Errors
/// A message with the expected element and its position in characters.
pub(super) fn parse(text: &str) -> Result<Parsed, String> {
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
        while let Some(term) = self.operator(&[('+', Term::Add), ('-', Term::Subtract)]) {
            self.product()?;
            self.parsed.terms.push(term);
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), String> {
        self.signed()?;
        while let Some(term) = self.operator(&[('*', Term::Multiply), ('/', Term::Divide)]) {
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
            self.parsed.terms.push(Term::Negate);
        } else {
            self.atom()?;
            if self.accept('^') {
                self.signed()?;
                self.parsed.terms.push(Term::Power);
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
                self.parsed.terms.push(Term::Number(number));
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
            ("min", count) => Term::Min(count),
            ("max", count) => Term::Max(count),
            ("clip", 3) => Term::Clip,
            ("mean", 1) => Term::Mean,
            ("curves", 2..) => Term::Curves(arguments),
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
        self.parsed.terms.push(Term::Name(index));
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

    fn operator(&mut self, operators: &[(char, Term)]) -> Option<Term> {
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
