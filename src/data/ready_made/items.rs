//! Conversion of a data set's rows to questions, without their correct answers: [`items`].

use std::collections::BTreeMap;
use std::sync::Arc;

use super::cells::{Cell, ConversationPaths, Row, SetRows, parse_list};
use super::choices::{LetteredOptions, OptionInterner, OptionList, Options, find_in_question};
use super::columns::map::map_flag;
use super::columns::{ColumnRoles, OptionsInQuestion, QuestionSource, SetColumn};
use super::omissions::{Omissions, RowOmission};
use super::pictures::{ImageForm, ImageMarks};
use super::settings::{SetArgs, SeveralImages};
use crate::ready_made::columns::map::{ColumnRole, split_instructions};
use darkqa_base::types::text::excerpt;

/// Maximum length of a question or an option, in bytes.
const MAX_TEXT_BYTES: usize = 16 << 10;

/// The question of a row. Its correct answer is not known yet.
#[derive(Debug)]
pub(super) struct RowQuestion {
    /// Index of the row in the table.
    pub(super) row: usize,
    /// The question without its options.
    pub(super) text: String,
    /// The question with its options, if they were found in its text.
    pub(super) whole: Option<String>,
    /// The options; `None` if neither a column nor the question has options.
    pub(super) options: Option<Arc<OptionList>>,
}

impl RowQuestion {
    /// The item as an open question. Options that were found in the question stay in its text.
    pub(super) fn without_options(self) -> Self {
        let text = self.whole.unwrap_or(self.text);
        Self { text, whole: None, options: None, ..self }
    }
}

/// Number of times that each instruction was cut from a question.
pub(super) type InstructionCounts = BTreeMap<String, usize>;

/// Cuts instructions from the end of questions and counts them; `None` keeps the instructions.
struct InstructionCutter<'a>(Option<&'a mut InstructionCounts>);

impl InstructionCutter<'_> {
    /// The text without the instructions at its end.
    fn cut(&mut self, text: &str) -> String {
        let Some(counts) = &mut self.0 else {
            return text.to_owned();
        };
        let (rest, instructions) = split_instructions(text);
        for instruction in instructions {
            *counts.entry(instruction).or_default() += 1;
        }
        rest.to_owned()
    }
}

/// Converts the rows to questions. Counts rows without a usable question in `omissions` and the instructions cut in
/// `cut`.
///
/// # Errors
/// If two columns have different options. The message contains the row and the two flags to choose from.
pub(super) fn items(
    table: &SetRows,
    roles: &ColumnRoles,
    form: ImageForm,
    args: &SetArgs,
    omissions: &mut Omissions,
    cut: &mut InstructionCounts,
) -> Result<Vec<RowQuestion>, String> {
    let mut cutter = InstructionCutter((!args.keep_instructions).then_some(cut));
    let (mut items, mut interner) = (Vec::new(), OptionInterner::default());
    for (index, image_count) in rows_with_images(table, roles, form, args, omissions) {
        let row = &table.rows[index];
        match question_parts(row, roles, ImageMarks::new(image_count), &mut cutter) {
            Ok(QuestionParts { text, whole, options }) => {
                items.push(RowQuestion {
                    row: index,
                    text,
                    whole,
                    options: options.map(|options| interner.intern(options)),
                });
            }
            Err(PartsError::Row(problem)) => {
                omissions.add(RowOmission::Bad, || format!("{}: {problem}", table.place_in_set(index)));
            }
            Err(PartsError::Set(problem)) => {
                return Err(format!("{}: {problem}", table.place_in_set(index)));
            }
        }
    }
    Ok(items)
}

/// The rows with an image, or with several that may be sent, and the number of images of each. Counts the other rows in
/// `omissions`.
pub(super) fn rows_with_images(
    table: &SetRows,
    roles: &ColumnRoles,
    form: ImageForm,
    args: &SetArgs,
    omissions: &mut Omissions,
) -> Vec<(usize, usize)> {
    let mut rows = Vec::with_capacity(table.rows.len());
    for (index, row) in table.rows.iter().enumerate() {
        let image_count = form.in_row(row, roles).len();
        let reason = match (image_count, args.multi_image) {
            (0, _) => Some(RowOmission::NoImage),
            (1, _) | (_, Some(SeveralImages::Send)) => None,
            (_, Some(SeveralImages::Skip) | None) => Some(RowOmission::SeveralImages),
        };
        match reason {
            Some(reason) => omissions.add(reason, || format!("{image_count} images")),
            None => rows.push((index, image_count)),
        }
    }
    rows
}

/// The question and the options of a row, as in [`RowQuestion`].
struct QuestionParts {
    text: String,
    whole: Option<String>,
    options: Option<OptionList>,
}

/// Error message for a row without [`QuestionParts`].
enum PartsError {
    /// The row has no usable question; other rows may have one.
    Row(String),
    /// The whole set cannot be read.
    Set(String),
}

/// Reads the question and the options of a row.
fn question_parts(
    row: &Row,
    roles: &ColumnRoles,
    mut marks: ImageMarks,
    cutter: &mut InstructionCutter<'_>,
) -> Result<QuestionParts, PartsError> {
    let [hint, text] = hint_and_question(row, roles, &mut marks).map_err(PartsError::Row)?;
    let (text, whole, options) = match Options::from_row(row, roles) {
        Options::Found(mut options) => {
            options.texts = options
                .texts
                .iter()
                .map(|option| marks.read_option(option))
                .collect::<Result<_, _>>()
                .map_err(PartsError::Row)?;
            (cutter.cut(&text), None, Some(options))
        }
        Options::None if roles.in_question == OptionsInQuestion::None => (cutter.cut(&text), None, None),
        Options::None => {
            let text = cutter.cut(&text);
            match find_in_question(&text) {
                LetteredOptions::Found { question, options } => {
                    let options = OptionList::from_question(&options);
                    (cutter.cut(&question), Some(text), Some(options))
                }
                LetteredOptions::None => (text, None, None),
                LetteredOptions::Unclear(problem) => return Err(PartsError::Row(problem)),
            }
        }
        Options::Differ([one, other]) => {
            return Err(PartsError::Set(format!(
                "the options of {one:?} and {other:?} differ; {} or {} says which are meant",
                map_flag(ColumnRole::Options, &one, None),
                map_flag(ColumnRole::Options, &other, None)
            )));
        }
        Options::Unread(problem) => return Err(PartsError::Row(problem)),
    };
    if text.is_empty() {
        let problem = "nothing but options in the question";
        return Err(PartsError::Row(problem.to_owned()));
    }
    let (text, whole) = (prepend_hint(&hint, text), whole.map(|text| prepend_hint(&hint, text)));
    let is_too_long =
        options.iter().flat_map(|options| &*options.texts).chain([&text]).any(|text| text.len() > MAX_TEXT_BYTES);
    if is_too_long {
        return Err(PartsError::Row(format!("a text of more than {} KB", MAX_TEXT_BYTES >> 10)));
    }
    Ok(QuestionParts { text, whole, options })
}

fn prepend_hint(hint: &str, text: String) -> String {
    match hint {
        "" => text,
        hint => format!("{hint}\n{text}"),
    }
}

/// The hint of a row (empty if it has none) and its question, in this order.
///
/// # Errors
/// If the row has no question, the question is too long, or its image marks cannot be read.
fn hint_and_question(row: &Row, roles: &ColumnRoles, marks: &mut ImageMarks) -> Result<[String; 2], String> {
    let text = match &roles.question {
        QuestionSource::Image => QuestionSource::IN_IMAGE_TEXT.to_owned(),
        QuestionSource::Column(column) => {
            // A text with a JSON list or object, such as a conversation, is not a question.
            column
                .text(row)
                .filter(|_| column.cell(row).parsed().is_none())
                .ok_or_else(|| no_question_text(column, row))?
        }
    };
    if text.len() > MAX_TEXT_BYTES {
        let longest = MAX_TEXT_BYTES >> 10;
        return Err(format!("a question of more than {longest} KB"));
    }
    let hint = roles.hint.as_ref().and_then(|hint| hint.text(row));
    let hint = marks.read(hint.as_deref().unwrap_or_default().trim())?;
    Ok([hint, marks.read(&text)?])
}

/// Error message for a cell without the text of a question.
fn no_question_text(column: &SetColumn, row: &Row) -> String {
    let (cell, name) = (column.cell(row), excerpt(&column.name, 60));
    if cell.is_absent() {
        return format!("the question is empty (column {name:?})");
    }
    let conversation_hint = ConversationPaths::from_cell(&column.name, cell).map_or_else(String::new, |paths| {
        format!("; {} reads its text", map_flag(ColumnRole::Question, &paths.question, None))
    });
    let kind = cell.parsed().map_or(cell.kind(), |parsed| parsed.kind());
    format!("the column {name:?} of the question holds a {kind}, not a text: {}{conversation_hint}", cell.excerpt(60))
}

/// The answer in a cell, as text. A list with one item is that item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum AnswerCell {
    /// The cell has no text, is an empty list, or is `nan`.
    Absent,
    One(String),
    /// A list with several items: an excerpt of the cell.
    Several(String),
}

impl AnswerCell {
    pub(super) fn from_row(row: &Row, column: &SetColumn) -> Self {
        let cell = column.cell(row);
        let items = match cell {
            Cell::List(cells) => cells.iter().map(Cell::text).collect(),
            Cell::Text(text) => parse_list(text),
            _ => None,
        };
        match (items.as_deref(), cell.text()) {
            (Some([only]), _) => Self::One(only.clone()),
            (Some([]), _) | (None, None) => Self::Absent,
            (Some(_), _) => Self::Several(cell.excerpt(60)),
            (None, Some(text)) if text.trim().eq_ignore_ascii_case("nan") => Self::Absent,
            (None, Some(text)) => Self::One(text.trim().to_owned()),
        }
    }
}
