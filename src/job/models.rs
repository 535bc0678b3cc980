//! The models of a run: their flags ([`ModelArgs`]), settings ([`AskSettings`]) and the opened models (`ModelUnderTest`).

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use clap::Args;
use serde_json::{Value, json};
use strsim::damerau_levenshtein;

use crate::ask::{AccessArgs, Endpoint, Model, Parameters, Remote, Script, Sending, Server};
use crate::error::{Error, Result};
use crate::types::{Condition, Control, Decides, View};

/// Flags that name the models to ask.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Model")]
pub(crate) struct ModelArgs {
    /// The model to ask, by its name at the endpoint; repeatable; built in: observer (frames with maps), its controls
    /// (observer:CONTROL), random, script:FILE; default: none, one must be named
    #[arg(long, value_name = "NAME", add = Decides::Trials)]
    pub model: Vec<ModelName>,
    /// Show the models no image, only text
    #[arg(long, add = Decides::Trials)]
    pub blind: bool,
    /// Add a text-only baseline by this model; repeatable; default: none
    #[arg(long, value_name = "NAME", add = Decides::Trials)]
    pub blind_model: Vec<ModelName>,
}

impl ModelArgs {
    /// Whether neither `--model` nor `--blind-model` names a model.
    pub(crate) fn is_empty(&self) -> bool {
        self.model.is_empty() && self.blind_model.is_empty()
    }
}

/// A model as flags name it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ModelName {
    /// Built-in model that guesses.
    Random,
    /// Built-in model that answers what can still be read from the pixels by one who knows the frame; or one of its controls.
    Observer(Option<Control>),
    /// Built-in model that answers from this file.
    Script(PathBuf),
    /// Model of this name at the endpoint.
    Remote(String),
}

/// The built-in models that need no file.
const BUILT_IN_NAMES: [&str; 2] = ["random", "observer"];

impl ModelName {
    /// Checks that the model can answer an open question.
    ///
    /// # Errors
    /// If it can only choose.
    pub(crate) fn require_open_answers(&self) -> Result<()> {
        let name = match self {
            Self::Random => "random",
            Self::Observer(_) => "observer",
            Self::Script(_) | Self::Remote(_) => return Ok(()),
        };
        let problem = format_args!("{name} can only choose, and these questions are open");
        Err(Error::usage("--model", problem))
    }
}

impl FromStr for ModelName {
    type Err = String;

    /// Reads a name. One that is similar to a built-in model's is refused, because it would be sent to an endpoint.
    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let near = |name: &&&str| damerau_levenshtein(name, &text.to_lowercase()) <= 2;
        if let Some(control) = text.strip_prefix("observer:") {
            return Ok(Self::Observer(Some(control.parse()?)));
        }
        match text {
            "" => Err("the name of a model is empty".to_owned()),
            "random" => Ok(Self::Random),
            "observer" => Ok(Self::Observer(None)),
            "script" => Err("script:FILE expected, a file of replies".to_owned()),
            name => match (
                name.strip_prefix("script:"),
                BUILT_IN_NAMES.iter().find(near),
            ) {
                (Some(path), _) => Ok(Self::Script(path.into())),
                (None, Some(built_in)) => {
                    Err(format!("did you mean the built-in model {built_in}?"))
                }
                (None, None) => Ok(Self::Remote(name.to_owned())),
            },
        }
    }
}

/// The models to ask, their parameters and their endpoint with its key.
#[derive(Debug)]
pub(crate) struct AskSettings {
    /// Models that `--model` names.
    pub models: Vec<ModelName>,
    /// Whether `models` see the images.
    pub view: View,
    /// Models of the text-only baseline.
    pub blind_models: Vec<ModelName>,
    /// The endpoint; `None` if all models are built in.
    pub server: Option<Server>,
    /// Parameters of every request; the name is set for each model.
    pub parameters: Parameters,
}

impl AskSettings {
    /// The settings of these flags. The key is read if a model needs one.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub(super) fn resolve(
        args: ModelArgs,
        parameters: Parameters,
        access: &AccessArgs,
        sending: Sending,
    ) -> Result<Self> {
        let mut all = args.model.iter().chain(&args.blind_model);
        let remote = all.any(|name| matches!(name, ModelName::Remote(_)));
        Ok(Self {
            view: if args.blind { View::Blind } else { View::Image },
            server: remote.then(|| access.server(sending)).transpose()?,
            models: args.model,
            blind_models: args.blind_model,
            parameters,
        })
    }
}

/// Name of the endpoint of built-in models in messages.
const BUILT_IN: &str = "built-in models";

/// One model and whether it sees the images.
#[derive(Debug, Clone)]
pub(crate) struct ModelUnderTest {
    pub(crate) model: Arc<Model>,
    /// Digest of the settings that decide the model's replies ([`Model::digest`]). Computed once, because it enters every trial key.
    pub(crate) digest: Arc<str>,
    pub(crate) view: View,
    /// Address of its endpoint; `None` if it is built in.
    pub(crate) address: Option<String>,
}

impl ModelUnderTest {
    pub(crate) fn new(model: Model, view: View, server: Option<&Server>) -> Result<Self> {
        let server = server.filter(|_| model.is_remote());
        Ok(Self {
            digest: model.digest()?.to_string().into(),
            address: server.map(|server| server.access.base.to_string()),
            model: Arc::new(model),
            view,
        })
    }

    /// Name of its endpoint for messages: the address, or that it is built in.
    pub(crate) fn endpoint_name(&self) -> &str {
        self.address.as_deref().unwrap_or(BUILT_IN)
    }
}

/// The opened models, those that see images and those that do not. A model that is named twice is an error. Nothing is sent.
/// `added` are asked too, with images, although no flag names them. `built_in` makes the built-in models that only one
/// experiment has.
pub(crate) fn open_all(
    ask: &AskSettings,
    added: &[ModelName],
    built_in: impl Fn(&ModelName) -> Result<Model>,
) -> Result<Vec<ModelUnderTest>> {
    let server = ask.server.as_ref();
    let endpoint = endpoint(server)?;
    let named = ask.models.iter().map(|name| (name, ask.view));
    let named = named.chain(added.iter().map(|name| (name, View::Image)));
    let blind = ask.blind_models.iter().map(|name| (name, View::Blind));
    let mut models: Vec<ModelUnderTest> = Vec::new();
    for (name, view) in named.chain(blind) {
        let model = match name {
            ModelName::Random | ModelName::Observer(_) => built_in(name)?,
            name => open(name, endpoint.as_ref(), &ask.parameters)?,
        };
        let name = model.name();
        let mut others = models.iter();
        if others.any(|other| other.view == view && other.model.name() == name) {
            let problem = format_args!("{name} is named twice");
            return Err(Error::usage("--model", problem));
        }
        models.push(ModelUnderTest::new(model, view, server)?);
    }
    Ok(models)
}

/// The models that are asked in a condition, or without images if it is `None`; each with its index among all.
pub(crate) fn asked_in<'a>(
    models: &'a [ModelUnderTest],
    condition: Option<&Condition>,
) -> Vec<(usize, &'a ModelUnderTest)> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    let all = models.iter().enumerate();
    all.filter(|(_, model)| model.view == view).collect()
}

/// The opened endpoint; `None` if all models are built in.
pub(crate) fn endpoint(server: Option<&Server>) -> Result<Option<Arc<Endpoint>>> {
    let open = |server: &Server| Endpoint::open(server.access.clone(), server.sending);
    Ok(server.map(open).transpose()?.map(Arc::new))
}

/// A model that can answer open questions, opened.
pub(crate) fn open(
    name: &ModelName,
    endpoint: Option<&Arc<Endpoint>>,
    parameters: &Parameters,
) -> Result<Model> {
    match name {
        ModelName::Script(path) => Ok(Model::Script(Script::load(path)?)),
        ModelName::Remote(name) => {
            let endpoint =
                endpoint.ok_or_else(|| Error::usage("--base-url", "no endpoint is known"))?;
            let parameters = Parameters {
                model: name.clone(),
                ..parameters.clone()
            };
            let model = Remote::open(Arc::clone(endpoint), parameters)?;
            Ok(Model::Remote(Box::new(model)))
        }
        ModelName::Random | ModelName::Observer(_) => Err(Error::usage(
            "--model",
            "a model that can answer open questions expected",
        )),
    }
}

/// The beginning of the fields of a manifest that say how requests to a model were changed; the model's name follows.
pub(super) const ADAPTED_FOR: &str = "adapted for ";

/// Changes to requests that the endpoint made necessary, by model; for the manifest.
pub(crate) fn adapted(models: &[ModelUnderTest]) -> impl Iterator<Item = (String, Value)> {
    models.iter().filter_map(|model| {
        let adapted = model.model.adapted();
        let name = format!("{ADAPTED_FOR}{}", model.model.name());
        (!adapted.is_empty()).then(|| (name, json!(adapted)))
    })
}
