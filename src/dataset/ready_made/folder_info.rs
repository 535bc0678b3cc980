//! The `dataset.json` beside the rows of a set: [`FolderInfo`].

use std::path::Path;

use super::container::Archive;
use super::map::Map;
use crate::error::{Error, Result};
use crate::files::reading;

/// The `dataset.json` of a folder with a set.
#[derive(Debug, Default)]
pub(super) struct FolderInfo {
    pub(super) name: String,
    pub(super) map: Option<Map>,
}

impl FolderInfo {
    const FILE: &str = "dataset.json";

    /// Reads the file of a folder; empty without one.
    pub(super) fn in_folder(folder: &Path) -> Result<Self> {
        let path = folder.join(Self::FILE);
        if !path.is_file() {
            return Ok(Self::default());
        }
        Self::read(&path, &reading::json(&path)?)
    }

    /// Reads the file at the top of a ZIP file.
    pub(super) fn in_archive(archive: &Archive) -> Result<Self> {
        if !archive.has(Self::FILE) {
            return Ok(Self::default());
        }
        let path = archive.path().join(Self::FILE);
        let text = archive.text(Self::FILE)?;
        let info: serde_json::Value =
            serde_json::from_str(&text).map_err(|e| Error::data(path.display(), e))?;
        if info.get("light").is_some_and(|light| light != "lit") {
            tracing::warn!(
                "{}: `light` is not read from a ZIP file; --light dark says that the set was photographed in the dark",
                path.display()
            );
        }
        Self::read(&path, &info)
    }

    fn read(path: &Path, info: &serde_json::Value) -> Result<Self> {
        let text = |key: &str| info.get(key).and_then(serde_json::Value::as_str);
        let map = text("map").map(str::parse).transpose();
        let wrong = |problem: String| Error::data(path.display(), format_args!("map: {problem}"));
        Ok(Self {
            name: text("name").unwrap_or_default().to_owned(),
            map: map.map_err(wrong)?,
        })
    }
}
