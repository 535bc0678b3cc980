//! What a report on 100,000 records costs: finding what they say, and making its files.
//!
//! `cargo bench --bench report` runs it, on all cores.

#![expect(clippy::unwrap_used, reason = "what is made here can be written")]

use std::collections::BTreeMap;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use darkqa_eval::report::page::Shown;
use darkqa_eval::report::products::products;
use darkqa_eval::score::findings::Findings;
use darkqa_eval::types::{
    Condition, DarkLevel, Degradation, Digest, Family, FrameId, Outcome, QuestionId, Reading,
    Record, Via, View,
};

/// Eleven conditions of five models on four questions about each of 456 frames: 100,320 records.
fn records() -> Vec<Record> {
    let dark = DarkLevel::ALL.into_iter();
    let dark = dark.flat_map(|level| [Degradation::Exposure(level), Degradation::Sensor(level)]);
    let conditions: Vec<Condition> = std::iter::once(Degradation::None)
        .chain(dark)
        .map(Condition::raw)
        .collect();
    let mut records = Vec::new();
    for model in 0..5 {
        for condition in &conditions {
            for question in 0..4 * 456 {
                records.push(record(model, condition, question));
            }
        }
    }
    records
}

fn record(model: usize, condition: &Condition, question: usize) -> Record {
    let name = Digest::of(format!("{model} {condition} {question}").as_bytes());
    let drawn = name.as_bytes()[0];
    let level = condition.degradation.level();
    let right = u32::from(drawn) > 30 * level as u32;
    let chosen = Reading {
        chosen: Some(usize::from(!right)),
        why: None,
    };
    Record {
        key: name.into(),
        question: QuestionId(format!("q{question:05}")),
        frame: FrameId(format!("f{:04}", question / 4)),
        family: Family::PAPER[question % 4].clone(),
        model: format!("model-{model}"),
        view: View::Image,
        level: Some(level),
        variant: condition.degradation.variant(),
        enhancer: None,
        condition: Some(condition.clone()),
        choices: ["yes", "no"].map(str::to_owned).to_vec(),
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
        latency_ms: Some(100),
        attempts: 1,
        image: None,
    }
}

fn bench(c: &mut Criterion) {
    let records = records();
    let find = || Findings::new(&records, &BTreeMap::new(), []);
    let mut group = c.benchmark_group("100,320 records");
    group.sample_size(10);
    group.bench_function("find what they say", |b| b.iter(|| black_box(find())));
    let findings = find();
    let shown = Shown {
        runs: Vec::new(),
        questions: &[],
        thumbnails: &[],
    };
    group.bench_function("make the report", |b| {
        b.iter(|| black_box(products(&findings, &shown).unwrap()));
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
