//! The accuracy of guessing: [`chance`].

use super::estimate::Estimate;
use darkqa_ground::types::{AskedItem, Family, Question};

/// Family of a question and the number of its choices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OfferedChoices {
    /// Family of the question.
    pub family: Family,
    /// Number of its choices.
    pub choices: usize,
}

impl OfferedChoices {
    /// The choices that an item offers.
    pub fn of(item: &AskedItem) -> Self {
        Self {
            family: item.family.as_ref().clone(),
            choices: item.choices.len(),
        }
    }
}

impl From<&Question> for OfferedChoices {
    fn from(question: &Question) -> Self {
        Self {
            family: question.family.clone(),
            choices: question.choices.len(),
        }
    }
}

/// The exact accuracy of a uniform guess: the mean of 1 / number of choices (DarkQA, section IV). `None` without questions.
///
/// The sum runs over the numbers of choices, so that the order of the questions cannot change a digit.
pub fn chance<'a>(questions: impl IntoIterator<Item = &'a OfferedChoices>) -> Option<Estimate> {
    let mut counts = std::collections::BTreeMap::<usize, usize>::new();
    for question in questions {
        *counts.entry(question.choices).or_default() += 1;
    }
    let n: usize = counts.values().sum();
    let sum: f64 = counts
        .iter()
        .map(|(&choices, &questions)| questions as f64 / choices as f64)
        .sum();
    (n > 0).then(|| Estimate::exact(sum / n as f64, n))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(choices: usize) -> OfferedChoices {
        OfferedChoices {
            family: Family::Closest,
            choices,
        }
    }

    #[test]
    fn chance_is_the_mean_of_one_over_the_choices() {
        let questions = [question(2), question(4), question(2)];
        assert_eq!(chance(&questions).unwrap(), Estimate::exact(1.25 / 3.0, 3));
        assert_eq!(chance([]), None);
    }
}
