//! Frames that are shown together, their photographs, and walks.

pub mod photographs;
mod source;
mod walk;

pub use source::{
    Frames, InputTally, Source, SourceFrame, first_question_per_frame, input_summary, inspect_all, warn_of_inputs,
};
pub use walk::{WalkArgs, WalkFolder};

pub(super) use source::{SourcePhotograph, matching_degradation};
pub(super) use walk::{CameraScope, DegradeStage};
