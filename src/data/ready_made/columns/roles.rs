//! Roles of the columns of a set: [`ColumnRoles`].
//!
//! Templates for the names of image files: [`Template`].

use std::collections::BTreeSet;

use super::column::SetColumn;
use super::map::{CellFormat, ColumnMap, ColumnRole, known_names, map_flag, normalize};
use crate::ready_made::cells::{Cell, ConversationPaths, Row, SetRows};
use darkqa_base::types::Choices;
use darkqa_base::types::questions::letter;
use darkqa_base::types::text::excerpt;

/// Columns by role. If a role has several columns, they are in order of preference.
#[derive(Debug)]
pub(crate) struct ColumnRoles {
    pub question: QuestionSource,
    pub images: ImageColumns,
    /// Columns with all options of a row in one cell.
    pub option_lists: Vec<SetColumn>,
    /// Columns with one option each, in order.
    pub option_cells: Vec<SetColumn>,
    pub answers: Vec<SetColumn>,
    pub ids: Vec<SetColumn>,
    pub hint: Option<SetColumn>,
    pub families: FamilyColumns,
    pub evidence: Option<SetColumn>,
    pub scene: Option<SetColumn>,
    /// Text between the options in one cell, if given by the user.
    pub option_separator: Option<String>,
    pub in_question: OptionsInQuestion,
}

/// Source of the text of a question.
#[derive(Debug)]
pub(crate) enum QuestionSource {
    Column(SetColumn),
    /// The question is in the image, according to the user. The prompt only refers to it.
    Image,
}

impl QuestionSource {
    /// Text of a question that is in its image.
    pub(crate) const IN_IMAGE_TEXT: &str = "Answer the question in the image.";

    /// Column of the text; `None` if the question is in the image.
    pub(crate) fn column(&self) -> Option<&SetColumn> {
        match self {
            Self::Column(column) => Some(column),
            Self::Image => None,
        }
    }
}

/// Columns of the families.
#[derive(Debug)]
pub(crate) enum FamilyColumns {
    /// Candidates by their names, in order of preference.
    Candidates(Vec<SetColumn>),
    /// Column given by the user, or none.
    Chosen(Option<SetColumn>),
}

impl FamilyColumns {
    fn as_slice(&self) -> &[SetColumn] {
        match self {
            Self::Candidates(columns) => columns,
            Self::Chosen(column) => column.as_slice(),
        }
    }
}

/// Treatment of options in the text of a question, if the row has no columns of options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OptionsInQuestion {
    Search,
    /// There are no options, according to the user.
    None,
}

/// Columns of the images.
#[derive(Debug)]
pub(crate) enum ImageColumns {
    /// The first of these columns with an image.
    First(Vec<SetColumn>),
    /// All of these columns.
    All(Vec<SetColumn>),
    /// The file named by a template.
    Template(Template),
}

impl ColumnRoles {
    /// Assigns roles to the columns of a table, by the map, else by their names.
    ///
    /// # Errors
    /// If a column of the map does not exist, there is no question column, or a row has several questions.
    pub(crate) fn new(table: &SetRows, map: &ColumnMap) -> Result<Self, String> {
        let question = columns_of(table, map, ColumnRole::Question)?;
        refuse_several_questions(table, map)?;
        let question = match (question.into_iter().next(), map.entry(ColumnRole::Question)) {
            (Some(column), _) => QuestionSource::Column(column),
            (None, Some(_)) => QuestionSource::Image,
            (None, None) => return Err(no_question(table, map)?),
        };
        Self::with_question(table, map, question)
    }

    /// Assigns roles to the columns of a table whose question comes from elsewhere.
    ///
    /// # Errors
    /// If a column of the map does not exist.
    pub(crate) fn with_question(table: &SetRows, map: &ColumnMap, question: QuestionSource) -> Result<Self, String> {
        let options_entry = map.entry(ColumnRole::Options);
        let options = columns_of(table, map, ColumnRole::Options)?;
        let (option_lists, option_cells) = match options_entry {
            Some(_) if options.len() > 1 => (Vec::new(), options),
            Some(_) => (options, Vec::new()),
            None => (options, option_cells(table)),
        };
        let evidence = columns_of(table, map, ColumnRole::Evidence)?.into_iter().next();
        Ok(Self {
            question,
            images: image_columns(table, map)?,
            option_lists,
            option_cells,
            answers: columns_of(table, map, ColumnRole::Answer)?,
            ids: columns_of(table, map, ColumnRole::Id)?,
            hint: columns_of(table, map, ColumnRole::Hint)?.into_iter().next(),
            families: match map.entry(ColumnRole::Family) {
                Some(_) => FamilyColumns::Chosen(columns_of(table, map, ColumnRole::Family)?.into_iter().next()),
                None => FamilyColumns::Candidates(columns_of(table, map, ColumnRole::Family)?),
            },
            evidence,
            scene: columns_of(table, map, ColumnRole::Scene)?.into_iter().next(),
            in_question: match options_entry {
                Some(entry) if entry.columns.is_empty() => OptionsInQuestion::None,
                _ => OptionsInQuestion::Search,
            },
            option_separator: options_entry.and_then(|entry| match &entry.format {
                CellFormat::Split(separator) => Some(separator.clone()),
                CellFormat::Inferred | CellFormat::Answer(_) => None,
            }),
        })
    }

    /// Columns of the question text, its options and its answer.
    fn question_columns(&self) -> impl Iterator<Item = &SetColumn> {
        self.question
            .column()
            .into_iter()
            .chain(&self.hint)
            .chain(&self.option_lists)
            .chain(&self.option_cells)
            .chain(&self.answers)
    }

    /// Columns that are not read again after the questions are parsed. Images, ids, families, evidence and scenes are
    /// read later.
    pub(crate) fn columns_to_clear(&self) -> BTreeSet<usize> {
        let (ImageColumns::First(images) | ImageColumns::All(images)) = &self.images else {
            // A template may name any column.
            return BTreeSet::new();
        };
        let needed: BTreeSet<usize> = images
            .iter()
            .chain(&self.ids)
            .chain(self.families.as_slice())
            .chain(&self.evidence)
            .chain(&self.scene)
            .map(|column| column.index)
            .collect();
        self.question_columns().map(|column| column.index).filter(|index| !needed.contains(index)).collect()
    }

    /// True if the column is used for a question, image, id or family.
    pub(super) fn uses(&self, index: usize) -> bool {
        let images = match &self.images {
            ImageColumns::First(columns) | ImageColumns::All(columns) => columns.as_slice(),
            ImageColumns::Template(_) => &[],
        };
        images
            .iter()
            .chain(self.families.as_slice())
            .chain(&self.ids)
            .chain(self.question_columns())
            .any(|column| column.index == index)
    }
}

/// Columns of a role: those in the map, else those with a known name, in order of preference.
fn columns_of(table: &SetRows, map: &ColumnMap, role: ColumnRole) -> Result<Vec<SetColumn>, String> {
    if let Some(entry) = map.entry(role) {
        if entry.columns.len() > 1
            && let Some(index) = table.find(&entry.unsplit)
        {
            return Ok(vec![SetColumn::new(index, &entry.unsplit)]);
        }
        return entry.columns.iter().map(|name| find_column(table, name)).collect();
    }
    Ok(known_names(role)
        .iter()
        .flat_map(|name| {
            table
                .columns
                .iter()
                .enumerate()
                .filter(move |(_, column)| normalize(column) == *name)
                .map(|(index, column)| SetColumn::new(index, column))
        })
        .collect())
}

/// Columns of images: by the map, else by their names and numbers.
fn image_columns(table: &SetRows, map: &ColumnMap) -> Result<ImageColumns, String> {
    let entry = map.entry(ColumnRole::Image);
    if let Some([template]) = entry.map(|entry| &*entry.columns)
        && template.contains('{')
    {
        return Template::parse(table, template, |name| find_column(table, name)).map(ImageColumns::Template);
    }
    let columns = columns_of(table, map, ColumnRole::Image)?;
    if entry.is_some() && columns.len() > 1 {
        return Ok(ImageColumns::All(columns));
    }
    let numbered = numbered_columns(table, &["image", "img"]);
    match columns.first() {
        None => Ok(ImageColumns::All(numbered)),
        Some(_) if numbered.is_empty() => Ok(ImageColumns::First(columns)),
        // With numbered columns, a column without a number has one of several images.
        Some(first) => Ok(ImageColumns::All(std::iter::once(first.clone()).chain(numbered).collect())),
    }
}

/// Column without a role that most likely has the questions: the one with most texts that end in a question mark, else
/// with most texts.
fn likely_question_column(table: &SetRows) -> Option<&String> {
    let known: BTreeSet<&String> = ColumnRole::ALL.iter().flat_map(|role| known_names(*role)).collect();
    let option_cells = option_cells(table);
    table
        .columns
        .iter()
        .enumerate()
        .filter(|(_, name)| {
            !known.contains(&normalize(name)) && !option_cells.iter().any(|column| column.name == **name)
        })
        .map(|(index, name)| {
            let texts: Vec<&String> = table
                .rows
                .iter()
                .filter_map(|row| match row.cell(index) {
                    Cell::Text(text) => Some(text),
                    _ => None,
                })
                .collect();
            let questions = texts.iter().filter(|text| text.trim_end().ends_with(['?', '？'])).count();
            (questions, texts.len(), name)
        })
        .filter(|(_, texts, _)| *texts > 0)
        .max_by_key(|(questions, texts, _)| (*questions, *texts))
        .map(|(_, _, name)| name)
}

/// Error message for a table without a question column, with the `--map` flag that most likely helps.
fn no_question(table: &SetRows, map: &ColumnMap) -> Result<String, String> {
    let has_images = embedded_images(table).is_some();
    let [options, answers] = [ColumnRole::Options, ColumnRole::Answer].map(|role| columns_of(table, map, role));
    let is_unanswerable = options?.is_empty() && answers?.is_empty();
    let remedy = match (ConversationPaths::find(table), likely_question_column(table)) {
        (Some(ConversationPaths { question, answer }), _) => {
            let answer = answer.map_or_else(String::new, |path| format!(",answer={path}"));
            format!(
                "it holds conversations, whose first question is read with {}",
                map_flag(ColumnRole::Question, &format!("{question}{answer}"), None)
            )
        }
        (None, Some(name)) => format!(
            "say which is which, e.g. {}; {} if it stands in the image",
            map_flag(ColumnRole::Question, name, None),
            map_flag(ColumnRole::Question, "", None)
        ),
        (None, None) if is_unanswerable && has_images => {
            "--ask home asks questions of its own about the images".to_owned()
        }
        (None, None) => format!(
            "if the question stands in the image, {} asks {:?}; else say which is which: --map question=COLUMN,image=COLUMN,options=COLUMN,answer=COLUMN",
            map_flag(ColumnRole::Question, "", None),
            QuestionSource::IN_IMAGE_TEXT
        ),
    };
    Ok(format!("no question among its columns:\n{}\n {remedy}", describe_columns(table)))
}

/// A column with images in its cells.
pub(crate) fn embedded_images(table: &SetRows) -> Option<SetColumn> {
    let is_image = |cell: &Cell| match cell {
        Cell::Bytes(_) | Cell::File(_) => true,
        Cell::Fields(fields) => fields.iter().any(|(name, _)| &**name == "bytes"),
        _ => false,
    };
    let index = table.rows.iter().find_map(|row| (0..table.columns.len()).find(|index| is_image(row.cell(*index))))?;
    Some(SetColumn::new(index, &table.columns[index]))
}

/// Finds a column by its name, or a field of the structs in a column, such as `meta.source`.
///
/// # Errors
/// If there is no such column; the error lists the columns.
pub(crate) fn find_column(table: &SetRows, name: &str) -> Result<SetColumn, String> {
    if let Some(index) = table.find(name) {
        return Ok(SetColumn::new(index, name));
    }
    if let Some((column, field)) = name.split_once('.')
        && let Some(index) = table.find(column)
    {
        return Ok(SetColumn::with_field(index, column, field));
    }
    let similar = table
        .columns
        .iter()
        .find(|known| normalize(known) == normalize(name))
        .map_or_else(String::new, |similar| format!("; did you mean {similar:?}?"));
    Err(format!("--map names the column {name:?}, which is not there{similar}\n{}", describe_columns(table)))
}

/// Columns with one of these names and a number, in the order of their numbers.
fn numbered_columns(table: &SetRows, names: &[&str]) -> Vec<SetColumn> {
    let mut found: Vec<(u32, SetColumn)> = Vec::new();
    for (index, column) in table.columns.iter().enumerate() {
        let normalized = normalize(column);
        let number = names.iter().find_map(|name| normalized.strip_prefix(name)).and_then(|digits| digits.parse().ok());
        if let Some(number) = number {
            found.push((number, SetColumn::new(index, column)));
        }
    }
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, column)| column).collect()
}

/// Columns with one option each: `A`, `B`, … (at least these two), or `option0`, `option_a`, `choice_a` and so on.
fn option_cells(table: &SetRows) -> Vec<SetColumn> {
    let letters: Vec<SetColumn> = (0..Choices::MOST)
        .map_while(|option| {
            let name = letter(option).to_string();
            table.find(&name).map(|index| SetColumn::new(index, &name))
        })
        .collect();
    if letters.len() > 1 {
        return letters;
    }
    let numbered = numbered_columns(table, &["option", "choice"]);
    if numbered.len() > 1 {
        return numbered;
    }
    let named: Vec<SetColumn> = (0..Choices::MOST)
        .map_while(|option| {
            let letter = letter(option).to_ascii_lowercase();
            let names = [format!("option{letter}"), format!("choice{letter}")];
            let index = table.columns.iter().position(|column| names.contains(&normalize(column)))?;
            Some(SetColumn::new(index, &table.columns[index]))
        })
        .collect();
    if named.len() > 1 { named } else { Vec::new() }
}

/// Refuses a table with several questions per row, unless the map chooses one.
fn refuse_several_questions(table: &SetRows, map: &ColumnMap) -> Result<(), String> {
    let questions = numbered_columns(table, &["question"]);
    if questions.len() < 2 || map.entry(ColumnRole::Question).is_some() {
        return Ok(());
    }
    let names: Vec<&str> = questions.iter().map(|column| column.name.as_str()).collect();
    Err(format!(
        "several questions per row, in the columns {}; one question per row is read: write a row for each, or take the ones in a column \
         with {}",
        names.join(", "),
        map_flag(ColumnRole::Question, names[0], None)
    ))
}

/// Maximum number of columns in a message (chosen).
const MAX_LISTED_COLUMNS: usize = 40;

/// Maximum length of all values in a message about a table, in characters (chosen).
const MAX_VALUES_LENGTH: usize = 360;

/// Maximum length of a column name in a message, in characters (chosen).
const MAX_LISTED_NAME: usize = 40;

/// Lists the columns with their kinds and an example value, one per line.
pub(crate) fn describe_columns(table: &SetRows) -> String {
    let width = table.columns.iter().map(|name| name.chars().count()).max();
    let width = width.unwrap_or(0).min(24);
    let columns = table.columns.len().clamp(1, MAX_LISTED_COLUMNS);
    let max_value = (MAX_VALUES_LENGTH / columns).min(60);
    let mut lines: Vec<String> = table
        .columns
        .iter()
        .enumerate()
        .take(MAX_LISTED_COLUMNS)
        .map(|(index, name)| {
            let cell =
                table.rows.iter().map(|row| row.cell(index)).find(|cell| !cell.is_absent()).unwrap_or(&Cell::Absent);
            let name = excerpt(name, MAX_LISTED_NAME);
            format!("   {name:width$}  {:8} {}", cell.kind(), cell.excerpt(max_value))
        })
        .collect();
    if table.columns.len() > lines.len() {
        lines.push(format!("   and {} more", table.columns.len() - lines.len()));
    }
    lines.join("\n")
}

/// Maximum width of a number (chosen).
const MAX_WIDTH: usize = 64;

/// Name of an image file with columns in braces: `images/{id}.jpg`, or `images/{id:012}.jpg` for a number in twelve
/// digits.
#[derive(Debug)]
pub(crate) struct Template {
    text: String,
    parts: Vec<TemplatePart>,
}

#[derive(Debug)]
enum TemplatePart {
    /// Literal text.
    Literal(String),
    /// Text of a cell, with leading zeros up to a minimum width.
    Cell { column: SetColumn, width: usize },
}

impl Template {
    /// Parses a template for a table. `find_column` finds a column of the table by its name.
    ///
    /// # Errors
    /// If a brace or a column is missing.
    pub(super) fn parse(
        table: &SetRows,
        text: &str,
        find_column: impl Fn(&str) -> Result<SetColumn, String>,
    ) -> Result<Self, String> {
        let mut parts = Vec::new();
        let mut rest = text;
        while let Some((literal, after)) = rest.split_once('{') {
            let (field, after) = after.split_once('}').ok_or_else(|| format!("{text:?}: '}}' is missing"))?;
            parts.push(TemplatePart::Literal(literal.to_owned()));
            parts.push(parse_field(table, field, &find_column)?);
            rest = after;
        }
        parts.push(TemplatePart::Literal(rest.to_owned()));
        Ok(Self { text: text.to_owned(), parts })
    }

    /// Template as written by the user.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// Fills in the cells of a row; `None` if one is absent.
    pub(crate) fn fill(&self, row: &Row) -> Option<String> {
        self.parts
            .iter()
            .map(|part| match part {
                TemplatePart::Literal(text) => Some(text.clone()),
                TemplatePart::Cell { column, width } => {
                    let value = column.text(row)?;
                    Some(format!("{:0>width$}", value.trim()))
                }
            })
            .collect()
    }
}

/// Parses a field in braces: a column, or a column with a width in Python's notation, `id:012` or `id:012d`. A column
/// with the whole name takes precedence.
fn parse_field(
    table: &SetRows,
    field: &str,
    find_column: impl Fn(&str) -> Result<SetColumn, String>,
) -> Result<TemplatePart, String> {
    if table.find(field).is_none()
        && let Some((name, format)) = field.rsplit_once(':')
        && let Some(width) = parse_width(format)
    {
        if width > MAX_WIDTH {
            return Err(format!("{{{field}}}: a width of at most {MAX_WIDTH} expected"));
        }
        let column = find_column(name)?;
        return Ok(TemplatePart::Cell { column, width });
    }
    let column = find_column(field)?;
    Ok(TemplatePart::Cell { column, width: 0 })
}

/// Parses a width with leading zeros, such as `012`; `None` for other texts.
fn parse_width(format: &str) -> Option<usize> {
    let digits = format.strip_suffix('d').unwrap_or(format);
    digits.strip_prefix('0')?.parse().ok()
}
