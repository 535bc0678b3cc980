//! THE CONDUCTOR: the only place that sees every stage, and the only bridge between CPU work and waiting.
//!
//! [`evaluate`] reads as the sentence it carries out: open the data, open the models, open the run folder, plan what is
//! left to ask, send the darkroom to make the images and ask about them, score, show.

mod again;
mod arrangement;
mod askers;
pub mod batch;
mod cores;
mod darkroom;
mod drive;
pub mod enhance;
pub mod export;
mod forecast;
mod gallery;
mod identity;
pub mod import;
mod inputs;
mod interface;
mod interrupt;
mod ledger;
pub mod merge;
mod observer;
pub mod openeqa;
mod plan;

pub mod progress;
pub mod questions;
pub mod realism;
mod recipe;
mod record;
pub mod report;
pub mod rooms;
pub mod serve;
pub mod show;
mod stage;
mod stop;
pub mod study;
pub mod synthesize;
mod thumbnail;
mod timings;
mod trial;
mod written;

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::Path;
use std::time::Instant;

use jiff::Timestamp;
use rayon::ThreadPool;
use serde_json::Value;

use crate::ask::ImageLimit;
use crate::config::{
    Ask, Config, Earnest, Enhancement, Images, Output, Recipe, RunPlace, Server, Show, Timing,
};
use crate::dataset::Dataset;
use crate::enhance::{Enhancer, ModelFile, Runtime};
use crate::error::Result;
use crate::report as reports;
use crate::store::{self, Moved, Store};
use crate::types::manifest::{Counts, RunManifest, Status};
use crate::types::{ChoiceDetail, Detail, Outcome, Question, Record, RunQuestion, TrialKey};

use cores::pool;
use darkroom::Darkroom;
use drive::{Drive, Tally};
use forecast::Means;
use identity::Identity;
use ledger::Ledger;
use plan::Plan;
use progress::Progress;
use stage::Stage;
use stop::End;
use thumbnail::Wanted;
use timings::Timings;

/// The folder of runs without a name of their own.
const RESULTS: &str = "results";

/// How an evaluation ended.
#[derive(Debug)]
pub struct Verdict {
    /// How far it came.
    pub status: Status,
    /// What belongs on standard output.
    pub output: String,
}

/// Runs an evaluation, or goes on with it.
///
/// # Errors
/// Where nothing can be asked, or no further trial could succeed; what had arrived by then is kept.
pub fn evaluate(config: &Config, progress: &Progress) -> Result<Verdict> {
    Stage::set(config, progress, |stage| match config.earnest {
        Earnest::Estimate => estimate(config, stage),
        Earnest::Run => ask(config, stage, progress),
    })
}

/// Asks what is left.
fn ask(config: &Config, stage: Stage<'_>, progress: &Progress) -> Result<Verdict> {
    let Stage {
        dataset,
        questions,
        inputs,
        files,
        identity,
        folder,
    } = stage;
    let kept = store::read_manifest(&folder, ChoiceDetail::SCHEMA)?;
    // Opened before the folder is made, so that an enhancer that does not work leaves nothing behind.
    let opened = match &kept {
        Some(manifest) if manifest.status == Status::Complete => Err(files),
        _ => Ok(open_enhancers(files, &config.enhancement)?),
    };
    let settings = identity::settings(&config.pace, &config.enhancement, &config.ask);
    let images = config.recipe.clone();
    let mut manifest = manifest(ChoiceDetail::SCHEMA, identity, settings, images, kept);
    let mut store = Store::open(&folder, &manifest, moved(&config.output))?;
    store.write_questions(&listed(questions, dataset))?;
    let frames = questions.iter().map(|question| &question.frame);
    let wanted = Wanted::new(frames, store::read_thumbnails(&folder)?);
    let kept = store.records()?;
    let ledger = Ledger::new(&config.money, inputs.askers, &kept)?;
    let mut plan = Plan::new(&inputs, &kept)?;
    drop(kept);
    leave_out(&mut plan, &store.out_in_batches()?, &folder);
    let trials = plan.keys.clone();
    let end = if plan.left() == 0 {
        End::Through
    } else {
        let (runtime, enhancers) =
            opened.or_else(|files| open_enhancers(files, &config.enhancement))?;
        let version =
            runtime.map(|runtime| ("onnxruntime".to_owned(), runtime.version().to_owned()));
        manifest.platform.extend(version);
        // A killed run says how much there was to ask.
        manifest.counts = Counts {
            trials: trials.len(),
            answered: trials.len() - plan.left(),
            failed: 0,
        };
        store.write_manifest(&manifest)?;
        if plan.left() < trials.len() {
            let answered = trials.len() - plan.left();
            progress.say(&format!(
                "{}: {answered} of {} trials are answered already",
                folder.display(),
                trials.len()
            ));
        }
        let cores = pool(config.enhancement.threads)?;
        let threads = cores.current_num_threads();
        let benches: Vec<ThreadPool> = (0..threads)
            .map(|_| pool(Some(NonZeroUsize::MIN)))
            .collect::<Result<_>>()?;
        let timings = Timings::default();
        let stoppers = enhancers.iter().map(Enhancer::stopper).collect();
        let mut darkroom = Darkroom {
            dataset,
            pictures: inputs.pictures,
            recipe: &inputs.recipe,
            enhancers,
            limit: limit(&config.ask, &config.images),
            timings: &timings,
        };
        cores.install(|| darkroom.check(&plan.frames))?;
        let drive = Drive {
            askers: inputs.askers,
            progress,
            pace: &config.pace,
            endpoint: endpoint(config.ask.server.as_ref()),
            timings: &timings,
        };
        let started = Instant::now();
        let tally = Tally {
            trials: trials.len(),
            answered: trials.len() - plan.left(),
        };
        let end = drive.run(tally, ledger, &mut store, stoppers, |out| {
            darkroom.develop(plan.frames, &wanted, (&cores, &benches), out);
        })?;
        if config.timings == Timing::Told {
            progress.note(&timings.told(started.elapsed(), threads));
        }
        end
    };
    if let (End::Spent, Some(most)) = (&end, config.money.most) {
        tracing::warn!(
            "stopped: one more question could cost more than the {} of --max-cost; the same command with more goes on",
            reports::forecast::money(most)
        );
    }
    manifest.settings.extend(askers::adapted(inputs.askers));
    show(config, &store, manifest, end, &trials)
}

/// Where the models are asked, in words.
fn endpoint(server: Option<&Server>) -> String {
    server.map_or("built-in models".to_owned(), |server| {
        server.access.base.to_string()
    })
}

/// The questions as the run keeps them.
fn listed(questions: &[Question], dataset: &Dataset) -> Vec<RunQuestion> {
    let list = questions.iter();
    list.map(|question| RunQuestion::new(question, &dataset.scene(&question.frame)))
        .collect()
}

/// Leaves out of a plan what a Batch API has been asked and has not answered: it would be paid for twice.
fn leave_out(plan: &mut Plan, out: &BTreeSet<TrialKey>, folder: &Path) {
    let left_out = plan.leave_out(out);
    if left_out > 0 {
        tracing::warn!(
            "{left_out} trials are out in a batch and are not asked here; take their replies over by batch import, or delete {} \
             to have them asked",
            folder.join(store::BATCH).display()
        );
    }
}

/// Says what is left to ask and what it would take; sends nothing and leaves no file.
fn estimate(config: &Config, stage: Stage<'_>) -> Result<Verdict> {
    let Stage {
        dataset,
        inputs,
        files,
        folder,
        ..
    } = stage;
    let kept: Vec<Record> = store::read_records(&folder)?;
    let ledger = Ledger::new(&config.money, inputs.askers, &kept)?;
    let plan = Plan::new(&inputs, &kept)?;
    let (_, enhancers) = open_enhancers(files, &config.enhancement)?;
    let mut darkroom = Darkroom {
        dataset,
        pictures: inputs.pictures,
        recipe: &inputs.recipe,
        enhancers,
        limit: None,
        timings: &Timings::default(),
    };
    let means = Means {
        config,
        askers: inputs.askers,
        plan: &plan,
        ledger: &ledger,
        kept: &kept,
        limit: limit(&config.ask, &config.images),
    };
    let forecast = forecast::forecast(&means, &mut darkroom)?;
    let output = match config.output.show {
        Show::Json => reports::forecast::json(&forecast)?,
        Show::Table => reports::forecast::render(&forecast),
    };
    Ok(Verdict {
        status: Status::Complete,
        output,
    })
}

/// The largest image that the endpoint takes; `None` where all models are built in.
fn limit(ask: &Ask, images: &Images) -> Option<ImageLimit> {
    let server = ask.server.as_ref()?;
    let known = || ImageLimit::of(&server.access.base);
    Some(images.largest.map_or_else(known, ImageLimit::stated))
}

/// Scores what a run holds, and leaves it in its folder where that says anything new.
fn show(
    config: &Config,
    store: &Store,
    mut manifest: RunManifest,
    end: End,
    trials: &[TrialKey],
) -> Result<Verdict> {
    let records = in_order(store.records()?, trials)?;
    let counts = count(trials.len(), &records);
    let status = end.status(counts);
    if (status, counts) != (manifest.status, manifest.counts) {
        (manifest.status, manifest.counts, manifest.updated) = (status, counts, now());
    }
    let output = report::leave(store, &manifest, records, config.output.show)?;
    if let End::Stopped(error) | End::Retired(error) = end {
        return Err(error);
    }
    Ok(Verdict { status, output })
}

/// Whether the run may lie at another address than before: only where it is named as the one to go on with.
fn moved(output: &Output) -> Moved {
    match output.place {
        RunPlace::Resume(_) => Moved::Allowed,
        RunPlace::Named(_) | RunPlace::Automatic => Moved::Refused,
    }
}

fn open_enhancers(
    files: Vec<ModelFile>,
    config: &Enhancement,
) -> Result<(Option<Runtime>, Vec<Enhancer>)> {
    if files.is_empty() {
        return Ok((None, Vec::new()));
    }
    let runtime = config.runtime.open()?;
    let threads = config.threads;
    let enhancers = files
        .into_iter()
        .map(|file| {
            let enhancer = Enhancer::open(file, &runtime, threads)?;
            Ok(enhancer
                .with_tiling(config.tiling)
                .with_most_side(config.most_side))
        })
        .collect::<Result<_>>()?;
    Ok((Some(runtime), enhancers))
}

/// The manifest of a run under way; one that was kept goes on as it is.
fn manifest(
    schema: &str,
    identity: Identity,
    settings: BTreeMap<String, Value>,
    images: Recipe,
    kept: Option<RunManifest>,
) -> RunManifest {
    let version = env!("CARGO_PKG_VERSION").to_owned();
    match kept {
        Some(kept) if kept.status == Status::Complete => RunManifest { identity, ..kept },
        kept => RunManifest {
            schema: schema.to_owned(),
            status: Status::Started,
            version,
            created: kept.map_or_else(now, |manifest| manifest.created),
            updated: now(),
            platform: identity::platform(),
            identity,
            settings,
            images,
            counts: Counts::default(),
        },
    }
}

/// Now, in UTC, to the second.
fn now() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

/// The records in the plan's order, whatever order the replies came in, and read anew: a reply is read alike wherever it
/// stands in a table, also where an earlier version of this program has kept it.
fn in_order(records: Vec<Record>, keys: &[TrialKey]) -> Result<Vec<Record>> {
    let mut by_key: BTreeMap<TrialKey, Record> = records
        .into_iter()
        .map(|record| (record.key, record))
        .collect();
    let records = keys.iter().filter_map(|key| by_key.remove(key));
    records.map(Record::reread).collect()
}

fn count(trials: usize, records: &[Record]) -> Counts {
    let failed = records
        .iter()
        .filter(|record| record.detail.outcome == Outcome::Failed)
        .count();
    Counts {
        trials,
        answered: records.len() - failed,
        failed,
    }
}
