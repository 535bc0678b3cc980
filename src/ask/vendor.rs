//! Facts about a host that serves models: [`Vendor`], from `vendors.toml`.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

use super::key_header::KeyHeader;
use super::token_field::TokenField;
use super::url::BaseUrl;
use super::vendor_batch::VendorBatch;
use crate::error::Error;

/// A vendor and the particularities of its endpoints; a field that is `None` is not known.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Vendor {
    /// The vendor's name, for messages.
    pub(crate) name: String,
    /// Ends of the host names of its endpoints.
    hosts: Vec<String>,
    /// The variables in which the vendor's own tools look for a key, in order.
    pub(super) key: Vec<String>,
    /// How the vendor's keys look, if no other vendor's do; else empty.
    #[serde(default)]
    key_form: Vec<String>,
    /// The header that carries the key.
    #[serde(default)]
    header: Header,
    /// The field that carries the token limit.
    #[serde(default)]
    token_field: LimitField,
    /// Whether the tokens of thinking do not count toward the token limit.
    #[serde(default)]
    pub(super) thinks_beyond_limit: bool,
    /// The largest image file, in bytes.
    pub(super) image_bytes: Option<usize>,
    /// The longest side of an image, in pixels.
    pub(super) image_side: Option<u32>,
    /// The most images in a request.
    pub(super) images: Option<usize>,
    /// The longest side of an image, in pixels, in a request with more than 20.
    pub(super) image_side_many: Option<u32>,
    /// The largest body of a request, in bytes.
    pub(super) request_bytes: Option<usize>,
    /// Whether the probabilities of tokens are stated; `None` if they are, by some models, or that is not known.
    logprobs: Option<Logprobs>,
    /// The Batch API; `None` if nothing is known of it.
    pub(super) batch: Option<VendorBatch>,
    /// The vendor's handling of a constraint on replies; `None` if it keeps the constraint, or if that is unknown.
    constrain: Option<Constraining>,
    /// A field of the body without which requests are not repeatable.
    pub(super) pin: Option<String>,
    /// Headers that name the account and are not secret, each with the variable that holds its value.
    #[serde(default)]
    pub(super) account: BTreeMap<String, String>,
    /// Forms of an address, if an address without a path cannot be used; else empty.
    #[serde(default)]
    pub(super) addresses: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Header {
    #[default]
    Bearer,
    ApiKey,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Constraining {
    Ignored,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Logprobs {
    Ignored,
    No,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
enum LimitField {
    #[default]
    MaxTokens,
    MaxCompletionTokens,
}

/// The table of vendors, with its date.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Vendors {
    #[cfg_attr(not(test), expect(dead_code, reason = "read by a test and by people"))]
    as_of: String,
    vendor: Vec<Vendor>,
}

static VENDORS: LazyLock<Vendors> = LazyLock::new(|| {
    toml::from_str(include_str!("vendors.toml"))
        .unwrap_or_else(|e| unreachable!("a test reads vendors.toml: {e}"))
});

impl Vendor {
    /// The vendor of a host; `None` if the host is not in the table.
    pub(crate) fn at_host(host: &str) -> Option<&'static Self> {
        VENDORS.vendor.iter().find(|vendor| vendor.is_of(host))
    }

    /// The vendor of the built-in table whose keys look like this one; `None` if keys of several do, or that is not known.
    pub(super) fn by_key(key: &str) -> Option<&'static Self> {
        VENDORS.vendor.iter().find(|vendor| vendor.has_key(key))
    }

    /// Whether a key looks like this vendor's.
    pub(super) fn has_key(&self, key: &str) -> bool {
        self.key_form.iter().any(|form| has_form(key, form))
    }

    /// Whether a vendor of the built-in table has a host of this very name; a name below a domain may be that of any customer.
    pub(super) fn has_host(host: &str) -> bool {
        VENDORS
            .vendor
            .iter()
            .flat_map(|vendor| &vendor.hosts)
            .any(|known| known == host)
    }

    /// Whether a host is one of the vendor's.
    pub(super) fn is_of(&self, host: &str) -> bool {
        self.hosts.iter().any(|end| is_below(host, end))
    }

    /// Checks what no type can say: that ends of host names are given, and nothing else in their place.
    ///
    /// # Errors
    /// The text names the field.
    pub(super) fn check(&self) -> Result<(), String> {
        let is_end = |end: &String| {
            let mut letters = end.chars();
            !end.is_empty() && letters.all(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '-'))
        };
        if self.hosts.is_empty() || !self.hosts.iter().all(is_end) {
            return Err(
                "hosts: ends of host names expected, such as \"api.example.com\" or \".example.com\""
                    .to_owned(),
            );
        }
        Ok(())
    }

    /// Checks that an address has a path, if the vendor's addresses need one.
    ///
    /// # Errors
    /// The error names the forms of its addresses.
    pub(super) fn check_address(&self, base: &BaseUrl) -> Result<(), Error> {
        if self.addresses.is_empty() || base.has_path() {
            return Ok(());
        }
        let forms = self.addresses.join(", or ");
        let problem = format_args!("{base}: an address of {} needs a path: {forms}", self.name);
        Err(Error::usage("--base-url", problem))
    }

    /// Whether a constraint on replies has no effect.
    pub(super) fn ignores_constraints(&self) -> bool {
        self.constrain == Some(Constraining::Ignored)
    }

    /// The vendor's reaction to a request for probabilities of tokens, in words; `None` if it may state them.
    pub(super) fn without_probabilities(&self) -> Option<&'static str> {
        self.logprobs.map(|logprobs| match logprobs {
            Logprobs::Ignored => "takes the request for probabilities and ignores it",
            Logprobs::No => "states no probabilities of tokens",
        })
    }

    /// The header in which this vendor expects the key.
    pub(super) fn key_header(&self) -> KeyHeader {
        match self.header {
            Header::Bearer => KeyHeader::Bearer,
            Header::ApiKey => KeyHeader::ApiKey,
        }
    }

    /// The field that carries the token limit at a vendor: never `Auto`.
    pub(super) fn token_field_at(vendor: Option<&Self>, field: TokenField) -> TokenField {
        match field {
            TokenField::Auto => vendor.map_or(TokenField::MaxTokens, Self::token_field),
            field => field,
        }
    }

    /// The field in which this vendor expects the token limit.
    fn token_field(&self) -> TokenField {
        match self.token_field {
            LimitField::MaxTokens => TokenField::MaxTokens,
            LimitField::MaxCompletionTokens => TokenField::MaxCompletionTokens,
        }
    }
}

/// Whether a text begins as a form states, in which `*` is for any text between two parts.
fn has_form(text: &str, form: &str) -> bool {
    let (begin, inside) = form.split_once('*').unwrap_or((form, ""));
    let rest = text.strip_prefix(begin);
    rest.is_some_and(|rest| rest.contains(inside))
}

/// Whether a host name is this one or one below it: a name that merely ends with the same letters is another host.
fn is_below(host: &str, end: &str) -> bool {
    match host.strip_suffix(end) {
        Some(rest) => rest.is_empty() || rest.ends_with('.') || end.starts_with('.'),
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(host: &str) -> Option<&'static str> {
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
            let variable = |name: &String| !super::super::key_form::looks_like_key(name);
            assert!(vendor.key.iter().all(variable), "{}", vendor.name);
        }
        let count = hosts.len();
        hosts.sort();
        hosts.dedup();
        assert_eq!(hosts.len(), count, "a host stands twice");
    }

    #[test]
    fn a_key_tells_its_vendor() {
        let of = |key: &str| Vendor::by_key(key).map(|vendor| &*vendor.name);
        assert_eq!(of("sk-ant-api03-x"), Some("Anthropic"));
        assert_eq!(of("sk-proj-x"), Some("OpenAI"));
        assert_eq!(of("sk-abcT3BlbkFJdef"), Some("OpenAI"));
        assert_eq!(of("sk-or-v1-x"), Some("OpenRouter"));
        for of_nobody in ["sk-1234", "", "x-sk-ant-", "T3BlbkFJ"] {
            assert_eq!(of(of_nobody), None, "{of_nobody}");
        }
    }

    #[test]
    fn the_token_field_depends_on_the_host() {
        let at = |host, field| Vendor::token_field_at(Vendor::at_host(host), field);
        let auto = TokenField::Auto;
        assert_eq!(at("api.openai.com", auto), TokenField::MaxCompletionTokens);
        assert_eq!(at("localhost", auto), TokenField::MaxTokens);
        assert_eq!(at("api.mistral.ai", auto), TokenField::MaxTokens);
        assert_eq!(at("api.openai.com", TokenField::Omit), TokenField::Omit);
    }

    #[test]
    fn an_address_needs_the_path_that_its_vendor_has() {
        let check = |text: &str| {
            let base: BaseUrl = text.parse().unwrap();
            Vendor::at_host(base.host()).map(|vendor| vendor.check_address(&base))
        };
        let bare = "https://r.openai.azure.com/?api-version=2024-10-21";
        let error = check(bare).unwrap().unwrap_err().to_string();
        assert!(
            error.contains("Azure needs a path: https://RESOURCE"),
            "{error}"
        );
        for base in [
            "https://r.openai.azure.com/openai/v1",
            "https://api.openai.com",
        ] {
            assert!(check(base).unwrap().is_ok(), "{base}");
        }
    }

    #[test]
    fn a_host_is_known_by_its_end() {
        assert_eq!(name("api.openai.com"), Some("OpenAI"));
        assert_eq!(name("eu.api.openai.com"), Some("OpenAI"));
        assert_eq!(name("r.openai.azure.com"), Some("Azure"));
        assert_eq!(name("dashscope-intl.aliyuncs.com"), Some("DashScope"));
        for other in [
            "127.0.0.1",
            "notapi.openai.com",
            "evil-openrouter.ai",
            "openrouter.ai.example",
            "openai.azure.com",
            "",
        ] {
            assert_eq!(name(other), None, "{other}");
        }
    }
}
