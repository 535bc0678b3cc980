//! Expected sentences about models that are less often right with images than without.

use super::{checked, finding};
use crate::sentences::below_blind;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, Family, Severity, Variant};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::paired::{PairedComparison, Spread};
use darkqa_score::comparisons::{Comparison, ComparisonKind, PooledFinding, PooledKind, Tested};
use darkqa_score::estimate::Estimate;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::significance::Verdict::{self, Better, NotShown, Worse};

/// A comparison of `model` with images and `other` without, in a family.
fn against_blind(
    model: &str,
    other: &str,
    family: &Family,
    level: usize,
    difference: f64,
    verdict: Verdict,
) -> Comparison {
    let level = AxisLevel::new(Kind::Sensor, Severity::LADDER[level - 1]);
    let variant = Variant { kind: Some(Kind::Sensor), ..Variant::NONE };
    Comparison {
        kind: ComparisonKind::Blind,
        first: ModelInCondition::with_images(model, level, &variant, None),
        second: ModelInCondition::new(other, None),
        family: Some(family.clone()),
        strict: tested(difference, verdict),
        lenient: tested(difference, verdict),
        least_holm: 1e-6,
    }
}

fn tested(value: f64, verdict: Verdict) -> PairedComparison {
    let difference = Estimate { value, low: value - 0.1, high: value + 0.1, n: 45 };
    PairedComparison {
        first: 0.3,
        second: 0.3 - value,
        tested: Tested {
            holm: 0.0123,
            verdict,
            p_report: Some(if verdict.is_shown() { 0.0123 } else { 0.3 }),
            ..Tested::new(difference, 0.001)
        },
        gained: 1,
        lost: 9,
        clusters: 24,
        mcnemar: 0.02,
        missing: 0,
        spread: Spread { error: 0.05, degrees: 23.0 },
    }
}

#[test]
fn family_below_blind_is_reported_once() {
    let color = &Family::Color;
    let one = [
        against_blind("sim-F", "sim-F", color, 3, -0.05, NotShown),
        against_blind("sim-F", "sim-F", color, 4, -0.2, Worse),
        against_blind("sim-F", "sim-F", color, 5, -0.3, Worse),
        against_blind("sim-A", "sim-A", color, 5, 0.2, Better),
        against_blind("sim-F", "sim-F", &Family::RoomType, 5, -0.25, Worse),
    ];
    assert_eq!(
        family_sentence(&one, &[]).unwrap(),
        "− Object colour: sim-F is less often right than without images at L4–L5. (sim-F at L5: −30.0 [−40.0, −20.0], p = 0.012; n = 45 in 24 scenes)"
    );
    let two = [&one[..], &[against_blind("sim-B", "sim-B", color, 5, -0.2, Worse)]];
    let said = family_sentence(&two.concat(), &[]).unwrap();
    assert!(
        said.starts_with("− Object colour: 2 of 3 models are less often right than without images. (sim-F at L5: "),
        "{said}"
    );
    // A model without blind replies of its own.
    let other = [against_blind("sim-F", "c", color, 5, -0.3, Worse)];
    let said = family_sentence(&other, &[]).unwrap();
    assert!(
        said.starts_with(
            "− Object colour: sim-F is less often right than c without images at L5. (sim-F at L5 against c: "
        ),
        "{said}"
    );
    assert_eq!(family_sentence(&one[..1], &[]), None);
    // The findings over all families are about several models, about this model alone, or not detected.
    let mut pooled = finding(PooledKind::Blind, 5, -0.2, Worse);
    assert!(family_sentence(&one, &[&pooled]).is_some());
    pooled.models = vec!["sim-F".to_owned()];
    assert_eq!(family_sentence(&one, &[&pooled]), None);
    pooled.strict.tested.p_report = Some(0.2);
    assert!(family_sentence(&one, &[&pooled]).is_some());
}

fn family_sentence(all: &[Comparison], pooled: &[&PooledFinding]) -> Option<String> {
    let all: Vec<&Comparison> = all.iter().collect();
    let sentence = below_blind::in_a_family(&all, pooled, ClusterUnit::Scene);
    sentence.as_ref().map(checked)
}

#[test]
fn blind_side_is_named() {
    let rows: [(&[&str], &[&str], &str); 4] = [
        (&["a"], &["a"], "In the dark a is less often right than without images at L5."),
        (&["a"], &["random"], "In the dark a is less often right than random without images at L5."),
        (&["a", "b"], &["b"], "In the dark the models are less often right than without images at L5."),
        (&["a", "b"], &["c", "d"], "In the dark the models are less often right than the models without images at L5."),
    ];
    for (models, blind, expected) in rows {
        assert_eq!(pooled_text(models, blind), expected);
    }
}

fn pooled_text(models: &[&str], blind: &[&str]) -> String {
    let mut finding = finding(PooledKind::Blind, 5, -0.2, Worse);
    let [models, blind] = [models, blind].map(|names| names.iter().map(|&n| n.to_owned()));
    (finding.models, finding.blind_models) = (models.collect(), blind.collect());
    let sentence = below_blind::pooled(&[&finding], ClusterUnit::Scene);
    sentence.unwrap().text
}
