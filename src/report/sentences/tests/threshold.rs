//! The sentence about how dark it may be: its models, enhancers, levels and light.

use super::checked;
use super::records::{answer, record, unanswered};
use crate::sentences::sentences;
use darkqa_base::types::{Condition, Family, Record};
use darkqa_score::cluster::FrameTies;
use darkqa_score::findings::Findings;
use darkqa_score::photographs::PhotographedSet;

/// Replies of a model to 8 questions about each of 16 frames, with a share of right ones in each condition.
fn replies(model: &str, conditions: &[(&str, f64)]) -> Vec<Record> {
    let mut records = Vec::new();
    for (name, share) in conditions {
        let condition: Option<Condition> = Some(name.parse().unwrap());
        for item in 0..128 {
            let mut detail = unanswered(format!("f{:02}", item / 8), Family::Color, &["a", "b", "c", "d"]);
            let place = (item * 37 % 128) as f64 / 128.0;
            answer(&mut detail, usize::from(place >= *share));
            records.push(record(item, model, condition.clone(), detail));
        }
    }
    records
}

/// The sentences about thresholds of these replies, of photographs taken in a light of `lux`.
fn said(records: Vec<Record>, lux: Option<f64>) -> Vec<String> {
    let trials = records.into_iter().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let findings = findings.with_set(PhotographedSet { lux, ..PhotographedSet::default() });
    sentences(&findings).iter().filter(|one| one.kind == "threshold").map(checked).collect()
}

/// Half-way from 1 to the floor of four choices is 0.625, at 5 EV on the line from 0.75 at 4 EV to 0.5 at 6 EV.
const FALLING: [(&str, f64); 4] = [("L0", 1.0), ("L2-ev", 0.75), ("L3-ev", 0.5), ("L5-ev", 0.25)];

#[test]
fn a_model_has_its_level_interval_and_light() {
    let [one] = &said(replies("m", &FALLING), None)[..] else { panic!() };
    assert!(one.starts_with("· m keeps half of the lead over guessing down to 5.0 EV ["), "{one}");
    assert!(one.contains("], between L2 and L3."), "{one}");
    // 200 lux / 2⁵ is 6.25 lux.
    let [one] = &said(replies("m", &FALLING), Some(200.0))[..] else { panic!() };
    assert!(one.contains("], 6.3 of 200 lux, between L2 and L3."), "{one}");
}

#[test]
fn an_estimated_light_names_its_images() {
    let trials = replies("m", &FALLING).into_iter().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let set = PhotographedSet { lux: Some(200.0), exposed: Some(48), ..PhotographedSet::default() };
    let findings = findings.with_set(set);
    let one = sentences(&findings).iter().find(|one| one.kind == "threshold").map(checked).unwrap();
    assert!(one.contains("lux at L0 estimated from the camera settings of 48 images"), "{one}");
}

#[test]
fn an_enhancer_has_its_own_threshold() {
    let with_lift = [FALLING.as_slice(), &[("L2-ev+lift", 1.0), ("L3-ev+lift", 1.0), ("L5-ev+lift", 1.0)]].concat();
    let [one] = &said(replies("m", &with_lift), Some(200.0))[..] else { panic!() };
    assert!(one.contains("; with lift down to > 9 EV."), "{one}");
}

#[test]
fn several_models_are_one_sentence() {
    let records = [replies("a", &FALLING), replies("b", &FALLING.map(|(name, _)| (name, 0.9)))].concat();
    let [one] = &said(records, None)[..] else { panic!() };
    assert!(one.starts_with("· Half of the lead over guessing is left down to: a 5.0 EV ["), "{one}");
    assert!(one.contains("], b > 9 EV"), "{one}");
}

#[test]
fn no_threshold_no_sentence() {
    assert_eq!(said(replies("m", &FALLING.map(|(name, _)| (name, 0.25))), Some(200.0)), [""; 0]);
}

#[test]
fn a_model_that_sees_everywhere_keeps_more_than_half() {
    let [one] = &said(replies("m", &FALLING.map(|(name, _)| (name, 0.9))), Some(200.0))[..] else { panic!() };
    assert!(one.starts_with("· m keeps more than half of the lead over guessing at all levels, down to L5"), "{one}");
    assert!(!one.contains("lux"), "{one}");
}
