//! Simulated runs with known effects: the rates of false claims and of detected effects.

use std::fmt::Write as _;

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution, StandardNormal};

use super::records::{answer, record, unanswered};
use crate::sentences::{EffectDirection, Sentence, sentences};
use darkqa_base::types::{ChoiceDetail, Condition, Family, FrameId, OptionProbabilities, QuestionId, Record};
use darkqa_score::accuracies::healths;
use darkqa_score::cluster::{Clusters, FrameTies};
use darkqa_score::comparisons::{PooledKind, baseline_rows};
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::significance::Verdict;

/// The design of a simulated run, and its true effects.
#[derive(Debug, Clone, Copy)]
struct SimulationDesign {
    models: usize,
    profiles: usize,
    enhancers: usize,
    /// Number of frames, each with four questions: two about objects, one about colour and one about the room.
    frames: usize,
    /// Share of right replies that the first enhancer adds at L4 and L5.
    gain: f64,
    /// Share of right replies that L4 and L5 with noise take away.
    loss: f64,
    /// True if the second half of the models are the first half, asked again.
    twins: bool,
}

/// Names of noise profiles in conditions; the first one is the paper's.
const PROFILES: [&str; 4] = ["", "@eld", "@level", "@physical"];

/// Questions of each frame, with their choices.
const QUESTIONS: [(Family, &[&str]); 4] = [
    (Family::Presence, &["yes", "no"]),
    (Family::Presence, &["no", "yes"]),
    (Family::Color, &["red", "green", "blue", "white"]),
    (Family::RoomType, &["kitchen", "bedroom", "bathroom", "hall"]),
];

impl SimulationDesign {
    /// The conditions of each model; the empty name stands for no images.
    fn conditions(&self) -> Vec<String> {
        let mut all = vec![String::new(), "L0".to_owned()];
        for level in 1..=5 {
            all.push(format!("L{level}-ev"));
            for profile in &PROFILES[..self.profiles] {
                all.push(format!("L{level}-noise{profile}"));
                for number in 0..self.enhancers {
                    all.push(format!("L{level}-noise{profile}+e{number}"));
                }
            }
        }
        all
    }

    /// Change of the share of right replies in a condition.
    fn effect(&self, condition: &str) -> f64 {
        let is_dark = condition.starts_with("L4-noise") || condition.starts_with("L5-noise");
        let loss = if is_dark { -self.loss } else { 0.0 };
        let gain = if is_dark && condition.ends_with("+e0") { self.gain } else { 0.0 };
        gain + loss
    }

    /// All records, without answers.
    fn records(&self) -> Vec<Record> {
        let mut records = Vec::new();
        for model in 0..self.models {
            let model = format!("m{model:02}");
            for name in self.conditions() {
                let condition: Option<Condition> = (!name.is_empty()).then(|| name.parse().unwrap());
                for item in 0..4 * self.frames {
                    let (family, choices) = &QUESTIONS[item % 4];
                    let detail = unanswered(format!("f{:03}", item / 4), family.clone(), choices);
                    records.push(record(item, &model, condition.clone(), detail));
                }
            }
        }
        records
    }

    /// Draws new answers for all records. Items, frames and models have random difficulties. Conditions differ by a
    /// random effect of each frame and by a new draw for 30 % of the answers, and on average only by
    /// [`SimulationDesign::effect`]. The confidence of a reply is the true probability that it is right.
    fn answer(&self, random: &mut StdRng, records: &mut [Record]) {
        let items = 4 * self.frames;
        let frames = normals(random, self.frames, 0.5);
        let difficulties = normals(random, items, 0.8);
        let conditions = self.conditions();
        let different = if self.twins { self.models / 2 } else { self.models };
        let models: Vec<(f64, Vec<f64>)> = (0..different)
            .map(|_| {
                let skill = 1.2 + 0.3 * Distribution::<f64>::sample(&StandardNormal, random);
                let fixed = (0..items).map(|_| random.random_range(0.0..1.0)).collect();
                (skill, fixed)
            })
            .collect();
        for (number, of_model) in records.chunks_mut(conditions.len() * items).enumerate() {
            let (skill, fixed) = &models[number % different];
            for (name, answers) in conditions.iter().zip(of_model.chunks_mut(items)) {
                let luck = normals(random, self.frames, 0.3);
                for (item, record) in answers.iter_mut().enumerate() {
                    let frame = item / 4;
                    let logit = skill + frames[frame] + difficulties[item] + luck[frame];
                    let p = 1.0 / (1.0 + (-logit).exp());
                    let p = p.clamp(0.55, 0.98) + self.effect(name);
                    let drawn = if random.random_bool(0.3) { random.random_range(0.0..1.0) } else { fixed[item] };
                    set_answer(&mut record.detail, p, drawn);
                }
            }
        }
    }
}

/// Normal random numbers with mean 0 and this standard deviation.
pub(super) fn normals(random: &mut StdRng, count: usize, deviation: f64) -> Vec<f64> {
    (0..count).map(|_| deviation * Distribution::<f64>::sample(&StandardNormal, random)).collect()
}

/// Sets an answer that is right with probability `p`, by a draw between 0 and 1.
pub(super) fn set_answer(detail: &mut ChoiceDetail, p: f64, drawn: f64) {
    let choices = detail.choices.len();
    let is_right = drawn < p;
    let chosen = if is_right { 0 } else { 1 + ((drawn - p) / (1.0 - p) * (choices - 1) as f64) as usize };
    let chosen = chosen.min(choices - 1);
    answer(detail, chosen);
    // A model with less than half of the probability could have chosen another answer.
    let confidence = p.clamp(0.51, 0.99);
    let rest = (1.0 - confidence) / (choices - 1) as f64;
    let mut probabilities = vec![rest; choices];
    probabilities[chosen] = confidence;
    detail.options =
        Some(OptionProbabilities { p: probabilities, mass: 1.0, bound: 0.0, token: String::new(), reasoned: false });
}

/// True if a sentence claims an effect: by its sign, or in words.
fn is_claim(sentence: &Sentence) -> bool {
    matches!(sentence.tone, EffectDirection::Better | EffectDirection::Worse)
        || ["collapse", "families"].contains(&sentence.kind)
        || sentence.kind == "best" && sentence.tone == EffectDirection::Note
}

/// Outcomes of the runs of a design.
#[derive(Debug, Default)]
struct OutcomeCounts {
    runs: usize,
    /// Runs with any signed sentence.
    signed: usize,
    /// Runs in which a set of findings has a verdict after the correction within the set alone.
    own: usize,
    /// Runs in which a finding by noise profile is decided.
    decided: usize,
    /// Runs in which the first enhancer is detected to help, and the same within its set alone.
    helped: [usize; 2],
    /// Runs in which darkness is detected to cost, and the same within its set alone.
    lost: [usize; 2],
    /// Signed sentences by kind.
    kinds: std::collections::BTreeMap<&'static str, usize>,
}

fn simulate(design: &SimulationDesign, runs: usize, seed: u64) -> OutcomeCounts {
    let mut random = StdRng::seed_from_u64(seed);
    let mut records = design.records();
    let mut counts = OutcomeCounts::default();
    for _ in 0..runs {
        design.answer(&mut random, &mut records);
        let trials = records.iter().cloned().collect();
        let findings = Findings::sentences_only(&trials, &FrameTies::default());
        let said = sentences(&findings);
        let claims: Vec<&Sentence> = said.iter().filter(|sentence| is_claim(sentence)).collect();
        counts.runs += 1;
        counts.signed += usize::from(!claims.is_empty());
        for claim in &claims {
            *counts.kinds.entry(claim.kind).or_default() += 1;
        }
        let whole = findings.pooled.iter().filter(|finding| finding.family.as_ref() == finding.kind.only_family());
        counts.own += usize::from(whole.clone().any(|finding| finding.strict.tested.verdict.is_shown()));
        let is_decided = findings.by_profile.iter().any(|finding| finding.robustness.word() != "open");
        counts.decided += usize::from(is_decided);
        for (kind, verdict, name, found) in [
            (PooledKind::Enhancer, Verdict::Better, "enhancer", &mut counts.helped),
            (PooledKind::Darkness, Verdict::Worse, "darkness", &mut counts.lost),
        ] {
            let sign = EffectDirection::from(verdict);
            found[0] += usize::from(claims.iter().any(|claim| claim.kind == name && claim.tone == sign));
            found[1] += usize::from(
                whole.clone().any(|finding| finding.kind == kind && finding.strict.tested.verdict == verdict),
            );
        }
    }
    counts
}

/// A share in percent with Wilson's interval.
pub(super) fn percent(count: usize, runs: usize) -> String {
    let share = darkqa_score::estimate::Estimate::share(count, runs).unwrap();
    let [value, low, high] = [share.value, share.low, share.high].map(|x| 100.0 * x);
    format!("{value:.1} [{low:.1}, {high:.1}]")
}

pub(super) fn runs() -> usize {
    std::env::var("DARKQA_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(300)
}

/// The numbers of models to simulate: those in `DARKQA_MODELS`, separated by commas, or all.
fn model_counts(all: &[usize]) -> Vec<usize> {
    let named = std::env::var("DARKQA_MODELS").unwrap_or_default();
    let named: Vec<usize> = named.split(',').filter_map(|count| count.parse().ok()).collect();
    if named.is_empty() { all.to_vec() } else { named }
}

#[test]
#[ignore = "takes an hour; prints a table of src/docs/numbers.md"]
#[expect(clippy::print_stdout, reason = "the table")]
fn null_reports_have_no_sign() {
    println!(
        "| models | profiles | enhancers | runs | any sign, % | within sets alone, % | decided by profile, % | kinds |"
    );
    let (mut all, mut signed) = (0, 0);
    for models in model_counts(&[1, 3, 6, 12]) {
        for profiles in [1, 4] {
            for enhancers in [0, 1, 4] {
                let design =
                    SimulationDesign { models, profiles, enhancers, frames: 42, gain: 0.0, loss: 0.0, twins: false };
                let counts = simulate(&design, runs(), (100 * models + 10 * profiles + enhancers) as u64);
                all += counts.runs;
                signed += counts.signed;
                println!(
                    "| {models} | {profiles} | {enhancers} | {} | {} | {} | {} | {:?} |",
                    counts.runs,
                    percent(counts.signed, counts.runs),
                    percent(counts.own, counts.runs),
                    percent(counts.decided, counts.runs),
                    counts.kinds
                );
            }
        }
    }
    println!("all: {}", percent(signed, all));
}

#[test]
#[ignore = "takes half an hour; prints a table of src/docs/numbers.md"]
#[expect(clippy::print_stdout, reason = "the table")]
fn effects_are_found() {
    println!(
        "| models | profiles | enhancers | effect | runs | help, % | help within its set, % | loss, % | loss within its set, % |"
    );
    for models in model_counts(&[1, 6]) {
        for (profiles, enhancers) in [(1, 1), (1, 4), (4, 1)] {
            for effect in [0.05, 0.1] {
                let design =
                    SimulationDesign { models, profiles, enhancers, frames: 42, gain: effect, loss: 0.0, twins: false };
                let seed = (100 * models + 10 * profiles + enhancers) as u64;
                let helped = simulate(&design, runs(), seed).helped;
                let design = SimulationDesign { gain: 0.0, loss: effect, ..design };
                let lost = simulate(&design, runs(), seed).lost;
                let mut cells = String::new();
                for count in helped.into_iter().chain(lost) {
                    let _ = write!(cells, " {} |", percent(count, runs()));
                }
                println!("| {models} | {profiles} | {enhancers} | {} | {} |{cells}", 100.0 * effect, runs());
            }
        }
    }
}

/// Number of simulated comparisons of unchanged models in which a model is called worse than in the old run.
fn false_alarms(models: usize, conditions: usize, runs: usize) -> usize {
    let design = SimulationDesign {
        models: 2 * models,
        profiles: 1,
        enhancers: 4,
        frames: 42,
        gain: 0.0,
        loss: 0.0,
        twins: true,
    };
    let mut random = StdRng::seed_from_u64((100 * models + conditions) as u64);
    let mut records = design.records();
    let kept: Vec<Option<Condition>> =
        design.conditions()[1..=conditions].iter().map(|name| Some(name.parse().unwrap())).collect();
    (0..runs)
        .filter(|_| {
            design.answer(&mut random, &mut records);
            let trials = records.iter().filter(|record| kept.contains(&record.condition)).cloned().collect();
            let units = Clusters::new(asked_pairs(&records), &FrameTies::default());
            let grid = Grid::new(&trials, &units);
            let pairs = grid.subjects.iter().enumerate().filter_map(|(index, subject)| {
                let number: usize = subject.model[1..].parse().ok()?;
                let old = ModelInCondition { model: format!("m{:02}", number + models), ..subject.clone() };
                Some((index, grid.find(&old)?))
            });
            let rows = baseline_rows(&grid, &healths(&grid), &pairs.collect::<Vec<_>>(), true, |_| None);
            rows.iter().any(|row| row.paired.tested.verdict == Verdict::Worse)
        })
        .count()
}

fn asked_pairs(records: &[Record]) -> impl Iterator<Item = (&QuestionId, &FrameId)> {
    records.iter().map(|record| (&record.question, &record.detail.frame))
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
#[expect(clippy::print_stdout, reason = "the table")]
fn unchanged_models_are_not_called_worse() {
    for (models, conditions) in [(1, 3), (1, 17), (6, 3), (6, 17), (12, 3), (12, 17)] {
        let alarms = false_alarms(models, conditions, runs());
        println!("| {models} | {conditions} | {} | {} |", runs(), percent(alarms, runs()));
    }
}
