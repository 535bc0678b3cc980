//! Accuracy of uniform guesses: [`chance`].

use crate::estimate::Estimate;
use darkqa_base::types::{AskedItem, Family, Question};

/// Family of a question, number of choices, and number of their orders that are asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OfferedChoices {
    /// Family of the question.
    pub family: Family,
    /// Number of its choices.
    pub choices: usize,
    /// Number of orders of the choices; each counts as one question.
    pub orders: usize,
}

impl OfferedChoices {
    /// Creates the entry of an item.
    pub fn from_item(item: &AskedItem) -> Self {
        Self { family: item.family.as_ref().clone(), choices: item.choices.len(), orders: 1 }
    }
}

impl From<&Question> for OfferedChoices {
    fn from(question: &Question) -> Self {
        Self { family: question.family.clone(), choices: question.choices.len(), orders: 1 }
    }
}

/// Exact accuracy of a uniform guess: the mean of 1 / number of choices over all orders that are asked. `None` without
/// questions.
///
/// Questions are grouped by their number of choices, so that their order cannot change the rounding of the sum.
pub(crate) fn chance<'a>(questions: impl IntoIterator<Item = &'a OfferedChoices>) -> Option<Estimate> {
    mean(questions, |question| question.orders)
}

/// Accuracy of a uniform guess with each question counted once, as in the paper (DarkQA, section IV); `None` if it
/// equals [`chance`]. The two differ if several orders are asked, because a question with many choices has many orders.
pub(crate) fn chance_of_questions<'a>(
    questions: impl IntoIterator<Item = &'a OfferedChoices> + Clone,
) -> Option<Estimate> {
    let once = mean(questions.clone(), |_| 1)?;
    let all = chance(questions)?;
    ((once.value - all.value).abs() > 1e-9).then_some(once)
}

fn mean<'a>(
    questions: impl IntoIterator<Item = &'a OfferedChoices>,
    weight: fn(&OfferedChoices) -> usize,
) -> Option<Estimate> {
    let mut counts = std::collections::BTreeMap::<usize, usize>::new();
    for question in questions {
        *counts.entry(question.choices).or_default() += weight(question);
    }
    let n: usize = counts.values().sum();
    let sum: f64 = counts.iter().map(|(&choices, &questions)| questions as f64 / choices as f64).sum();
    (n > 0).then(|| Estimate::exact(sum / n as f64, n))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(choices: usize) -> OfferedChoices {
        OfferedChoices { family: Family::Closest, choices, orders: 1 }
    }

    /// A question that is asked once for each rotation of its choices.
    fn rotated(choices: usize) -> OfferedChoices {
        OfferedChoices { orders: choices, ..question(choices) }
    }

    #[test]
    fn with_all_orders_long_questions_count_more() {
        let questions = [rotated(2), rotated(4)];
        assert_eq!(chance(&questions).unwrap(), Estimate::exact(2.0 / 6.0, 6));
        assert_eq!(chance_of_questions(&questions).unwrap(), Estimate::exact(0.375, 2));
        assert_eq!(chance_of_questions(&[rotated(4), rotated(4)]), None);
        assert_eq!(chance_of_questions(&[question(2), question(4)]), None);
    }

    #[test]
    fn chance_is_the_mean_of_one_over_the_choices() {
        let questions = [question(2), question(4), question(2)];
        assert_eq!(chance(&questions).unwrap(), Estimate::exact(1.25 / 3.0, 3));
        assert_eq!(chance([]), None);
    }
}
