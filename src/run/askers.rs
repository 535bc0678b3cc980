//! The models of a run, opened: [`Asker`].

use std::sync::Arc;

use serde_json::{Value, json};

use super::observer;
use crate::ask::{Endpoint, Model, Parameters, Random, Remote, Script, Wire};
use crate::config::{Ask, Config, ModelName, Server};
use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::types::{Question, View};

/// One model and whether it sees the images.
#[derive(Debug, Clone)]
pub(super) struct Asker {
    pub(super) model: Arc<Model>,
    /// What the model answers by, as [`Model::digest`] writes it: made once, for it enters every key.
    pub(super) digest: Arc<str>,
    pub(super) view: View,
}

impl Asker {
    pub(super) fn new(model: Model, view: View) -> Self {
        Self {
            digest: model.digest().to_string().into(),
            model: Arc::new(model),
            view,
        }
    }
}

/// Opens all models; nothing is sent.
pub(super) fn open(
    config: &Config,
    dataset: &Arc<Dataset>,
    questions: &[Question],
) -> Result<Vec<Asker>> {
    let ask = &config.ask;
    let prior = Random {
        seed: config.light.sensor.seed,
    };
    gather(ask, |name, endpoint| match name {
        ModelName::Random => Ok(Model::Random(prior)),
        ModelName::Observer => {
            let place = &config.data.place;
            observer::open(dataset, place, questions, prior).map(Model::Local)
        }
        name => speaker(name, endpoint, &ask.parameters),
    })
}

/// Opens the models of open questions; nothing is sent.
pub(super) fn open_speakers(ask: &Ask) -> Result<Vec<Asker>> {
    gather(ask, |name, endpoint| {
        speaker(name, endpoint, &ask.parameters)
    })
}

/// The models that see and those that do not, none of them twice.
fn gather(
    ask: &Ask,
    open: impl Fn(&ModelName, Option<&Arc<Endpoint>>) -> Result<Model>,
) -> Result<Vec<Asker>> {
    let endpoint = endpoint(ask.server.as_ref())?;
    let seen = ask.models.iter().map(|name| (name, ask.view));
    let blind = ask.blind_models.iter().map(|name| (name, View::Blind));
    let mut askers: Vec<Asker> = Vec::new();
    for (name, view) in seen.chain(blind) {
        let asker = Asker::new(open(name, endpoint.as_ref())?, view);
        let name = asker.model.name();
        let mut others = askers.iter();
        if others.any(|other| other.view == view && other.model.name() == name) {
            let problem = format_args!("{name} is named twice");
            return Err(Error::usage("--model", problem));
        }
        askers.push(asker);
    }
    Ok(askers)
}

/// The endpoint, ready to be talked to.
pub(super) fn endpoint(server: Option<&Server>) -> Result<Option<Arc<Endpoint>>> {
    let open = |server: &Server| Endpoint::open(server.access.clone(), server.sending);
    Ok(server.map(open).transpose()?.map(Arc::new))
}

/// A model that answers in words.
pub(super) fn speaker(
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
pub(super) fn adapted<'a>(
    askers: impl IntoIterator<Item = &'a Asker>,
) -> impl Iterator<Item = (String, Value)> {
    askers.into_iter().filter_map(|asker| {
        let adapted = asker.model.adapted();
        let name = format!("adapted for {}", asker.model.name());
        (!adapted.is_empty()).then(|| (name, json!(adapted)))
    })
}
