//! The shared vocabulary: no input or output, no pixel mathematics.

pub mod condition;
pub mod digest;
pub mod frame;
pub mod kept;
pub mod labels;
pub mod light;
pub mod listed;
pub mod manifest;
pub mod open;
pub mod question;
pub mod reply;
pub mod trial;

pub use condition::{Condition, EnhancerName};
pub use digest::Digest;
pub use frame::{DepthKind, Frame, FrameId, Intrinsics, Rgb, Segmentation};
pub use kept::Kept;
pub use labels::{Label, Labels, SegmentName};
pub use light::{DarkLevel, Degradation, Level, Stops, Variant, Variants};
pub use listed::{Listed, Thumbnail};
pub use open::{OpenRecord, Step, WalkFacts};
pub use question::{Answer, Choices, Family, Question, QuestionId, Why};
pub use reply::{Finish, Reply, Usage};
pub use trial::{Failure, FailureKind, ImageFacts, Outcome, Reading, Record, TrialKey, Via, View};

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use proptest::prelude::*;

    use super::*;

    fn degradation() -> impl Strategy<Value = Degradation> {
        (prop::sample::select(&DarkLevel::ALL[..]), 0..3).prop_map(|(dark, kind)| match kind {
            0 => Degradation::None,
            1 => Degradation::Exposure(dark),
            _ => Degradation::Sensor(dark),
        })
    }

    proptest! {
        #[test]
        fn conditions_read_back(degradation in degradation(), enhancer in prop::option::of("[A-Za-z0-9_.-]{1,12}")) {
            let enhancer = enhancer.map(|name| EnhancerName::new(&name).unwrap());
            let condition = Condition { degradation, enhancer };
            prop_assert_eq!(&condition.to_string().parse::<Condition>().unwrap(), &condition);
            let json = serde_json::to_string(&condition).unwrap();
            prop_assert_eq!(serde_json::from_str::<Condition>(&json).unwrap(), condition);
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
        fn no_text_is_read_as_another(text in "(L[0-6])?-?(ev|noise|raw)?(\\+[a-z]{0,3})?|\\PC{0,12}") {
            if let Ok(condition) = text.parse::<Condition>() {
                prop_assert_eq!(condition.to_string().to_lowercase(), text.to_lowercase());
            }
        }
    }
}
