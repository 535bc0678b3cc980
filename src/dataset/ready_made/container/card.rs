//! The configurations that the card of a repository names: [`configs`].
//!
//! A card is a `README.md` with YAML at its head. Of that YAML only `configs` is read, in the form in which hubs write it (Hugging Face,
//! "Manual Configuration"): a list of mappings with `config_name`, `default`, `data_dir` and `data_files`. The last is a pattern, a list
//! of patterns, a list of `split` and `path`, or a mapping of splits to patterns.

use super::yaml::{Yaml, value};

/// One configuration of a repository.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Config {
    pub(super) name: String,
    pub(super) is_default: bool,
    /// The folder that the patterns start from; empty for that of the card.
    pub(super) folder: String,
    /// The files: split (empty if none is named) and pattern. None for all files of the folder.
    pub(super) files: Option<Vec<(String, String)>>,
}

/// The configurations in a card; empty if it names none.
///
/// # Errors
/// If it names some in a way that is not read.
pub(super) fn configs(card: &str) -> Result<Vec<Config>, String> {
    let card = card.trim_start_matches('\u{feff}').replace("\r\n", "\n");
    let head = card
        .strip_prefix("---\n")
        .and_then(|rest| rest.split_once("\n---"));
    let mut lines = head
        .map_or("", |(head, _)| head)
        .lines()
        .skip_while(|line| key(line) != Some("configs"));
    let Some(first) = lines.next() else {
        return Ok(Vec::new());
    };
    let inside = lines.take_while(|line| key(line).is_none());
    let text: Vec<&str> = std::iter::once(first).chain(inside).collect();
    let configs = value(&text.join("\n"))?;
    match configs.field("configs") {
        None | Some(Yaml::Nothing) => Ok(Vec::new()),
        Some(Yaml::List(configs)) => configs.iter().map(config).collect(),
        Some(_) => Err("configs is not a list".to_owned()),
    }
}

/// The name of the field at the left edge that a line begins.
fn key(line: &str) -> Option<&str> {
    let is_edge = !line.starts_with([' ', '\t', '-', '#']);
    let (name, _) = line.split_once(':').filter(|_| is_edge)?;
    Some(name.trim_end())
}

fn config(config: &Yaml) -> Result<Config, String> {
    if !matches!(config, Yaml::Fields(_)) {
        return Err("configs holds something other than mappings".to_owned());
    }
    let text = |name: &str| match config.field(name) {
        None | Some(Yaml::Nothing) => Ok(String::new()),
        Some(Yaml::Text(text)) => Ok(text.clone()),
        Some(_) => Err(format!("{name} is not a text")),
    };
    let name = match text("config_name")? {
        name if name.is_empty() => "default".to_owned(),
        name => name,
    };
    let of_config = |problem: String| format!("configuration {name:?}: {problem}");
    Ok(Config {
        is_default: text("default")
            .map_err(of_config)?
            .eq_ignore_ascii_case("true"),
        folder: text("data_dir").map_err(of_config)?,
        files: match config.field("data_files") {
            None | Some(Yaml::Nothing) => None,
            Some(files) => Some(data_files(files).map_err(of_config)?),
        },
        name,
    })
}

/// The splits and patterns of `data_files`.
fn data_files(files: &Yaml) -> Result<Vec<(String, String)>, String> {
    let of_split = |split: &str, files: &Yaml| -> Result<Vec<(String, String)>, String> {
        let patterns = patterns(files)?.into_iter();
        Ok(patterns
            .map(|pattern| (split.to_owned(), pattern))
            .collect())
    };
    match files {
        Yaml::Fields(splits) => {
            let splits = splits.iter().map(|(split, files)| of_split(split, files));
            Ok(splits.collect::<Result<Vec<_>, _>>()?.concat())
        }
        Yaml::List(entries) => {
            let entries = entries.iter().map(|entry| match entry {
                Yaml::Fields(_) => {
                    let Some(path) = entry.field("path") else {
                        return Err("an entry of data_files has no path".to_owned());
                    };
                    match entry.field("split") {
                        Some(Yaml::Text(split)) => of_split(split, path),
                        None => of_split("", path),
                        Some(_) => Err("a split of data_files is not a text".to_owned()),
                    }
                }
                entry => of_split("", entry),
            });
            Ok(entries.collect::<Result<Vec<_>, _>>()?.concat())
        }
        files => of_split("", files),
    }
}

/// One pattern, or a list of them.
fn patterns(files: &Yaml) -> Result<Vec<String>, String> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forms_of_cards_are_read() {
        let card = "---\nlicense: mit\nconfigs:\n- config_name: Full\n  data_files:\n  - split: adversarial\n    path: Full/adversarial-*\n  - split: popular\n    path: \"Full/popular-*\"\n- config_name: default\n  default: true\n  data_files:\n  - split: test\n    path:\n    - data/a.parquet\n    - 'data/b: c.parquet'\n- config_name: one\n  data_files: one/*.csv\n- config_name: two\n  data_files: [\"x.csv\", y.csv]\ndataset_info:\n- config_name: none\n---\n# text\n- config_name: no\n";
        let file = |split: &str, pattern: &str| (split.to_owned(), pattern.to_owned());
        let config = |name: &str, is_default, files: Vec<(String, String)>| Config {
            name: name.to_owned(),
            is_default,
            folder: String::new(),
            files: Some(files),
        };
        let expected = [
            config(
                "Full",
                false,
                vec![
                    file("adversarial", "Full/adversarial-*"),
                    file("popular", "Full/popular-*"),
                ],
            ),
            config(
                "default",
                true,
                vec![
                    file("test", "data/a.parquet"),
                    file("test", "data/b: c.parquet"),
                ],
            ),
            config("one", false, vec![file("", "one/*.csv")]),
            config("two", false, vec![file("", "x.csv"), file("", "y.csv")]),
        ];
        assert_eq!(configs(card).unwrap(), expected);
        assert_eq!(configs(&card.replace('\n', "\r\n")).unwrap(), expected);
        for none in ["", "# text", "---\nlicense: mit\n---\n", "---\nconfigs:\n"] {
            assert_eq!(configs(none).unwrap(), [], "{none:?}");
        }
    }

    #[test]
    fn splits_may_be_names_of_fields_and_a_folder_may_hold_the_files() {
        let of = |config: &str| {
            let card = format!("---\nlicense: mit\nconfigs:\n{config}tags:\n- x\n---\n");
            configs(&card).map(|mut configs| configs.remove(0))
        };
        let file = |split: &str, pattern: &str| (split.to_owned(), pattern.to_owned());
        let found = of("  - config_name: a\n    data_files:\n      test: data/test-*\n      train:\n      - x.csv\n      - y.csv\n").unwrap();
        let files = vec![
            file("test", "data/test-*"),
            file("train", "x.csv"),
            file("train", "y.csv"),
        ];
        assert_eq!(found.files, Some(files));
        let found = of("- data_files: {test: \"data/*.csv\"}\n  data_dir: inner\n").unwrap();
        assert_eq!(
            (found.name.as_str(), found.folder.as_str()),
            ("default", "inner")
        );
        assert_eq!(found.files, Some(vec![file("test", "data/*.csv")]));
        let found = of("- config_name: a\n  data_dir: inner\n").unwrap();
        assert_eq!(found.files, None);
        for wrong in [
            "- config_name: a\n  data_files:\n  - split: test\n",
            "- config_name: a\n  data_files: [{x: y}]\n",
            "- config_name: a\n  data_files: &x y\n",
            "- a\n",
            "  a: b\n",
        ] {
            assert!(of(wrong).is_err(), "{wrong}");
        }
    }
}
