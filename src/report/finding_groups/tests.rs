use super::*;
use crate::sentences::{EffectDirection, SentenceScope};

fn sentence(kind: &'static str, tone: EffectDirection, text: &str, scope: SentenceScope) -> Sentence {
    Sentence {
        kind,
        tone,
        text: format!("{text}."),
        detail: String::new(),
        values: [("difference", -20.0), ("low", -40.0), ("high", -5.0)]
            .map(|(name, value)| (name.to_owned(), value))
            .into(),
        scope,
    }
}

fn scope_of_subject(subject: &str) -> SentenceScope {
    SentenceScope { subject: Some(subject.to_owned()), ..SentenceScope::default() }
}

fn scope_of_light(light: &str, level: &str) -> SentenceScope {
    SentenceScope { light: Some(light.to_owned()), at: Some(level.to_owned()), ..SentenceScope::default() }
}

#[test]
fn a_detected_finding_is_the_main_finding() {
    let sentences = [
        sentence("enhancer", EffectDirection::NotShown, "a does nothing", scope_of_subject("a")),
        sentence("enhancer", EffectDirection::Worse, "b harms", scope_of_subject("b")),
        sentence("fidelity", EffectDirection::Better, "psnr", SentenceScope::default()),
        sentence("darkness", EffectDirection::NotShown, "no loss", SentenceScope::default()),
        sentence("best", EffectDirection::Better, "m sees best", SentenceScope::default()),
    ];
    let groups = FindingGroups::new(&sentences);
    let first: Vec<(&str, String)> =
        groups.main_findings().into_iter().map(|(title, finding)| (title, finding.text())).collect();
    let expected = [("Darkness", "no loss"), ("Enhancers", "b harms")];
    assert_eq!(first, expected.map(|(title, text)| (title, text.to_owned())));
    assert_eq!(groups.summary(), "no loss; b harms.");
    assert_eq!(groups.count(), 5);
}

#[test]
fn enhancer_with_the_largest_effect_stands_for_its_group() {
    let of = |subject: &str, difference: f64, tone| {
        let text = format!("{subject} acts");
        let mut sentence = sentence("enhancer", tone, &text, scope_of_subject(subject));
        sentence.values.insert("difference".to_owned(), difference);
        sentence.scope.training = format!("{subject} was trained.");
        sentence
    };
    let mut sentences = vec![
        of("a", -2.0, EffectDirection::NotShown),
        of("b", -9.0, EffectDirection::NotShown),
        of("c", 3.0, EffectDirection::NotShown),
    ];
    let groups = FindingGroups::new(&sentences);
    assert_eq!(groups.main_findings()[0].1.text(), "b acts. b was trained");
    assert_eq!(groups.summary(), "no effect of the 3 enhancers was detected.");
    // A detected effect comes before a larger one that is not detected.
    sentences[0].tone = EffectDirection::Worse;
    sentences[2].tone = EffectDirection::Better;
    let groups = FindingGroups::new(&sentences);
    assert_eq!(groups.summary(), "c acts; a acts. c was trained. a was trained.");
}

#[test]
fn all_effects_of_an_enhancer_are_one_finding() {
    let sentences = [
        sentence("enhancer", EffectDirection::Worse, "a harms at L1", scope_of_subject("a")),
        sentence("enhancer", EffectDirection::Better, "a helps at L4", scope_of_subject("a")),
        sentence("enhancer", EffectDirection::NotShown, "a at L2", scope_of_subject("a")),
    ];
    let groups = FindingGroups::new(&sentences);
    assert_eq!(groups.count(), 1);
    assert_eq!(groups.main_findings()[0].1.text(), "a harms at L1; a helps at L4");
}

#[test]
fn noise_profiles_are_compared_in_one_finding() {
    let sentences = [
        sentence("darkness", EffectDirection::NotShown, "paper: no loss", scope_of_light("paper", "L3")),
        sentence("darkness", EffectDirection::Worse, "eld: costs", scope_of_light("eld", "L5")),
    ];
    let groups = FindingGroups::new(&sentences);
    let first = groups.main_findings();
    assert_eq!(first[0].1.text(), "eld: costs");
    let intervals = first[0].1.intervals();
    let texts: Vec<String> = intervals.iter().map(ToString::to_string).collect();
    assert_eq!(texts, ["−20.0 [−40.0, −5.0] at L5", "paper: −20.0 [−40.0, −5.0] at L3"]);
}

#[test]
fn a_summary_without_darkness_is_the_first_finding() {
    let sentences = [sentence("noise", EffectDirection::Worse, "noise costs", SentenceScope::default())];
    assert_eq!(FindingGroups::new(&sentences).summary(), "noise costs.");
    assert_eq!(FindingGroups::new(&[]).summary(), "");
}

#[test]
fn a_sentence_of_an_unknown_kind_is_in_the_last_group() {
    let sentences = [sentence("novel", EffectDirection::Note, "new", SentenceScope::default())];
    let groups = FindingGroups::new(&sentences);
    assert_eq!((groups.all()[0].title, groups.count()), ("Sample", 1));
    assert!(groups.main_findings().is_empty());
}
