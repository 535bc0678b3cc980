//! The scores of open answers: [`OpenSummary`], from the marks of a judge.
//!
//! A score is 100 · mean((clip(mark, 1, 5) − 1) / 4) (Majumdar et al. 2024, CVPR, section 4.2). Questions about one walk share
//! its frames, so that walks are the clusters; of one walk alone the questions are.

use std::collections::{BTreeMap, BTreeSet};

use super::estimate::Estimate;
use super::llm_match::points;
use super::paired::difference;
use super::subject::Subject;
use crate::types::{AxisLevel, View};

/// How many independent right-or-wrong replies a mark may count for: one on a scale of five steps varies less than such a reply
/// of the same mean, at least where it is not all or nothing.
const MOST: f64 = 4.0;

/// What came of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It was not given yet, or it failed: not scored.
    Missing,
    /// It was given and not judged yet: not scored.
    Unjudged,
    /// The judge's reply has no mark in it: not scored.
    Unmarked,
    /// There is none: worth nothing, unjudged.
    Null,
    /// The judge's mark.
    Marked(i64),
}

impl Outcome {
    /// What it is worth, between 0 and 1; `None` where it is not scored.
    #[must_use]
    pub fn points(self) -> Option<f64> {
        match self {
            Self::Missing | Self::Unjudged | Self::Unmarked => None,
            Self::Null => Some(points(None)),
            Self::Marked(mark) => Some(points(Some(mark))),
        }
    }
}

/// One answer to one question.
#[derive(Debug, Clone, PartialEq)]
pub struct Scored {
    /// Whose it is.
    pub subject: Subject,
    /// The question's place among those asked.
    pub question: usize,
    /// What came of it.
    pub outcome: Outcome,
    /// Whether the protocol has cut it before it was judged.
    pub cut: bool,
}

/// What a question belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Its walk.
    pub episode: String,
    /// Its category.
    pub category: String,
    /// Its split.
    pub split: String,
}

/// Questions that are scored together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// All.
    All,
    /// Those of a split.
    Split(String),
    /// Those of a category.
    Category(String),
}

impl Group {
    /// Whether a question belongs to it.
    fn has(&self, topic: &Topic) -> bool {
        match self {
            Self::All => true,
            Self::Split(split) => *split == topic.split,
            Self::Category(category) => *category == topic.category,
        }
    }

    /// The name in files and tables.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::All => "all",
            Self::Split(name) | Self::Category(name) => name,
        }
    }

    /// What it groups by.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Split(_) => "split",
            Self::Category(_) => "category",
        }
    }
}

/// The score of a subject on a group of questions, and what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenCell {
    /// Whose.
    pub subject: Subject,
    /// On what.
    pub group: Group,
    /// How many answers are due.
    pub due: usize,
    /// Those not given, or failed.
    pub missing: usize,
    /// Those not judged yet.
    pub unjudged: usize,
    /// Those whose judge gave no mark.
    pub unmarked: usize,
    /// Those that are none.
    pub null: usize,
    /// Those that the protocol has cut.
    pub cut: usize,
    /// The mean, between 0 and 1; `None` where nothing is scored. Its `n` counts answers.
    pub score: Option<Estimate>,
}

impl OpenCell {
    /// How many answers are scored.
    #[must_use]
    pub fn scored(&self) -> usize {
        self.score.map_or(0, |score| score.n)
    }
}

/// What a score is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Against {
    /// The same model on the lit frames.
    Lit,
    /// The same model at the same level without an enhancer.
    Raw,
}

/// A subject's score less that of another, on the questions that both were scored on.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Whose.
    pub subject: Subject,
    /// Against what.
    pub against: Against,
    /// On what.
    pub group: Group,
    /// The difference of the unrounded means; its `n` counts questions.
    pub difference: Estimate,
}

/// Every score of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenSummary {
    /// What the clusters are: `episode`, or `question` of one episode alone.
    pub unit: &'static str,
    /// How many there are.
    pub clusters: usize,
    /// Scores by subject, and by group within.
    pub cells: Vec<OpenCell>,
    /// Differences, likewise.
    pub changes: Vec<Change>,
}

impl OpenSummary {
    /// The cell of a subject on a group.
    #[must_use]
    pub fn cell(&self, subject: &Subject, group: &Group) -> Option<&OpenCell> {
        let mut cells = self.cells.iter();
        cells.find(|cell| cell.subject == *subject && cell.group == *group)
    }

    /// How a subject does against another on a group.
    #[must_use]
    pub fn change(&self, subject: &Subject, against: Against, group: &Group) -> Option<&Change> {
        self.changes.iter().find(|change| {
            change.subject == *subject && change.against == against && change.group == *group
        })
    }

    /// All groups in their order.
    #[must_use]
    pub fn groups(&self) -> BTreeSet<&Group> {
        self.cells.iter().map(|cell| &cell.group).collect()
    }
}

/// Scores answers; `topics` holds what each question belongs to.
#[must_use]
pub fn open_summary(answers: &[Scored], topics: &[Topic]) -> OpenSummary {
    let episodes: BTreeMap<&str, usize> = topics
        .iter()
        .map(|topic| &*topic.episode)
        .collect::<BTreeSet<_>>()
        .into_iter()
        .zip(0..)
        .collect();
    let walks = episodes.len() > 1;
    let cluster = |question: usize| {
        if walks {
            episodes[&*topics[question].episode]
        } else {
            question
        }
    };
    let mut by_subject = BTreeMap::<&Subject, Vec<&Scored>>::new();
    for answer in answers {
        by_subject.entry(&answer.subject).or_default().push(answer);
    }
    let groups = groups(topics);
    let (mut cells, mut changes) = (Vec::new(), Vec::new());
    for (subject, answers) in &by_subject {
        for group in &groups {
            let of = |answer: &&&Scored| group.has(&topics[answer.question]);
            let here: Vec<&Scored> = answers.iter().filter(of).copied().collect();
            cells.push(cell(subject, group, &here, cluster));
        }
        for (against, other) in others(subject) {
            let Some(theirs) = by_subject.get(&other) else {
                continue;
            };
            for group in &groups {
                let is_of = |question: usize| group.has(&topics[question]);
                let difference = change(answers, theirs, is_of, cluster);
                changes.extend(difference.map(|difference| Change {
                    subject: (*subject).clone(),
                    against,
                    group: group.clone(),
                    difference,
                }));
            }
        }
    }
    OpenSummary {
        unit: if walks { "episode" } else { "question" },
        clusters: if walks { episodes.len() } else { topics.len() },
        cells,
        changes,
    }
}

/// All questions; the splits and the categories where there are several.
fn groups(topics: &[Topic]) -> Vec<Group> {
    let splits: BTreeSet<&String> = topics.iter().map(|topic| &topic.split).collect();
    let categories: BTreeSet<&String> = topics.iter().map(|topic| &topic.category).collect();
    let several = |names: BTreeSet<&String>, make: fn(String) -> Group| {
        let several = names.len() > 1;
        let names = names.into_iter().filter(move |_| several);
        names.cloned().map(make).collect::<Vec<_>>()
    };
    std::iter::once(Group::All)
        .chain(several(splits, Group::Split))
        .chain(several(categories, Group::Category))
        .collect()
}

/// Whom a subject is held against.
fn others(subject: &Subject) -> Vec<(Against, Subject)> {
    let Some(level) = subject.level.filter(|_| subject.view == Some(View::Image)) else {
        return Vec::new();
    };
    let seeing =
        |level, enhancer| Subject::seeing(&subject.model, level, &subject.variant, enhancer);
    let lit = (level != AxisLevel::L0).then(|| (Against::Lit, seeing(AxisLevel::L0, None)));
    let raw = subject
        .enhancer
        .is_some()
        .then(|| (Against::Raw, seeing(level, None)));
    lit.into_iter().chain(raw).collect()
}

fn cell(
    subject: &Subject,
    group: &Group,
    answers: &[&Scored],
    cluster: impl Fn(usize) -> usize,
) -> OpenCell {
    let count = |outcome| {
        let alike = answers.iter().filter(|answer| answer.outcome == outcome);
        alike.count()
    };
    let mut sums = BTreeMap::<usize, (f64, f64)>::new();
    for answer in answers {
        if let Some(points) = answer.outcome.points() {
            let (sum, n) = sums.entry(cluster(answer.question)).or_default();
            (*sum, *n) = (*sum + points, *n + 1.0);
        }
    }
    let sums: Vec<(f64, f64)> = sums.into_values().collect();
    let n = sums.iter().map(|(_, n)| n).sum::<f64>() as usize;
    OpenCell {
        subject: subject.clone(),
        group: group.clone(),
        due: answers.len(),
        missing: count(Outcome::Missing),
        unjudged: count(Outcome::Unjudged),
        unmarked: count(Outcome::Unmarked),
        null: count(Outcome::Null),
        cut: answers.iter().filter(|answer| answer.cut).count(),
        score: Estimate::scored(&sums, MOST, n),
    }
}

/// The first's mean less the second's on the questions that both were scored on; several people's answers to one question count as
/// their mean.
fn change(
    first: &[&Scored],
    second: &[&Scored],
    is_of: impl Fn(usize) -> bool,
    cluster: impl Fn(usize) -> usize,
) -> Option<Estimate> {
    let means = |answers: &[&Scored]| {
        let mut means = BTreeMap::<usize, (f64, f64)>::new();
        for answer in answers.iter().filter(|answer| is_of(answer.question)) {
            if let Some(points) = answer.outcome.points() {
                let (sum, n) = means.entry(answer.question).or_default();
                (*sum, *n) = (*sum + points, *n + 1.0);
            }
        }
        means
    };
    let (first, second) = (means(first), means(second));
    let mut sums = BTreeMap::<usize, (f64, f64)>::new();
    let mut n = 0;
    for (question, (sum, count)) in &first {
        let Some((other, others)) = second.get(question) else {
            continue;
        };
        let (net, pairs) = sums.entry(cluster(*question)).or_default();
        (*net, *pairs) = (*net + sum / count - other / others, *pairs + 1.0);
        n += 1;
    }
    let sums: Vec<(f64, f64)> = sums.into_values().collect();
    (n > 0).then(|| difference(&sums, n))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(episode: usize, category: &str) -> Topic {
        Topic {
            episode: format!("hm3d-v0/{episode:03}"),
            category: category.into(),
            split: "hm3d-v0".into(),
        }
    }

    fn scored(level: &str, question: usize, outcome: Outcome) -> Scored {
        Scored {
            subject: Subject::shown("m", Some(&level.parse().unwrap())),
            question,
            outcome,
            cut: false,
        }
    }

    #[test]
    fn marks_become_upstreams_score() {
        use Outcome::{Marked, Missing, Null, Unmarked};
        let topics: Vec<Topic> = (0..7).map(|i| topic(0, ["a", "b"][i % 2])).collect();
        let outcomes = [
            Marked(5),
            Marked(5),
            Marked(3),
            Marked(1),
            Null,
            Missing,
            Unmarked,
        ];
        let answers = outcomes.into_iter().enumerate();
        let answers: Vec<Scored> = answers
            .map(|(i, outcome)| scored("L0", i, outcome))
            .collect();
        let summary = open_summary(&answers, &topics);
        let all = summary.cell(&answers[0].subject, &Group::All).unwrap();
        let score = all.score.unwrap();
        assert!((score.value - 0.5).abs() < 1e-12 && score.n == 5);
        assert!(score.low < 0.5 && score.high > 0.5);
        assert_eq!((all.due, all.null, all.missing, all.unmarked), (7, 1, 1, 1));
        assert_eq!((summary.unit, summary.clusters), ("question", 7));
        let names: Vec<&str> = summary.groups().iter().map(|group| group.name()).collect();
        assert_eq!(names, ["all", "a", "b"]);
    }

    #[test]
    fn drops_are_of_unrounded_means_on_shared_questions() {
        use Outcome::{Marked, Missing};
        let topics: Vec<Topic> = (0..6).map(|i| topic(i / 2, "a")).collect();
        let marks = |level: &str, marks: [i64; 6]| -> Vec<Scored> {
            let outcome = |mark| if mark == 0 { Missing } else { Marked(mark) };
            let marks = marks.into_iter().enumerate();
            marks
                .map(|(i, mark)| scored(level, i, outcome(mark)))
                .collect()
        };
        let answers = [
            marks("L0", [5, 4, 5, 4, 0, 5]),
            marks("L2-noise", [4, 4, 3, 1, 1, 5]),
            marks("L2-noise+ruas", [5, 4, 5, 1, 1, 5]),
        ]
        .concat();
        let summary = open_summary(&answers, &topics);
        let dark = Subject::shown("m", Some(&"L2-noise".parse().unwrap()));
        let drop = summary.change(&dark, Against::Lit, &Group::All).unwrap();
        // (0.25 + 0 + 0.5 + 0.75 + 0) / 5, the fifth question being unanswered at L0.
        assert!((drop.difference.value + 0.3).abs() < 1e-12 && drop.difference.n == 5);
        assert!(drop.difference.low < -0.3 && drop.difference.high > -0.3);
        let mended = Subject::shown("m", Some(&"L2-noise+ruas".parse().unwrap()));
        let gain = summary.change(&mended, Against::Raw, &Group::All).unwrap();
        assert!((gain.difference.value - 0.125).abs() < 1e-12);
        assert!(summary.change(&mended, Against::Lit, &Group::All).is_some());
        assert_eq!(summary.changes.len(), 3);
        assert_eq!((summary.unit, summary.clusters), ("episode", 3));
    }
}
