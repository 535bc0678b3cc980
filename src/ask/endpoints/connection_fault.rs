//! Causes of failed connections: [`permanent_cause`] and [`is_unknown_host`] search the error text of the HTTP client,
//! [`lacks_open_files`] inspects the error itself.

use std::error::Error;
use std::io;

/// Phrases in errors that a retry does not solve, with the remedy.
const PERMANENT_CAUSES: [(&[&str], &str); 8] = [
    (
        &["UnknownIssuer", "self-signed", "self signed"],
        "its certificate is signed by an authority that is not trusted; name that authority, or the certificate itself, with --ca-file",
    ),
    (
        &["CaUsedAsEndEntity"],
        "its certificate is that of an authority (CA:TRUE) and is not trusted; name it with --ca-file, or make one with \
         basicConstraints=CA:FALSE",
    ),
    (
        &["certificate expired", "certificate not valid yet", "NotValidYet", "Expired"],
        "its certificate is not valid at the time of this machine; renew it, or set the clock",
    ),
    (
        &["NotValidForName", "certificate not valid for name"],
        "its certificate is for another host name; use the name in the certificate as --base-url",
    ),
    (
        &["invalid peer certificate"],
        "its certificate is rejected; make another one, or name the authority with --ca-file",
    ),
    (
        &["proxy authorization required", "proxy authentication required"],
        "the proxy asks for a user and password: set them in HTTPS_PROXY, or name the host in NO_PROXY",
    ),
    (
        &["failed to create underlying connection: received corrupt message"],
        "the proxy speaks plain http at this port; give it as http:// in that variable",
    ),
    (
        &["InvalidContentType", "corrupt message"],
        "the server speaks plain http at this port; use http:// in --base-url",
    ),
];

/// Phrases in errors of plain HTTP requests to a TLS port.
const TLS_PORT: [&str; 2] = ["invalid HTTP version parsed", "received invalid HTTP"];

/// Remedy for a connection error that a retry does not solve; `None` for other errors. `is_plain` is true for http://
/// addresses.
pub(super) fn permanent_cause(text: &str, is_plain: bool) -> Option<&'static str> {
    if is_plain {
        let is_tls = TLS_PORT.iter().any(|phrase| text.contains(phrase));
        return is_tls.then_some(
            "the server does not answer in plain http at this port; if it speaks TLS, use https:// in --base-url",
        );
    }
    PERMANENT_CAUSES
        .iter()
        .find(|(phrases, _)| phrases.iter().any(|phrase| text.contains(phrase)))
        .map(|(_, remedy)| *remedy)
}

/// Remedy for a host name that DNS does not know.
pub(super) const UNKNOWN_HOST: &str = "no name server knows this host; check --base-url and the proxy settings, and that the server is started and this machine is online";

/// Phrases of glibc, musl, macOS and Windows for a host name that does not exist. A DNS outage has other phrases.
const UNKNOWN_HOST_PHRASES: [&str; 5] = [
    "Name or service not known",
    "No address associated with hostname",
    "Name does not resolve",
    "nodename nor servname provided",
    "No such host is known",
];

/// True if the error text reports that the host name does not exist.
pub(super) fn is_unknown_host(text: &str) -> bool {
    UNKNOWN_HOST_PHRASES.iter().any(|phrase| text.contains(phrase))
}

/// Error codes for too many open files, in this process or in the system: EMFILE and ENFILE; on Windows WSAEMFILE.
const TOO_MANY_FILES: &[i32] = if cfg!(windows) { &[10_024] } else { &[24, 23] };

/// True if a request failed because the system allows no further open file or connection.
pub(super) fn lacks_open_files(error: &(dyn Error + 'static)) -> bool {
    error
        .downcast_ref::<io::Error>()
        .and_then(io::Error::raw_os_error)
        .is_some_and(|code| TOO_MANY_FILES.contains(&code))
        || error.source().is_some_and(lacks_open_files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permanent_causes_have_a_remedy() {
        for (text, is_plain, remedy) in [
            ("invalid peer certificate: UnknownIssuer", false, "--ca-file"),
            ("invalid peer certificate: Other(OtherError(CaUsedAsEndEntity))", false, "CA:FALSE"),
            ("invalid peer certificate: certificate expired: x", false, "clock"),
            ("client error (Connect): proxy authorization required", false, "HTTPS_PROXY"),
            ("received corrupt message of type InvalidContentType", false, "http:// in --base-url"),
            (
                "tunnel error: failed to create underlying connection: received corrupt message of type InvalidContentType",
                false,
                "the proxy speaks plain http",
            ),
            ("client error: invalid HTTP version parsed", true, "https://"),
        ] {
            let cause = permanent_cause(text, is_plain).unwrap();
            assert!(cause.contains(remedy), "{text}: {cause}");
        }
        for text in ["tcp connect error: Connection refused", "connection reset by peer"] {
            assert_eq!(permanent_cause(text, false), None);
            assert_eq!(permanent_cause(text, true), None);
        }
    }

    #[test]
    fn a_dns_outage_is_not_an_unknown_host() {
        let lookup = "dns error: failed to lookup address information: ";
        assert!(is_unknown_host(&format!("{lookup}Name or service not known")));
        assert!(!is_unknown_host(&format!("{lookup}Temporary failure in name resolution")));
    }

    #[cfg(unix)]
    #[test]
    fn too_many_open_files_are_found_among_causes() {
        #[derive(Debug, thiserror::Error)]
        #[error("outer")]
        struct Outer(#[source] io::Error);
        assert!(lacks_open_files(&Outer(io::Error::from_raw_os_error(24))));
        assert!(!lacks_open_files(&Outer(io::Error::from_raw_os_error(111))));
        assert!(!lacks_open_files(&Outer(io::Error::other("Too many open files"))));
    }
}
