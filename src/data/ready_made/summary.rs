//! Summary of how a set was read, for the user: [`Summary`].

use std::collections::{BTreeMap, BTreeSet};

use super::cells::SetRows;
use super::columns::{ColumnRoles, FamilySource, ImageColumns, QuestionSource};
use super::items::InstructionCounts;
use super::omissions::{Omissions, RowOmission};
use super::pictures::Series;
use crate::openeqa::ImageSource;
use darkqa_base::types::{FrameId, Question};

/// Facts about a set, for messages and the manifest.
pub(super) struct Summary<'a> {
    pub(super) name: &'a str,
    pub(super) table: &'a SetRows,
    pub(super) roles: &'a ColumnRoles,
    pub(super) families: &'a FamilySource,
    /// Columns and formats of the answers.
    pub(super) answers: &'a [String],
    /// Source of the ids.
    pub(super) ids: &'a str,
    pub(super) cut_instructions: &'a InstructionCounts,
    pub(super) omissions: &'a Omissions,
    /// Description of the groups of questions; `None` without groups.
    pub(super) groups: Option<String>,
    /// Images of the set; empty if the questions are about frames of other data.
    pub(super) sources: &'a BTreeMap<FrameId, ImageSource>,
    /// Images of each question with several.
    pub(super) series: &'a Series,
    pub(super) questions: &'a [Question],
    /// Further facts, one per line.
    pub(super) notes: Vec<String>,
}

/// Start of a line about rows that are left out.
pub(crate) const LEFT_OUT: &str = "left out: ";

/// Maximum number of families without a warning that tables are hard to read (chosen).
const MANY_FAMILIES: usize = 60;

impl Summary<'_> {
    /// The facts, one per line.
    pub(super) fn lines(&self) -> Vec<String> {
        let families: BTreeSet<&str> = self.questions.iter().map(|question| question.family.name()).collect();
        let mut lines = vec![
            format!(
                "{}: {} on {} in {} ({})",
                self.name,
                count(self.questions.len(), "question", "questions"),
                count(self.images(), "image", "images"),
                count(families.len(), "family", "families"),
                self.families.description()
            ),
            self.columns(),
        ];
        lines.extend(self.multi_image_questions());
        lines.extend(self.groups.clone());
        for (reason, number) in self.omissions.counts() {
            let first = match (reason, self.omissions.bad()) {
                (RowOmission::Bad, Some((_, first))) => format!("; the first: {first}"),
                _ => String::new(),
            };
            lines.push(format!("{LEFT_OUT}{number} of {} rows ({}){first}", self.table.rows.len(), reason.name()));
        }
        for (ending, number) in self.cut_instructions {
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

    /// Number of images.
    fn images(&self) -> usize {
        if !self.sources.is_empty() {
            return self.sources.len();
        }
        let frames: BTreeSet<_> = self.questions.iter().map(|question| &question.frame).collect();
        frames.len()
    }

    /// Number of questions with several images, and of their images; `None` if all questions have one image.
    fn multi_image_questions(&self) -> Option<String> {
        let counts: Vec<usize> =
            self.questions.iter().filter_map(|question| Some(self.series.get(&question.frame)?.len())).collect();
        let (least, most) = (counts.iter().min()?, counts.iter().max()?);
        let each = if least == most { most.to_string() } else { format!("{least} to {most}") };
        let questions = match counts.len() {
            1 => "1 question shows".to_owned(),
            number => format!("{number} questions show"),
        };
        Some(format!(
            "{questions} {each} images, all in one request: each at its mark (<image 2>) in the text, else in order beside it"
        ))
    }

    /// Column of each role.
    fn columns(&self) -> String {
        let roles = self.roles;
        let image = match &roles.images {
            ImageColumns::First(columns) => columns.first().map_or("none", |column| &column.name).to_owned(),
            ImageColumns::All(columns) => {
                let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
                names.join(", ")
            }
            ImageColumns::Template(template) => template.text().to_owned(),
        };
        let mut parts = vec![
            match roles.question.column() {
                Some(column) => format!("question = {}", column.name),
                None => format!("question = in the image (asked as {:?})", QuestionSource::IN_IMAGE_TEXT),
            },
            format!("image = {image} ({})", self.formats()),
        ];
        let cells: Vec<&str> = roles.option_cells.iter().map(|column| column.name.as_str()).collect();
        match (&*cells, &*roles.option_lists) {
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

    /// Number of images by format, such as `PNG 3, files 2`.
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
        counts.iter().map(|(format, count)| format!("{format} {count}")).collect::<Vec<String>>().join(", ")
    }
}

/// A number with its noun in the singular or plural.
pub(super) fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}
