//! The YAML in which the cards of data sets name their files: [`value`].

use saphyr_parser::{Event, Parser, ScalarStyle, StrInput};

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
        fields
            .iter()
            .find(|(field, _)| field == name)
            .map(|(_, value)| value)
    }
}

/// Most levels of values in each other; chosen.
const DEEPEST: usize = 20;

/// The value of a text. Anchors, aliases and tags are refused, so that a value is no longer than its text.
///
/// # Errors
/// If it is not YAML, or holds something that is not read.
pub(super) fn value(text: &str) -> Result<Yaml, String> {
    let mut reader = Reader(Parser::new_from_str(text));
    let mut value = Yaml::Nothing;
    loop {
        match reader.next()? {
            Event::StreamEnd => return Ok(value),
            Event::Nothing | Event::StreamStart | Event::DocumentStart(_) | Event::DocumentEnd => {}
            event => value = reader.value(event, 0)?,
        }
    }
}

/// The events of a text.
struct Reader<'a>(Parser<'a, StrInput<'a>>);

impl<'a> Reader<'a> {
    fn next(&mut self) -> Result<Event<'a>, String> {
        match self.0.next() {
            None => Ok(Event::StreamEnd),
            Some(Ok((event, _))) => Ok(event),
            Some(Err(error)) => Err(format!("not YAML: {error}")),
        }
    }

    /// The value that an event begins.
    fn value(&mut self, event: Event<'a>, depth: usize) -> Result<Yaml, String> {
        if depth > DEEPEST {
            return Err(format!("values are nested more than {DEEPEST} levels deep"));
        }
        match event {
            Event::Scalar(text, ScalarStyle::Plain, 0, None)
                if matches!(&*text, "" | "~" | "null") =>
            {
                Ok(Yaml::Nothing)
            }
            Event::Scalar(text, _, 0, None) => Ok(Yaml::Text(text.into_owned())),
            Event::SequenceStart(0, None) => {
                let mut items = Vec::new();
                loop {
                    match self.next()? {
                        Event::SequenceEnd => return Ok(Yaml::List(items)),
                        event => items.push(self.value(event, depth + 1)?),
                    }
                }
            }
            Event::MappingStart(0, None) => {
                let mut fields = Vec::new();
                loop {
                    let name = match self.next()? {
                        Event::MappingEnd => return Ok(Yaml::Fields(fields)),
                        event => self.value(event, depth + 1)?,
                    };
                    let Yaml::Text(name) = name else {
                        return Err("the name of a field is not a text".to_owned());
                    };
                    let event = self.next()?;
                    fields.push((name, self.value(event, depth + 1)?));
                }
            }
            _ => Err("anchors, aliases and tags are not read".to_owned()),
        }
    }
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
        let long = value("a: >-\n  b\n  c\nd: [e,\n  f]\ng: ~\nh: '~'\n").unwrap();
        assert_eq!(long.field("a"), Some(&text("b c")));
        assert_eq!(
            long.field("d"),
            Some(&Yaml::List(vec![text("e"), text("f")]))
        );
        assert_eq!(long.field("g"), Some(&Yaml::Nothing));
        assert_eq!(long.field("h"), Some(&text("~")));
    }

    #[test]
    fn what_is_not_read_is_refused() {
        for wrong in [
            "a: &b c",
            "a: [b",
            "a: !x b",
            "a: 'b",
            "a: 1\n b: 2\n c\nd",
            "[a]: b",
            "a: &x [b]\nc: [*x, *x]",
        ] {
            assert!(value(wrong).is_err(), "{wrong}: {:?}", value(wrong));
        }
    }

    #[test]
    fn deep_and_unfinished_texts_end_at_once() {
        for deep in ["- ", "[", "{a: ", "? "] {
            for count in [3000, 300_000] {
                assert!(value(&(deep.repeat(count) + "x")).is_err(), "{deep}");
            }
        }
    }
}
