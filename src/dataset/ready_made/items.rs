//! The rows of a set as questions without their truth: [`items`].

use super::cells::{Row, Table, Turns};
use super::choices::{AllOffered, Lettered, Offered, Options, in_question};
use super::columns::map::flag;
use super::columns::names::{Role, without_endings};
use super::columns::{Asked, Column, InQuestion, Roles};
use super::omissions::{LeftOut, Why};
use super::pictures::{ImageMarks, ImagesAre};
use super::settings::{SetArgs, SeveralImages};
use crate::types::text::excerpt;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The maximum length of a question or an option, in bytes.
const LONGEST_TEXT: usize = 16 << 10;

/// A row as a question. Its truth is not known yet.
#[derive(Debug)]
pub(super) struct Item {
    pub(super) row: usize,
    pub(super) text: String,
    /// The text with the options in it, if they were found there.
    pub(super) whole: Option<String>,
    /// The options; `None` if neither columns nor the question hold any.
    pub(super) options: Option<Arc<Offered>>,
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

/// How often each instruction was cut from questions.
pub(super) type Cut = BTreeMap<String, usize>;

/// The instructions at the end of questions, with how often each was cut; `None` if they stay.
struct Endings<'a>(Option<&'a mut Cut>);

impl Endings<'_> {
    /// The text without the instructions at its end.
    fn cut(&mut self, text: &str) -> String {
        let Some(cut) = &mut self.0 else {
            return text.to_owned();
        };
        let (rest, endings) = without_endings(text);
        for ending in endings {
            *cut.entry(ending).or_default() += 1;
        }
        rest.to_owned()
    }
}

/// The rows as questions. Rows that cannot be asked are counted.
///
/// # Errors
/// If two columns of options differ; the error shows the row and the two commands.
pub(super) fn items(
    table: &Table,
    roles: &Roles,
    kind: ImagesAre,
    args: &SetArgs,
    left: &mut LeftOut,
    cut: &mut Cut,
) -> Result<Vec<Item>, String> {
    let mut endings = Endings((!args.keep_instructions).then_some(cut));
    let (mut items, mut offered) = (Vec::new(), AllOffered::default());
    for (at, row) in table.rows.iter().enumerate() {
        let count = kind.in_row(row, roles).len();
        let why = match (count, args.multi_image) {
            (0, _) => Some(Why::NoImage),
            (1, _) | (_, Some(SeveralImages::Send)) => None,
            (_, Some(SeveralImages::Skip) | None) => Some(Why::SeveralImages),
        };
        if let Some(why) = why {
            left.add(why, || format!("{count} images"));
            continue;
        }
        match parts(row, roles, ImageMarks::new(count), &mut endings) {
            Ok(Parts {
                text,
                whole,
                options,
            }) => items.push(Item {
                row: at,
                text,
                whole,
                options: options.map(|options| offered.once(options)),
            }),
            Err(NoParts::BadRow(problem)) => {
                left.add(Why::Bad, || format!("{}: {problem}", table.place(at)));
            }
            Err(NoParts::BadSet(problem)) => return Err(format!("{}: {problem}", table.place(at))),
        }
    }
    Ok(items)
}

/// The text and the options of a row.
struct Parts {
    text: String,
    whole: Option<String>,
    options: Option<Offered>,
}

/// Why a row has no [`Parts`].
enum NoParts {
    /// The row is bad, in words.
    BadRow(String),
    /// The set cannot be read, in words.
    BadSet(String),
}

/// A bad row.
fn bad(problem: impl Into<String>) -> NoParts {
    NoParts::BadRow(problem.into())
}

/// The parts of a row.
fn parts(
    row: &Row,
    roles: &Roles,
    mut marks: ImageMarks,
    endings: &mut Endings<'_>,
) -> Result<Parts, NoParts> {
    let [hint, text] = words(row, roles, &mut marks).map_err(NoParts::BadRow)?;
    let (text, whole, options) = match Options::from_row(row, roles) {
        Options::Found(mut options) => {
            let texts = options.texts.iter().map(|option| marks.read_option(option));
            options.texts = texts.collect::<Result<_, _>>().map_err(NoParts::BadRow)?;
            (endings.cut(&text), None, Some(options))
        }
        Options::None if roles.in_question == InQuestion::None => (endings.cut(&text), None, None),
        Options::None => {
            let text = endings.cut(&text);
            match in_question(&text) {
                Lettered::Found { question, options } => {
                    let options = Offered::lettered(&options);
                    (endings.cut(&question), Some(text), Some(options))
                }
                Lettered::None => (text, None, None),
                Lettered::Unclear(problem) => return Err(NoParts::BadRow(problem)),
            }
        }
        Options::Differ([one, other]) => {
            return Err(NoParts::BadSet(format!(
                "the options of {one:?} and {other:?} differ; {} or {} says which are meant",
                flag(Role::Options, &one, None),
                flag(Role::Options, &other, None)
            )));
        }
        Options::Unread(problem) => return Err(NoParts::BadRow(problem)),
    };
    if text.is_empty() {
        return Err(bad("nothing but options in the question"));
    }
    let below = |text: String| match &*hint {
        "" => text,
        hint => format!("{hint}\n{text}"),
    };
    let (text, whole) = (below(text), whole.map(below));
    let texts = options.iter().flat_map(|options| &*options.texts);
    if texts.chain([&text]).any(|text| text.len() > LONGEST_TEXT) {
        return Err(bad(format!(
            "a text of more than {} KB",
            LONGEST_TEXT >> 10
        )));
    }
    Ok(Parts {
        text,
        whole,
        options,
    })
}

/// The hint of a row, empty if it has none, and its question.
fn words(row: &Row, roles: &Roles, marks: &mut ImageMarks) -> Result<[String; 2], String> {
    let text = match &roles.question {
        Asked::InImage => Asked::IN_IMAGE.to_owned(),
        Asked::Column(column) => {
            // A list or struct in a text of JSON, as tables hold conversations, is no question either.
            let text = column.text(row);
            let text = text.filter(|_| column.cell(row).parsed().is_none());
            text.ok_or_else(|| no_text(column, row))?
        }
    };
    if text.len() > LONGEST_TEXT {
        let longest = LONGEST_TEXT >> 10;
        return Err(format!("a question of more than {longest} KB"));
    }
    let hint = roles.hint.as_ref().and_then(|hint| hint.text(row));
    let hint = marks.read(hint.as_deref().unwrap_or_default().trim())?;
    Ok([hint, marks.read(&text)?])
}

/// The problem of a cell of a question that holds no text.
fn no_text(column: &Column, row: &Row) -> String {
    let (cell, name) = (column.cell(row), excerpt(&column.name, 60));
    if cell.is_absent() {
        return format!("the question is empty (column {name:?})");
    }
    let inner = Turns::from_cell(&column.name, cell).map_or_else(String::new, |turns| {
        format!(
            "; {} reads its text",
            flag(Role::Question, &turns.question, None)
        )
    });
    let kind = cell.parsed().map_or(cell.kind(), |parsed| parsed.kind());
    format!(
        "the column {name:?} of the question holds a {kind}, not a text: {}{inner}",
        cell.shown(60)
    )
}

/// The answer in a column of a row, as text; a list of one is that one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum AnswerCell {
    Absent,
    One(String),
    Several(String),
}

impl AnswerCell {
    pub(super) fn from_row(row: &Row, column: &Column) -> Self {
        use super::cells::Cell;
        let cell = column.cell(row);
        let items = match cell {
            Cell::List(cells) => cells.iter().map(Cell::text).collect(),
            Cell::Text(text) => super::cells::list(text),
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
