//! `serve`: serves the built-in models at an OpenAI-compatible endpoint on loopback, for testing clients and for CI
//! without keys.
//!
//! `POST /v1/chat/completions` takes a multiple-choice question with or without an image and answers with a letter;
//! `GET /v1/models` lists the models. The observer must know which frame an image shows, and finds it by the image
//! alone ([`request`]). Only programs on this machine are answered, not web pages of other sites (`admission`).
//! Any key is accepted, and nothing is charged or stored.
//!
//! Admission of requests from programs on this machine, but not from web pages of other sites: [`admit`].
//!
//! Connections of the server, with limits for their number and for the time of clients: [`answer_until`].

mod completion;
mod request;

use std::convert::Infallible;
use std::future::{Future, poll_fn};
use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use clap::Args;
use hyper::body::{Body as _, Incoming};
use hyper::server::conn::http1;
use hyper::service::{HttpService, service_fn};
use hyper::{HeaderMap, Method, Request, Response, StatusCode, Uri, header};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use tokio::runtime;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use completion::{Completion, MemoryBound, RequestFault};
use darkqa_ask::{Call, Message, Model, Query, Random};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::Status;
use darkqa_base::types::{Choices, Decides, Digest, Evidence, Family, FrameId, Question, QuestionId};
use darkqa_data::{DataSource, RootArgs};
use darkqa_engine::images::progress::Progress;
use darkqa_engine::interrupt::Interrupt;
use darkqa_engine::observer::Observer;
use darkqa_questions::rules::Rules;
use darkqa_runs::Outcome;
use request::{AskedQuestion, FrameMatcher, MAX_PIXELS, ServedQuestion};

/// Maximum number of bytes of all bodies in flight (chosen). A body takes up to three times its size until it is
/// decoded.
const MAX_BODIES: usize = 2 * MAX_BODY;

/// Maximum number of requests answered in parallel; further ones wait (chosen).
const MAX_PARALLEL: usize = 16;

// Paths of the server.
const MODELS: &str = "/v1/models";
const COMPLETIONS: &str = "/v1/chat/completions";

/// The flags of `serve`.
#[derive(Debug, Args)]
pub(crate) struct ServeArgs {
    /// The frames that the observer knows: rooms:frames=N,seed=N,size=WIDTHxHEIGHT, or a folder of frames with maps
    #[arg(long, value_name = "DIR|rooms:…", value_parser = darkqa_data::parse_data_source, default_value_t, add = Decides::Reply)]
    pub data: DataSource,
    /// The port on 127.0.0.1, 0 for any that is free
    #[arg(long, value_name = "N", default_value_t = 8089, add = Decides::Nothing)]
    pub port: u16,
    /// The seed of the guesses
    #[arg(long, value_name = "N", default_value_t = 0, add = Decides::Pixels)]
    pub seed: u64,
    /// Further folders of the frames.
    #[command(flatten)]
    pub root: RootArgs,
}

/// The state that all requests share.
struct ServerState {
    frame_matcher: FrameMatcher,
    /// The models, by their names at this endpoint. The names differ from `observer` and `random`, which run without an
    /// endpoint.
    models: [(&'static str, Model); 2],
    /// Permits for answering requests.
    permits: Semaphore,
    /// Bytes of bodies in flight.
    bodies: MemoryBound,
    /// Pixels of decoded images in flight.
    pixels: MemoryBound,
    /// True after the first image that shows no frame.
    has_seen_unknown: AtomicBool,
}

/// Answers requests until the process is interrupted.
///
/// # Errors
/// If the frames cannot be read, or another process uses the port.
pub(crate) fn serve(args: &ServeArgs, progress: &Progress) -> Result<Outcome> {
    // Bind first, so that a used port is reported before any frame is drawn.
    let listener = bind(args.port)?;
    let dataset = Arc::new(args.data.open_without_questions(&args.root.data_root)?);
    let prior = Random { seed: args.seed };
    let observer = Observer::open(&dataset, &args.data, &args.root.data_root, &[], Rules::built_in()?)
        .map_err(|e| e.usage_at("--data"))?;
    let models =
        [("darkqa-observer", Model::Local(observer.model(None, prior))), ("darkqa-random", Model::Random(prior))];
    let state = Arc::new(ServerState {
        frame_matcher: FrameMatcher::new(&dataset, progress)?,
        models,
        permits: Semaphore::new(MAX_PARALLEL),
        bodies: MemoryBound::new(MAX_BODIES >> 10, 1 << 10, format!("bodies of more than {} MiB", MAX_BODIES >> 20)),
        pixels: MemoryBound::new(
            MAX_PIXELS / 1000,
            1000,
            format!("images of more than {} million pixels", MAX_PIXELS / 1_000_000),
        ),
        has_seen_unknown: AtomicBool::new(false),
    });
    let runtime = runtime::Builder::new_multi_thread().enable_all().build().map_err(|e| Error::usage("serve", e))?;
    runtime.block_on(listen(listener, state, progress))?;
    Ok(Outcome::text(Status::Complete, String::new()))
}

/// A non-blocking listener at a loopback port.
fn bind(port: u16) -> Result<TcpListener> {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    TcpListener::bind(address).and_then(|listener| listener.set_nonblocking(true).map(|()| listener)).map_err(|e| {
        let problem = format!("cannot listen at {address}: {e}; --port N takes another port, 0 any free one");
        Error::usage("--port", problem)
    })
}

async fn listen(listener: TcpListener, state: Arc<ServerState>, progress: &Progress) -> Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener).map_err(|e| Error::usage("--port", e))?;
    let address = listener.local_addr().map_err(|e| Error::usage("--port", e))?;
    let names: Vec<&str> = state.names().collect();
    progress.note(&format!("models: {}; no key is needed; Ctrl-C ends it", names.join(", ")));
    // A client may wait for the address on standard output. Ignore a closed output.
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "http://{address}/v1").and_then(|()| out.flush());
    drop(out);
    let port = address.port();
    let service = service_fn(move |request| {
        let state = Arc::clone(&state);
        async move {
            let answer = respond(&state, request, port).await;
            Ok::<_, Infallible>(answer.unwrap_or_else(Into::into))
        }
    });
    let mut interrupt = Interrupt::listen()?;
    // Dropped after the first interrupt, so that a second one ends the process at once.
    let interrupted = async move { interrupt.next().await };
    answer_until(listener, service, interrupted).await;
    Ok(())
}

/// Answers a request, if it is admitted.
async fn respond(state: &ServerState, request: Request<Incoming>, port: u16) -> Result<Response<String>, RequestFault> {
    admit(&request, port)?;
    match (request.method(), request.uri().path()) {
        (&Method::GET | &Method::HEAD, MODELS) => Ok(completion::models(state.names())),
        (&Method::POST, COMPLETIONS) => {
            // Read the body before taking a permit, so that a slow client does not block others.
            let (body, _share) = body(request.into_body(), &state.bodies).await?;
            let _permit = state.permits.acquire().await;
            Ok(state.answer(body).await?.into())
        }
        (_, path) => {
            let status = match path {
                MODELS | COMPLETIONS => StatusCode::METHOD_NOT_ALLOWED,
                _ => StatusCode::NOT_FOUND,
            };
            let message = format!("no such path; use GET {MODELS} or POST {COMPLETIONS}");
            Err(RequestFault::new(status, message))
        }
    }
}

impl ServerState {
    fn names(&self) -> impl Iterator<Item = &'static str> {
        self.models.iter().map(|(name, _)| *name)
    }

    async fn answer(&self, body: Vec<u8>) -> Result<Completion, RequestFault> {
        let request = ServedQuestion::parse(body, &self.pixels).await?;
        let model = self.models.iter().find(|(name, _)| *name == request.model);
        let (_, model) = model.ok_or_else(|| {
            let names: Vec<&str> = self.names().collect();
            let message = format!("the model {:?} is not one of {}", request.model, names.join(", "));
            RequestFault::new(StatusCode::NOT_FOUND, message).at("model", "model_not_found")
        })?;
        let parsed = AskedQuestion::parse(&request.text)?;
        let frame = request.image.as_ref().and_then(|image| self.frame_matcher.best_match(&image.rgb));
        if request.image.is_some() && frame.is_none() && !self.has_seen_unknown.swap(true, Relaxed) {
            tracing::warn!(
                "an image shows none of the {} frames of --data: about such images the observer guesses, too",
                self.frame_matcher.len()
            );
        }
        let text_digest = Digest::from_bytes(request.text.as_bytes()).to_string();
        let image = request.image.as_ref().map(|image| &image.payload);
        let images = image.map(std::slice::from_ref);
        let image_digest = image.map_or_else(String::new, |image| image.facts().digest.to_string());
        let question = Question {
            id: QuestionId(format!("{text_digest} {image_digest}")),
            family: Family::Other(String::new()),
            text: parsed.question,
            choices: Choices::new(parsed.choices, 0)
                .map_err(|e| RequestFault::new(StatusCode::BAD_REQUEST, e.to_string()))?,
            group: None,
            evidence: Evidence::default(),
            frame: frame.cloned().unwrap_or(FrameId(String::new())),
        };
        let call = Call {
            query: Query::Choice(&question),
            condition: None,
            message: Message {
                // An image that shows no frame of the data is not passed on.
                images: images.filter(|_| frame.is_some()).unwrap_or_default(),
                ..Message::text_only(&request.text)
            },
            turn: 0,
        };
        let reply = model
            .ask(call)
            .await
            .map_err(|e| RequestFault::new(StatusCode::INTERNAL_SERVER_ERROR, e.failure.message))?;
        Ok(Completion { model: request.model, text: reply.text, form: request.form })
    }
}

/// Maximum size of a request body, in bytes (chosen).
const MAX_BODY: usize = 64 << 20;

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
fn admit(request: &Request<Incoming>, port: u16) -> Result<(), RequestFault> {
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
async fn body(body: Incoming, bodies: &MemoryBound) -> Result<(Vec<u8>, OwnedSemaphorePermit), RequestFault> {
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

/// Maximum number of open connections; further ones wait (chosen).
const MAX_CONNECTIONS: usize = 64;

/// Maximum time for receiving the headers of a request, which also limits idle connections (chosen).
const HEADER_TIMEOUT: Duration = Duration::from_secs(10);

/// Time for finishing open requests after `end` (chosen).
const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(10);

/// Pause after a connection could not be accepted, for example because no file descriptor is free (chosen).
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Answers requests until `end`, then finishes the open ones.
async fn answer_until<S>(listener: tokio::net::TcpListener, service: S, end: impl Future<Output = ()>)
where
    S: HttpService<Incoming, ResBody = String, Error = Infallible, Future: Send> + Clone + Send + 'static,
{
    let free = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let open = GracefulShutdown::new();
    let mut end = std::pin::pin!(end);
    loop {
        let next = async {
            let permit = Arc::clone(&free).acquire_owned().await;
            (permit, listener.accept().await)
        };
        let (permit, accepted) = tokio::select! {
            () = &mut end => break,
            next = next => next,
        };
        let Ok((stream, _)) = accepted else {
            tokio::time::sleep(ACCEPT_PAUSE).await;
            continue;
        };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEADER_TIMEOUT)
            .serve_connection(TokioIo::new(stream), service.clone());
        let connection = open.watch(connection);
        tokio::spawn(async move {
            // Errors such as a broken connection or invalid HTTP concern only the client.
            let _ = connection.await;
            drop(permit);
        });
    }
    let _ = tokio::time::timeout(SHUTDOWN_TIMEOUT, open.shutdown()).await;
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
