//! The column that holds the answers, among several that may: [`option_column`], [`yes_or_no_column`].
//!
//! A gap in a column, or a broken answer, does not make it give way to another: columns are compared in the rows that both answer.

use super::map::flag;
use super::names::Role;
use super::roles::{Column, Roles};
use crate::dataset::ready_made::cells::Table;
use crate::dataset::ready_made::choices::{Offered, Reading, digit, yes_or_no};
use crate::dataset::ready_made::items::{AnswerCell, Item};
use crate::types::text::excerpt;

/// The choice that a column names in each row; `None` where it names none that can be read.
type Said = Vec<Option<usize>>;

/// A column that may hold the answers.
struct Candidate<'a> {
    column: &'a Column,
    /// The ways in which its answers can be read, at least one.
    ways: Vec<Said>,
}

/// The answer of a row in a column, if it is one.
fn answer(table: &Table, item: &Item, column: &Column) -> Option<String> {
    match AnswerCell::from_row(&table.rows[item.row], column) {
        AnswerCell::One(answer) => Some(answer),
        AnswerCell::Absent | AnswerCell::Several(_) => None,
    }
}

/// The column whose answers are options.
///
/// # Errors
/// If two columns say different things of a row; the error shows the row and the two commands.
pub(in crate::dataset::ready_made) fn option_column<'a>(
    table: &Table,
    roles: &'a Roles,
    items: &[Item],
) -> Result<&'a Column, String> {
    let none = Offered::default();
    let candidate = |column: &'a Column| {
        let answers: Vec<Option<String>> = items
            .iter()
            .map(|item| answer(table, item, column))
            .collect();
        let filled = answers.iter().flatten().count();
        let said = |reading: Reading| -> Said {
            items
                .iter()
                .zip(&answers)
                .map(|(item, answer)| {
                    let options = item.options.as_deref().unwrap_or(&none);
                    reading.by_rule(answer.as_ref()?, options)
                })
                .collect()
        };
        let all = Reading::ALL.map(said);
        let most = all.iter().map(read).max().unwrap_or(0);
        // A text that happens to be an option here and there is no column of answers.
        if 2 * most <= filled {
            return None;
        }
        let mut ways: Vec<Said> = Vec::new();
        for said in all {
            if read(&said) == most && !ways.contains(&said) {
                ways.push(said);
            }
        }
        Some(Candidate { column, ways })
    };
    chosen(table, roles, items, candidate)
}

/// The flag for a column of no known name whose cells are an option in every row, in the first way that fits; `None` if there is none.
pub(in crate::dataset::ready_made) fn unnamed(
    table: &Table,
    roles: &Roles,
    items: &[Item],
) -> Option<String> {
    let none = Offered::default();
    let mut fitting = table
        .columns
        .iter()
        .enumerate()
        .filter(|(at, _)| !roles.holds(*at))
        .flat_map(|(at, name)| {
            let column = Column {
                at,
                field: None,
                name: name.clone(),
            };
            Reading::ALL
                .into_iter()
                .map(move |reading| (column.clone(), reading))
        })
        .filter(|(column, reading)| {
            items.iter().all(|item| {
                let options = item.options.as_deref().unwrap_or(&none);
                answer(table, item, column)
                    .is_some_and(|answer| reading.truth(&answer, options).is_some())
            })
        });
    let (column, reading) = fitting.next()?;
    Some(flag(Role::Answer, &column.name, Some(reading)))
}

/// The column whose answers are yes or no. A column of other words beside it differs from it.
///
/// # Errors
/// As [`option_column`].
pub(in crate::dataset::ready_made) fn yes_or_no_column<'a>(
    table: &Table,
    roles: &'a Roles,
    items: &[Item],
) -> Result<&'a Column, String> {
    /// The meaning of a word that is neither yes nor no.
    const OTHER: usize = usize::MAX;
    let candidate = |column: &'a Column| {
        let answers: Vec<Option<String>> = items
            .iter()
            .map(|item| answer(table, item, column))
            .collect();
        let said = |read: fn(&str) -> Option<usize>| -> Said {
            answers
                .iter()
                .map(|answer| Some(read(answer.as_ref()?).unwrap_or(OTHER)))
                .collect()
        };
        let mut ways = vec![said(yes_or_no)];
        if answers
            .iter()
            .flatten()
            .all(|answer| digit(answer).is_some())
        {
            ways.push(said(digit));
        }
        (answers.iter().flatten().count() > 0).then_some(Candidate { column, ways })
    };
    chosen(table, roles, items, candidate)
}

/// How many rows are read.
fn read(said: &Said) -> usize {
    said.iter().flatten().count()
}

/// The first of the columns that may hold the answers, if no other contradicts it; one that can be read in one way alone goes first.
/// The first of all columns if none may.
fn chosen<'a>(
    table: &Table,
    roles: &'a Roles,
    items: &[Item],
    candidate: impl Fn(&'a Column) -> Option<Candidate<'a>>,
) -> Result<&'a Column, String> {
    let [only] = &*roles.answers else {
        let candidates: Vec<Candidate<'a>> = roles.answers.iter().filter_map(candidate).collect();
        let clear = candidates.iter().find(|one| one.ways.len() == 1);
        let Some(chosen) = clear.or(candidates.first()) else {
            return Ok(&roles.answers[0]);
        };
        for other in &candidates {
            if let Some(at) = difference(chosen, other) {
                return Err(differ(table, &items[at], chosen.column, other.column));
            }
        }
        return Ok(chosen.column);
    };
    Ok(only)
}

/// The first row in which two columns differ, however they are read; `None` if they can be read alike.
fn difference(one: &Candidate<'_>, other: &Candidate<'_>) -> Option<usize> {
    let mut first = None;
    for said in &one.ways {
        for others in &other.ways {
            let mut rows = said.iter().zip(others);
            let differs = |(said, others): (&Option<usize>, &Option<usize>)| {
                said.is_some() && others.is_some() && said != others
            };
            let row = rows.position(differs)?;
            first.get_or_insert(row);
        }
    }
    first
}

fn differ(table: &Table, item: &Item, one: &Column, other: &Column) -> String {
    let says = |column: &Column| excerpt(&answer(table, item, column).unwrap_or_default(), 60);
    format!(
        "{}: the answers of {:?} and {:?} differ, {:?} and {:?}; {} or {} says which is meant",
        table.place(item.row),
        one.name,
        other.name,
        says(one),
        says(other),
        flag(Role::Answer, &one.name, None),
        flag(Role::Answer, &other.name, None)
    )
}
