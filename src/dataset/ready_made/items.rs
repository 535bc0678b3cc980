//! The rows of a set as questions without their truth: [`items`].

use super::images::{ImagesAre, RowImage, images, named_frames};
use super::left_out::{LeftOut, Why};
use super::lettered::{Lettered, in_question};
use super::map::flag;
use super::names::{Role, without_endings};
use super::offered::Offered;
use super::options::Options;
use super::roles::{InQuestion, Roles};
use super::row::{Row, Table};
use std::collections::BTreeMap;
use std::sync::LazyLock;

use regex::Regex;

/// The maximum length of a question or an option, in bytes.
const LONGEST_TEXT: usize = 16 << 10;

/// The place of an image in a text.
static IMAGE_MARK: LazyLock<Option<Regex>> =
    LazyLock::new(|| Regex::new(r"<image(?: ?\d+)?>\s*").ok());

/// A row as a question. Its truth is not known yet.
#[derive(Debug)]
pub(super) struct Item {
    pub(super) row: usize,
    pub(super) image: RowImage,
    pub(super) text: String,
    /// The text with the options in it, if they were found there.
    pub(super) whole: Option<String>,
    /// The options; `None` if neither columns nor the question hold any.
    pub(super) options: Option<Offered>,
}

impl Item {
    /// The question as it stands, without the options that were found in it.
    pub(super) fn without_options(self) -> Self {
        let text = self.whole.unwrap_or(self.text);
        Self {
            text,
            whole: None,
            options: None,
            ..self
        }
    }
}

/// What is done about instructions at the end of questions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Endings {
    Cut,
    Kept,
}

/// How often each instruction was cut from questions.
pub(super) type Cut = BTreeMap<String, usize>;

/// The rows as questions. Rows that cannot be asked are counted.
///
/// # Errors
/// If two columns of options differ; the error shows the row and the two commands.
pub(super) fn items(
    table: &Table,
    roles: &Roles,
    kind: ImagesAre,
    ending: Endings,
    left: &mut LeftOut,
    cut: &mut Cut,
) -> Result<Vec<Item>, String> {
    let mut items = Vec::new();
    for (at, row) in table.rows.iter().enumerate() {
        let mut found = match kind {
            ImagesAre::Files => images(table, row, roles),
            ImagesAre::Frames => named_frames(row, roles),
        };
        let count = found.len();
        let Some(image) = found.pop().filter(|_| count == 1) else {
            let why = if count == 0 {
                Why::NoImage
            } else {
                Why::SeveralImages
            };
            left.add(why, || format!("{count} images"));
            continue;
        };
        let item = match item(table, at, roles, ending, cut)? {
            Ok(Parts {
                text,
                whole,
                options,
            }) => Item {
                row: at,
                image,
                text,
                whole,
                options,
            },
            Err(problem) => {
                left.add(Why::Bad, || format!("{}: {problem}", table.place(at)));
                continue;
            }
        };
        items.push(item);
    }
    Ok(items)
}

/// The text and the options of a row.
struct Parts {
    text: String,
    whole: Option<String>,
    options: Option<Offered>,
}

/// The parts of a row; the inner error is the fault of a bad row.
fn item(
    table: &Table,
    at: usize,
    roles: &Roles,
    ending: Endings,
    cut: &mut Cut,
) -> Result<Result<Parts, String>, String> {
    let row = &table.rows[at];
    let Some(text) = roles.question.text(row) else {
        let column = &roles.question.name;
        return Ok(Err(format!("the question is empty (column {column:?})")));
    };
    if text.len() > LONGEST_TEXT {
        let problem = format!("a question of more than {} KB", LONGEST_TEXT >> 10);
        return Ok(Err(problem));
    }
    let text = match &*IMAGE_MARK {
        Some(mark) => mark.replace_all(&text, "").trim().to_owned(),
        None => text,
    };
    let mut without = |text: &str| {
        if ending == Endings::Kept {
            return text.to_owned();
        }
        let (rest, endings) = without_endings(text);
        for ending in endings {
            *cut.entry(ending).or_default() += 1;
        }
        rest.to_owned()
    };
    let (text, whole, options) = match Options::of(row, roles) {
        Options::Found(options) => (without(&text), None, Some(options)),
        Options::None if roles.in_question == InQuestion::None => (without(&text), None, None),
        Options::None => {
            let text = without(&text);
            match in_question(&text) {
                Lettered::Found { question, options } => {
                    let options = Offered::lettered(options);
                    (without(&question), Some(text), Some(options))
                }
                Lettered::None => (text, None, None),
                Lettered::Unclear(problem) => return Ok(Err(problem)),
            }
        }
        Options::Differ([one, other]) => {
            return Err(format!(
                "{}: the options of {one:?} and {other:?} differ; {} or {} says which are meant",
                table.place(at),
                flag(Role::Options, &one, None),
                flag(Role::Options, &other, None)
            ));
        }
        Options::Unread(problem) => return Ok(Err(problem)),
    };
    if text.is_empty() {
        return Ok(Err("nothing but options in the question".to_owned()));
    }
    let hint = roles.hint.as_ref().and_then(|hint| hint.text(row));
    let below = |text: String| match &hint {
        Some(hint) => format!("{}\n{text}", hint.trim()),
        None => text,
    };
    let (text, whole) = (below(text), whole.map(below));
    let is_long = |text: &String| text.len() > LONGEST_TEXT;
    if is_long(&text)
        || options
            .iter()
            .flat_map(|options| &options.texts)
            .any(is_long)
    {
        let problem = format!("a text of more than {} KB", LONGEST_TEXT >> 10);
        return Ok(Err(problem));
    }
    Ok(Ok(Parts {
        text,
        whole,
        options,
    }))
}

/// The answer in a column of a row, as text; a list of one is that one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum AnswerCell {
    Absent,
    One(String),
    Several(String),
}

impl AnswerCell {
    pub(super) fn of(row: &Row, column: &super::roles::Column) -> Self {
        use super::cell::Cell;
        let cell = column.of(row);
        let items = match cell {
            Cell::List(cells) => cells.iter().map(Cell::text).collect(),
            Cell::Text(text) => super::text_list::list(text),
            _ => None,
        };
        match (items.as_deref(), cell.text()) {
            (Some([only]), _) => Self::One(only.clone()),
            (Some([]), _) | (None, None) => Self::Absent,
            (Some(_), _) => Self::Several(cell.shown(60)),
            (None, Some(text)) if text.trim().eq_ignore_ascii_case("nan") => Self::Absent,
            (None, Some(text)) => Self::One(text.trim().to_owned()),
        }
    }
}
