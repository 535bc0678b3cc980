//! The manifest of a run that starts or continues: [`run_manifest`].

use std::collections::BTreeMap;

use serde_json::Value;

use crate::engine::experiment::{DetailOf, Experiment};
use crate::engine::identity;
use crate::engine::images::frames::input_summary;
use crate::engine::images::recipes::image_words::ImageWords;
use crate::engine::settings::JobSettings;
use crate::error::Result;
use crate::runs::changed_settings::is_kept;
use crate::runs::divisions::tasks_setting;
use crate::runs::renamed::{self, SettingsChange};
use crate::store::now;
use crate::types::manifests::{Counts, RunManifest, RunPart, Status};
use crate::types::{InputSummary, ListedModel, StoredDetail as _};
use darkqa_score::answers::record::Detail as _;

/// The manifest of a run that starts, or that continues the run of the `stored` manifest. It keeps the date, columns
/// and image flags of the stored one; after a complete run, it keeps everything but the identity.
///
/// # Errors
/// If a number in the settings of a model is not finite.
pub(crate) fn run_manifest<E: Experiment>(experiment: &E, stored: Option<RunManifest>) -> Result<RunManifest> {
    let job = experiment.settings();
    let mut settings = identity::settings(job);
    let notes: BTreeMap<String, Value> =
        experiment.notes().into_iter().map(|(field, value)| (field.to_owned(), value)).collect();
    settings.extend(notes.clone());
    let kept = stored.iter().flat_map(|stored| &stored.settings);
    settings.extend(kept.filter(|(key, _)| is_kept(key)).map(|(key, value)| (key.clone(), value.clone())));
    settings.extend(job.tasks.map(tasks_setting));
    let mut columns = stored.as_ref().map_or_else(Default::default, |stored| stored.columns.clone());
    for (column, values) in experiment.columns() {
        columns.entry(column).or_default().extend(values);
    }
    let mut manifest = RunManifest {
        schema: DetailOf::<E>::SCHEMA.to_owned(),
        status: Status::Started,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        created: now(),
        updated: now(),
        platform: identity::platform(),
        identity: experiment.identity(),
        columns,
        models: listed_models(job, stored.as_ref()),
        enhancers: BTreeMap::new(),
        inputs: inputs(experiment),
        shard: job.shard.is_part().then(|| job.shard.to_string()),
        part: experiment.part().map(|place| RunPart { place, trials: vec![0; place.count] }),
        settings,
        images: job.image_flags.clone(),
        reply_reading: DetailOf::<E>::REPLY_READING.map(str::to_owned),
        counts: Counts::default(),
    };
    let Some(mut stored) = stored else {
        return Ok(manifest);
    };
    let other_settings = match job.ask.file {
        Some(_) => SettingsChange::Allowed,
        None => SettingsChange::Refused,
    };
    let before = stored.clone();
    let models = experiment.columns().remove("model").unwrap_or_default();
    let views = job.ask.views();
    let current_models = renamed::CurrentModels { models: &models, views: &views, settings: other_settings };
    renamed::note_renamed_models(&mut manifest, &before, current_models)?;
    let images = merged_flags(&stored.images, manifest.images);
    if stored.status != Status::Complete {
        return Ok(RunManifest {
            created: stored.created,
            enhancers: stored.enhancers,
            inputs: manifest.inputs.or(stored.inputs),
            images,
            // Stored replies keep their parsed answers until they are parsed again.
            reply_reading: stored.reply_reading,
            ..manifest
        });
    }
    stored.settings.extend(notes);
    stored.models.clone_from(&manifest.models);
    renamed::note_renamed_models(&mut stored, &before, current_models)?;
    Ok(RunManifest {
        identity: manifest.identity,
        columns: manifest.columns,
        models: manifest.models,
        inputs: manifest.inputs.or(stored.inputs),
        shard: manifest.shard,
        part: manifest.part,
        images,
        ..stored
    })
}

/// Models listed in the models file; without a file, those in the stored manifest.
fn listed_models(job: &JobSettings, stored: Option<&RunManifest>) -> Vec<ListedModel> {
    match &job.ask.file {
        Some(file) => file.listed.clone(),
        None => stored.map_or_else(Vec::new, |stored| stored.models.clone()),
    }
}

/// Summary of the changes made to the frames when they were read; `None` without changes.
fn inputs<E: Experiment>(experiment: &E) -> Option<InputSummary> {
    let summary = input_summary(experiment.sources());
    (!summary.is_plain()).then_some(summary)
}

/// Marks a run as started, with the settings of this command and this version.
pub(crate) fn mark_started<E: Experiment>(experiment: &E, manifest: &mut RunManifest) {
    manifest.status = Status::Started;
    manifest.updated = now();
    env!("CARGO_PKG_VERSION").clone_into(&mut manifest.version);
    let settings = identity::settings(experiment.settings());
    manifest.settings.extend(settings);
}

/// Image flags of the stored manifest and of this call. Lists are joined, with the stored values first; other values
/// are those of this call.
fn merged_flags(stored: &ImageWords, current: ImageWords) -> ImageWords {
    let mut all = stored.clone();
    for (flag, value) in current {
        let value = match (all.remove(&flag), value) {
            (Some(Value::Array(mut known)), Value::Array(more)) => {
                let more: Vec<Value> = more.into_iter().filter(|value| !known.contains(value)).collect();
                known.extend(more);
                Value::Array(known)
            }
            (_, value) => value,
        };
        all.insert(flag, value);
    }
    all
}
