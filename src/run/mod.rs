//! THE CONDUCTOR: the only place that sees every stage, and the only bridge between CPU work and waiting.
//!
//! [`evaluate`] reads as the sentence it carries out: open the data, open the models, open the run folder, plan what is
//! left to ask, send the darkroom to make the images and ask about them, score, show.

mod askers;
mod darkroom;
mod drive;
mod identity;
mod interrupt;
mod plan;
pub mod progress;
mod recipe;
mod record;
mod stop;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use rayon::prelude::*;

use crate::config::{Config, Enhancement, ModelName, RunPlace, Show};
use crate::dataset::Dataset;
use crate::enhance::{Enhancer, Runtime};
use crate::error::{Error, Result};
use crate::report;
use crate::score::accuracy::summarize;
use crate::store::{self, Store};
use crate::types::manifest::{Counts, RunManifest, SCHEMA, Status};
use crate::types::{Digest, Family, FrameId, Outcome, Question, Record, TrialKey};

use drive::Drive;
use identity::Identity;
use plan::{Inputs, Plan};
use progress::Progress;
use stop::End;

/// The folder of runs without a name of their own.
const RESULTS: &str = "results";

/// How an evaluation ended.
#[derive(Debug)]
pub struct Verdict {
    /// How far it came.
    pub status: Status,
    /// What belongs on standard output.
    pub output: String,
    /// The run folder.
    pub folder: PathBuf,
}

/// Runs an evaluation, or goes on with it.
///
/// # Errors
/// Where nothing can be asked, or no further trial could succeed; what had arrived by then is kept.
pub fn evaluate(config: &Config, progress: &Progress) -> Result<Verdict> {
    let dataset = Dataset::open(&config.data.place, config.data.questions.as_deref())?;
    let questions = select(&dataset, config)?;
    let askers = askers::open(config)?;
    let enhancers = identity::enhancers(config)?;
    let pictures = look_through(&dataset, &questions, progress)?;
    let inputs = Inputs::new(config, &questions, &pictures, &askers, &enhancers)?;

    let identity = identity::identity(config, &dataset, &inputs);
    let folder = folder(config, &dataset, &identity)?;
    let kept = store::read_manifest(&folder)?;
    let complete = kept
        .as_ref()
        .is_some_and(|manifest| manifest.status == Status::Complete);
    // Opened before the folder is made, so that an enhancer that does not work leaves nothing behind.
    let opened = if complete {
        None
    } else {
        Some(open_enhancers(config)?)
    };
    let mut manifest = manifest(config, identity, kept);
    let mut store = Store::open(&folder, &manifest)?;
    let plan = Plan::new(&inputs, &store.records()?)?;
    let (runtime, enhancers) = match opened {
        None if plan.left() == 0 => (None, Vec::new()),
        None => open_enhancers(config)?,
        Some(opened) => opened,
    };
    if let Some(runtime) = runtime {
        let version = runtime.version().to_owned();
        manifest.platform.insert("onnxruntime".to_owned(), version);
    }
    if plan.left() < plan.trials() {
        let answered = plan.trials() - plan.left();
        progress.say(&format!(
            "{}: {answered} of {} trials are answered already",
            folder.display(),
            plan.trials()
        ));
    }
    let (trials, keys) = (plan.trials(), plan.keys.clone());
    let drive = Drive {
        config,
        dataset: &dataset,
        recipe: &inputs.recipe,
        askers: &askers,
        progress,
    };
    let end = drive.run(plan, enhancers, &mut store)?;

    let records = in_order(store.records()?, &keys);
    manifest.counts = count(trials, &records);
    manifest.status = end.status(manifest.counts);
    manifest.updated = now();
    let summary = summarize(&records, &questions);
    let json = report::files::json(&summary, &manifest)?;
    store.write("summary.csv", &report::files::csv(&summary)?)?;
    store.write("summary.json", json.as_bytes())?;
    store.write_manifest(&manifest)?;
    if let End::Stopped(error) = end {
        return Err(error);
    }
    let output = match config.output.show {
        Show::Json => json,
        Show::Table => report::table::render(&summary),
    };
    Ok(Verdict {
        status: manifest.status,
        output,
        folder,
    })
}

/// The questions that are asked: of the chosen families, the first so many.
fn select(dataset: &Dataset, config: &Config) -> Result<Vec<Question>> {
    let wanted = |question: &&Question| {
        config
            .data
            .families
            .as_ref()
            .is_none_or(|list| list.contains(&question.family))
    };
    let there: BTreeSet<&Family> = dataset
        .questions()
        .iter()
        .map(|question| &question.family)
        .collect();
    if let Some(missing) = config
        .data
        .families
        .iter()
        .flatten()
        .find(|family| !there.contains(family))
    {
        let there: Vec<&str> = there.into_iter().map(Family::name).collect();
        let problem = format!(
            "no question of the family {missing}; there are: {}",
            there.join(", ")
        );
        return Err(Error::usage("--families", problem));
    }
    let limit = config.data.limit.map_or(usize::MAX, usize::from);
    Ok(dataset
        .questions()
        .iter()
        .filter(wanted)
        .take(limit)
        .cloned()
        .collect())
}

/// Reads every image that is asked about once: a missing or broken one is found before anything is paid for, and its
/// content enters the keys of its trials.
fn look_through(
    dataset: &Dataset,
    questions: &[Question],
    progress: &Progress,
) -> Result<BTreeMap<FrameId, Digest>> {
    let frames: BTreeMap<&FrameId, &Question> = questions
        .iter()
        .map(|question| (&question.frame, question))
        .collect();
    let bar = progress.bar("reading images", frames.len());
    let digests = frames.into_par_iter().map(|(frame, question)| {
        let picture = dataset.picture(frame)?;
        picture
            .check()
            .map_err(|e| Error::data(format_args!("question {:?}", question.id.0), e))?;
        bar.inc();
        Ok((frame.clone(), picture.digest()))
    });
    digests.collect()
}

fn open_enhancers(config: &Config) -> Result<(Option<Runtime>, Vec<Enhancer>)> {
    let Enhancement {
        models,
        threads,
        runtime,
        ..
    } = &config.enhancement;
    if models.is_empty() {
        return Ok((None, Vec::new()));
    }
    let runtime = runtime.open()?;
    let enhancers = models
        .iter()
        .map(|path| Enhancer::open(path, &runtime, *threads))
        .collect::<Result<_>>()?;
    Ok((Some(runtime), enhancers))
}
/// The models in the name of a folder.
fn label(config: &Config) -> String {
    let names = config
        .ask
        .models
        .iter()
        .chain(&config.ask.blind_models)
        .map(|name| match name {
            ModelName::Random => "random".to_owned(),
            ModelName::Script(path) => path.file_stem().map_or_else(
                || "script".to_owned(),
                |stem| stem.to_string_lossy().into_owned(),
            ),
            ModelName::Remote(name) => name.clone(),
        });
    names.take(2).collect::<Vec<_>>().join("-")
}

/// The folder of this run: the one named, else the newest with the same identity, else a new one.
fn folder(config: &Config, dataset: &Dataset, identity: &Identity) -> Result<PathBuf> {
    match &config.output.place {
        RunPlace::Named(path) => Ok(path.clone()),
        RunPlace::Resume(path) => match store::read_manifest(path)? {
            Some(_) => Ok(path.clone()),
            None => Err(Error::usage(
                "--resume",
                format_args!(
                    "{}: no run in this folder; a new run takes --out",
                    path.display()
                ),
            )),
        },
        RunPlace::Automatic => {
            let hash = &identity::digest(identity).to_string()[..8];
            let base = Path::new(RESULTS);
            Ok(store::find(base, hash).unwrap_or_else(|| {
                let time = Timestamp::now().strftime("%Y%m%d-%H%M%S");
                let name = format!("{time}-{}-{}-{hash}", label(config), dataset.name());
                base.join(name.replace(|c: char| !(c.is_alphanumeric() || "-_.".contains(c)), "_"))
            }))
        }
    }
}

fn manifest(config: &Config, identity: Identity, kept: Option<RunManifest>) -> RunManifest {
    let (created, mut platform) = kept.map_or_else(
        || (now(), BTreeMap::new()),
        |manifest| (manifest.created, manifest.platform),
    );
    platform.extend(identity::platform());
    RunManifest {
        schema: SCHEMA.to_owned(),
        status: Status::Started,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        created,
        updated: now(),
        platform,
        identity,
        settings: identity::settings(config),
        counts: Counts::default(),
    }
}

/// Now, in UTC, to the second.
fn now() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

/// The records in the plan's order, whatever order the replies came in.
fn in_order(records: Vec<Record>, keys: &[TrialKey]) -> Vec<Record> {
    let mut by_key: BTreeMap<TrialKey, Record> = records
        .into_iter()
        .map(|record| (record.key, record))
        .collect();
    keys.iter().filter_map(|key| by_key.remove(key)).collect()
}

fn count(trials: usize, records: &[Record]) -> Counts {
    let failed = records
        .iter()
        .filter(|record| record.outcome == Outcome::Failed)
        .count();
    Counts {
        trials,
        answered: records.len() - failed,
        failed,
    }
}
