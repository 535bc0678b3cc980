//! The true option of each question of a set: [`Truths`].

use std::sync::Arc;

use super::answers::{
    AnswerOf, OneReading, Reading, asks_yes_or_no, digit, one_reading, yes_or_no,
};
use super::offered::Offered;
use crate::dataset::ready_made::cells::{Cell, Table};
use crate::dataset::ready_made::columns::map::{CellFormat, flag};
use crate::dataset::ready_made::columns::names::Role;
use crate::dataset::ready_made::columns::{Column, Roles, answer_column};
use crate::dataset::ready_made::items::{AnswerCell, Item};
use crate::dataset::ready_made::omissions::{OmissionReason, Omissions};
use crate::types::Choices;
use crate::types::text::excerpt;

/// A question with its choices.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct Answered {
    pub(in crate::dataset::ready_made) row: usize,
    pub(in crate::dataset::ready_made) text: String,
    pub(in crate::dataset::ready_made) choices: Choices,
}

/// The questions with their truths, and how these were read.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct Truths {
    pub(in crate::dataset::ready_made) answered: Vec<Answered>,
    /// The column and the reading, in words.
    pub(in crate::dataset::ready_made) said: Vec<String>,
}

/// The smallest share of questions that begin with a verb, for digits to mean no and yes.
const SHARE_OF_VERBS: f64 = 0.9;

/// The truths of all questions: one reading for those with options, another for those of yes and no.
///
/// # Errors
/// If there are no answers, no reading fits all of them, or two readings fit and differ.
pub(in crate::dataset::ready_made) fn truths(
    table: &Table,
    roles: &Roles,
    how: &CellFormat,
    items: Vec<Item>,
    left: &mut Omissions,
) -> Result<Truths, String> {
    if roles.answers.is_empty() && items.iter().all(|item| item.options.is_none()) {
        for item in items {
            left.add(OmissionReason::Open, || {
                format!("not in a column that is known ({})", table.place(item.row))
            });
        }
        return Ok(Truths {
            answered: Vec::new(),
            said: Vec::new(),
        });
    }
    if roles.answers.is_empty() {
        let remedy = answer_column::unnamed(table, roles, &items).map_or_else(
            || "a test split without them? (--ask FILE asks questions without answers about every image.)".to_owned(),
            |flag| format!("{flag} reads those of a column."),
        );
        return Err(format!(
            "no answers among its columns: {remedy} Its columns:\n{}",
            crate::dataset::ready_made::columns::shown(table)
        ));
    }
    let mut listed: Vec<Item> = items
        .into_iter()
        .map(|item| {
            if names_no_options(table, roles, &item) {
                item.without_options()
            } else {
                item
            }
        })
        .collect();
    let bare = listed.extract_if(.., |item| item.options.is_none());
    let bare: Vec<Item> = bare.collect();
    let mut truths = Truths {
        answered: Vec::new(),
        said: Vec::new(),
    };
    read_with_options(table, roles, how, listed, left, &mut truths)?;
    read_without_options(table, roles, bare, left, &mut truths)?;
    truths.answered.sort_by_key(|answered| answered.row);
    Ok(truths)
}

/// Whether the letters in a question name things in the image and no options, because its answer is yes or no and none of them.
fn names_no_options(table: &Table, roles: &Roles, item: &Item) -> bool {
    let Some(options) = item.options.as_deref().filter(|_| item.whole.is_some()) else {
        return false;
    };
    let answers: Vec<String> = roles
        .answers
        .iter()
        .filter_map(
            |column| match AnswerCell::from_row(&table.rows[item.row], column) {
                AnswerCell::One(answer) => Some(answer),
                AnswerCell::Absent | AnswerCell::Several(_) => None,
            },
        )
        .collect();
    let is_option = |answer: &String| {
        let readings = [Reading::Letter, Reading::Text];
        readings
            .iter()
            .any(|reading| reading.truth(answer, options).is_some())
    };
    answers.iter().any(|answer| yes_or_no(answer).is_some()) && !answers.iter().any(is_option)
}

/// Whether the lines are of this program's own form, in which the answer is the text of a choice.
pub(in crate::dataset::ready_made) fn is_own(table: &Table) -> bool {
    const FIELDS: [&str; 11] = [
        "id",
        "frame",
        "image",
        "family",
        "question",
        "choices",
        "answer",
        "evidence",
        "group",
        "group_size",
        "scene",
    ];
    let has = |name: &&str| table.find(name).is_some();
    ["question", "choices", "answer"].iter().all(has)
        && table
            .columns
            .iter()
            .all(|column| FIELDS.contains(&column.as_str()))
}

/// Whether every answer is written as a text, and none as a number.
fn are_texts(table: &Table, column: &Column) -> bool {
    table
        .rows
        .iter()
        .map(|row| column.cell(row))
        .all(|cell| matches!(cell, Cell::Text(_)))
}

/// Items with an answer each. Those without one, or with several, are counted. `other` is a flag for a column of answers that is not
/// known by its name, for the error if there are none.
fn with_answers(
    table: &Table,
    column: &Column,
    items: Vec<Item>,
    left: &mut Omissions,
    other: Option<String>,
) -> Result<Vec<(Item, String)>, String> {
    let count = items.len();
    let mut absent = Vec::new();
    let mut found = Vec::with_capacity(count);
    for item in items {
        match AnswerCell::from_row(&table.rows[item.row], column) {
            AnswerCell::One(answer) => found.push((item, answer)),
            AnswerCell::Several(shown) => left.add(OmissionReason::SeveralTruths, || shown),
            AnswerCell::Absent => absent.push(item.row),
        }
    }
    if absent.len() == count && count > 0 {
        let remedy = other.map_or_else(
            || "a test split without them? --read split names another, and --ask FILE asks questions without answers about every image".to_owned(),
            |flag| format!("{flag} reads those of another column"),
        );
        return Err(format!(
            "no answer in any row (column {:?}): {remedy}",
            column.name
        ));
    }
    for row in absent {
        left.add(OmissionReason::Bad, || {
            format!("{}: no answer (column {:?})", table.place(row), column.name)
        });
    }
    Ok(found)
}

/// The questions with options.
fn read_with_options(
    table: &Table,
    roles: &Roles,
    how: &CellFormat,
    items: Vec<Item>,
    left: &mut Omissions,
    truths: &mut Truths,
) -> Result<(), String> {
    if items.is_empty() {
        return Ok(());
    }
    let column = answer_column::option_column(table, roles, &items)?;
    let other = answer_column::unnamed(table, roles, &items);
    let items = with_answers(table, column, items, left, other)?;
    let read = ColumnReading::choose(table, column, how, &items)?;
    let name = read.reading.name();
    truths.said.push(format!("{} ({name})", column.name));
    truths.answered.reserve(items.len());
    for (
        Item {
            row, text, options, ..
        },
        answer,
    ) in items
    {
        match read.choices(&answer, &options.unwrap_or_default()) {
            Ok(choices) => truths.answered.push(Answered { row, text, choices }),
            Err(problem) => left.add(OmissionReason::Bad, || {
                format!("{}: {problem}", table.place(row))
            }),
        }
    }
    Ok(())
}

/// How the answers of a column are read: in one way, in all rows.
struct ColumnReading<'h> {
    how: &'h CellFormat,
    reading: Reading,
    /// The number of rows that it fits.
    fit: usize,
}

impl<'h> ColumnReading<'h> {
    /// The reading that the user names, else the one that fits all rows, else the one that fits most of them.
    ///
    /// # Errors
    /// If it fits no row, or two readings fit and differ.
    fn choose(
        table: &Table,
        column: &Column,
        how: &'h CellFormat,
        items: &[(Item, String)],
    ) -> Result<Self, String> {
        let none = Offered::default();
        let rows: Vec<AnswerOf<'_>> = items
            .iter()
            .map(|(item, answer)| (answer.as_str(), item.options.as_deref().unwrap_or(&none)))
            .collect();
        let by = |reading: Reading| {
            let mut read = Self {
                how,
                reading,
                fit: 0,
            };
            let fit = rows.iter().filter(|row| read.truth(**row).is_some());
            read.fit = fit.count();
            read
        };
        let read = match how {
            CellFormat::Answer(reading) => by(*reading),
            CellFormat::ByRule | CellFormat::Split(_) => {
                let texts = is_own(table) && are_texts(table, column);
                let texts = texts.then(|| by(Reading::Text));
                // Of two readings that fit as many rows, the text is what this form has.
                match texts.filter(|read| read.fit > 0 && 2 * read.fit >= rows.len()) {
                    Some(texts) => texts,
                    None => by(by_rule(&rows).map_err(|(readings, row)| {
                        ambiguous(table, &items[row].0, rows[row], readings, column)
                    })?),
                }
            }
        };
        match items.first() {
            Some((item, answer)) if read.fit == 0 => Err(format!(
                "{}: the answer {:?} (column {:?}) is not one of the options {}, neither by letter nor by text nor by number",
                table.place(item.row),
                excerpt(answer, 60),
                column.name,
                rows[0].1.shown(120)
            )),
            _ => Ok(read),
        }
    }

    /// The index of the option that an answer means.
    fn truth(&self, (answer, options): AnswerOf<'_>) -> Option<usize> {
        match self.how {
            CellFormat::Answer(_) => self.reading.truth(answer, options),
            CellFormat::ByRule | CellFormat::Split(_) => self.reading.by_rule(answer, options),
        }
    }

    /// The options as choices, with the one that an answer means as the true one.
    ///
    /// # Errors
    /// If the answer means none of them, or they are no choices.
    fn choices(&self, answer: &str, options: &Offered) -> Result<Choices, String> {
        match self.truth((answer, options)) {
            Some(truth) => Choices::known_by(Arc::clone(&options.texts), Some(truth))
                .map_err(|e| e.to_string()),
            None => Err(format!(
                "the answer {:?} is not one of the options {} (read as {}, which fits {} rows)",
                excerpt(answer, 60),
                options.shown(120),
                self.reading.name(),
                self.fit
            )),
        }
    }
}

/// The reading that fits all rows; if there is none, the one that fits most of them.
///
/// # Errors
/// If two readings fit and differ: both, and the row.
fn by_rule(rows: &[AnswerOf<'_>]) -> Result<Reading, ([Reading; 2], usize)> {
    match one_reading(rows) {
        OneReading::Fits(reading) => Ok(reading),
        OneReading::Ambiguous { readings, row } => Err((readings, row)),
        OneReading::None { best, unfit } => {
            let read: Vec<usize> = (0..rows.len())
                .filter(|row| unfit.binary_search(row).is_err())
                .collect();
            let kept: Vec<AnswerOf<'_>> = read.iter().map(|&row| rows[row]).collect();
            match one_reading(&kept) {
                OneReading::Ambiguous { readings, row } => Err((readings, read[row])),
                OneReading::Fits(_) | OneReading::None { .. } => Ok(best),
            }
        }
    }
}

/// The error for an answer that two readings understand in two ways.
fn ambiguous(
    table: &Table,
    item: &Item,
    (answer, options): AnswerOf<'_>,
    readings: [Reading; 2],
    column: &Column,
) -> String {
    let [one, other] = readings.map(Reading::name);
    let [first, second] = readings.map(|reading| flag(Role::Answer, &column.name, Some(reading)));
    format!(
        "{}: the answer {:?} may be read as {one} or as {other}, which differ among the options {}; {first} or {second} says which is meant",
        table.place(item.row),
        excerpt(answer, 60),
        options.shown(120),
    )
}

/// The questions without options: of yes and no, or open.
fn read_without_options(
    table: &Table,
    roles: &Roles,
    items: Vec<Item>,
    left: &mut Omissions,
    truths: &mut Truths,
) -> Result<(), String> {
    if items.is_empty() {
        return Ok(());
    }
    let column = answer_column::yes_or_no_column(table, roles, &items)?;
    let items = with_answers(table, column, items, left, None)?;
    let verbs = items
        .iter()
        .filter(|(item, _)| asks_yes_or_no(last_line(&item.text)))
        .count();
    let are_digits = verbs as f64 >= SHARE_OF_VERBS * items.len() as f64
        && items.iter().all(|(_, answer)| digit(answer).is_some());
    let both: Arc<[String]> = ["yes", "no"].map(str::to_owned).into();
    let mut count = 0;
    for (Item { row, text, .. }, answer) in items {
        let read = if are_digits { digit(&answer) } else { None };
        let truth = read.or_else(|| yes_or_no(&answer));
        match Choices::known_by(Arc::clone(&both), truth) {
            Ok(choices) if choices.truth().is_some() => {
                count += 1;
                truths.answered.push(Answered { row, text, choices });
            }
            Ok(_) | Err(_) => left.add(OmissionReason::Open, || {
                format!("{:?}", excerpt(&answer, 60))
            }),
        }
    }
    if count > 0 {
        let digits = if are_digits { ", 1 is yes" } else { "" };
        truths
            .said
            .push(format!("{} (yes/no{digits})", column.name));
    }
    Ok(())
}

/// The last line of a text, behind a hint.
fn last_line(text: &str) -> &str {
    text.lines().next_back().unwrap_or(text)
}
