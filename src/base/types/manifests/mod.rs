//! Manifests of runs: the models and settings of a run, and notes about its images and enhancers.

mod enhancer_note;
mod flaw;
mod input_note;
mod manifest;
mod model_listing;
mod recorded_names;
mod size_log;
mod stored_views;

pub use enhancer_note::{
    ConventionLine, ELSEWHERE, EnhancerNote, FlawedImage, JudgedImages, ProbeNote, ProbeOutcome, TRAINED_ON,
};
pub use flaw::Flaw;
pub use input_note::{ColourHandling, ColourNote, DepthNote, InputNote, InputSummary};
pub use manifest::{
    ColumnDifference, Columns, Counts, FIRST_REPLY_READING, Identity, JUDGES, PartPlace, RunManifest, RunPart, Status,
    differences, judge_flag,
};
pub use model_listing::{ListedModel, ModelColumn, ModelListing};
pub use recorded_names::RecordedNames;
pub use size_log::{SeamCounts, SizeLog};
pub use stored_views::{Fit, StoredViews, Views};
