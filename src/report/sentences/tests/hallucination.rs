//! Expected sentences about false answers and about one answer to most questions.

use super::{checked, findings};
use crate::sentences::hallucination::{self, TopAnswer};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, Family, Severity};
use darkqa_score::answers::confusion::{AgainstClean, Collapse, FalseAnswer};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::Tested;
use darkqa_score::comparisons::paired::{PairedComparison, Spread};
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::estimate::Estimate;
use darkqa_score::significance::Verdict::{self, Better, NotShown, Worse};

#[test]
fn detected_increases_of_false_answers_are_reported() {
    // A growing rate is worse; the darkest level is not detected here.
    let grown = [(0.1, NotShown), (0.4, Worse), (0.84, Worse), (0.9, NotShown)];
    assert_eq!(
        false_answer_sentence(FalseAnswer::No, &grown).unwrap(),
        "− At L3 “no” is answered to 89.0 % of the objects that are there (5.0 % at L0). (mean of these 2 models: +84.0 [+80.0, +88.0], \
         p < 0.001; an increase is shown at L2–L3; n = 1,237 in 30 scenes)"
    );
    let said = false_answer_sentence(FalseAnswer::Yes, &[(0.4, Worse)]).unwrap();
    assert!(
        said.starts_with("− At L1 “yes” is answered to 45.0 % of the objects that are not there (5.0 % at L0). ("),
        "{said}"
    );
    assert_eq!(false_answer_sentence(FalseAnswer::No, &[(0.5, NotShown)]), None);
    assert_eq!(false_answer_sentence(FalseAnswer::No, &[(-0.03, Better)]), None);
    assert_eq!(false_answer_sentence(FalseAnswer::No, &[]), None);
}

fn false_answer_sentence(answer: FalseAnswer, levels: &[(f64, Verdict)]) -> Option<String> {
    let mut all = findings(PooledKind::Hallucination(answer), levels);
    for finding in &mut all {
        let strict = &mut finding.strict;
        (strict.first, strict.second) = (0.05 + strict.tested.difference.value, 0.05);
        finding.family = Some(Family::Presence);
    }
    let all: Vec<&PooledFinding> = all.iter().collect();
    let sentence = hallucination::false_answers(&all, answer, ClusterUnit::Scene);
    sentence.as_ref().map(checked)
}

/// The most frequent answer of a model: its share, its true share, and the share of a guess.
fn collapse(share: f64, truth: f64, guess: f64) -> Collapse {
    Collapse {
        top: "living room".to_owned(),
        share: Estimate { value: share, low: share - 0.1, high: share + 0.1, n: 45 },
        truth,
        guess,
        entropy: 1.0,
        true_entropy: 2.0,
        clusters: 24,
        clean: Some(AgainstClean { strict: at_clean(share), lenient: at_clean(share), is_commonest: true }),
    }
}

/// The share of the same answer at L0.
fn at_clean(share: f64) -> PairedComparison {
    let value = share - 0.305;
    let difference = Estimate { value, low: value - 0.1, high: value + 0.1, n: 45 };
    PairedComparison {
        first: share,
        second: 0.305,
        tested: Tested { p_report: Some(0.0012), ..Tested::new(difference, 0.001) },
        gained: 20,
        lost: 3,
        clusters: 24,
        mcnemar: 0.001,
        missing: 0,
        spread: Spread { error: 0.05, degrees: 23.0 },
    }
}

#[test]
fn collapse_needs_an_increase_since_l0() {
    let mut found = collapse(0.67, 0.32, 0.25);
    assert!(found.is_shown());
    found.clean.as_mut().unwrap().lenient.tested.p_report = Some(0.2);
    assert!(!found.is_shown(), "only the strict parsing shows it");
    found.clean = None;
    assert!(!found.is_shown(), "there is no L0");
}

#[test]
fn collapsed_models_are_named_or_counted() {
    let room = Family::RoomType;
    let seeing = collapse(0.4, 0.32, 0.25);
    let blind = collapse(0.67, 0.32, 0.25);
    assert_eq!(
        collapse_sentence(&[(&room, &[("sim-F", blind.clone())])]).unwrap(),
        "− At L5 67.0 % of the replies about room type are “living room”, which is true of 32.0 %. (sim-F: 67.0 % [57.0, 77.0], 30.5 % at \
         L0 (+36.5 [+26.5, +46.5] points, p = 0.001); limit: 20 points above the true share; n = 45 in 24 scenes)"
    );
    let one = [("sim-A", seeing.clone()), ("sim-F", blind.clone())];
    let said = collapse_sentence(&[(&room, &one)]).unwrap();
    assert!(
        said.starts_with(
            "− At L5 67.0 % of the replies of sim-F about room type are “living room”, which is true of 32.0 %. ("
        ),
        "{said}"
    );
    let two = [("sim-A", seeing.clone()), ("sim-B", collapse(0.6, 0.32, 0.25)), ("sim-F", blind.clone())];
    // The models of the family with the largest excess are counted.
    let color = [("sim-A", collapse(0.5, 0.29, 0.25))];
    let said = collapse_sentence(&[(&Family::Color, &color), (&room, &two)]).unwrap();
    assert!(
        said.starts_with(
            "− At L5 2 of 3 models give one answer about room type far more often than it is true: 67.0 % of the replies of sim-F are \
             “living room”, which is true of 32.0 %. ("
        ),
        "{said}"
    );
    assert!(said.ends_with("in 24 scenes; also in object colour)"), "{said}");
    // An excess of 19 points; an interval that contains the true share; a random choice of two words; too few clusters.
    for not_shown in [
        collapse(0.51, 0.32, 0.25),
        Collapse { share: Estimate { low: 0.3, ..blind.share }, ..blind.clone() },
        collapse(0.55, 0.2, 0.5),
        Collapse { clusters: 7, ..blind.clone() },
    ] {
        assert_eq!(collapse_sentence(&[(&room, &[("sim-F", not_shown)])]), None);
    }
    // An excess of 20 points, which is not exact in binary.
    assert!(collapse_sentence(&[(&room, &[("sim-F", collapse(0.6, 0.4, 0.25))])]).is_some());
    assert_eq!(collapse_sentence(&[]), None);
}

fn collapse_sentence(families: &[(&Family, &[(&str, Collapse)])]) -> Option<String> {
    let level = AxisLevel::new(Kind::Sensor, Severity::LADDER[4]);
    let answers: Vec<TopAnswer<'_>> = families
        .iter()
        .flat_map(|(family, models)| {
            models.iter().map(move |(model, collapse)| TopAnswer { model, family, level, collapse })
        })
        .collect();
    let sentence = hallucination::collapse(&answers, ClusterUnit::Scene);
    sentence.as_ref().map(checked)
}
