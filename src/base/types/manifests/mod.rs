//! Manifests of runs: the models and settings of a run, and notes about its images and enhancers.

mod enhancer_note;
mod input_note;
mod manifest;
mod model_listing;

pub use enhancer_note::{
    ConventionLine, ELSEWHERE, EnhancerLatency, EnhancerNote, FlawedImage, JudgedImages, ProbeNote, ProbeOutcome,
    SeamCounts, SizeLog, TRAINED_ON, milliseconds,
};
pub use input_note::{ColourHandling, ColourNote, DepthNote, Flaw, InputNote, InputSummary};
pub use manifest::{
    ColumnDifference, Columns, Counts, FIRST_REPLY_READING, Fit, Identity, JUDGES, PartPlace, PngForm, RecordedNames,
    RunManifest, RunPart, Status, StoredViews, Views, differences, judge_flag,
};
pub use model_listing::{ListedModel, ModelColumn, ModelListing};
