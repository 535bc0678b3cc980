//! What a report on 100,000 records costs: finding what they say, and making its files.
//!
//! `cargo bench --bench report` runs it, on all cores.

#![expect(clippy::unwrap_used, reason = "what is made here can be written")]

#[path = "../support/made.rs"]
#[expect(unreachable_pub, reason = "the tests share it as a module of their support")]
mod made;

use std::collections::HashMap;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use darkqa_base::types::questions::FAMILIES;
use darkqa_base::types::{ChoiceDetail, Condition, Degradation, Digest, Record, Severity, Trials};
use darkqa_eval::Kind;
use darkqa_eval::internals::report::{PageInputs, Report, products};
use darkqa_score::cluster::FrameTies;
use darkqa_score::findings::Findings;
use made::record;

/// Eleven conditions of five models on four questions about each of 456 frames: 100,320 records.
fn records() -> Vec<Record> {
    let dark = Severity::LADDER
        .into_iter()
        .flat_map(|severity| Kind::ALL.map(|kind| Degradation::new(kind, severity, None).unwrap()));
    let conditions: Vec<Condition> = std::iter::once(None).chain(dark.map(Some)).map(Condition::raw).collect();
    let mut records = Vec::new();
    for model in 0..5 {
        for condition in &conditions {
            for question in 0..4 * 456 {
                let name = format!("model-{model}");
                let drawn = Digest::from_bytes(format!("{name} {condition} {question}").as_bytes());
                let severity = condition.level().severity();
                let level = Severity::LADDER.iter().filter(|s| Some(**s) <= severity).count() as u32;
                let right = u32::from(drawn.as_bytes()[0]) > 30 * level;
                let mut record = record(&name, condition, (question, question / 4), right);
                record.detail.family = FAMILIES[question % 4].family.clone();
                records.push(record);
            }
        }
    }
    records
}

fn bench(c: &mut Criterion) {
    let trials: Trials<ChoiceDetail> = records().into_iter().collect();
    let find = || Findings::new(&trials, &FrameTies::default(), [], &[]);
    let mut group = c.benchmark_group("100,320 records");
    group.sample_size(10);
    group.bench_function("find what they say", |b| b.iter(|| black_box(find())));
    let findings = find();
    let shown = PageInputs {
        runs: Vec::new(),
        questions: Box::new(|_| Ok(HashMap::new())),
        thumbnails: &[],
        costs: Box::new(|| Ok(HashMap::new())),
        prompts: None,
        texts: Box::new(|_| Ok(String::new())),
    };
    group.bench_function("make the report", |b| {
        b.iter(|| {
            let report = Report::from_findings(&findings, Vec::new());
            black_box(products(&report, &shown).unwrap())
        });
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
