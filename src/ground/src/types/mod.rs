//! The types that all rooms share, without input or output. The only arithmetic on pixels is how more than 8 bits are shown;
//! [`isa`] names the instruction sets that loops over pixels are compiled for.

pub mod axis_level;
#[cfg(feature = "program")]
mod canonical;
pub mod condition;
mod condition_columns;
pub mod control;
#[cfg(feature = "program")]
pub mod decides;
pub mod degradation;
pub mod detail;
pub mod digest;
pub mod enhancer_note;
mod experiment_detail;
pub mod exposure_facts;
#[cfg(feature = "program")]
pub mod flag;
mod flaw;
pub mod frame;
pub mod image;
#[cfg(feature = "program")]
pub mod image_mark;
pub mod image_notes;
mod input_note;
pub mod isa;
pub mod key_values;
pub mod keyed_flag;
pub mod kind_set;
pub mod labels;
pub mod light_group;
pub mod manifest;
pub mod model_listing;
pub mod model_views;
pub mod near_name;
pub mod observed;
pub mod option_probabilities;
pub mod outlines;
pub mod pair_dark;
mod pair_facts;
pub mod pixels;
pub mod question;
pub mod recent;
pub mod record;
pub mod recorded_names;
pub mod reply;
pub mod run_question;
mod set_light;
pub mod severity;
pub mod shared;
mod shell;
mod shown_codes;
pub mod shown_text;
mod size_log;
pub mod small_number;
mod strict_group;
pub mod toml_fault;
pub mod treatment;
pub mod treatment_set;
pub mod trial_key;
pub mod trials;
pub mod words;

pub use axis_level::{AxisLevel, KindReading};
pub use condition::{Condition, EnhancerName};
pub use condition_columns::ConditionColumns;
pub use control::Control;
#[cfg(feature = "program")]
pub use decides::Decides;
pub use degradation::{Degradation, ReadingName};
pub use detail::{
    AnswerReading, ChoiceDetail, ImageFacts, OpenDetail, Step, TrialOutcome, WalkFacts,
};
pub use digest::Digest;
pub use exposure_facts::ExposureFacts;
pub use flaw::Flaw;
#[cfg(feature = "program")]
pub use frame::Frame;
pub use frame::{DepthKind, FrameId, Intrinsics, Segmentation};
pub use image::{Codes16, Image, Light, Rgb, Sample};
pub use image_notes::{ImageFidelity, ObjectCrop, Thumbnail};
pub use input_note::{ColourHandling, ColourNote, DepthNote, InputNote, InputSummary};
pub use kind_set::KindSet;
pub use labels::{Label, Labels, SegmentName};
pub use light_group::LightGroup;
pub use model_listing::{ListedModel, ModelColumn, ModelListing};
pub use observed::{AnswerSource, Observed};
pub use option_probabilities::{OptionProbabilities, Thought, TokenChances, TokenPosition};
pub use outlines::PixelBox;
pub use pair_dark::{PairDark, PhotoName};
pub use pair_facts::PairFacts;
pub use pixels::Pixels;
pub use question::Truths;
pub use question::{Answer, Choices, Family, Question, QuestionId, UnreadReason};
pub use record::{Failure, FailureKind, StoredDetail, Via, View};
pub use reply::{Finish, LostAttempts, Reply, Unstated, Usage};
pub use run_question::RunQuestion;
pub use set_light::SetLight;
pub use severity::{Axis, Severity};
pub use shared::{Distinct, Shared};
pub use shell::shell_word;
pub use size_log::{SeamCounts, SizeLog};
pub use strict_group::StrictGroup;
pub use treatment::Treatment;
pub use treatment_set::TreatmentSet;
pub use trial_key::TrialKey;
pub use trials::{
    AskedItem, AskedParts, ChoiceFacts, ChoiceTables, KeptTrial, SentImages, TextPlace, TrialRef,
    Trials,
};

/// The record of a trial; by default of a question with choices.
pub type Record<D = ChoiceDetail> = record::Record<D>;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use proptest::prelude::*;

    use super::degradation::Kind;
    use super::*;

    fn degradation() -> impl Strategy<Value = Option<Degradation>> {
        let kind = prop::sample::select(&Kind::ALL[..]);
        let reading = prop::option::of("[A-Za-z0-9_.-]{1,12}");
        prop::option::of(
            (kind, 1..=1600_u16, reading).prop_map(|(kind, severity, reading)| {
                let reading = reading
                    .filter(|_| kind.has_readings())
                    .map(|name| ReadingName::new(&name).unwrap());
                Degradation::new(kind, Severity::hundredths(severity), reading).unwrap()
            }),
        )
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
            let severities = [one, other].map(Severity::hundredths);
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
