//! The base URL of an endpoint: [`BaseUrl`].
//!
//! The proxy that the environment sets: [`proxy_variable`].
//!
//! Headers that the user adds to every request: [`CustomHeaders`].
//!
//! Environment variables: [`variable`].

use std::ffi::OsString;
use std::net::IpAddr;
use std::str::FromStr;
use std::{env, fmt};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::Uri;
use hyper::http::uri::Authority;
use hyper_util::client::proxy::matcher::Matcher;
use percent_encoding::percent_decode_str;
use reqwest::Url;
use reqwest::header::{HeaderMap, HeaderName, HeaderValue};

use crate::secrets::{is_secret_header, looks_like_key};
use crate::wire_kind::Wire;
use darkqa_base::error::{Error, Result};

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
    pub fn port(&self) -> Option<u16> {
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
    pub fn has_path(&self) -> bool {
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

/// Valid proxy address, to find out whether `NO_PROXY` exempts an address.
const SAMPLE_PROXY: &str = "http://127.0.0.1:1";

/// Variable that sets the proxy for an address; `None` if requests are sent directly. The proxy must be usable: reqwest
/// ignores an invalid one and would connect directly.
///
/// Reads the same variables in the same order as reqwest: `HTTP_PROXY` or `HTTPS_PROXY` by the scheme of the address,
/// then `ALL_PROXY`, each before its lower-case name. An empty variable counts as unset.
///
/// # Errors
/// If the proxy is not usable. The error names the variable but not its value, which may contain a password.
pub(super) fn proxy_variable(
    base: &BaseUrl,
    variable: impl Fn(&str) -> Option<OsString>,
) -> Result<Option<&'static str>> {
    // Requests to this machine use no proxy.
    if base.is_loopback() {
        return Ok(None);
    }
    let Ok(address) = base.to_string().parse::<Uri>() else {
        return Ok(None);
    };
    let by_scheme = if base.is_plain() { ["HTTP_PROXY", "http_proxy"] } else { ["HTTPS_PROXY", "https_proxy"] };
    let Some((name, value)) =
        first_set(&variable, by_scheme).or_else(|| first_set(&variable, ["ALL_PROXY", "all_proxy"]))
    else {
        return Ok(None);
    };
    let no_proxy = first_set(&variable, ["NO_PROXY", "no_proxy"])
        .and_then(|(_, value)| value.into_string().ok())
        .unwrap_or_default();
    let matcher = Matcher::builder().all(SAMPLE_PROXY).no(no_proxy).build();
    let is_exempt = matcher.intercept(&address).is_none();
    if is_exempt {
        return Ok(None);
    }
    if value.to_str().is_some_and(is_usable) {
        return Ok(Some(name));
    }
    let problem = "not a proxy that can be used, and nothing was sent without it; expected for example http://proxy.example:3128 (no \
                   SOCKS). To connect directly, unset it or name the host in NO_PROXY";
    Err(Error::usage(name, problem))
}

/// The first of two variables that is set, unless it is empty.
fn first_set(
    variable: &impl Fn(&str) -> Option<OsString>,
    names: [&'static str; 2],
) -> Option<(&'static str, OsString)> {
    names.into_iter().find_map(|name| Some((name, variable(name)?))).filter(|(_, value)| !value.is_empty())
}

/// True if requests can be sent through a proxy at this address.
fn is_usable(proxy: &str) -> bool {
    let matcher = Matcher::builder().all(proxy.to_owned()).build();
    matcher.intercept(&Uri::from_static("http://host.example/")).is_some_and(|proxy| {
        let is_http = matches!(proxy.uri().scheme_str(), Some("http" | "https"));
        is_http && proxy.uri().authority().is_some_and(is_valid_authority)
    })
}

/// True if an authority has a host and either no port or a valid one.
fn is_valid_authority(authority: &Authority) -> bool {
    let port = authority.as_str().strip_prefix(authority.host()).and_then(|rest| rest.strip_prefix(':'));
    !authority.host().is_empty() && port.is_none_or(|port| port.parse::<u16>().is_ok_and(|port| port > 0))
}

/// Headers that the user cannot set, because the program or its HTTP library sets them.
const RESERVED: [&str; 9] = [
    "accept-encoding",
    "connection",
    "content-encoding",
    "content-length",
    "content-type",
    "expect",
    "host",
    "te",
    "transfer-encoding",
];

/// Headers that the user adds to every request to an endpoint. Secret values come from environment variables.
#[derive(Clone, Default)]
pub struct CustomHeaders {
    map: HeaderMap,
    /// Values from environment variables, both whole and without a leading word such as `Bearer`.
    secrets: Vec<String>,
}

impl std::fmt::Debug for CustomHeaders {
    /// Lists the header names without their values.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.map.keys()).finish()
    }
}

impl CustomHeaders {
    /// Parses `--header 'NAME: VALUE'` and `--header-env NAME=VARIABLE`.
    ///
    /// # Errors
    /// If a header cannot be sent, is named twice, has a secret in place of a variable, or names a variable that is not
    /// set. No error shows a value.
    pub(super) fn read(plain: &[String], from_variables: &[String]) -> Result<Self> {
        let mut headers = Self::default();
        for text in plain {
            headers.add_plain(text)?;
        }
        for text in from_variables {
            headers.add_from_variable(text)?;
        }
        Ok(headers)
    }

    /// Adds a header given as `NAME: VALUE`.
    fn add_plain(&mut self, text: &str) -> Result<()> {
        let (name, value) = text
            .split_once(':')
            .ok_or_else(|| Error::usage("--header", "'NAME: VALUE' expected, as 'X-Team: vision'"))?;
        let (name, value) = (name.trim(), value.trim());
        if is_secret_header(name, value) {
            return Err(Error::usage(
                "--header",
                format_args!(
                    "the value of {name} looks like a secret, which is not shown here; put it into a variable and name that: \
                 --header-env {name}=VARIABLE"
                ),
            ));
        }
        self.add(name, value, "--header")
    }

    /// Adds a header given as `NAME=VARIABLE`.
    fn add_from_variable(&mut self, text: &str) -> Result<()> {
        let (name, variable_name) = text
            .split_once('=')
            .ok_or_else(|| Error::usage("--header-env", "NAME=VARIABLE expected, as X-Auth=GATEWAY_TOKEN"))?;
        let (name, variable_name) = (name.trim(), variable_name.trim());
        if looks_like_key(variable_name) {
            return Err(Error::usage(
                "--header-env",
                format_args!(
                    "the value after {name}= looks like a secret, which is not shown here; put it into a variable and name that"
                ),
            ));
        }
        let value = variable(variable_name)
            .ok_or_else(|| Error::usage("--header-env", format_args!("the variable {variable_name} is not set")))?;
        let value = value.trim();
        self.add(name, value, "--header-env")?;
        self.secrets.push(value.to_owned());
        // A server may repeat the secret without its leading word: only the token of "Bearer …".
        if let Some((_, secret)) = value.split_once(' ') {
            self.secrets.push(secret.to_owned());
        }
        Ok(())
    }

    /// Adds a header. Errors name `flag`, the flag that the header comes from.
    fn add(&mut self, name: &str, value: &str, flag: &str) -> Result<()> {
        let Ok(header_name) = HeaderName::try_from(name) else {
            return Err(Error::usage(flag, "this is not a valid name of an HTTP header"));
        };
        if RESERVED.contains(&header_name.as_str()) {
            return Err(Error::usage(flag, format_args!("{name} is set by the program itself")));
        }
        let Ok(mut header_value) = HeaderValue::try_from(value) else {
            return Err(Error::usage(
                flag,
                format_args!("the value of {name} has characters that an HTTP header cannot carry"),
            ));
        };
        header_value.set_sensitive(flag == "--header-env");
        if self.map.insert(header_name, header_value).is_some() {
            return Err(Error::usage(flag, format_args!("{name} is named twice")));
        }
        Ok(())
    }

    /// Secret values to remove from everything that is stored.
    pub(super) fn secrets(&self) -> &[String] {
        &self.secrets
    }

    /// Adds these headers to the headers of a request.
    ///
    /// # Errors
    /// If the request already has a header of the same name, for the key or the account.
    pub(super) fn add_to(&self, headers: &mut HeaderMap) -> Result<()> {
        for (name, value) in &self.map {
            if headers.insert(name, value.clone()).is_some() {
                let problem = format_args!(
                    "{name} is sent already, with the key or the account: leave it out of --header and --header-env, or the key with --api-key-env none"
                );
                return Err(Error::usage("--header", problem));
            }
        }
        Ok(())
    }
}

/// Value of an environment variable; `None` if it is unset or blank.
pub(super) fn variable(name: &str) -> Option<String> {
    env::var(name).ok().filter(|text| !text.trim().is_empty())
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

    /// Variable with an unusable proxy for this address and environment.
    fn refused(base: &str, set: &[(&str, &str)]) -> Option<String> {
        let error = proxy_variable(&base.parse().unwrap(), |name| {
            set.iter().find(|(known, _)| *known == name).map(|(_, value)| value.into())
        })
        .err()?
        .to_string();
        assert!(!error.contains("pass"), "{error}");
        Some(error.split(':').next().unwrap_or_default().to_owned())
    }

    const PLAIN: &str = "http://llm.example/v1";

    const ENCRYPTED: &str = "https://llm.example/v1";

    #[test]
    fn unusable_proxies_are_refused() {
        for proxy in [
            "socks5://user:pass@127.0.0.1:1080",
            "ftp://proxy",
            "http://",
            "http:/proxy:3128",
            "http://:3128",
            "http://proxy:99999",
            "http://proxy:port",
            "http://proxy:0",
            "my proxy",
            " http://proxy:3128",
        ] {
            for (base, name) in [(PLAIN, "HTTP_PROXY"), (ENCRYPTED, "https_proxy"), (ENCRYPTED, "ALL_PROXY")] {
                let found = refused(base, &[(name, proxy)]);
                assert_eq!(found.as_deref(), Some(name), "{proxy}");
            }
        }
    }

    #[test]
    fn usable_proxies_are_accepted() {
        for proxy in ["", "http://proxy:3128", "https://user:pass@proxy", "proxy:3128", "http://[::1]:3128/"] {
            assert_eq!(refused(PLAIN, &[("HTTP_PROXY", proxy)]), None, "{proxy}");
        }
    }

    #[test]
    fn unused_proxies_are_not_checked() {
        let wrong = ("ALL_PROXY", "socks5://proxy");
        assert_eq!(refused("http://127.0.0.1:8000/v1", &[wrong]), None);
        assert_eq!(refused(PLAIN, &[wrong, ("HTTP_PROXY", "http://proxy")]), None);
        assert_eq!(refused(PLAIN, &[("HTTPS_PROXY", "socks5://proxy")]), None);
        for no_proxy in ["*", "llm.example", ".example, other"] {
            assert_eq!(refused(PLAIN, &[wrong, ("NO_PROXY", no_proxy)]), None);
        }
        let other = refused(PLAIN, &[wrong, ("NO_PROXY", "other")]);
        assert_eq!(other.as_deref(), Some("ALL_PROXY"));
    }

    fn read(plain: &[&str]) -> Result<CustomHeaders> {
        let plain: Vec<String> = plain.iter().map(|text| (*text).to_owned()).collect();
        CustomHeaders::read(&plain, &[])
    }

    #[test]
    fn headers_are_checked() {
        let headers = read(&["X-Team: a: b", "x-empty:"]).unwrap();
        assert_eq!(headers.map["x-team"], "a: b");
        assert_eq!(headers.map["x-empty"], "");
        for (wrong, part) in [
            (&["X-Team"][..], "'NAME: VALUE'"),
            (&["Content-Type: a/b"], "the program itself"),
            (&["a b: c"], "not a valid name"),
            (&["X-A: b", "x-a: c"], "twice"),
            (&["X-A: b\u{7f}"], "cannot carry"),
        ] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.starts_with("--header: ") && error.contains(part), "{error}");
        }
    }

    #[test]
    fn secrets_on_the_command_line_are_refused() {
        for secret in [
            "X-Any: sk-0123456789",
            "Authorization: Bearer abcdefghijklmnop",
            "X-Auth-Token: 0123456789abcdef0123",
            "Cookie: session=0123456789abcdef",
        ] {
            let error = read(&[secret]).unwrap_err().to_string();
            assert!(error.contains("--header-env"), "{error}");
            assert!(!error.contains("0123") && !error.contains("abcd"), "{error}");
        }
        assert!(read(&["X-Team: 0123456789abcdef0123"]).is_ok());
        let secret_as_variable = ["X-Auth=sk-0123456789".to_owned()];
        let error = CustomHeaders::read(&[], &secret_as_variable).unwrap_err().to_string();
        assert!(!error.contains("0123"), "{error}");
    }

    #[test]
    fn a_header_is_not_sent_twice() {
        let headers = read(&["X-Team: a"]).unwrap();
        let mut request = HeaderMap::new();
        headers.add_to(&mut request).unwrap();
        assert_eq!(request["x-team"], "a");
        assert!(headers.add_to(&mut request).is_err());
    }
}
