//! Simulated runs with missing replies: a model that refuses what it would get wrong must not seem to see.

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};

use super::records::{answer, record, unanswered};
use super::simulation::{percent, runs};
use crate::sentences::{EffectDirection, sentences};
use darkqa_base::types::{Condition, Family, Record, TrialOutcome};
use darkqa_score::cluster::FrameTies;
use darkqa_score::comparisons::PooledKind;
use darkqa_score::findings::Findings;
use darkqa_score::threshold::NoThreshold;

/// Which replies of a model are missing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum MissingReplies {
    /// Replies that would be wrong, as far as the share allows.
    Wrong,
    /// Replies that would be right.
    Right,
    /// Any.
    Random,
}

/// A run of one model over the exposure drop alone.
#[derive(Debug, Clone, Copy)]
struct MissingDesign {
    missing: MissingReplies,
    /// Share of right answers at L0 to L5, if all questions were answered.
    right: [f64; 6],
    /// Share of missing replies at L0 to L5.
    missing_shares: [f64; 6],
}

const FRAMES: usize = 32;
const QUESTIONS: usize = 6;

/// Refuses nearly all that it would get wrong in the dark.
const REFUSING: MissingDesign = MissingDesign {
    missing: MissingReplies::Wrong,
    right: [0.9, 0.9, 0.85, 0.8, 0.7, 0.55],
    missing_shares: [0.0, 0.0, 0.1, 0.2, 0.3, 0.45],
};

/// Refuses in the dark what it would get right; darkness costs nothing.
const REFUSING_RIGHT: MissingDesign =
    MissingDesign { missing: MissingReplies::Right, right: [0.8; 6], missing_shares: [0.0, 0.0, 0.0, 0.0, 0.2, 0.4] };

impl MissingDesign {
    fn records(&self, random: &mut StdRng) -> Vec<Record> {
        let mut records = Vec::new();
        for level in 0..6 {
            let name = if level == 0 { "L0".to_owned() } else { format!("L{level}-ev") };
            let condition: Option<Condition> = Some(name.parse().unwrap());
            let (right, missing) = (self.right[level], self.missing_shares[level]);
            for item in 0..FRAMES * QUESTIONS {
                let frame = format!("f{:02}", item / QUESTIONS);
                let mut detail = unanswered(frame, Family::Color, &["a", "b", "c", "d"]);
                let is_right = random.random_bool(right);
                let share_of_outcome = match (self.missing, is_right) {
                    (MissingReplies::Random, _) => missing,
                    (MissingReplies::Wrong, false) => missing / (1.0 - right),
                    (MissingReplies::Right, true) => missing / right,
                    _ => 0.0,
                };
                if random.random_bool(share_of_outcome.min(1.0)) {
                    detail.outcome = TrialOutcome::Failed;
                } else {
                    answer(&mut detail, usize::from(!is_right) * random.random_range(1..4));
                }
                records.push(record(item, "m", condition.clone(), detail));
            }
        }
        records
    }
}

/// What simulated reports say about darkness.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct DarkCounts {
    /// Reports that call darkness better, or say that no loss was detected.
    misleading: usize,
    /// Reports with a threshold beyond the darkest level.
    beyond: usize,
    /// Reports whose interval of the difference at L5 holds the true one.
    covered: usize,
    /// Reports that detect a loss.
    lost: usize,
}

fn simulate(design: &MissingDesign, runs: usize) -> DarkCounts {
    let mut random = StdRng::seed_from_u64(74);
    let mut counts = DarkCounts::default();
    let truth = design.right[5] - design.right[0];
    for _ in 0..runs {
        let trials = design.records(&mut random).into_iter().collect();
        let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
        let said = sentences(&findings);
        let darkness: Vec<_> = said.iter().filter(|one| one.kind == "darkness").collect();
        counts.misleading += usize::from(
            darkness.iter().any(|one| one.tone == EffectDirection::Better || one.text.starts_with("No loss")),
        );
        counts.lost += usize::from(darkness.iter().any(|one| one.tone == EffectDirection::Worse));
        let whole = &findings.curves[0].summary;
        counts.beyond += usize::from(whole.threshold.is_ok_and(|one| one.value.is_infinite()));
        let darkest =
            findings.pooled.iter().rfind(|finding| finding.kind == PooledKind::Darkness && finding.family.is_none());
        let difference = darkest.unwrap().strict.tested.difference;
        counts.covered += usize::from((difference.low..=difference.high).contains(&truth));
    }
    counts
}

#[test]
fn refusals_of_wrong_answers_are_no_sight() {
    let counts = simulate(&REFUSING, 60);
    assert_eq!((counts.misleading, counts.beyond), (0, 0), "{counts:?}");
    assert!(counts.covered >= 55, "{counts:?}");
    // Control: with all replies, the same model shows its loss.
    let whole = MissingDesign { missing_shares: [0.0; 6], ..REFUSING };
    let counts = simulate(&whole, 20);
    assert_eq!((counts.misleading, counts.lost), (0, 20), "{counts:?}");
}

#[test]
fn refusals_of_right_answers_are_no_loss() {
    let counts = simulate(&REFUSING_RIGHT, 60);
    assert_eq!(counts.lost, 0, "{counts:?}");
    assert!(counts.covered >= 55, "{counts:?}");
}

#[test]
fn a_level_without_replies_has_no_verdict() {
    let design = MissingDesign {
        missing_shares: [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        missing: MissingReplies::Random,
        right: [0.9; 6],
    };
    let mut random = StdRng::seed_from_u64(3);
    let trials = design.records(&mut random).into_iter().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let said = sentences(&findings);
    let darkness: Vec<&str> = said.iter().filter(|one| one.kind == "darkness").map(|one| &*one.text).collect();
    assert_eq!(darkness, ["No verdict on darkness is possible at L5: no question has all replies at L5."]);
}

#[test]
fn undecided_thresholds_name_their_lower_end() {
    let mut random = StdRng::seed_from_u64(5);
    let trials = REFUSING.records(&mut random).into_iter().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let threshold = findings.curves[0].summary.threshold;
    let Err(NoThreshold::Missing { low }) = threshold else {
        panic!("{threshold:?}");
    };
    let darkest = findings.curves[0].summary.darkest.value();
    assert!(low < darkest, "{low}");
}

#[test]
#[ignore = "takes minutes; prints a table of src/docs/numbers.md"]
#[expect(clippy::print_stdout, reason = "the table")]
fn missing_replies_neither_hide_nor_make_a_loss() {
    println!("| missing | misleading | threshold beyond 9 EV | interval holds the truth | loss detected |");
    let none = MissingDesign { missing: MissingReplies::Random, right: [0.9; 6], missing_shares: [0.0; 6] };
    let at_random = |loss: f64, missing: f64| MissingDesign {
        right: [0.9, 0.9, 0.9, 0.9, 0.9 - loss, 0.9 - loss],
        missing_shares: [missing; 6],
        ..none
    };
    for (name, design) in [
        ("refuses wrong", REFUSING),
        ("refuses right", REFUSING_RIGHT),
        ("no loss, none missing", none),
        ("loss of 10, none missing", at_random(0.1, 0.0)),
        ("loss of 10, 1 % at random", at_random(0.1, 0.01)),
        ("loss of 10, 3 % at random", at_random(0.1, 0.03)),
        ("loss of 20, 3 % at random", at_random(0.2, 0.03)),
    ] {
        let counts = simulate(&design, runs());
        let [misleading, beyond, covered, lost] =
            [counts.misleading, counts.beyond, counts.covered, counts.lost].map(|count| percent(count, runs()));
        println!("| {name} | {misleading} | {beyond} | {covered} | {lost} |");
    }
}
