//! The inferred mapping of a set, for the user: [`Summary`].

use std::collections::{BTreeMap, BTreeSet};

use super::cells::Table;
use super::columns::{Asked, FamilyOf, Images, Roles};
use super::items::InstructionCounts;
use super::omissions::{OmissionReason, Omissions};
use super::pictures::Series;
use crate::dataset::image_source::ImageSource;
use crate::types::{FrameId, Question};

/// The facts of a set that was read, for messages and the manifest.
pub(super) struct Summary<'a> {
    pub(super) name: &'a str,
    pub(super) table: &'a Table,
    pub(super) roles: &'a Roles,
    pub(super) family: &'a FamilyOf,
    pub(super) answers: &'a [String],
    pub(super) ids: String,
    pub(super) cut: &'a InstructionCounts,
    pub(super) left: &'a Omissions,
    /// A description of the groups of questions; `None` without groups.
    pub(super) groups: Option<String>,
    /// The images of the set; none if the questions are about frames of other data.
    pub(super) sources: &'a BTreeMap<FrameId, ImageSource>,
    /// The images of questions that show several.
    pub(super) series: &'a Series,
    pub(super) questions: &'a [Question],
    /// Further facts, one a line.
    pub(super) notes: Vec<String>,
}

/// The start of a line about rows that are left out.
pub(in crate::dataset) const LEFT_OUT: &str = "left out: ";

/// The number of families from which on tables are hard to read.
const MANY_FAMILIES: usize = 60;

impl Summary<'_> {
    /// One fact a line.
    pub(super) fn lines(&self) -> Vec<String> {
        let families: BTreeSet<&str> = self
            .questions
            .iter()
            .map(|question| question.family.name())
            .collect();
        let by = self.family.said();
        let mut lines = vec![
            format!(
                "{}: {} on {} in {} ({by})",
                self.name,
                count(self.questions.len(), "question", "questions"),
                count(self.images(), "image", "images"),
                count(families.len(), "family", "families")
            ),
            self.columns(),
        ];
        lines.extend(self.several());
        lines.extend(self.groups.clone());
        for (why, number) in self.left.counts() {
            let first = match (why, self.left.bad()) {
                (OmissionReason::Bad, Some((_, first))) => format!("; the first: {first}"),
                _ => String::new(),
            };
            lines.push(format!(
                "{LEFT_OUT}{number} of {} rows ({}){first}",
                self.table.rows.len(),
                why.name()
            ));
        }
        for (ending, number) in self.cut {
            lines.push(format!("cut from the question: {ending:?} {number} times"));
        }
        if families.len() > MANY_FAMILIES {
            lines.push(format!(
                "{} families make tables that are hard to read; --map family=COLUMN names another column, --map family= none",
                families.len()
            ));
        }
        lines.extend(self.notes.iter().cloned());
        lines
    }

    fn images(&self) -> usize {
        if self.sources.is_empty() {
            let frames = self.questions.iter().map(|question| &question.frame);
            return frames.collect::<BTreeSet<_>>().len();
        }
        self.sources.len()
    }

    /// How many questions show several images; `None` if all show one.
    fn several(&self) -> Option<String> {
        let counts: Vec<usize> = self
            .questions
            .iter()
            .filter_map(|question| Some(self.series.get(&question.frame)?.len()))
            .collect();
        let (least, most) = (counts.iter().min()?, counts.iter().max()?);
        let each = if least == most {
            most.to_string()
        } else {
            format!("{least} to {most}")
        };
        let questions = match counts.len() {
            1 => "1 question shows".to_owned(),
            number => format!("{number} questions show"),
        };
        Some(format!(
            "{questions} {each} images, all in one request: each at its mark (<image 2>) in the text, else in order beside it"
        ))
    }

    /// Which column was taken for what.
    fn columns(&self) -> String {
        let roles = self.roles;
        let image = match &roles.images {
            Images::First(columns) => columns
                .first()
                .map_or("none", |column| &column.name)
                .to_owned(),
            Images::All(columns) => {
                let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
                names.join(", ")
            }
            Images::Template(template) => template.text().to_owned(),
        };
        let mut parts = vec![
            match roles.question.column() {
                Some(column) => format!("question = {}", column.name),
                None => format!("question = in the image (asked as {:?})", Asked::IN_IMAGE),
            },
            format!("image = {image} ({})", self.formats()),
        ];
        let cells: Vec<&str> = roles.cells.iter().map(|cell| cell.name.as_str()).collect();
        match (&*cells, &*roles.options) {
            ([], []) => {}
            ([], [column, ..]) => parts.push(format!("options = {}", column.name)),
            (cells, _) => parts.push(format!("options = {}", cells.join(" "))),
        }
        if let Some(hint) = &roles.hint {
            parts.push(format!("hint = {}", hint.name));
        }
        parts.push(format!("answer = {}", self.answers.join(" and ")));
        parts.push(format!("id = {}", self.ids));
        parts.join(", ")
    }

    /// How many images are of which format, as `PNG 3, files 2`.
    fn formats(&self) -> String {
        if self.sources.is_empty() {
            return "names of frames".to_owned();
        }
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for source in self.sources.values() {
            let format = match source {
                ImageSource::Embedded(image) => image.format(),
                _ => "files",
            };
            *counts.entry(format).or_default() += 1;
        }
        counts
            .iter()
            .map(|(format, count)| format!("{format} {count}"))
            .collect::<Vec<String>>()
            .join(", ")
    }
}

/// A number with its noun.
pub(super) fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}
