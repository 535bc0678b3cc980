//! The folder of a run: [`find`].

use std::path::{Path, PathBuf};

use jiff::Timestamp;
use serde_json::json;

use crate::engine::experiment::{DetailOf, Experiment};
use crate::engine::images::trials::Plan;
use crate::engine::models::{AskSettings, ModelName};
use crate::engine::settings::{JobSettings, RESULTS, RunPlace};
use crate::error::{Error, Result};
use crate::store::{self, AddressChange};
use crate::types::{Digest, StoredDetail as _};

/// The folder of a run: the one named, else the newest of the same identity and plan, else a new one.
pub(crate) fn find<E: Experiment>(experiment: &E) -> Result<PathBuf> {
    let settings = experiment.settings();
    match settings.place.for_shard(settings.shard) {
        RunPlace::Named(path) => Ok(path),
        // The manifest is restored later, when the folder is opened.
        RunPlace::Resume(path) if store::manifest_damage(&path)?.is_some() => Ok(path),
        RunPlace::Resume(path) => match store::read_manifest(&path, DetailOf::<E>::SCHEMA)? {
            Some(_) => Ok(path),
            None => Err(Error::usage(
                "--resume",
                format_args!("{}: no run in this folder; --out begins a new run", path.display()),
            )),
        },
        RunPlace::Automatic => automatic(experiment),
    }
}

/// Creates the folder of a run; for a shard, also the folder of the whole run.
///
/// # Errors
/// If it cannot be created.
pub(crate) fn make(folder: &Path, settings: &JobSettings) -> Result<()> {
    if let RunPlace::Named(outer) = &settings.place {
        settings.access.create(outer)?;
    }
    settings.access.create(folder)
}

/// The newest folder under [`RESULTS`] with the identity and plan of an experiment, else the path of a new one.
fn automatic<E: Experiment>(experiment: &E) -> Result<PathBuf> {
    let settings = experiment.settings();
    let facts = json!({
        "identity": experiment.identity(),
        "columns": experiment.columns(),
        "shard": settings.shard.to_string(),
        "trials": Plan::new(experiment.plan(0, || Ok(Vec::new()))?).keys,
        "notes": experiment.notes(),
    });
    let hash = &Digest::canonical("darkqa.command/2", &facts)?.to_string()[..8];
    let base = Path::new(RESULTS);
    Ok(store::find(base, hash).unwrap_or_else(|| {
        let time = Timestamp::now().strftime("%Y%m%d-%H%M%S");
        let (models, data) = (models_label(&settings.ask), experiment.data());
        let name = format!("{time}-{models}-{data}-{hash}");
        base.join(name.replace(|c: char| !(c.is_alphanumeric() || "-_.".contains(c)), "_"))
    }))
}

/// The models' part of a folder name: the names of the first two models, cut at 60 characters.
fn models_label(ask: &AskSettings) -> String {
    let names: Vec<String> = ask
        .models
        .iter()
        .take(2)
        .map(|model| match &model.id {
            ModelName::Remote(_) => model.name.clone(),
            built_in => built_in.label(),
        })
        .collect();
    names.join("-").chars().take(60).collect()
}

/// Allows another address of the endpoint than in the manifest only with `--resume`.
pub(crate) fn address_change(place: &RunPlace) -> AddressChange {
    match place {
        RunPlace::Resume(_) => AddressChange::Allowed,
        RunPlace::Named(_) | RunPlace::Automatic => AddressChange::Refused,
    }
}
