//! What differs between the things that are asked: [`Experiment`].

use serde_json::Value;

use super::identity::{Columns, Identity};
use super::models::ModelUnderTest;
use super::outcome::{Outcome, StdoutFormat};
use super::plan::SourcePlan;
use super::recipe::Recipe;
use super::settings::JobSettings;
use super::source::{Frames, Source};
use super::stored::StoredRun;
use super::trial::Item;
use crate::ask::Server;
use crate::error::Result;
use crate::store::Store;
use crate::types::{Record, RunQuestion};

/// The record of a trial of an experiment.
pub(crate) type RecordOf<E> = Record<DetailOf<E>>;

/// What an experiment adds to a record.
pub(crate) type DetailOf<E> = <<E as Experiment>::Item as Item>::Detail;

/// A request of a later phase that no plan can know yet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ExpectedRequest {
    /// The model, by its place among those of the phase.
    pub(crate) model: usize,
    /// How many tokens its words are likely to have.
    pub(crate) words: f64,
    /// How many tokens its reply is likely to have.
    pub(crate) reply: f64,
}

/// Something that is asked: questions with choices, or open ones with marks. Opened and checked; nothing is asked, and nothing written.
pub(crate) trait Experiment: Sync {
    /// What one trial is about.
    type Item: Item;

    /// What is asked one after the other: a phase is planned when those before it have ended.
    const PHASES: &'static [&'static str];

    /// What a reply is, in words.
    const REPLY: &'static str;

    /// The settings that every experiment has.
    fn settings(&self) -> &JobSettings;

    /// The endpoint that is asked most; `None` if all models are built in.
    fn server(&self) -> Option<&Server> {
        self.settings().ask.server.as_ref()
    }

    /// What the data are called, in the name of a run folder.
    fn data(&self) -> &str;

    /// The models of a phase.
    fn models(&self, phase: usize) -> &[ModelUnderTest];

    /// What is shown.
    fn sources(&self) -> &[Source];

    /// Where the files of the sources' frames come from.
    fn frames(&self) -> &dyn Frames;

    /// What decides the pixels that are sent.
    fn recipe(&self) -> &Recipe;

    /// The questions, as the run keeps them.
    fn questions(&self) -> Vec<RunQuestion>;

    /// What all trials share and no column tells apart.
    fn identity(&self) -> Identity;

    /// What each value of a column stands for.
    fn columns(&self) -> Columns;

    /// What decides by itself neither a reply nor an image, and may explain how a run went.
    fn notes(&self) -> Vec<(&'static str, Value)> {
        Vec::new()
    }

    /// Records that are not asked for but given, as answers in files.
    fn given(&self) -> &[RecordOf<Self>] {
        &[]
    }

    /// All trials of a phase, those that have a reply among them.
    fn plan(&self, phase: usize, stored: &[RecordOf<Self>]) -> Result<Vec<SourcePlan<Self::Item>>>;

    /// Requests of later phases that no plan can know yet: marks of answers to come.
    fn to_come(&self, _left: &[SourcePlan<Self::Item>]) -> Vec<ExpectedRequest> {
        Vec::new()
    }

    /// Scores what a run holds, and writes its report and its manifest into its folder. It is incomplete if not all that came is scored.
    fn report(
        &self,
        store: &Store<DetailOf<Self>>,
        run: StoredRun<DetailOf<Self>>,
        show: StdoutFormat,
    ) -> Result<Outcome>;
}
