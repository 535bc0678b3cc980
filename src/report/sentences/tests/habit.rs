//! Simulated runs in which one answer is true of most questions: a model that always gives it must not seem to see.

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};

use super::records::{answer, record, unanswered};
use super::simulation::{percent, runs};
use crate::sentences::sentences;
use darkqa_base::types::{Condition, Family, Record};
use darkqa_score::cluster::FrameTies;
use darkqa_score::findings::Findings;

const FRAMES: usize = 32;
const QUESTIONS: usize = 6;
const ROOMS: [&str; 4] = ["bedroom", "kitchen", "bathroom", "office"];
/// Share of questions of which the first room is true.
const COMMON: f64 = 0.81;

/// A model that sees up to a level, and answers with the first room in the dark and without images.
#[derive(Debug, Clone, Copy)]
struct HabitDesign {
    /// The darkest level at which it sees.
    sees_to: usize,
    /// True if it is asked without images, too.
    is_asked_blind: bool,
}

impl HabitDesign {
    fn records(self, random: &mut StdRng) -> Vec<Record> {
        let truths: Vec<usize> = (0..FRAMES * QUESTIONS)
            .map(|_| if random.random_bool(COMMON) { 0 } else { random.random_range(1..4) })
            .collect();
        let levels = (0..6).map(Some).chain(self.is_asked_blind.then_some(None));
        let mut records = Vec::new();
        for level in levels {
            let condition: Option<Condition> = level.map(|level| match level {
                0 => "L0".parse().unwrap(),
                level => format!("L{level}-ev").parse().unwrap(),
            });
            for (item, truth) in truths.iter().enumerate() {
                let sees = level.is_some_and(|level| level <= self.sees_to);
                let chosen = match sees {
                    false => 0,
                    true if random.random_bool(0.95) => *truth,
                    true => (truth + 1) % 4,
                };
                let frame = format!("f{:02}", item / QUESTIONS);
                let mut detail = unanswered(frame, Family::RoomType, &ROOMS);
                detail.truth = Some(*truth);
                answer(&mut detail, chosen);
                records.push(record(item, "m", condition.clone(), detail));
            }
        }
        records
    }
}

/// What simulated reports say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct HabitCounts {
    /// Reports with a threshold beyond the darkest level.
    beyond: usize,
    /// Reports with a threshold before L1, where the model stops seeing.
    early: usize,
    /// Reports that say that no loss was detected.
    no_loss: usize,
    /// Reports with the alert about answers that are often true.
    named: usize,
}

fn simulate(design: HabitDesign, runs: usize) -> HabitCounts {
    let mut random = StdRng::seed_from_u64(81);
    let mut counts = HabitCounts::default();
    for _ in 0..runs {
        let trials = design.records(&mut random).into_iter().collect();
        let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
        let said = sentences(&findings);
        let is_clear = said.iter().any(|one| one.kind == "darkness" && one.text.starts_with("No loss"));
        counts.no_loss += usize::from(is_clear);
        let threshold = findings.curves[0].summary.threshold;
        counts.beyond += usize::from(threshold.is_ok_and(|one| one.value.is_infinite()));
        counts.early += usize::from(threshold.is_ok_and(|one| one.value <= 2.0));
        counts.named += usize::from(!findings.summary.unbalanced.is_empty());
    }
    counts
}

const HABIT: HabitDesign = HabitDesign { sees_to: 0, is_asked_blind: true };

#[test]
fn a_habit_that_is_often_right_is_no_sight() {
    for is_asked_blind in [true, false] {
        let counts = simulate(HabitDesign { is_asked_blind, ..HABIT }, 40);
        assert_eq!((counts.beyond, counts.named), (0, 40), "{counts:?}");
        assert!(counts.early > 35, "{counts:?}");
    }
    // Control: a model that sees to the end.
    let seeing = HabitDesign { sees_to: 5, ..HABIT };
    let counts = simulate(seeing, 20);
    assert_eq!((counts.beyond, counts.early), (20, 0), "{counts:?}");
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
#[expect(clippy::print_stdout, reason = "the table")]
fn habits_are_no_sight() {
    println!("| sees to | asked without images | beyond 9 EV | before L1 | no loss | habit named |");
    for sees_to in [0, 2, 5] {
        for is_asked_blind in [true, false] {
            let counts = simulate(HabitDesign { sees_to, is_asked_blind }, runs());
            let cells = [counts.beyond, counts.early, counts.no_loss, counts.named];
            let [beyond, early, no_loss, named] = cells.map(|count| percent(count, runs()));
            println!("| L{sees_to} | {is_asked_blind} | {beyond} | {early} | {no_loss} | {named} |");
        }
    }
}
