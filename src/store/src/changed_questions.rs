//! Questions of a run that are no longer the ones stored in it: [`ChangedQuestions`].

use darkqa_ground::types::RunQuestion;
use darkqa_ground::types::questions::QuestionPart;
use darkqa_ground::types::text::excerpt;

/// The most characters of a text in the message.
const SHOWN: usize = 60;

/// The questions that differ from the stored ones: the first of them, and the number that differ in the same part.
#[derive(Debug, Default)]
pub(super) struct ChangedQuestions {
    first: Option<(QuestionPart, String)>,
    same_part: usize,
}

impl ChangedQuestions {
    /// Adds a question that differs from the stored one in a part.
    pub(super) fn add(&mut self, part: QuestionPart, stored: &RunQuestion, now: &RunQuestion) {
        let first = self
            .first
            .get_or_insert_with(|| (part, changed(part, stored, now)));
        self.same_part += usize::from(first.0 == part);
    }

    /// The problem in words; `None` if no question differs. `reads_alike` is whether images are read as they were.
    pub(super) fn problem(&self, reads_alike: impl FnOnce() -> bool) -> Option<String> {
        let (part, first) = self.first.as_ref()?;
        let more = match self.same_part {
            1 => String::new(),
            2 => "; so has 1 more question".to_owned(),
            count => format!("; so have {} more questions", count - 1),
        };
        let remedy = match part {
            QuestionPart::Image if reads_alike() => "restore the file or its --data",
            QuestionPart::Image => {
                "restore the file, and flags that decide how it is read (--decode)"
            }
            _ => "restore --data and --questions",
        };
        Some(format!("{first}{more}; {remedy}, or use another --out"))
    }
}

/// The change of a question in words.
fn changed(part: QuestionPart, stored: &RunQuestion, now: &RunQuestion) -> String {
    let texts = |question: &RunQuestion| match part {
        QuestionPart::Text => Some(question.text.clone()),
        QuestionPart::Choices => Some(question.choices.join(", ")),
        QuestionPart::Answer => Some(question.answer.clone().unwrap_or_default()),
        QuestionPart::Frame => Some(question.frame.0.clone()),
        QuestionPart::Family => Some(question.family.name().to_owned()),
        QuestionPart::Scene => Some(question.scene.clone()),
        QuestionPart::Image | QuestionPart::Group => None,
    };
    let id = excerpt(&stored.id.0, SHOWN);
    let frame = excerpt(&stored.frame.0, SHOWN);
    match (part, texts(stored).zip(texts(now))) {
        (QuestionPart::Image, _) => {
            format!("the image {frame:?} of question {id:?} has changed since the run began")
        }
        (part, Some((before, now))) => format!(
            "question {id:?} has another {} than in this run: {:?}, before {:?}",
            part.words(),
            excerpt(&now, SHOWN),
            excerpt(&before, SHOWN)
        ),
        (part, None) => format!(
            "question {id:?} has another {} than in this run",
            part.words()
        ),
    }
}
