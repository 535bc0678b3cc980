//! Expected sentences of each kind and verdict. Every number in a sentence must be one of its values ([`checked`]).

mod below_blind;
mod best;
mod claims;
mod confidence;
mod habit;
mod hallucination;
mod missing;
mod real;
pub(crate) mod records;
mod simulation;
mod threshold;

use super::sentence::{Sentence, level_runs};
use super::{below_blind as below, darkness, pooled, sample};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, EnhancerName, Severity, Variant};
use darkqa_score::auc::Auc;
use darkqa_score::cluster::{ClusterUnit, FrameTies};
use darkqa_score::comparisons::{PooledDifference, PooledFinding, PooledKind, Tested};
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::photographs::FidelityFindings;
use darkqa_score::significance::SwapMethod;
use darkqa_score::significance::Verdict::{self, Better, NotShown, TooFewClusters, Worse};

/// A finding at one of the named levels, with an interval of ± 4 points.
pub(crate) fn finding(kind: PooledKind, level: usize, difference: f64, verdict: Verdict) -> PooledFinding {
    let enhancer = (kind == PooledKind::Enhancer).then(|| EnhancerName::new("lift").unwrap());
    PooledFinding {
        kind,
        family: None,
        variant: Variant { kind: Some(Kind::Sensor), ..Variant::NONE },
        enhancer,
        against: None,
        level: AxisLevel::new(Kind::Sensor, Severity::LADDER[level - 1]),
        mean_over: Vec::new(),
        models: ["a", "b"].map(str::to_owned).to_vec(),
        blind_models: if kind == PooledKind::Blind { vec!["a".to_owned(), "b".to_owned()] } else { Vec::new() },
        strict: parsed(kind, difference, verdict),
        lenient: parsed(kind, difference, verdict),
        format: [1.0, 1.0],
        levels: 5,
        items: 1237,
        dropped: 0,
        missing: 0,
        clusters: 30,
        least_p: 1e-9,
        least_holm: 1e-8,
    }
}

/// The difference of a finding in a parsing.
fn parsed(kind: PooledKind, difference: f64, verdict: Verdict) -> PooledDifference {
    let holm = if verdict == NotShown { 0.062 } else { 0.0004 };
    // A loss has a negative difference, except for rates of false answers, which are worse if they grow.
    let is_loss = matches!(kind, PooledKind::Hallucination(_)) == (difference > 0.0);
    assert!(verdict != Worse || is_loss || difference == 0.0, "{kind:?} {difference}");
    PooledDifference {
        first: 0.5,
        second: 0.8637,
        tested: Tested {
            p_by: Some(SwapMethod::Counted),
            holm,
            verdict,
            p_report: Some(holm),
            ..Tested::new(
                Estimate { value: difference, low: difference - 0.04, high: difference + 0.04, n: 1237 },
                0.0124,
            )
        },
    }
}

fn findings(kind: PooledKind, all: &[(f64, Verdict)]) -> Vec<PooledFinding> {
    all.iter().enumerate().map(|(i, (difference, verdict))| finding(kind, i + 1, *difference, *verdict)).collect()
}

/// The numbers in a text, without those of level names.
fn numbers(text: &str) -> Vec<f64> {
    let text = text.replace('−', "-");
    text.split([' ', '[', ']', '(', ')', ';', '–', ':', '%'])
        .map(|word| word.trim_end_matches(['.', ',']).replace(',', ""))
        .filter_map(|word| word.parse().ok())
        .collect()
}

/// The sentence as one line. Panics if a number in it is not one of its values.
fn checked(sentence: &Sentence) -> String {
    let line = format!("{} {} ({})", sentence.tone.sign(), sentence.text, sentence.detail);
    for number in numbers(&line) {
        let mut values = sentence.values.values();
        assert!(
            values.any(|value| (value.abs() - number.abs()).abs() < 1e-9),
            "{number} of {line} is not in {:?}",
            sentence.values
        );
    }
    line
}

#[test]
fn each_kind_and_verdict_has_a_sentence() {
    use PooledKind::{Blind, Darkness, Enhancer, Noise};
    let said = level_sentences(Darkness, &[(-0.02, NotShown), (-0.1, Worse), (-0.449, Worse)]);
    assert_eq!(
        said,
        [
            "− Darkness costs 44.9 points at L3, from 86.4 % at L0. (mean of these 2 models: −44.9 [−48.9, −40.9], p < 0.001; a loss is \
          shown at L2–L3; at L1–L3: −2.0, −10.0, −44.9; n = 1,237 in 30 scenes)"
        ]
    );
    let said = level_sentences(Darkness, &[(-0.02, NotShown), (-0.01, NotShown)]);
    assert_eq!(
        said,
        [
            "· No loss by darkness was detected at any level; a loss of up to 6 points at L1 cannot be excluded. (mean of these 2 \
          models: −1.0 [−5.0, +3.0], p = 0.062; at L2; n = 1,237 in 30 scenes)"
        ]
    );
    let said = level_sentences(Darkness, &[(0.1, Better)]);
    assert!(said[0].starts_with("+ At L1 accuracy is 10.0 points higher than at L0. ("));
    let said = level_sentences(Noise, &[(-0.05, Worse), (-0.091, Worse), (0.01, NotShown)]);
    assert!(
        said[0].starts_with("− With noise, accuracy is up to 9.1 points lower than by the exposure drop alone (L2). (")
    );
    assert!(said[0].contains("; shown at L1–L2;"), "{said:?}");
    let said = level_sentences(Noise, &[(-0.05, Worse), (-0.02, NotShown)]);
    assert!(said[0].starts_with("− With noise, accuracy is 5.0 points lower than by the exposure drop alone (L1). ("));
    // Both verdicts are reported.
    let said = level_sentences(Noise, &[(-0.644, Worse), (0.0, NotShown), (0.644, Better)]);
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].starts_with("− With noise, accuracy is 64.4 points lower than"));
    assert!(said[1].starts_with("+ With noise, accuracy is 64.4 points higher than"));
    assert!(said[1].contains("; shown at L3;"), "{said:?}");
    assert!(level_sentences(Noise, &[(-0.5, TooFewClusters)]).is_empty());
    assert!(level_sentences(Darkness, &[(-1.0, TooFewClusters)]).is_empty());
    let said = level_sentences(Noise, &[(0.03, NotShown)]);
    assert!(
        said[0].starts_with("· No difference in accuracy between noise and the exposure drop alone was detected. (")
    );
    let said = level_sentences(
        Enhancer,
        &[(-0.081, Worse), (-0.06, Worse), (-0.05, NotShown), (0.056, Better), (0.05, Better)],
    );
    let starts = [
        "− lift harms at L1–L2, by up to 8.1 points. (mean of these 2 models: −8.1 [−12.1, −4.1], p < 0.001; at L1;",
        "+ lift helps at L4–L5, by up to 5.6 points. (",
        "· lift at L3: accuracy 5.0 points lower, unconfirmed after correction for all tests. (mean of these 2 models: −5.0 [−9.0, −1.0], p = 0.062; largest at L3, not detected \
         after correction (uncorrected p = 0.012); n = 1,237 in 30 scenes)",
    ];
    assert_eq!(said.len(), starts.len());
    for (said, start) in said.iter().zip(starts) {
        assert!(said.starts_with(start), "{said}");
    }
    let said =
        level_sentences(Enhancer, &[(-0.081, Worse), (0.05, Better), (0.0, NotShown), (0.22, Better), (0.2, Better)]);
    assert!(said[0].starts_with("− lift harms at L1, by 8.1 points. ("));
    assert!(said[1].starts_with("+ lift helps at L2, L4–L5, by up to 22.0 points. ("));
    assert!(level_sentences(Blind, &[(0.2, Better), (0.0, NotShown)]).is_empty());
    let said = level_sentences(Blind, &[(0.2, Better), (-0.1, Worse)]);
    assert!(said[0].starts_with("− In the dark the models are less often right than without images at L2. ("));
}

fn level_sentences(kind: PooledKind, levels: &[(f64, Verdict)]) -> Vec<String> {
    let all = findings(kind, levels);
    let all: Vec<&PooledFinding> = all.iter().collect();
    let unit = ClusterUnit::Scene;
    let sentences: Vec<Sentence> = match kind {
        PooledKind::Darkness => darkness::with_variant(&all, None, &[], None, unit).into_iter().collect(),
        PooledKind::Noise => pooled::noise(&all, &[], unit),
        PooledKind::Enhancer => pooled::enhancers(&all, &[], unit),
        PooledKind::Blind => below::pooled(&all, unit).into_iter().collect(),
        PooledKind::EnhancerPair | PooledKind::Hallucination(_) => Vec::new(),
    };
    sentences.iter().map(checked).collect()
}

#[test]
fn undetected_effects_may_be_unconfirmed() {
    let unit = ClusterUnit::Scene;
    let all = findings(PooledKind::Darkness, &[(-0.05, NotShown)]);
    let all: Vec<&PooledFinding> = all.iter().collect();
    let said = checked(&darkness::with_variant(&all, None, &[], None, unit).unwrap());
    assert!(
        said.starts_with(
            "· At L1 accuracy is 5.0 points lower than at L0, unconfirmed after correction for all tests. ("
        ),
        "{said}"
    );
    let all = findings(PooledKind::Noise, &[(0.05, NotShown)]);
    let all: Vec<&PooledFinding> = all.iter().collect();
    let said = checked(&pooled::noise(&all, &[], unit)[0]);
    assert!(
        said.starts_with(
            "· With noise, accuracy is 5.0 points higher than by the exposure drop alone (L1), unconfirmed after"
        ),
        "{said}"
    );
}

#[test]
fn effects_of_strict_parsing_alone_are_named() {
    let mut found = finding(PooledKind::Enhancer, 1, 0.085, Better);
    found.lenient = parsed(PooledKind::Enhancer, 0.05, NotShown);
    let said = checked(&pooled::enhancers(&[&found], &[], ClusterUnit::Scene)[0]);
    assert!(said.starts_with("· lift at L1: accuracy 8.5 points higher, in the strict parsing alone. ("), "{said}");
}

#[test]
fn unconfirmed_fidelity_names_its_direction() {
    let low = fidelity_sentence([0.11, 0.02, 0.47]);
    assert!(
        low.starts_with("· Within a condition, images with a higher PSNR get fewer right answers, unconfirmed after correction for all tests. ("),
        "{low}"
    );
    let none = fidelity_sentence([0.11, 0.02, 0.53]);
    assert!(
        none.starts_with("· Within a condition, PSNR was not detected to tell right from wrong answers. ("),
        "{none}"
    );
}

/// The sentence about an AUC of PSNR with this interval, not detected after the correction.
fn fidelity_sentence([value, low, high]: [f64; 3]) -> String {
    let trials = Vec::new().into_iter().collect();
    let mut findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let estimate = Estimate { value, low, high, n: 702 };
    findings.fidelity = Some(FidelityFindings {
        models: vec!["m".to_owned()],
        conditions: Vec::new(),
        within: [Some(Auc { estimate, p: 0.04 }), None],
        p_report: Some(0.508),
        between: [None, None],
    });
    checked(&super::fidelity(&findings).unwrap())
}

/// Findings about L1–L5 without a verdict, and the mean of L4–L5 with one.
fn detected_by_mean(kind: PooledKind, difference: f64, verdict: Verdict) -> [Vec<PooledFinding>; 2] {
    let levels = findings(kind, &[(difference / 5.0, NotShown); 5]);
    let mean = PooledFinding {
        mean_over: levels[3..].iter().map(|finding| finding.level).collect(),
        ..finding(kind, 5, difference, verdict)
    };
    [levels, vec![mean]]
}

#[test]
fn means_are_reported_without_a_detected_level() {
    let helps = mean_sentences(PooledKind::Enhancer, 0.05, Better);
    assert!(
        helps[0].starts_with("+ lift helps at L4–L5, by 5.0 points on average. (mean of these 2 models: +5.0 [")
            && helps[0].contains("; mean of L4–L5; at L1–L5: +1.0, +1.0, +1.0, +1.0, +1.0; n = "),
        "{helps:?}"
    );
    assert!(helps[1].starts_with("· lift at L1–L3: no effect detected. ("), "{helps:?}");
    let costs = mean_sentences(PooledKind::Darkness, -0.05, Worse);
    assert!(
        costs.len() == 1 && costs[0].starts_with("− Darkness costs 5.0 points on average over L4–L5, from "),
        "{costs:?}"
    );
    let noise = mean_sentences(PooledKind::Noise, -0.05, Worse);
    assert!(
        noise.len() == 1
            && noise[0].starts_with(
                "− With noise, accuracy is 5.0 points lower on average than by the exposure drop alone (L4–L5). ("
            ),
        "{noise:?}"
    );
    // A mean without a verdict changes nothing.
    let none = mean_sentences(PooledKind::Enhancer, 0.05, NotShown);
    assert!(none.len() == 1 && none[0].starts_with("· lift at L1–L5: no effect detected. ("), "{none:?}");
}

fn mean_sentences(kind: PooledKind, difference: f64, verdict: Verdict) -> Vec<String> {
    let [levels, means] = detected_by_mean(kind, difference, verdict);
    let [levels, means] = [&levels, &means].map(|all| all.iter().collect::<Vec<&PooledFinding>>());
    let unit = ClusterUnit::Scene;
    let sentences: Vec<Sentence> = match kind {
        PooledKind::Darkness => darkness::with_variant(&levels, Some(means[0]), &[], None, unit).into_iter().collect(),
        PooledKind::Noise => pooled::noise(&levels, &means, unit),
        _ => pooled::enhancers(&levels, &means, unit),
    };
    sentences.iter().map(checked).collect()
}

#[test]
fn the_observer_confirms_less() {
    // In a report on several runs, the name contains the run.
    let said = enhancer_sentences("observer (a)", &[(-0.088, Worse), (-0.08, Worse)]);
    assert!(said[0].starts_with("− With lift the observer confirms less at L1–L2, by up to 8.8 points. ("), "{said:?}");
    let said = enhancer_sentences("observer", &[(0.03, Better)]);
    assert!(said[0].starts_with("+ With lift the observer confirms more at L1, by 3.0 points. ("), "{said:?}");
}

fn enhancer_sentences(model: &str, levels: &[(f64, Verdict)]) -> Vec<String> {
    let mut all = findings(PooledKind::Enhancer, levels);
    for finding in &mut all {
        finding.models = vec![model.to_owned()];
    }
    let all: Vec<&PooledFinding> = all.iter().collect();
    pooled::enhancers(&all, &[], ClusterUnit::Scene).iter().map(checked).collect()
}

#[test]
fn interval_widths_are_a_range() {
    assert_eq!(
        power_sentence(&[0.0614, 0.139, 0.08]).unwrap(),
        "· With 30 scenes the intervals of the findings reach about 6 to 14 points to each side. (over all families; an effect much \
         smaller than that cannot be shown with so small a sample)"
    );
    assert_eq!(
        power_sentence(&[0.061, 0.064]).unwrap(),
        "· With 30 scenes the intervals of the findings reach about 6 points to each side. (over all families; an effect much smaller \
         than that cannot be shown with so small a sample)"
    );
    assert_eq!(power_sentence(&[0.01, 0.049]), None);
}

fn power_sentence(half_widths: &[f64]) -> Option<String> {
    let mut all = findings(PooledKind::Darkness, &vec![(-0.129, Worse); half_widths.len()]);
    for (finding, half) in all.iter_mut().zip(half_widths) {
        let difference = &mut finding.strict.tested.difference;
        (difference.low, difference.high) = (-0.129 - half, -0.129 + half);
    }
    let sentence = sample::power(&all, ClusterUnit::Scene);
    sentence.as_ref().map(checked)
}

#[test]
fn one_model_and_lost_items_are_named() {
    let mut one = finding(PooledKind::Darkness, 5, -0.3, Worse);
    one.models = vec!["gpt-4o".to_owned()];
    (one.dropped, one.strict.tested.p_by, one.clusters) = (100, Some(SwapMethod::Drawn(100_000)), 1);
    let said = checked(&darkness::with_variant(&[&one], None, &[], None, ClusterUnit::Frame).unwrap());
    assert!(
        said.ends_with(
            "(gpt-4o: −30.0 [−34.0, −26.0], p < 0.001; a loss is shown at L5; n = 1,237 in 1 frame, 100 left out because a model has no \
             reply, p by 100,000 random swaps)"
        ),
        "{said}"
    );
}

#[test]
fn neighbouring_levels_become_a_range() {
    let all = ["L1", "L2", "L3", "L4", "L5"];
    assert_eq!(level_runs(&["L1", "L2", "L4"], &all), "L1–L2, L4");
    assert_eq!(level_runs(&all, &all), "L1–L5");
    assert_eq!(level_runs(&["L5"], &all), "L5");
}

#[test]
fn sentences_never_claim_equality() {
    let source = [
        include_str!("../darkness.rs"),
        include_str!("../pooled.rs"),
        include_str!("../sample.rs"),
        include_str!("../models.rs"),
        include_str!("../mod.rs"),
        include_str!("../hallucination.rs"),
        include_str!("../below_blind.rs"),
    ];
    for text in source {
        for word in ["no difference is", "equal to", "tied", "the same as", "significant"] {
            assert!(!text.contains(&format!("{word} ")), "{word}");
        }
    }
}
