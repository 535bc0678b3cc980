//! The base URL of an endpoint: [`BaseUrl`].

use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use percent_encoding::percent_decode_str;
use reqwest::Url;

use crate::ask::wire_kind::Wire;
use crate::error::{Error, Result};

/// The base URL of an endpoint, used exactly as written: no `/v1` is added or assumed.
#[derive(Clone, PartialEq, Eq)]
pub struct BaseUrl(Url);

impl BaseUrl {
    /// The URL of a path below the base URL, as `chat/completions`; the query string stays.
    pub(super) fn join(&self, path: &str) -> Url {
        let mut url = self.0.clone();
        url.set_path(&format!("{}/{path}", self.0.path().trim_end_matches('/')));
        url
    }

    /// The host, in lower case.
    #[must_use]
    pub fn host(&self) -> &str {
        self.0.host_str().unwrap_or_default()
    }

    /// The port, or the default port of the scheme.
    #[must_use]
    pub(crate) fn port(&self) -> Option<u16> {
        self.0.port_or_known_default()
    }

    /// True if the host is this machine.
    #[must_use]
    pub fn is_loopback(&self) -> bool {
        let host = self.host();
        let bare = host.trim_start_matches('[').trim_end_matches(']');
        host == "localhost" || host.ends_with(".localhost") || bare.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
    }

    /// True for http://: requests are sent unencrypted.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.0.scheme() == "http"
    }

    /// True if the URL has a path other than `/`.
    pub(crate) fn has_path(&self) -> bool {
        !self.0.path().trim_matches('/').is_empty()
    }

    /// True if the URL has a user name or password.
    #[must_use]
    pub fn has_credentials(&self) -> bool {
        !self.0.username().is_empty() || self.0.password().is_some()
    }

    /// Secrets in the URL: user name and password in every form that a server could repeat, and the values of the query
    /// string.
    pub(super) fn secrets(&self) -> Vec<String> {
        let mut secrets = Vec::new();
        if self.has_credentials() {
            let (user, password) = (self.0.username(), self.0.password().unwrap_or_default());
            let (plain_user, plain_password) = (decoded(user), decoded(password));
            secrets.push(STANDARD.encode(format!("{plain_user}:{plain_password}")));
            secrets.extend([user, password].map(str::to_owned));
            secrets.extend([plain_user, plain_password]);
        }
        for pair in self.0.query().unwrap_or_default().split('&') {
            // The API version of Azure is not secret, and Azure's errors mention it.
            if let Some((name, value)) = pair.split_once('=')
                && name != "api-version"
            {
                secrets.extend([value.to_owned(), decoded(value)]);
            }
        }
        secrets
    }
}

/// Decodes percent encoding.
fn decoded(text: &str) -> String {
    percent_decode_str(text).decode_utf8_lossy().into_owned()
}

impl FromStr for BaseUrl {
    type Err = Error;

    /// Parses a URL. Errors do not show it, because it may contain a password.
    fn from_str(text: &str) -> Result<Self> {
        let url = Url::parse(text.trim()).map_err(|error| {
            Error::usage(
                "--base-url",
                format_args!(
                    "not an address ({error}); expected for example https://api.openai.com/v1 or http://127.0.0.1:8000/v1"
                ),
            )
        })?;
        if !matches!(url.scheme(), "http" | "https") || url.host_str().is_none() {
            return Err(Error::usage("--base-url", "expected an address that begins with https:// or http://"));
        }
        if url.fragment().is_some() {
            return Err(Error::usage(
                "--base-url",
                "an address with '#' cannot be used; remove '#' and everything after it",
            ));
        }
        for path in Wire::ALL.map(Wire::path) {
            let before = url.path().trim_end_matches('/').strip_suffix(path);
            if before.is_some_and(|before| before.ends_with('/')) {
                return Err(Error::usage(
                    "--base-url",
                    format_args!("remove /{path} from the end; it is appended to the address"),
                ));
            }
        }
        Ok(Self(url))
    }
}

impl fmt::Display for BaseUrl {
    /// Writes the URL without user name, password and query string.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}://{}", self.0.scheme(), self.host())?;
        if let Some(port) = self.0.port() {
            write!(f, ":{port}")?;
        }
        f.write_str(self.0.path().trim_end_matches('/'))
    }
}

impl fmt::Debug for BaseUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "BaseUrl({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn url(text: &str) -> BaseUrl {
        text.parse().unwrap()
    }

    #[test]
    fn the_path_is_used_exactly_as_written() {
        for (base, completions) in [
            ("https://api.openai.com/v1", "https://api.openai.com/v1/chat/completions"),
            ("https://api.openai.com/v1/", "https://api.openai.com/v1/chat/completions"),
            ("http://127.0.0.1:4010", "http://127.0.0.1:4010/chat/completions"),
            (
                "https://r.example/openai/deployments/a%2Fb?api-version=2024-10-21",
                "https://r.example/openai/deployments/a%2Fb/chat/completions?api-version=2024-10-21",
            ),
            ("https://g.example/v1beta/openai//", "https://g.example/v1beta/openai/chat/completions"),
        ] {
            assert_eq!(url(base).join("chat/completions").as_str(), completions);
        }
        for wrong in
            ["", "api.openai.com/v1", "ftp://a/", "http://", "https://a/v1#x", "https://a/v1/chat/completions/"]
        {
            assert!(wrong.parse::<BaseUrl>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn secrets_in_the_url_are_not_shown() {
        let base = url("https://me:p%40ss@h.example:444/v1?key=s3cr%20t&api-version=2024-10-21");
        assert_eq!(base.to_string(), "https://h.example:444/v1");
        assert_eq!(format!("{base:?}"), "BaseUrl(https://h.example:444/v1)");
        let secrets = base.secrets();
        for secret in ["me", "p@ss", "p%40ss", "s3cr%20t", "s3cr t", "bWU6cEBzcw=="] {
            assert!(secrets.iter().any(|s| s == secret), "{secret}");
        }
        assert!(!secrets.iter().any(|s| s == "2024-10-21"));
        let error = "https://me:secret@[::1".parse::<BaseUrl>().unwrap_err();
        assert!(!error.to_string().contains("secret"));
    }

    #[test]
    fn addresses_of_this_machine_are_recognized() {
        for local in [
            "http://localhost:1/",
            "http://127.0.0.1/",
            "http://127.9.9.9/v1",
            "http://[::1]:8/v1",
            "http://LOCALHOST/",
        ] {
            assert!(url(local).is_loopback(), "{local}");
        }
        for remote in ["http://192.168.0.1/", "http://localhost.example.com/", "http://[::2]/"] {
            assert!(!url(remote).is_loopback(), "{remote}");
        }
    }
}
