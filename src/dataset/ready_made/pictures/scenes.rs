//! The scenes of the frames of a set: [`Scenes`].

use std::collections::{BTreeMap, BTreeSet};

use crate::dataset::ready_made::cells::Table;
use crate::dataset::ready_made::choices::is_own;
use crate::dataset::ready_made::columns::Column;
use crate::dataset::ready_made::columns::map::{Map, flag};
use crate::dataset::ready_made::columns::names::Role;
use crate::dataset::ready_made::summary::count;
use crate::error::{Error, Result};
use crate::types::FrameId;

/// Scene of each frame that has one.
pub(in crate::dataset) type SceneNames = BTreeMap<FrameId, String>;

/// The column of scenes and what it says of the frames.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct Scenes<'a> {
    column: Option<&'a Column>,
    /// True if the user named the column, or wrote this program's own form. Otherwise a column that contradicts itself is not used.
    is_meant: bool,
    names: SceneNames,
    frames: BTreeSet<FrameId>,
    /// First frame with two scenes, and both of them.
    contradiction: Option<String>,
}

impl<'a> Scenes<'a> {
    /// No frames yet.
    pub(in crate::dataset::ready_made) fn new(
        table: &Table,
        map: &Map,
        column: Option<&'a Column>,
    ) -> Self {
        Self {
            column,
            is_meant: map.entry(Role::Scene).is_some() || is_own(table),
            names: SceneNames::new(),
            frames: BTreeSet::new(),
            contradiction: None,
        }
    }

    /// Adds the frame of a row.
    ///
    /// # Errors
    /// If the user named the column and gives the frame a second scene.
    pub(in crate::dataset::ready_made) fn add(
        &mut self,
        table: &Table,
        row: usize,
        frame: &FrameId,
    ) -> Result<()> {
        let Some(column) = self.column else {
            return Ok(());
        };
        self.frames.insert(frame.clone());
        let scene = column.text(&table.rows[row]).unwrap_or_default();
        let scene = scene.trim();
        if scene.is_empty() {
            return Ok(());
        }
        let known = self.names.entry(frame.clone());
        let known = known.or_insert_with(|| scene.to_owned());
        if known == scene {
            return Ok(());
        }
        let problem = format!(
            "the image {:?} is of the scene {scene:?} here and of {known:?} before",
            frame.0
        );
        if self.is_meant {
            let remedy = flag(Role::Scene, "", None);
            let problem = format!("{problem}; an image has one scene ({remedy} ignores scenes)");
            return Err(Error::data(table.place(row), problem));
        }
        self.contradiction.get_or_insert(problem);
        Ok(())
    }

    /// The scenes; none if the column contradicts itself.
    pub(in crate::dataset::ready_made) fn take(&mut self) -> SceneNames {
        match self.contradiction {
            None => std::mem::take(&mut self.names),
            Some(_) => SceneNames::new(),
        }
    }

    /// Column and number of scenes in words; `None` without a column.
    pub(in crate::dataset::ready_made) fn note(&self) -> Option<String> {
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
