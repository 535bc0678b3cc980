//! `serve`: the built-in models at an OpenAI-compatible endpoint on loopback, for trying clients and for CI without keys.
//!
//! `POST /v1/chat/completions` takes a multiple-choice question with or without an image and answers with a letter; `GET
//! /v1/models` lists the models. The observer must know which frame an image shows, and finds it by the image alone
//! (`recognise`). Only requests of programs on this machine are answered, and of no page of another site (`admission`). Any key is
//! accepted, and nothing is charged or stored.

mod admission;
mod completion;
mod connections;
mod puzzle;
mod recognise;
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
use crate::dataset::{self, DataPlace, Dataset, RootArgs};
use crate::engine::interrupt::Interrupt;
use crate::engine::observer::Observer;
use crate::error::{Error, Result};
use crate::images::progress::Progress;
use crate::runs::Outcome;
use crate::types::manifests::Status;
use crate::types::{Choices, Decides, Digest, Family, FrameId, Question, QuestionId};
use darkqa_questions::rules::Rules;

use admission::{admit, body};
use completion::{Completion, RequestFault};
use puzzle::Puzzle;
use recognise::FrameMatcher;
use request::ServedQuestion;

/// The requests that are answered at once; further ones wait. Chosen.
const AT_ONCE: usize = 16;

/// The paths of the server.
const MODELS: &str = "/v1/models";
const COMPLETIONS: &str = "/v1/chat/completions";

/// The flags of `serve`.
#[derive(Debug, Args)]
pub(crate) struct ServeArgs {
    /// The frames that the observer knows: rooms:frames=N,seed=N,size=WIDTHxHEIGHT, or a folder of frames with maps
    #[arg(long, value_name = "DIR|rooms:…", value_parser = dataset::parse_data_place, default_value_t, add = Decides::Reply)]
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
    likenesses: FrameMatcher,
    /// The models by their names at this endpoint. They differ from `--model observer`, which runs without an endpoint.
    models: [(&'static str, Model); 2],
    /// Places for requests that are answered.
    places: Semaphore,
    /// Whether an image has come that shows no frame.
    met_unknown: AtomicBool,
}

/// Answers requests until the process is interrupted.
///
/// # Errors
/// If the frames cannot be read, or another process uses the port.
pub(crate) fn serve(args: &ServeArgs, progress: &Progress) -> Result<Outcome> {
    // A port that is taken is an error before any frame is drawn.
    let listener = bind(args.port)?;
    let dataset = Arc::new(Dataset::open_without_questions(
        &args.data,
        &args.root.data_root,
    )?);
    let prior = Random { seed: args.seed };
    let observer = Observer::open(&dataset, &args.data, &[], Rules::built_in()?);
    let observer = observer.map_err(|e| e.usage_at("--data"))?;
    let models = [
        ("darkqa-observer", Model::Local(observer.model(None, prior))),
        ("darkqa-random", Model::Random(prior)),
    ];
    let likenesses = FrameMatcher::new(&dataset, progress)?;
    let state = Arc::new(ServerState {
        likenesses,
        models,
        places: Semaphore::new(AT_ONCE),
        met_unknown: AtomicBool::new(false),
    });
    let runtime = runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|e| Error::usage("serve", e))?;
    runtime.block_on(listen(listener, state, progress))?;
    Ok(Outcome::text(Status::Complete, String::new()))
}

/// A listener at a port of this machine.
fn bind(port: u16) -> Result<TcpListener> {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let listener = TcpListener::bind(address);
    let listener = listener.and_then(|listener| listener.set_nonblocking(true).map(|()| listener));
    listener.map_err(|e| {
        let problem =
            format!("cannot listen at {address}: {e}; --port N takes another port, 0 any free one");
        Error::usage("--port", problem)
    })
}

async fn listen(listener: TcpListener, state: Arc<ServerState>, progress: &Progress) -> Result<()> {
    let unusable = |e| Error::usage("--port", e);
    let listener = tokio::net::TcpListener::from_std(listener).map_err(unusable)?;
    let address = listener.local_addr().map_err(unusable)?;
    let names: Vec<&str> = state.names().collect();
    progress.note(&format!(
        "models: {}; no key is needed; Ctrl-C ends it",
        names.join(", ")
    ));
    // A client may wait for the address on standard output. A closed output is ignored.
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
    connections::answer_until(listener, service, interrupt.next()).await;
    Ok(())
}

/// Answers a request if it may be answered.
async fn respond(
    state: &ServerState,
    request: Request<Incoming>,
    port: u16,
) -> Result<Response<String>, RequestFault> {
    admit(&request, port)?;
    match (request.method(), request.uri().path()) {
        (&Method::GET | &Method::HEAD, MODELS) => Ok(completion::models(state.names())),
        (&Method::POST, COMPLETIONS) => {
            // Before a place is taken: a slow client holds none.
            let body = body(request.into_body()).await?;
            let _place = state.places.acquire().await;
            Ok(state.answer(&body).await?.into())
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

    async fn answer(&self, body: &[u8]) -> Result<Completion, RequestFault> {
        let request = ServedQuestion::read(body)?;
        let model = self.models.iter().find(|(name, _)| *name == request.model);
        let (_, model) = model.ok_or_else(|| {
            let names: Vec<&str> = self.names().collect();
            let message = format!(
                "the model {:?} is not one of {}",
                request.model,
                names.join(", ")
            );
            RequestFault::new(StatusCode::NOT_FOUND, message).at("model", "model_not_found")
        })?;
        let puzzle = Puzzle::read(&request.text)?;
        let frame = request
            .image
            .as_ref()
            .and_then(|(image, _)| self.likenesses.best_match(image));
        if request.image.is_some() && frame.is_none() && !self.met_unknown.swap(true, Relaxed) {
            tracing::warn!(
                "an image shows none of the {} frames of --data: about such images the observer guesses, too",
                self.likenesses.len()
            );
        }
        let words = Digest::from_bytes(request.text.as_bytes()).to_string();
        let image = request.image.as_ref().map(|(_, payload)| payload);
        let images = image.map(std::slice::from_ref);
        let seen = image.map_or_else(String::new, |image| image.facts().digest.to_string());
        let question = Question {
            id: QuestionId(format!("{words} {seen}")),
            family: Family::Other(String::new()),
            text: puzzle.question,
            choices: Choices::new(puzzle.choices, 0)
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
        Ok(Completion {
            model: request.model,
            text: reply.text,
            form: request.form,
        })
    }
}
