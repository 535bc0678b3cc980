//! Parser for the YAML in a data set's card, which lists the data files: [`value`].

use saphyr_parser::{Event, Parser, ScalarStyle, StrInput};

/// A parsed YAML value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Yaml {
    /// Null, or an empty document.
    Nothing,
    /// Any other scalar, numbers included.
    Text(String),
    List(Vec<Yaml>),
    /// A mapping, in file order.
    Fields(Vec<(String, Yaml)>),
}

impl Yaml {
    /// The value of the first field of this name; `None` if there is none or this is not a mapping.
    pub(super) fn field(&self, name: &str) -> Option<&Self> {
        let Self::Fields(fields) = self else {
            return None;
        };
        fields.iter().find(|(field, _)| field == name).map(|(_, value)| value)
    }
}

/// Maximum nesting depth; chosen.
const DEEPEST: usize = 20;

/// Parses a YAML text. Anchors, aliases and tags are rejected, so a value cannot be larger than its text.
///
/// # Errors
/// If the text is not YAML, is nested too deeply, or has an anchor, an alias, a tag or a field name that is not a text.
pub(super) fn value(text: &str) -> Result<Yaml, String> {
    let mut reader = EventReader(Parser::new_from_str(text));
    let mut value = Yaml::Nothing;
    loop {
        match reader.next_event()? {
            Event::StreamEnd => return Ok(value),
            Event::Nothing | Event::StreamStart | Event::DocumentStart(_) | Event::DocumentEnd => {}
            event => value = reader.parse_value(event, 0)?,
        }
    }
}

/// Builds values from the events of the YAML parser.
struct EventReader<'a>(Parser<'a, StrInput<'a>>);

impl<'a> EventReader<'a> {
    /// The next event; [`Event::StreamEnd`] at the end of the text.
    fn next_event(&mut self) -> Result<Event<'a>, String> {
        match self.0.next() {
            None => Ok(Event::StreamEnd),
            Some(Ok((event, _))) => Ok(event),
            Some(Err(error)) => Err(format!("not YAML: {error}")),
        }
    }

    /// Parses the value that starts with `event`. `depth` is 0 at the top level.
    fn parse_value(&mut self, event: Event<'a>, depth: usize) -> Result<Yaml, String> {
        if depth > DEEPEST {
            return Err(format!("values are nested more than {DEEPEST} levels deep"));
        }
        match event {
            Event::Scalar(text, ScalarStyle::Plain, 0, None) if matches!(&*text, "" | "~" | "null") => {
                Ok(Yaml::Nothing)
            }
            Event::Scalar(text, _, 0, None) => Ok(Yaml::Text(text.into_owned())),
            Event::SequenceStart(0, None) => {
                let mut items = Vec::new();
                loop {
                    match self.next_event()? {
                        Event::SequenceEnd => return Ok(Yaml::List(items)),
                        event => items.push(self.parse_value(event, depth + 1)?),
                    }
                }
            }
            Event::MappingStart(0, None) => {
                let mut fields = Vec::new();
                loop {
                    let name = match self.next_event()? {
                        Event::MappingEnd => return Ok(Yaml::Fields(fields)),
                        event => self.parse_value(event, depth + 1)?,
                    };
                    let Yaml::Text(name) = name else {
                        return Err("the name of a field is not a text".to_owned());
                    };
                    let event = self.next_event()?;
                    fields.push((name, self.parse_value(event, depth + 1)?));
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

    fn field(name: &str, value: Yaml) -> (String, Yaml) {
        (name.to_owned(), value)
    }

    #[test]
    fn parses_block_and_flow_style() {
        let read = value(
            "- name: 'it''s' # what\n  files:\n  - a: 1\n    b: [x, \"y, z\"]\n  - c\n- {d: e, f: [g]}\n-\n  - h\n",
        )
        .unwrap();
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
            Yaml::Fields(vec![field("d", text("e")), field("f", Yaml::List(vec![text("g")]))]),
            Yaml::List(vec![text("h")]),
        ]);
        assert_eq!(read, expected);
        assert_eq!(value(""), Ok(Yaml::Nothing));
        let long = value("a: >-\n  b\n  c\nd: [e,\n  f]\ng: ~\nh: '~'\n").unwrap();
        assert_eq!(long.field("a"), Some(&text("b c")));
        assert_eq!(long.field("d"), Some(&Yaml::List(vec![text("e"), text("f")])));
        assert_eq!(long.field("g"), Some(&Yaml::Nothing));
        assert_eq!(long.field("h"), Some(&text("~")));
    }

    #[test]
    fn rejects_invalid_and_unsupported_yaml() {
        for wrong in ["a: &b c", "a: [b", "a: !x b", "a: 'b", "a: 1\n b: 2\n c\nd", "[a]: b", "a: &x [b]\nc: [*x, *x]"]
        {
            assert!(value(wrong).is_err(), "{wrong}: {:?}", value(wrong));
        }
    }

    #[test]
    fn rejects_deep_nesting() {
        for deep in ["- ", "[", "{a: ", "? "] {
            for count in [3000, 300_000] {
                assert!(value(&(deep.repeat(count) + "x")).is_err(), "{deep}");
            }
        }
    }
}
