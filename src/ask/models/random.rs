//! Model that guesses: [`Random`].

use serde_json::{Value, json};

use crate::ask::requests::Call;
use crate::types::questions::letter;
use crate::types::{Digest, Question};

/// A model that answers with the letter of a random choice; all choices are equally likely. The guess depends only on
/// the seed, question, condition and turn, not on the order in which questions are asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Random {
    /// Seed of the guesses.
    pub seed: u64,
}

impl Random {
    /// Name in records and tables.
    pub const NAME: &'static str = "random";

    pub(super) fn content(self) -> Value {
        json!({"random": self.seed})
    }

    pub(super) fn answer(self, question: &Question, call: Call<'_>) -> String {
        let mut context = call.condition.map(ToString::to_string).unwrap_or_default();
        if call.turn > 0 {
            context = format!("{context} turn {}", call.turn);
        }
        let mut digest = Digest::from_parts([
            Self::NAME.as_bytes(),
            &self.seed.to_le_bytes(),
            question.id.0.as_bytes(),
            context.as_bytes(),
        ]);
        let count = question.choices.len() as u64;
        // Reject draws from the largest multiple of `count` upwards: their remainders would favour the first choices.
        let limit = u64::MAX - u64::MAX % count;
        loop {
            let (chunks, _) = digest.as_bytes().as_chunks::<8>();
            let draw = chunks.iter().map(|bytes| u64::from_le_bytes(*bytes)).find(|draw| *draw < limit);
            if let Some(draw) = draw {
                return letter((draw % count) as usize).to_string();
            }
            digest = Digest::from_bytes(digest.as_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ask::{Message, Query};
    use crate::types::{Choices, Condition, Family, FrameId, QuestionId};

    fn question(id: usize, choices: usize) -> Question {
        let texts = (0..choices).map(|i| format!("choice {i}")).collect();
        Question {
            id: QuestionId(id.to_string()),
            frame: FrameId("f".into()),
            family: Family::Presence,
            text: "?".into(),
            choices: Choices::new(texts, 0).unwrap(),
            group: None,
            evidence: serde_json::Value::Null,
        }
    }

    fn guess(seed: u64, question: &Question, condition: Option<&Condition>, turn: u32) -> String {
        let call = Call { query: Query::Choice(question), condition, message: Message::text_only(""), turn };
        Random { seed }.answer(question, call)
    }

    #[test]
    fn guesses_are_uniform() {
        let mut counts = [0_u32; 3];
        for id in 0..3000 {
            let reply = guess(7, &question(id, 3), None, 0);
            counts[usize::from(reply.as_bytes()[0] - b'A')] += 1;
        }
        // 129 is five standard deviations of the count for uniform guesses.
        assert!(counts.iter().all(|count| count.abs_diff(1000) < 130), "{counts:?}");
    }

    fn guesses(seed: u64, condition: &str) -> String {
        let condition = condition.parse().unwrap();
        (0..40).map(|id| guess(seed, &question(id, 4), Some(&condition), 0)).collect()
    }

    #[test]
    fn guesses_depend_on_seed_question_and_condition() {
        assert_eq!(guesses(1, "L3-noise"), guesses(1, "L3-noise"));
        assert_ne!(guesses(1, "L3-noise"), guesses(2, "L3-noise"));
        assert_ne!(guesses(1, "L3-noise"), guesses(1, "L3-ev"));
    }
}
