//! The address, key and certificates of an endpoint: [`Access`].

use std::error::Error as _;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use reqwest::header::{HeaderMap, HeaderName, HeaderValue};
use reqwest::{Client, redirect};
use rustls::crypto::ring::default_provider;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;

use super::own_certificate::client_config;
use super::own_headers::CustomHeaders;
use super::proxy::check_proxy;
use super::url::BaseUrl;
use crate::ask::secrets::{KeyHeader, Scrub, Secret};
use crate::ask::vendors::Vendor;
use crate::ask::wire_kind::Wire;
use crate::error::{Error, Result};
use crate::files::reading;

/// The maximum time to open a connection; chosen.
const CONNECT: Duration = Duration::from_secs(10);

/// The address of an endpoint with everything that is needed to connect to it.
#[derive(Debug, Clone)]
pub struct Access {
    /// The base URL of the endpoint.
    pub base: BaseUrl,
    /// The API key; `None` if no header with a key is sent.
    pub key: Option<Secret>,
    /// The header that carries the key.
    pub key_header: KeyHeader,
    /// Further headers that name the account and are not secret: `OpenAI-Organization`, `OpenAI-Project`.
    pub account: Vec<(String, String)>,
    /// Facts about the vendor; `None` for hosts that no table lists.
    pub vendor: Option<&'static Vendor>,
    /// Headers that the user adds.
    pub headers: CustomHeaders,
    /// Certificate authorities that are trusted in addition to those of the system.
    pub authorities: Authorities,
    /// Whether a key may be sent unencrypted to another machine.
    pub allow_http: bool,
}

impl Access {
    /// An address without a key.
    #[must_use]
    pub fn new(base: BaseUrl) -> Self {
        Self {
            vendor: Vendor::at_host(base.host()),
            base,
            key: None,
            key_header: KeyHeader::Auto,
            account: Vec::new(),
            headers: CustomHeaders::default(),
            authorities: Authorities::default(),
            allow_http: false,
        }
    }

    /// The filter that removes keys and passwords from the server's texts.
    pub(super) fn scrub(&self) -> Scrub {
        let key = self.key.as_ref().map(|key| key.expose().to_owned());
        let own = self.headers.secrets().iter().cloned();
        Scrub::new(self.base.secrets().into_iter().chain(key).chain(own))
    }

    /// Refuses settings that would send a key unencrypted, or send two keys.
    pub(super) fn check(&self, scrub: &Scrub) -> Result<()> {
        let base = &self.base;
        let secret = self.key.is_some() || !scrub.is_empty();
        if secret && base.is_plain() && !base.is_loopback() && !self.allow_http {
            return Err(Error::usage(
                "--base-url",
                format_args!(
                    "the key would be sent unencrypted to {base}; use https://, or --allow http on a network that you trust"
                ),
            ));
        }
        if self.key.is_some() && base.has_credentials() {
            return Err(Error::usage(
                "--base-url",
                format_args!(
                    "{base} has a user name in the address, and a key is set too; remove one of them"
                ),
            ));
        }
        Ok(())
    }

    /// The headers of every request to an API.
    pub(super) fn headers(&self, wire: Wire) -> Result<HeaderMap> {
        let form = match self.key_header {
            KeyHeader::Auto => self.vendor.map_or(KeyHeader::Bearer, Vendor::key_header),
            named => named,
        };
        let mut headers = wire.headers(self.key.as_ref(), form)?;
        for (name, text) in &self.account {
            let invalid = |_| {
                Error::usage(
                    name.as_str(),
                    "the value has characters that an HTTP header cannot carry",
                )
            };
            let value = HeaderValue::try_from(text).map_err(invalid)?;
            let name = HeaderName::try_from(name).map_err(|_| {
                Error::usage(name.as_str(), "this is not a valid name of an HTTP header")
            })?;
            headers.insert(name, value);
        }
        self.headers.extend(&mut headers)?;
        Ok(headers)
    }

    /// The HTTP client of all requests, with a limit of the time to connect alone. It follows no redirects, because a POST would become a GET and the key would be sent
    /// elsewhere. Proxies come from the environment (`HTTPS_PROXY`, `NO_PROXY`, …); there is none for this machine.
    pub(super) fn client(&self, timeout: Duration, scrub: &Scrub) -> Result<Client> {
        // An error means that a provider is installed already.
        let _ = default_provider().install_default();
        let mut client = Client::builder()
            .user_agent(concat!("darkqa-eval/", env!("CARGO_PKG_VERSION")))
            .redirect(redirect::Policy::none())
            .connect_timeout(connect_limit(timeout));
        let trusted = &self.authorities.0;
        if !trusted.is_empty() {
            let config = client_config(trusted, Arc::new(default_provider()));
            let config = config.map_err(|e| Error::usage("--ca-file", e.to_string()))?;
            client = client.tls_backend_preconfigured(config);
        }
        check_proxy(&self.base, |name| std::env::var_os(name))?;
        if self.base.is_loopback() {
            client = client.no_proxy();
        }
        client.build().map_err(|error| Error::Endpoint {
            endpoint: self.base.to_string(),
            problem: scrub.line(&with_causes(&error)),
        })
    }
}

/// Custom certificate authorities, as of a private CA.
#[derive(Debug, Clone, Default)]
pub struct Authorities(Vec<CertificateDer<'static>>);

impl Authorities {
    /// Reads a PEM file of one or more certificates.
    ///
    /// # Errors
    /// If it cannot be read or has no certificate.
    pub fn load(path: &Path) -> Result<Self> {
        let pem = reading::settings(path)?;
        let found = CertificateDer::pem_slice_iter(pem.as_bytes());
        let found: Vec<CertificateDer<'static>> =
            found.collect::<Result<_, _>>().unwrap_or_default();
        if found.is_empty() {
            return Err(Error::usage(
                "--ca-file",
                format_args!(
                    "{}: there is no certificate in it; expected a PEM file, which begins with -----BEGIN CERTIFICATE-----",
                    path.display()
                ),
            ));
        }
        Ok(Self(found))
    }
}

/// The maximum time to open a connection for tries of this time.
pub(super) fn connect_limit(timeout: Duration) -> Duration {
    CONNECT.min(timeout)
}

/// The text of an error with its causes: reqwest's own text says only that something failed.
pub(super) fn with_causes(error: &reqwest::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
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
    fn the_key_is_sent_in_the_header_that_the_server_expects() {
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
            let headers = access(base, header).headers(Wire::Chat).unwrap();
            assert_eq!(headers.len(), 1);
            assert_eq!(headers[name], value);
            assert!(headers[name].is_sensitive());
        }
        let bare = Access::new(azure.parse().unwrap());
        assert!(bare.headers(Wire::Chat).unwrap().is_empty());
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
