//! Who is asked, where, and with what key.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::str::FromStr;
use std::{env, fs};

use super::{Shard, parsed, seconds};
use crate::ask::{
    Access, Authorities, BaseUrl, Bounds, Constrain, KeyHeader, Parameters, Quota, Secret, Sending,
    Temperature, TokenField,
};
use crate::cli::{ModelArgs, SendingArgs};
use crate::error::{Error, Result};
use crate::types::View;

/// The endpoint where nobody says otherwise.
const BASE_URL: &str = "https://api.openai.com/v1";

/// Where Azure's own clients look for a key.
const AZURE_KEY: &str = "AZURE_OPENAI_API_KEY";

/// The name of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ModelName {
    /// The built-in one that guesses.
    Random,
    /// The built-in one that looks at what the pixels still hold.
    Observer,
    /// The built-in one that answers out of a file.
    Script(PathBuf),
    /// One at the endpoint.
    Remote(String),
}

/// Who is asked.
#[derive(Debug)]
pub struct Ask {
    /// The models.
    pub models: Vec<ModelName>,
    /// Whether they see the images.
    pub view: View,
    /// The models of the text-only baseline.
    pub blind_models: Vec<ModelName>,
    /// The endpoint; `None` where all models are built in.
    pub server: Option<Server>,
    /// How a model is to speak; its name is set for each.
    pub parameters: Parameters,
    /// A folder with prompts of the user's.
    pub prompts: Option<PathBuf>,
}

/// Where requests go, and how.
#[derive(Debug)]
pub struct Server {
    /// The address, the key and the certificates.
    pub access: Access,
    /// Timeouts, retries, pace.
    pub sending: Sending,
}

pub(super) fn ask(said: ModelArgs, sending: &SendingArgs, shard: Shard) -> Result<Ask> {
    let names = |flag: &'static str, names: &[String]| -> Result<Vec<ModelName>> {
        names
            .iter()
            .map(|name| name.parse::<ModelName>().map_err(|e| e.at(flag)))
            .collect()
    };
    let (models, blind_models) = (
        names("--model", &said.model)?,
        names("--blind-model", &said.blind_model)?,
    );
    let remote = models
        .iter()
        .chain(&blind_models)
        .any(|name| matches!(name, ModelName::Remote(_)));
    let parameters = Parameters {
        temperature: parsed("--temperature", said.temperature.as_deref())?
            .unwrap_or(Temperature::Auto),
        max_tokens: Some(
            said.max_tokens
                .map_or(Parameters::MAX_TOKENS, NonZeroU32::get),
        ),
        token_field: parsed("--token-field", said.token_field.as_deref())?
            .unwrap_or(TokenField::Auto),
        reasoning_effort: said.reasoning_effort.clone(),
        detail: parsed("--detail", said.detail.as_deref())?,
        constrain: parsed("--constrain", said.constrain.as_deref())?.unwrap_or(Constrain::None),
        ..Parameters::new(String::new())
    };
    Ok(Ask {
        models,
        view: if said.blind { View::Blind } else { View::Image },
        blind_models,
        server: if remote {
            Some(server(&said, sending, shard)?)
        } else {
            None
        },
        parameters,
        prompts: said.prompts,
    })
}

impl FromStr for ModelName {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.trim() {
            "" => Err(Error::usage("--model", "the name of a model is empty")),
            "random" => Ok(Self::Random),
            "observer" => Ok(Self::Observer),
            name => Ok(name.strip_prefix("script:").map_or_else(
                || Self::Remote(name.to_owned()),
                |path| Self::Script(path.into()),
            )),
        }
    }
}

/// The endpoint; what may be sent to it in a minute is this part's share.
fn server(said: &ModelArgs, sending: &SendingArgs, shard: Shard) -> Result<Server> {
    let base = said
        .base_url
        .clone()
        .or_else(|| set("OPENAI_BASE_URL"))
        .unwrap_or_else(|| BASE_URL.to_owned());
    let base: BaseUrl = base.parse()?;
    let authorities = said.ca_file.as_deref().map(Authorities::load).transpose()?;
    let defaults = Sending::default();
    Ok(Server {
        access: Access {
            key: key(said, &base)?,
            key_header: parsed("--key-header", said.key_header.as_deref())?
                .unwrap_or(KeyHeader::Auto),
            headers: who_asks(&base),
            authorities: authorities.unwrap_or_default(),
            allow_http: said.allow_http,
            ..Access::new(base)
        },
        sending: Sending {
            timeout: seconds("--timeout", sending.timeout)?.unwrap_or(defaults.timeout),
            retries: sending.retries.unwrap_or(defaults.retries),
            max_wait: seconds("--max-wait", sending.max_wait)?.unwrap_or(defaults.max_wait),
            concurrency: concurrency(sending)?,
            quota: Quota {
                requests: sending.rpm.map(|rpm| shard.share(rpm)),
                tokens: sending.tpm.map(|tpm| shard.share(tpm)),
            },
            ..defaults
        },
    })
}

/// How many requests are in flight at once.
pub(super) fn concurrency(said: &SendingArgs) -> Result<Bounds> {
    let said = parsed("--concurrency", said.concurrency.as_deref())?;
    Ok(said.unwrap_or(Bounds::DEFAULT))
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

/// The key for an endpoint: from a file, else from a variable; another machine must have one unless `none` is said.
fn key(said: &ModelArgs, base_url: &BaseUrl) -> Result<Option<Secret>> {
    if let Some(path) = &said.api_key_file {
        let text = fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
        return Secret::new(&text, "--api-key-file").map(Some);
    }
    let azure = || base_url.is_azure() && set(AZURE_KEY).is_some();
    let name = match &said.api_key_env {
        Some(name) => name,
        None if azure() => AZURE_KEY,
        None => "OPENAI_API_KEY",
    };
    if name == "none" {
        return Ok(None);
    }
    match set(name) {
        Some(text) => Secret::new(&text, name).map(Some),
        None if said.api_key_env.is_some() => Err(Error::usage(
            "--api-key-env",
            format_args!("the variable {name} is not set"),
        )),
        None if base_url.is_loopback() || base_url.has_credentials() => Ok(None),
        None => Err(Error::usage(
            name,
            format_args!(
                "no key for {base_url}: set this variable, or name another with --api-key-env NAME or a file with --api-key-file FILE; \
                 an endpoint without keys takes --api-key-env none"
            ),
        )),
    }
}

fn set(variable: &str) -> Option<String> {
    env::var(variable)
        .ok()
        .filter(|text| !text.trim().is_empty())
}
