//! The configurations that the card of a repository names: [`configs`].
//!
//! A card is a `README.md` with YAML at its head. Of that YAML only `configs` is read, in the form in which hubs write it (Hugging Face,
//! "Manual Configuration"): a list of mappings with `config_name`, `default` and `data_files`.

/// One configuration of a repository.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Config {
    pub(super) name: String,
    pub(super) is_default: bool,
    /// The files: split (empty if none is named) and pattern.
    pub(super) files: Vec<(String, String)>,
}

/// The configurations in a card; empty if it names none.
pub(super) fn configs(card: &str) -> Vec<Config> {
    let card = card.trim_start_matches('\u{feff}').replace("\r\n", "\n");
    let head = card
        .strip_prefix("---\n")
        .and_then(|rest| rest.split_once("\n---"));
    let lines = head.map_or("", |(head, _)| head).lines();
    let mut configs: Vec<Config> = Vec::new();
    let (mut is_inside, mut split, mut has_patterns) = (false, String::new(), false);
    for line in lines.filter(|line| !line.trim().is_empty() && !line.trim().starts_with('#')) {
        if !line.starts_with([' ', '-']) {
            is_inside = line.trim_end() == "configs:";
            continue;
        }
        if !is_inside {
            continue;
        }
        let entry = line
            .trim()
            .trim_start_matches("- ")
            .trim_start_matches("- ");
        let (key, value) = match entry.split_once(':') {
            Some((key, value)) if !has_quotes(key) => (key.trim(), unquoted(value)),
            // A pattern alone, in a list of patterns.
            _ if has_patterns => ("pattern", unquoted(entry)),
            _ => continue,
        };
        if key == "config_name" {
            configs.push(Config {
                name: value.clone(),
                ..Config::default()
            });
            split.clear();
        }
        let Some(config) = configs.last_mut() else {
            continue;
        };
        let is_empty = value.is_empty();
        match key {
            "default" => config.is_default = value == "true",
            "split" => split = value,
            "data_files" | "path" if is_empty => {}
            "data_files" | "path" | "pattern" => {
                let list = value
                    .strip_prefix('[')
                    .and_then(|list| list.strip_suffix(']'));
                let patterns = list.map_or(vec![value.clone()], |list| {
                    list.split(',').map(unquoted).collect()
                });
                let patterns = patterns.into_iter();
                config
                    .files
                    .extend(patterns.map(|pattern| (split.clone(), pattern)));
            }
            _ => {}
        }
        has_patterns = matches!(key, "data_files" | "path") && is_empty || key == "pattern";
    }
    configs
}

fn has_quotes(text: &str) -> bool {
    text.contains(['"', '\''])
}

/// A value without the quotes and the space around it.
fn unquoted(value: &str) -> String {
    let value = value.trim();
    value.trim_matches(['"', '\'']).to_owned()
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
            files,
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
        assert_eq!(configs(card), expected);
        assert_eq!(configs(&card.replace('\n', "\r\n")), expected);
        for none in ["", "# text", "---\nlicense: mit\n---\n", "---\nconfigs:\n"] {
            assert_eq!(configs(none), [], "{none:?}");
        }
    }
}
