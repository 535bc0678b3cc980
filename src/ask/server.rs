//! The server that models are asked at, as flags say it ([`AccessArgs`]), and with its key ([`Server`]).

use std::path::PathBuf;
use std::{env, fs};

use clap::Args;

use super::access::{Access, Authorities};
use super::key_header::KeyHeader;
use super::secret::Secret;
use super::sending::Sending;
use super::url::BaseUrl;
use crate::error::{Error, Result};
use crate::types::Decides;

/// The endpoint if none is named.
const BASE_URL: &str = "https://api.openai.com/v1";

/// Where Azure's own clients look for a key.
const AZURE_KEY: &str = "AZURE_OPENAI_API_KEY";

/// The name of no variable: the endpoint takes no key.
const NO_KEY: &str = "none";

/// The address of an endpoint and its key.
///
/// The address stays a text until it is used: the command line would show one that cannot be read, and it may hold a password.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Model")]
pub(crate) struct AccessArgs {
    /// The endpoint; /chat/completions is appended; default: OPENAI_BASE_URL, else OpenAI's own
    #[arg(long, value_name = "URL", add = Decides::Reply)]
    pub base_url: Option<String>,
    /// The variable that holds the API key, or none for an endpoint without keys; default: OPENAI_API_KEY (at Azure
    /// AZURE_OPENAI_API_KEY before it)
    #[arg(long, value_name = "NAME|none", conflicts_with = "api_key_file", add = Decides::Nothing)]
    pub api_key_env: Option<String>,
    /// A file that holds the API key; default: none, a variable holds it
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub api_key_file: Option<PathBuf>,
    /// The header that carries the key; auto is api-key at Azure, else bearer
    #[arg(long, value_name = "HEADER", value_enum, default_value_t, add = Decides::Nothing)]
    pub key_header: KeyHeader,
    /// A PEM file of certificate authorities to trust besides the system's; default: none
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub ca_file: Option<PathBuf>,
    /// Send a key over unencrypted http to another machine
    #[arg(long, add = Decides::Nothing)]
    pub allow_http: bool,
}

/// Where requests go, and how.
#[derive(Debug, Clone)]
pub(crate) struct Server {
    /// The address, the key and the certificates.
    pub access: Access,
    /// Timeouts, retries, pace.
    pub sending: Sending,
}

impl AccessArgs {
    /// The same endpoint without a key.
    #[must_use]
    pub(crate) fn without_key(&self) -> Self {
        Self {
            api_key_env: Some(NO_KEY.to_owned()),
            api_key_file: None,
            ..self.clone()
        }
    }

    /// Reads the key and the certificates.
    ///
    /// # Errors
    /// If the address is none, or a key or certificate is not where it is said to be.
    pub(crate) fn server(&self, sending: Sending) -> Result<Server> {
        let named = self.base_url.clone().or_else(|| set("OPENAI_BASE_URL"));
        let base: BaseUrl = named.as_deref().unwrap_or(BASE_URL).parse()?;
        let authorities = self.ca_file.as_deref().map(Authorities::load).transpose()?;
        let access = Access {
            key: self.key(&base)?,
            key_header: self.key_header,
            headers: who_asks(&base),
            authorities: authorities.unwrap_or_default(),
            allow_http: self.allow_http,
            ..Access::new(base)
        };
        Ok(Server { access, sending })
    }

    /// The key: from a file, else from a variable; another machine must have one unless `none` is said.
    fn key(&self, base: &BaseUrl) -> Result<Option<Secret>> {
        if let Some(path) = &self.api_key_file {
            let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
            return Secret::new(&text, "--api-key-file").map(Some);
        }
        let azure = || base.is_azure() && set(AZURE_KEY).is_some();
        let name = match &self.api_key_env {
            Some(name) => name,
            None if azure() => AZURE_KEY,
            None => "OPENAI_API_KEY",
        };
        if name == NO_KEY {
            return Ok(None);
        }
        match set(name) {
            Some(text) => Secret::new(&text, name).map(Some),
            None if self.api_key_env.is_some() => Err(Error::usage(
                "--api-key-env",
                format_args!("the variable {name} is not set"),
            )),
            None if base.is_loopback() || base.has_credentials() => Ok(None),
            None => Err(Error::usage(
                name,
                format_args!(
                    "no key for {base}: set this variable, or name another with --api-key-env NAME or a file with --api-key-file FILE; \
                     an endpoint without keys takes --api-key-env none"
                ),
            )),
        }
    }
}

/// The headers of OpenAI for accounts with several organizations or projects, from the variables of its own clients.
fn who_asks(base: &BaseUrl) -> Vec<(&'static str, String)> {
    if base.host() != "api.openai.com" {
        return Vec::new();
    }
    let headers = [
        ("openai-organization", "OPENAI_ORG_ID"),
        ("openai-project", "OPENAI_PROJECT_ID"),
    ];
    let headers = headers.into_iter();
    headers
        .filter_map(|(header, variable)| Some((header, set(variable)?)))
        .collect()
}

/// The text of a variable that is not blank.
fn set(variable: &str) -> Option<String> {
    env::var(variable)
        .ok()
        .filter(|text| !text.trim().is_empty())
}
