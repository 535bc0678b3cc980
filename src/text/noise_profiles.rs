//! The noise profiles that a report has noisy images in: [`NoiseProfiles`].

use std::collections::BTreeSet;

use serde::Serialize;

use crate::types::ReadingName;
use darkqa_score::model_in_condition::ModelInCondition;

/// The noise profiles of the subjects with noise, `paper` first.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub(crate) struct NoiseProfiles(BTreeSet<ReadingName>);

impl NoiseProfiles {
    pub(crate) fn new<'s>(subjects: impl IntoIterator<Item = &'s ModelInCondition>) -> Self {
        let subjects = subjects.into_iter();
        Self(
            subjects
                .filter_map(|subject| subject.variant.reading.clone())
                .collect(),
        )
    }

    /// The open question of a single noise profile, and how the others are asked; `None` without noise or with several readings.
    pub(crate) fn open_question(&self) -> Option<String> {
        let mut readings = self.0.iter();
        let (Some(only), None) = (readings.next(), readings.next()) else {
            return None;
        };
        Some(format!(
            "One noise profile was run ({only}). Whether the findings hold under another is not known: --profile all \
             --resume DIR, with the flags of the run, asks the missing trials."
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Condition;

    #[test]
    fn one_reading_alone_leaves_a_question_open() {
        let of = |conditions: &[&str]| {
            let conditions: Vec<Condition> = conditions
                .iter()
                .map(|text| text.parse().unwrap())
                .collect();
            let subjects: Vec<ModelInCondition> = conditions
                .iter()
                .map(|c| ModelInCondition::new("m", Some(c)))
                .collect();
            NoiseProfiles::new(&subjects)
        };
        let one = of(&["L0", "L3-ev", "L3-noise@eld", "L5-noise@eld+lift"]);
        let said = one.open_question().unwrap();
        assert!(said.starts_with("One noise profile was run (eld). "));
        for conditions in [&["L0", "L3-ev"][..], &["L3-noise", "L3-noise@physical"]] {
            assert_eq!(of(conditions).open_question(), None, "{conditions:?}");
        }
        let several = of(&["L3-noise@eld", "L3-noise"]);
        assert_eq!(
            serde_json::to_string(&several).unwrap(),
            r#"["paper","eld"]"#
        );
    }
}
