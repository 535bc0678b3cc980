//! The scores over the levels, a line a model and light: [`Rows`].

use std::collections::{BTreeMap, BTreeSet};

use crate::report::subject::{light, percent, points};
use crate::score::open::{Against, Group, OpenCell, OpenSummary};
use crate::score::subject::Subject;
use crate::types::{AxisLevel, EnhancerName, KindReading, View};

/// A model in one variant, raw or enhanced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Line<'a> {
    pub(super) model: &'a str,
    enhancer: Option<&'a EnhancerName>,
    variant: &'a KindReading,
}

impl Line<'_> {
    /// The variant in words, with what mended it.
    pub(super) fn light(&self) -> String {
        light(self.variant, self.enhancer)
    }
}

/// The scores of all models.
pub(super) struct Rows<'a> {
    summary: &'a OpenSummary,
    /// The levels of all lines.
    pub(super) levels: BTreeSet<AxisLevel>,
    /// Those that see; each with the lit frames of its model among its levels.
    pub(super) lines: BTreeMap<Line<'a>, BTreeSet<AxisLevel>>,
    /// Those that do not.
    pub(super) blind: Vec<&'a Subject>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(summary: &'a OpenSummary) -> Self {
        let mut rows = Self {
            summary,
            levels: BTreeSet::new(),
            lines: BTreeMap::new(),
            blind: Vec::new(),
        };
        let cells = summary.cells.iter().filter(|cell| cell.group == Group::All);
        for subject in cells.map(|cell| &cell.subject) {
            match (subject.view, subject.level) {
                (Some(View::Image), Some(level)) => {
                    rows.levels.insert(level);
                    let line = Line {
                        model: &subject.model,
                        enhancer: subject.enhancer.as_ref(),
                        variant: &subject.variant,
                    };
                    rows.lines.entry(line).or_default().insert(level);
                }
                _ => rows.blind.push(subject),
            }
        }
        // The lit frames begin every ladder; they are a line of their own only where there is no other.
        let dark: BTreeSet<&str> = rows
            .lines
            .keys()
            .filter(|line| line.variant.kind.is_some())
            .map(|line| line.model)
            .collect();
        let lit: BTreeSet<&str> = rows
            .lines
            .keys()
            .filter(|line| line.variant.kind.is_none())
            .map(|line| line.model)
            .collect();
        rows.lines
            .retain(|line, _| line.variant.kind.is_some() || !dark.contains(line.model));
        for (line, levels) in &mut rows.lines {
            if lit.contains(line.model) {
                levels.insert(AxisLevel::L0);
            }
        }
        rows
    }

    /// The cell of a line at a level, where there is one.
    pub(super) fn cell(
        &self,
        line: &Line<'_>,
        level: AxisLevel,
        group: &Group,
    ) -> Option<&'a OpenCell> {
        let there = self
            .lines
            .get(line)
            .is_some_and(|levels| levels.contains(&level));
        there
            .then(|| {
                let subject = Subject::seeing(line.model, level, line.variant, line.enhancer);
                self.summary.cell(&subject, group)
            })
            .flatten()
    }

    /// A score with half of its interval and, in brackets, what it differs from the lit frames; of the unrounded means.
    pub(super) fn shown(&self, cell: Option<&OpenCell>) -> String {
        let Some(cell) = cell else {
            return String::new();
        };
        let Some(score) = cell.score else {
            return "–".to_owned();
        };
        let half = percent((score.high - score.low) / 2.0);
        let change = self
            .summary
            .change(&cell.subject, Against::Lit, &cell.group);
        let change = change.map(|change| format!(" ({})", points(change.difference.value)));
        format!(
            "{} ±{half}{}",
            percent(score.value),
            change.unwrap_or_default()
        )
    }
}
