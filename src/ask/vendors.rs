//! Vendors that host models ([`Vendor`]), with the limits of their endpoints and their Batch API ([`VendorBatch`]): the
//! built-in table, `vendors.toml`, and the user's file of the same form ([`VendorTable`]).

use std::collections::BTreeMap;
use std::num::{NonZeroU64, NonZeroUsize};
use std::path::Path;
use std::sync::LazyLock;

use serde::Deserialize;

use super::endpoints::BaseUrl;
use super::requests::TokenField;
use super::secrets::{KeyHeader, looks_like_key};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::text::TomlFault;

/// A vendor that hosts models, and the properties of its endpoints. `None` means unknown, unless a field states
/// otherwise.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Vendor {
    /// Name of the vendor, for messages.
    pub name: String,
    /// Host name suffixes of its endpoints, such as `api.example.com` or `.example.com`.
    hosts: Vec<String>,
    /// Environment variables in which the vendor's own tools look for a key, in this order.
    pub key: Vec<String>,
    /// Patterns of keys that only this vendor uses, with `*` for any text; empty if there are none.
    #[serde(default)]
    key_form: Vec<String>,
    /// Header that carries the key.
    #[serde(default)]
    header: Header,
    /// Request field that carries the token limit.
    #[serde(default)]
    token_field: LimitField,
    /// True if reasoning tokens do not count toward the token limit.
    #[serde(default)]
    pub thinks_beyond_limit: bool,
    /// Maximum size of an image file, in bytes.
    pub image_bytes: Option<usize>,
    /// Maximum side of an image, in pixels.
    pub image_side: Option<u32>,
    /// Maximum number of images in a request.
    pub images: Option<usize>,
    /// Maximum side of an image, in pixels, if a request has more than 20 images.
    pub image_side_many: Option<u32>,
    /// Maximum size of a request body, in bytes.
    pub request_bytes: Option<usize>,
    /// Why replies lack token probabilities; `None` if some models return them, or if that is unknown.
    logprobs: Option<Logprobs>,
    /// Batch API; `None` if unknown.
    pub batch: Option<VendorBatch>,
    /// Failure to constrain replies; `None` if the vendor obeys a constraint, or if that is unknown.
    constrain: Option<Constraining>,
    /// Field of the request body without which requests are not repeatable.
    pub pin: Option<String>,
    /// Headers that name the account and are not secret, each with the environment variable that holds its value.
    #[serde(default)]
    pub account: BTreeMap<String, String>,
    /// Valid forms of a base URL; empty if a base URL without a path is valid.
    #[serde(default)]
    addresses: Vec<String>,
}

/// A [`KeyHeader`] other than `Auto`, as written in the table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Header {
    #[default]
    Bearer,
    ApiKey,
}

/// Handling of a constraint on replies by a vendor that does not obey it.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Constraining {
    /// The constraint is accepted and has no effect.
    Ignored,
}

/// Handling of a request for token probabilities by a vendor that never returns them.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Logprobs {
    /// The request is accepted and has no effect.
    Ignored,
    /// Token probabilities cannot be requested.
    No,
}

/// A [`TokenField`] that a vendor may expect, as written in the table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
enum LimitField {
    #[default]
    MaxTokens,
    MaxCompletionTokens,
}

/// The built-in table of vendors, with its date.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Vendors {
    #[cfg_attr(not(test), expect(dead_code, reason = "read by a test and by people"))]
    as_of: String,
    vendor: Vec<Vendor>,
}

static VENDORS: LazyLock<Vendors> = LazyLock::new(|| {
    toml::from_str(include_str!("vendors.toml")).unwrap_or_else(|e| unreachable!("a test reads vendors.toml: {e}"))
});

impl Vendor {
    /// Finds the vendor of a host; `None` if the built-in table lacks the host.
    pub fn at_host(host: &str) -> Option<&'static Self> {
        VENDORS.vendor.iter().find(|vendor| vendor.owns_host(host))
    }

    /// Finds the vendor in the built-in table that uses keys of this form; `None` if several vendors do, or if that is
    /// unknown.
    fn by_key(key: &str) -> Option<&'static Self> {
        VENDORS.vendor.iter().find(|vendor| vendor.has_key(key))
    }

    /// True if a key has a form that only this vendor uses.
    fn has_key(&self, key: &str) -> bool {
        self.key_form.iter().any(|pattern| matches_key_pattern(key, pattern))
    }

    /// True if the built-in table lists exactly this host name. A name below a listed domain may belong to any
    /// customer.
    pub fn has_host(host: &str) -> bool {
        VENDORS.vendor.iter().flat_map(|vendor| &vendor.hosts).any(|known| known == host)
    }

    /// True if the host belongs to this vendor.
    pub fn owns_host(&self, host: &str) -> bool {
        self.hosts.iter().any(|suffix| matches_host_suffix(host, suffix))
    }

    /// Checks that `hosts` is a non-empty list of host name suffixes, which the types do not ensure.
    ///
    /// # Errors
    /// The message names the field.
    fn check(&self) -> Result<(), String> {
        if self.hosts.is_empty() || !self.hosts.iter().all(|text| is_host_suffix(text)) {
            return Err(
                "hosts: ends of host names expected, such as \"api.example.com\" or \".example.com\"".to_owned()
            );
        }
        Ok(())
    }

    /// Checks that a base URL has a path if this vendor requires one.
    ///
    /// # Errors
    /// The message lists the valid forms.
    pub fn check_address(&self, base: &BaseUrl) -> Result<(), Error> {
        if self.addresses.is_empty() || base.has_path() {
            return Ok(());
        }
        let forms = self.addresses.join(", or ");
        let problem = format_args!("{base}: an address of {} needs a path: {forms}", self.name);
        Err(Error::usage("--base-url", problem))
    }

    /// True if constraints on replies have no effect at this vendor.
    pub fn ignores_constraints(&self) -> bool {
        self.constrain == Some(Constraining::Ignored)
    }

    /// Why the vendor returns no token probabilities, as a verb phrase for messages; `None` if it may return them.
    pub fn without_probabilities(&self) -> Option<&'static str> {
        self.logprobs.map(|logprobs| match logprobs {
            Logprobs::Ignored => "takes the request for probabilities and ignores it",
            Logprobs::No => "states no probabilities of tokens",
        })
    }

    /// Header in which the vendor expects the key.
    pub fn key_header(&self) -> KeyHeader {
        match self.header {
            Header::Bearer => KeyHeader::Bearer,
            Header::ApiKey => KeyHeader::ApiKey,
        }
    }

    /// Resolves `Auto` to the field that the vendor expects, or to `MaxTokens` without a vendor. Never returns `Auto`.
    pub fn token_field_at(vendor: Option<&Self>, field: TokenField) -> TokenField {
        match field {
            TokenField::Auto => vendor.map_or(TokenField::MaxTokens, Self::token_field),
            field => field,
        }
    }

    /// Request field in which the vendor expects the token limit.
    fn token_field(&self) -> TokenField {
        match self.token_field {
            LimitField::MaxTokens => TokenField::MaxTokens,
            LimitField::MaxCompletionTokens => TokenField::MaxCompletionTokens,
        }
    }
}

/// True if a key starts with a pattern, in which `*` matches any text between two parts.
fn matches_key_pattern(key: &str, pattern: &str) -> bool {
    let (prefix, infix) = pattern.split_once('*').unwrap_or((pattern, ""));
    key.strip_prefix(prefix).is_some_and(|rest| rest.contains(infix))
}

/// True for a non-empty text of ASCII letters, digits, dots and hyphens.
fn is_host_suffix(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '-'))
}

/// True if a host is the suffix itself or a subdomain of it. `notapi.example.com` does not match `api.example.com`.
fn matches_host_suffix(host: &str, suffix: &str) -> bool {
    match host.strip_suffix(suffix) {
        Some(rest) => rest.is_empty() || rest.ends_with('.') || suffix.starts_with('.'),
        None => false,
    }
}

/// Vendors of a file, with priority over the built-in table; empty by default.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct VendorTable(&'static [Vendor]);

/// Content of a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct VendorFile {
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
        let text = files::settings(path)?;
        let VendorFile { vendor: rows, .. } = toml::from_str(&text).map_err(|e: toml::de::Error| {
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

/// Batch API of a vendor; `None` in a field means the value of OpenAI.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct VendorBatch {
    #[serde(default)]
    pub form: BatchForm,
    /// Purpose under which files are uploaded.
    pub purpose: Option<String>,
    /// Maximum size of a file, in MB.
    pub file_size: Option<NonZeroU64>,
    /// Maximum number of requests in a file.
    pub requests: Option<NonZeroUsize>,
    /// Path of chat completions in the lines of a file.
    pub url: Option<String>,
}

/// Form of a Batch API.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BatchForm {
    /// Batches of uploaded files, as at OpenAI.
    #[default]
    Files,
    /// Another form.
    Other,
    /// The vendor has no Batch API.
    None,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vendor_at(host: &str) -> Option<&'static str> {
        Vendor::at_host(host).map(|vendor| &*vendor.name)
    }

    #[test]
    fn the_table_is_complete() {
        assert!(VENDORS.as_of.starts_with("20"));
        assert!(VENDORS.vendor.len() > 10);
        let mut hosts = Vec::new();
        for vendor in &VENDORS.vendor {
            assert!(!vendor.key.is_empty(), "{}", vendor.name);
            assert_eq!(vendor.check(), Ok(()), "{}", vendor.name);
            hosts.extend(&vendor.hosts);
            assert!(vendor.key.iter().all(|name| !crate::secrets::looks_like_key(name)), "{}", vendor.name);
        }
        let count = hosts.len();
        hosts.sort();
        hosts.dedup();
        assert_eq!(hosts.len(), count, "a host is listed twice");
    }

    fn vendor_name(key: &str) -> Option<&'static str> {
        Vendor::by_key(key).map(|vendor| &*vendor.name)
    }

    #[test]
    fn keys_identify_their_vendor() {
        assert_eq!(vendor_name("sk-ant-api03-x"), Some("Anthropic"));
        assert_eq!(vendor_name("sk-proj-x"), Some("OpenAI"));
        assert_eq!(vendor_name("sk-abcT3BlbkFJdef"), Some("OpenAI"));
        assert_eq!(vendor_name("sk-or-v1-x"), Some("OpenRouter"));
        for unknown in ["sk-1234", "", "x-sk-ant-", "T3BlbkFJ"] {
            assert_eq!(vendor_name(unknown), None, "{unknown}");
        }
    }

    fn token_field_at(host: &str, field: TokenField) -> TokenField {
        Vendor::token_field_at(Vendor::at_host(host), field)
    }

    #[test]
    fn the_token_field_depends_on_the_host() {
        let auto = TokenField::Auto;
        assert_eq!(token_field_at("api.openai.com", auto), TokenField::MaxCompletionTokens);
        assert_eq!(token_field_at("localhost", auto), TokenField::MaxTokens);
        assert_eq!(token_field_at("api.mistral.ai", auto), TokenField::MaxTokens);
        assert_eq!(token_field_at("api.openai.com", TokenField::Omit), TokenField::Omit);
    }

    fn check_base(text: &str) -> Option<Result<(), Error>> {
        let base: BaseUrl = text.parse().unwrap();
        Vendor::at_host(base.host()).map(|vendor| vendor.check_address(&base))
    }

    #[test]
    fn some_vendors_require_a_path() {
        let bare = "https://r.openai.azure.com/?api-version=2024-10-21";
        let error = check_base(bare).unwrap().unwrap_err().to_string();
        assert!(error.contains("Azure needs a path: https://RESOURCE"), "{error}");
        for base in ["https://r.openai.azure.com/openai/v1", "https://api.openai.com"] {
            assert!(check_base(base).unwrap().is_ok(), "{base}");
        }
    }

    #[test]
    fn hosts_match_by_suffix() {
        assert_eq!(vendor_at("api.openai.com"), Some("OpenAI"));
        assert_eq!(vendor_at("eu.api.openai.com"), Some("OpenAI"));
        assert_eq!(vendor_at("r.openai.azure.com"), Some("Azure"));
        assert_eq!(vendor_at("dashscope-intl.aliyuncs.com"), Some("DashScope"));
        for other in
            ["127.0.0.1", "notapi.openai.com", "evil-openrouter.ai", "openrouter.ai.example", "openai.azure.com", ""]
        {
            assert_eq!(vendor_at(other), None, "{other}");
        }
    }

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
