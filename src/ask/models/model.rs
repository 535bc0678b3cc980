//! Remote and built-in models: [`Model`].

use std::sync::LazyLock;

use serde_json::Value;

use super::local::{Local, Random, Script};
use super::remote::Remote;
use crate::batch;
use crate::batch_api::BatchServer;
use crate::costs::{Reservation, image_tokens, scaling_image_tokens};
use crate::failures::AskError;
use crate::pace::HeldBack;
use crate::requests::{Call, ChangedSetting, Message, Parameters};
use darkqa_base::error::Result;
use darkqa_base::types::{Digest, Reply};

/// Number of CPU cores that the process may use; `None` if unknown. Counted once, because counting reads files of the
/// control group.
static CORES: LazyLock<Option<usize>> = LazyLock::new(|| std::thread::available_parallelism().ok().map(usize::from));

/// A model, at an endpoint or in this process.
#[derive(Debug)]
pub enum Model {
    /// A model at an endpoint.
    Remote(Box<Remote>),
    /// Random guesses, each choice equally likely.
    Random(Random),
    /// Replies from a file.
    Script(Script),
    /// Answers of a function in this process.
    Local(Local),
}

impl Model {
    /// Name in records and tables.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Remote(model) => model.name(),
            Self::Random(_) => Random::NAME,
            Self::Script(script) => script.name(),
            Self::Local(local) => local.name(),
        }
    }

    /// Everything besides prompt and image that decides a reply: the model and its parameters, but not the address.
    #[must_use]
    pub fn content(&self) -> Value {
        match self {
            Self::Remote(model) => model.content(),
            Self::Random(random) => random.content(),
            Self::Script(script) => script.content(),
            Self::Local(local) => local.content(),
        }
    }

    /// Digest of [`Model::content`].
    ///
    /// # Errors
    /// If a number in it is not finite.
    pub fn digest(&self) -> Result<Digest> {
        Digest::canonical("darkqa.model/2", &self.content())
    }

    /// Maximum number of questions in flight at the moment; `None` for any number.
    #[must_use]
    pub fn width(&self) -> Option<usize> {
        match self {
            Self::Remote(model) => Some(model.width()),
            // The function uses the CPU of this machine.
            Self::Local(_) => *CORES,
            Self::Random(_) | Self::Script(_) => None,
        }
    }

    /// True if both models are at the same endpoint, so that they share its window, or both are in this process.
    #[must_use]
    pub fn shares_endpoint(&self, other: &Self) -> bool {
        match (self.remote(), other.remote()) {
            (Some(one), Some(other)) => std::ptr::eq(one.endpoint(), other.endpoint()),
            (None, None) => true,
            _ => false,
        }
    }

    /// Stops further requests to the model's endpoint; requests in flight finish.
    pub fn close(&self) {
        if let Self::Remote(model) = self {
            model.endpoint().close();
        }
    }

    /// True if the model is at an endpoint.
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.remote().is_some()
    }

    /// Changes to requests after the server refused a field; see [`Remote::adapted`].
    #[must_use]
    pub fn adapted(&self) -> Vec<String> {
        self.remote().map_or_else(Vec::new, Remote::adapted)
    }

    /// Time for which requests to the model's endpoint had to wait for their turn so far; zero for built-in models.
    pub fn held_back(&self) -> HeldBack {
        self.remote().map_or_else(HeldBack::default, |model| model.endpoint().held_back())
    }

    /// Number of tokens of an image of this width and height, in pixels; `None` if unknown.
    #[must_use]
    pub fn image_tokens(&self, width: u64, height: u64) -> Option<u64> {
        let Parameters { model, detail, .. } = self.remote()?.parameters();
        image_tokens(model, *detail, width, height)
    }

    /// Number of tokens of an image of this width and height, in pixels, if the model has more of them for larger
    /// images; `None` if it does not, or if the number is unknown.
    pub fn scaling_image_tokens(&self, width: u64, height: u64) -> Option<u64> {
        let Parameters { model, detail, .. } = self.remote()?.parameters();
        scaling_image_tokens(model, *detail, width, height)
    }

    /// Service tier that requests ask for; `None` if they leave it to the server.
    pub fn service_tier(&self) -> Option<&str> {
        self.remote()?.parameters().extra.service_tier()
    }

    /// Maximum number of tokens in a reply; `None` for models without this limit.
    #[must_use]
    pub fn max_tokens(&self) -> Option<u32> {
        Some(self.remote()?.parameters().max_tokens.get())
    }

    /// Maximum number of charged tokens of a reply, including hidden reasoning; `None` if not all of them are limited.
    /// The server may exceed it.
    pub fn reply_limit(&self) -> Option<u64> {
        self.remote()?.reply_limit()
    }

    /// Length of the system message in bytes; 0 without one.
    pub fn system_bytes(&self) -> usize {
        self.remote().and_then(|model| model.parameters().extra.system.as_ref()).map_or(0, String::len)
    }

    /// Token limit of replies, if the run began with another one.
    pub fn changed_limit(&self) -> Option<u32> {
        self.remote()?.parameters().changed_limit()
    }

    /// Token limits of replies: the current one, and the one with which the run began. `None` if none is sent.
    pub fn token_limits(&self) -> Option<(u32, u32)> {
        let parameters = self.remote()?.parameters();
        Some((parameters.limit()?, parameters.first_limit()))
    }

    /// Settings that changed within the run; empty if none did.
    pub fn changed_settings(&self) -> &[ChangedSetting] {
        self.remote()
            .and_then(|model| model.parameters().origin.continued.as_ref())
            .map_or(&[], |continued| &continued.changes)
    }

    /// Flags of the settings that the server refused: they may change within the run.
    pub fn forced(&self) -> Vec<&'static str> {
        self.remote().map_or_else(Vec::new, Remote::forced)
    }

    /// True for the judge of open answers.
    pub fn is_judge(&self) -> bool {
        self.remote().is_some_and(|model| model.parameters().origin.is_judge)
    }

    /// Body of a request as it would be sent now; `None` for built-in models.
    #[must_use]
    pub fn body(&self, message: Message<'_>, choices: usize) -> Option<Result<Vec<u8>, serde_json::Error>> {
        Some(self.remote()?.body(message, choices))
    }

    /// A line of an input file for the Batch API, with a line end; `None` for built-in models. `url` is the path of the
    /// API in the line.
    ///
    /// # Errors
    /// If the line cannot be written as JSON.
    pub fn batch_line(
        &self,
        id: &str,
        url: &str,
        message: Message<'_>,
        choices: usize,
    ) -> Result<Option<Vec<u8>>, serde_json::Error> {
        let Some(model) = self.remote() else {
            return Ok(None);
        };
        let body = model.batch_body(message, choices)?;
        batch::input_line(id, url, &body).map(Some)
    }

    /// Path of the API in the lines of a batch file; `None` for built-in models.
    pub fn batch_url(&self) -> Option<&'static str> {
        Some(self.remote()?.batch_url())
    }

    /// Base URL for files and batches, without secrets; `None` for built-in models.
    pub fn batch_base(&self) -> Option<String> {
        Some(self.remote()?.endpoint().base().to_string())
    }

    /// Client for the Files and Batch APIs of the model's endpoint; `None` for built-in models.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub fn batch_server(&self) -> Result<Option<BatchServer>> {
        self.remote().map(|model| model.endpoint().batch_server()).transpose()
    }

    /// True if both models use the same account for files and batches; false for built-in models.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub fn shares_account_with(&self, other: &Self) -> Result<bool> {
        match (self.remote(), other.remote()) {
            (Some(own), Some(other)) => own.endpoint().shares_account_with(other.endpoint()),
            _ => Ok(false),
        }
    }

    /// Adapts further requests after a refusal in the output of a batch. Returns true if the request may succeed now.
    #[must_use]
    pub fn adapt_to_refusal(&self, status: u16, body: &[u8]) -> bool {
        self.remote().is_some_and(|model| model.adapt_to_refusal(status, body))
    }

    /// True if a line of a batch may have been refused for its content alone.
    #[must_use]
    pub fn may_refuse_content(&self, status: u16, body: &[u8]) -> bool {
        self.remote().is_some_and(|model| model.may_refuse_content(status, body))
    }

    fn remote(&self) -> Option<&Remote> {
        match self {
            Self::Remote(model) => Some(model),
            Self::Random(_) | Self::Script(_) | Self::Local(_) => None,
        }
    }

    /// Asks one question. Dropping the future abandons the request.
    pub async fn ask(&self, call: Call<'_>) -> Result<Reply, AskError> {
        self.ask_within(call, None, false).await
    }

    /// Asks one question; the reservation covers the cost of each of its requests. A question that timed out at a
    /// gateway in an earlier call (`has_timed_out`) is given up at the next timeout.
    pub async fn ask_within(
        &self,
        call: Call<'_>,
        reservation: Option<&Reservation>,
        has_timed_out: bool,
    ) -> Result<Reply, AskError> {
        match self {
            Self::Remote(model) => {
                let choices = call.query.choice_count();
                model.ask_within(call.message, choices, reservation, has_timed_out).await
            }
            Self::Random(random) => {
                let question = call.query.require_choices()?;
                Ok(Reply::local(random.answer(question, call)))
            }
            Self::Script(script) => script.answer(call.query.id(), call.condition),
            Self::Local(local) => {
                let question = call.query.require_choices()?;
                tokio::task::block_in_place(|| local.answer(question, call))
            }
        }
    }
}
