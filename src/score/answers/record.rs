//! Parsing of a reply into the record of its trial, for both experiments: [`Detail`], [`answered`], [`reread`].
//!
//! Manual checks of questions: shares of wrong and ambiguous questions ([`CheckedShare`]), and agreement of two people
//! ([`CheckAgreement`]).

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufRead, ErrorKind, Write};

use crate::choice::llm_match::{Protocol, mark};
use crate::choice::option_probabilities::option_probabilities;
use crate::choice::{LENIENT_VERSION, has_thoughts, readings};
use crate::comparisons::{AgreementCounts, clustered_kappa, kappa};
use crate::estimate::{ClusterCount, Estimate};
use darkqa_base::error::Result;
use darkqa_base::types::records::Record;
use darkqa_base::types::{
    Answer, ChoiceDetail, Choices, Family, Finish, OpenDetail, OptionProbabilities, ParsedAnswer, QuestionId, Reply,
    Step, StoredDetail, TrialOutcome, Trials, UnreadReason,
};

/// Part of a record that stores the answer parsed from a reply.
pub trait Detail: StoredDetail {
    /// Version of the parsing rules, such as `lenient/5`; `None` if no choice is parsed.
    const REPLY_READING: Option<&'static str>;

    /// Parses the answer in a reply and stores it. A stored reply can be parsed again.
    ///
    /// # Errors
    /// If the choices of the detail are not valid.
    fn read(&mut self, reply: &Reply) -> Result<()>;

    /// Index of the choice in the lenient parsing; `None` if no choice was found.
    fn chosen(&self) -> Option<usize>;

    /// Everything that [`read`](Self::read) stores.
    type Reading: PartialEq;

    /// The answer as it is stored.
    fn reading(&self) -> Self::Reading;

    /// Parses the line of a record. Each kind has its own function, so that this crate compiles it, for speed, and not
    /// the caller.
    ///
    /// # Errors
    /// If the line is not a record of this kind.
    fn parse_record(line: &[u8]) -> serde_json::Result<Record<Self>>;

    /// True if trials with these details can be written as bytes.
    const HAS_BYTES: bool = false;

    /// Writes trials as bytes.
    ///
    /// # Errors
    /// If `out` cannot be written, or these details have no bytes.
    fn write_trials(_trials: &Trials<Self>, _out: &mut dyn Write) -> io::Result<()> {
        Err(ErrorKind::Unsupported.into())
    }

    /// Reads what [`write_trials`](Self::write_trials) has written.
    ///
    /// # Errors
    /// If `from` cannot be read or has other bytes, or these details have no bytes.
    fn read_trials(_from: &mut dyn BufRead) -> io::Result<Trials<Self>> {
        Err(ErrorKind::Unsupported.into())
    }
}

impl Detail for ChoiceDetail {
    const REPLY_READING: Option<&'static str> = Some(LENIENT_VERSION);

    /// Stores both parsings of a reply, and the outcome, which follows from the strict parsing.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        let why = self.strict.and_then(|strict| strict.why);
        if why == Some(UnreadReason::CannotTell) && reply.text.is_empty() {
            // A person pressed the button for it, so there is no text to parse again.
            return Ok(());
        }
        let choices = Choices::with_truth(self.choices.clone().into(), self.truth)?;
        let (strict, lenient) = readings(reply, &choices);
        self.outcome = match strict {
            Answer::Unparsed(_) => TrialOutcome::Unparsed,
            Answer::Chosen(index) => match choices.truth() {
                None => TrialOutcome::Answered,
                Some(truth) if truth == index => TrialOutcome::Right,
                Some(_) => TrialOutcome::Wrong,
            },
        };
        self.strict = Some(strict.into());
        self.lenient = Some(lenient.into());
        // A stored reply lacks the observer's findings and the probabilities of the choices, so the stored ones are
        // kept.
        if let Some(chances) = &reply.chances {
            let options = option_probabilities(chances, &self.choices);
            self.options = options.map(|options| OptionProbabilities {
                reasoned: options.reasoned || has_thoughts(&reply.text),
                ..options
            });
        }
        if reply.observed.is_some() {
            self.observed.clone_from(&reply.observed);
        }
        Ok(())
    }

    fn chosen(&self) -> Option<usize> {
        self.lenient?.chosen
    }

    type Reading = (Option<ParsedAnswer>, Option<ParsedAnswer>, TrialOutcome);

    fn reading(&self) -> Self::Reading {
        (self.strict, self.lenient, self.outcome)
    }

    fn parse_record(line: &[u8]) -> serde_json::Result<Record<Self>> {
        serde_json::from_slice(line)
    }

    const HAS_BYTES: bool = true;

    fn write_trials(trials: &Trials<Self>, out: &mut dyn Write) -> io::Result<()> {
        trials.write_to(out)
    }

    fn read_trials(from: &mut dyn BufRead) -> io::Result<Trials<Self>> {
        Trials::read_from(from)
    }
}

impl Detail for OpenDetail {
    const REPLY_READING: Option<&'static str> = None;

    /// Stores the marks that the two protocols parse from a judge's reply.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        if self.step == Step::Mark {
            self.upstream = mark(&reply.text, Protocol::Upstream);
            self.tolerant = mark(&reply.text, Protocol::Tolerant);
        }
        Ok(())
    }

    fn chosen(&self) -> Option<usize> {
        None
    }

    type Reading = (Option<i64>, Option<i64>);

    fn reading(&self) -> Self::Reading {
        (self.upstream, self.tolerant)
    }

    fn parse_record(line: &[u8]) -> serde_json::Result<Record<Self>> {
        serde_json::from_slice(line)
    }
}

/// Returns the record with a reply and the answer parsed from it.
///
/// # Errors
/// If the choices of the record are not valid.
pub fn answered<D: Detail>(mut record: Record<D>, reply: Reply) -> Result<Record<D>> {
    read(&mut record, &reply)?;
    record.reply = Some(reply.text);
    record.refusal = reply.refusal;
    record.finish = Some(reply.finish);
    record.usage = reply.usage;
    record.served_model = reply.served_model;
    record.provider = reply.provider;
    record.endpoint = reply.endpoint;
    record.latency_ms = Some(reply.latency_ms);
    record.attempts = reply.attempts;
    record.lost = reply.lost;
    Ok(record)
}

/// Returns the record with its stored reply parsed again, by the rules of this version of the program.
///
/// # Errors
/// As for [`answered`].
pub fn reread<D: Detail>(mut record: Record<D>) -> Result<Record<D>> {
    if let Some(text) = record.reply.clone() {
        let reply = Reply {
            refusal: record.refusal.clone(),
            finish: record.finish.clone().unwrap_or(Finish::Unknown),
            ..Reply::local(text)
        };
        read(&mut record, &reply)?;
    }
    Ok(record)
}

fn read<D: Detail>(record: &mut Record<D>, reply: &Reply) -> Result<()> {
    let question = &record.question.0;
    record.detail.read(reply).map_err(|e| e.at(format!("the record of question {question:?}")))
}

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
