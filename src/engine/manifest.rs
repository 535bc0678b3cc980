//! The manifest of a run that starts or continues: [`run_manifest`].
//!
//! The settings that define a run: those that all trials share ([`images`]), and the definitions of the values in its
//! columns ([`columns`]).

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::models::ModelUnderTest;
use crate::experiment::{DetailOf, Experiment};
use crate::images::frames::input_summary;
use crate::images::recipes::Recipe;
use crate::images::recipes::image_recipe::ImageWords;
use crate::settings::JobSettings;
use darkqa_ask::{Prices, by_flag};
use darkqa_base::error::Result;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::manifests::{Columns, Counts, PngForm, RunManifest, RunPart, Status};
use darkqa_base::types::{Degradation, Digest, InputSummary, ListedModel, PairDark, ProfileName, StoredDetail as _};
use darkqa_enhance::{SizeArgs, Tiling};
use darkqa_light::{KindSettings, Synthesis, version};
use darkqa_pictures::Scaling;
use darkqa_runs::renamed::{self, SettingsChange, is_kept};
use darkqa_runs::shard::tasks_setting;
use darkqa_score::answers::record::Detail as _;
use darkqa_store::now;

/// The manifest of a run that starts, or that continues the run of the `stored` manifest. It keeps the date, columns
/// and image flags of the stored one; after a complete run, it keeps everything but the identity.
///
/// # Errors
/// If a number in the settings of a model is not finite.
pub fn run_manifest<E: Experiment>(experiment: &E, stored: Option<RunManifest>) -> Result<RunManifest> {
    let job = experiment.settings();
    let mut settings = settings(job);
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
        platform: platform(),
        identity: experiment.identity(),
        columns,
        models: listed_models(job, stored.as_ref()),
        enhancers: BTreeMap::new(),
        inputs: inputs(experiment),
        shard: job.shard.is_part().then(|| job.shard.to_string()),
        part: experiment.part().map(|place| RunPart { place, trials: vec![0; place.count] }),
        settings,
        images: job.image_flags.clone(),
        png: PngForm::NEWEST,
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
            png: stored.png,
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
pub fn mark_started<E: Experiment>(experiment: &E, manifest: &mut RunManifest) {
    manifest.status = Status::Started;
    manifest.updated = now();
    env!("CARGO_PKG_VERSION").clone_into(&mut manifest.version);
    let settings = settings(experiment.settings());
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

/// The kinds of degradation in the paper. Their versions are part of the identity of every run. The versions of other
/// kinds are in the column `variant` of runs that use them, so that they can be added to an existing run.
const PAPER_KINDS: [Kind; 2] = [Kind::Exposure, Kind::Sensor];

/// Settings of a recipe that all trials share.
pub fn images(recipe: &Recipe) -> impl Iterator<Item = (String, Value)> {
    let scaling = match recipe.scaling {
        Scaling::Never => None,
        Scaling::MaxSide(side) => Some(("--max-side", json!(side))),
        Scaling::LongerSide(side) => Some(("--image-size", json!(side))),
    };
    let fields = [
        ("--image", json!(recipe.format.to_string())),
        ("--seed", json!(recipe.seed)),
        ("synthesis", json!(PAPER_KINDS.map(version))),
        ("enhancement", json!(darkqa_enhance::VERSION)),
    ];
    fields.into_iter().chain(scaling).map(|(field, value)| (field.to_owned(), value))
}

/// Definitions of the models, enhancers, noise profiles and other kinds of degradation of a run.
pub fn columns<'a>(
    models: impl IntoIterator<Item = &'a ModelUnderTest>,
    recipe: &Recipe,
    settings: &JobSettings,
) -> Columns {
    let models = models.into_iter().map(|model| (model.name.to_string(), model_definition(model)));
    let enhancers = recipe.enhancers.iter().map(|(name, digest)| {
        let content = enhancer_definition(digest, &settings.loading.size);
        (name.as_str().to_owned(), content)
    });
    let elsewhere = recipe.enhanced_images.iter().map(|images| {
        let content = json!({"--enhanced": images.digest()});
        (images.name().as_str().to_owned(), content)
    });
    let enhancers = enhancers.chain(elsewhere);
    let degradations = settings.light.degradations();
    let profiles: BTreeSet<&ProfileName> = degradations
        .iter()
        .flatten()
        .filter_map(Degradation::reading)
        .chain(settings.light.matches.iter().filter_map(PairDark::reading))
        .collect();
    let kinds: BTreeSet<Kind> = degradations
        .iter()
        .flatten()
        .map(Degradation::kind)
        .chain(settings.light.matches.iter().filter_map(PairDark::kind))
        .collect();
    let variants = kinds
        .into_iter()
        .filter(|kind| !PAPER_KINDS.contains(kind))
        .map(|kind| (kind.word().to_owned(), kind_definition(kind, &recipe.kinds)));
    let noise = recipe
        .kinds
        .sensor
        .readings
        .iter()
        .filter(|(name, _)| profiles.contains(name))
        .map(|(name, content)| (name.to_string(), noise_definition(content)));
    let columns: [(&str, BTreeMap<String, Value>); 4] = [
        ("model", models.collect()),
        ("enhancer", enhancers.collect()),
        ("reading", noise.collect()),
        ("variant", variants.collect()),
    ];
    columns
        .into_iter()
        .filter(|(_, values)| !values.is_empty())
        .map(|(column, values)| (column.to_owned(), values))
        .collect()
}

/// Settings by flag that affect the replies of a model, other than question and images, and the address of its
/// endpoint.
pub fn model_definition(model: &ModelUnderTest) -> Value {
    let mut content = model.model.content();
    if let (Some(address), Some(fields)) = (model.address(), content.as_object_mut()) {
        *fields = by_flag(std::mem::take(fields));
        fields.insert("--base-url".to_owned(), json!(address));
    }
    content
}

/// Settings by flag that affect the pixels of an enhancer. Automatic tiling is left out: it changes at most one sample
/// in a thousand, compared with enhancement of the whole image.
pub fn enhancer_definition(digest: &Digest, size: &SizeArgs) -> Value {
    let tile = (size.tile != Tiling::Auto).then(|| size.tile.to_string());
    let mut content = json!({
        "--llie": digest,
        "--tile": tile,
        "--llie-max-side": size.llie_max_side,
    });
    // Left out if unset, so that runs of versions without the flag can be continued.
    if size.llie_resize {
        content["--llie-resize"] = json!(true);
    }
    content
}

/// Settings of a noise profile, by flag.
fn noise_definition(synthesis: &Synthesis) -> Value {
    json!({
        "--amplify": synthesis.amplify,
        "--tone": synthesis.tone,
        "--draws": synthesis.draws,
        "--coupling": synthesis.coupling,
        "--camera, --gain, --ratio or --fixed": synthesis.camera,
    })
}

/// Settings of a kind of degradation outside the paper, by flag.
fn kind_definition(kind: Kind, kinds: &KindSettings) -> Value {
    let mut content = json!({"synthesis": version(kind), "--motion": kinds.motion.to_string()});
    if kind == Kind::Auto {
        content["--auto"] = json!(kinds.auto.to_string());
        content["--camera or --fixed"] = json!(kinds.sensor.readings.camera());
    }
    content
}

/// Settings that do not affect replies, but may explain the course of a run.
pub fn settings(job: &JobSettings) -> BTreeMap<String, Value> {
    let mut settings = vec![
        ("--concurrency", json!(job.concurrency.to_string())),
        ("--max-failures", json!(job.money.max_failures)),
        ("--threads", json!(job.loading.threads.threads)),
    ];
    settings.extend(job.money.prices.setting().map(|own| (Prices::SETTING, own)));
    if let Some(models) = &job.ask.file {
        settings.push(("models", models.resolved.clone()));
    } else if let Some(server) = job.ask.servers().first() {
        let sending = server.sending;
        settings.extend([
            ("--timeout", json!(sending.timeout.as_secs_f64())),
            ("--retries", json!(sending.retries)),
            ("--max-wait", json!(sending.max_wait.as_secs_f64())),
            ("--patience", json!(sending.patience.as_secs_f64())),
            ("--rpm", json!(sending.quota.requests)),
            ("--tpm", json!(sending.quota.tokens)),
        ]);
    }
    settings.into_iter().map(|(field, value)| (field.to_owned(), value)).collect()
}

/// Operating system and processor of this machine.
pub fn platform() -> BTreeMap<String, String> {
    let facts = [("system", std::env::consts::OS), ("processor", std::env::consts::ARCH)];
    facts.map(|(fact, value)| (fact.to_owned(), value.to_owned())).into()
}
