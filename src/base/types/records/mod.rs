//! Records of trials: their keys, columns and details, and notes about the images that were sent.

mod experiment_detail;
mod record;
mod small_number;
mod trials;

pub use record::{
    ChoiceDetail, Failure, FailureKind, ImageFacts, ImageFidelity, ObjectCrop, OpenDetail, ParsedAnswer, Record, Step,
    StoredDetail, Thumbnail, TrialKey, TrialOutcome, Via, View, WalkFacts,
};
pub use small_number::{SmallNumber, Tokens};
pub use trials::{
    AskedItem, AskedParts, ChoiceFacts, ChoiceTables, ItemKey, KeptTrial, SentImages, Stopped, TextPlace, TrialRef,
    Trials,
};
