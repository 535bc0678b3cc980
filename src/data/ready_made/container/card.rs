//! Configurations in the dataset card of a repository: [`parse_configs`].
//!
//! A card is a `README.md` that starts with YAML. Only its field `configs` is used (Hugging Face, "Manual
//! Configuration"): a list of mappings with `config_name`, `default`, `data_dir` and `data_files`. `data_files` is a
//! pattern, a list of patterns, a list of `split` and `path`, or a mapping of splits to patterns.
//!
//! Parser for the YAML in a data set's card, which lists the data files: [`value`].

use saphyr_parser::{Event, Parser, ScalarStyle, StrInput};

/// One configuration of a repository.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Config {
    pub(super) name: String,
    pub(super) is_default: bool,
    /// Folder of the patterns; empty for the folder of the card.
    pub(super) folder: String,
    /// Patterns of the files; `None` for all files of the folder.
    pub(super) files: Option<Vec<SplitPattern>>,
}

/// Pattern of the files of a split.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct SplitPattern {
    /// Name of the split; empty if the card does not name it.
    pub(super) split: String,
    pub(super) pattern: String,
}

/// Parses the configurations of a card; empty if it has none.
///
/// # Errors
/// If `configs` is not in a supported form.
pub(super) fn parse_configs(card: &str) -> Result<Vec<Config>, String> {
    let card = card.trim_start_matches('\u{feff}').replace("\r\n", "\n");
    let head = card.strip_prefix("---\n").and_then(|rest| rest.split_once("\n---"));
    let mut lines = head.map_or("", |(head, _)| head).lines().skip_while(|line| top_level_key(line) != Some("configs"));
    let Some(first) = lines.next() else {
        return Ok(Vec::new());
    };
    let text: Vec<&str> =
        std::iter::once(first).chain(lines.take_while(|line| top_level_key(line).is_none())).collect();
    let configs = value(&text.join("\n"))?;
    match configs.field("configs") {
        None | Some(Yaml::Nothing) => Ok(Vec::new()),
        Some(Yaml::List(configs)) => configs.iter().map(parse_config).collect(),
        Some(_) => Err("configs is not a list".to_owned()),
    }
}

/// Key of a line without indentation; `None` for other lines.
fn top_level_key(line: &str) -> Option<&str> {
    if line.starts_with([' ', '\t', '-', '#']) {
        return None;
    }
    let (name, _) = line.split_once(':')?;
    Some(name.trim_end())
}

fn parse_config(config: &Yaml) -> Result<Config, String> {
    if !matches!(config, Yaml::Fields(_)) {
        return Err("configs holds something other than mappings".to_owned());
    }
    let name = match text_field(config, "config_name")? {
        name if name.is_empty() => "default".to_owned(),
        name => name,
    };
    let with_name = |problem: String| format!("configuration {name:?}: {problem}");
    Ok(Config {
        is_default: text_field(config, "default").map_err(with_name)?.eq_ignore_ascii_case("true"),
        folder: text_field(config, "data_dir").map_err(with_name)?,
        files: match config.field("data_files") {
            None | Some(Yaml::Nothing) => None,
            Some(files) => Some(parse_data_files(files).map_err(with_name)?),
        },
        name,
    })
}

/// A text field; empty if it is absent.
fn text_field(config: &Yaml, name: &str) -> Result<String, String> {
    match config.field(name) {
        None | Some(Yaml::Nothing) => Ok(String::new()),
        Some(Yaml::Text(text)) => Ok(text.clone()),
        Some(_) => Err(format!("{name} is not a text")),
    }
}

/// Parses the value of `data_files`.
fn parse_data_files(files: &Yaml) -> Result<Vec<SplitPattern>, String> {
    let mut found = Vec::new();
    match files {
        Yaml::Fields(splits) => {
            for (split, files) in splits {
                add_patterns(split, files, &mut found)?;
            }
        }
        Yaml::List(entries) => {
            for entry in entries {
                let (split, files) = match entry {
                    Yaml::Fields(_) => parse_split_entry(entry)?,
                    files => ("", files),
                };
                add_patterns(split, files, &mut found)?;
            }
        }
        files => add_patterns("", files, &mut found)?,
    }
    Ok(found)
}

/// Parses a mapping of `split` and `path`: the split (empty if it is missing) and the patterns.
fn parse_split_entry(entry: &Yaml) -> Result<(&str, &Yaml), String> {
    let path = entry.field("path").ok_or("an entry of data_files has no path")?;
    match entry.field("split") {
        Some(Yaml::Text(split)) => Ok((split.as_str(), path)),
        None => Ok(("", path)),
        Some(_) => Err("a split of data_files is not a text".to_owned()),
    }
}

/// Adds the patterns of a split.
fn add_patterns(split: &str, files: &Yaml, found: &mut Vec<SplitPattern>) -> Result<(), String> {
    for pattern in parse_patterns(files)? {
        found.push(SplitPattern { split: split.to_owned(), pattern });
    }
    Ok(())
}

/// Parses a pattern or a list of patterns.
fn parse_patterns(files: &Yaml) -> Result<Vec<String>, String> {
    match files {
        Yaml::Text(pattern) => Ok(vec![pattern.clone()]),
        Yaml::List(patterns) => patterns
            .iter()
            .map(|pattern| match pattern {
                Yaml::Text(pattern) => Ok(pattern.clone()),
                _ => Err("a pattern of data_files is not a text".to_owned()),
            })
            .collect(),
        Yaml::Nothing | Yaml::Fields(_) => Err("data_files names no patterns".to_owned()),
    }
}

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

    fn file(split: &str, pattern: &str) -> SplitPattern {
        SplitPattern { split: split.to_owned(), pattern: pattern.to_owned() }
    }

    fn config(name: &str, is_default: bool, files: Vec<SplitPattern>) -> Config {
        Config { name: name.to_owned(), is_default, folder: String::new(), files: Some(files) }
    }

    #[test]
    fn configs_of_cards_are_parsed() {
        let card = "---\nlicense: mit\nconfigs:\n- config_name: Full\n  data_files:\n  - split: adversarial\n    path: Full/adversarial-*\n  - split: popular\n    path: \"Full/popular-*\"\n- config_name: default\n  default: true\n  data_files:\n  - split: test\n    path:\n    - data/a.parquet\n    - 'data/b: c.parquet'\n- config_name: one\n  data_files: one/*.csv\n- config_name: two\n  data_files: [\"x.csv\", y.csv]\ndataset_info:\n- config_name: none\n---\n# text\n- config_name: no\n";
        let expected = [
            config("Full", false, vec![file("adversarial", "Full/adversarial-*"), file("popular", "Full/popular-*")]),
            config("default", true, vec![file("test", "data/a.parquet"), file("test", "data/b: c.parquet")]),
            config("one", false, vec![file("", "one/*.csv")]),
            config("two", false, vec![file("", "x.csv"), file("", "y.csv")]),
        ];
        assert_eq!(parse_configs(card).unwrap(), expected);
        assert_eq!(parse_configs(&card.replace('\n', "\r\n")).unwrap(), expected);
        for none in ["", "# text", "---\nlicense: mit\n---\n", "---\nconfigs:\n"] {
            assert_eq!(parse_configs(none).unwrap(), [], "{none:?}");
        }
    }

    fn first_config(config: &str) -> Result<Config, String> {
        let card = format!("---\nlicense: mit\nconfigs:\n{config}tags:\n- x\n---\n");
        parse_configs(&card).map(|mut configs| configs.remove(0))
    }

    #[test]
    fn splits_may_be_field_names() {
        let found = first_config("  - config_name: a\n    data_files:\n      test: data/test-*\n      train:\n      - x.csv\n      - y.csv\n").unwrap();
        let files = vec![file("test", "data/test-*"), file("train", "x.csv"), file("train", "y.csv")];
        assert_eq!(found.files, Some(files));
        let found = first_config("- data_files: {test: \"data/*.csv\"}\n  data_dir: inner\n").unwrap();
        assert_eq!((found.name.as_str(), found.folder.as_str()), ("default", "inner"));
        assert_eq!(found.files, Some(vec![file("test", "data/*.csv")]));
        let found = first_config("- config_name: a\n  data_dir: inner\n").unwrap();
        assert_eq!(found.files, None);
        for wrong in [
            "- config_name: a\n  data_files:\n  - split: test\n",
            "- config_name: a\n  data_files: [{x: y}]\n",
            "- config_name: a\n  data_files: &x y\n",
            "- a\n",
            "  a: b\n",
        ] {
            assert!(first_config(wrong).is_err(), "{wrong}");
        }
    }

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
