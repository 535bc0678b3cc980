//! Records whose truth is known, as a run would have kept them.

use darkqa_eval::types::{
    Condition, Digest, Family, FrameId, Outcome, QuestionId, Reading, Record, Via, View,
};

/// What a model made of one question in one condition: the first of three choices is true.
pub fn record(
    model: &str,
    condition: &Condition,
    (question, frame): (usize, usize),
    right: bool,
) -> Record {
    let chosen = Reading {
        chosen: Some(usize::from(!right)),
        why: None,
    };
    let degradation = condition.degradation;
    Record {
        key: Digest::of(format!("{question} {model} {condition}").as_bytes()).into(),
        question: QuestionId(format!("q{question:05}")),
        frame: FrameId(format!("f{frame:04}")),
        family: Family::Color,
        model: model.to_owned(),
        view: View::Image,
        level: Some(degradation.level()),
        variant: degradation.variant(),
        enhancer: condition.enhancer.clone(),
        condition: Some(condition.clone()),
        choices: ["a", "b", "c"].map(str::to_owned).to_vec(),
        truth: 0,
        reply: Some(if right { "A" } else { "B" }.to_owned()),
        refusal: None,
        finish: None,
        strict: Some(chosen),
        lenient: Some(chosen),
        repeat: 0,
        via: Via::Direct,
        outcome: if right {
            Outcome::Right
        } else {
            Outcome::Wrong
        },
        failure: None,
        usage: None,
        served_model: None,
        latency_ms: None,
        attempts: 1,
        image: None,
    }
}
