//! Types shared by all crates of the workspace, without input or output.

pub mod degradations;
#[cfg(feature = "program")]
pub mod evidence;
pub mod flags;
pub mod images;
#[cfg(feature = "program")]
pub mod manifests;
#[cfg(feature = "program")]
pub mod questions;
#[cfg(feature = "program")]
pub mod records;
#[cfg(feature = "program")]
pub mod replies;
pub mod text;
pub mod values;

pub use degradations::{
    Axis, AxisLevel, Condition, ConditionColumns, Degradation, EnhancerName, ExposureFacts, KindSet, PairDark,
    PairFacts, PhotoName, ProfileName, RunGroup, SetLight, Severity, Treatment, TreatmentSet, Variant,
};
#[cfg(feature = "program")]
pub use evidence::Evidence;
#[cfg(feature = "program")]
pub use flags::Decides;
#[cfg(feature = "program")]
pub use images::Frame;
pub use images::{
    DepthKind, FrameId, Image, Intrinsics, Label, Labels, Light, Pixels, Rgb, Rgb16Image, Sample, SegmentName,
    Segmentation,
};
#[cfg(feature = "program")]
pub use manifests::{
    ColourHandling, ColourNote, DepthNote, Flaw, InputNote, InputSummary, ListedModel, ModelColumn, ModelListing,
    SeamCounts, SizeLog,
};
#[cfg(feature = "program")]
pub use questions::{
    Answer, Choices, Family, PixelBox, Question, QuestionId, RunQuestion, StrictGroup, Truths, UnreadReason,
};
#[cfg(feature = "program")]
pub use records::{
    AskedItem, AskedParts, ChoiceDetail, ChoiceFacts, ChoiceTables, Failure, FailureKind, ImageFacts, ImageFidelity,
    ItemKey, KeptTrial, ObjectCrop, OpenDetail, ParsedAnswer, SentImages, Step, StoredDetail, TextPlace, Thumbnail,
    TrialKey, TrialOutcome, TrialRef, Trials, Via, View, WalkFacts,
};
#[cfg(feature = "program")]
pub use replies::{
    AnswerSource, Control, Finish, LostAttempts, Observed, OptionProbabilities, OtherField, Reply, ServiceTier,
    StatedCost, Thought, TokenChances, TokenPosition, Unstated, Usage,
};
pub use text::shell_word;
pub use values::{Digest, Distinct, Shared};

/// The record of a trial; by default of a question with choices.
#[cfg(feature = "program")]
pub type Record<D = ChoiceDetail> = records::Record<D>;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use proptest::prelude::*;

    use super::degradations::Kind;
    use super::*;

    fn degradation() -> impl Strategy<Value = Option<Degradation>> {
        let kind = prop::sample::select(&Kind::ALL[..]);
        let reading = prop::option::of("[A-Za-z0-9_.-]{1,12}");
        prop::option::of((kind, 1..=1600_u16, reading).prop_map(|(kind, severity, reading)| {
            let reading = reading.filter(|_| kind.has_profiles()).map(|name| ProfileName::new(&name).unwrap());
            Degradation::new(kind, Severity::from_hundredths(severity), reading).unwrap()
        }))
    }

    proptest! {
        #[test]
        fn conditions_read_back(degradation in degradation(), enhancer in prop::option::of("[A-Za-z0-9_.-]{1,12}")) {
            let enhancer = enhancer.map(|name| EnhancerName::new(&name).unwrap());
            let condition = Condition { treatment: degradation.into(), enhancer, group: None };
            prop_assert_eq!(&condition.to_string().parse::<Condition>().unwrap(), &condition);
            let json = serde_json::to_string(&condition).unwrap();
            prop_assert_eq!(serde_json::from_str::<Condition>(&json).unwrap(), condition);
        }

        #[test]
        fn labels_read_back_in_order(one in 1..=1600_u16, other in 1..=1600_u16) {
            let severities = [one, other].map(Severity::from_hundredths);
            for (kind, severity) in Kind::ALL.into_iter().zip(severities) {
                prop_assert_eq!(kind.severity(&kind.label(severity)).unwrap(), severity);
            }
            let [one_level, other_level] = severities.map(|s| AxisLevel::new(Kind::ALL[0], s));
            prop_assert_eq!(one_level.cmp(&other_level), one.cmp(&other));
        }

        #[test]
        fn families_read_back(name in "\\PC{0,20}|room_type|color") {
            let family = Family::from(name.as_str());
            prop_assert_eq!(family.to_string(), name);
            let json = serde_json::to_string(&family).unwrap();
            prop_assert_eq!(serde_json::from_str::<Family>(&json).unwrap(), family);
        }

        #[test]
        fn trial_keys_read_back(bits in any::<u128>()) {
            let text = format!("{bits:032x}");
            let key: TrialKey = text.parse().unwrap();
            prop_assert_eq!(key.to_string(), text);
        }

        #[test]
        fn a_condition_is_written_as_it_was_read(text in "(L[0-6]|E[0-9]{1,2}(\\.[0-9]{0,3})?)?-?(ev|noise|raw)?(@[a-z&]{0,3})?(\\+[a-z]{0,3})?|\\PC{0,12}") {
            if let Ok(condition) = text.parse::<Condition>() {
                prop_assert_eq!(condition.to_string().to_lowercase(), text.to_lowercase());
            }
        }
    }
}
