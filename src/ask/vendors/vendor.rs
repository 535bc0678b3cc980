//! Vendors that host models, and the limits of their endpoints: [`Vendor`]. The built-in table is `vendors.toml`.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

use super::vendor_batch::VendorBatch;
use crate::ask::endpoints::BaseUrl;
use crate::ask::requests::TokenField;
use crate::ask::secrets::KeyHeader;
use crate::error::Error;

/// A vendor that hosts models, and the properties of its endpoints. `None` means unknown, unless a field states
/// otherwise.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Vendor {
    /// Name of the vendor, for messages.
    pub(crate) name: String,
    /// Host name suffixes of its endpoints, such as `api.example.com` or `.example.com`.
    hosts: Vec<String>,
    /// Environment variables in which the vendor's own tools look for a key, in this order.
    pub(crate) key: Vec<String>,
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
    pub(crate) thinks_beyond_limit: bool,
    /// Maximum size of an image file, in bytes.
    pub(crate) image_bytes: Option<usize>,
    /// Maximum side of an image, in pixels.
    pub(crate) image_side: Option<u32>,
    /// Maximum number of images in a request.
    pub(crate) images: Option<usize>,
    /// Maximum side of an image, in pixels, if a request has more than 20 images.
    pub(crate) image_side_many: Option<u32>,
    /// Maximum size of a request body, in bytes.
    pub(crate) request_bytes: Option<usize>,
    /// Why replies lack token probabilities; `None` if some models return them, or if that is unknown.
    logprobs: Option<Logprobs>,
    /// Batch API; `None` if unknown.
    pub(crate) batch: Option<VendorBatch>,
    /// Failure to constrain replies; `None` if the vendor obeys a constraint, or if that is unknown.
    constrain: Option<Constraining>,
    /// Field of the request body without which requests are not repeatable.
    pub(crate) pin: Option<String>,
    /// Headers that name the account and are not secret, each with the environment variable that holds its value.
    #[serde(default)]
    pub(crate) account: BTreeMap<String, String>,
    /// Valid forms of a base URL; empty if a base URL without a path is valid.
    #[serde(default)]
    pub(super) addresses: Vec<String>,
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
    toml::from_str(include_str!("../vendors.toml")).unwrap_or_else(|e| unreachable!("a test reads vendors.toml: {e}"))
});

impl Vendor {
    /// Finds the vendor of a host; `None` if the built-in table lacks the host.
    pub(crate) fn at_host(host: &str) -> Option<&'static Self> {
        VENDORS.vendor.iter().find(|vendor| vendor.owns_host(host))
    }

    /// Finds the vendor in the built-in table that uses keys of this form; `None` if several vendors do, or if that is
    /// unknown.
    pub(super) fn by_key(key: &str) -> Option<&'static Self> {
        VENDORS.vendor.iter().find(|vendor| vendor.has_key(key))
    }

    /// True if a key has a form that only this vendor uses.
    pub(super) fn has_key(&self, key: &str) -> bool {
        self.key_form.iter().any(|pattern| matches_key_pattern(key, pattern))
    }

    /// True if the built-in table lists exactly this host name. A name below a listed domain may belong to any
    /// customer.
    pub(crate) fn has_host(host: &str) -> bool {
        VENDORS.vendor.iter().flat_map(|vendor| &vendor.hosts).any(|known| known == host)
    }

    /// True if the host belongs to this vendor.
    pub(crate) fn owns_host(&self, host: &str) -> bool {
        self.hosts.iter().any(|suffix| matches_host_suffix(host, suffix))
    }

    /// Checks that `hosts` is a non-empty list of host name suffixes, which the types do not ensure.
    ///
    /// # Errors
    /// The message names the field.
    pub(super) fn check(&self) -> Result<(), String> {
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
    pub(crate) fn check_address(&self, base: &BaseUrl) -> Result<(), Error> {
        if self.addresses.is_empty() || base.has_path() {
            return Ok(());
        }
        let forms = self.addresses.join(", or ");
        let problem = format_args!("{base}: an address of {} needs a path: {forms}", self.name);
        Err(Error::usage("--base-url", problem))
    }

    /// True if constraints on replies have no effect at this vendor.
    pub(crate) fn ignores_constraints(&self) -> bool {
        self.constrain == Some(Constraining::Ignored)
    }

    /// Why the vendor returns no token probabilities, as a verb phrase for messages; `None` if it may return them.
    pub(crate) fn without_probabilities(&self) -> Option<&'static str> {
        self.logprobs.map(|logprobs| match logprobs {
            Logprobs::Ignored => "takes the request for probabilities and ignores it",
            Logprobs::No => "states no probabilities of tokens",
        })
    }

    /// Header in which the vendor expects the key.
    pub(crate) fn key_header(&self) -> KeyHeader {
        match self.header {
            Header::Bearer => KeyHeader::Bearer,
            Header::ApiKey => KeyHeader::ApiKey,
        }
    }

    /// Resolves `Auto` to the field that the vendor expects, or to `MaxTokens` without a vendor. Never returns `Auto`.
    pub(crate) fn token_field_at(vendor: Option<&Self>, field: TokenField) -> TokenField {
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
            assert!(vendor.key.iter().all(|name| !crate::ask::secrets::looks_like_key(name)), "{}", vendor.name);
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
}
