//! Scenes of the frames of a set: [`Scenes`].

use std::collections::{BTreeMap, BTreeSet};

use crate::data::ready_made::cells::Table;
use crate::data::ready_made::choices::is_native_format;
use crate::data::ready_made::columns::Column;
use crate::data::ready_made::columns::map::{ColumnMap, map_flag};
use crate::data::ready_made::columns::names::Role;
use crate::data::ready_made::summary::count;
use crate::error::{Error, Result};
use crate::types::FrameId;

/// Scene of each frame that has one.
pub(crate) type SceneNames = BTreeMap<FrameId, String>;

/// Collects the scenes of the frames from the column of scenes.
#[derive(Debug)]
pub(crate) struct Scenes<'a> {
    column: Option<&'a Column>,
    /// True if the user gave the column, or the table is in this program's own format. Then a frame with two scenes is
    /// an error; otherwise the column is ignored.
    is_required: bool,
    names: SceneNames,
    frames: BTreeSet<FrameId>,
    /// Message about the first frame with two scenes.
    contradiction: Option<String>,
}

impl<'a> Scenes<'a> {
    /// No frames yet.
    pub(crate) fn new(table: &Table, map: &ColumnMap, column: Option<&'a Column>) -> Self {
        Self {
            column,
            is_required: map.entry(Role::Scene).is_some() || is_native_format(table),
            names: SceneNames::new(),
            frames: BTreeSet::new(),
            contradiction: None,
        }
    }

    /// Adds the frame of a row.
    ///
    /// # Errors
    /// If the frame already has another scene and the column is required.
    pub(crate) fn add(&mut self, table: &Table, row: usize, frame: &FrameId) -> Result<()> {
        let Some(column) = self.column else {
            return Ok(());
        };
        self.frames.insert(frame.clone());
        let scene = column.text(&table.rows[row]).unwrap_or_default();
        let scene = scene.trim();
        if scene.is_empty() {
            return Ok(());
        }
        let known = self.names.entry(frame.clone()).or_insert_with(|| scene.to_owned());
        if known == scene {
            return Ok(());
        }
        let problem = format!("the image {:?} is of the scene {scene:?} here and of {known:?} before", frame.0);
        if self.is_required {
            let remedy = map_flag(Role::Scene, "", None);
            let problem = format!("{problem}; an image has one scene ({remedy} ignores scenes)");
            return Err(Error::data(table.place(row), problem));
        }
        self.contradiction.get_or_insert(problem);
        Ok(())
    }

    /// Takes the scenes out; none if the column has contradictions.
    pub(crate) fn take(&mut self) -> SceneNames {
        match self.contradiction {
            None => std::mem::take(&mut self.names),
            Some(_) => SceneNames::new(),
        }
    }

    /// Note about the column and the number of scenes; `None` without a column.
    pub(crate) fn note(&self) -> Option<String> {
        let name = &self.column?.name;
        if let Some(problem) = &self.contradiction {
            return Some(format!("{name} is not used as the scene: {problem}"));
        }
        let scenes: BTreeSet<&String> = self.names.values().collect();
        let without = match self.frames.len() - self.names.len() {
            0 => String::new(),
            some => format!(", {} without a scene", count(some, "image", "images")),
        };
        Some(format!(
            "scene = {name}: {} of {}{without}",
            count(scenes.len(), "scene", "scenes"),
            count(self.frames.len(), "image", "images")
        ))
    }
}
