//! Findings of `check`, one per line: [`Findings`].

use std::collections::BTreeMap;

use serde::Serialize;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Mark {
    /// No problem.
    Ok,
    /// A run would continue, but its numbers may be misleading.
    Warning,
    /// A run would stop.
    Problem,
}

impl Mark {
    fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok     ",
            Self::Warning => "warning",
            Self::Problem => "problem",
        }
    }
}

/// One finding.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Finding {
    pub(super) mark: Mark,
    pub(super) text: String,
}

/// Maximum number of findings of one kind that are shown.
const MAX_SHOWN: usize = 5;

/// All findings, in order.
#[derive(Debug, Default)]
pub(super) struct Findings {
    all: Vec<Finding>,
    /// Number of findings of each kind, and index of the last one shown.
    kinds: BTreeMap<&'static str, (usize, usize)>,
}

impl Findings {
    pub(super) fn ok(&mut self, text: impl Into<String>) {
        self.add(Mark::Ok, text);
    }

    pub(super) fn warn(&mut self, text: impl Into<String>) {
        self.add(Mark::Warning, text);
    }

    pub(super) fn problem(&mut self, text: impl Into<String>) {
        self.add(Mark::Problem, text);
    }

    fn add(&mut self, mark: Mark, text: impl Into<String>) {
        let text = text.into();
        self.all.push(Finding { mark, text });
    }

    /// Adds a finding of a kind. Only the first [`MAX_SHOWN`] of a kind are shown.
    pub(super) fn add_of_kind(&mut self, kind: &'static str, mark: Mark, text: impl Into<String>) {
        let count = self.kinds.entry(kind).or_default();
        count.0 += 1;
        if count.0 <= MAX_SHOWN {
            count.1 = self.all.len();
            self.add(mark, text);
        }
    }

    /// The findings, with a line for the number of each kind that is not shown.
    pub(super) fn finish(mut self) -> Vec<Finding> {
        let mut rest: Vec<(usize, Finding)> = self
            .kinds
            .iter()
            .filter(|(_, (count, _))| *count > MAX_SHOWN)
            .map(|(kind, (count, last))| {
                let mark = self.all[*last].mark;
                let text = format!("and {} more: {kind}", count - MAX_SHOWN);
                (*last, Finding { mark, text })
            })
            .collect();
        rest.sort_by_key(|(last, _)| std::cmp::Reverse(*last));
        for (last, finding) in rest {
            self.all.insert(last + 1, finding);
        }
        self.all
    }

    /// Number of problems, including those that are not shown.
    pub(super) fn problem_count(&self) -> usize {
        let shown = self.all.iter().filter(|finding| finding.mark == Mark::Problem).count();
        let hidden: usize = self
            .kinds
            .values()
            .filter(|(_, last)| self.all[*last].mark == Mark::Problem)
            .map(|(count, _)| count.saturating_sub(MAX_SHOWN))
            .sum();
        shown + hidden
    }
}

/// The findings as lines of text.
pub(super) fn lines(findings: &[Finding]) -> String {
    findings
        .iter()
        .map(|finding| {
            let text = finding.text.replace('\n', "\n         ");
            format!("{}  {text}\n", finding.mark.word())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_findings_of_a_kind_are_counted() {
        let mut findings = Findings::default();
        findings.ok("files");
        for n in 0..7 {
            findings.add_of_kind("missing images", Mark::Problem, format!("{n}.png is missing"));
        }
        findings.add_of_kind("grey images", Mark::Warning, "x.png is grey");
        assert_eq!(findings.problem_count(), 7);
        let text = lines(&findings.finish());
        assert!(
            text.contains("problem  4.png is missing\nproblem  and 2 more: missing images\nwarning  x.png"),
            "{text}"
        );
        assert!(!text.contains("5.png"), "{text}");
    }
}
