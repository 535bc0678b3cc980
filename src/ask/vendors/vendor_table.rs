//! Vendors from the user's file, in the form of `vendors.toml`: [`VendorTable`].

use std::path::Path;

use serde::Deserialize;

use super::vendor::Vendor;
use crate::ask::secrets::looks_like_key;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::text::TomlFault;

/// Vendors of a file, with priority over the built-in table; empty by default.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct VendorTable(&'static [Vendor]);

/// Content of a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Rows {
    /// Date of the table.
    #[expect(dead_code, reason = "for readers of the table")]
    as_of: Option<String>,
    vendor: Vec<Vendor>,
}

impl VendorTable {
    /// Reads a file. Its vendors live as long as the program, like those of the built-in table.
    ///
    /// # Errors
    /// If the file cannot be read or parsed, has no vendor, or has a key in place of a variable name; the error does
    /// not show the key.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = reading::settings(path)?;
        let Rows { vendor: rows, .. } = toml::from_str(&text).map_err(|e: toml::de::Error| {
            let TomlFault { line, problem } = TomlFault::new(&text, &e);
            invalid_file(path, &format!("line {line}: {problem}"))
        })?;
        if rows.is_empty() {
            return Err(invalid_file(path, "there is no [[vendor]] in it"));
        }
        for vendor in &rows {
            vendor.check().map_err(|problem| invalid_file(path, &format!("{}: {problem}", vendor.name)))?;
            if vendor.batch.is_some() {
                let problem = "batch: what a Batch API takes is not read from a file; set it with --file-size, --file-requests, --url and \
                               --purpose";
                return Err(invalid_file(path, &format!("{}: {problem}", vendor.name)));
            }
            if vendor.key.iter().any(|name| looks_like_key(name)) {
                let problem =
                    "the value of key looks like a key, which is not shown here: name the variable that holds it";
                return Err(invalid_file(path, &format!("{}: {problem}", vendor.name)));
            }
        }
        Ok(Self(Box::leak(rows.into_boxed_slice())))
    }

    /// Finds the vendor of a host in the file or else in the built-in table.
    pub(crate) fn at_host(self, host: &str) -> Option<&'static Vendor> {
        self.0.iter().find(|vendor| vendor.owns_host(host)).or_else(|| Vendor::at_host(host))
    }

    /// Finds the vendor whose keys have the form of this one, in the file or else in the built-in table.
    pub(crate) fn by_key(self, key: &str) -> Option<&'static Vendor> {
        self.0.iter().find(|vendor| vendor.has_key(key)).or_else(|| Vendor::by_key(key))
    }
}

fn invalid_file(path: &Path, problem: &str) -> Error {
    let expected = "expected tables [[vendor]] with name, hosts and key, as in src/ask/vendors.toml";
    let problem = format!("{}: {problem}; {expected}", path.display());
    Error::usage("--vendor", problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<VendorTable> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        VendorTable::read(file.path())
    }

    fn name_at(table: VendorTable, host: &str) -> Option<&'static str> {
        table.at_host(host).map(|vendor| &*vendor.name)
    }

    #[test]
    fn user_rows_have_priority() {
        let table = read(
            "[[vendor]]\nname = \"Mine\"\nhosts = [\"llm.example\", \"api.openai.com\"]\nkey = [\"MY_KEY\"]\nheader = \"api-key\"\n",
        );
        let table = table.unwrap();
        assert_eq!(name_at(table, "eu.llm.example"), Some("Mine"));
        assert_eq!(name_at(table, "api.openai.com"), Some("Mine"));
        assert_eq!(name_at(table, "api.mistral.ai"), Some("Mistral"));
        assert_eq!(name_at(table, "notllm.example"), None);
        assert_eq!(VendorTable::default().at_host("api.openai.com").unwrap().name, "OpenAI");
    }

    #[test]
    fn invalid_tables_are_errors() {
        let row = "[[vendor]]\nname = \"Mine\"\n";
        for (text, part) in [
            ("", "line 1: missing field `vendor`"),
            ("vendor = []", "there is no [[vendor]]"),
            ("[[vendor]]\nname = 3", "line 2: "),
            (&format!("{row}hosts = [\"a.b\"]\nkey = []\ncolour = 1"), "line 5: unknown field `colour`"),
            (&format!("{row}hosts = []\nkey = []"), "Mine: hosts: "),
            (&format!("{row}hosts = [\"https://a.b/v1\"]\nkey = []"), "Mine: hosts: "),
            (&format!("{row}hosts = [\"a.b\"]\nkey = []\nbatch = {{ requests = 9 }}"), "Mine: batch: "),
            (&format!("{row}hosts = [\"a.b\"]\nkey = [\"sk-0123456789\"]"), "looks like a key"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains("--vendor: ") && error.contains(part), "{text}: {error}");
            assert!(!error.contains("0123"), "{error}");
        }
        assert!(VendorTable::read(Path::new("/nowhere/at/all")).is_err());
    }
}
