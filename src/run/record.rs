//! What came of a trial, as a line of `records.jsonl`.

use super::plan::Choice;
use super::trial::{Item, Slide, Trial};
use crate::ask::Query;
use crate::error::Result;
use crate::score::choice::readings;
use crate::types::detail::ChoiceLine;
use crate::types::{Answer, ChoiceDetail, Choices, Detail, Outcome, Record, Reply};

impl Item for Choice {
    type Detail = ChoiceDetail;

    // It names a letter.
    const REPLY: f64 = 4.0;

    fn query(&self) -> Query<'_> {
        Query::Choice(&self.question)
    }

    fn place(&self) -> &str {
        &self.question.frame.0
    }

    fn turn(&self) -> u32 {
        self.turn
    }

    fn blank(trial: &Trial<Self>, slide: &Slide, model: &str) -> Record {
        blank(trial, slide, model)
    }
}

impl Detail for ChoiceDetail {
    type Line = ChoiceLine;

    const SCHEMA: &'static str = "darkqa.run/2";

    /// Enters both readings of a reply and the outcome, which is the strict one's.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        let choices = Choices::new(self.choices.clone(), self.truth)?;
        let (strict, lenient) = readings(reply, &choices);
        self.outcome = match strict {
            Answer::Chosen(index) if index == choices.truth() => Outcome::Right,
            Answer::Chosen(_) => Outcome::Wrong,
            Answer::Unparsed(_) => Outcome::Unparsed,
        };
        self.strict = Some(strict.into());
        self.lenient = Some(lenient.into());
        Ok(())
    }

    fn choices(&self) -> usize {
        self.choices.len()
    }
}

fn blank(trial: &Trial<Choice>, slide: &Slide, model: &str) -> Record {
    let question = &*trial.item.question;
    let detail = ChoiceDetail {
        frame: question.frame.clone(),
        family: question.family.clone(),
        choices: question.choices.texts().to_vec(),
        truth: question.choices.truth(),
        repeat: trial.item.repeat,
        strict: None,
        lenient: None,
        outcome: Outcome::Failed,
        image: slide.images.first().map(|image| image.facts().clone()),
    };
    Record::blank(
        trial.key,
        question.id.clone(),
        model,
        slide.condition.clone(),
        detail,
    )
}
