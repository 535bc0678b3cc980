//! The part of YAML in which the cards of data sets name their files: [`value`].
//!
//! Read are mappings and lists in blocks and in brackets, texts with and without quotes, and comments (YAML 1.2.2, chapters 7 and 8).
//! Anchors, tags and the like are refused.

use crate::types::shown_text::excerpt;

/// A value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Yaml {
    Nothing,
    Text(String),
    List(Vec<Yaml>),
    Fields(Vec<(String, Yaml)>),
}

impl Yaml {
    /// The value of a field.
    pub(super) fn field(&self, name: &str) -> Option<&Self> {
        let Self::Fields(fields) = self else {
            return None;
        };
        let mut fields = fields.iter();
        fields
            .find(|(field, _)| field == name)
            .map(|(_, value)| value)
    }
}

/// How deep values may lie in each other.
const DEEPEST: usize = 20;

/// A line with the number of spaces before it.
type Line<'a> = (usize, &'a str);

/// The value in some lines.
///
/// # Errors
/// If they hold anything that is not read; the error shows the line.
pub(super) fn value(text: &str) -> Result<Yaml, String> {
    let lines = text.lines().map(|line| without_comment(line).trim_end());
    let lines = lines.filter(|line| !line.trim().is_empty());
    let lines = lines.map(|line| (line.len() - line.trim_start().len(), line.trim_start()));
    let mut block = Block {
        lines: lines.collect(),
        next: 0,
    };
    let Some((indent, _)) = block.line() else {
        return Ok(Yaml::Nothing);
    };
    let value = block.value(indent, 0)?;
    match block.line() {
        None => Ok(value),
        Some((_, line)) => Err(format!(
            "the line {:?} is not understood",
            excerpt(line, 80)
        )),
    }
}

/// Lines, of which those before `next` are read.
struct Block<'a> {
    lines: Vec<Line<'a>>,
    next: usize,
}

impl<'a> Block<'a> {
    fn line(&self) -> Option<Line<'a>> {
        self.lines.get(self.next).copied()
    }

    /// The value whose lines begin after so many spaces.
    fn value(&mut self, indent: usize, depth: usize) -> Result<Yaml, String> {
        let Some((_, line)) = self.line() else {
            return Ok(Yaml::Nothing);
        };
        if depth > DEEPEST {
            return Err(format!(
                "the line {:?} is nested too deep",
                excerpt(line, 80)
            ));
        }
        if is_item(line) {
            return self.list(indent, depth);
        }
        if key(line).is_some() {
            return self.fields(indent, depth);
        }
        self.next += 1;
        self.scalar(line, indent.saturating_sub(1))
    }

    fn list(&mut self, indent: usize, depth: usize) -> Result<Yaml, String> {
        let mut items = Vec::new();
        while let Some((at, line)) = self.line() {
            if at != indent || !is_item(line) {
                break;
            }
            let rest = line[1..].trim_start();
            if rest.is_empty() {
                self.next += 1;
                items.push(self.below(indent, depth)?);
            } else {
                // What follows the dash stands as if on a line of its own.
                let inner = indent + line.len() - rest.len();
                self.lines[self.next] = (inner, rest);
                items.push(self.value(inner, depth + 1)?);
            }
        }
        Ok(Yaml::List(items))
    }

    fn fields(&mut self, indent: usize, depth: usize) -> Result<Yaml, String> {
        let mut fields = Vec::new();
        while let Some((at, line)) = self.line() {
            let Some((name, rest)) = key(line).filter(|_| at == indent) else {
                break;
            };
            self.next += 1;
            let value = match rest {
                "" => match self.line() {
                    // A list may begin below its name.
                    Some((at, line)) if at == indent && is_item(line) => {
                        self.list(indent, depth + 1)?
                    }
                    _ => self.below(indent, depth)?,
                },
                "|" | "|-" | ">" | ">-" => self.words(indent),
                rest => self.scalar(rest, indent)?,
            };
            fields.push((name, value));
        }
        Ok(Yaml::Fields(fields))
    }

    /// The value in the lines that begin further on.
    fn below(&mut self, indent: usize, depth: usize) -> Result<Yaml, String> {
        match self.line() {
            Some((at, _)) if at > indent => self.value(at, depth + 1),
            _ => Ok(Yaml::Nothing),
        }
    }

    /// The lines that begin further on, as one text.
    fn words(&mut self, indent: usize) -> Yaml {
        let mut words = Vec::new();
        while let Some((_, line)) = self.line().filter(|(at, _)| *at > indent) {
            words.push(line);
            self.next += 1;
        }
        Yaml::Text(words.join(" "))
    }

    /// A text, or a value in brackets, which may go on on further lines.
    fn scalar(&mut self, text: &str, indent: usize) -> Result<Yaml, String> {
        let mut text = text.to_owned();
        while let Some((_, line)) = self.line().filter(|(at, _)| *at > indent) {
            text = format!("{text} {line}");
            self.next += 1;
        }
        let (value, rest) = in_brackets(&text, 0)?;
        if rest.trim().is_empty() {
            return Ok(value);
        }
        Err(format!(
            "the value {:?} is not understood",
            excerpt(&text, 80)
        ))
    }
}

fn is_item(line: &str) -> bool {
    line == "-" || line.starts_with("- ")
}

/// The name of a field and what follows its colon; `None` if the line begins with none.
fn key(line: &str) -> Option<(String, &str)> {
    if let Some(quote) = line.chars().next().filter(|c| matches!(c, '"' | '\'')) {
        let (name, rest) = quoted(line, quote)?;
        let rest = rest.trim_start().strip_prefix(':')?;
        return (rest.is_empty() || rest.starts_with(' ')).then(|| (name, rest.trim()));
    }
    if line.starts_with(['[', '{']) {
        return None;
    }
    let at = line
        .match_indices(':')
        .map(|(at, _)| at)
        .find(|at| line.len() == at + 1 || line[at + 1..].starts_with(' '))?;
    Some((line[..at].trim().to_owned(), line[at + 1..].trim()))
}

/// A value in a text, and what follows it. Inside brackets a text without quotes ends at a comma or a bracket.
fn in_brackets(text: &str, depth: usize) -> Result<(Yaml, &str), String> {
    let text = text.trim_start();
    let wrong = || format!("the value {:?} is not understood", excerpt(text, 80));
    if depth > DEEPEST {
        return Err(wrong());
    }
    match text.chars().next() {
        None => Ok((Yaml::Nothing, "")),
        Some(quote @ ('"' | '\'')) => {
            let (text, rest) = quoted(text, quote).ok_or_else(wrong)?;
            Ok((Yaml::Text(text), rest))
        }
        Some('[') => {
            let (mut rest, mut items) = (text[1..].trim_start(), Vec::new());
            while !rest.starts_with(']') {
                let (item, after) = in_brackets(rest, depth + 1)?;
                items.push(item);
                let after = after.trim_start();
                rest = match after.strip_prefix(',') {
                    Some(after) => after.trim_start(),
                    None if after.starts_with(']') => after,
                    None => return Err(wrong()),
                };
            }
            Ok((Yaml::List(items), &rest[1..]))
        }
        Some('{') => {
            let (mut rest, mut fields) = (text[1..].trim_start(), Vec::new());
            while !rest.starts_with('}') {
                let (name, after) = key(rest)
                    .map(|(name, _)| {
                        let at = rest.find(": ").map_or(rest.len(), |at| at + 2);
                        (name, &rest[at..])
                    })
                    .ok_or_else(wrong)?;
                let (item, after) = in_brackets(after, depth + 1)?;
                fields.push((name, item));
                let after = after.trim_start();
                rest = match after.strip_prefix(',') {
                    Some(after) => after.trim_start(),
                    None if after.starts_with('}') => after,
                    None => return Err(wrong()),
                };
            }
            Ok((Yaml::Fields(fields), &rest[1..]))
        }
        Some('&' | '!' | '|' | '>' | '%' | '@' | '`') => Err(wrong()),
        Some(_) => {
            let end = match depth {
                0 => text.len(),
                _ => text.find([',', ']', '}']).unwrap_or(text.len()),
            };
            let (text, rest) = text.split_at(end);
            Ok((plain(text.trim()), rest))
        }
    }
}

fn plain(text: &str) -> Yaml {
    match text {
        "" | "~" | "null" => Yaml::Nothing,
        text => Yaml::Text(text.to_owned()),
    }
}

/// The text in quotes at the start of a text, and what follows it.
fn quoted(text: &str, quote: char) -> Option<(String, &str)> {
    let mut inner = String::new();
    let mut chars = text.char_indices().skip(1).peekable();
    while let Some((at, c)) = chars.next() {
        match c {
            '\\' if quote == '"' => inner.push(chars.next()?.1),
            c if c == quote => {
                // In single quotes, two of them are one.
                if quote == '\'' && chars.peek().is_some_and(|(_, next)| *next == quote) {
                    chars.next();
                    inner.push(quote);
                } else {
                    return Some((inner, &text[at + 1..]));
                }
            }
            c => inner.push(c),
        }
    }
    None
}

/// A line without the comment at its end.
fn without_comment(line: &str) -> &str {
    let (mut quote, mut before) = (None, ' ');
    for (at, c) in line.char_indices() {
        match (quote, c) {
            (None, '#') if before == ' ' => return &line[..at],
            (None, '"' | '\'') if " [{,:-".contains(before) => quote = Some(c),
            (Some(open), c) if c == open => quote = None,
            _ => {}
        }
        before = c;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Yaml {
        Yaml::Text(text.to_owned())
    }

    #[test]
    fn blocks_and_brackets_are_read() {
        let read = value("- name: 'it''s' # what\n  files:\n  - a: 1\n    b: [x, \"y, z\"]\n  - c\n- {d: e, f: [g]}\n-\n  - h\n").unwrap();
        let field = |name: &str, value| (name.to_owned(), value);
        let expected = Yaml::List(vec![
            Yaml::Fields(vec![
                field("name", text("it's")),
                field(
                    "files",
                    Yaml::List(vec![
                        Yaml::Fields(vec![
                            field("a", text("1")),
                            field("b", Yaml::List(vec![text("x"), text("y, z")])),
                        ]),
                        text("c"),
                    ]),
                ),
            ]),
            Yaml::Fields(vec![
                field("d", text("e")),
                field("f", Yaml::List(vec![text("g")])),
            ]),
            Yaml::List(vec![text("h")]),
        ]);
        assert_eq!(read, expected);
        assert_eq!(value(""), Ok(Yaml::Nothing));
        let long = value("a: >-\n  b\n  c\nd: [e,\n  f]\n").unwrap();
        assert_eq!(long.field("a"), Some(&text("b c")));
        assert_eq!(
            long.field("d"),
            Some(&Yaml::List(vec![text("e"), text("f")]))
        );
    }

    #[test]
    fn what_is_not_read_is_refused() {
        for wrong in [
            "a: &b c",
            "a: [b",
            "a: {b}",
            "a: !x b",
            "a: 'b",
            "a: 1\n b: 2\n c\nd",
        ] {
            assert!(value(wrong).is_err(), "{wrong}: {:?}", value(wrong));
        }
        let deep = "- ".repeat(3000) + "x";
        assert!(value(&deep).is_err());
        assert!(value(&format!("a: {}", "[".repeat(3000))).is_err());
    }
}
