//! Reading the text of a sidecar's expression: [`parse`].
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

/// Largest number of characters of an expression; chosen.
const MOST_CHARACTERS: usize = 1000;
/// Deepest nesting of parentheses, signs and powers, so that no text overflows the stack; chosen.
const DEEPEST: usize = 50;

/// Steps of an expression in postfix order, and its names in the order of their first use.
pub(super) struct Parsed {
    pub(super) terms: Vec<Term>,
    pub(super) names: Vec<String>,
}

/// Reads an expression.
///
/// # Errors
/// The expected element and the position in characters.
pub(super) fn parse(text: &str) -> Result<Parsed, String> {
    let characters: Vec<char> = text.chars().collect();
    if characters.len() > MOST_CHARACTERS {
        return Err(format!(
            "the expression has {} characters; at most {MOST_CHARACTERS} are allowed",
            characters.len()
        ));
    }
    let mut parser = Parser {
        characters,
        at: 0,
        depth: 0,
        parsed: Parsed {
            terms: Vec::new(),
            names: Vec::new(),
        },
    };
    parser.sum()?;
    match parser.peek() {
        None => Ok(parser.parsed),
        Some(_) => Err(parser.wrong("an operator or the end")),
    }
}

struct Parser {
    characters: Vec<char>,
    at: usize,
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

    /// All nesting goes through here.
    fn signed(&mut self) -> Result<(), String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("it is nested deeper than {DEEPEST} levels"));
        }
        if self.taken('-') {
            self.signed()?;
            self.parsed.terms.push(Term::Negate);
        } else {
            self.atom()?;
            if self.taken('^') {
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
                self.at += 1;
                self.sum()?;
                self.close()
            }
            Some('`') => {
                self.at += 1;
                let name = self.word(|c| c != '`');
                if self.peek() != Some('`') || name.is_empty() {
                    return Err(self.wrong("a name that ends with a backtick"));
                }
                self.at += 1;
                self.name(name)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => {
                let start = self.at;
                let word = self.word(|c| c.is_ascii_alphanumeric() || c == '_');
                if self.taken('(') {
                    self.function(&word, start)
                } else {
                    self.name(word)
                }
            }
            _ => Err(self.wrong("a number, a name or an opening parenthesis")),
        }
    }

    fn number(&mut self) -> Result<(), String> {
        let start = self.at;
        let is_part = |c: char| c.is_ascii_digit() || c == '.';
        let mut digits = self.word(is_part);
        let mark = self.characters.get(self.at).copied();
        if let Some(mark @ ('e' | 'E')) = mark {
            digits.push(mark);
            self.at += 1;
            if let Some(sign @ ('+' | '-')) = self.characters.get(self.at).copied() {
                digits.push(sign);
                self.at += 1;
            }
            digits.push_str(&self.word(is_part));
        }
        match digits.parse::<f32>() {
            Ok(number) if number.is_finite() => {
                self.parsed.terms.push(Term::Number(number));
                Ok(())
            }
            _ => {
                self.at = start;
                Err(self.wrong("a finite number"))
            }
        }
    }

    fn function(&mut self, word: &str, start: usize) -> Result<(), String> {
        self.sum()?;
        let mut arguments = 1;
        while self.taken(',') {
            self.sum()?;
            arguments += 1;
        }
        self.close()?;
        let term = match (word, arguments) {
            ("min", count) => Term::Min(count),
            ("max", count) => Term::Max(count),
            ("clip", 3) => Term::Clip,
            ("mean", 1) => Term::Mean,
            ("curves", 2..) => Term::Curves(arguments),
            _ => {
                self.at = start;
                return Err(
                    self.wrong("min(…), max(…), clip(x, low, high), mean(x) or curves(x, a, …)")
                );
            }
        };
        self.parsed.terms.push(term);
        Ok(())
    }

    /// A name, with the channels in brackets behind it, if there are any.
    fn name(&mut self, mut name: String) -> Result<(), String> {
        if self.taken('[') {
            let slice = self.word(|c| c != ']');
            name = format!("{name}[{slice}]");
            if !self.taken(']') || ChannelSlice::split(&name).is_none() {
                return Err(self.wrong("channels such as [4:7] (from 0, end excluded)"));
            }
        }
        let names = &mut self.parsed.names;
        let index = names.iter().position(|known| *known == name);
        let index = index.unwrap_or_else(|| {
            names.push(name);
            names.len() - 1
        });
        self.parsed.terms.push(Term::Name(index));
        Ok(())
    }

    fn close(&mut self) -> Result<(), String> {
        if self.taken(')') {
            Ok(())
        } else {
            Err(self.wrong("an operator or a closing parenthesis"))
        }
    }

    /// The next character that is no space.
    fn peek(&mut self) -> Option<char> {
        while self
            .characters
            .get(self.at)
            .is_some_and(|c| c.is_whitespace())
        {
            self.at += 1;
        }
        self.characters.get(self.at).copied()
    }

    /// Whether the next character is this one, which is then passed.
    fn taken(&mut self, wanted: char) -> bool {
        let taken = self.peek() == Some(wanted);
        self.at += usize::from(taken);
        taken
    }

    fn operator(&mut self, operators: &[(char, Term)]) -> Option<Term> {
        operators
            .iter()
            .find(|(c, _)| self.taken(*c))
            .map(|(_, term)| *term)
    }

    /// The characters from here on that belong to a word.
    fn word(&mut self, belongs: impl Fn(char) -> bool) -> String {
        let word: String = self.characters[self.at..]
            .iter()
            .take_while(|c| belongs(**c))
            .collect();
        self.at += word.chars().count();
        word
    }

    fn wrong(&self, expected: &str) -> String {
        let found = self.characters.get(self.at);
        let found = found.map_or("the end".to_owned(), |c| format!("{c:?}"));
        format!(
            "expected {expected} at character {}, found {found}",
            self.at + 1
        )
    }
}
