//! The orders in which the choices of a question are shown: [`ChoiceOrder`], [`arrange`].

use std::num::NonZeroU32;

use clap::Args;

use crate::error::Result;
use crate::types::{Choices, Decides, Digest, Question};

/// The flags for the order of choices and for repeats.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct ChoiceOrder {
    /// Show the choices of each question in an order drawn from --seed, the same in every condition
    #[arg(long, add = Decides::Reply)]
    pub shuffle_options: bool,
    /// Ask each question once for every rotation of its choices: what a model answers by position averages out
    #[arg(long, add = Decides::Reply)]
    pub circular: bool,
    /// Ask everything N times
    #[arg(long, value_name = "N", default_value_t = NonZeroU32::MIN, add = Decides::Trials)]
    pub repeats: NonZeroU32,
}

/// One order in which a question is shown.
#[derive(Debug)]
pub(super) struct ShownQuestion {
    /// The question with its choices in the order shown.
    pub(super) question: Question,
    /// The number of times that this order was shown before.
    pub(super) repeat: u32,
    /// The number of times that the question was shown before, in any order.
    pub(super) turn: u32,
}

/// All orders in which a question is shown: each rotation of the first order, repeated `--repeats` times.
///
/// A record holds the choices in the order shown, so its readings need no mapping back. Two orders have two keys, because
/// the choices enter the key.
pub(super) fn arrange(
    question: &Question,
    choice_order: ChoiceOrder,
    seed: u64,
) -> Result<Vec<ShownQuestion>> {
    let choices = &question.choices;
    let mut order: Vec<usize> = (0..choices.len()).collect();
    if choice_order.shuffle_options {
        // Sorted by one digest per choice: a random order that does not depend on other questions.
        order.sort_by_cached_key(|&index| {
            let text = choices.texts()[index].as_bytes();
            let parts = [
                b"shuffle",
                &seed.to_le_bytes()[..],
                question.id.0.as_bytes(),
                text,
            ];
            *Digest::of_parts(parts).as_bytes()
        });
    }
    let rotations = if choice_order.circular {
        choices.len()
    } else {
        1
    };
    let mut arranged = Vec::new();
    for repeat in 0..choice_order.repeats.get() {
        for rotation in 0..rotations {
            let mut order = order.clone();
            order.rotate_left(rotation);
            let texts = order.iter().map(|&index| choices.texts()[index].clone());
            let truth = order.iter().position(|&index| index == choices.truth());
            arranged.push(ShownQuestion {
                question: Question {
                    choices: Choices::new(texts.collect(), truth.unwrap_or_default())?,
                    ..question.clone()
                },
                repeat,
                turn: arranged.len() as u32,
            });
        }
    }
    Ok(arranged)
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
            evidence: serde_json::Value::Null,
        }
    }

    fn shown(id: usize, shuffled: bool, circular: bool, repeats: u32) -> Vec<(String, u32)> {
        let choice_order = ChoiceOrder {
            shuffle_options: shuffled,
            circular,
            repeats: NonZeroU32::new(repeats).unwrap(),
        };
        let arranged = arrange(&question(id), choice_order, 7).unwrap();
        let shown = arranged.iter().map(|arranged| {
            let choices = &arranged.question.choices;
            assert_eq!(choices.texts()[choices.truth()], "b");
            (choices.texts().concat(), arranged.repeat)
        });
        shown.collect()
    }

    #[test]
    fn every_rotation_is_shown_as_often_as_asked_for() {
        let expected = |text: &str, repeat| (text.to_owned(), repeat);
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
        assert!(
            counts.values().all(|n| (885..=1115).contains(n)),
            "{counts:?}"
        );
    }
}
