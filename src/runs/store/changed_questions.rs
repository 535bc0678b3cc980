//! Questions that differ from those stored in the run: [`ChangedQuestions`].

use darkqa_base::types::RunQuestion;
use darkqa_base::types::questions::QuestionPart;
use darkqa_base::types::text::excerpt;

/// Maximum number of characters of a text in the message.
const MAX_CHARS: usize = 60;

/// The first question that differs from the stored one, and the number of questions that differ in the same part.
#[derive(Debug, Default)]
pub(super) struct ChangedQuestions {
    first: Option<(QuestionPart, String)>,
    same_part: usize,
}

impl ChangedQuestions {
    /// Adds a question that differs from the stored one in a part.
    pub(super) fn add(&mut self, part: QuestionPart, stored: &RunQuestion, now: &RunQuestion) {
        let first = self.first.get_or_insert_with(|| (part, describe_change(part, stored, now)));
        self.same_part += usize::from(first.0 == part);
    }

    /// The error text; `None` if no question differs. `is_decoded_alike` returns true if image files are decoded as in
    /// the stored run.
    pub(super) fn problem(&self, is_decoded_alike: impl FnOnce() -> bool) -> Option<String> {
        let (part, first) = self.first.as_ref()?;
        let more = match self.same_part {
            1 => String::new(),
            2 => "; so has 1 more question".to_owned(),
            count => format!("; so have {} more questions", count - 1),
        };
        let remedy = match part {
            QuestionPart::Image if is_decoded_alike() => "restore the file or its --data",
            QuestionPart::Image => "restore the file, and flags that decide how it is read (--decode)",
            _ => "restore --data and --questions",
        };
        Some(format!("{first}{more}; {remedy}, or use another --out"))
    }
}

/// The change of a question in words.
fn describe_change(part: QuestionPart, stored: &RunQuestion, now: &RunQuestion) -> String {
    let id = excerpt(&stored.id.0, MAX_CHARS);
    let frame = excerpt(&stored.frame.0, MAX_CHARS);
    match (part, part_text(part, stored).zip(part_text(part, now))) {
        (QuestionPart::Image, _) => {
            format!("the image {frame:?} of question {id:?} has changed since the run began")
        }
        (part, Some((before, now))) => format!(
            "question {id:?} has another {} than in this run: {:?}, before {:?}",
            part.words(),
            excerpt(&now, MAX_CHARS),
            excerpt(&before, MAX_CHARS)
        ),
        (part, None) => format!("question {id:?} has another {} than in this run", part.words()),
    }
}

/// The text of a part of a question; `None` for parts without a text.
fn part_text(part: QuestionPart, question: &RunQuestion) -> Option<String> {
    match part {
        QuestionPart::Text => Some(question.text.clone()),
        QuestionPart::Choices => Some(question.choices.join(", ")),
        QuestionPart::Answer => Some(question.answer.clone().unwrap_or_default()),
        QuestionPart::Frame => Some(question.frame.0.clone()),
        QuestionPart::Family => Some(question.family.name().to_owned()),
        QuestionPart::Scene => Some(question.scene.clone()),
        QuestionPart::Image | QuestionPart::Group => None,
    }
}
