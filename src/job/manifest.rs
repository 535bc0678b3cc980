//! The manifest of a run under way: [`of`].

use std::collections::BTreeMap;

use serde_json::Value;

use super::experiment::{DetailOf, Experiment};
use super::folder::now;
use super::identity;
use super::image_words::ImageWords;
use crate::types::manifest::{Counts, RunManifest, Status};
use crate::types::{Detail as _, Record};

/// The manifest of a run; one that was kept goes on as it is, with the columns that are new.
pub(crate) fn of<E: Experiment>(experiment: &E, kept: Option<RunManifest>) -> RunManifest {
    let job = experiment.settings();
    let mut settings = identity::settings(job);
    let notes = experiment.notes().into_iter();
    let notes = notes.map(|(field, value)| (field.to_owned(), value));
    let notes: BTreeMap<String, Value> = notes.collect();
    settings.extend(notes.clone());
    let mut columns = kept
        .as_ref()
        .map_or_else(Default::default, |kept| kept.columns.clone());
    for (column, values) in experiment.columns() {
        columns.entry(column).or_default().extend(values);
    }
    let manifest = RunManifest {
        schema: DetailOf::<E>::SCHEMA.to_owned(),
        status: Status::Started,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        created: now(),
        updated: now(),
        platform: identity::platform(),
        identity: experiment.identity(),
        columns,
        shard: job.shard.is_part().then(|| job.shard.to_string()),
        settings,
        images: job.pictures.clone(),
        counts: Counts::default(),
    };
    let Some(mut kept) = kept else {
        return manifest;
    };
    let images = together(&kept.images, manifest.images);
    if kept.status != Status::Complete {
        return RunManifest {
            created: kept.created,
            images,
            ..manifest
        };
    }
    kept.settings.extend(notes);
    RunManifest {
        identity: manifest.identity,
        columns: manifest.columns,
        shard: manifest.shard,
        images,
        ..kept
    }
}

/// Notes that a run goes on, by this command and this version.
pub(crate) fn go_on<E: Experiment>(experiment: &E, manifest: &mut RunManifest) {
    manifest.status = Status::Started;
    manifest.updated = now();
    env!("CARGO_PKG_VERSION").clone_into(&mut manifest.version);
    let settings = identity::settings(experiment.settings());
    manifest.settings.extend(settings);
}

/// The flags that decide the images: those said now, and of lists also what was said before.
fn together(kept: &ImageWords, now: ImageWords) -> ImageWords {
    let mut all = kept.clone();
    for (flag, value) in now {
        let value = match (all.remove(&flag), value) {
            (Some(Value::Array(mut known)), Value::Array(more)) => {
                let more: Vec<Value> = more
                    .into_iter()
                    .filter(|one| !known.contains(one))
                    .collect();
                known.extend(more);
                Value::Array(known)
            }
            (_, value) => value,
        };
        all.insert(flag, value);
    }
    all
}

/// How many of these trials have a reply, and how many failed.
pub(crate) fn count<D>(trials: usize, records: &[Record<D>]) -> Counts {
    let failed = records.iter().filter(|record| record.failed()).count();
    Counts {
        trials,
        answered: records.len() - failed,
        failed,
    }
}
