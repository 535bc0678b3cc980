//! The tables of a models file, with the line of each key: [`ModelsFile`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use darkqa_ask::{is_secret_header, is_secret_value, looks_like_key};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::text::{TomlFault, line_at};

/// The tables of a models file. Keys and values are not validated yet.
#[derive(Debug)]
pub(super) struct ModelsFile {
    pub(super) path: PathBuf,
    pub(super) defaults: Keys,
    /// The tables `[[model]]`, in the order of the file.
    pub(super) models: Vec<Keys>,
}

/// The values of one table with their places, by key. Keys are spelled with hyphens.
pub(super) type Keys = BTreeMap<String, Located>;

/// A value with its place, for errors.
#[derive(Debug, Clone)]
pub(super) struct Located {
    pub(super) value: Value,
    /// The file and line, or the flag.
    pub(super) place: String,
}

impl Located {
    /// An error about the value; the message states the key.
    pub(super) fn error(&self, problem: impl std::fmt::Display) -> Error {
        Error::usage(self.place.clone(), problem)
    }
}

impl ModelsFile {
    /// Reads a models file.
    ///
    /// # Errors
    /// If it cannot be read, is not TOML, has other tables than `[defaults]` and `[[model]]`, or contains a secret. The
    /// error names the line, and does not show the secret.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = files::settings(path)?;
        let at = |start: usize| in_line(path, line_at(&text, start));
        let values: Table = toml::from_str(&text).map_err(|e| invalid_toml(path, &text, &e))?;
        let spans = DeTable::parse(&text).map_err(|e| invalid_toml(path, &text, &e))?;
        let mut file = Self { path: path.to_owned(), defaults: Keys::new(), models: Vec::new() };
        for (key, value) in spans.get_ref() {
            let name = &**key.get_ref();
            let place = at(key.span().start);
            match (name, value.get_ref(), values.get(name)) {
                ("defaults", DeValue::Table(keys), Some(Value::Table(values))) => {
                    file.defaults = locate_keys(keys, values, &at)?;
                }
                ("model", DeValue::Array(tables), Some(Value::Array(all))) => {
                    for (keys, values) in tables.iter().zip(all) {
                        let (DeValue::Table(keys), Value::Table(values)) = (keys.get_ref(), values) else {
                            return Err(Error::usage(place, "tables [[model]] expected"));
                        };
                        file.models.push(locate_keys(keys, values, &at)?);
                    }
                }
                _ => {
                    let problem = format_args!("{name}: only [defaults] and [[model]] are known here");
                    return Err(Error::usage(place, problem));
                }
            }
        }
        if file.models.is_empty() {
            let problem = "there is no [[model]] in it";
            return Err(Error::usage(path.display().to_string(), problem));
        }
        Ok(file)
    }
}

fn in_line(path: &Path, line: usize) -> String {
    format!("{}, line {line}", path.display())
}

fn invalid_toml(path: &Path, text: &str, e: &toml::de::Error) -> Error {
    let TomlFault { line, problem } = TomlFault::new(text, e);
    Error::usage(in_line(path, line), format_args!("not valid TOML: {problem}"))
}

/// Adds the lines to the keys and values of a table. Refuses secrets, and keys that are set twice.
fn locate_keys(keys: &DeTable<'_>, values: &Table, at: &impl Fn(usize) -> String) -> Result<Keys> {
    let mut found = Keys::new();
    for (key, spanned) in keys {
        let name = &**key.get_ref();
        let Some(value) = values.get(name) else {
            continue;
        };
        refuse_secrets(name, spanned, name == "headers", at)?;
        let located = Located { value: value.clone(), place: at(key.span().start) };
        let name = name.replace('_', "-");
        if found.insert(name.clone(), located).is_some() {
            let problem = format_args!("{name} is set twice");
            return Err(Error::usage(at(key.span().start), problem));
        }
    }
    Ok(found)
}

/// Refuses a value that looks like an API key or another secret. `in_headers` is true if the keys are names of headers.
fn refuse_secrets(
    key: &str,
    value: &Spanned<DeValue<'_>>,
    in_headers: bool,
    at: &impl Fn(usize) -> String,
) -> Result<()> {
    match value.get_ref() {
        DeValue::String(text) => {
            let is_key_as_variable = matches!(key, "key-env" | "key_env" | "env") && looks_like_key(text);
            if is_secret_value(text) || is_key_as_variable || in_headers && is_secret_header(key, text) {
                let problem = format_args!(
                    "{key} looks like a secret, which is not shown here and must not be in a file of models: name a variable \
                     that holds it (key-env = \"NAME\", or {{ env = \"NAME\" }} for a header)"
                );
                return Err(Error::usage(at(value.span().start), problem));
            }
            Ok(())
        }
        DeValue::Array(items) => items.iter().try_for_each(|item| refuse_secrets(key, item, in_headers, at)),
        DeValue::Table(table) => {
            table.iter().try_for_each(|(key, item)| refuse_secrets(key.get_ref(), item, in_headers, at))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ModelsFile> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        ModelsFile::read(file.path())
    }

    #[test]
    fn tables_are_read_with_their_lines() {
        let file =
            read("[defaults]\nmax_tokens = 64\n\n[[model]]\nid = \"a\"\n[[model]]\nid = \"b\"\nbody = { a = 1 }\n")
                .unwrap();
        assert_eq!(file.defaults["max-tokens"].value, Value::Integer(64));
        assert_eq!(file.models.len(), 2);
        assert!(file.models[1]["id"].place.ends_with(", line 7"));
        for (wrong, part) in [
            ("", "no [[model]]"),
            ("[[model]]\nid = ", "line 2: not valid TOML"),
            ("[[model]]\nid = \"a\"\n[model2]\n", "line 3: model2"),
            ("model = 3", "line 1: model"),
            ("[[model]]\na-b = 1\na_b = 2", "line 3: a-b is set twice"),
        ] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }

    #[test]
    fn secrets_are_refused_by_line_and_not_shown() {
        for secret in [
            "key-env = \"sk-0123456789\"",
            "key-env = \"0123456789abcdef0123456789\"",
            "headers = { X-Team = \"a\", Authorization = \"Bearer 0123456789\" }",
            "headers = { X-Auth-Token = \"0123456789abcdef0123\" }",
            "body = { a = { b = [\"AIza0123456789\"] } }",
        ] {
            let error = read(&format!("[[model]]\n{secret}\n")).unwrap_err().to_string();
            assert!(error.contains("line 2: "), "{error}");
            assert!(error.contains("name a variable") && !error.contains("0123"), "{error}");
        }
        assert!(read("[[model]]\nkey-env = \"GATEWAY_KEY\"\nheaders = { X-Auth = { env = \"TOKEN\" } }\n").is_ok());
    }
}
