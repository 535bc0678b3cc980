//! The proxy that the environment sets: [`proxy_variable`].

use std::ffi::OsString;

use hyper::Uri;
use hyper::http::uri::Authority;
use hyper_util::client::proxy::matcher::Matcher;

use super::url::BaseUrl;
use crate::error::{Error, Result};

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
