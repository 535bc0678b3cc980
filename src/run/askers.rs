//! The models of a run, opened: [`Asker`].

use std::sync::Arc;

use serde_json::{Value, json};

use super::observer;
use crate::ask::{Endpoint, Model, OpenAi, Parameters, Random, Script};
use crate::config::{Config, ModelName};
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
    let endpoint = match &ask.server {
        Some(server) => Some(Arc::new(Endpoint::open(
            server.access.clone(),
            server.sending,
        )?)),
        None => None,
    };
    let seen = ask.models.iter().map(|name| (name, ask.view));
    let blind = ask.blind_models.iter().map(|name| (name, View::Blind));
    let mut askers: Vec<Asker> = Vec::new();
    for (name, view) in seen.chain(blind) {
        let model = Arc::new(match name {
            ModelName::Random => Model::Random(prior),
            ModelName::Observer => {
                let place = &config.data.place;
                Model::Local(observer::open(dataset, place, questions, prior)?)
            }
            ModelName::Script(path) => Model::Script(Script::load(path)?),
            ModelName::Remote(name) => {
                let endpoint = endpoint
                    .as_ref()
                    .ok_or_else(|| Error::usage("--base-url", "no endpoint is known"))?;
                Model::OpenAi(OpenAi::new(
                    Arc::clone(endpoint),
                    Parameters {
                        model: name.clone(),
                        ..ask.parameters.clone()
                    },
                ))
            }
        });
        if askers
            .iter()
            .any(|asker| asker.view == view && asker.model.name() == model.name())
        {
            return Err(Error::usage(
                "--model",
                format_args!("{} is named twice", model.name()),
            ));
        }
        let digest = model.digest().to_string().into();
        askers.push(Asker {
            model,
            digest,
            view,
        });
    }
    Ok(askers)
}

/// How requests had to differ from what was tried first, by model; for the manifest.
pub(super) fn adapted(askers: &[Asker]) -> impl Iterator<Item = (String, Value)> {
    askers.iter().filter_map(|asker| {
        let Model::OpenAi(model) = &*asker.model else {
            return None;
        };
        let adapted = model.adapted();
        let name = format!("adapted for {}", model.name());
        (!adapted.is_empty()).then(|| (name, json!(adapted)))
    })
}
