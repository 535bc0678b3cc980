//! `openeqa`: open questions about walks through dark houses, and a judge that marks the answers.
//!
//! [`openeqa`] asks for the answers first, walk by walk, and then for the marks of those that came; both by the machinery of an
//! evaluation. A run folder is found by content: models, levels, answers of people and judges may be added to it.

mod batch;
mod episode;
mod forecast;
mod given;
mod item;
mod marks;
mod outcome;
mod plan;
mod stage;
mod study;
mod theatre;

use std::collections::{BTreeMap, BTreeSet, HashSet};

use rayon::ThreadPool;

use super::askers;
use super::cores::pool;
use super::drive::{Drive, Tally};
use super::ledger::Ledger;
use super::progress::Progress;
use super::stop::End;
use super::thumbnail::Wanted;
use super::timings::Timings;
use super::trial::{Exposed, Slide};
use super::{Verdict, endpoint, identity, manifest, moved, open_enhancers};
use crate::config::{OpenEqa, OpenTask};
use crate::enhance::Enhancer;
use crate::error::{Error, Result};
use crate::report::forecast::money;
use crate::store::{self, Store};
use crate::types::manifest::RunManifest;
use crate::types::{Detail, FrameId, OpenDetail, Record, TrialKey};

use marks::{Kept, Marks, Prediction, predictions};
use plan::{Due, Plan};
use stage::Stage;
use theatre::Theatre;

/// Carries out what is to be done.
///
/// # Errors
/// Where nothing can be asked, or no further trial could succeed; what had arrived by then is kept.
pub fn openeqa(config: &OpenEqa, progress: &Progress) -> Result<Verdict> {
    let stage = Stage::set(config, progress)?;
    match &config.task {
        OpenTask::Run => Run::open(config, stage, progress)?.ask(),
        OpenTask::Batch(files) => Run::open(config, stage, progress)?.export(files),
        OpenTask::Estimate => forecast::estimate(config, stage),
        OpenTask::Study(folder) => study::pack(config, stage, folder, progress),
    }
}

/// A run of open questions under way.
struct Run<'a> {
    config: &'a OpenEqa,
    stage: Stage<'a>,
    progress: &'a Progress,
    cores: ThreadPool,
    store: Store<OpenDetail>,
    manifest: RunManifest,
    /// The answers that were given in files.
    given: Vec<Record<OpenDetail>>,
    /// Every answer that is due, there or not.
    due: Vec<Due>,
}

impl<'a> Run<'a> {
    /// Opens the run folder, and takes the answers of files over into it.
    fn open(config: &'a OpenEqa, stage: Stage<'a>, progress: &'a Progress) -> Result<Self> {
        let given = all_given(config, &stage)?;
        let kept = store::read_manifest(&stage.folder, OpenDetail::SCHEMA)?;
        let mut settings = identity::settings(&config.pace, &config.enhancement, &config.ask);
        settings.extend(outcome::settings(config, &stage));
        let mut manifest = manifest(
            OpenDetail::SCHEMA,
            stage.identity.clone(),
            BTreeMap::new(),
            BTreeMap::new(),
            kept,
        );
        // Those of the last command, whatever the run was begun with: judge and protocol may be others.
        manifest.settings = settings;
        let mut store = Store::<OpenDetail>::open(&stage.folder, &manifest, moved(&config.output))?;
        let there: HashSet<TrialKey> = store.records()?.iter().map(|record| record.key).collect();
        for record in given.iter().filter(|record| !there.contains(&record.key)) {
            store.append(record)?;
        }
        Ok(Self {
            config,
            due: Plan::new(&stage, &HashSet::new())?.due,
            stage,
            progress,
            cores: pool(config.enhancement.threads)?,
            store,
            manifest,
            given,
        })
    }

    /// Asks what is left: answers, and then marks.
    fn ask(mut self) -> Result<Verdict> {
        let mut end = self.answers()?;
        if matches!(end, End::Through | End::Retired(_)) {
            // What the other models have answered is marked all the same.
            let marked = self.marks()?;
            if matches!(end, End::Through) {
                end = marked;
            }
        }
        if let (End::Spent, Some(most)) = (&end, self.config.money.most) {
            tracing::warn!(
                "stopped: one more question could cost more than the {} of --max-cost; the same command with more goes on",
                money(most)
            );
        }
        let askers = self.stage.askers.iter().chain(&self.stage.judge);
        self.manifest.settings.extend(askers::adapted(askers));
        self.show(end)
    }

    /// The records by their keys.
    fn kept(&self) -> Result<Kept> {
        let records = self.store.records()?.into_iter();
        Ok(records.map(|record| (record.key, record)).collect())
    }

    /// The trials that have a reply, and those that are out in a batch.
    fn there(&self, kept: &Kept) -> Result<(HashSet<TrialKey>, HashSet<TrialKey>)> {
        let answered = kept.values().filter(|record| !record.failed());
        let answered: HashSet<TrialKey> = answered.map(|record| record.key).collect();
        let mut out = self.store.out_in_batches()?;
        out.retain(|key| !answered.contains(key));
        Ok((answered, out.into_iter().collect()))
    }

    fn answers(&mut self) -> Result<End> {
        let kept = self.kept()?;
        let (answered, out) = self.there(&kept)?;
        let plan = Plan::new(&self.stage, &answered.union(&out).copied().collect())?;
        self.left_out(plan.due.iter().filter(|due| out.contains(&due.key)).count());
        let left = plan.left();
        if left == 0 {
            return Ok(End::Through);
        }
        let files = std::mem::take(&mut self.stage.files);
        let (runtime, enhancers) = open_enhancers(files, &self.config.enhancement)?;
        let version =
            runtime.map(|runtime| ("onnxruntime".to_owned(), runtime.version().to_owned()));
        self.manifest.platform.extend(version);
        self.store.write_manifest(&self.manifest)?;
        let stoppers = enhancers.iter().map(Enhancer::stopper).collect();
        let mut theatre = Theatre::new(self.config, &self.stage, enhancers);
        self.cores.install(|| theatre.sample(&plan.walks))?;
        let askers = &self.stage.askers;
        let ledger = Ledger::new(&self.config.money, askers, kept.values())?;
        let tally = Tally {
            trials: plan.due.len(),
            answered: plan.due.len() - left,
        };
        let drive = Drive {
            askers,
            progress: self.progress,
            pace: &self.config.pace,
            endpoint: endpoint(self.config.ask.server.as_ref()),
            timings: &Timings::default(),
        };
        let names = self.stage.episodes.iter();
        let names: Vec<FrameId> = names.map(|episode| FrameId(episode.name.clone())).collect();
        let wanted = Wanted::new(&names, store::read_thumbnails(self.store.folder())?);
        let cores = &self.cores;
        drive.run(tally, ledger, &mut self.store, stoppers, |out| {
            cores.install(|| theatre.show(plan.walks, &wanted, out));
        })
    }

    fn marks(&mut self) -> Result<End> {
        let Some(judge) = self.stage.judge.clone() else {
            return Ok(End::Through);
        };
        let kept = self.kept()?;
        let (marked, out) = self.there(&kept)?;
        let marks = self.left_to_mark(&kept, &marked.union(&out).copied().collect());
        self.left_out(marks.due.iter().filter(|key| out.contains(key)).count());
        if marks.left.is_empty() {
            return Ok(End::Through);
        }
        let judge = std::slice::from_ref(&judge);
        let ledger = Ledger::new(&self.config.money, judge, kept.values())?;
        let tally = Tally {
            trials: marks.due.len(),
            answered: marks.due.len() - marks.left.len(),
        };
        let server = self.config.judge.as_ref();
        let drive = Drive {
            askers: judge,
            progress: self.progress,
            pace: &self.config.pace,
            endpoint: endpoint(server.and_then(|judge| judge.server.as_ref())),
            timings: &Timings::default(),
        };
        let exposed = Exposed {
            slide: Slide::default(),
            trials: marks.left,
            problem: None,
            thumbnail: None,
        };
        drive.run(tally, ledger, &mut self.store, Vec::new(), |out| {
            // Where nobody listens the run has ended already.
            let _ = out.blocking_send(exposed);
        })
    }

    /// The answers that are to be marked and have no mark among those that are `there`.
    fn left_to_mark(&self, kept: &Kept, there: &HashSet<TrialKey>) -> Marks {
        Marks::new(&self.stage, &self.predictions(kept), there)
    }

    /// Every answer that is due or was given.
    fn predictions(&self, kept: &Kept) -> Vec<Prediction> {
        let protocol = self.config.protocol;
        predictions(&self.stage, &self.due, &self.given, kept, protocol)
    }

    /// Says what a Batch API has been asked and has not answered: asked here, it would be paid for twice.
    fn left_out(&self, trials: usize) {
        if trials > 0 {
            tracing::warn!(
                "{trials} trials are out in a batch and are not asked here; take their replies over by batch import, or delete {} to \
                 have them asked",
                self.store.folder().join(store::BATCH).display()
            );
        }
    }
}

/// The answers of all files.
fn all_given(config: &OpenEqa, stage: &Stage<'_>) -> Result<Vec<Record<OpenDetail>>> {
    let mut names: BTreeSet<&str> = stage
        .askers
        .iter()
        .map(|asker| asker.model.name())
        .collect();
    let mut all = Vec::new();
    for file in &config.given {
        if !names.insert(&file.name) {
            let problem = format_args!("{} is named twice among models and answers", file.name);
            return Err(Error::usage("--answers", problem));
        }
        all.extend(given::given(file, stage, config.light.variants)?);
    }
    Ok(all)
}
