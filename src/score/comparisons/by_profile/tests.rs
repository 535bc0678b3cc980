//! Tests of claims under several noise profiles, from made records.

use super::*;
use crate::tests::{records, with_grid};
use darkqa_base::types::Record;

fn find<'f>(found: &'f [FindingByProfile], claim: &NoiseHypothesis) -> &'f FindingByProfile {
    found.iter().find(|finding| finding.claim == *claim).unwrap()
}

fn standings(finding: &FindingByProfile) -> Vec<Option<ClaimVerdict>> {
    finding.effects.iter().map(|one| one.effect.map(|_| one.verdict)).collect()
}

/// Replies that are right by exposure drop and at L0, and follow the two functions with noise.
fn ladder(paper: fn(usize) -> Option<bool>, physical: fn(usize) -> Option<bool>) -> Vec<Record> {
    let mut all = records("m", "L0", |_| Some(true));
    for level in 1..=5 {
        all.extend(records("m", &format!("L{level}-ev"), |_| Some(true)));
        all.extend(records("m", &format!("L{level}-noise"), paper));
        all.extend(records("m", &format!("L{level}-noise@physical"), physical));
    }
    all
}

#[test]
fn a_claim_holds_where_its_interval_is_on_its_side() {
    let records = ladder(|item| Some(item % 4 == 0), |_| Some(true));
    with_grid(&records, |grid| {
        let found = by_profile(grid);
        let noise = find(&found, &NoiseHypothesis::NoiseCompounds(None));
        assert_eq!(noise.levels.len(), 5);
        assert_eq!(standings(noise), [Some(ClaimVerdict::Holds), Some(ClaimVerdict::Open)]);
        assert_eq!(noise.robustness, Robustness::Some);
        let effect = noise.effects[0].effect.unwrap();
        assert!((effect.difference.value - 0.75).abs() < 1e-12);
        // The same items in every column, each once, however many levels it has.
        let numbers = noise.effects.iter().map(|one| one.effect.unwrap().difference.n);
        assert_eq!(numbers.collect::<Vec<_>>(), [24, 24]);
        // Seven claims under two profiles: the smallest p counts 14 times.
        let smallest = found
            .iter()
            .flat_map(|finding| &finding.effects)
            .filter_map(|one| one.effect)
            .map(|one| one.p)
            .fold(1.0, f64::min);
        assert!(effect.holm >= 14.0 * smallest, "{effect:?}");
        let costs = find(&found, &NoiseHypothesis::DarknessCosts);
        assert_eq!(standings(costs), [Some(ClaimVerdict::Holds), Some(ClaimVerdict::Open)]);
        assert!(costs.effects[0].effect.unwrap().difference.value < 0.0);
        // Nothing was enhanced or asked without images.
        assert!(found.iter().all(|finding| finding.claim.enhancer().is_none()));
        assert!(found.iter().all(|finding| finding.claim.family().is_none()));
    });
}

#[test]
fn the_same_everywhere_is_open_and_the_opposite_is_reversed() {
    let same = ladder(|_| Some(true), |_| Some(true));
    with_grid(&same, |grid| {
        let found = by_profile(grid);
        assert!(found.iter().all(|finding| finding.robustness == Robustness::Open));
    });
    // Accuracy is lower with the exposure drop alone than with noise under either profile.
    let mut opposite = ladder(|_| Some(true), |_| Some(true));
    for level in 1..=5 {
        opposite.extend(records("m", &format!("L{level}-ev"), |_| Some(false)));
    }
    with_grid(&opposite, |grid| {
        let found = by_profile(grid);
        let noise = find(&found, &NoiseHypothesis::NoiseCompounds(None));
        assert_eq!(standings(noise), [Some(ClaimVerdict::Opposite); 2]);
        assert_eq!(noise.robustness, Robustness::None);
    });
}

#[test]
fn items_without_a_reply_leave_every_column_and_unasked_levels_are_named() {
    let mut records_ = ladder(|item| (item != 3).then_some(false), |item| (item != 7).then_some(false));
    records_
        .retain(|record| record.condition.as_ref().map(ToString::to_string).as_deref() != Some("L2-noise@physical"));
    with_grid(&records_, |grid| {
        let found = by_profile(grid);
        let noise = find(&found, &NoiseHypothesis::NoiseCompounds(None));
        let levels: Vec<String> = noise.levels.iter().map(ToString::to_string).collect();
        assert_eq!(levels, ["L1", "L3", "L4", "L5"]);
        assert_eq!((noise.dropped, noise.robustness), (2, Robustness::All));
        let numbers = noise.effects.iter().map(|one| one.effect.unwrap().difference.n);
        assert_eq!(numbers.collect::<Vec<_>>(), [22, 22]);
        let second = grid.subjects.iter().find(|subject| subject.level.is_some_and(|level| level.to_string() == "L2"));
        let claim = NoiseHypothesis::NoiseCompounds(second.and_then(|subject| subject.level));
        let of_second = find(&found, &claim);
        assert_eq!(standings(of_second), [Some(ClaimVerdict::Holds), None]);
        // A claim that was not asked under one profile does not hold under all.
        assert_eq!(of_second.robustness, Robustness::Some);
    });
}

#[test]
fn enhancers_and_families_have_claims_of_their_own() {
    let mut all = ladder(|item| Some(item % 2 == 0), |_| Some(true));
    for level in 1..=5 {
        for profile in ["", "@physical"] {
            let condition = format!("L{level}-noise{profile}+lift");
            let answers: fn(usize) -> Option<bool> = if level < 4 { |_| Some(false) } else { |_| Some(true) };
            all.extend(records("m", &condition, answers));
        }
    }
    all.extend(records("other", "", |_| Some(true)));
    with_grid(&all, |grid| {
        let found = by_profile(grid);
        let name = EnhancerName::new("lift").unwrap();
        let harms = find(&found, &NoiseHypothesis::EnhancerHarms(name.clone()));
        assert_eq!((harms.levels.len(), harms.robustness), (3, Robustness::All));
        let helps = find(&found, &NoiseHypothesis::EnhancerHelps(name));
        assert_eq!(standings(helps), [Some(ClaimVerdict::Holds), Some(ClaimVerdict::Open)]);
        // Items of one family are all even, those of the other all odd.
        let level = *harms.levels.last().unwrap();
        let darkest = helps.levels[1];
        assert!(level < darkest);
        let below = find(&found, &NoiseHypothesis::BelowBlind(Family::RoomType, darkest));
        assert_eq!(below.blind.as_deref(), Some("other"));
        assert_eq!(standings(below), [Some(ClaimVerdict::Holds), Some(ClaimVerdict::Open)]);
        assert_eq!(below.effects[0].effect.unwrap().difference.n, 12);
    });
}

#[test]
fn one_profile_has_no_table() {
    let mut all = ladder(|_| Some(false), |_| Some(true));
    all.retain(|record| {
        let condition = record.condition.as_ref().map(ToString::to_string);
        condition.is_none_or(|condition| !condition.contains('@'))
    });
    with_grid(&all, |grid| assert!(by_profile(grid).is_empty()));
}
