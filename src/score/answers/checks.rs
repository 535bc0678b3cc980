//! Manual checks of questions: shares of wrong and ambiguous questions ([`CheckedShare`]), and agreement of two people
//! ([`CheckAgreement`]).

use std::collections::{BTreeMap, BTreeSet};

use crate::comparisons::{AgreementCounts, clustered_kappa, kappa};
use crate::estimate::{ClusterCount, Estimate};
use darkqa_base::types::{Family, QuestionId};

/// Result of a person's check of a question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CheckFinding {
    /// The person gave the answer of the rule.
    Right,
    /// The person gave another answer.
    Wrong,
    /// For the person, none or several of the choices fit.
    Ambiguous,
}

/// One question checked by one person, who had not seen the answer of the rule.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    pub person: String,
    pub family: Family,
    /// Scene of the question's frame: the cluster of the intervals.
    pub scene: String,
    pub finding: CheckFinding,
}

/// Checks of all people, by person and question.
pub type Checks = BTreeMap<(String, QuestionId), Check>;

/// Shares of wrong and ambiguous questions of a family, according to one person.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedShare {
    pub person: String,
    /// `None` for all families.
    pub family: Option<Family>,
    pub wrong: Estimate,
    pub ambiguous: Estimate,
}

/// Agreement of two people on the questions that both checked.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckAgreement {
    pub people: [String; 2],
    /// Share of questions with the same result of both people.
    pub same: Estimate,
    /// Cohen's κ of finding a question right (Cohen 1960, Educ. Psychol. Meas. 20:37); `None` if one person found all
    /// questions right, or none.
    pub kappa: Option<f64>,
    /// Lower and upper bound of the 95 % interval of κ; `None` if the results vary in too few scenes.
    pub interval: Option<[f64; 2]>,
}

/// Computes the shares of each person, for each family and for all families together.
pub fn shares(checks: &Checks) -> Vec<CheckedShare> {
    let people: BTreeSet<&String> = checks.keys().map(|(person, _)| person).collect();
    let families: BTreeSet<&Family> = checks.values().map(|check| &check.family).collect();
    let mut shares = Vec::new();
    for person in people {
        for family in families.iter().copied().map(Some).chain([None]) {
            let own: Vec<&Check> = checks
                .values()
                .filter(|check| check.person == *person)
                .filter(|check| family.is_none_or(|family| check.family == *family))
                .collect();
            let [wrong, ambiguous] = [CheckFinding::Wrong, CheckFinding::Ambiguous]
                .map(|finding| share(&own, |check| check.finding == finding));
            if let (Some(wrong), Some(ambiguous)) = (wrong, ambiguous) {
                shares.push(CheckedShare { person: person.clone(), family: family.cloned(), wrong, ambiguous });
            }
        }
    }
    shares
}

/// Share of checks for which `counts` is true, with its interval by scene.
fn share(checks: &[&Check], counts: impl Fn(&Check) -> bool) -> Option<Estimate> {
    let mut scenes: BTreeMap<&str, ClusterCount> = BTreeMap::new();
    for check in checks {
        let count = scenes.entry(&check.scene).or_default();
        count.replies += 1;
        count.right += u32::from(counts(check));
    }
    Estimate::clustered(&scenes.into_values().collect::<Vec<_>>())
}

/// Computes the agreement of each two people who checked the same questions.
pub fn agreements(checks: &Checks) -> Vec<CheckAgreement> {
    let people: BTreeSet<&String> = checks.keys().map(|(person, _)| person).collect();
    let people: Vec<&String> = people.into_iter().collect();
    people
        .iter()
        .enumerate()
        .flat_map(|(i, first)| people[i + 1..].iter().map(|second| [*first, *second]))
        .filter_map(|pair| agreement(checks, pair))
        .collect()
}

fn agreement(checks: &Checks, [first, second]: [&String; 2]) -> Option<CheckAgreement> {
    let mut scenes: BTreeMap<&str, (ClusterCount, AgreementCounts)> = BTreeMap::new();
    for ((person, question), one) in checks {
        let other = checks.get(&(second.clone(), question.clone()));
        let Some(other) = other.filter(|_| person == first) else {
            continue;
        };
        let (same, counts) = scenes.entry(&one.scene).or_default();
        same.replies += 1;
        same.right += u32::from(one.finding == other.finding);
        let is_right = [one, other].map(|check| check.finding == CheckFinding::Right);
        counts.add_item(is_right);
    }
    let (same, counts): (Vec<ClusterCount>, Vec<AgreementCounts>) = scenes.into_values().unzip();
    let total = AgreementCounts::total(&counts);
    Some(CheckAgreement {
        people: [first.clone(), second.clone()],
        same: Estimate::clustered(&same)?,
        kappa: kappa(total.both / total.all, total.first / total.all, total.second / total.all),
        interval: clustered_kappa(&counts).map(|kappa| [kappa.low, kappa.high]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fifty questions: both find 20 right and 15 wrong, the second 10 more right, the first 5 more.
    fn checks(people: [&str; 2]) -> Checks {
        use CheckFinding::{Ambiguous, Right, Wrong};
        (0..50)
            .flat_map(|i| {
                let findings = match i {
                    0..20 => [Right, Right],
                    20..35 => [Wrong, Wrong],
                    35..45 => [Ambiguous, Right],
                    _ => [Right, Wrong],
                };
                people.into_iter().zip(findings).map(move |(person, finding)| {
                    let check = Check {
                        person: person.to_owned(),
                        family: if i % 2 == 0 { Family::Color } else { Family::Presence },
                        scene: format!("{i}"),
                        finding,
                    };
                    ((person.to_owned(), QuestionId(format!("{i}"))), check)
                })
            })
            .collect()
    }

    #[test]
    fn two_people_agree_beyond_chance() {
        // The example of the English Wikipedia's article on Cohen's κ: 0.4 (here with 25 and 30 of 50 found right).
        let found = agreements(&checks(["anna", "ben"]));
        assert_eq!(found.len(), 1);
        assert!((found[0].kappa.unwrap() - 0.4).abs() < 1e-12, "{found:?}");
        assert!((found[0].same.value - 0.7).abs() < 1e-12);
        let [low, high] = found[0].interval.unwrap();
        assert!(0.0 < low && low < 0.4 && 0.4 < high && high < 1.0, "{low} {high}");
        // One person alone has nobody to agree with.
        let mut alone = checks(["anna", "ben"]);
        alone.retain(|(person, _), _| person == "anna");
        assert_eq!(agreements(&alone), []);
    }

    #[test]
    fn shares_are_those_of_each_person_and_family() {
        let found = shares(&checks(["anna", "ben"]));
        assert_eq!(found.len(), 6);
        let anna = found.iter().find(|share| share.family.is_none()).unwrap();
        assert_eq!((&*anna.person, anna.wrong.n), ("anna", 50));
        assert!((anna.wrong.value - 0.3).abs() < 1e-12 && (anna.ambiguous.value - 0.2).abs() < 1e-12);
        assert!(anna.wrong.low < 0.3 && 0.3 < anna.wrong.high);
    }

    #[test]
    fn without_any_fault_there_is_no_kappa() {
        let mut faultless = checks(["anna", "ben"]);
        for check in faultless.values_mut() {
            check.finding = CheckFinding::Right;
        }
        assert_eq!(agreements(&faultless)[0].kappa, None);
    }
}
