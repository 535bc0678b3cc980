//! The server of a run: its flags ([`AccessArgs`]), and the resolved settings with the key ([`Server`]).
//!
//! Check that a key belongs to the vendor of an address: [`check_owner`].

use std::path::PathBuf;

use clap::Args;

use super::BaseUrl;
use super::access::{Access, Authorities};
use super::load_balancer::Sending;
use super::url::{CustomHeaders, variable};
use crate::secrets::{KeyHeader, Secret, looks_like_key};
use crate::vendors::{Vendor, VendorTable};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;

/// Base URL if neither `--base-url` nor `OPENAI_BASE_URL` is set.
const DEFAULT_BASE_URL: &str = "https://api.openai.com/v1";

/// Variable with the base URL if `--base-url` is not set.
const BASE_URL_VARIABLE: &str = "OPENAI_BASE_URL";

/// Variable with the key of endpoints that are not in the table of vendors.
pub const OPENAI_KEY: &str = "OPENAI_API_KEY";

/// Value of `--api-key-env` for an endpoint without keys.
const NO_KEY: &str = "none";

/// The address of an endpoint, its key and its headers.
///
/// The address and the headers are parsed when they are used: the parser of the command line would print an invalid
/// one, with its password.
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Model")]
pub struct AccessArgs {
    /// Endpoint; /chat/completions is appended; repeatable for replicas of one server; default: OPENAI_BASE_URL, else
    /// OpenAI's
    #[arg(long, value_name = "URL", add = Decides::Reply)]
    pub base_url: Vec<String>,
    /// Environment variable with the API key; none for an endpoint without keys; default: the vendor's
    /// (ANTHROPIC_API_KEY, GEMINI_API_KEY …), else OPENAI_API_KEY, which is never sent to another known vendor by
    /// default
    #[arg(long, value_name = "NAME|none", conflicts_with = "api_key_file", add = Decides::Nothing)]
    pub api_key_env: Option<String>,
    /// File with the API key; default: none, the variable is read
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub api_key_file: Option<PathBuf>,
    /// TOML file of vendors that extends or overrides the built-in table; default: none
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub vendor: Option<PathBuf>,
    /// Send a key to an address although it looks like a key of another vendor
    #[arg(long, add = Decides::Nothing)]
    pub key_anyway: bool,
    /// Header of the key; auto is the vendor's (api-key at Azure), else bearer
    #[arg(long, value_name = "HEADER", value_enum, default_value_t, add = Decides::Nothing)]
    pub key_header: KeyHeader,
    /// Header to add to every request; repeatable; default: none
    #[arg(long, value_name = "NAME: VALUE", add = Decides::Nothing)]
    pub header: Vec<String>,
    /// Header to add to every request, with its secret value from an environment variable; repeatable; default: none
    #[arg(long, value_name = "NAME=VARIABLE", add = Decides::Nothing)]
    pub header_env: Vec<String>,
    /// PEM file of certificate authorities to trust in addition to the system's; default: none
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub ca_file: Option<PathBuf>,
    /// Send a key over unencrypted http to another machine
    #[arg(long, add = Decides::Nothing)]
    pub allow_http: bool,
}

/// Replicas of a server, and the settings for sending requests to it.
#[derive(Debug, Clone)]
pub struct Server {
    /// Address, key and certificates of each replica; at least one.
    pub replicas: Vec<Access>,
    /// Timeouts, retries and rate limits of requests.
    pub sending: Sending,
}

impl Server {
    /// Maximum number of requests in flight, at all replicas together.
    pub fn max_in_flight(&self) -> usize {
        let replicas = self.replicas.len();
        self.sending.concurrency.per_replica(replicas).max() * replicas
    }

    /// Addresses of all replicas, without secrets.
    pub fn addresses(&self) -> Vec<String> {
        self.replicas.iter().map(|replica| replica.base.to_string()).collect()
    }
}

impl AccessArgs {
    /// The same endpoint, without any key.
    #[must_use]
    pub fn without_key(&self) -> Self {
        Self { api_key_env: Some(NO_KEY.to_owned()), api_key_file: None, header_env: Vec::new(), ..self.clone() }
    }

    /// Flags for another endpoint: without the key and the headers of this one.
    #[must_use]
    pub fn for_base_url(&self, base_url: String) -> Self {
        Self {
            base_url: vec![base_url],
            ca_file: self.ca_file.clone(),
            allow_http: self.allow_http,
            key_anyway: self.key_anyway,
            vendor: self.vendor.clone(),
            ..Self::default()
        }
    }

    /// Reads the keys, the headers and the certificates.
    ///
    /// # Errors
    /// If an address is not valid or occurs twice, or a key, header or certificate cannot be read or must not be sent.
    pub fn server(&self, sending: Sending) -> Result<Server> {
        let authorities = self.ca_file.as_deref().map(Authorities::load).transpose()?;
        let authorities = authorities.unwrap_or_default();
        let vendors = self.vendors()?;
        let mut replicas: Vec<Access> = Vec::new();
        for base in self.addresses()? {
            if replicas.iter().any(|other| other.base == base) {
                let problem = format_args!("{base} is named twice");
                return Err(Error::usage("--base-url", problem));
            }
            let vendor = vendors.at_host(base.host());
            if let Some(vendor) = vendor {
                vendor.check_address(&base)?;
            }
            let key = self.key(&base, vendor)?;
            if let Some(key) = &key
                && !self.key_anyway
            {
                check_owner(key, &base, vendors)?;
            }
            replicas.push(Access {
                vendor,
                key,
                key_file: self.api_key_file.clone(),
                key_header: self.key_header,
                account: account_headers(vendor),
                headers: CustomHeaders::read(&self.header, &self.header_env)?,
                authorities: authorities.clone(),
                allow_http: self.allow_http,
                ..Access::new(base)
            });
        }
        Ok(Server { replicas, sending })
    }

    /// Reads the vendors of `--vendor`.
    fn vendors(&self) -> Result<VendorTable> {
        match &self.vendor {
            Some(path) => VendorTable::read(path),
            None => Ok(VendorTable::default()),
        }
    }

    /// Addresses from the flags or the environment, by default OpenAI's.
    ///
    /// # Errors
    /// If an address is not valid.
    pub fn addresses(&self) -> Result<Vec<BaseUrl>> {
        if self.base_url.is_empty() {
            let named = variable(BASE_URL_VARIABLE);
            return Ok(vec![named.as_deref().unwrap_or(DEFAULT_BASE_URL).parse()?]);
        }
        self.base_url.iter().map(|text| text.parse()).collect()
    }

    /// Description of the source of the key, without the key.
    pub fn key_source(&self, replica: &Access) -> String {
        if let Some(path) = &self.api_key_file {
            return format!("the file {}", path.display());
        }
        let names = match self.api_key_env.as_deref() {
            Some(NO_KEY) => return "none".to_owned(),
            Some(name) => vec![name],
            None => key_variables(&replica.base, replica.vendor),
        };
        match names.iter().find(|name| variable(name).is_some()) {
            Some(name) => format!("the variable {name}"),
            None => format!("none: {} is not set", names.join(" or ")),
        }
    }

    /// Checks that neither a key nor a custom header is sent to an address from a run folder, which may come from
    /// someone else. Addresses of vendors in the built-in table are safe.
    ///
    /// # Errors
    /// If a key or a custom header would be sent.
    pub fn check_run_address(&self, base: &BaseUrl) -> Result<()> {
        if Vendor::has_host(base.host()) && !base.is_plain() {
            return Ok(());
        }
        let has_headers = !self.header.is_empty() || !self.header_env.is_empty();
        if base.is_loopback() && !has_headers && self.key(base, None)?.is_none() {
            return Ok(());
        }
        let problem = format_args!(
            "only the run folder names the address {base}, and it may be a stranger's: to send your key there, name it with --base-url \
             {base}"
        );
        Err(Error::usage("--base-url", problem))
    }

    /// Reads the key from a file or a variable. An endpoint on another machine requires a key, except with `none`.
    fn key(&self, base: &BaseUrl, vendor: Option<&'static Vendor>) -> Result<Option<Secret>> {
        if let Some(path) = &self.api_key_file {
            return Secret::read(path).map(Some);
        }
        if let Some(name) = self.api_key_env.as_deref() {
            if name == NO_KEY {
                return Ok(None);
            }
            if looks_like_key(name) {
                return Err(Error::usage(
                    "--api-key-env",
                    "the name of a variable expected; this value looks like a key and is not shown here: put it into a variable, and name \
                     that variable",
                ));
            }
            let text = variable(name).ok_or_else(|| {
                let problem = format_args!("the variable {name} is not set");
                Error::usage("--api-key-env", problem)
            })?;
            return Secret::new(&text, name).map(Some);
        }
        let names = key_variables(base, vendor);
        let first_set = names.iter().find_map(|name| Some((*name, variable(name)?)));
        match first_set {
            Some((name, text)) => Secret::new(&text, name).map(Some),
            None if base.is_loopback() || base.has_credentials() => Ok(None),
            // A header from a variable authenticates the user instead.
            None if !self.header_env.is_empty() => Ok(None),
            None => Err(missing_key_error(base, &names)),
        }
    }
}

/// Variables that may hold the key of an endpoint, in order. OpenAI's key is sent to another vendor only if
/// `OPENAI_BASE_URL` has the same host.
fn key_variables(base: &BaseUrl, vendor: Option<&'static Vendor>) -> Vec<&'static str> {
    let Some(vendor) = vendor else {
        return vec![OPENAI_KEY];
    };
    let mut names: Vec<&str> = vendor.key.iter().map(String::as_str).collect();
    let has_same_host = variable(BASE_URL_VARIABLE)
        .and_then(|text| text.parse::<BaseUrl>().ok())
        .is_some_and(|url| url.host() == base.host());
    if has_same_host && !names.contains(&OPENAI_KEY) {
        names.push(OPENAI_KEY);
    }
    names
}

/// Environment variables of the tools of a host's vendor; empty if the built-in table does not have the host.
pub fn vendor_variables(host: &str) -> Vec<&'static str> {
    Vendor::at_host(host)
        .into_iter()
        .flat_map(|vendor| vendor.key.iter().chain(vendor.account.values()))
        .map(String::as_str)
        .collect()
}

/// Error about a missing key.
fn missing_key_error(base: &BaseUrl, names: &[&str]) -> Error {
    let has_unused_key = !names.contains(&OPENAI_KEY) && variable(OPENAI_KEY).is_some();
    let unused_key = if has_unused_key {
        " (OPENAI_API_KEY is set, and is not sent to another vendor unless --api-key-env names it)"
    } else {
        ""
    };
    let variables = if names.len() == 1 { "this variable" } else { "one of these variables" };
    Error::usage(
        names.join(", "),
        format_args!(
            "no key for {base}: set {variables}{unused_key}, or name another with --api-key-env NAME or a file with --api-key-file FILE; \
             name your own server with --base-url URL; --api-key-env none sends no key"
        ),
    )
}

/// Headers for accounts with several organizations or projects, from the variables that the vendor's clients use.
fn account_headers(vendor: Option<&Vendor>) -> Vec<(String, String)> {
    vendor
        .into_iter()
        .flat_map(|vendor| &vendor.account)
        .filter_map(|(header, name)| Some((header.clone(), variable(name)?)))
        .collect()
}

/// Checks that a key does not look like the key of another vendor: a wrong variable, or an address from someone else,
/// would disclose it. Any key may be sent to this machine, which may run a gateway.
///
/// # Errors
/// If the key belongs to another vendor. The error names the vendor and the address, but never the key.
fn check_owner(key: &Secret, base: &BaseUrl, vendors: VendorTable) -> Result<()> {
    match vendors.by_key(key.expose()) {
        Some(owner) if !base.is_loopback() && !owner.owns_host(base.host()) => Err(Error::usage(
            "--base-url",
            format_args!(
                "{base}: the key looks like one of {}, and this address is another's; name the key of this address with --api-key-env NAME, \
                 or type --allow key-mismatch to send it there",
                owner.name
            ),
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(vendors: VendorTable, key: &str, address: &str) -> Result<(), String> {
        let key = Secret::new(key, "KEY").unwrap();
        check_owner(&key, &address.parse().unwrap(), vendors).map_err(|e| e.to_string())
    }

    #[test]
    fn keys_are_sent_only_to_their_vendor() {
        let rows = tempfile::NamedTempFile::new().unwrap();
        let text = "[[vendor]]\nname = \"Campus\"\nhosts = [\"llm.example\"]\nkey = [\"K\"]\nkey-form = [\"camp-\", \"sk-proj-\"]\n";
        std::fs::write(rows.path(), text).unwrap();
        let own = VendorTable::read(rows.path()).unwrap();
        for (key, address) in [
            ("sk-ant-123", "https://api.anthropic.com/v1"),
            ("sk-ant-123", "http://127.0.0.1:4000/v1"),
            ("sk-123", "https://api.example.org/v1"),
        ] {
            assert_eq!(check(VendorTable::default(), key, address), Ok(()), "{address}");
        }
        for address in ["https://api.openai.com/v1", "https://api.example.org/v1"] {
            let error = check(own, "sk-ant-123", address).unwrap_err();
            assert!(error.contains("looks like one of Anthropic") && error.contains("--allow key-mismatch"));
            assert!(!error.contains("sk-ant"), "{error}");
        }
        // The user's table can add key forms. Its hosts may receive keys of these forms, even if they are another
        // vendor's.
        let gateway = "https://llm.example/v1";
        assert_eq!(check(own, "camp-123", gateway), Ok(()));
        assert_eq!(check(own, "sk-proj-123", gateway), Ok(()));
        assert!(check(VendorTable::default(), "sk-proj-123", gateway).is_err());
        let error = check(own, "camp-123", "https://api.example.org/v1").unwrap_err();
        assert!(error.contains("looks like one of Campus"), "{error}");
    }
}
