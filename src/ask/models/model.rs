//! The models that can be asked: [`Model`].

use serde_json::Value;

use super::local::Local;
use super::random::Random;
use super::remote::Remote;
use super::script::Script;
use crate::ask::batch;
use crate::ask::batch_api::BatchServer;
use crate::ask::costs::{Reservation, image_tokens};
use crate::ask::failures::AskError;
use crate::ask::requests::{Call, Message, Parameters};
use crate::error::Result;
use crate::types::{Digest, Reply};

/// A model, remote or in this process.
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
    /// The name in records and tables.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Remote(model) => model.name(),
            Self::Random(_) => Random::NAME,
            Self::Script(script) => script.name(),
            Self::Local(local) => local.name(),
        }
    }

    /// The content that decides a reply besides prompt and image: the model and its parameters, but not the address.
    #[must_use]
    pub fn content(&self) -> Value {
        match self {
            Self::Remote(model) => model.content(),
            Self::Random(random) => random.content(),
            Self::Script(script) => script.content(),
            Self::Local(local) => local.content(),
        }
    }

    /// The digest of [`Model::content`].
    ///
    /// # Errors
    /// If a number in it is not finite.
    pub fn digest(&self) -> Result<Digest> {
        Digest::canonical("darkqa.model/2", &self.content())
    }

    /// The number of questions that may be in flight at once; `None` for any number.
    #[must_use]
    pub fn width(&self) -> Option<usize> {
        match self {
            Self::Remote(model) => Some(model.width()),
            // It computes on the cores of this machine.
            Self::Local(_) => std::thread::available_parallelism().ok().map(usize::from),
            Self::Random(_) | Self::Script(_) => None,
        }
    }

    /// Whether both models are asked at one endpoint, whose window they share; or both are in this process.
    #[must_use]
    pub fn shares_endpoint(&self, other: &Self) -> bool {
        match (self.remote(), other.remote()) {
            (Some(one), Some(other)) => std::ptr::eq(one.endpoint(), other.endpoint()),
            (None, None) => true,
            _ => false,
        }
    }

    /// Stops further requests to the model's endpoint; those in flight are finished.
    pub fn close(&self) {
        if let Self::Remote(model) = self {
            model.endpoint().close();
        }
    }

    /// Whether the model is asked over a network, which can fail.
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.remote().is_some()
    }

    /// The changes to requests after the server refused a field; see [`Remote::adapted`].
    #[must_use]
    pub fn adapted(&self) -> Vec<String> {
        self.remote().map_or_else(Vec::new, Remote::adapted)
    }

    /// The number of tokens of an image of this width and height, in pixels; `None` if unknown.
    #[must_use]
    pub fn image_tokens(&self, width: u64, height: u64) -> Option<u64> {
        let Parameters { model, detail, .. } = self.remote()?.parameters();
        image_tokens(model, *detail, width, height)
    }

    /// The maximum number of tokens in a reply; `None` for models without this limit.
    #[must_use]
    pub fn max_tokens(&self) -> Option<u32> {
        Some(self.remote()?.parameters().max_tokens.get())
    }

    /// The most tokens that a reply is charged, hidden reasoning included, if the server keeps to its limits; `None` if no limit holds
    /// for all of them.
    pub(crate) fn reply_limit(&self) -> Option<u64> {
        self.remote()?.reply_limit()
    }

    /// The text of a request besides the question, in bytes: the system message.
    pub(crate) fn system_bytes(&self) -> usize {
        let system = self.remote().map(|model| &model.parameters().extra.system);
        system.and_then(Option::as_ref).map_or(0, String::len)
    }

    /// The token limit of its replies, if it is larger than the one that the run began with.
    pub(crate) fn grown_limit(&self) -> Option<u32> {
        self.remote()?.parameters().grown_limit()
    }

    /// The body of a request as it would be sent now; `None` for models without requests.
    #[must_use]
    pub fn body(
        &self,
        message: Message<'_>,
        choices: usize,
    ) -> Option<Result<Vec<u8>, serde_json::Error>> {
        Some(self.remote()?.body(message, choices))
    }

    /// One line of a Batch API's input file, with a line end; `None` if the model cannot be asked in a batch. `url` replaces
    /// the API's path in the line.
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

    /// The path in a line of a Batch API's file; `None` if the model cannot be asked in a batch.
    pub(crate) fn batch_url(&self) -> Option<&'static str> {
        Some(self.remote()?.batch_url())
    }

    /// The address of the files and batches of the model's endpoint, without secrets; `None` if the model is built in.
    pub(crate) fn batch_base(&self) -> Option<String> {
        Some(self.remote()?.endpoint().base().to_string())
    }

    /// The files and batches of the model's endpoint; `None` if the model is built in.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub(crate) fn batch_server(&self) -> Result<Option<BatchServer>> {
        let remote = self.remote();
        remote
            .map(|model| model.endpoint().batch_server())
            .transpose()
    }

    /// Whether the files and batches of both models are those of one account; false if one is built in.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub(crate) fn shares_account_with(&self, other: &Self) -> Result<bool> {
        match (self.remote(), other.remote()) {
            (Some(own), Some(other)) => own.endpoint().shares_account_with(other.endpoint()),
            _ => Ok(false),
        }
    }

    /// Adapts further requests to a refusal in the output of a batch, as after a refused request. Returns whether the request may
    /// succeed now.
    #[must_use]
    pub(crate) fn adapt_to_refusal(&self, status: u16, body: &[u8]) -> bool {
        let remote = self.remote();
        remote.is_some_and(|model| model.adapt_to_refusal(status, body))
    }

    fn remote(&self) -> Option<&Remote> {
        match self {
            Self::Remote(model) => Some(model),
            Self::Random(_) | Self::Script(_) | Self::Local(_) => None,
        }
    }

    /// Asks one question. The future may be dropped at any time, which gives up the request.
    pub async fn ask(&self, call: Call<'_>) -> Result<Reply, AskError> {
        self.ask_within(call, None).await
    }

    /// Asks one question; each of its requests holds this reservation while it is in flight.
    pub(crate) async fn ask_within(
        &self,
        call: Call<'_>,
        reservation: Option<&Reservation>,
    ) -> Result<Reply, AskError> {
        match self {
            Self::Remote(model) => {
                let choices = call.query.choices();
                model.ask_within(call.message, choices, reservation).await
            }
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
