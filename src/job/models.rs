//! The models of a run, opened: [`ModelUnderTest`].

use std::sync::Arc;

use serde_json::{Value, json};

use crate::ask::{Endpoint, Model, Parameters, Remote, Script, Wire};
use crate::config::{Ask, ModelName, Server};
use crate::error::{Error, Result};
use crate::types::{Condition, View};

/// What messages call the place of models that are built in.
const BUILT_IN: &str = "built-in models";

/// One model and whether it sees the images.
#[derive(Debug, Clone)]
pub(crate) struct ModelUnderTest {
    pub(crate) model: Arc<Model>,
    /// What the model answers by, as [`Model::digest`] writes it: made once, for it enters every key.
    pub(crate) digest: Arc<str>,
    pub(crate) view: View,
    /// The address of its endpoint; `None` if it is built in.
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

    /// Where it is asked, for messages.
    pub(crate) fn place(&self) -> &str {
        self.address.as_deref().unwrap_or(BUILT_IN)
    }
}

/// Opens the models that see and those that do not, none of them twice; nothing is sent. Built-in models that only one experiment
/// has are made by `built_in`.
pub(crate) fn open_all(
    ask: &Ask,
    built_in: impl Fn(&ModelName) -> Result<Model>,
) -> Result<Vec<ModelUnderTest>> {
    let server = ask.server.as_ref();
    let endpoint = endpoint(server)?;
    let seen = ask.models.iter().map(|name| (name, ask.view));
    let blind = ask.blind_models.iter().map(|name| (name, View::Blind));
    let mut models: Vec<ModelUnderTest> = Vec::new();
    for (name, view) in seen.chain(blind) {
        let model = match name {
            ModelName::Random | ModelName::Observer => built_in(name)?,
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

/// The models that are asked in a condition, or without images, each with its place among all.
pub(crate) fn asked_in<'a>(
    models: &'a [ModelUnderTest],
    condition: Option<&Condition>,
) -> Vec<(usize, &'a ModelUnderTest)> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    let all = models.iter().enumerate();
    all.filter(|(_, model)| model.view == view).collect()
}

/// The endpoint, ready to be talked to.
pub(crate) fn endpoint(server: Option<&Server>) -> Result<Option<Arc<Endpoint>>> {
    let open = |server: &Server| Endpoint::open(server.access.clone(), server.sending);
    Ok(server.map(open).transpose()?.map(Arc::new))
}

/// A model that answers in words.
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
            let model = Remote::open(Arc::clone(endpoint), Wire::Chat, parameters)?;
            Ok(Model::Remote(model))
        }
        ModelName::Random | ModelName::Observer => Err(Error::usage(
            "--model",
            "a model that answers in words expected",
        )),
    }
}

/// How requests had to differ from what was tried first, by model; for the manifest.
pub(crate) fn adapted(models: &[ModelUnderTest]) -> impl Iterator<Item = (String, Value)> {
    models.iter().filter_map(|one| {
        let adapted = one.model.adapted();
        let name = format!("adapted for {}", one.model.name());
        (!adapted.is_empty()).then(|| (name, json!(adapted)))
    })
}
