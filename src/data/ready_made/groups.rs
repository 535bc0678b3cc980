//! Groups of questions that a set scores together: [`GroupRule`], [`Groups`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::cells::{Cell, Row, SetRows};
use super::choices::is_native_format;
use super::columns::map::ColumnMap;
use super::columns::{SetColumn, find_column};
use super::summary::count;
use crate::ready_made::columns::map::ColumnRole;
use darkqa_base::types::{Question, StrictGroup};

/// Rule that makes the name of a row's group from its cells.
#[derive(Debug)]
pub(super) struct GroupRule {
    /// Column or template, as written by the user or the preset.
    text: String,
    parts: Vec<NamePart>,
    /// Column with the number of questions in the group, in files written by a run.
    size: Option<SetColumn>,
}

/// Part of the name of a group.
#[derive(Debug)]
enum NamePart {
    /// Literal text, the same in every row.
    Literal(String),
    /// Text of a cell.
    Cell(SetColumn),
    /// Index of a run of `length` consecutive numbers in a column, counted from `first`: `{Index:2 from 1}` groups 1
    /// with 2, and 3 with 4.
    Run { column: SetColumn, length: u64, first: u64 },
}

/// Columns for the name and the size of groups in files of this program.
const NATIVE_COLUMNS: [&str; 2] = ["group", "group_size"];

impl GroupRule {
    /// Rule in the map, else the rule for files of this program; `None` if questions have no groups.
    ///
    /// # Errors
    /// If the map names a column that does not exist, or the template is invalid.
    pub(super) fn from_map(table: &SetRows, map: &ColumnMap) -> Result<Option<Self>, String> {
        let [name, size] = NATIVE_COLUMNS;
        let size = table.find(size).map(|index| SetColumn::new(index, size));
        let is_native = table.find(name).is_some() && (size.is_some() || is_native_format(table));
        let text = match map.entry(ColumnRole::Group).map(|entry| &*entry.columns) {
            Some([text]) => text.clone(),
            None if is_native => name.to_owned(),
            _ => return Ok(None),
        };
        let parts = if text.contains('{') {
            parse_template(table, &text)?
        } else {
            vec![NamePart::Cell(find_column(table, &text)?)]
        };
        let size = size.filter(|_| text == name);
        Ok(Some(Self { text, parts, size }))
    }

    /// Name of the group of a row; `None` if a cell is absent, or is not a number where one is needed.
    fn name(&self, row: &Row) -> Option<String> {
        self.parts.iter().map(|part| part.text(row)).collect()
    }
}

impl NamePart {
    fn text(&self, row: &Row) -> Option<String> {
        match self {
            Self::Literal(text) => Some(text.clone()),
            Self::Cell(column) => match column.cell(row) {
                Cell::File(facts) => Some(facts.digest.to_string()[..12].to_owned()),
                _ => column.text(row).map(|text| text.trim().to_owned()),
            },
            Self::Run { column, length, first } => {
                let number: u64 = column.text(row)?.trim().parse().ok()?;
                Some((number.checked_sub(*first)? / length).to_string())
            }
        }
    }
}

/// Parses a template of group names.
fn parse_template(table: &SetRows, template: &str) -> Result<Vec<NamePart>, String> {
    let mut parts = Vec::new();
    let mut rest = template;
    while let Some((literal, after)) = rest.split_once('{') {
        let (field, after) = after.split_once('}').ok_or_else(|| format!("group={template}: '}}' is missing"))?;
        if !literal.is_empty() {
            parts.push(NamePart::Literal(literal.to_owned()));
        }
        parts.push(parse_field(table, field)?);
        rest = after;
    }
    if !rest.is_empty() {
        parts.push(NamePart::Literal(rest.to_owned()));
    }
    Ok(parts)
}

/// Parses a field in braces: a column, or a column with the length of a run of numbers. A column with the whole name
/// takes precedence.
fn parse_field(table: &SetRows, field: &str) -> Result<NamePart, String> {
    let Some((name, run)) = split_run(field).filter(|_| table.find(field).is_none()) else {
        return find_column(table, field).map(NamePart::Cell);
    };
    let (length, first) = run.split_once(" from ").unwrap_or((run, "0"));
    let length: u64 = length.trim().parse().map_err(|_| run_problem(field))?;
    let first = first.trim().parse().map_err(|_| run_problem(field))?;
    if length == 0 {
        return Err(run_problem(field));
    }
    Ok(NamePart::Run { column: find_column(table, name)?, length, first })
}

fn run_problem(field: &str) -> String {
    format!(
        "group={{{field}}}: {{COLUMN:2}} or {{COLUMN:2 from 1}} expected, with how many numbers are one group and the first of them"
    )
}

/// Splits a field in braces at its last colon: the column and the run of numbers.
fn split_run(field: &str) -> Option<(&str, &str)> {
    field.rsplit_once(':')
}

/// Columns that a template names.
pub(super) fn template_columns(template: &str) -> Vec<&str> {
    template
        .split('{')
        .skip(1)
        .filter_map(|part| part.split('}').next())
        .map(|field| split_run(field).map_or(field, |(name, _)| name))
        .collect()
}

/// Groups of the rows of a set.
#[derive(Debug, Default)]
pub(super) struct Groups {
    /// The rule as text; empty if there are no groups.
    rule: String,
    /// Name of the group by row.
    names: Vec<Option<String>>,
    /// Number of questions by name.
    sizes: HashMap<String, usize>,
}

impl Groups {
    /// Groups the rows. Rows that cannot be asked count as members, so that incomplete groups are detected. Rotated
    /// copies of a question do not count.
    pub(super) fn new(table: &SetRows, rule: &GroupRule, is_rotation: impl Fn(usize) -> bool) -> Self {
        let mut groups = Self { rule: rule.text.clone(), ..Self::default() };
        for (index, row) in table.rows.iter().enumerate() {
            let name = rule.name(row).filter(|name| !name.is_empty());
            if let Some(name) = &name
                && !is_rotation(index)
            {
                *groups.sizes.entry(name.clone()).or_default() += 1;
            }
            groups.names.push(name);
        }
        let Some(size) = &rule.size else {
            return groups;
        };
        // A file of a run may have only some questions of a group.
        for (row, name) in table.rows.iter().zip(&groups.names) {
            let stated = size.text(row).and_then(|text| text.trim().parse().ok());
            if let (Some(name), Some(stated)) = (name, stated) {
                let known = groups.sizes.entry(name.clone()).or_default();
                *known = (*known).max(stated);
            }
        }
        groups
    }

    /// Group of a row; `None` if it has none.
    pub(super) fn group(&self, row: usize) -> Option<StrictGroup> {
        let name = self.names.get(row)?.clone()?;
        let size = self.sizes.get(&name).copied().unwrap_or(1);
        Some(StrictGroup { name, size })
    }

    /// Describes the groups of these questions; `None` without groups.
    pub(super) fn describe(&self, questions: &[Question]) -> Option<String> {
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
        let across_images = groups.values().filter(|members| count_frames(members) > 1).count();
        let incomplete = groups.iter().filter(|(group, members)| members.len() < group.size).count();
        let ungrouped = questions.iter().filter(|question| question.group.is_none()).count();
        let facts: String = [
            (if sizes.len() > 1 { single } else { 0 }, "of one question"),
            (across_images, "about several images"),
            (incomplete, "with questions that are left out, never complete"),
            (self.sizes.len().saturating_sub(groups.len()), "more of which every question is left out"),
        ]
        .into_iter()
        .filter(|(number, _)| *number > 0)
        .map(|(number, what)| format!(", {number} {what}"))
        .collect();
        let without = match ungrouped {
            0 => String::new(),
            number => format!("; {} without a group", count(number, "question", "questions")),
        };
        Some(format!("group = {}: {number}{of}{facts}{without}", self.rule))
    }
}

/// Number of different frames that questions are about.
fn count_frames(questions: &[&Question]) -> usize {
    questions.iter().map(|question| &question.frame).collect::<BTreeSet<_>>().len()
}
