//! Stage 4, ask: a prompt and an image go out, a [`Reply`] comes back. The only asynchronous stage.
//!
//! [`Prompts`] turn a question into words, [`Payload`] an image into the text of a data URL; both are CPU work and done before.
//! A [`Model`] takes the two as the [`Message`] of a [`Call`]. [`OpenAi`] is a model behind an [`Endpoint`]; what belongs to one server (address,
//! key, connections, pauses) lives in the endpoint and is shared by all models asked there.

mod access;
pub mod batch;
pub mod bilinear;
mod body;
mod complaint;
mod endpoint;
mod escapes;
mod field;
mod image_limit;
mod image_tokens;
mod local;
mod openai;
pub mod openeqa;
mod pace;
mod parameters;
mod payload;
mod plain_png;
mod prices;
mod prompt;
mod random;
mod request;
mod response;
mod script;
mod secret;
mod stream;
mod url;
mod verdict;

pub use access::{Access, Authorities, KeyHeader};
pub use endpoint::{Endpoint, Sending};
pub use field::Refused;
pub use image_limit::ImageLimit;
pub use image_tokens::image_tokens;
pub use local::{Local, Opinion};
pub use openai::OpenAi;
pub use pace::{Bounds, Quota};
pub use parameters::{Constrain, Detail, Parameters, Temperature, TokenField};
pub use payload::{Format, Payload, Quality};
pub use prices::{Price, Prices};
pub use prompt::Prompts;
pub use random::Random;
pub use script::Script;
pub use secret::Secret;
pub use url::BaseUrl;

use std::sync::Arc;

use crate::types::{Condition, Digest, Failure, FailureKind, Question, QuestionId, Reply};

/// What is put to a model.
#[derive(Debug, Clone, Copy)]
pub enum Query<'a> {
    /// A question with choices.
    Choice(&'a Question),
    /// A question that is answered in words of one's own, by its name.
    Open(&'a QuestionId),
}

impl<'a> Query<'a> {
    /// The name of the question.
    #[must_use]
    pub fn id(self) -> &'a QuestionId {
        match self {
            Self::Choice(question) => &question.id,
            Self::Open(id) => id,
        }
    }

    /// How many choices there are; 0 where the answer is open.
    #[must_use]
    pub fn choices(self) -> usize {
        match self {
            Self::Choice(question) => question.choices.len(),
            Self::Open(_) => 0,
        }
    }

    /// The question with choices, for models that know no other.
    fn choice(self) -> Result<&'a Question, AskError> {
        match self {
            Self::Choice(question) => Ok(question),
            Self::Open(id) => Err(AskError {
                failure: failure(
                    FailureKind::Request,
                    format!("question {id} has no choices, and this model can only choose"),
                ),
                attempts: 0,
                reach: Reach::Endpoint,
                refused: None,
            }),
        }
    }
}

/// The one message of a conversation: words, images, and the words behind them.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// The words before the images; all of them where there are no images.
    pub before: &'a str,
    /// The images; none for a question put in words alone.
    pub images: &'a [Arc<Payload>],
    /// The words behind the images; empty for none.
    pub behind: &'a str,
}

impl<'a> Message<'a> {
    /// Words alone.
    #[must_use]
    pub fn words(before: &'a str) -> Self {
        Self {
            before,
            images: &[],
            behind: "",
        }
    }
}

/// Everything a model needs to answer one question.
#[derive(Debug, Clone, Copy)]
pub struct Call<'a> {
    /// The question; models made in process look at it, the others at the message.
    pub query: Query<'a>,
    /// What the images show; `None` where none are shown.
    pub condition: Option<&'a Condition>,
    /// The question in words, with its images.
    pub message: Message<'a>,
    /// How many times the question was put before, in whatever order of its choices.
    pub turn: u32,
}

/// Something that can be asked.
#[derive(Debug)]
pub enum Model {
    /// A model behind an OpenAI-compatible endpoint.
    OpenAi(OpenAi),
    /// Any choice, as likely as another.
    Random(Random),
    /// Replies out of a file.
    Script(Script),
    /// What a function says.
    Local(Local),
}

impl Model {
    /// The name in records and tables.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::OpenAi(model) => model.name(),
            Self::Random(_) => Random::NAME,
            Self::Script(script) => script.name(),
            Self::Local(local) => local.name(),
        }
    }

    /// The digest of what decides a reply besides prompt and image: the model and its parameters, not where it is asked.
    #[must_use]
    pub fn digest(&self) -> Digest {
        match self {
            Self::OpenAi(model) => model.digest(),
            Self::Random(random) => random.digest(),
            Self::Script(script) => script.digest(),
            Self::Local(local) => local.digest(),
        }
    }

    /// How many questions may be under way at once; `None` where it does not matter.
    #[must_use]
    pub fn width(&self) -> Option<usize> {
        match self {
            Self::OpenAi(model) => Some(model.endpoint().width()),
            // It works on this machine's own cores.
            Self::Local(_) => std::thread::available_parallelism().ok().map(usize::from),
            Self::Random(_) | Self::Script(_) => None,
        }
    }

    /// Lets nothing further go out to the model's endpoint; what is on the wire is finished.
    pub fn close(&self) {
        if let Self::OpenAi(model) = self {
            model.endpoint().close();
        }
    }

    /// Whether it is asked over a network, and so can fail for reasons of its own.
    #[must_use]
    pub fn is_remote(&self) -> bool {
        matches!(self, Self::OpenAi(_))
    }

    /// Puts one question. Dropping the future gives up the request and leaves nothing behind.
    pub async fn ask(&self, call: Call<'_>) -> Result<Reply, AskError> {
        match self {
            Self::OpenAi(model) => model.ask(call.message, call.query.choices()).await,
            Self::Random(random) => {
                let question = call.query.choice()?;
                Ok(Reply::local(random.answer(question, call)))
            }
            Self::Script(script) => script.answer(call.query.id(), call.condition),
            Self::Local(local) => {
                let question = call.query.choice()?;
                tokio::task::block_in_place(|| local.answer(question, call))
            }
        }
    }
}

/// How far a failure reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// This one request failed; another may succeed.
    Trial,
    /// Every further request to this model would fail alike: key, credit, address, name, parameters.
    Endpoint,
    /// None: it was given up because the run ends, and may not even have been sent.
    Interrupted,
}

/// Why no reply came.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", failure.message)]
pub struct AskError {
    /// What went wrong in the last try.
    pub failure: Failure,
    /// How many requests were sent.
    pub attempts: u32,
    /// Whether it is worth asking anything else.
    pub reach: Reach,
    /// The field that the server does not take, where it is one that can be sent otherwise.
    pub refused: Option<Refused>,
}

/// A failure without an HTTP status.
fn failure(kind: FailureKind, message: String) -> Failure {
    Failure {
        kind,
        status: None,
        message,
    }
}
