//! Which column of a set is which: [`Roles`].

use std::collections::BTreeSet;

pub(in crate::dataset::ready_made) use super::column::Column;
use super::map::{CellFormat, Map, flag};
use super::names::{Role, known, plain};
use super::template::Template;
use crate::dataset::ready_made::cells::{Cell, Table, Turns};
use crate::types::Choices;
use crate::types::questions::letter;
use crate::types::text::excerpt;

/// The columns by role.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct Roles {
    pub(in crate::dataset::ready_made) question: Asked,
    /// The columns of images; the first that has any wins, or all of a numbered family.
    pub(in crate::dataset::ready_made) images: Images,
    /// Columns of lists or texts of options.
    pub(in crate::dataset::ready_made) options: Vec<Column>,
    /// Columns of one option each, in order.
    pub(in crate::dataset::ready_made) cells: Vec<Column>,
    pub(in crate::dataset::ready_made) answers: Vec<Column>,
    pub(in crate::dataset::ready_made) ids: Vec<Column>,
    pub(in crate::dataset::ready_made) hint: Option<Column>,
    pub(in crate::dataset::ready_made) families: Families,
    pub(in crate::dataset::ready_made) evidence: Option<Column>,
    pub(in crate::dataset::ready_made) scene: Option<Column>,
    pub(in crate::dataset::ready_made) split_options: Option<String>,
    pub(in crate::dataset::ready_made) in_question: InQuestion,
}

/// Where the text of a question stands.
#[derive(Debug)]
pub(in crate::dataset::ready_made) enum Asked {
    Column(Column),
    /// In the image, as the user states: the text only points there.
    InImage,
}

impl Asked {
    /// The text of questions that stand in their images.
    pub(in crate::dataset::ready_made) const IN_IMAGE: &str = "Answer the question in the image.";

    /// The column; `None` if there is none.
    pub(in crate::dataset::ready_made) fn column(&self) -> Option<&Column> {
        match self {
            Self::Column(column) => Some(column),
            Self::InImage => None,
        }
    }
}

/// The columns that may name families.
#[derive(Debug)]
pub(in crate::dataset::ready_made) enum Families {
    /// By their names, the best first.
    Known(Vec<Column>),
    /// The one that the user names, or none.
    Said(Option<Column>),
}

/// Whether options are looked for in the text of a question whose columns have none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum InQuestion {
    Searched,
    /// The user states that there are no options.
    None,
}

/// Where the images of a row stand.
#[derive(Debug)]
pub(in crate::dataset::ready_made) enum Images {
    /// In the first of these columns that has one.
    First(Vec<Column>),
    /// In all of these columns.
    All(Vec<Column>),
    /// In a file of this name, with the cells of columns in braces.
    Template(Template),
}

impl Roles {
    /// The roles of the columns of a table, by a map and else by their names.
    ///
    /// # Errors
    /// If a column of the map is not there, no column is the question, or the columns hold several questions a row.
    pub(in crate::dataset::ready_made) fn new(table: &Table, map: &Map) -> Result<Self, String> {
        let named = |role| Self::named(table, map, role);
        let question = named(Role::Question)?;
        refuse_wide(table, map)?;
        let question = match (question.into_iter().next(), map.entry(Role::Question)) {
            (Some(column), _) => Asked::Column(column),
            (None, Some(_)) => Asked::InImage,
            (None, None) => return Err(no_question(table)),
        };
        let how = map.entry(Role::Options);
        let mut options = named(Role::Options)?;
        let is_of_cells = how.is_some() && options.len() > 1;
        let cells = match how {
            Some(_) if is_of_cells => std::mem::take(&mut options),
            Some(_) => Vec::new(),
            None => cells(table),
        };
        let evidence = named(Role::Evidence)?.into_iter().next();
        Ok(Self {
            question,
            images: Self::images(table, map)?,
            options,
            cells,
            answers: named(Role::Answer)?,
            ids: named(Role::Id)?,
            hint: named(Role::Hint)?.into_iter().next(),
            families: match map.entry(Role::Family) {
                Some(_) => Families::Said(named(Role::Family)?.into_iter().next()),
                None => Families::Known(named(Role::Family)?),
            },
            evidence,
            scene: named(Role::Scene)?.into_iter().next(),
            in_question: match how {
                Some(entry) if entry.columns.is_empty() => InQuestion::None,
                _ => InQuestion::Searched,
            },
            split_options: how.and_then(|entry| match &entry.how {
                CellFormat::Split(signs) => Some(signs.clone()),
                CellFormat::ByRule | CellFormat::Answer(_) => None,
            }),
        })
    }

    /// The columns that nobody reads again once the questions have their text, their options and their answers: not those of images,
    /// ids, families and scenes.
    pub(in crate::dataset::ready_made) fn read_once(&self) -> BTreeSet<usize> {
        let (Images::First(images) | Images::All(images)) = &self.images else {
            // A template may name any column.
            return BTreeSet::new();
        };
        let families = match &self.families {
            Families::Known(columns) => columns.as_slice(),
            Families::Said(column) => column.as_slice(),
        };
        let kept: BTreeSet<usize> = images
            .iter()
            .chain(&self.ids)
            .chain(families)
            .chain(&self.evidence)
            .chain(&self.scene)
            .map(|column| column.at)
            .collect();
        self.question
            .column()
            .into_iter()
            .chain(&self.hint)
            .chain(&self.options)
            .chain(&self.cells)
            .chain(&self.answers)
            .map(|column| column.at)
            .filter(|at| !kept.contains(at))
            .collect()
    }

    /// Whether a column has a role.
    pub(super) fn holds(&self, at: usize) -> bool {
        let images = match &self.images {
            Images::First(columns) | Images::All(columns) => columns.as_slice(),
            Images::Template(_) => &[],
        };
        let families = match &self.families {
            Families::Known(columns) => columns.as_slice(),
            Families::Said(column) => column.as_slice(),
        };
        let mut columns = images
            .iter()
            .chain(families)
            .chain(&self.ids)
            .chain(self.question.column());
        let mut others = self
            .hint
            .iter()
            .chain(&self.options)
            .chain(&self.cells)
            .chain(&self.answers);
        columns.any(|column| column.at == at) || others.any(|column| column.at == at)
    }

    /// The columns of a role: those of the map, or those with one of its names, the best first.
    fn named(table: &Table, map: &Map, role: Role) -> Result<Vec<Column>, String> {
        if let Some(entry) = map.entry(role) {
            if entry.columns.len() > 1
                && let Some(at) = table.find(&entry.whole)
            {
                let name = entry.whole.clone();
                let field = None;
                return Ok(vec![Column { at, field, name }]);
            }
            let columns = entry.columns.iter();
            return columns.map(|name| column(table, name)).collect();
        }
        let columns = known(role).iter().flat_map(|name| {
            table
                .columns
                .iter()
                .enumerate()
                .filter(move |(_, column)| plain(column) == *name)
                .map(|(at, column)| Column {
                    at,
                    field: None,
                    name: column.clone(),
                })
        });
        Ok(columns.collect())
    }

    fn images(table: &Table, map: &Map) -> Result<Images, String> {
        let entry = map.entry(Role::Image);
        if let Some([template]) = entry.map(|entry| &*entry.columns)
            && template.contains('{')
        {
            let template = Template::new(table, template, |name| column(table, name));
            return template.map(Images::Template);
        }
        let columns = Self::named(table, map, Role::Image)?;
        if entry.is_some() && columns.len() > 1 {
            return Ok(Images::All(columns));
        }
        let numbered = numbered(table, &["image", "img"]);
        if let (Some(first), false) = (columns.first(), numbered.is_empty()) {
            // A picture beside numbered ones is one of several.
            let all = std::iter::once(first.clone()).chain(numbered);
            return Ok(Images::All(all.collect()));
        }
        if !columns.is_empty() {
            return Ok(Images::First(columns));
        }
        Ok(Images::All(numbered))
    }
}

/// The problem of a table without a column of questions, with the map that reads it, as far as one can be told.
fn no_question(table: &Table) -> String {
    let known: BTreeSet<&String> = Role::ALL.iter().flat_map(|role| known(*role)).collect();
    let is_free = |(_, name): &(usize, &String)| {
        !known.contains(&plain(name)) && !cells(table).iter().any(|cell| cell.name == **name)
    };
    let texts = table.columns.iter().enumerate().filter(is_free);
    let likely = texts
        .map(|(at, name)| {
            let cells: Vec<bool> = table
                .rows
                .iter()
                .filter_map(|row| match row.cell(at) {
                    Cell::Text(text) => Some(text.trim_end().ends_with(['?', '？'])),
                    _ => None,
                })
                .collect();
            (
                cells.iter().filter(|asks| **asks).count(),
                cells.len(),
                name,
            )
        })
        .filter(|(_, texts, _)| *texts > 0)
        .max_by_key(|(asks, texts, _)| (*asks, *texts));
    let remedy = match (Turns::find(table), likely) {
        (Some(Turns { question, answer }), _) => {
            let answer = answer.map_or_else(String::new, |path| format!(",answer={path}"));
            format!(
                "it holds conversations, whose first question is read with {}",
                flag(Role::Question, &format!("{question}{answer}"), None)
            )
        }
        (None, Some((_, _, name))) => format!(
            "say which is which, e.g. {}; {} if it stands in the image",
            flag(Role::Question, name, None),
            flag(Role::Question, "", None)
        ),
        (None, None) => format!(
            "if the question stands in the image, {} asks {:?}; else say which is which: --map question=COLUMN,image=COLUMN,options=COLUMN,answer=COLUMN",
            flag(Role::Question, "", None),
            Asked::IN_IMAGE
        ),
    };
    format!(
        "no question among its columns:\n{}\n {remedy}",
        shown(table)
    )
}

/// The column of a name, or the field of structs in it, as `meta.source`.
pub(in crate::dataset::ready_made) fn column(table: &Table, name: &str) -> Result<Column, String> {
    let own = |name: &str, field: Option<&str>| {
        table.find(name).map(|at| Column {
            at,
            field: field.map(str::to_owned),
            name: field.map_or_else(|| name.to_owned(), |field| format!("{name}.{field}")),
        })
    };
    let inner = || {
        let (name, field) = name.split_once('.')?;
        own(name, Some(field))
    };
    own(name, None).or_else(inner).ok_or_else(|| {
        let near = table
            .columns
            .iter()
            .find(|known| plain(known) == plain(name));
        let near = near.map_or_else(String::new, |near| format!("; did you mean {near:?}?"));
        format!(
            "--map names the column {name:?}, which is not there{near}\n{}",
            shown(table)
        )
    })
}

/// The columns `NAME` and a number, in the order of the numbers.
fn numbered(table: &Table, names: &[&str]) -> Vec<Column> {
    let mut found: Vec<(u32, Column)> = Vec::new();
    for (at, column) in table.columns.iter().enumerate() {
        let plain = plain(column);
        let digits = names.iter().find_map(|name| plain.strip_prefix(name));
        if let Some(number) = digits.and_then(|digits| digits.parse().ok()) {
            let name = column.clone();
            found.push((
                number,
                Column {
                    at,
                    field: None,
                    name,
                },
            ));
        }
    }
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, column)| column).collect()
}

/// The columns of one option each: `A`, `B`, … (at least these two), or `option0`, `option_a`, `choice_a` and so on.
fn cells(table: &Table) -> Vec<Column> {
    let of = |name: &str| {
        table.find(name).map(|at| Column {
            at,
            field: None,
            name: name.to_owned(),
        })
    };
    let letters: Vec<Column> = (0..Choices::MOST)
        .map_while(|index| of(&letter(index).to_string()))
        .collect();
    if letters.len() > 1 {
        return letters;
    }
    let digits = numbered(table, &["option", "choice"]);
    if digits.len() > 1 {
        return digits;
    }
    let named = |index: usize| {
        let name = letter(index).to_ascii_lowercase();
        let names = [format!("option{name}"), format!("choice{name}")];
        let column = table
            .columns
            .iter()
            .find(|column| names.contains(&plain(column)))?;
        of(column)
    };
    let named: Vec<Column> = (0..Choices::MOST).map_while(named).collect();
    if named.len() > 1 { named } else { Vec::new() }
}

/// Refuses a table that has several questions a row.
fn refuse_wide(table: &Table, map: &Map) -> Result<(), String> {
    let wide = numbered(table, &["question"]);
    if wide.len() < 2 || map.entry(Role::Question).is_some() {
        return Ok(());
    }
    let names: Vec<&str> = wide.iter().map(|column| column.name.as_str()).collect();
    Err(format!(
        "several questions per row, in the columns {}; one question per row is read: write a row for each, or take the ones in a column \
         with {}",
        names.join(", "),
        flag(Role::Question, names[0], None)
    ))
}

/// The most characters of values that are shown of a table, and of a name.
const MOST_SHOWN: usize = 360;
const LONGEST_SHOWN_NAME: usize = 40;

/// The columns with their kinds and a short value each, one a line.
pub(in crate::dataset::ready_made) fn shown(table: &Table) -> String {
    let width = table.columns.iter().map(|name| name.chars().count()).max();
    let width = width.unwrap_or(0).min(24);
    let most = (MOST_SHOWN / table.columns.len().clamp(1, 40)).min(60);
    let mut lines: Vec<String> = table
        .columns
        .iter()
        .enumerate()
        .take(40)
        .map(|(at, name)| {
            let cell = table
                .rows
                .iter()
                .map(|row| row.cell(at))
                .find(|cell| !cell.is_absent())
                .unwrap_or(&Cell::Absent);
            let name = excerpt(name, LONGEST_SHOWN_NAME);
            format!("   {name:width$}  {:8} {}", cell.kind(), cell.shown(most))
        })
        .collect();
    if table.columns.len() > lines.len() {
        lines.push(format!("   and {} more", table.columns.len() - lines.len()));
    }
    lines.join("\n")
}
