//! The server at which models are asked: its flags ([`AccessArgs`]), and its settings with the key ([`Server`]).

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

/// The endpoint if neither `--base-url` nor `OPENAI_BASE_URL` names one.
const BASE_URL: &str = "https://api.openai.com/v1";

/// The environment variable in which Azure's clients look for a key.
const AZURE_KEY: &str = "AZURE_OPENAI_API_KEY";

/// The value of `--api-key-env` for an endpoint without keys.
const NO_KEY: &str = "none";

/// The address of an endpoint and its key.
///
/// The address is parsed when it is used: the parser of the command line would print an invalid one, with its password.
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

/// The address of a server, and how requests are sent to it.
#[derive(Debug, Clone)]
pub(crate) struct Server {
    /// The address, the key and the certificates.
    pub access: Access,
    /// The timeouts, retries and rate limits of requests.
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
    /// If the address is not valid, or a key or certificate cannot be read.
    pub(crate) fn server(&self, sending: Sending) -> Result<Server> {
        let named = self
            .base_url
            .clone()
            .or_else(|| variable("OPENAI_BASE_URL"));
        let base: BaseUrl = named.as_deref().unwrap_or(BASE_URL).parse()?;
        let authorities = self.ca_file.as_deref().map(Authorities::load).transpose()?;
        let access = Access {
            key: self.key(&base)?,
            key_header: self.key_header,
            headers: account_headers(&base),
            authorities: authorities.unwrap_or_default(),
            allow_http: self.allow_http,
            ..Access::new(base)
        };
        Ok(Server { access, sending })
    }

    /// The key from a file or a variable. For an endpoint on another machine a key is required, except with `none`.
    fn key(&self, base: &BaseUrl) -> Result<Option<Secret>> {
        if let Some(path) = &self.api_key_file {
            let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
            return Secret::new(&text, "--api-key-file").map(Some);
        }
        let azure = || base.is_azure() && variable(AZURE_KEY).is_some();
        let name = match &self.api_key_env {
            Some(name) => name,
            None if azure() => AZURE_KEY,
            None => "OPENAI_API_KEY",
        };
        if name == NO_KEY {
            return Ok(None);
        }
        match variable(name) {
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
                     a server of your own is named by --base-url URL, and --api-key-env none sends no key"
                ),
            )),
        }
    }
}

/// OpenAI's headers for accounts with several organizations or projects, from the variables that OpenAI's clients use.
fn account_headers(base: &BaseUrl) -> Vec<(&'static str, String)> {
    if base.host() != "api.openai.com" {
        return Vec::new();
    }
    let headers = [
        ("openai-organization", "OPENAI_ORG_ID"),
        ("openai-project", "OPENAI_PROJECT_ID"),
    ];
    let headers = headers.into_iter();
    headers
        .filter_map(|(header, name)| Some((header, variable(name)?)))
        .collect()
}

/// The value of an environment variable; `None` if it is not set or blank.
fn variable(name: &str) -> Option<String> {
    env::var(name).ok().filter(|text| !text.trim().is_empty())
}
