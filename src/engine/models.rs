//! The models of a run: their flags ([`ModelArgs`]), their settings ([`AskSettings`]) and the opened models
//! (`ModelUnderTest`).
//!
//! Models that flags name and models of a models file are merged into one list of settings.
//!
//! Warnings about the model names in replies: [`ServedNames`].

mod asking;
mod check;
mod entry;
mod file;
mod name;
mod settings;
mod trust;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde_json::{Value, json};

use crate::images::trials::{Item, Stimulus, Trial};
use darkqa_ask::{Endpoint, Model, Parameters, Price, Prices, Remote, Script, Server, Unpriced};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::{is_other_model, is_same_name};
use darkqa_base::types::{Condition, Record, Reply, View};
use darkqa_runs::renamed::{self, ADAPTED_FOR, CHANGED_FOR, REFUSED_FOR};

pub use asking::AskingArgs;
pub use check::{check, describe};
pub use entry::{RunDefault, run_defaults};
pub use name::{ModelArgs, ModelName};
pub use settings::{AskSettings, KeyUse, ResolveContext, TextBaseline};

/// Name in messages for the endpoint of built-in models.
const BUILT_IN: &str = "built-in models";

/// An opened model, with its view: with or without images.
#[derive(Debug, Clone)]
pub struct ModelUnderTest {
    pub model: Arc<Model>,
    /// The name in records and tables.
    pub name: Arc<str>,
    /// Digest of the settings that affect the model's replies ([`Model::digest`]). Cached, because every trial key
    /// contains it.
    pub digest: Arc<str>,
    pub view: View,
    /// The endpoint; `None` for a built-in model.
    pub server: Option<Arc<Server>>,
    /// The model's own price; `None` for the price in the table.
    pub price: Option<Price>,
    /// Number of questions that the model is asked; `None` for all.
    pub limit: Option<usize>,
}

impl ModelUnderTest {
    /// A model under its own name. `server` is its endpoint if it is remote, and ignored for built-in models.
    pub fn new(model: Model, view: View, server: Option<&Arc<Server>>) -> Result<Self> {
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

    /// Addresses of the endpoint, separated by spaces; `None` for a built-in model.
    pub fn address(&self) -> Option<String> {
        let server = self.server.as_ref();
        server.map(|server| server.addresses().join(" "))
    }

    /// Name of the endpoint in messages: its addresses, or [`BUILT_IN`].
    pub fn endpoint_name(&self) -> String {
        self.address().unwrap_or_else(|| BUILT_IN.to_owned())
    }

    /// Price of the model's tokens; `None` if it is built in or the price is unknown.
    pub fn price(&self, prices: &Prices) -> Option<Price> {
        self.priced(prices).ok().flatten()
    }

    /// Price of the model's tokens at the service tier that its requests ask for; `None` if it is built in.
    ///
    /// # Errors
    /// The reason why the price is unknown.
    pub fn priced(&self, prices: &Prices) -> std::result::Result<Option<Price>, Unpriced> {
        if !self.model.is_remote() {
            return Ok(None);
        }
        let tier = self.model.service_tier();
        match self.price {
            Some(own) => Ok(Some(own.as_asked(tier))),
            None => prices.price(self.model.name(), tier).map(Some),
        }
    }

    /// The record of a trial, without an outcome.
    pub fn blank<I: Item>(&self, trial: &Trial<I>, stimulus: &Stimulus) -> Record<I::Detail> {
        Record { max_tokens: self.model.changed_limit(), ..I::blank(trial, stimulus, &self.name) }
    }

    /// True if the model is asked the question with this index among the selected ones.
    pub fn is_asked(&self, place: usize) -> bool {
        self.limit.is_none_or(|limit| place < limit)
    }
}

/// Opens all models, with and without images. Sends nothing. `added` names further models, which are asked with images.
/// `built_in` makes the built-in models that only one type of experiment has.
///
/// # Errors
/// If a model cannot be opened, or two models differ in no setting that affects replies.
pub fn open_all(
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
    // Added models follow the last model that sees images.
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
        if let Some(other) = models[..i].iter().find(|other| have_same_trials(other, model)) {
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

fn have_same_trials(one: &ModelUnderTest, other: &ModelUnderTest) -> bool {
    one.view == other.view && one.model.name() == other.model.name() && one.digest == other.digest
}

/// The opened endpoints. Each is opened once, so that its models share its connections and its pauses.
#[derive(Default)]
struct Endpoints(Vec<(Arc<Server>, Arc<Endpoint>)>);

impl Endpoints {
    /// The endpoint of a server, opened on the first call; `None` for a built-in model.
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

/// The models that are asked in a condition, each with its index in `models`. Without a condition, those that are asked
/// without images.
pub fn asked_in<'a>(models: &'a [ModelUnderTest], condition: Option<&Condition>) -> Vec<(usize, &'a ModelUnderTest)> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    models.iter().enumerate().filter(|(_, model)| model.view == view).collect()
}

/// Opens an endpoint.
pub fn endpoint(server: &Server) -> Result<Arc<Endpoint>> {
    Endpoint::from_addresses(server.replicas.clone(), server.sending).map(Arc::new)
}

/// Opens a model that can answer open questions.
///
/// # Errors
/// If the model answers multiple-choice questions only, or cannot be opened.
pub fn open(name: &ModelName, endpoint: Option<&Arc<Endpoint>>, parameters: &Parameters) -> Result<Model> {
    match name {
        ModelName::Script(path) => Ok(Model::Script(Script::load(path)?)),
        ModelName::Remote(name) => {
            let endpoint = endpoint.ok_or_else(|| Error::usage("--base-url", "no endpoint is known"))?;
            let parameters = Parameters { model: name.clone(), ..parameters.clone() };
            let model = Remote::open(Arc::clone(endpoint), parameters)?;
            Ok(Model::Remote(Box::new(model)))
        }
        ModelName::Random | ModelName::Observer(_) | ModelName::RoomNet => {
            Err(Error::usage("--model", "a model that can answer open questions expected"))
        }
    }
}

/// Adds to the settings of a manifest which flags of each model the server refused, and which settings changed within
/// the run.
pub fn note_changes(models: &[&ModelUnderTest], settings: &mut BTreeMap<String, Value>) {
    for model in models {
        let forced = model.model.forced();
        if !forced.is_empty() {
            let key = renamed::key(REFUSED_FOR, &model.name, model.model.is_judge());
            let earlier = renamed::strings(settings.get(&key));
            let all: BTreeSet<&str> = earlier.iter().map(String::as_str).chain(forced).collect();
            settings.insert(key, json!(all));
        }
        let changes = model.model.changed_settings();
        if !changes.is_empty() {
            let key = renamed::key(CHANGED_FOR, &model.name, model.model.is_judge());
            settings.insert(key, json!(changes));
        }
    }
}

/// Changes to requests that the endpoint required, by model, as settings for the manifest. The changes of a model that
/// is asked both with and without images are merged.
pub fn adapted(models: &[ModelUnderTest]) -> impl Iterator<Item = (String, Value)> {
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
    by_name.into_iter().map(|(name, changes)| (name, json!(changes)))
}

/// The name in the replies of one model.
#[derive(Debug, Clone, Default)]
pub(super) struct ServedNames {
    /// Name in the first reply that has one.
    first: Option<String>,
    has_warned: bool,
}

impl ServedNames {
    /// Adds a reply. Warns if the first name is evidently that of another model, and once if a later name differs from
    /// the first.
    pub(super) fn add(&mut self, model: &ModelUnderTest, reply: &Reply) {
        let Some(served) = reply.served_model.as_deref().filter(|name| !name.is_empty()) else {
            return;
        };
        let name = &model.name;
        match &self.first {
            None => {
                if is_other_model(model.model.name(), served) {
                    tracing::warn!(
                        "{name}: its replies name another model, {served}: check which model the server has loaded, or serves under this \
                         name"
                    );
                }
                self.first = Some(served.to_owned());
            }
            Some(first) if !self.has_warned && !is_same_name(first, served) => {
                self.has_warned = true;
                tracing::warn!(
                    "{name}: its replies name several models, first {first}, now {served}: replies of two models are no comparison of \
                     light; the report counts them for each level (a --model with a date or version, or no fallback, keeps one)"
                );
            }
            Some(_) => {}
        }
    }
}
