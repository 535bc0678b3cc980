//! Frames that are shown together, their photographs, and walks.

mod input_tally;
mod photograph;
pub(crate) mod photographs;
mod source;
mod walk;

pub(crate) use input_tally::InputTally;
pub(super) use photograph::{SourcePhotograph, matching_degradation};
pub(crate) use source::{
    Frames, Source, SourceFrame, first_question_per_frame, input_summary, inspect_all, warn_of_inputs,
};
pub(super) use walk::{CameraScope, DegradeStage};
pub(crate) use walk::{WalkArgs, WalkFolder};
