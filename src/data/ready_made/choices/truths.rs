//! Correct option of each question in a ready-made set: [`find_truths`].

use std::sync::Arc;

use super::answer_format::{
    AnswerFormat, FormatSearch, RowAnswer, asks_yes_or_no, digit_index, find_format, yes_no_index,
};
use super::option_list::OptionList;
use crate::ready_made::cells::{Cell, SetRows};
use crate::ready_made::columns::map::{CellFormat, ColumnRole, map_flag};
use crate::ready_made::columns::{ColumnRoles, SetColumn, answer_column, describe_columns};
use crate::ready_made::items::{AnswerCell, RowQuestion};
use crate::ready_made::omissions::{Omissions, RowOmission};
use darkqa_base::types::Choices;
use darkqa_base::types::text::{counted, excerpt};

/// Question of a row with its choices, including the correct one.
#[derive(Debug)]
pub(crate) struct SetQuestion {
    /// Index of the row in the table.
    pub row: usize,
    pub text: String,
    pub choices: Choices,
}

/// Questions of a set with their correct options.
#[derive(Debug, Default)]
pub(crate) struct SetTruths {
    pub questions: Vec<SetQuestion>,
    /// Answer columns with their formats as text, for the summary.
    pub columns: Vec<String>,
}

/// Minimum share of questions that begin with a verb, as yes/no questions do (heuristic). Below it, 0 and 1 do not mean
/// no and yes.
const MIN_VERB_SHARE: f64 = 0.9;

/// Finds the correct option of each question.
///
/// The answers to multiple-choice questions share one format. The answers to yes/no questions have a format of their
/// own.
///
/// # Errors
/// If there are no answers, no format fits any row, or two formats fit but identify different options.
pub(crate) fn find_truths(
    table: &SetRows,
    roles: &ColumnRoles,
    format: &CellFormat,
    items: Vec<RowQuestion>,
    omissions: &mut Omissions,
) -> Result<SetTruths, String> {
    if roles.answers.is_empty() && items.iter().all(|item| item.options.is_none()) {
        return Err(format!(
            "neither options nor answers among its columns: --map options=COLUMN,answer=COLUMN names them, and --map answer=COLUMN \
             those of yes/no questions; --ask FILE asks questions without answers about every image. Its columns:\n{}",
            describe_columns(table)
        ));
    }
    if roles.answers.is_empty() {
        let remedy = answer_column::suggest_column(table, roles, &items).map_or_else(
            || "a test split without them? (--ask FILE asks questions without answers about every image.)".to_owned(),
            |flag| format!("{flag} reads those of a column."),
        );
        return Err(format!("no answers among its columns: {remedy} Its columns:\n{}", describe_columns(table)));
    }
    let (with_options, without_options) = items
        .into_iter()
        .map(|item| if letters_are_not_options(table, roles, &item) { item.without_options() } else { item })
        .partition::<Vec<RowQuestion>, _>(|item| item.options.is_some());
    let mut truths = SetTruths::default();
    add_choice_questions(table, roles, format, with_options, omissions, &mut truths)?;
    add_yes_no_questions(table, roles, without_options, omissions, &mut truths)?;
    truths.questions.sort_by_key(|question| question.row);
    Ok(truths)
}

/// True if lettered texts in a question are labels in the image, not options: the answer is yes or no, and identifies
/// none of them.
fn letters_are_not_options(table: &SetRows, roles: &ColumnRoles, item: &RowQuestion) -> bool {
    // `whole` is set only if the options were found in the question's text.
    let Some(options) = item.options.as_deref().filter(|_| item.whole.is_some()) else {
        return false;
    };
    let answers: Vec<String> = roles
        .answers
        .iter()
        .filter_map(|column| match AnswerCell::from_row(&table.rows[item.row], column) {
            AnswerCell::One(answer) => Some(answer),
            AnswerCell::Absent | AnswerCell::Several(_) => None,
        })
        .collect();
    answers.iter().any(|answer| yes_no_index(answer).is_some())
        && !answers.iter().any(|answer| {
            [AnswerFormat::Letter, AnswerFormat::Text]
                .iter()
                .any(|format| format.choice_index(answer, options).is_some())
        })
}

/// True if the table is in this program's own format, in which the answer is the text of a choice.
pub(crate) fn is_native_format(table: &SetRows) -> bool {
    const FIELDS: [&str; 11] =
        ["id", "frame", "image", "family", "question", "choices", "answer", "evidence", "group", "group_size", "scene"];
    ["question", "choices", "answer"].iter().all(|name| table.find(name).is_some())
        && table.columns.iter().all(|column| FIELDS.contains(&column.as_str()))
}

/// True if all cells of the column are texts.
fn are_texts(table: &SetRows, column: &SetColumn) -> bool {
    table.rows.iter().all(|row| matches!(column.cell(row), Cell::Text(_)))
}

/// Pairs each item with its answer. Items without an answer, or with several, are added to the omissions.
///
/// # Errors
/// If the column has no answer in any row. The error suggests `other_column_flag`, the flag to read another column, if
/// there is one.
fn with_answers(
    table: &SetRows,
    column: &SetColumn,
    items: Vec<RowQuestion>,
    omissions: &mut Omissions,
    other_column_flag: Option<String>,
) -> Result<Vec<(RowQuestion, String)>, String> {
    let mut absent = Vec::new();
    let mut found = Vec::with_capacity(items.len());
    for item in items {
        match AnswerCell::from_row(&table.rows[item.row], column) {
            AnswerCell::One(answer) => found.push((item, answer)),
            AnswerCell::Several(excerpt) => {
                omissions.add(RowOmission::SeveralTruths, || excerpt);
            }
            AnswerCell::Absent => absent.push(item.row),
        }
    }
    if table.rows.iter().all(|row| AnswerCell::from_row(row, column) == AnswerCell::Absent) {
        let remedy = other_column_flag.map_or_else(
            || "a test split without them? --read split names another, and --ask FILE asks questions without answers about every image".to_owned(),
            |flag| format!("{flag} reads those of another column"),
        );
        return Err(format!("no answer in any row (column {:?}): {remedy}", column.name));
    }
    for row in absent {
        omissions
            .add(RowOmission::Bad, || format!("{}: no answer (column {:?})", table.place_in_set(row), column.name));
    }
    Ok(found)
}

/// Adds the multiple-choice questions with their correct options to `truths`.
fn add_choice_questions(
    table: &SetRows,
    roles: &ColumnRoles,
    format: &CellFormat,
    items: Vec<RowQuestion>,
    omissions: &mut Omissions,
    truths: &mut SetTruths,
) -> Result<(), String> {
    if items.is_empty() {
        return Ok(());
    }
    let column = answer_column::option_column(table, roles, &items)?;
    let other_column_flag = answer_column::suggest_column(table, roles, &items);
    let items = with_answers(table, column, items, omissions, other_column_flag)?;
    if items.is_empty() {
        return Ok(());
    }
    let column_format = ColumnFormat::choose(table, column, format, &items)?;
    let name = column_format.format.name();
    truths.columns.push(format!("{} ({name})", column.name));
    truths.questions.reserve(items.len());
    for (item, answer) in items {
        let RowQuestion { row, text, options, .. } = item;
        match column_format.choices(&answer, &options.unwrap_or_default()) {
            Ok(choices) => truths.questions.push(SetQuestion { row, text, choices }),
            Err(problem) => omissions.add(RowOmission::Bad, || format!("{}: {problem}", table.place_in_set(row))),
        }
    }
    Ok(())
}

/// Format of the answers in a column; all rows share it.
struct ColumnFormat {
    format: AnswerFormat,
    /// True if the user chose the format with `--map`.
    is_chosen: bool,
    /// Number of rows that the format fits.
    fitting_rows: usize,
}

impl ColumnFormat {
    /// Chooses the format given with `--map`, else the one that fits all rows, else the one that fits most rows.
    ///
    /// # Errors
    /// If the format fits no row, or two formats fit but identify different options.
    fn choose(
        table: &SetRows,
        column: &SetColumn,
        format: &CellFormat,
        items: &[(RowQuestion, String)],
    ) -> Result<Self, String> {
        let none = OptionList::default();
        let rows: Vec<RowAnswer<'_>> = items
            .iter()
            .map(|(item, answer)| RowAnswer { answer, options: item.options.as_deref().unwrap_or(&none) })
            .collect();
        let chosen = match format {
            CellFormat::Answer(format) => Self::new(*format, true, &rows),
            CellFormat::Inferred | CellFormat::Split(_) => {
                // Answers in this program's own format are texts: text wins if it fits at least half of the rows.
                let texts = (is_native_format(table) && are_texts(table, column))
                    .then(|| Self::new(AnswerFormat::Text, false, &rows))
                    .filter(|texts| texts.fitting_rows > 0 && 2 * texts.fitting_rows >= rows.len());
                if let Some(texts) = texts {
                    texts
                } else {
                    let format = infer_format(&rows)
                        .map_err(|(formats, row)| ambiguous_answer(table, &items[row].0, rows[row], formats, column))?;
                    Self::new(format, false, &rows)
                }
            }
        };
        match items.first() {
            Some((item, answer)) if chosen.fitting_rows == 0 => Err(format!(
                "{}: the answer {:?} (column {:?}) is not one of the options {}, neither by letter nor by text nor by number",
                table.place_in_set(item.row),
                excerpt(answer, 60),
                column.name,
                rows[0].options.excerpt(120)
            )),
            _ => Ok(chosen),
        }
    }

    fn new(format: AnswerFormat, is_chosen: bool, rows: &[RowAnswer<'_>]) -> Self {
        let mut column_format = Self { format, is_chosen, fitting_rows: 0 };
        column_format.fitting_rows =
            rows.iter().filter(|row| column_format.choice_index(row.answer, row.options).is_some()).count();
        column_format
    }

    /// Index of the option that an answer identifies.
    fn choice_index(&self, answer: &str, options: &OptionList) -> Option<usize> {
        if self.is_chosen {
            self.format.chosen_choice_index(answer, options)
        } else {
            self.format.inferred_choice_index(answer, options)
        }
    }

    /// Choices of a question, with the option that the answer identifies marked as correct.
    ///
    /// # Errors
    /// If the answer does not identify an option, or the options are not valid choices.
    fn choices(&self, answer: &str, options: &OptionList) -> Result<Choices, String> {
        match self.choice_index(answer, options) {
            Some(truth) => Choices::with_truth(Arc::clone(&options.texts), Some(truth)).map_err(|e| e.to_string()),
            None => Err(format!(
                "the answer {:?} is not one of the options {} (read as {}, which fits {})",
                excerpt(answer, 60),
                options.excerpt(120),
                self.format.name(),
                counted(self.fitting_rows, "row")
            )),
        }
    }
}

/// Finds the format that fits all rows, else the one that fits most rows.
///
/// # Errors
/// The two formats and the index of the row, if two formats fit but identify different options in that row.
fn infer_format(rows: &[RowAnswer<'_>]) -> Result<AnswerFormat, ([AnswerFormat; 2], usize)> {
    match find_format(rows) {
        FormatSearch::Fits(format) => Ok(format),
        FormatSearch::Ambiguous { formats, row } => Err((formats, row)),
        FormatSearch::None { best, unfit } => {
            // Search the rows that `best` fits once more: another format may fit all of them, too, and disagree.
            let (indices, fitting): (Vec<usize>, Vec<RowAnswer<'_>>) = rows
                .iter()
                .enumerate()
                .filter(|(index, _)| unfit.binary_search(index).is_err())
                .map(|(index, row)| (index, *row))
                .unzip();
            match find_format(&fitting) {
                FormatSearch::Ambiguous { formats, row } => Err((formats, indices[row])),
                FormatSearch::Fits(_) | FormatSearch::None { .. } => Ok(best),
            }
        }
    }
}

/// Error message for an answer that identifies a different option in each of two formats.
fn ambiguous_answer(
    table: &SetRows,
    item: &RowQuestion,
    RowAnswer { answer, options }: RowAnswer<'_>,
    formats: [AnswerFormat; 2],
    column: &SetColumn,
) -> String {
    let [one, other] = formats.map(AnswerFormat::name);
    let [one_flag, other_flag] = formats.map(|format| map_flag(ColumnRole::Answer, &column.name, Some(format)));
    format!(
        "{}: the answer {:?} may be read as {one} or as {other}, which differ among the options {}; {one_flag} or {other_flag} says which is meant",
        table.place_in_set(item.row),
        excerpt(answer, 60),
        options.excerpt(120),
    )
}

/// Adds the yes/no questions with their correct options to `truths`. The other questions without options are
/// open-ended: they are added to the omissions.
fn add_yes_no_questions(
    table: &SetRows,
    roles: &ColumnRoles,
    items: Vec<RowQuestion>,
    omissions: &mut Omissions,
    truths: &mut SetTruths,
) -> Result<(), String> {
    if items.is_empty() {
        return Ok(());
    }
    let column = answer_column::yes_or_no_column(table, roles, &items)?;
    let items = with_answers(table, column, items, omissions, None)?;
    let verb_questions = items.iter().filter(|(item, _)| asks_yes_or_no(last_line(&item.text))).count();
    let digits_mean_yes_no = verb_questions as f64 >= MIN_VERB_SHARE * items.len() as f64
        && items.iter().all(|(_, answer)| digit_index(answer).is_some());
    let yes_and_no: Arc<[String]> = ["yes", "no"].map(str::to_owned).into();
    let mut count = 0;
    for (RowQuestion { row, text, .. }, answer) in items {
        let digit = if digits_mean_yes_no { digit_index(&answer) } else { None };
        let truth = digit.or_else(|| yes_no_index(&answer));
        match Choices::with_truth(Arc::clone(&yes_and_no), truth) {
            Ok(choices) if choices.truth().is_some() => {
                count += 1;
                truths.questions.push(SetQuestion { row, text, choices });
            }
            Ok(_) | Err(_) => omissions.add(RowOmission::Open, || format!("{:?}", excerpt(&answer, 60))),
        }
    }
    if count > 0 {
        let digits = if digits_mean_yes_no { ", 1 is yes" } else { "" };
        truths.columns.push(format!("{} (yes/no{digits})", column.name));
    }
    Ok(())
}

/// Last line of a text: the question, even if a hint precedes it.
fn last_line(text: &str) -> &str {
    text.lines().next_back().unwrap_or(text)
}
