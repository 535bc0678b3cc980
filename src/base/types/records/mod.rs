//! Records of trials: their keys, columns and details, and notes about the images that were sent.

mod detail;
mod experiment_detail;
mod image_notes;
mod record;
mod small_number;
mod trial_key;
mod trials;

pub use detail::{ChoiceDetail, ImageFacts, OpenDetail, ParsedAnswer, Step, TrialOutcome, WalkFacts};
pub use image_notes::{ImageFidelity, ObjectCrop, Thumbnail};
pub use record::{Failure, FailureKind, Record, StoredDetail, Via, View};
pub use small_number::{SmallNumber, Tokens};
pub use trial_key::TrialKey;
pub use trials::{
    AskedItem, AskedParts, ChoiceFacts, ChoiceTables, KeptTrial, SentImages, TextPlace, TrialRef, Trials,
};
