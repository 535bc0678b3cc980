//! Simulated designs, and designs whose numbers are known.

mod models;
mod simulated;
mod study;

use super::*;
use crate::estimate::Estimate;
use simulated::{DESIGNS, FULL, Simulation};

/// A reply to a question that is a scene of its own.
fn reply(question: u32, [wording, order, draw]: [u16; 3], value: f64) -> Observation {
    Observation { question, scene: question, wording, order, draw, repeat: 0, value }
}

/// True if the interval contains a number.
fn holds(estimate: Estimate, truth: f64) -> bool {
    estimate.low <= truth && truth <= estimate.high
}

/// Components with these standard deviations, in the order of [`Source::ALL`].
pub(super) fn known(deviations: [f64; 10]) -> Components {
    let components = Source::ALL.into_iter().zip(deviations);
    let component = |(source, deviation)| Component { source, deviation: Estimate::exact(deviation, 1) };
    Components { components: components.map(component).collect() }
}

#[test]
fn components_are_those_of_the_simulation() {
    const REPORTS: u64 = 80;
    for simulation in [FULL, DESIGNS[3]] {
        for is_difference in [false, true] {
            let truth = simulation.truth(is_difference);
            let mut variances = [0.0; 10];
            for report in 0..REPORTS {
                let ([first, second], _) = simulation.replies(report);
                let components = Components::new(&if is_difference { paired(&first, &second) } else { first });
                for (variance, source) in variances.iter_mut().zip(Source::ALL) {
                    *variance += components.variance(source) / REPORTS as f64;
                }
            }
            for ((source, truth), variance) in Source::ALL.into_iter().zip(truth).zip(variances) {
                // Variances below that are often estimated as 0, which biases their mean.
                if truth > 0.075 {
                    let ratio = variance.sqrt() / truth;
                    assert!((0.8..1.2).contains(&ratio), "{} {is_difference} {source:?}: {ratio}", simulation.name);
                }
            }
        }
    }
}

#[test]
fn no_effect_of_the_wording_is_found_where_there_is_none() {
    const REPORTS: u64 = 60;
    let simulation = &DESIGNS[1];
    let (mut held, mut sum) = (0, 0.0);
    for report in 0..REPORTS {
        let components = Components::new(&simulation.replies(report).0[0]);
        let wording = components.deviation(Source::Facet(Facet::Wording)).unwrap();
        held += u64::from(wording.low == 0.0);
        sum += wording.value;
    }
    assert!(sum / (REPORTS as f64) < 0.01, "{sum}");
    assert!(held * 100 >= 95 * REPORTS, "{held}");
}

#[test]
fn intervals_of_differences_hold_for_other_wordings() {
    const REPORTS: u64 = 60;
    let (mut held, mut all) = (0, 0);
    for simulation in &DESIGNS {
        let truth = simulation.accuracies[0] - simulation.accuracies[1];
        for report in 0..REPORTS {
            let ([first, second], _) = simulation.replies(report);
            let found = FacetedDifference::new(&paired(&first, &second)).unwrap();
            held += usize::from(holds(found.difference, truth));
            all += 1;
        }
    }
    let share = f64::from(held as u32) / f64::from(all);
    assert!((0.93..0.99).contains(&share), "{share}");
}

/// The analysis of variance of questions × wordings (Brennan 2001, section 2.2): σ² of wordings is (MS(w) − MS(qw)) /
/// questions.
#[test]
fn wordings_are_those_of_the_analysis_of_variance() {
    let values = [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]];
    let mut observations = Vec::new();
    for (question, row) in values.iter().enumerate() {
        observations
            .extend((0..3_u16).map(|wording| reply(question as u32, [wording, 0, 0], row[usize::from(wording)])));
    }
    // Means of the wordings 5/6, 3/6, 2/6 and of the questions 1/3, 2/3, 1, 2/3, 2/3, 0; the mean of all is 5/9.
    let between = 6.0 * ((5.0 / 18.0_f64).powi(2) + (1.0 / 18.0_f64).powi(2) + (4.0 / 18.0_f64).powi(2));
    let questions = 3.0
        * ((2.0 / 9.0_f64).powi(2) + 3.0 * (1.0 / 9.0_f64).powi(2) + (4.0 / 9.0_f64).powi(2) + (5.0 / 9.0_f64).powi(2));
    let total = 10.0 * (4.0 / 9.0_f64).powi(2) + 8.0 * (5.0 / 9.0_f64).powi(2);
    let residual = (total - between - questions) / 10.0;
    let expected = ((between / 2.0 - residual) / 6.0).sqrt();
    let components = Components::new(&observations);
    let wording = components.deviation(Source::Facet(Facet::Wording)).unwrap();
    assert!((wording.value - expected).abs() < 1e-12, "{wording:?} {expected}");
    // What the design cannot tell apart is part of the questions and of the rest.
    let found: Vec<Source> = components.components.iter().map(|component| component.source).collect();
    assert_eq!(found, [Source::Question, Source::Facet(Facet::Wording), Source::Rest]);
    let [range] = &facet_ranges(&observations)[..] else { panic!("only the wording varies") };
    assert!((range.range.value - 0.5).abs() < 1e-12 && range.levels[0].1 > 0.27);
}

#[test]
fn order_of_the_observations_does_not_matter() {
    let ([first, second], _) = DESIGNS[3].replies(7);
    let reversed: Vec<Observation> = first.iter().rev().copied().collect();
    assert_eq!(Components::new(&first), Components::new(&reversed));
    assert_eq!(facet_ranges(&first), facet_ranges(&reversed));
    let differences = [&first, &reversed].map(|first| FacetedDifference::new(&paired(first, &second)));
    assert_eq!(differences[0], differences[1]);
}

#[test]
fn a_facet_that_changes_only_with_the_question_has_no_component() {
    let observations: Vec<Observation> =
        (0..24).map(|i| reply(i / 2, [(i / 2 % 3) as u16, (i % 2) as u16, 0], f64::from(i % 5 / 3))).collect();
    let components = Components::new(&observations);
    assert_eq!(components.deviation(Source::Facet(Facet::Wording)), None);
    assert!(components.deviation(Source::Facet(Facet::Order)).is_some());
    assert_eq!(components.deviation(Source::Facet(Facet::Draw)), None);
}

#[test]
fn few_data_have_wide_intervals() {
    // One scene says nothing about others.
    let one: Vec<Observation> = (0..24)
        .map(|i| Observation { scene: 0, ..reply(i / 6, [(i % 3) as u16, (i % 6 / 3) as u16, 0], f64::from(i % 2)) })
        .collect();
    for component in Components::new(&one).components {
        assert_eq!((component.deviation.low, component.deviation.high), (0.0, 0.5), "{component:?}");
    }
    assert!(facet_ranges(&one).iter().all(|range| holds(range.range, 0.0) && holds(range.range, 1.0)));
    // 20 scenes without an error may have one in seven.
    let right: Vec<Observation> =
        (0..120).map(|i| reply(i / 6, [(i % 3) as u16, (i % 6 / 3) as u16, 0], 1.0)).collect();
    for component in Components::new(&right).components {
        let Estimate { value, low, high, .. } = component.deviation;
        assert!(value == 0.0 && low == 0.0 && (high - 0.346).abs() < 0.001, "{component:?}");
    }
    assert_eq!(Components::new(&[]).components, []);
    assert_eq!(facet_ranges(&[]), []);
    assert_eq!(FacetedDifference::new(&[]), None);
}

#[test]
fn signs_are_counted_over_combinations() {
    let side = |gain: [f64; 4]| -> Vec<Observation> {
        (0..4_u16)
            .flat_map(|cell| (0..10).map(move |question| (cell, question)))
            .map(|(cell, question)| {
                reply(
                    question,
                    [cell % 2, cell / 2, 0],
                    f64::from(u8::from(f64::from(question) < gain[usize::from(cell)])),
                )
            })
            .collect()
    };
    let pairs = paired(&side([6.0, 7.0, 4.0, 3.0]), &side([3.0, 4.0, 4.0, 4.0]));
    let found = FacetedDifference::new(&pairs).unwrap();
    assert_eq!(found.signs, SignCount { same: 2, of: 4 });
    assert!((found.difference.value - 0.125).abs() < 1e-12 && found.difference.n == 40);
    // A reply without a partner is left out.
    assert_eq!(paired(&side([6.0; 4])[..15], &side([3.0; 4])[5..]).len(), 10);
}

/// Standard deviation of the mean accuracy over simulated reports.
fn simulated_error(simulation: &Simulation, reports: u64) -> f64 {
    let means: Vec<f64> = (0..reports)
        .map(|report| {
            let ([first, _], _) = simulation.replies(report);
            first.iter().map(|observation| observation.value).sum::<f64>() / first.len() as f64
        })
        .collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    (means.iter().map(|other| (other - mean).powi(2)).sum::<f64>() / (means.len() as f64 - 1.0)).sqrt()
}

#[test]
fn standard_errors_of_designs_are_those_of_simulated_runs() {
    for simulation in [FULL, Simulation { design: Design { is_half: true, ..FULL.design }, ..FULL }] {
        let expected = known(simulation.truth(false)).spread(&simulation.design).error;
        let found = simulated_error(&simulation, 200);
        // The standard error of a standard deviation from 200 reports is 5 %.
        assert!((found / expected - 1.0).abs() < 0.15, "{:?}: {found} {expected}", simulation.design);
    }
}

/// Requests that half of the combinations needs, as a share of those of all, for the same standard error: with more
/// questions of more scenes. `None` if no number of them suffices.
fn requests_of_half(components: &Components, full: Design) -> Option<f64> {
    let target = components.spread(&full).error;
    (full.questions..20 * full.questions).find_map(|questions| {
        let scenes = questions * full.scenes / full.questions;
        let half = Design { questions, scenes, is_half: true, ..full };
        let is_enough = components.spread(&half).error <= target;
        is_enough.then(|| half.requests() as f64 / full.requests() as f64)
    })
}

#[test]
fn half_of_the_combinations_needs_about_half_of_the_requests() {
    let full = Design { scenes: 600, questions: 600, ..FULL.design };
    let needed = |is_difference| requests_of_half(&known(FULL.truth(is_difference)), full).unwrap();
    assert!((0.5..0.55).contains(&needed(false)), "{}", needed(false));
    assert!((0.5..0.6).contains(&needed(true)), "{}", needed(true));
    // If replies differ by chance alone, all requests are needed.
    let chance = known([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4]);
    assert!((requests_of_half(&chance, full).unwrap() - 1.0).abs() < 0.01);
}

#[test]
fn repeats_help_where_they_were_found_to_vary() {
    let components = known([0.0, 0.15, 0.0, 0.0, 0.0, 0.1, 0.1, 0.0, 0.0, 0.35]);
    let found = Design { scenes: 120, questions: 120, wordings: 3, orders: 3, draws: 2, repeats: 1, is_half: true };
    // One repeat does not tell how much others would help.
    let once = Components {
        components: components.components.iter().copied().filter(|c| c.source != Source::Combination).collect(),
    };
    let repeated = Design { repeats: 4, ..found };
    assert!(components.spread(&repeated).error < 0.9 * components.spread(&found).error);
    assert_eq!(once.spread(&repeated), once.spread(&found));
}
