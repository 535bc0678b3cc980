//! The orders in which the choices of a question are shown: [`ChoiceOrder`], [`arrange`].

use std::num::NonZeroU32;

use clap::Args;

use crate::error::Result;
use crate::types::{Choices, Condition, Decides, Digest, Question, Truths};

/// The flags for the order of choices and for repeats.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct ChoiceOrder {
    /// Show the choices of each question in an order drawn from --seed, the same in every condition
    #[arg(long, add = Decides::Reply)]
    pub shuffle_options: bool,
    /// Ask each question once for every rotation of its choices, so that a model's preference for a position averages out
    #[arg(long, add = Decides::Reply)]
    pub circular: bool,
    /// Ask everything N times; default: once, and with --ask the untouched images twice
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub repeats: Option<NonZeroU32>,
}

/// How many times each order of choices is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Repeats {
    /// So many times everywhere.
    Everywhere(NonZeroU32),
    /// So many times about untouched images without an enhancer, and once everywhere else.
    InTheLight(NonZeroU32),
}

/// How many times untouched images are asked about where nobody knows the answers, so that the report can tell what light changes
/// from what a model answers differently by itself.
const IN_THE_LIGHT: NonZeroU32 = NonZeroU32::MIN.saturating_add(1);

impl Repeats {
    /// The largest number of times in any condition.
    pub(super) fn most(self) -> NonZeroU32 {
        match self {
            Self::Everywhere(times) | Self::InTheLight(times) => times,
        }
    }

    /// How many times a question is asked in a condition; without an image if it is `None`.
    pub(super) fn times(self, condition: Option<&Condition>) -> u32 {
        match self {
            Self::Everywhere(times) => times.get(),
            Self::InTheLight(times) if condition == Some(&Condition::raw(None)) => times.get(),
            Self::InTheLight(_) => 1,
        }
    }
}

impl ChoiceOrder {
    /// How many times each order is asked, of questions with these truths.
    pub(super) fn repeats(self, truths: Truths) -> Repeats {
        match (self.repeats, truths) {
            (Some(times), _) => Repeats::Everywhere(times),
            (None, Truths::Known) => Repeats::Everywhere(NonZeroU32::MIN),
            (None, Truths::Unknown) => Repeats::InTheLight(IN_THE_LIGHT),
        }
    }
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

/// All orders in which a question is shown: each rotation of the first order, repeated as often as in any condition.
///
/// A record holds the choices in the order shown, so its readings need no mapping back. Two orders have two keys, because
/// the choices enter the key.
pub(super) fn arrange(
    question: &Question,
    choice_order: ChoiceOrder,
    repeats: Repeats,
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
            *Digest::from_parts(parts).as_bytes()
        });
    }
    let rotations = if choice_order.circular {
        choices.len()
    } else {
        1
    };
    let mut arranged = Vec::new();
    for repeat in 0..repeats.most().get() {
        for rotation in 0..rotations {
            let mut order = order.clone();
            order.rotate_left(rotation);
            let texts = order.iter().map(|&index| choices.texts()[index].clone());
            let truth = order
                .iter()
                .position(|&index| Some(index) == choices.truth());
            arranged.push(ShownQuestion {
                question: Question {
                    choices: Choices::known_by(texts.collect(), truth)?,
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
            group: None,
            evidence: serde_json::Value::Null,
        }
    }

    fn shown(id: usize, shuffled: bool, circular: bool, repeats: u32) -> Vec<(String, u32)> {
        let choice_order = ChoiceOrder {
            shuffle_options: shuffled,
            circular,
            repeats: NonZeroU32::new(repeats),
        };
        let repeats = choice_order.repeats(Truths::Known);
        let arranged = arrange(&question(id), choice_order, repeats, 7).unwrap();
        arranged
            .iter()
            .map(|arranged| {
                let choices = &arranged.question.choices;
                assert_eq!(choices.texts()[choices.truth().unwrap()], "b");
                (choices.texts().concat(), arranged.repeat)
            })
            .collect()
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
    fn without_truths_the_untouched_images_alone_are_asked_twice() {
        let times = |repeats: Option<u32>, truths, condition: Option<&str>| {
            let order = ChoiceOrder {
                shuffle_options: false,
                circular: false,
                repeats: repeats.and_then(NonZeroU32::new),
            };
            let condition = condition.map(|name| name.parse::<Condition>().unwrap());
            order.repeats(truths).times(condition.as_ref())
        };
        for (condition, expected) in [
            (Some("L0"), 2),
            (Some("L3-noise"), 1),
            (Some("L0+lift"), 1),
            (None, 1),
        ] {
            assert_eq!(
                times(None, Truths::Unknown, condition),
                expected,
                "{condition:?}"
            );
            assert_eq!(times(None, Truths::Known, condition), 1, "{condition:?}");
            assert_eq!(
                times(Some(3), Truths::Unknown, condition),
                3,
                "{condition:?}"
            );
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
        assert!(
            counts.values().all(|n| (885..=1115).contains(n)),
            "{counts:?}"
        );
    }
}
