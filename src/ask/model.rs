//! Something that can be asked: [`Model`].

use serde_json::Value;

use super::batch;
use super::call::{Call, Message};
use super::failure::AskError;
use super::image_tokens::image_tokens;
use super::local::Local;
use super::parameters::Parameters;
use super::random::Random;
use super::remote::Remote;
use super::script::Script;
use crate::error::Result;
use crate::types::{Digest, Reply};

/// Something that can be asked.
#[derive(Debug)]
pub enum Model {
    /// A model behind an endpoint.
    Remote(Remote),
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
            Self::Remote(model) => model.name(),
            Self::Random(_) => Random::NAME,
            Self::Script(script) => script.name(),
            Self::Local(local) => local.name(),
        }
    }

    /// What decides a reply besides prompt and image: the model and its parameters, not where it is asked.
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

    /// How many questions may be under way at once; `None` where it does not matter.
    #[must_use]
    pub fn width(&self) -> Option<usize> {
        match self {
            Self::Remote(model) => Some(model.endpoint().width()),
            // It works on this machine's own cores.
            Self::Local(_) => std::thread::available_parallelism().ok().map(usize::from),
            Self::Random(_) | Self::Script(_) => None,
        }
    }

    /// Lets nothing further go out to the model's endpoint; what is on the wire is finished.
    pub fn close(&self) {
        if let Self::Remote(model) = self {
            model.endpoint().close();
        }
    }

    /// Whether it is asked over a network, and so can fail for reasons of its own.
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.remote().is_some()
    }

    /// How its requests differ from the first one, because the server refused a field; see [`Remote::adapted`].
    #[must_use]
    pub fn adapted(&self) -> Vec<String> {
        self.remote().map_or_else(Vec::new, Remote::adapted)
    }

    /// The tokens that an image of this width and height has for it; `None` where that is not known.
    #[must_use]
    pub fn image_tokens(&self, width: u64, height: u64) -> Option<u64> {
        let Parameters { model, detail, .. } = self.remote()?.parameters();
        image_tokens(model, *detail, width, height)
    }

    /// The maximum number of tokens of a reply, if it has one.
    #[must_use]
    pub fn max_tokens(&self) -> Option<u32> {
        Some(self.remote()?.parameters().max_tokens.get())
    }

    /// One line of a Batch API's input file, with a line end; `None` if the model cannot be asked in a batch. `url` is the path
    /// that the line asks, if it is another than the one of the wire.
    ///
    /// # Errors
    /// If the line cannot be written as JSON.
    pub fn batch_line(
        &self,
        id: &str,
        url: Option<&str>,
        message: Message<'_>,
        choices: usize,
    ) -> Result<Option<Vec<u8>>, serde_json::Error> {
        let remote = self.remote();
        let Some((model, known)) = remote.and_then(|model| Some((model, model.batch_url()?)))
        else {
            return Ok(None);
        };
        let body = model.body(message, choices)?;
        batch::line(id, url.unwrap_or(known), &body).map(Some)
    }

    fn remote(&self) -> Option<&Remote> {
        match self {
            Self::Remote(model) => Some(model),
            Self::Random(_) | Self::Script(_) | Self::Local(_) => None,
        }
    }

    /// Puts one question. Dropping the future gives up the request and leaves nothing behind.
    pub async fn ask(&self, call: Call<'_>) -> Result<Reply, AskError> {
        match self {
            Self::Remote(model) => model.ask(call.message, call.query.choices()).await,
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
