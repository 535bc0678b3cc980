//! The address, key and certificates of an endpoint: [`Access`].
//!
//! The key of an endpoint, which a file may replace while a run asks: [`AccountKey`].
//!
//! TLS with the user's own certificates: [`client_config`].

use std::error::Error as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use reqwest::header::{HeaderMap, HeaderName, HeaderValue};
use reqwest::{Client, redirect};
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::client::verify_server_name;
use rustls::crypto::CryptoProvider;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::server::ParsedCertificate;
use rustls::{CertificateError, ClientConfig, DigitallySignedStruct, OtherError, SignatureScheme};
use rustls_platform_verifier::Verifier;
use tracing::warn;

use super::url::{BaseUrl, CustomHeaders};
use crate::secrets::{KeyHeader, Scrub, Secret};
use crate::vendors::Vendor;
use crate::wire_kind::Wire;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;

/// Maximum time to open a connection; chosen.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// Address of an endpoint, with everything that is needed to connect to it.
#[derive(Debug, Clone)]
pub struct Access {
    /// The base URL of the endpoint.
    pub base: BaseUrl,
    /// API key; `None` to send no header with a key.
    pub key: Option<Secret>,
    /// File of the key, which is read again if the server refuses the key; `None` for a key from elsewhere.
    pub key_file: Option<PathBuf>,
    /// The header that carries the key.
    pub key_header: KeyHeader,
    /// Headers that name the account and are not secret, such as `OpenAI-Organization` and `OpenAI-Project`.
    pub account: Vec<(String, String)>,
    /// Vendor of the host; `None` if no table lists it.
    pub vendor: Option<&'static Vendor>,
    /// Headers from `--header` and `--header-env`.
    pub headers: CustomHeaders,
    /// Certificate authorities to trust in addition to those of the system.
    pub authorities: Authorities,
    /// True if a key may be sent unencrypted to another machine.
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
            key_file: None,
            key_header: KeyHeader::Auto,
            account: Vec::new(),
            headers: CustomHeaders::default(),
            authorities: Authorities::default(),
            allow_http: false,
        }
    }

    /// Filter that removes the keys and passwords of this endpoint from text of the server.
    pub(super) fn scrub(&self) -> Scrub {
        let key = self.key.as_ref().map(|key| key.expose().to_owned());
        let custom = self.headers.secrets().iter().cloned();
        Scrub::new(self.base.secrets().into_iter().chain(key).chain(custom))
    }

    /// Checks that no key is sent unencrypted, and that at most one key is sent.
    pub(super) fn check(&self, scrub: &Scrub) -> Result<()> {
        let base = &self.base;
        let has_secret = self.key.is_some() || !scrub.is_empty();
        if has_secret && base.is_plain() && !base.is_loopback() && !self.allow_http {
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
                format_args!("{base} has a user name in the address, and a key is set too; remove one of them"),
            ));
        }
        Ok(())
    }

    /// Headers of every request through this API.
    pub(super) fn headers(&self, wire: Wire) -> Result<HeaderMap> {
        let mut headers = self.key_headers(self.key.as_ref(), wire)?;
        for (name, text) in &self.account {
            let value = HeaderValue::try_from(text).map_err(|_| {
                Error::usage(name.as_str(), "the value has characters that an HTTP header cannot carry")
            })?;
            let name = HeaderName::try_from(name)
                .map_err(|_| Error::usage(name.as_str(), "this is not a valid name of an HTTP header"))?;
            headers.insert(name, value);
        }
        self.headers.add_to(&mut headers)?;
        Ok(headers)
    }

    /// Header with this key.
    pub(super) fn key_headers(&self, key: Option<&Secret>, wire: Wire) -> Result<HeaderMap> {
        let key_header = match self.key_header {
            KeyHeader::Auto => self.vendor.map_or(KeyHeader::Bearer, Vendor::key_header),
            explicit => explicit,
        };
        wire.headers(key, key_header)
    }

    /// HTTP client for all requests, with a time limit for connecting only.
    ///
    /// It follows no redirects: a POST would become a GET, and the key would be sent to another address. Proxies come
    /// from the environment (`HTTPS_PROXY`, `NO_PROXY`, …); requests to this machine use none.
    pub(super) fn client(&self, timeout: Duration, scrub: &Scrub) -> Result<Client> {
        // An error means that a crypto provider is already installed.
        let _ = default_provider().install_default();
        let mut client = Client::builder()
            .user_agent(concat!("darkqa-eval/", env!("CARGO_PKG_VERSION")))
            .redirect(redirect::Policy::none())
            .connect_timeout(connect_timeout(timeout));
        let trusted = &self.authorities.0;
        if !trusted.is_empty() {
            let config = client_config(trusted, Arc::new(default_provider()))
                .map_err(|e| Error::usage("--ca-file", e.to_string()))?;
            client = client.tls_backend_preconfigured(config);
        }
        if self.base.is_loopback() {
            client = client.no_proxy();
        }
        client.build().map_err(|error| Error::Endpoint {
            endpoint: self.base.to_string(),
            problem: scrub.line(&with_causes(&error)),
        })
    }
}

/// Additional certificate authorities, for example a private CA.
#[derive(Debug, Clone, Default)]
pub struct Authorities(Vec<CertificateDer<'static>>);

impl Authorities {
    /// Reads a PEM file of one or more certificates.
    ///
    /// # Errors
    /// If the file cannot be read or has no valid certificate.
    pub fn load(path: &Path) -> Result<Self> {
        let pem = files::settings(path)?;
        let certificates: Vec<_> =
            CertificateDer::pem_slice_iter(pem.as_bytes()).collect::<Result<_, _>>().unwrap_or_default();
        if certificates.is_empty() {
            return Err(Error::usage(
                "--ca-file",
                format_args!(
                    "{}: there is no certificate in it; expected a PEM file, which begins with -----BEGIN CERTIFICATE-----",
                    path.display()
                ),
            ));
        }
        Ok(Self(certificates))
    }
}

/// Maximum time to open a connection, for attempts with this timeout.
pub(super) fn connect_timeout(timeout: Duration) -> Duration {
    CONNECT_TIMEOUT.min(timeout)
}

/// Text of an error with all its causes; reqwest's own text lacks them.
pub(super) fn with_causes(error: &reqwest::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

/// The key of an endpoint. If it comes from a file, the file is read again after a refusal with status 401: tokens of
/// cloud accounts are valid for an hour, and keys are rotated.
#[derive(Debug)]
pub(super) struct AccountKey {
    access: Access,
    state: Mutex<AccessState>,
}

#[derive(Debug)]
struct AccessState {
    /// Key from a later reading of the file; `None` before it.
    renewed: Option<Secret>,
    /// Number of keys read so far, besides the first.
    renewals: u32,
    /// Filter that removes all keys so far.
    scrub: Arc<Scrub>,
}

/// Headers of a request, with the key that they carry.
#[derive(Debug)]
pub(super) struct KeyedHeaders {
    pub headers: HeaderMap,
    /// Number of the key.
    renewals: u32,
}

impl AccountKey {
    pub(super) fn new(access: Access, scrub: Scrub) -> Self {
        Self { access, state: Mutex::new(AccessState { renewed: None, renewals: 0, scrub: Arc::new(scrub) }) }
    }

    /// Filter that removes the keys and passwords of the endpoint from text of the server.
    pub(super) fn scrub(&self) -> Arc<Scrub> {
        Arc::clone(&self.state().scrub)
    }

    /// These headers, with the latest key.
    pub(super) fn add_to(&self, headers: &HeaderMap) -> KeyedHeaders {
        let state = self.state();
        let mut headers = headers.clone();
        if let Some(key) = &state.renewed
            && let Ok(latest) = self.access.key_headers(Some(key), Wire::Chat)
        {
            headers.extend(latest);
        }
        KeyedHeaders { headers, renewals: state.renewals }
    }

    /// Reads the file of the key again, after the server refused the key of a request. Returns true if there is another
    /// key since.
    pub(super) fn renew(&self, refused: &KeyedHeaders) -> bool {
        let Some(path) = &self.access.key_file else {
            return false;
        };
        let mut state = self.state();
        if state.renewals != refused.renewals {
            return true;
        }
        let key = match Secret::read(path) {
            Ok(key) => key,
            Err(error) => {
                warn!("the server refuses the key, and a new one could not be read: {error}");
                return false;
            }
        };
        if Some(&key) == state.renewed.as_ref().or(self.access.key.as_ref()) {
            return false;
        }
        state.scrub = Arc::new(state.scrub.with(key.expose().to_owned()));
        state.renewed = Some(key);
        state.renewals += 1;
        true
    }

    fn state(&self) -> MutexGuard<'_, AccessState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// TLS settings of a client that trusts these certificates in addition to the system's, both as authorities and as
/// server certificates.
///
/// # Errors
/// If a certificate cannot be used.
fn client_config(
    trusted: &[CertificateDer<'static>],
    provider: Arc<CryptoProvider>,
) -> Result<ClientConfig, rustls::Error> {
    let verifier = CustomVerifier {
        platform: Verifier::new_with_extra_roots(trusted.iter().cloned(), Arc::clone(&provider))?,
        trusted: trusted.to_vec(),
    };
    let config = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions()?;
    let mut config = config.dangerous().with_custom_certificate_verifier(Arc::new(verifier)).with_no_client_auth();
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    Ok(config)
}

/// Verifier of the platform that also accepts a trusted CA certificate as the server's own certificate.
///
/// `openssl req -x509` creates certificates with `CA:TRUE`, which the platform verifier rejects for a server. Other
/// clients accept such a certificate if the user trusts it.
#[derive(Debug)]
struct CustomVerifier {
    platform: Verifier,
    trusted: Vec<CertificateDer<'static>>,
}

impl ServerCertVerifier for CustomVerifier {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        intermediates: &[CertificateDer<'_>],
        server_name: &ServerName<'_>,
        ocsp_response: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        let verified = self.platform.verify_server_cert(end_entity, intermediates, server_name, ocsp_response, now);
        // The platform verifier checks the dates before it reports this error.
        match verified {
            Err(rustls::Error::InvalidCertificate(CertificateError::Other(OtherError(error))))
                if error.to_string().contains("CaUsedAsEndEntity")
                    && self.trusted.iter().any(|trusted| trusted == end_entity) =>
            {
                verify_server_name(&ParsedCertificate::try_from(end_entity)?, server_name)?;
                Ok(ServerCertVerified::assertion())
            }
            verified => verified,
        }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        self.platform.verify_tls12_signature(message, cert, dss)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        self.platform.verify_tls13_signature(message, cert, dss)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.platform.supported_verify_schemes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(base: &str, key_header: KeyHeader) -> Access {
        Access { key: Some(Secret::new("sk-0123", "KEY").unwrap()), key_header, ..Access::new(base.parse().unwrap()) }
    }

    #[test]
    fn the_vendor_decides_the_key_header() {
        let azure = "https://r.openai.azure.com/openai/v1/";
        for (base, header, name, value) in [
            (azure, KeyHeader::Auto, "api-key", "sk-0123"),
            (azure, KeyHeader::Bearer, "authorization", "Bearer sk-0123"),
            ("https://api.openai.com/v1", KeyHeader::Auto, "authorization", "Bearer sk-0123"),
            ("https://gateway.example/v1", KeyHeader::ApiKey, "api-key", "sk-0123"),
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

    #[test]
    fn key_is_read_again_after_a_refusal() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let write = |key: &str| std::fs::write(file.path(), key).unwrap();
        let access = Access {
            key: Some(Secret::new("sk-first-0123456789", "KEY").unwrap()),
            key_file: Some(file.path().to_owned()),
            ..Access::new("https://api.example.org/v1".parse().unwrap())
        };
        let base = access.headers(Wire::Chat).unwrap();
        let scrub = access.scrub();
        let key = AccountKey::new(access, scrub);
        let first = key.add_to(&base);
        write("sk-first-0123456789\n");
        assert!(!key.renew(&first), "the same key");
        write("");
        assert!(!key.renew(&first), "no key");
        write("sk-second-0123456789\n");
        assert!(key.renew(&first));
        assert!(key.renew(&first), "another request has read it");
        let second = key.add_to(&base);
        assert_eq!(second.headers["authorization"], "Bearer sk-second-0123456789");
        assert!(second.headers["authorization"].is_sensitive());
        assert!(!key.renew(&second), "no newer one");
        let text = key.scrub().line("sk-first-0123456789 and sk-second-0123456789");
        assert_eq!(text, "[secret] and [secret]");
    }

    #[test]
    fn key_of_a_variable_is_not_read_again() {
        let access = Access::new("https://api.example.org/v1".parse().unwrap());
        let key = AccountKey::new(access, Scrub::default());
        assert!(!key.renew(&key.add_to(&HeaderMap::new())));
    }
}
