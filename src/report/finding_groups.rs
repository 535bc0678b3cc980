//! Findings of a report by group: [`FindingGroups`]. The page, the terminal and Markdown all start with the same
//! summary and the same main finding of each group, and list all findings in the same groups.

use std::fmt::{self, Write as _};

use crate::sentences::{Sentence, capitalised};
use crate::text::words::{percent, points, share_ends};

/// Title of a group, and the kinds of sentences that belong to it.
struct GroupKinds {
    title: &'static str,
    /// Kinds of which a finding can be the main finding of the group, the most important first.
    leading: &'static [&'static str],
    /// Kinds that are only in the list of all findings.
    further: &'static [&'static str],
}

/// All groups in order. Sentences of any other kind are in the last group.
const GROUPS: [GroupKinds; 9] = [
    GroupKinds { title: "Baseline", leading: &["baseline"], further: &[] },
    GroupKinds { title: "Threshold", leading: &["threshold"], further: &[] },
    GroupKinds {
        title: "Darkness",
        leading: &["darkness", "real darkness", "agreement_in_the_dark"],
        further: &["real against synthetic", "families", "best", "apart"],
    },
    GroupKinds { title: "Wordings", leading: &["variation"], further: &[] },
    GroupKinds { title: "Noise", leading: &["noise"], further: &["readings"] },
    GroupKinds {
        title: "Enhancers",
        leading: &["enhancer", "real enhanced", "agreement_enhanced"],
        further: &["fidelity"],
    },
    GroupKinds { title: "Without images", leading: &["below blind", "images"], further: &[] },
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
        leading: &["no verdict", "left out", "bank_cannot_tell", "models_in_light", "power"],
        further: &[],
    },
];

/// Maximum number of main findings at the start of a report (chosen to fit one screen).
const MAX_FIRST: usize = 6;
/// Maximum number of enhancers in the summary (chosen).
const MAX_ENHANCERS: usize = 3;
/// Maximum number of sentences in the text of a finding (chosen).
const MAX_CLAUSES: usize = 3;

/// Findings of a report in groups, without empty groups.
pub struct FindingGroups<'a>(Vec<FindingGroup<'a>>);

/// Findings of one group, the most important kind first.
pub(crate) struct FindingGroup<'a> {
    pub(super) title: &'static str,
    findings: Vec<GroupedFinding<'a>>,
    /// Index of the main finding; `None` if no finding is of a leading kind.
    first: Option<usize>,
}

/// Sentences about the same subject, such as one enhancer, or one effect under several noise profiles.
pub(super) struct GroupedFinding<'a> {
    sentences: Vec<&'a Sentence>,
}

/// Effect of a finding in one variant.
pub(super) struct FindingInterval {
    /// Text of the effect with its interval.
    pub(super) effect: String,
    /// Variant, if it differs from the variant of the finding's text.
    pub(super) light: Option<String>,
    /// Level, or range of levels.
    pub(super) at: Option<String>,
}

/// Value of an effect and both ends of its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Effect {
    /// Difference in percentage points.
    Difference([f64; 3]),
    /// Share in percent.
    Share([f64; 3]),
}

impl<'a> FindingGroups<'a> {
    /// Groups the sentences of a report.
    pub(super) fn new(sentences: &'a [Sentence]) -> Self {
        let mut groups: Vec<FindingGroup<'a>> =
            GROUPS.iter().map(|kinds| FindingGroup::new(kinds, sentences)).collect();
        groups.retain(|group| !group.findings.is_empty());
        Self(groups)
    }

    pub(super) fn all(&self) -> &[FindingGroup<'a>] {
        &self.0
    }

    /// Number of findings in all groups.
    pub(super) fn count(&self) -> usize {
        self.0.iter().map(|group| group.findings.len()).sum()
    }

    /// Main findings at the start of a report, each with the title of its group.
    pub(super) fn main_findings(&self) -> Vec<(&'static str, &GroupedFinding<'a>)> {
        self.0.iter().filter_map(|group| Some((group.title, group.main_finding()?))).take(MAX_FIRST).collect()
    }

    fn group(&self, title: &str) -> Option<&FindingGroup<'a>> {
        self.0.iter().find(|group| group.title == title)
    }

    /// Summary of the report: the comparison with a baseline, how dark it may be, then one sentence with the effect of darkness and the detected effects
    /// of enhancers. Without any of them, it is the first main finding; without any finding, it is empty. A sentence
    /// about the training data of each enhancer with an effect follows.
    pub(super) fn summary(&self) -> String {
        let [baseline, threshold, darkness] = ["Baseline", "Threshold", "Darkness"]
            .map(|title| self.group(title).and_then(FindingGroup::main_finding).map(GroupedFinding::claims));
        let first: Vec<String> = baseline.into_iter().chain(threshold).map(|claims| self.sentence(&[claims])).collect();
        let enhancers = self.group("Enhancers");
        let clauses: Vec<String> = darkness
            .into_iter()
            .chain(enhancers.map(FindingGroup::enhancer_effects))
            .filter(|clause| !clause.is_empty())
            .collect();
        if let ([], [], Some((_, main))) = (&clauses[..], &first[..], self.main_findings().first()) {
            return self.sentence(&[main.text()]);
        }
        let effects = (!clauses.is_empty()).then(|| self.sentence(&clauses));
        let trainings = enhancers.map_or_else(Vec::new, FindingGroup::trainings);
        first.into_iter().chain(effects).chain(trainings).collect::<Vec<String>>().join(" ")
    }

    /// Joins clauses to one sentence. A variant at the start of the first clause is not repeated in the others.
    fn sentence(&self, clauses: &[String]) -> String {
        let prefix = self
            .0
            .iter()
            .flat_map(|group| &group.findings)
            .filter_map(|finding| finding.main_sentence().scope.light.as_ref())
            .map(|light| format!("{light}: "))
            .find(|prefix| clauses[0].starts_with(prefix))
            .unwrap_or_default();
        let clauses: Vec<&str> = clauses.iter().map(|clause| clause.strip_prefix(&prefix).unwrap_or(clause)).collect();
        capitalised(&prefix) + &clauses.join("; ") + "."
    }
}

impl<'a> FindingGroup<'a> {
    fn new(kinds: &GroupKinds, sentences: &'a [Sentence]) -> Self {
        let is_last = GROUPS.last().is_some_and(|last| last.title == kinds.title);
        let listed = kinds.kinds().flat_map(|kind| sentences.iter().filter(move |sentence| sentence.kind == kind));
        let unlisted = sentences.iter().filter(|sentence| is_last && !is_listed(sentence.kind));
        let mut findings: Vec<GroupedFinding<'a>> = Vec::new();
        for sentence in listed.chain(unlisted) {
            match findings.iter_mut().find(|finding| finding.is_about(sentence)) {
                Some(finding) => finding.sentences.push(sentence),
                None => findings.push(GroupedFinding { sentences: vec![sentence] }),
            }
        }
        let leading: Vec<usize> = findings
            .iter()
            .enumerate()
            .filter(|(_, finding)| kinds.leading.contains(&finding.kind()))
            .map(|(index, _)| index)
            .collect();
        let detected = leading.iter().copied().find(|index| findings[*index].is_detected());
        let first = detected.or(leading.first().copied());
        Self { title: kinds.title, first: first.map(|first| strongest(&findings, first)), findings }
    }

    /// The first detected finding of a leading kind, else the first one; of several enhancers the one with the largest
    /// effect. `None` without a finding of a leading kind.
    fn main_finding(&self) -> Option<&GroupedFinding<'a>> {
        Some(&self.findings[self.first?])
    }

    /// Sentences of all findings in the group.
    pub(super) fn sentences(&self) -> impl Iterator<Item = &'a Sentence> {
        self.findings.iter().flat_map(|finding| finding.sentences.iter().copied())
    }

    /// Findings about the enhancers, of the kind of the main finding.
    fn of_main_kind(&self) -> Vec<&GroupedFinding<'a>> {
        let kind = self.main_finding().map(GroupedFinding::kind);
        self.findings.iter().filter(|finding| Some(finding.kind()) == kind).collect()
    }

    /// Findings in the summary: the largest detected effects, or the effect of the only enhancer.
    fn in_summary(&self) -> Vec<&GroupedFinding<'a>> {
        let mut findings = self.of_main_kind();
        if findings.len() > 1 {
            findings.retain(|finding| finding.is_detected());
            findings.sort_by(|one, other| other.size().total_cmp(&one.size()));
            findings.truncate(MAX_ENHANCERS);
        }
        findings
    }

    /// Detected effects of the enhancers, or the statement that none was detected.
    fn enhancer_effects(&self) -> String {
        let claims: Vec<String> = self.in_summary().into_iter().map(GroupedFinding::claims).collect();
        match self.of_main_kind().len() {
            count if count > 0 && claims.is_empty() => {
                format!("no effect of the {count} enhancers was detected")
            }
            _ => claims.join("; "),
        }
    }

    /// Sentences about the training data of the enhancers in the summary.
    fn trainings(&self) -> Vec<String> {
        self.in_summary()
            .into_iter()
            .map(|finding| finding.main_sentence().scope.training.clone())
            .filter(|training| !training.is_empty())
            .collect()
    }
}

/// Index of the finding with the largest effect among those that are about the same kind of effect as the finding
/// `first` and as detected as it, but about other enhancers; `first` if it is not about an enhancer.
fn strongest(findings: &[GroupedFinding<'_>], first: usize) -> usize {
    let is_alike = |finding: &GroupedFinding<'_>| {
        let sentence = finding.main_sentence();
        sentence.scope.subject.is_some()
            && finding.kind() == findings[first].kind()
            && finding.is_detected() == findings[first].is_detected()
    };
    (0..findings.len())
        .filter(|index| is_alike(&findings[*index]))
        .rev()
        .max_by(|one, other| findings[*one].size().total_cmp(&findings[*other].size()))
        .unwrap_or(first)
}

/// True if a group lists a kind of sentence.
fn is_listed(kind: &str) -> bool {
    GROUPS.iter().any(|group| group.kinds().any(|listed| listed == kind))
}

impl GroupKinds {
    /// All kinds of the group, the leading ones first.
    fn kinds(&self) -> impl Iterator<Item = &'static str> {
        self.leading.iter().chain(self.further).copied()
    }
}

impl<'a> GroupedFinding<'a> {
    /// Kind of the finding's sentences.
    fn kind(&self) -> &'static str {
        self.sentences[0].kind
    }

    /// True if any sentence reports a detected effect.
    fn is_detected(&self) -> bool {
        self.main_sentence().tone.is_detected()
    }

    /// True if a sentence belongs to this finding: it is about the same enhancer, or about the same effect in another
    /// variant.
    fn is_about(&self, sentence: &Sentence) -> bool {
        let own = self.sentences[0];
        let is_one_of_several = sentence.scope.subject.is_some() || sentence.scope.light.is_some();
        is_one_of_several && own.kind == sentence.kind && own.scope.subject == sentence.scope.subject
    }

    /// Sentence whose sign and interval stand for the finding: the first with a detected effect, else the first.
    pub(super) fn main_sentence(&self) -> &'a Sentence {
        self.sentences.iter().copied().find(|sentence| sentence.tone.is_detected()).unwrap_or(self.sentences[0])
    }

    /// Size of the effect of the main sentence in points; 0 without one.
    fn size(&self) -> f64 {
        let difference = self.main_sentence().values.get("difference");
        difference.map_or(0.0, |difference| difference.abs())
    }

    /// Text of the detected effects in the variant of [`Self::main_sentence`] and the sentence about training data,
    /// without the last full stop.
    pub(super) fn text(&self) -> String {
        match self.main_sentence().scope.training.trim_end_matches('.') {
            "" => self.claims(),
            training => format!("{}. {training}", self.claims()),
        }
    }

    /// Text of the detected effects in the variant of [`Self::main_sentence`], without a full stop.
    fn claims(&self) -> String {
        let main = self.main_sentence();
        let mut texts: Vec<&str> = self
            .sentences
            .iter()
            .copied()
            .filter(|sentence| sentence.scope.light == main.scope.light)
            .filter(|sentence| sentence.tone.is_detected() || *sentence == main)
            .map(Sentence::claim)
            .collect();
        let more = texts.len().saturating_sub(MAX_CLAUSES);
        texts.truncate(MAX_CLAUSES);
        let mut text = texts.join("; ");
        if more > 0 {
            let _ = write!(text, "; {more} more");
        }
        text
    }

    /// Text of the intervals; empty for a finding without one.
    pub(super) fn intervals_text(&self) -> String {
        let intervals: Vec<String> = self.intervals().iter().map(ToString::to_string).collect();
        intervals.join("; ")
    }

    /// Interval of the main sentence, then one for each other variant.
    pub(super) fn intervals(&self) -> Vec<FindingInterval> {
        let main = self.main_sentence();
        let mut by_light = vec![main];
        for sentence in &self.sentences {
            let light = &sentence.scope.light;
            let known = by_light.iter_mut().find(|known| known.scope.light == *light);
            match known {
                None => by_light.push(sentence),
                // Prefer a detected effect in each variant.
                Some(known) if !known.tone.is_detected() && sentence.tone.is_detected() => {
                    *known = sentence;
                }
                Some(_) => {}
            }
        }
        by_light
            .into_iter()
            .filter_map(|sentence| {
                let light = sentence.scope.light.clone();
                Some(FindingInterval {
                    effect: Effect::from_sentence(sentence)?.text(),
                    light: light.filter(|_| sentence.scope.light != main.scope.light),
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
    /// Difference or share among the values of a sentence; `None` without both.
    pub(super) fn from_sentence(sentence: &Sentence) -> Option<Self> {
        let [difference, share, low, high] =
            ["difference", "share", "low", "high"].map(|name| sentence.values.get(name).copied());
        let (low, high) = (low?, high?);
        difference
            .map(|value| Self::Difference([value, low, high]))
            .or_else(|| share.map(|value| Self::Share([value, low, high])))
    }

    /// Formats the effect, as in `−4.8 [−8.5, −1.0]` or `90.0 % [80.1, 95.3]`.
    pub(super) fn text(self) -> String {
        match self {
            Self::Difference(numbers) => {
                let [value, low, high] = numbers.map(|number| points(number / 100.0));
                format!("{value} [{low}, {high}]")
            }
            Self::Share(numbers) => {
                let [value, low, high] = numbers.map(|number| number / 100.0);
                let [low, high] = share_ends(low, high);
                format!("{} % [{low}, {high}]", percent(value))
            }
        }
    }
}

#[cfg(test)]
mod tests;
