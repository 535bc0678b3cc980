//! `serve`: serves the built-in models at an OpenAI-compatible endpoint on loopback, for testing clients and for CI
//! without keys.
//!
//! `POST /v1/chat/completions` takes a multiple-choice question with or without an image and answers with a letter;
//! `GET /v1/models` lists the models. The observer must know which frame an image shows, and finds it by the image
//! alone ([`frame_matcher`]). Only programs on this machine are answered, not web pages of other sites ([`admission`]).
//! Any key is accepted, and nothing is charged or stored.

mod admission;
mod completion;
mod connections;
mod frame_matcher;
mod memory;
mod parsed_question;
mod request;

use std::convert::Infallible;
use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

use clap::Args;
use hyper::body::Incoming;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use tokio::runtime;
use tokio::sync::Semaphore;

use crate::ask::{Call, Message, Model, Query, Random};
use crate::data::{self, DataPlace, Dataset, RootArgs};
use crate::engine::images::progress::Progress;
use crate::engine::interrupt::Interrupt;
use crate::engine::observer::Observer;
use crate::error::{Error, Result};
use crate::runs::Outcome;
use crate::types::manifests::Status;
use crate::types::{Choices, Decides, Digest, Family, FrameId, Question, QuestionId};
use darkqa_questions::rules::Rules;

use admission::{MAX_BODY, admit, body};
use completion::{Completion, RequestFault};
use frame_matcher::FrameMatcher;
use memory::MemoryBound;
use parsed_question::ParsedQuestion;
use request::{MAX_PIXELS, ServedQuestion};

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
    #[arg(long, value_name = "DIR|rooms:…", value_parser = data::parse_data_place, default_value_t, add = Decides::Reply)]
    pub data: DataPlace,
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
    let dataset = Arc::new(Dataset::open_without_questions(&args.data, &args.root.data_root)?);
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
    connections::answer_until(listener, service, interrupted).await;
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
        let parsed = ParsedQuestion::parse(&request.text)?;
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
            evidence: serde_json::Value::Null,
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
