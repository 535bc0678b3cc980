//! An experiment in its run folder: [`Job`].
//!
//! The folder of a run: [`find`].

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use serde_json::json;

use super::models::{AskSettings, ModelName};
use super::settings::{JobSettings, RESULTS, RunPlace};
use crate::batch::{self, BatchFileArgs, BatchRunArgs};
use crate::costs::{MeasuredTokens, estimate};
use crate::experiment::{DetailOf, Experiment};
use crate::images::enhancement::enhancers::EnhancerModels;
use crate::images::frames::{input_summary, warn_of_inputs};
use crate::images::progress::Progress;
use crate::images::recipes::Maker;
use crate::images::stored::StoredFindings;
use crate::images::timings::Timings;
use crate::images::trials::Plan;
use crate::open_run::{OpenRun, pipeline};
use crate::stored_keys::{answered, lost_for_good, truncated};
use crate::{dark_already, manifest};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{RunManifest, Status};
use darkqa_base::types::{Digest, StoredDetail as _, TrialKey};
use darkqa_enhance::ModelFile;
use darkqa_report::forecast::{forecast_json, render};
use darkqa_runs::forecast::Forecast;
use darkqa_runs::outcome::Outcome;
use darkqa_store::{AddressChange, Store};

/// An experiment and its run folder.
pub struct Job<'a, E: Experiment> {
    experiment: &'a E,
    /// Files of the enhancement models, not yet loaded.
    files: Vec<ModelFile>,
    /// Run folder, which may not exist yet.
    folder: PathBuf,
    progress: &'a Progress,
}

impl<'a, E: Experiment> Job<'a, E> {
    /// A job in the run folder of the experiment. Nothing is written.
    pub fn new(experiment: &'a E, files: Vec<ModelFile>, progress: &'a Progress) -> Result<Self> {
        Ok(Self { folder: find(experiment)?, experiment, files, progress })
    }

    /// Asks the remaining trials, or only estimates them (`--dry-run`).
    ///
    /// # Errors
    /// If nothing can be asked, or no further trial could succeed. Replies that had arrived are kept.
    pub fn run(self) -> Result<Outcome> {
        warn_of_inputs(&input_summary(self.experiment.sources()));
        if self.experiment.settings().money.dry_run { self.estimate() } else { self.open()?.ask() }
    }

    /// Writes the remaining requests as files of a Batch API, and marks their trials in the run as sent.
    ///
    /// # Errors
    /// If a model is built in, an image is larger than the endpoint accepts, or a file cannot be written.
    pub fn export_batch(self, files: &BatchFileArgs) -> Result<Outcome> {
        warn_of_inputs(&input_summary(self.experiment.sources()));
        batch::file::export(self.open()?, files)
    }

    /// Submits the remaining requests in batches, and waits for their replies.
    ///
    /// # Errors
    /// If a model is built in, or a server refuses a request that every further call would repeat. Submitted batches
    /// are kept, and the same command continues.
    pub fn run_batch(self, files: &BatchFileArgs, args: &BatchRunArgs) -> Result<Outcome> {
        warn_of_inputs(&input_summary(self.experiment.sources()));
        if self.experiment.settings().money.dry_run {
            return self.estimate();
        }
        batch::run::run(self.open()?, files, args)
    }

    /// Estimates the remaining requests and their cost, as the text to print. Sends nothing and writes no file.
    fn estimate(self) -> Result<Outcome> {
        let show = self.experiment.settings().show;
        let forecast = self.forecast()?;
        Ok(Outcome::text(Status::Complete, if show.is_json() { forecast_json(&forecast)? } else { render(&forecast) }))
    }

    /// Estimates the remaining requests and their cost. Sends nothing and writes no file.
    ///
    /// # Errors
    /// If the run has other settings, an enhancer cannot be opened, or an image cannot be made.
    pub fn forecast(self) -> Result<Forecast> {
        let experiment = self.experiment;
        let settings = experiment.settings();
        self.check_same_run()?;
        let stored = darkqa_store::read_trials::<DetailOf<E>>(&self.folder)?;
        let mut answered = answered(&stored);
        answered.extend(lost_for_good(&stored, settings));
        let (mut plans, mut measured) = (Vec::new(), Vec::new());
        for phase in 0..E::PHASES.len() {
            let mut plan = Plan::new(experiment.plan(phase, || darkqa_store::read_records(&self.folder))?);
            let models = experiment.models(phase).len();
            measured.push(MeasuredTokens::from_stored(models, &plan, experiment.sources(), &stored));
            let again = truncated(&stored, experiment.models(phase));
            plan.exclude(|key| answered.contains(key) && !again.contains(key));
            plans.push(plan);
        }
        if plans.iter().any(|plan| !plan.conditions().is_empty()) {
            dark_already::warn(experiment);
        }
        let timings = Timings::default();
        let enhancers = EnhancerModels::load(self.files, &settings.loading)?.take()?;
        let mut pipeline = pipeline(experiment, enhancers, None, &timings);
        for plan in &plans {
            pipeline.probe(experiment.sources(), &plan.sources)?;
        }
        estimate::estimate(experiment, &plans, &measured, &stored, &mut pipeline)
    }

    /// Checks that this command can continue the run in the folder, if there is one.
    ///
    /// # Errors
    /// If the run has other settings.
    fn check_same_run(&self) -> Result<()> {
        if darkqa_store::manifest_damage(&self.folder)?.is_some() {
            return Ok(());
        }
        let Some(stored) = darkqa_store::read_manifest(&self.folder, DetailOf::<E>::SCHEMA)? else {
            return Ok(());
        };
        let requested = manifest::run_manifest(self.experiment, Some(stored.clone()))?;
        let address_change = address_change(&self.experiment.settings().place);
        darkqa_store::check_same_run(&self.folder, &stored, &requested, address_change)
    }

    /// Opens the run folder.
    fn open(self) -> Result<OpenRun<'a, E>> {
        let Self { experiment, files, folder, progress } = self;
        let settings = experiment.settings();
        let damage = darkqa_store::manifest_damage(&folder)?;
        let stored = match damage {
            Some(_) => None,
            None => darkqa_store::read_manifest(&folder, DetailOf::<E>::SCHEMA)?,
        };
        let complete = stored.as_ref().is_some_and(|stored| stored.status == Status::Complete);
        let images = settings.images.open(settings.access)?;
        let mut enhancers = EnhancerModels::from_files(files, &settings.loading);
        if !complete {
            // Loaded before the folder is created, so that a broken enhancer leaves no folder. Enhancers with stored
            // findings were loaded by an earlier run, and are not loaded here.
            enhancers.open_runtime()?;
            let maker = Maker::new(enhancers.version(), &settings.loading.size);
            let are_all_known = match &images {
                Some(store) => StoredFindings::new(store, &maker).has_all(&enhancers)?,
                None => false,
            };
            if !are_all_known {
                enhancers.open()?;
            }
        }
        let manifest = manifest::run_manifest(experiment, stored)?;
        make(&folder, settings)?;
        if let Some(damage) = damage {
            restore_manifest(experiment, &folder, &manifest, &damage)?;
        }
        let mut store = Store::open(&folder, &manifest, address_change(&settings.place))?;
        let lacks_notes = store.repair_notes();
        store.add_questions(experiment.questions(), manifest.inputs.as_ref(), || planned_keys(experiment, &folder))?;
        let present: HashSet<TrialKey> = if experiment.imported_records().is_empty() {
            HashSet::new()
        } else {
            store.trials()?.iter().map(|trial| trial.key).collect()
        };
        for record in experiment.imported_records() {
            if !present.contains(&record.key) {
                store.append(record)?;
            }
        }
        Ok(OpenRun {
            experiment,
            progress,
            enhancers,
            store,
            lacks_notes,
            manifest,
            keys: HashSet::new(),
            images,
            unasked: None,
        })
    }
}

/// Keys of all trials of this command, in all phases.
fn planned_keys<E: Experiment>(experiment: &E, folder: &Path) -> Result<HashSet<TrialKey>> {
    let mut keys = HashSet::new();
    for phase in 0..E::PHASES.len() {
        keys.extend(experiment.plan_without(phase, || darkqa_store::read_records(folder), |_| true)?.keys);
    }
    Ok(keys)
}

/// Writes the manifest of this command into a run folder whose manifest is damaged. The command is taken for the one
/// that made the run if it plans the trials of all stored replies, because the key of a trial is a digest of everything
/// that affects its reply.
///
/// # Errors
/// If a stored reply belongs to a trial that this command does not plan.
fn restore_manifest<E: Experiment>(experiment: &E, folder: &Path, manifest: &RunManifest, damage: &str) -> Result<()> {
    let planned = planned_keys(experiment, folder)?;
    let trials = darkqa_store::read_trials::<DetailOf<E>>(folder)?;
    let (own, others) =
        trials.iter().filter(|trial| !trial.failed()).partition::<Vec<_>, _>(|trial| planned.contains(&trial.key));
    if !others.is_empty() {
        let problem = format!(
            "{damage}, and {} of {} replies are not of this command: the records are intact; call the command that made them, with all its \
             models, levels and flags",
            others.len(),
            own.len() + others.len()
        );
        let path = folder.to_owned();
        return Err(Error::Run { path, problem });
    }
    darkqa_store::restore_manifest(folder, manifest)?;
    tracing::warn!("{damage}; made again: all {} replies of the run are of this command", own.len());
    Ok(())
}

/// The folder of a run: the one named, else the newest of the same identity and plan, else a new one.
pub fn find<E: Experiment>(experiment: &E) -> Result<PathBuf> {
    let settings = experiment.settings();
    match settings.place.for_shard(settings.shard) {
        RunPlace::Named(path) => Ok(path),
        // The manifest is restored later, when the folder is opened.
        RunPlace::Resume(path) if darkqa_store::manifest_damage(&path)?.is_some() => Ok(path),
        RunPlace::Resume(path) => match darkqa_store::read_manifest(&path, DetailOf::<E>::SCHEMA)? {
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
pub fn make(folder: &Path, settings: &JobSettings) -> Result<()> {
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
        "trials": experiment.plan_without(0, || Ok(Vec::new()), |_| true)?.keys,
        "notes": experiment.notes(),
    });
    let hash = &Digest::canonical("darkqa.command/2", &facts)?.to_string()[..8];
    let base = Path::new(RESULTS);
    Ok(darkqa_store::find(base, hash).unwrap_or_else(|| {
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
pub fn address_change(place: &RunPlace) -> AddressChange {
    match place {
        RunPlace::Resume(_) => AddressChange::Allowed,
        RunPlace::Named(_) | RunPlace::Automatic => AddressChange::Refused,
    }
}
