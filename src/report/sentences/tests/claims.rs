//! Simulated runs about one claim of a report: how often it is made, with and without its effect.

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};

use super::records::{record, unanswered};
use super::simulation::{normals, percent, runs, set_answer};
use crate::sentences::{Sentence, sentences};
use darkqa_base::types::{ChoiceDetail, Condition, Family, Record};
use darkqa_score::cluster::FrameTies;
use darkqa_score::findings::Findings;

/// A run with known accuracies, about one claim of its report.
struct Claimed {
    name: &'static str,
    models: &'static [&'static str],
    families: usize,
    /// Number of frames, each with a question of every family.
    frames: usize,
    /// Accuracy of a model in a condition on a family.
    accuracy: fn(&str, &str, usize) -> f64,
    /// True if the first model answers at L3–L5 as without images.
    is_blind_in_the_dark: bool,
    /// True if models are asked without images.
    has_blind: bool,
    /// True if a sentence makes the claim.
    claims: fn(&Sentence) -> bool,
}

impl Claimed {
    /// Number of simulated reports with the claim.
    fn count(&self, runs: usize, seed: u64) -> usize {
        let mut random = StdRng::seed_from_u64(seed);
        (0..runs)
            .filter(|_| {
                let trials = self.records(&mut random).into_iter().collect();
                let findings = Findings::sentences_only(&trials, &FrameTies::default());
                sentences(&findings).iter().any(self.claims)
            })
            .count()
    }

    /// Draws the records. Items and frames have random difficulties, and conditions differ by a new draw of 30 % of the
    /// answers.
    fn records(&self, random: &mut StdRng) -> Vec<Record> {
        let choices = ["red", "green", "blue", "white"];
        let items = self.frames * self.families;
        let frames = normals(random, self.frames, 0.5);
        let difficulties = normals(random, items, 0.8);
        let mut records = Vec::new();
        for (index, model) in self.models.iter().enumerate() {
            let fixed: Vec<f64> = (0..items).map(|_| random.random_range(0.0..1.0)).collect();
            let mut without_images = Vec::new();
            for name in ["", "L0", "L1-ev", "L2-ev", "L3-ev", "L4-ev", "L5-ev"] {
                let condition: Option<Condition> = (!name.is_empty()).then(|| name.parse().unwrap());
                let is_dark = ["L3-ev", "L4-ev", "L5-ev"].contains(&name);
                for item in 0..items {
                    let (frame, family) = (item / self.families, item % self.families);
                    let share = (self.accuracy)(model, name, family);
                    let logit = (share / (1.0 - share)).ln() + frames[frame] + difficulties[item];
                    let p = 1.0 / (1.0 + (-logit).exp());
                    let drawn = if random.random_bool(0.3) { random.random_range(0.0..1.0) } else { fixed[item] };
                    let family = Family::Other(format!("family {family:02}"));
                    let mut detail = unanswered(format!("f{frame:03}"), family, &choices);
                    if self.is_blind_in_the_dark && index == 0 && is_dark {
                        detail = ChoiceDetail::clone(&without_images[item]);
                    } else {
                        set_answer(&mut detail, p, drawn);
                    }
                    detail.options = None;
                    if name.is_empty() {
                        without_images.push(detail.clone());
                        if !self.has_blind {
                            continue;
                        }
                    }
                    records.push(record(item, model, condition.clone(), detail));
                }
            }
        }
        records
    }
}

/// Accuracy of two models that are equal at L1–L4.
fn equal_between(model: &str, condition: &str, _: usize) -> f64 {
    match (model, condition) {
        ("a", "L0") => 0.95,
        ("a", "L5-ev") => 0.45,
        ("b", "L0") => 0.7,
        ("b", "L5-ev") => 0.8,
        (_, "") => 0.3,
        _ => 0.75,
    }
}

/// Accuracy of a model `a` that is better than `b` in the dark, without seeing anything there.
fn better_by_habit(model: &str, condition: &str, _: usize) -> f64 {
    match (model, condition) {
        ("a", "") => 0.55,
        ("b", "") => 0.3,
        (_, "L0" | "L1-ev" | "L2-ev") => 0.9,
        _ => 0.35,
    }
}

/// Accuracy of a model `a` that guesses in the dark; `b` is below chance.
fn guesses(model: &str, condition: &str, _: usize) -> f64 {
    match (model, condition) {
        (_, "L0" | "L1-ev" | "L2-ev") => 0.9,
        ("a", _) => 0.25,
        _ => 0.08,
    }
}

/// Accuracy of a model `a` that sees in the dark.
fn sees(model: &str, condition: &str, _: usize) -> f64 {
    match (model, condition) {
        (_, "") => 0.3,
        (_, "L0" | "L1-ev" | "L2-ev") => 0.9,
        ("a", _) => 0.6,
        _ => 0.4,
    }
}

/// Accuracy of a model that loses equally in all families.
fn equal_losses(_: &str, condition: &str, _: usize) -> f64 {
    match condition {
        "" => 0.3,
        "L0" => 0.9,
        "L5-ev" => 0.5,
        _ => 0.8,
    }
}

/// Accuracy of a model that loses 20 points more in the first family.
fn one_loses_more(model: &str, condition: &str, family: usize) -> f64 {
    let share = equal_losses(model, condition, family);
    if condition == "L5-ev" && family == 0 { share - 0.2 } else { share }
}

/// True if a sentence attributes L1, L2, L3 or L4 to one of two leaders.
fn names_a_level_between(sentence: &Sentence) -> bool {
    let attributed = sentence.text.split("; not told apart").next();
    let is_range = |text: &str| ["L1", "L2", "L3", "L4", "–"].iter().any(|at| text.contains(at));
    is_crossing(sentence) && attributed.is_some_and(is_range)
}

/// True if a sentence is about two leaders.
fn is_crossing(sentence: &Sentence) -> bool {
    sentence.kind == "best" && sentence.text.contains(" is better at ")
}

/// True if a sentence states that a model sees best.
fn says_sees(sentence: &Sentence) -> bool {
    sentence.kind == "best" && sentence.text.contains(" sees best ")
}

/// True if a sentence states that one family loses more than another.
fn compares_families(sentence: &Sentence) -> bool {
    sentence.kind == "families"
}

/// Runs in which the claim is false, and runs in which it is true.
fn claimed_runs() -> Vec<Claimed> {
    let two = Claimed {
        name: "two leaders, equal at L1–L4: a level between is attributed",
        models: &["a", "b"],
        families: 4,
        frames: 42,
        accuracy: equal_between,
        is_blind_in_the_dark: false,
        has_blind: false,
        claims: names_a_level_between,
    };
    vec![
        Claimed { name: "true: two leaders, 25 and 35 points apart at L0 and L5", claims: is_crossing, ..two },
        Claimed {
            name: "dark replies are those without images: it sees best",
            accuracy: better_by_habit,
            is_blind_in_the_dark: true,
            has_blind: true,
            claims: says_sees,
            ..two
        },
        Claimed {
            name: "guesses in the dark, not asked without images: it sees best",
            accuracy: guesses,
            claims: says_sees,
            ..two
        },
        Claimed {
            name: "true: sees 20 points more than the other model in the dark",
            accuracy: sees,
            has_blind: true,
            claims: says_sees,
            ..two
        },
        Claimed {
            name: "20 families with equal losses: one costs more",
            models: &["a"],
            families: 20,
            accuracy: equal_losses,
            claims: compares_families,
            ..two
        },
        Claimed {
            name: "2 families with equal losses: one costs more",
            models: &["a"],
            families: 2,
            accuracy: equal_losses,
            claims: compares_families,
            ..two
        },
        Claimed {
            name: "true: one of 4 families loses 20 points more",
            models: &["a"],
            accuracy: one_loses_more,
            claims: compares_families,
            ..two
        },
        two,
    ]
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
#[expect(clippy::print_stdout, reason = "the table")]
fn false_claims_are_rare() {
    for (index, claimed) in claimed_runs().iter().enumerate() {
        let count = claimed.count(runs(), 7 + index as u64);
        println!("| {} | {} |", claimed.name, percent(count, runs()));
        let share = darkqa_score::estimate::Estimate::share(count, runs()).unwrap();
        if claimed.name.starts_with("true: ") {
            // A true effect is claimed more often than a false one may be.
            assert!(share.low > 0.05, "{}: {share:?}", claimed.name);
        } else {
            assert!(share.low <= 0.05, "{}: {share:?}", claimed.name);
        }
    }
}
