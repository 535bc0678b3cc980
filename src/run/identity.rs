//! What decides the replies of a run, and what does not, by flag.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use serde_json::{Value, json};

use super::merge::SHARD;
use super::plan::Inputs;
use crate::ask::Constrain;
use crate::config::{Ask, Config, Enhancement, Order, Pace, Rotations, Showing};
use crate::dataset::Dataset;
use crate::enhance::{ModelFile, Tiling};
use crate::error::{Error, Result};
use crate::synthesis::{Readings, VERSION, exposure};
use crate::types::{Digest, View};

/// Flags and contents that decide the replies.
pub(super) type Identity = BTreeMap<String, Value>;

/// The enhancement models' files, each under a name of its own.
pub(super) fn enhancers(models: &[PathBuf]) -> Result<Vec<ModelFile>> {
    let mut enhancers: Vec<ModelFile> = Vec::new();
    for path in models {
        let file = ModelFile::read(path)?;
        if enhancers.iter().any(|other| other.name() == file.name()) {
            let problem = format_args!(
                "two models are named {}; rename one of the files",
                file.name()
            );
            return Err(Error::usage("--llie", problem));
        }
        enhancers.push(file);
    }
    Ok(enhancers)
}

/// What decides the replies. A run is only resumed by a command with the same.
pub(super) fn identity(config: &Config, dataset: &Dataset, inputs: &Inputs<'_>) -> Identity {
    // Of a set, so that the digest of a whole run follows from those of its shards.
    let images = inputs
        .pictures
        .iter()
        .map(|(frame, pictured)| [frame.0.as_bytes(), pictured.digest.as_bytes()])
        .map(Digest::of_parts);
    let (ask, readings) = (&config.ask, &config.light.sensor.readings);
    let names = |view| -> BTreeSet<&str> {
        inputs
            .askers
            .iter()
            .filter(|asker| asker.view == view)
            .map(|asker| asker.model.name())
            .collect()
    };
    let models: BTreeMap<&str, Digest> = inputs
        .askers
        .iter()
        .map(|asker| (asker.model.name(), asker.model.digest()))
        .collect();
    let enhancers: BTreeMap<&str, Digest> = inputs
        .recipe
        .enhancers
        .iter()
        .map(|(name, digest)| (name.as_str(), *digest))
        .collect();
    let levels: Vec<String> = config
        .light
        .levels
        .iter()
        .map(ToString::to_string)
        .collect();
    let fields = [
        (
            "--data",
            json!({"name": dataset.name(), "images": Digest::of_set(images)}),
        ),
        ("--questions", json!(dataset.questions_digest())),
        ("--families", json!(config.data.families)),
        ("--limit", json!(config.data.limit)),
        ("--levels", json!(levels)),
        ("--variant", json!(config.light.variants.to_string())),
        ("--llie", json!(enhancers)),
        ("--llie-on", json!(config.enhancement.on.to_string())),
        ("--model", json!(names(View::Image))),
        ("--blind-model", json!(names(View::Blind))),
        (
            "--base-url",
            json!(
                ask.server
                    .as_ref()
                    .map(|server| server.access.base.to_string())
            ),
        ),
        ("--prompts", json!(inputs.prompts.digest())),
        ("--image", json!(config.images.format.to_string())),
        ("--max-side", json!(config.images.max_side)),
        (
            "--temperature",
            json!(ask.parameters.temperature.to_string()),
        ),
        ("--max-tokens", json!(ask.parameters.max_tokens)),
        ("--reasoning-effort", json!(ask.parameters.reasoning_effort)),
        ("--detail", json!(ask.parameters.detail)),
        ("what the models answer by", json!(models)),
    ];
    // Tiles give what the whole image does, or all but one sample in a thousand of it.
    let tiling = config.enhancement.tiling;
    let tiling = (tiling != Tiling::Auto).then(|| ("--tile", json!(tiling.to_string())));
    let side = config.enhancement.most_side;
    let side = side.map(|side| ("--llie-max-side", json!(side)));
    let constrain = ask.parameters.constrain;
    let constrain =
        (constrain != Constrain::None).then(|| ("--constrain", json!(constrain.to_string())));
    let shard = config.shard;
    let shard = shard.is_part().then(|| (SHARD, json!(shard.to_string())));
    fields
        .into_iter()
        .chain(light(config.light.sensor.seed, readings))
        .chain(tiling)
        .chain(side)
        .chain(constrain)
        .chain(showing(config.showing))
        .chain(shard)
        .map(|(field, value)| (field.to_owned(), value))
        .collect()
}

/// What decides how frames are darkened.
pub(super) fn light(seed: u64, readings: &Readings) -> Vec<(&'static str, Value)> {
    let Ok(synthesis) = readings.only() else {
        return vec![
            ("--seed", json!(seed)),
            ("--profile", json!(readings)),
            ("synthesis", json!([exposure::VERSION, VERSION])),
        ];
    };
    vec![
        ("--seed", json!(seed)),
        ("--profile or --amplify", json!(synthesis.amplify)),
        ("--profile or --tone", json!(synthesis.tone)),
        ("--draws", json!(synthesis.draws)),
        ("--profile or --coupling", json!(synthesis.coupling)),
        (
            "--camera, --gain, --ratio or --fixed",
            json!(synthesis.camera),
        ),
        ("synthesis", json!([exposure::VERSION, VERSION])),
    ]
}

/// How choices are shown and how often, where that is not the usual way.
fn showing(said: Showing) -> impl Iterator<Item = (&'static str, Value)> {
    let shuffled = said.order != Order::Given;
    let every = said.rotations == Rotations::Every;
    let repeated = said.repeats.get() > 1;
    [
        shuffled.then_some(("--shuffle-options", true.into())),
        every.then_some(("--circular", true.into())),
        repeated.then(|| ("--repeats", json!(said.repeats))),
    ]
    .into_iter()
    .flatten()
}

/// The content of an identity.
pub(super) fn digest(identity: &Identity) -> Digest {
    let fields = identity
        .iter()
        .flat_map(|(field, value)| [field.clone(), value.to_string()]);
    let fields: Vec<String> = fields.collect();
    Digest::of_parts(fields.iter().map(String::as_bytes))
}

/// What does not decide a reply, but may explain how a run went.
pub(super) fn settings(
    pace: &Pace,
    enhancement: &Enhancement,
    ask: &Ask,
) -> BTreeMap<String, Value> {
    let mut settings = BTreeMap::from([
        (
            "--concurrency".to_owned(),
            json!(pace.concurrency.to_string()),
        ),
        ("--max-failures".to_owned(), json!(pace.max_failures)),
        ("--threads".to_owned(), json!(enhancement.threads)),
        (
            "--token-field".to_owned(),
            json!(ask.parameters.token_field.to_string()),
        ),
    ]);
    if let Some(server) = &ask.server {
        let sending = server.sending;
        settings.insert("--timeout".to_owned(), json!(sending.timeout.as_secs_f64()));
        settings.insert("--retries".to_owned(), json!(sending.retries));
        settings.insert(
            "--max-wait".to_owned(),
            json!(sending.max_wait.as_secs_f64()),
        );
        settings.insert("--rpm".to_owned(), json!(sending.quota.requests));
        settings.insert("--tpm".to_owned(), json!(sending.quota.tokens));
    }
    settings
}

/// Where the run was made.
pub(super) fn platform() -> BTreeMap<String, String> {
    let facts = [
        ("system", std::env::consts::OS),
        ("processor", std::env::consts::ARCH),
    ];
    facts
        .map(|(fact, value)| (fact.to_owned(), value.to_owned()))
        .into()
}
