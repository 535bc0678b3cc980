//! Questions that a set scores together: [`GroupRule`], [`Groups`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::cells::{Cell, Row, Table};
use super::choices::is_own;
use super::columns::map::Map;
use super::columns::names::Role;
use super::columns::{Column, column};
use super::summary::count;
use crate::types::{Question, StrictGroup};

/// How the group of a row follows from its cells.
#[derive(Debug)]
pub(super) struct GroupRule {
    /// The column or template as the user or the preset says it.
    text: String,
    parts: Vec<Part>,
    /// The column that holds the number of questions in the group, in files that a run wrote.
    size: Option<Column>,
}

/// A part of the name of a group.
#[derive(Debug)]
enum Part {
    /// The same in every row.
    Words(String),
    /// A cell.
    Cell(Column),
    /// The numbers of a column in runs of one length, from a first number: `{Index:2 from 1}` takes 1 and 2, 3 and 4 together.
    Run {
        column: Column,
        length: u64,
        first: u64,
    },
}

/// The columns by which files of this program name groups.
const OWN: [&str; 2] = ["group", "group_size"];

impl GroupRule {
    /// The rule of a map; without one, that of a file of this program; `None` if questions have no groups.
    ///
    /// # Errors
    /// If the map names a column that is not there, or a template cannot be read.
    pub(super) fn from_map(table: &Table, map: &Map) -> Result<Option<Self>, String> {
        let [name, size] = OWN;
        let own = |name| table.find(name).and_then(|_| column(table, name).ok());
        let is_own = || own(name).is_some() && (own(size).is_some() || is_own(table));
        let text = match map.entry(Role::Group).map(|entry| &*entry.columns) {
            Some([text]) => text.clone(),
            None if is_own() => name.to_owned(),
            _ => return Ok(None),
        };
        let parts = if text.contains('{') {
            parts(table, &text)?
        } else {
            vec![Part::Cell(column(table, &text)?)]
        };
        let size = own(size).filter(|_| text == name);
        Ok(Some(Self { text, parts, size }))
    }

    /// The name of the group of a row; `None` if a cell is absent, or no number where one is needed.
    fn name(&self, row: &Row) -> Option<String> {
        self.parts.iter().map(|part| part.text(row)).collect()
    }
}

impl Part {
    fn text(&self, row: &Row) -> Option<String> {
        match self {
            Self::Words(words) => Some(words.clone()),
            Self::Cell(column) => match column.cell(row) {
                Cell::File(facts) => Some(facts.digest.to_string()[..12].to_owned()),
                _ => column.text(row).map(|text| text.trim().to_owned()),
            },
            Self::Run {
                column,
                length,
                first,
            } => {
                let number: u64 = column.text(row)?.trim().parse().ok()?;
                Some((number.checked_sub(*first)? / length).to_string())
            }
        }
    }
}

/// The parts of a template.
fn parts(table: &Table, template: &str) -> Result<Vec<Part>, String> {
    let mut parts = Vec::new();
    let mut rest = template;
    while let Some((words, after)) = rest.split_once('{') {
        let (field, after) = after
            .split_once('}')
            .ok_or_else(|| format!("group={template}: '}}' is missing"))?;
        if !words.is_empty() {
            parts.push(Part::Words(words.to_owned()));
        }
        parts.push(part(table, field)?);
        rest = after;
    }
    if !rest.is_empty() {
        parts.push(Part::Words(rest.to_owned()));
    }
    Ok(parts)
}

/// Parses the braces of a template: a column, or a column and how many of its numbers are one group.
fn part(table: &Table, field: &str) -> Result<Part, String> {
    let Some((name, run)) = run_of(field).filter(|_| table.find(field).is_none()) else {
        return column(table, field).map(Part::Cell);
    };
    let wrong = || {
        format!(
            "group={{{field}}}: {{COLUMN:2}} or {{COLUMN:2 from 1}} expected, with how many numbers are one group and the first of them"
        )
    };
    let (length, first) = run.split_once(" from ").unwrap_or((run, "0"));
    let length: u64 = length.trim().parse().map_err(|_| wrong())?;
    let first = first.trim().parse().map_err(|_| wrong())?;
    if length == 0 {
        return Err(wrong());
    }
    Ok(Part::Run {
        column: column(table, name)?,
        length,
        first,
    })
}

/// The column in the braces of a template, and what follows its colon.
fn run_of(field: &str) -> Option<(&str, &str)> {
    field.rsplit_once(':')
}

/// The columns that a template names.
pub(super) fn columns(template: &str) -> Vec<&str> {
    template
        .split('{')
        .skip(1)
        .filter_map(|part| part.split('}').next())
        .map(|field| run_of(field).map_or(field, |(name, _)| name))
        .collect()
}

/// The groups of the rows of a set.
#[derive(Debug, Default)]
pub(super) struct Groups {
    /// The rule as text; empty if there are no groups.
    rule: String,
    /// The name by row.
    names: Vec<Option<String>>,
    sizes: HashMap<String, usize>,
}

impl Groups {
    /// The groups by a rule. Rows that cannot be asked count as members, so that it is known what a group lacks; copies do not.
    pub(super) fn new(table: &Table, rule: &GroupRule, is_copy: impl Fn(usize) -> bool) -> Self {
        let mut groups = Self {
            rule: rule.text.clone(),
            ..Self::default()
        };
        for (at, row) in table.rows.iter().enumerate() {
            let name = rule.name(row).filter(|name| !name.is_empty());
            if let Some(name) = name.clone().filter(|_| !is_copy(at)) {
                *groups.sizes.entry(name).or_default() += 1;
            }
            groups.names.push(name);
        }
        let Some(size) = &rule.size else {
            return groups;
        };
        // A file of a run may hold a part of a group.
        for (row, name) in table.rows.iter().zip(&groups.names) {
            let stated = size.text(row).and_then(|text| text.trim().parse().ok());
            if let (Some(name), Some(stated)) = (name, stated) {
                let known = groups.sizes.entry(name.clone()).or_default();
                *known = (*known).max(stated);
            }
        }
        groups
    }

    /// The group of a row; `None` if it has none.
    pub(super) fn group(&self, row: usize) -> Option<StrictGroup> {
        let name = self.names.get(row)?.clone()?;
        let size = self.sizes.get(&name).copied().unwrap_or(1);
        Some(StrictGroup { name, size })
    }

    /// Describes the groups of these questions; `None` without groups.
    pub(super) fn said(&self, questions: &[Question]) -> Option<String> {
        if self.rule.is_empty() {
            return None;
        }
        let mut groups = BTreeMap::<&StrictGroup, Vec<&Question>>::new();
        for question in questions {
            if let Some(group) = &question.group {
                groups.entry(group).or_default().push(question);
            }
        }
        let number = count(groups.len(), "group", "groups");
        let sizes: BTreeSet<usize> = groups.keys().map(|group| group.size).collect();
        let of = match (sizes.first(), sizes.last()) {
            (Some(1), Some(1)) => " of one question, so that the strict score is accuracy".into(),
            (Some(least), Some(most)) if least == most => format!(" of {most} questions"),
            (Some(least), Some(most)) => format!(" of {least} to {most} questions"),
            _ => String::new(),
        };
        let single = groups.keys().filter(|group| group.size == 1).count();
        let across = groups.values().filter(|members| frames(members) > 1);
        let parts = groups
            .iter()
            .filter(|(group, members)| members.len() < group.size);
        let without = questions.iter().filter(|question| question.group.is_none());
        let facts = [
            (if sizes.len() > 1 { single } else { 0 }, "of one question"),
            (across.count(), "about several images"),
            (
                parts.count(),
                "with questions that are left out, never complete",
            ),
            (
                self.sizes.len().saturating_sub(groups.len()),
                "more of which every question is left out",
            ),
        ];
        let facts = facts
            .into_iter()
            .filter(|(number, _)| *number > 0)
            .map(|(number, what)| format!(", {number} {what}"));
        let without = match without.count() {
            0 => String::new(),
            number => format!(
                "; {} without a group",
                count(number, "question", "questions")
            ),
        };
        let facts: String = facts.collect();
        Some(format!(
            "group = {}: {number}{of}{facts}{without}",
            self.rule
        ))
    }
}

/// The number of frames that questions are about.
fn frames(questions: &[&Question]) -> usize {
    questions
        .iter()
        .map(|question| &question.frame)
        .collect::<BTreeSet<_>>()
        .len()
}
