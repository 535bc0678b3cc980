//! The findings of a report by group: [`FindingGroups`]. The page, the terminal and Markdown open with the same summary and the same
//! finding of each group, and list all findings in the same groups.

use std::fmt::{self, Write as _};

use crate::sentences::{Sentence, capitalised};
use crate::text::words::{percent, points};

/// A group of findings, by the kinds of its sentences.
struct GroupKinds {
    title: &'static str,
    /// Kinds that may stand for the group, the most important first.
    leading: &'static [&'static str],
    /// Kinds that are only in the list of all findings.
    further: &'static [&'static str],
}

/// The groups in their order. A sentence of another kind is in the last group.
const GROUPS: [GroupKinds; 7] = [
    GroupKinds {
        title: "Baseline",
        leading: &["baseline"],
        further: &[],
    },
    GroupKinds {
        title: "Darkness",
        leading: &["darkness", "real darkness", "agreement_in_the_dark"],
        further: &["real against synthetic", "families", "best", "apart"],
    },
    GroupKinds {
        title: "Noise",
        leading: &["noise"],
        further: &["readings"],
    },
    GroupKinds {
        title: "Enhancers",
        leading: &["enhancer", "real enhanced", "agreement_enhanced"],
        further: &["fidelity"],
    },
    GroupKinds {
        title: "Without images",
        leading: &["below blind", "images"],
        further: &[],
    },
    GroupKinds {
        title: "Failures",
        leading: &[
            "no_answer_in_the_light",
            "collapse",
            "hallucination",
            "confidence",
            "cannot_tell",
            "format",
            "unread",
        ],
        further: &[],
    },
    GroupKinds {
        title: "Sample",
        leading: &[
            "no verdict",
            "left out",
            "bank_cannot_tell",
            "models_in_light",
            "power",
        ],
        further: &[],
    },
];

/// Most findings that a report opens with, and most enhancers that the summary names; chosen for one screen.
const MAX_FIRST: usize = 5;
const MAX_ENHANCERS: usize = 3;
/// Most sentences of one finding that a report opens with; chosen.
const MAX_CLAUSES: usize = 3;

/// The findings of a report in groups, without empty groups.
pub(super) struct FindingGroups<'a>(Vec<FindingGroup<'a>>);

/// The findings of one group, the most important kind first.
pub(super) struct FindingGroup<'a> {
    pub(super) title: &'static str,
    findings: Vec<Finding<'a>>,
    /// Place of the finding that stands for the group; `None` if no kind of the group's findings may.
    first: Option<usize>,
}

/// The sentences about one thing: an enhancer, or one effect under several noise profiles.
pub(super) struct Finding<'a> {
    sentences: Vec<&'a Sentence>,
}

/// The effect of a finding in one light.
pub(super) struct FindingInterval {
    /// The effect with its interval, in words.
    pub(super) effect: String,
    /// The light, if it is not that of the finding's text.
    pub(super) light: Option<String>,
    /// The level, or the levels.
    pub(super) at: Option<String>,
}

/// A difference in points, or a share in percent, with the ends of its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Effect {
    Difference([f64; 3]),
    Share([f64; 3]),
}

impl<'a> FindingGroups<'a> {
    /// The groups of these sentences.
    pub(super) fn new(sentences: &'a [Sentence]) -> Self {
        let mut groups: Vec<FindingGroup<'a>> = GROUPS
            .iter()
            .map(|kinds| FindingGroup::new(kinds, sentences))
            .collect();
        groups.retain(|group| !group.findings.is_empty());
        Self(groups)
    }

    /// All groups.
    pub(super) fn all(&self) -> &[FindingGroup<'a>] {
        &self.0
    }

    /// The number of findings.
    pub(super) fn count(&self) -> usize {
        self.0.iter().map(|group| group.findings.len()).sum()
    }

    /// The findings that a report opens with, each with the title of its group.
    pub(super) fn first(&self) -> Vec<(&'static str, &Finding<'a>)> {
        self.0
            .iter()
            .filter_map(|group| Some((group.title, &group.findings[group.first?])))
            .take(MAX_FIRST)
            .collect()
    }

    /// The report in one sentence: what darkness does, and what each enhancer was detected to do; without either, the first finding.
    /// Empty without findings.
    pub(super) fn summary(&self) -> String {
        let group = |title: &str| self.0.iter().find(|group| group.title == title);
        let darkness = group("Darkness").and_then(|group| Some(&group.findings[group.first?]));
        let clauses: Vec<String> = darkness
            .map(Finding::text)
            .into_iter()
            .chain(group("Enhancers").map(FindingGroup::enhancers))
            .filter(|clause| !clause.is_empty())
            .collect();
        match (&clauses[..], self.first().first()) {
            ([], Some((_, first))) => self.sentence(&[first.text()]),
            ([], None) => String::new(),
            _ => self.sentence(&clauses),
        }
    }

    /// One sentence of some clauses; the light of the first one is named once, at its beginning.
    fn sentence(&self, clauses: &[String]) -> String {
        let findings = self.0.iter().flat_map(|group| &group.findings);
        let prefix = findings
            .filter_map(|finding| finding.shown().scope.light.as_ref())
            .map(|light| format!("{light}: "))
            .find(|prefix| clauses[0].starts_with(prefix))
            .unwrap_or_default();
        let bare = clauses
            .iter()
            .map(|clause| clause.strip_prefix(&prefix).unwrap_or(clause));
        capitalised(&prefix) + &bare.collect::<Vec<_>>().join("; ") + "."
    }
}

impl<'a> FindingGroup<'a> {
    fn new(kinds: &GroupKinds, sentences: &'a [Sentence]) -> Self {
        let is_last = GROUPS.last().is_some_and(|last| last.title == kinds.title);
        let is_known = |kind: &str| {
            GROUPS
                .iter()
                .any(|group| group.kinds().any(|own| own == kind))
        };
        let known = kinds.kinds().flat_map(|kind| {
            sentences
                .iter()
                .filter(move |sentence| sentence.kind == kind)
        });
        let unknown = sentences
            .iter()
            .filter(|sentence| is_last && !is_known(sentence.kind));
        let mut findings: Vec<Finding<'a>> = Vec::new();
        for sentence in known.chain(unknown) {
            match findings
                .iter_mut()
                .find(|finding| finding.is_about(sentence))
            {
                Some(finding) => finding.sentences.push(sentence),
                None => findings.push(Finding {
                    sentences: vec![sentence],
                }),
            }
        }
        let leading = || {
            findings
                .iter()
                .enumerate()
                .filter(|(_, finding)| kinds.leading.contains(&finding.sentences[0].kind))
        };
        let first = leading()
            .find(|(_, finding)| finding.shown().tone.is_detected())
            .or_else(|| leading().next())
            .map(|(place, _)| place);
        Self {
            title: kinds.title,
            first,
            findings,
        }
    }

    /// The sentences of all its findings.
    pub(super) fn sentences(&self) -> impl Iterator<Item = &'a Sentence> {
        self.findings
            .iter()
            .flat_map(|finding| finding.sentences.iter().copied())
    }

    /// The detected effects of the enhancers, or the statement that none was detected.
    fn enhancers(&self) -> String {
        let Some(first) = self.first.map(|first| &self.findings[first]) else {
            return String::new();
        };
        let own = |finding: &&Finding<'_>| finding.sentences[0].kind == first.sentences[0].kind;
        let findings = || self.findings.iter().filter(own);
        let detected: Vec<String> = findings()
            .filter(|finding| finding.shown().tone.is_detected())
            .take(MAX_ENHANCERS)
            .map(Finding::text)
            .collect();
        match findings().count() {
            _ if !detected.is_empty() => detected.join("; "),
            1 => first.text(),
            count => format!("no effect of the {count} enhancers was detected"),
        }
    }
}

impl GroupKinds {
    /// All kinds, the leading ones first.
    fn kinds(&self) -> impl Iterator<Item = &'static str> {
        self.leading.iter().chain(self.further).copied()
    }
}

impl<'a> Finding<'a> {
    /// Whether a sentence belongs to this finding: it is about the same enhancer, or about the same effect in another light.
    fn is_about(&self, sentence: &Sentence) -> bool {
        let own = self.sentences[0];
        let is_one_of_several = sentence.scope.subject.is_some() || sentence.scope.light.is_some();
        is_one_of_several
            && own.kind == sentence.kind
            && own.scope.subject == sentence.scope.subject
    }

    /// The sentence with the sign and the interval of the finding: the first detected one, else the first.
    pub(super) fn shown(&self) -> &'a Sentence {
        let mut sentences = self.sentences.iter().copied();
        sentences
            .find(|sentence| sentence.tone.is_detected())
            .unwrap_or(self.sentences[0])
    }

    /// The detected effect in the light of [`Self::shown`], without a full stop.
    pub(super) fn text(&self) -> String {
        let shown = self.shown();
        let mut texts: Vec<&str> = self
            .sentences
            .iter()
            .copied()
            .filter(|sentence| sentence.scope.light == shown.scope.light)
            .filter(|sentence| sentence.tone.is_detected() || *sentence == shown)
            .map(Sentence::claim)
            .collect();
        let more = texts.len().saturating_sub(MAX_CLAUSES);
        texts.truncate(MAX_CLAUSES);
        let mut text = texts.join("; ");
        if more > 0 {
            let _ = write!(text, "; {more} more");
        }
        text + &shown.scope.training
    }

    /// The intervals in words; empty of a finding without one.
    pub(super) fn interval_words(&self) -> String {
        let intervals = self.intervals();
        let words: Vec<String> = intervals.iter().map(ToString::to_string).collect();
        words.join("; ")
    }

    /// The interval of the finding, and those in other lights.
    pub(super) fn intervals(&self) -> Vec<FindingInterval> {
        let shown = self.shown();
        let mut of_lights = vec![shown];
        for sentence in &self.sentences {
            let light = &sentence.scope.light;
            let known = of_lights
                .iter_mut()
                .find(|known| known.scope.light == *light);
            match known {
                None => of_lights.push(sentence),
                // The detected one stands for a light.
                Some(known) if !known.tone.is_detected() && sentence.tone.is_detected() => {
                    *known = sentence;
                }
                Some(_) => {}
            }
        }
        of_lights
            .into_iter()
            .filter_map(|sentence| {
                let light = sentence.scope.light.clone();
                Some(FindingInterval {
                    effect: Effect::from_sentence(sentence)?.words(),
                    light: light.filter(|_| sentence.scope.light != shown.scope.light),
                    at: sentence.scope.at.clone(),
                })
            })
            .collect()
    }
}

impl fmt::Display for FindingInterval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(light) = &self.light {
            write!(f, "{light}: ")?;
        }
        f.write_str(&self.effect)?;
        match &self.at {
            Some(at) => write!(f, " at {at}"),
            None => Ok(()),
        }
    }
}

impl Effect {
    /// The difference or the share that a sentence names; `None` if it names none.
    pub(super) fn from_sentence(sentence: &Sentence) -> Option<Self> {
        let numbers = |names: [&str; 3]| {
            let [value, low, high] = names.map(|name| sentence.values.get(name).copied());
            Some([value?, low?, high?])
        };
        numbers(["difference", "low", "high"])
            .map(Self::Difference)
            .or_else(|| numbers(["share", "low", "high"]).map(Self::Share))
    }

    /// The effect as `−4.8 [−8.5, −1.0]` or `90.0 % [80.1, 95.3]`.
    pub(super) fn words(self) -> String {
        match self {
            Self::Difference(numbers) => {
                let [value, low, high] = numbers.map(|number| points(number / 100.0));
                format!("{value} [{low}, {high}]")
            }
            Self::Share(numbers) => {
                let [value, low, high] = numbers.map(|number| percent(number / 100.0));
                format!("{value} % [{low}, {high}]")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sentences::{Scope, Tone};

    fn sentence(kind: &'static str, tone: Tone, text: &str, scope: Scope) -> Sentence {
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

    fn about(subject: &str) -> Scope {
        Scope {
            subject: Some(subject.to_owned()),
            ..Scope::default()
        }
    }

    fn under(light: &str, level: &str) -> Scope {
        Scope {
            light: Some(light.to_owned()),
            at: Some(level.to_owned()),
            ..Scope::default()
        }
    }

    #[test]
    fn a_detected_finding_stands_for_its_group() {
        let sentences = [
            sentence("enhancer", Tone::NotShown, "a does nothing", about("a")),
            sentence("enhancer", Tone::Worse, "b harms", about("b")),
            sentence("fidelity", Tone::Better, "psnr", Scope::default()),
            sentence("darkness", Tone::NotShown, "no loss", Scope::default()),
            sentence("best", Tone::Better, "m sees best", Scope::default()),
        ];
        let groups = FindingGroups::new(&sentences);
        let first: Vec<(&str, String)> = groups
            .first()
            .into_iter()
            .map(|(title, finding)| (title, finding.text()))
            .collect();
        let expected = [("Darkness", "no loss"), ("Enhancers", "b harms")];
        assert_eq!(
            first,
            expected.map(|(title, text)| (title, text.to_owned()))
        );
        assert_eq!(groups.summary(), "no loss; b harms.");
        assert_eq!(groups.count(), 5);
    }

    #[test]
    fn all_that_an_enhancer_does_is_one_finding() {
        let sentences = [
            sentence("enhancer", Tone::Worse, "a harms at L1", about("a")),
            sentence("enhancer", Tone::Better, "a helps at L4", about("a")),
            sentence("enhancer", Tone::NotShown, "a at L2", about("a")),
        ];
        let groups = FindingGroups::new(&sentences);
        assert_eq!(groups.count(), 1);
        assert_eq!(groups.first()[0].1.text(), "a harms at L1; a helps at L4");
    }

    #[test]
    fn noise_profiles_are_compared_in_one_finding() {
        let sentences = [
            sentence(
                "darkness",
                Tone::NotShown,
                "paper: no loss",
                under("paper", "L3"),
            ),
            sentence("darkness", Tone::Worse, "eld: costs", under("eld", "L5")),
        ];
        let groups = FindingGroups::new(&sentences);
        let first = groups.first();
        assert_eq!(first[0].1.text(), "eld: costs");
        let intervals = first[0].1.intervals();
        let texts: Vec<String> = intervals.iter().map(ToString::to_string).collect();
        assert_eq!(
            texts,
            [
                "−20.0 [−40.0, −5.0] at L5",
                "paper: −20.0 [−40.0, −5.0] at L3"
            ]
        );
    }

    #[test]
    fn a_summary_without_darkness_is_the_first_finding() {
        let sentences = [sentence(
            "noise",
            Tone::Worse,
            "noise costs",
            Scope::default(),
        )];
        assert_eq!(FindingGroups::new(&sentences).summary(), "noise costs.");
        assert_eq!(FindingGroups::new(&[]).summary(), "");
    }

    #[test]
    fn a_sentence_of_an_unknown_kind_is_in_the_last_group() {
        let sentences = [sentence("novel", Tone::Note, "new", Scope::default())];
        let groups = FindingGroups::new(&sentences);
        assert_eq!((groups.all()[0].title, groups.count()), ("Sample", 1));
        assert!(groups.first().is_empty());
    }
}
