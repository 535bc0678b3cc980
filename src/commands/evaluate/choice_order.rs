//! Order of the choices of a question, and number of repeats: [`ChoiceOrder`], [`shown_questions`].

use std::num::NonZeroU32;

use clap::Args;

use crate::error::Result;
use crate::types::{Choices, Condition, Decides, Digest, Question, Truths};

/// The flags for the order of choices and for repeats.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct ChoiceOrder {
    /// Shuffle the choices of each question by --seed, equally in every condition
    #[arg(long, add = Decides::Reply)]
    pub shuffle_options: bool,
    /// Ask each question once per rotation of its choices, so that position preferences average out
    #[arg(long, add = Decides::Reply)]
    pub circular: bool,
    /// Ask everything N times; default: once, and with --ask the untouched images twice
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub repeats: Option<NonZeroU32>,
}

/// Number of times that each order of choices is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Repeats {
    /// The same number in all conditions.
    Everywhere(NonZeroU32),
    /// This number for untouched images without an enhancer, and once in other conditions.
    Untouched(NonZeroU32),
}

/// Default number of times for untouched images if true answers are unknown. With two replies, the report can separate
/// the effect of light from the variation of a model's replies.
const UNTOUCHED_REPEATS: NonZeroU32 = NonZeroU32::MIN.saturating_add(1);

impl Repeats {
    /// The maximum over all conditions.
    pub(super) fn max(self) -> NonZeroU32 {
        match self {
            Self::Everywhere(times) | Self::Untouched(times) => times,
        }
    }

    /// The number of times in a condition; `None` is without an image.
    pub(super) fn times(self, condition: Option<&Condition>) -> u32 {
        match self {
            Self::Everywhere(times) => times.get(),
            Self::Untouched(times) if condition == Some(&Condition::raw(None)) => times.get(),
            Self::Untouched(_) => 1,
        }
    }
}

impl ChoiceOrder {
    /// Number of times that each order is asked: `--repeats`, or a default that depends on whether true answers are
    /// known.
    pub(super) fn repeats(self, truths: Truths) -> Repeats {
        match (self.repeats, truths) {
            (Some(times), _) => Repeats::Everywhere(times),
            (None, Truths::Known) => Repeats::Everywhere(NonZeroU32::MIN),
            (None, Truths::Unknown) => Repeats::Untouched(UNTOUCHED_REPEATS),
        }
    }
}

/// A question with its choices in one order.
#[derive(Debug)]
pub(super) struct ShownQuestion {
    /// The question with its choices in the order shown.
    pub(super) question: Question,
    /// Number of times that this order was shown before.
    pub(super) repeat: u32,
    /// Number of times that the question was shown before, in any order.
    pub(super) turn: u32,
}

/// All showings of a question: each rotation of the first order, repeated up to [`Repeats::max`].
///
/// A record stores the choices in the order shown, so that parsed choices need no mapping. Different orders have
/// different keys, because the key depends on the choices.
pub(super) fn shown_questions(
    question: &Question,
    choice_order: ChoiceOrder,
    repeats: Repeats,
    seed: u64,
) -> Result<Vec<ShownQuestion>> {
    let choices = &question.choices;
    let mut order: Vec<usize> = (0..choices.len()).collect();
    if choice_order.shuffle_options {
        // Sorting by a digest of each choice gives a random order that does not depend on other questions.
        order.sort_by_cached_key(|&index| {
            let text = choices.texts()[index].as_bytes();
            let parts = [b"shuffle", &seed.to_le_bytes()[..], question.id.0.as_bytes(), text];
            *Digest::from_parts(parts).as_bytes()
        });
    }
    let rotations = if choice_order.circular { choices.len() } else { 1 };
    let mut shown = Vec::new();
    for repeat in 0..repeats.max().get() {
        for rotation in 0..rotations {
            let mut order = order.clone();
            order.rotate_left(rotation);
            let texts = order.iter().map(|&index| choices.texts()[index].clone());
            let truth = order.iter().position(|&index| Some(index) == choices.truth());
            shown.push(ShownQuestion {
                question: Question { choices: Choices::with_truth(texts.collect(), truth)?, ..question.clone() },
                repeat,
                turn: shown.len() as u32,
            });
        }
    }
    Ok(shown)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::types::{Family, FrameId, QuestionId};

    fn question(id: usize) -> Question {
        let texts = ["a", "b", "c"].map(str::to_owned).to_vec();
        Question {
            id: QuestionId(id.to_string()),
            frame: FrameId("f".into()),
            family: Family::Closest,
            text: "?".into(),
            choices: Choices::new(texts, 1).unwrap(),
            group: None,
            evidence: serde_json::Value::Null,
        }
    }

    fn shown(id: usize, shuffled: bool, circular: bool, repeats: u32) -> Vec<(String, u32)> {
        let choice_order = ChoiceOrder { shuffle_options: shuffled, circular, repeats: NonZeroU32::new(repeats) };
        let repeats = choice_order.repeats(Truths::Known);
        shown_questions(&question(id), choice_order, repeats, 7)
            .unwrap()
            .iter()
            .map(|shown| {
                let choices = &shown.question.choices;
                assert_eq!(choices.texts()[choices.truth().unwrap()], "b");
                (choices.texts().concat(), shown.repeat)
            })
            .collect()
    }

    fn expected(text: &str, repeat: u32) -> (String, u32) {
        (text.to_owned(), repeat)
    }

    #[test]
    fn every_rotation_is_repeated() {
        assert_eq!(shown(0, false, false, 1), [expected("abc", 0)]);
        assert_eq!(
            shown(0, false, true, 2),
            [
                expected("abc", 0),
                expected("bca", 0),
                expected("cab", 0),
                expected("abc", 1),
                expected("bca", 1),
                expected("cab", 1)
            ]
        );
    }

    fn times(repeats: Option<u32>, truths: Truths, condition: Option<&str>) -> u32 {
        let order = ChoiceOrder { shuffle_options: false, circular: false, repeats: repeats.and_then(NonZeroU32::new) };
        let condition = condition.map(|name| name.parse::<Condition>().unwrap());
        order.repeats(truths).times(condition.as_ref())
    }

    #[test]
    fn only_untouched_images_are_asked_twice_without_truths() {
        for (condition, expected) in [(Some("L0"), 2), (Some("L3-noise"), 1), (Some("L0+lift"), 1), (None, 1)] {
            assert_eq!(times(None, Truths::Unknown, condition), expected, "{condition:?}");
            assert_eq!(times(None, Truths::Known, condition), 1, "{condition:?}");
            assert_eq!(times(Some(3), Truths::Unknown, condition), 3, "{condition:?}");
        }
    }

    #[test]
    fn shuffled_orders_are_equally_frequent_and_reproducible() {
        let mut counts = BTreeMap::<String, usize>::new();
        for id in 0..6000 {
            let order = shown(id, true, false, 1);
            assert_eq!(order, shown(id, true, false, 1));
            *counts.entry(order[0].0.clone()).or_default() += 1;
        }
        assert_eq!(counts.len(), 6);
        // The expected count is 1000; the bounds are four standard deviations.
        assert!(counts.values().all(|n| (885..=1115).contains(n)), "{counts:?}");
    }
}
