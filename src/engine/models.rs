//! The models of a run: their flags ([`ModelArgs`]), their settings ([`AskSettings`]) and the opened models (`ModelUnderTest`).
//!
//! Flags and a file of models make one list of settings; a model that a flag names is an entry like those of the file.

mod args;
mod asking;
mod check;
mod describe;
mod entry;
mod file;
mod name;
mod run_defaults;
mod selection;
mod settings;
mod trust;

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Value, json};

use crate::ask::{Endpoint, Model, Parameters, Price, Prices, Remote, Script, Server};
use crate::error::{Error, Result};
use crate::images::trials::{Item, Stimulus, Trial};
use crate::runs::renamed::ADAPTED_FOR;
use crate::types::{Condition, Record, View};

pub(crate) use args::ModelArgs;
pub(crate) use asking::AskingArgs;
pub(crate) use check::check;
pub(crate) use describe::describe;
pub(crate) use name::ModelName;
pub(crate) use run_defaults::{RunDefault, run_defaults};
pub(crate) use settings::{AskSettings, KeyUse, ResolveContext, TextBaseline};

/// Name of the endpoint of built-in models in messages.
const BUILT_IN: &str = "built-in models";

/// One model and whether it sees the images.
#[derive(Debug, Clone)]
pub(crate) struct ModelUnderTest {
    pub(crate) model: Arc<Model>,
    /// The name in records and tables.
    pub(crate) name: Arc<str>,
    /// Digest of the settings that decide the model's replies ([`Model::digest`]). Computed once, because it enters every trial key.
    pub(crate) digest: Arc<str>,
    pub(crate) view: View,
    /// Its endpoint; `None` if it is built in.
    pub(crate) server: Option<Arc<Server>>,
    /// The price, if it is not that of the table of prices.
    pub(crate) price: Option<Price>,
    /// The number of questions that it is asked; `None` for all.
    pub(crate) limit: Option<usize>,
}

impl ModelUnderTest {
    /// A model under its own name, at this endpoint if it is remote.
    pub(crate) fn new(model: Model, view: View, server: Option<&Arc<Server>>) -> Result<Self> {
        let server = server.filter(|_| model.is_remote());
        Ok(Self {
            digest: model.digest()?.to_string().into(),
            name: model.name().into(),
            server: server.cloned(),
            model: Arc::new(model),
            view,
            price: None,
            limit: None,
        })
    }

    /// Address of its endpoint; `None` if it is built in.
    pub(crate) fn address(&self) -> Option<String> {
        let server = self.server.as_ref();
        server.map(|server| server.addresses().join(" "))
    }

    /// Name of its endpoint for messages: the address, or that it is built in.
    pub(crate) fn endpoint_name(&self) -> String {
        self.address().unwrap_or_else(|| BUILT_IN.to_owned())
    }

    /// The price of its tokens; `None` if it is built in or the price is unknown.
    pub(crate) fn price(&self, prices: &Prices) -> Option<Price> {
        let remote = self.model.is_remote();
        let of_table = || prices.find(self.model.name());
        remote.then(|| self.price.or_else(of_table)).flatten()
    }

    /// The record of a trial, without an outcome.
    pub(crate) fn blank<I: Item>(
        &self,
        trial: &Trial<I>,
        stimulus: &Stimulus,
    ) -> Record<I::Detail> {
        Record {
            max_tokens: self.model.raised_limit(),
            ..I::blank(trial, stimulus, &self.name)
        }
    }

    /// Whether it is asked the question at this place among the selected ones.
    pub(crate) fn is_asked(&self, place: usize) -> bool {
        self.limit.is_none_or(|limit| place < limit)
    }
}

/// The opened models, those that see images and those that do not. Nothing is sent. `added` are asked too, with images, although no
/// flag names them. `built_in` makes the built-in models that only one experiment has.
///
/// # Errors
/// If a model cannot be opened, or two differ in nothing that decides a reply.
pub(crate) fn open_all(
    ask: &AskSettings,
    added: &[ModelName],
    built_in: impl Fn(&ModelName) -> Result<Model>,
) -> Result<Vec<ModelUnderTest>> {
    let mut endpoints = Endpoints::default();
    let mut models: Vec<ModelUnderTest> = Vec::new();
    for settings in &ask.models {
        let model = match &settings.id {
            name if name.is_choice_only() => built_in(name)?,
            name => {
                let endpoint = endpoints.get(settings.server.as_ref())?;
                open(name, endpoint.as_ref(), &settings.parameters)?
            }
        };
        let opened = ModelUnderTest::new(model, settings.view, settings.server.as_ref())?;
        models.push(ModelUnderTest {
            name: settings.name.as_str().into(),
            price: settings.price,
            limit: settings.limit,
            ..opened
        });
    }
    // Behind the last model that sees images.
    let last = models.iter().rposition(|model| model.view == View::Image);
    let place = last.map_or(models.len(), |last| last + 1);
    for (i, name) in added.iter().enumerate() {
        let model = ModelUnderTest::new(built_in(name)?, View::Image, None)?;
        models.insert(place + i, model);
    }
    refuse_same_trials(&models)?;
    Ok(models)
}

/// Refuses two models whose trials would have the same keys.
fn refuse_same_trials(models: &[ModelUnderTest]) -> Result<()> {
    for (i, model) in models.iter().enumerate() {
        let mut before = models[..i].iter();
        let facts = |model: &ModelUnderTest| {
            let name = model.model.name().to_owned();
            (model.view, name, Arc::clone(&model.digest))
        };
        if let Some(other) = before.find(|other| facts(other) == facts(model)) {
            let how = match model.view {
                View::Image => "",
                View::Blind => " without images",
            };
            let problem = format_args!(
                "{} and {} differ in nothing that decides the reply{how}: leave one of them out, with its flag or its view in a file of models; \
                 if they are two deployments, set deployment there",
                other.name, model.name
            );
            return Err(Error::usage("--model", problem));
        }
    }
    Ok(())
}

/// The opened endpoints, each once: all its models share its connections and its pauses.
#[derive(Default)]
struct Endpoints(Vec<(Arc<Server>, Arc<Endpoint>)>);

impl Endpoints {
    fn get(&mut self, server: Option<&Arc<Server>>) -> Result<Option<Arc<Endpoint>>> {
        let Some(server) = server else {
            return Ok(None);
        };
        let mut known = self.0.iter();
        if let Some((_, endpoint)) = known.find(|(known, _)| Arc::ptr_eq(known, server)) {
            return Ok(Some(Arc::clone(endpoint)));
        }
        let endpoint = endpoint(server)?;
        self.0.push((Arc::clone(server), Arc::clone(&endpoint)));
        Ok(Some(endpoint))
    }
}

/// The models that are asked in a condition, or without images if it is `None`; each with its index among all.
pub(crate) fn asked_in<'a>(
    models: &'a [ModelUnderTest],
    condition: Option<&Condition>,
) -> Vec<(usize, &'a ModelUnderTest)> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    models
        .iter()
        .enumerate()
        .filter(|(_, model)| model.view == view)
        .collect()
}

/// The opened endpoint.
pub(crate) fn endpoint(server: &Server) -> Result<Arc<Endpoint>> {
    Endpoint::from_addresses(server.replicas.clone(), server.sending).map(Arc::new)
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
        ModelName::Random | ModelName::Observer(_) | ModelName::RoomNet => Err(Error::usage(
            "--model",
            "a model that can answer open questions expected",
        )),
    }
}

/// Changes to requests that the endpoint made necessary, by name; for the manifest. Those of a model that is asked with images and
/// without stand together.
pub(crate) fn adapted(models: &[ModelUnderTest]) -> impl Iterator<Item = (String, Value)> {
    let mut by_name: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for model in models {
        let name = format!("{ADAPTED_FOR}{}", model.name);
        for change in model.model.adapted() {
            let changes = by_name.entry(name.clone()).or_default();
            if !changes.contains(&change) {
                changes.push(change);
            }
        }
    }
    by_name
        .into_iter()
        .map(|(name, changes)| (name, json!(changes)))
}
