//! Choice of the answer column among several candidates: [`option_column`], [`yes_or_no_column`].
//!
//! Columns are compared in the rows where both have a valid answer, so a gap or a broken answer in a column does not
//! exclude it.

use super::column::SetColumn;
use super::map::{ColumnRole, map_flag};
use super::roles::ColumnRoles;
use crate::ready_made::cells::SetRows;
use crate::ready_made::choices::{AnswerFormat, OptionList, digit_index, yes_no_index};
use crate::ready_made::items::{AnswerCell, RowQuestion};
use darkqa_base::types::text::excerpt;

/// Index of the choice that each row of a column identifies; `None` for a row without a valid answer.
type RowChoices = Vec<Option<usize>>;

/// Column that may have the answers.
struct AnswerCandidate<'a> {
    column: &'a SetColumn,
    /// Choices of the rows in each format that fits, at least one.
    interpretations: Vec<RowChoices>,
}

/// Answer of a row in a column; `None` if it has none or several.
fn answer(table: &SetRows, item: &RowQuestion, column: &SetColumn) -> Option<String> {
    match AnswerCell::from_row(&table.rows[item.row], column) {
        AnswerCell::One(answer) => Some(answer),
        AnswerCell::Absent | AnswerCell::Several(_) => None,
    }
}

/// Answer of each row in a column.
fn column_answers(table: &SetRows, items: &[RowQuestion], column: &SetColumn) -> Vec<Option<String>> {
    items.iter().map(|item| answer(table, item, column)).collect()
}

/// Column whose answers identify options.
///
/// # Errors
/// If two columns have different answers for a row; the error shows the row and the flags to choose a column.
pub(crate) fn option_column<'a>(
    table: &SetRows,
    roles: &'a ColumnRoles,
    items: &[RowQuestion],
) -> Result<&'a SetColumn, String> {
    choose(table, roles, items, |column| option_candidate(table, items, column))
}

/// A column as candidate for the answers of questions with options; `None` if at most half of its answers identify
/// options.
fn option_candidate<'a>(table: &SetRows, items: &[RowQuestion], column: &'a SetColumn) -> Option<AnswerCandidate<'a>> {
    let none = OptionList::default();
    let answers = column_answers(table, items, column);
    let filled = answers.iter().flatten().count();
    let by_format = AnswerFormat::ALL.map(|format| -> RowChoices {
        items
            .iter()
            .zip(&answers)
            .map(|(item, answer)| {
                let options = item.options.as_deref().unwrap_or(&none);
                format.inferred_choice_index(answer.as_ref()?, options)
            })
            .collect()
    });
    let most = by_format.iter().map(count_valid).max().unwrap_or(0);
    if 2 * most <= filled {
        return None;
    }
    let mut interpretations: Vec<RowChoices> = Vec::new();
    for choices in by_format {
        if count_valid(&choices) == most && !interpretations.contains(&choices) {
            interpretations.push(choices);
        }
    }
    Some(AnswerCandidate { column, interpretations })
}

/// Flag for a column without a role whose cells identify an option in every row, in the first format that fits; `None`
/// if there is no such column.
pub(crate) fn suggest_column(table: &SetRows, roles: &ColumnRoles, items: &[RowQuestion]) -> Option<String> {
    let none = OptionList::default();
    for (index, name) in table.columns.iter().enumerate() {
        if roles.uses(index) {
            continue;
        }
        let column = SetColumn::new(index, name);
        let fitting = AnswerFormat::ALL.into_iter().find(|format| {
            items.iter().all(|item| {
                let options = item.options.as_deref().unwrap_or(&none);
                answer(table, item, &column).is_some_and(|answer| format.choice_index(&answer, options).is_some())
            })
        });
        if let Some(format) = fitting {
            return Some(map_flag(ColumnRole::Answer, name, Some(format)));
        }
    }
    None
}

/// Column whose answers are yes or no. Other words count as a third answer.
///
/// # Errors
/// As [`option_column`].
pub(crate) fn yes_or_no_column<'a>(
    table: &SetRows,
    roles: &'a ColumnRoles,
    items: &[RowQuestion],
) -> Result<&'a SetColumn, String> {
    choose(table, roles, items, |column| yes_or_no_candidate(table, items, column))
}

/// A column as candidate for the answers of yes/no questions; `None` if it has no answers.
fn yes_or_no_candidate<'a>(
    table: &SetRows,
    items: &[RowQuestion],
    column: &'a SetColumn,
) -> Option<AnswerCandidate<'a>> {
    let answers = column_answers(table, items, column);
    if !answers.iter().any(Option::is_some) {
        return None;
    }
    let mut interpretations = vec![parse_answers(&answers, yes_no_index)];
    if answers.iter().flatten().all(|answer| digit_index(answer).is_some()) {
        interpretations.push(parse_answers(&answers, digit_index));
    }
    Some(AnswerCandidate { column, interpretations })
}

/// Index of yes or no for each answer, and a third index for other words.
fn parse_answers(answers: &[Option<String>], parse: fn(&str) -> Option<usize>) -> RowChoices {
    const OTHER: usize = usize::MAX;
    answers.iter().map(|answer| Some(parse(answer.as_ref()?).unwrap_or(OTHER))).collect()
}

/// Number of rows with a valid answer.
fn count_valid(choices: &RowChoices) -> usize {
    choices.iter().flatten().count()
}

/// Chooses the first candidate with a single interpretation, else the first candidate, else the first column.
///
/// # Errors
/// If another candidate contradicts the chosen one.
fn choose<'a>(
    table: &SetRows,
    roles: &'a ColumnRoles,
    items: &[RowQuestion],
    candidate: impl Fn(&'a SetColumn) -> Option<AnswerCandidate<'a>>,
) -> Result<&'a SetColumn, String> {
    if let [only] = &*roles.answers {
        return Ok(only);
    }
    let candidates: Vec<AnswerCandidate<'a>> = roles.answers.iter().filter_map(candidate).collect();
    let unambiguous = candidates.iter().find(|candidate| candidate.interpretations.len() == 1);
    let Some(chosen) = unambiguous.or(candidates.first()) else {
        return Ok(&roles.answers[0]);
    };
    for other in &candidates {
        if let Some(row) = first_difference(chosen, other) {
            return Err(differing_answers(table, &items[row], chosen.column, other.column));
        }
    }
    Ok(chosen.column)
}

/// Index of a row in which two columns differ in every interpretation; `None` if some interpretations agree.
fn first_difference(one: &AnswerCandidate<'_>, other: &AnswerCandidate<'_>) -> Option<usize> {
    let mut first = None;
    for choices in &one.interpretations {
        for other_choices in &other.interpretations {
            let row = choices
                .iter()
                .zip(other_choices)
                .position(|(one, other)| one.is_some() && other.is_some() && one != other)?;
            first.get_or_insert(row);
        }
    }
    first
}

/// Error message for two columns with different answers in a row.
fn differing_answers(table: &SetRows, item: &RowQuestion, one: &SetColumn, other: &SetColumn) -> String {
    format!(
        "{}: the answers of {:?} and {:?} differ, {:?} and {:?}; {} or {} says which is meant",
        table.place_in_set(item.row),
        one.name,
        other.name,
        answer_excerpt(table, item, one),
        answer_excerpt(table, item, other),
        map_flag(ColumnRole::Answer, &one.name, None),
        map_flag(ColumnRole::Answer, &other.name, None)
    )
}

fn answer_excerpt(table: &SetRows, item: &RowQuestion, column: &SetColumn) -> String {
    excerpt(&answer(table, item, column).unwrap_or_default(), 60)
}
