//! The interface between the engine and what is asked: [`Experiment`].

use serde_json::Value;

use crate::engine::models::ModelUnderTest;
use crate::engine::settings::JobSettings;
use crate::error::Result;
use crate::images::plan::SourcePlan;
use crate::images::recipe::Recipe;
use crate::images::source::{Frames, Source};
use crate::images::trial::Item;
use crate::report::power::PowerForecast;
use crate::runs::outcome::{Outcome, StdoutFormat};
use crate::runs::stored::StoredRun;
use crate::store::Store;
use crate::types::manifest::PartPlace;
use crate::types::manifest::{Columns, Identity};
use crate::types::{Record, RunQuestion};

/// The record of a trial of an experiment.
pub(crate) type RecordOf<E> = Record<DetailOf<E>>;

/// The fields that an experiment adds to a record.
pub(crate) type DetailOf<E> = <<E as Experiment>::Item as Item>::Detail;

/// A request of a later phase that cannot be planned yet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ExpectedRequest {
    /// Index of the model among those of the phase.
    pub(crate) model: usize,
    /// Expected tokens of its text.
    pub(crate) text_tokens: f64,
    /// Expected tokens of its reply.
    pub(crate) reply_tokens: f64,
}

/// Questions with choices, or open questions with marks; opened and checked. Nothing is asked or written before it is carried out.
pub(crate) trait Experiment: Sync {
    /// The subject of one trial.
    type Item: Item;

    /// Names of the phases, in order. A phase is planned when those before it have ended.
    const PHASES: &'static [&'static str];

    /// Description of the shortest reply, for the estimate of cost.
    const REPLY: &'static str;

    /// The noun for one source: frame or walk.
    const SOURCE: &'static str;

    /// The settings that every experiment has.
    fn settings(&self) -> &JobSettings;

    /// Name of the data, for the name of a run folder.
    fn data(&self) -> &str;

    /// Models that are asked in a phase.
    fn models(&self, phase: usize) -> &[ModelUnderTest];

    /// The flag of the token limit in a phase.
    fn token_flag(&self, _phase: usize) -> &'static str {
        "--max-tokens"
    }

    /// All sources of the run.
    fn sources(&self) -> &[Source];

    /// Place of these sources among those of the whole run; `None` if this is the whole run.
    fn part(&self) -> Option<PartPlace>;

    /// Reader of the frames' files.
    fn frames(&self) -> &dyn Frames;

    /// Settings that decide the pixels that are sent.
    fn recipe(&self) -> &Recipe;

    /// Questions, as the run folder stores them.
    fn questions(&self) -> Vec<RunQuestion>;

    /// Settings that all trials share and no column tells apart.
    fn identity(&self) -> Identity;

    /// Definition of each value of a column.
    fn columns(&self) -> Columns;

    /// Settings that decide neither a reply nor an image, but may explain how a run went.
    fn notes(&self) -> Vec<(&'static str, Value)> {
        Vec::new()
    }

    /// The effect that the whole run can detect; `None` if unknown.
    fn power(&self) -> Option<PowerForecast> {
        None
    }

    /// Records from files of answers, which are not asked.
    fn imported_records(&self) -> &[RecordOf<Self>] {
        &[]
    }

    /// All trials of a phase, including those with a reply. The records so far are read only where the trials follow from replies.
    fn plan(
        &self,
        phase: usize,
        records: impl FnOnce() -> Result<Vec<RecordOf<Self>>>,
    ) -> Result<Vec<SourcePlan<Self::Item>>>;

    /// Requests of later phases that cannot be planned yet: marks of answers that have not arrived.
    fn expected_requests(&self, _remaining: &[SourcePlan<Self::Item>]) -> Vec<ExpectedRequest> {
        Vec::new()
    }

    /// Scores a run, and writes its report and manifest into its folder. The outcome is incomplete if a reply cannot be scored.
    fn report(
        &self,
        store: &Store<DetailOf<Self>>,
        run: StoredRun<DetailOf<Self>>,
        show: StdoutFormat,
    ) -> Result<Outcome>;
}
