//! Records whose truth is known, as a run would have kept them.

use darkqa_base::types::{
    ChoiceDetail, Condition, Digest, Family, FrameId, ParsedAnswer, QuestionId, Record, TrialOutcome,
};

/// A model's reply to one question in one condition; the first of three choices is true.
pub fn record(model: &str, condition: &Condition, (question, frame): (usize, usize), right: bool) -> Record {
    let chosen = ParsedAnswer { chosen: Some(usize::from(!right)), why: None };
    let detail = ChoiceDetail {
        frame: FrameId(format!("f{frame:04}")),
        family: Family::Color,
        choices: ["a", "b", "c"].map(str::to_owned).to_vec(),
        truth: Some(0),
        repeat: 0,
        wording: None,
        order: 0,
        strict: Some(chosen),
        lenient: Some(chosen),
        outcome: if right { TrialOutcome::Right } else { TrialOutcome::Wrong },
        image: None,
        more_images: Vec::new(),
        shown_frame: None,
        observed: None,
        options: None,
    };
    let key = Digest::from_bytes(format!("{question} {model} {condition}").as_bytes()).into();
    let question = QuestionId(format!("q{question:05}"));
    Record {
        reply: Some(if right { "A" } else { "B" }.to_owned()),
        attempts: 1,
        ..Record::blank(key, question, model, Some(condition.clone()), detail)
    }
}
