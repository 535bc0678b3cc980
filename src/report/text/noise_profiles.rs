//! [`NoiseProfiles`]: the noise profiles of the images in a report.

use std::collections::BTreeSet;

use serde::Serialize;

use crate::types::ProfileName;
use darkqa_score::model_in_condition::ModelInCondition;

/// The noise profiles of the subjects with noise, `paper` first.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub(crate) struct NoiseProfiles(BTreeSet<ProfileName>);

impl NoiseProfiles {
    pub(crate) fn new<'s>(subjects: impl IntoIterator<Item = &'s ModelInCondition>) -> Self {
        Self(subjects.into_iter().filter_map(|subject| subject.variant.reading.clone()).collect())
    }

    /// A note that other noise profiles were not run, with the flags to run them; `None` without noise or with several
    /// noise profiles.
    pub(crate) fn open_question(&self) -> Option<String> {
        let mut readings = self.0.iter();
        let (Some(only), None) = (readings.next(), readings.next()) else {
            return None;
        };
        Some(format!(
            "One noise profile was run ({only}). Results under the others are unknown: --profile all --resume DIR, with the \
             flags of the run, asks the missing trials."
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Condition;

    #[test]
    fn single_profile_leaves_a_question_open() {
        let one = profiles(&["L0", "L3-ev", "L3-noise@eld", "L5-noise@eld+lift"]);
        let note = one.open_question().unwrap();
        assert!(note.starts_with("One noise profile was run (eld). "));
        for conditions in [&["L0", "L3-ev"][..], &["L3-noise", "L3-noise@physical"]] {
            assert_eq!(profiles(conditions).open_question(), None, "{conditions:?}");
        }
        let several = profiles(&["L3-noise@eld", "L3-noise"]);
        assert_eq!(serde_json::to_string(&several).unwrap(), r#"["paper","eld"]"#);
    }

    fn profiles(conditions: &[&str]) -> NoiseProfiles {
        let subjects: Vec<ModelInCondition> = conditions
            .iter()
            .map(|text| text.parse::<Condition>().unwrap())
            .map(|condition| ModelInCondition::new("m", Some(&condition)))
            .collect();
        NoiseProfiles::new(&subjects)
    }
}
