//! How an endpoint is reached: [`Access`], its address, key and certificates.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderName, HeaderValue};
use reqwest::{Certificate, Client, redirect};

use super::endpoint::chain;
use super::secret::{Scrub, Secret};
use super::url::BaseUrl;
use crate::error::{Error, Result};

/// How long a connection may take to come about.
const CONNECT: Duration = Duration::from_secs(10);

/// The address of an endpoint with all that opens its door.
#[derive(Debug, Clone)]
pub struct Access {
    /// The address.
    pub base: BaseUrl,
    /// The key; without one no header carries any.
    pub key: Option<Secret>,
    /// The header that carries the key.
    pub key_header: KeyHeader,
    /// Further headers that say who asks and are no secret: `OpenAI-Organization`, `OpenAI-Project`.
    pub headers: Vec<(&'static str, String)>,
    /// Certificate authorities that are trusted besides those of the system.
    pub authorities: Authorities,
    /// Whether a key may travel unencrypted to another machine.
    pub allow_http: bool,
}

impl Access {
    /// An address without a key.
    #[must_use]
    pub fn new(base: BaseUrl) -> Self {
        Self {
            base,
            key: None,
            key_header: KeyHeader::Auto,
            headers: Vec::new(),
            authorities: Authorities::default(),
            allow_http: false,
        }
    }

    /// What must be taken out of everything that the server says.
    pub(super) fn scrub(&self) -> Scrub {
        let key = self.key.as_ref().map(|key| key.expose().to_owned());
        Scrub::new(self.base.secrets().into_iter().chain(key))
    }

    /// Refuses what would give a key away or send two.
    pub(super) fn check(&self, scrub: &Scrub) -> Result<()> {
        let base = &self.base;
        let secret = self.key.is_some() || !scrub.is_empty();
        if secret && base.is_plain() && !base.is_loopback() && !self.allow_http {
            return Err(Error::usage(
                "--base-url",
                format_args!(
                    "the key would travel to {base} for all to read; use https://, or --allow-http if the network is yours"
                ),
            ));
        }
        if self.key.is_some() && base.has_credentials() {
            return Err(Error::usage(
                "--base-url",
                format_args!("{base} comes with a user name and with a key; leave one of them out"),
            ));
        }
        Ok(())
    }

    /// The headers of every request.
    pub(super) fn headers(&self) -> Result<HeaderMap> {
        let mut headers = HeaderMap::new();
        if let Some(key) = &self.key {
            let unfit = |_| Error::usage("key", "no HTTP header can carry it");
            let (name, text) = match self.key_header.at(&self.base) {
                KeyHeader::ApiKey => (HeaderName::from_static("api-key"), key.expose().to_owned()),
                _ => (AUTHORIZATION, format!("Bearer {}", key.expose())),
            };
            let mut value = HeaderValue::try_from(text).map_err(unfit)?;
            value.set_sensitive(true);
            headers.insert(name, value);
        }
        for (name, text) in &self.headers {
            let unfit = |_| Error::usage(*name, "no HTTP header can carry it");
            let name = HeaderName::try_from(*name)
                .map_err(|_| Error::usage(*name, "this is no name of a header"))?;
            headers.insert(name, HeaderValue::try_from(text).map_err(unfit)?);
        }
        Ok(headers)
    }

    /// The client of all requests: redirects are not followed, for a POST would become a GET and the key go elsewhere;
    /// proxies are those of the environment (`HTTPS_PROXY`, `NO_PROXY`, …), and none for this machine.
    pub(super) fn client(&self, timeout: Duration, scrub: &Scrub) -> Result<Client> {
        let mut client = Client::builder()
            .user_agent(concat!("darkqa-eval/", env!("CARGO_PKG_VERSION")))
            .redirect(redirect::Policy::none())
            .connect_timeout(CONNECT.min(timeout))
            .timeout(timeout);
        if !self.authorities.0.is_empty() {
            client = client.tls_certs_merge(self.authorities.0.iter().cloned());
        }
        if self.base.is_loopback() {
            client = client.no_proxy();
        }
        client.build().map_err(|error| Error::Endpoint {
            endpoint: self.base.to_string(),
            problem: scrub.line(&chain(&error)),
        })
    }
}

/// Certificate authorities of the user's own.
#[derive(Debug, Clone, Default)]
pub struct Authorities(Vec<Certificate>);

impl Authorities {
    /// Reads a PEM file of one or more certificates.
    ///
    /// # Errors
    /// Where it cannot be read or holds none.
    pub fn load(path: &Path) -> Result<Self> {
        let pem = std::fs::read(path).map_err(|e| Error::file(path, "read", e))?;
        let found = Certificate::from_pem_bundle(&pem).unwrap_or_default();
        if found.is_empty() {
            return Err(Error::usage(
                "--ca-file",
                format_args!(
                    "{}: no certificate in it; a PEM file expected, which begins with -----BEGIN CERTIFICATE-----",
                    path.display()
                ),
            ));
        }
        Ok(Self(found))
    }
}

/// The header that carries a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyHeader {
    /// `api-key` at Azure, `Authorization` elsewhere.
    Auto,
    /// `Authorization: Bearer …`; at Azure for tokens of Microsoft Entra.
    Bearer,
    /// `api-key: …`, as Azure and gateways before it want it.
    ApiKey,
}

impl KeyHeader {
    const NAMES: [(Self, &str); 3] = [
        (Self::Auto, "auto"),
        (Self::Bearer, "bearer"),
        (Self::ApiKey, "api-key"),
    ];

    fn at(self, base: &BaseUrl) -> Self {
        match self {
            Self::Auto if base.is_azure() => Self::ApiKey,
            Self::Auto => Self::Bearer,
            said => said,
        }
    }
}

impl fmt::Display for KeyHeader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(header, _)| header == self);
        f.pad(name.map_or("", |(_, name)| name))
    }
}

impl FromStr for KeyHeader {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::NAMES.iter().find(|(_, name)| *name == text);
        found.map(|(header, _)| *header).ok_or_else(|| {
            Error::usage(
                "--key-header",
                format_args!("{text:?} is none of auto, bearer, api-key"),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(base: &str, key_header: KeyHeader) -> Access {
        Access {
            key: Some(Secret::new("sk-0123", "KEY").unwrap()),
            key_header,
            ..Access::new(base.parse().unwrap())
        }
    }

    #[test]
    fn the_key_travels_in_the_header_of_its_server() {
        let azure = "https://r.openai.azure.com/openai/v1/";
        for (base, header, name, value) in [
            (azure, KeyHeader::Auto, "api-key", "sk-0123"),
            (azure, KeyHeader::Bearer, "authorization", "Bearer sk-0123"),
            (
                "https://api.openai.com/v1",
                KeyHeader::Auto,
                "authorization",
                "Bearer sk-0123",
            ),
            (
                "https://gateway.example/v1",
                KeyHeader::ApiKey,
                "api-key",
                "sk-0123",
            ),
        ] {
            let headers = access(base, header).headers().unwrap();
            assert_eq!(headers.len(), 1);
            assert_eq!(headers[name], value);
            assert!(headers[name].is_sensitive());
        }
        let bare = Access::new(azure.parse().unwrap());
        assert!(bare.headers().unwrap().is_empty());
    }

    #[test]
    fn names_read_back() {
        for (header, name) in KeyHeader::NAMES {
            assert_eq!(name.parse::<KeyHeader>().unwrap(), header);
            assert_eq!(header.to_string(), name);
        }
        assert!("basic".parse::<KeyHeader>().is_err());
    }

    #[test]
    fn a_file_without_certificates_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "no certificate").unwrap();
        let error = Authorities::load(file.path()).unwrap_err().to_string();
        assert!(error.contains("BEGIN CERTIFICATE"), "{error}");
        assert!(Authorities::load(Path::new("/nowhere")).is_err());
    }
}
