//! Admission of requests from programs on this machine, but not from web pages of other sites: [`admit`].

use std::future::poll_fn;
use std::pin::Pin;
use std::time::Duration;

use hyper::body::{Body as _, Incoming};
use hyper::{HeaderMap, Method, Request, StatusCode, Uri, header};
use tokio::sync::OwnedSemaphorePermit;

use super::completion::RequestFault;
use super::memory::MemoryBound;

/// Maximum size of a request body, in bytes (chosen).
pub(super) const MAX_BODY: usize = 64 << 20;
/// Maximum time for receiving the body of a request (chosen).
const BODY_TIMEOUT: Duration = Duration::from_mins(1);
/// Host names of the loopback interface.
const LOOPBACK: [&str; 3] = ["127.0.0.1", "localhost", "[::1]"];

/// Checks the headers of a request to this port.
///
/// A web page in a browser may send requests to loopback. If its domain resolves to this machine (DNS rebinding),
/// `Host` has that domain; otherwise `Origin` has the site of the page. Without a CORS preflight, a page cannot send
/// JSON.
///
/// # Errors
/// 421 for another host, 403 for a page of another site, 415 for a body that is not JSON.
pub(super) fn admit(request: &Request<Incoming>, port: u16) -> Result<(), RequestFault> {
    let headers = request.headers();
    let host = request
        .uri()
        .authority()
        .map(|authority| authority.as_str().to_owned())
        .or_else(|| header_text(headers, header::HOST));
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
    let kind = header_text(headers, header::CONTENT_TYPE).unwrap_or_default();
    let kind = kind.split(';').next().unwrap_or_default().trim();
    if request.method() == Method::POST && !kind.eq_ignore_ascii_case("application/json") {
        let message = "the header Content-Type: application/json is missing";
        return Err(RequestFault::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, message));
    }
    Ok(())
}

/// The body of a request, with its share of the bytes that all bodies may have together.
///
/// # Errors
/// If it is too large, does not arrive in time, or breaks off; 503 if other bodies have all bytes.
pub(super) async fn body(
    body: Incoming,
    bodies: &MemoryBound,
) -> Result<(Vec<u8>, OwnedSemaphorePermit), RequestFault> {
    // Check the announced length first. A body without one may be as long as allowed.
    if body.size_hint().lower() > MAX_BODY as u64 {
        return Err(too_large());
    }
    let length = body.size_hint().exact().map_or(MAX_BODY, |n| n as usize);
    let share = bodies.take(length).await?;
    tokio::time::timeout(BODY_TIMEOUT, read_all(body))
        .await
        .map_err(|_| {
            let message = format!("the body did not arrive within {} s", BODY_TIMEOUT.as_secs());
            RequestFault::new(StatusCode::REQUEST_TIMEOUT, message)
        })?
        .ok_or_else(too_large)
        .map(|bytes| (bytes, share))
}

fn too_large() -> RequestFault {
    let message = format!("the body is incomplete, or has more than {} MiB", MAX_BODY >> 20);
    RequestFault::new(StatusCode::PAYLOAD_TOO_LARGE, message)
}

/// All bytes of a body; `None` if it is too large or breaks off.
async fn read_all(mut body: Incoming) -> Option<Vec<u8>> {
    let announced = body.size_hint().exact().unwrap_or_default() as usize;
    let mut bytes = Vec::with_capacity(announced.min(MAX_BODY));
    while let Some(frame) = poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await {
        // A frame without data contains trailers, which are ignored.
        let data = frame.ok()?.into_data().unwrap_or_default();
        if bytes.len() + data.len() > MAX_BODY {
            return None;
        }
        bytes.extend_from_slice(&data);
    }
    Some(bytes)
}

/// The value of a header; `None` if it is missing, repeated or not text.
fn header_text(headers: &HeaderMap, name: header::HeaderName) -> Option<String> {
    let mut values = headers.get_all(name).into_iter();
    let first = values.next()?.to_str().ok()?.to_owned();
    values.next().is_none().then_some(first)
}

/// True if a host with a port is this server.
fn is_here(host: &str, port: u16) -> bool {
    LOOPBACK.iter().any(|name| host.eq_ignore_ascii_case(&format!("{name}:{port}")))
}

/// True if an origin is a page from this machine, on any port.
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
        for origin in ["http://localhost:3000", "http://127.0.0.1", "http://[::1]:8"] {
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
