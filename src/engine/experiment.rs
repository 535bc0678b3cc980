//! The interface between the engine and a type of evaluation: [`Experiment`].

use serde_json::Value;

use crate::images::frames::{Frames, Source};
use crate::images::recipes::Recipe;
use crate::images::trials::{Item, Plan, SourcePlan};
use crate::models::ModelUnderTest;
use crate::settings::JobSettings;
use darkqa_base::error::Result;
use darkqa_base::types::manifests::{Columns, Identity, PartPlace, RunManifest};
use darkqa_base::types::{Record, RunQuestion, TrialKey};
use darkqa_runs::forecast::PowerForecast;
use darkqa_runs::outcome::{Outcome, StdoutFormat};
use darkqa_runs::stored::StoredRun;
use darkqa_score::choice::llm_match::Protocol;
use darkqa_store::Store;

/// Record type of an experiment's trials.
pub type RecordOf<E> = Record<DetailOf<E>>;

/// The fields that an experiment adds to a record.
pub type DetailOf<E> = <<E as Experiment>::Item as Item>::Detail;

/// A request of a later phase that cannot be planned before the replies of an earlier one.
#[derive(Debug, Clone, Copy)]
pub struct ExpectedRequest {
    /// Index of the model in [`Experiment::models`] of its phase.
    pub model: usize,
    /// Expected number of text tokens in the prompt.
    pub text_tokens: f64,
    /// Expected number of tokens in the reply.
    pub reply_tokens: f64,
}

/// An evaluation that is ready to run: multiple-choice questions, or open questions whose answers a judge marks. Its
/// inputs are opened and checked, but no request was sent and nothing was written yet.
pub trait Experiment: Sync {
    /// The question, or the answer to judge, of one trial.
    type Item: Item;

    /// Names of the phases, in order. A phase is planned after all earlier phases have ended.
    const PHASES: &'static [&'static str];

    /// Description of the shortest reply, as the cost estimate prints it.
    const REPLY: &'static str;

    /// The word for one source: `frame` or `walk`.
    const SOURCE: &'static str;

    /// Settings that are common to all experiments.
    fn settings(&self) -> &JobSettings;

    /// Name of the data set, used in the name of the run folder.
    fn data(&self) -> &str;

    /// Models that receive requests in a phase.
    fn models(&self, phase: usize) -> &[ModelUnderTest];

    /// The command-line flag that limits the reply tokens in a phase.
    fn token_flag(&self, _phase: usize) -> &'static str {
        "--max-tokens"
    }

    /// The protocol by which the replies of a phase are read as marks; `None` for answers.
    fn mark_protocol(&self, _phase: usize) -> Option<Protocol> {
        None
    }

    /// Image sources (frames or walks) of this run or shard.
    fn sources(&self) -> &[Source];

    /// In a shard, the sources of the whole run that enhancers are tried on; empty for those of
    /// [`sources`](Self::sources).
    fn probe_sources(&self) -> &[Source] {
        &[]
    }

    /// Position of these sources in the whole run, for a shard; `None` if this is the whole run.
    fn part(&self) -> Option<PartPlace>;

    /// Reader of the frame files.
    fn frames(&self) -> &dyn Frames;

    /// Settings that determine the pixels sent to the models.
    fn recipe(&self) -> &Recipe;

    /// Questions in the form that the run folder stores.
    fn questions(&self) -> Vec<RunQuestion>;

    /// Settings that apply to all trials of a run and are not a column of the tables.
    fn identity(&self) -> Identity;

    /// Definition of each value in each column of the tables.
    fn columns(&self) -> Columns;

    /// Settings that affect neither a reply nor an image, recorded because they may explain a run.
    fn notes(&self) -> Vec<(&'static str, Value)> {
        Vec::new()
    }

    /// The effect size that the whole run can detect; `None` if unknown.
    fn power(&self) -> Option<PowerForecast> {
        None
    }

    /// Records imported from answer files; no model is asked for them.
    fn imported_records(&self) -> &[RecordOf<Self>] {
        &[]
    }

    /// Calls `add` with the trials of a phase, source by source, including those that already have a reply. `records`
    /// reads the records so far; it is called only if the trials depend on replies of an earlier phase.
    fn each_source(
        &self,
        phase: usize,
        records: impl FnOnce() -> Result<Vec<RecordOf<Self>>>,
        add: &mut dyn FnMut(SourcePlan<Self::Item>),
    ) -> Result<()>;

    /// All trials of a phase, as for [`each_source`](Self::each_source).
    fn plan(
        &self,
        phase: usize,
        records: impl FnOnce() -> Result<Vec<RecordOf<Self>>>,
    ) -> Result<Vec<SourcePlan<Self::Item>>> {
        let mut sources = Vec::new();
        self.each_source(phase, records, &mut |source| sources.push(source))?;
        Ok(sources)
    }

    /// The plan of a phase without the trials that `is_excluded` accepts, which are never in memory together.
    fn plan_without(
        &self,
        phase: usize,
        records: impl FnOnce() -> Result<Vec<RecordOf<Self>>>,
        is_excluded: impl Fn(&TrialKey) -> bool,
    ) -> Result<Plan<Self::Item>> {
        let mut plan = Plan::new(Vec::new());
        self.each_source(phase, records, &mut |source| plan.add(source, &is_excluded))?;
        Ok(plan)
    }

    /// Requests of later phases that cannot be planned yet, such as the judge's marks for answers that have not
    /// arrived.
    fn expected_requests(&self, _remaining: &[SourcePlan<Self::Item>]) -> Vec<ExpectedRequest> {
        Vec::new()
    }

    /// The outcome of [`report`](Self::report) on the run with this manifest, if the report in its folder is made from
    /// the same records and settings; otherwise `None`.
    fn unchanged_report(
        &self,
        _store: &Store<DetailOf<Self>>,
        _manifest: &RunManifest,
        _show: StdoutFormat,
    ) -> Result<Option<Outcome>> {
        Ok(None)
    }

    /// Scores a run, and writes the report and the manifest into the run folder. The outcome is incomplete if a reply
    /// cannot be scored.
    fn report(
        &self,
        store: &Store<DetailOf<Self>>,
        run: StoredRun<DetailOf<Self>>,
        show: StdoutFormat,
    ) -> Result<Outcome>;
}
