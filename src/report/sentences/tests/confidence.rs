//! Expected sentences about the confidence of models.

use super::checked;
use crate::sentences::below_blind::{Confidence, confidence};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, Severity, Variant};
use darkqa_score::calibration::{Calibration, RiskCoverage};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::Tested;
use darkqa_score::estimate::Estimate;
use darkqa_score::model_in_condition::ModelInCondition;

fn around(value: f64) -> Estimate {
    Estimate { value, low: value - 0.05, high: value + 0.05, n: 1200 }
}

/// A tested number, detected if it is more than 5 points from 0.
fn tested(value: f64) -> Tested {
    let p_report = Some(if value.abs() > 0.05 { 0.0004 } else { 0.3 });
    Tested { p_report, ..Tested::new(around(value), 0.0004) }
}

/// The calibration of a model with this confidence and accuracy.
fn calibration(confidence: f64, accuracy: f64) -> Calibration {
    let zero = around(0.0);
    Calibration {
        subject: ModelInCondition::with_images("a", AxisLevel::L0, &Variant::NONE, None),
        replies: 1200,
        reasoned: 0,
        unstated: 0,
        confidence: around(confidence),
        accuracy: around(accuracy),
        overconfidence: tested(confidence - accuracy),
        growth: Some(tested(confidence - accuracy - 0.02)),
        error: None,
        brier: zero,
        skill: zero,
        nll: zero,
        risk: RiskCoverage { at_100: 0.0, at_80: 0.0, at_50: 0.0, area: 0.0 },
        auroc: None,
        blind_shift: None,
        over_orders: None,
        bins: Vec::new(),
        positions: Vec::new(),
    }
}

#[test]
fn overconfidence_in_the_dark_is_reported() {
    let clean = calibration(0.9, 0.88);
    let (blind, modest, always) = (calibration(0.85, 0.4), calibration(0.42, 0.4), calibration(0.95, 0.88));
    assert_eq!(
        confidence_sentence(&[("a", &blind, Some(&clean))]).unwrap(),
        "− a does not know how little it sees at L5: its mean confidence is 85.0 %, and 40.0 % of its replies are right. \
         (confidence less accuracy: +45.0 [+40.0, +50.0] points, p < 0.001, +2.0 [−3.0, +7.0] at L0; n = 1,200 replies with probabilities)"
    );
    // The most overconfident model is named, with the number of overconfident models.
    let several =
        confidence_sentence(&[("b", &modest, Some(&clean)), ("a", &blind, Some(&clean)), ("c", &modest, None)]);
    let several = several.unwrap();
    assert!(several.starts_with("− a does not know") && several.contains("shown of 1 of 3 models"), "{several}");
    // If overconfidence is not larger than at L0, or L0 was not asked, the sentence does not blame the dark.
    for clean in [Some(&clean), None] {
        let said = confidence_sentence(&[("a", &always, clean)]).unwrap();
        assert!(said.starts_with("− At L5 a is surer than it is right: its mean confidence is 95.0 %"), "{said}");
    }
    let said = confidence_sentence(&[("b", &modest, Some(&clean))]).unwrap();
    assert!(said.starts_with("· b was not detected to be surer than it is right at L5"), "{said}");
    assert_eq!(confidence_sentence(&[]), None);
}

fn confidence_sentence(models: &[(&str, &Calibration, Option<&Calibration>)]) -> Option<String> {
    let level = AxisLevel::new(Kind::Sensor, Severity::LADDER[4]);
    let all: Vec<Confidence<'_>> =
        models.iter().map(|&(model, dark, clean)| Confidence { model, level, dark, clean }).collect();
    let sentence = confidence(&all, ClusterUnit::Scene);
    sentence.as_ref().map(checked)
}
