//! The requests that are answered: those of programs on this machine, and of no page of another site: [`admit`].

use std::future::poll_fn;
use std::pin::Pin;
use std::time::Duration;

use hyper::body::{Body as _, Incoming};
use hyper::{HeaderMap, Method, Request, StatusCode, Uri, header};

use super::completion::RequestFault;

/// The maximum size of a request in bytes (chosen).
const LARGEST: usize = 64 << 20;
/// How long a client may take for the body of a request. Chosen.
const BODY_TIME: Duration = Duration::from_mins(1);
/// The names of this machine for itself.
const LOOPBACK: [&str; 3] = ["127.0.0.1", "localhost", "[::1]"];

/// Checks the headers of a request to this port.
///
/// A page in a browser may send requests here: its own name then stands in `Host` if it has a name that leads to this machine (DNS
/// rebinding), and else in `Origin`; and without asking first it can send no JSON.
///
/// # Errors
/// 421 for another host, 403 for a page of another site, 415 for a body that is not JSON.
pub(super) fn admit(request: &Request<Incoming>, port: u16) -> Result<(), RequestFault> {
    let headers = request.headers();
    let host = request
        .uri()
        .authority()
        .map(|authority| authority.as_str().to_owned())
        .or_else(|| text(headers, header::HOST));
    let is_here = host.as_deref().is_some_and(|host| is_here(host, port));
    if !is_here {
        let message = format!("the host is neither 127.0.0.1:{port} nor localhost:{port}");
        return Err(RequestFault::new(StatusCode::MISDIRECTED_REQUEST, message));
    }
    let origin = headers.get(header::ORIGIN);
    if origin.is_some_and(|origin| !origin.to_str().is_ok_and(is_local_page)) {
        let message = "requests from pages of other sites are not answered";
        return Err(RequestFault::new(StatusCode::FORBIDDEN, message));
    }
    let kind = text(headers, header::CONTENT_TYPE).unwrap_or_default();
    let kind = kind.split(';').next().unwrap_or_default().trim();
    if request.method() == Method::POST && !kind.eq_ignore_ascii_case("application/json") {
        let message = "the header Content-Type: application/json is missing";
        return Err(RequestFault::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            message,
        ));
    }
    Ok(())
}

/// The body of a request.
///
/// # Errors
/// If it is too large, does not arrive in time, or breaks off.
pub(super) async fn body(body: Incoming) -> Result<Vec<u8>, RequestFault> {
    let too_large = || {
        let message = format!(
            "the body is incomplete, or has more than {} MiB",
            LARGEST >> 20
        );
        RequestFault::new(StatusCode::PAYLOAD_TOO_LARGE, message)
    };
    // What the client says of its length.
    if body.size_hint().lower() > LARGEST as u64 {
        return Err(too_large());
    }
    let read = tokio::time::timeout(BODY_TIME, whole(body)).await;
    let read = read.map_err(|_| {
        let message = format!("the body did not arrive within {} s", BODY_TIME.as_secs());
        RequestFault::new(StatusCode::REQUEST_TIMEOUT, message)
    })?;
    read.ok_or_else(too_large)
}

/// All bytes of a body; `None` if it is too large or breaks off.
async fn whole(mut body: Incoming) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    while let Some(frame) = poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await {
        // A frame without data is of trailers, which are ignored.
        let data = frame.ok()?.into_data().unwrap_or_default();
        if bytes.len() + data.len() > LARGEST {
            return None;
        }
        bytes.extend_from_slice(&data);
    }
    Some(bytes)
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<String> {
    let mut values = headers.get_all(name).into_iter();
    let first = values.next()?.to_str().ok()?.to_owned();
    values.next().is_none().then_some(first)
}

/// Whether a host with its port is this server.
fn is_here(host: &str, port: u16) -> bool {
    LOOPBACK
        .iter()
        .any(|name| host.eq_ignore_ascii_case(&format!("{name}:{port}")))
}

/// Whether an origin is a page of this machine, on any port.
fn is_local_page(origin: &str) -> bool {
    let Ok(origin) = origin.parse::<Uri>() else {
        return false;
    };
    let is_http = matches!(origin.scheme_str(), Some("http" | "https"));
    is_http && origin.host().is_some_and(|host| LOOPBACK.contains(&host))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pages_of_this_machine_are_local() {
        for origin in [
            "http://localhost:3000",
            "http://127.0.0.1",
            "http://[::1]:8",
        ] {
            assert!(is_local_page(origin), "{origin}");
        }
        for origin in [
            "null",
            "http://evil.example",
            "http://localhost.evil.example",
            "http://127.0.0.1.evil.example:8089",
            "file://localhost",
        ] {
            assert!(!is_local_page(origin), "{origin}");
        }
        assert!(is_here("localhost:80", 80) && is_here("LOCALHOST:80", 80));
        assert!(!is_here("localhost", 80) && !is_here("localhost:81", 80));
    }
}
