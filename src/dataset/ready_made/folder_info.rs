//! The optional `dataset.json` of a ready-made data set: [`FolderInfo`].

use std::path::Path;

use super::columns::map::ColumnMap;
use super::container::Archive;
use crate::dataset::root::Root;
use crate::error::{Error, Result};
use crate::files::reading;

/// The fields that are read from `dataset.json`.
#[derive(Debug, Default)]
pub(super) struct FolderInfo {
    /// Name of the data set; empty if none is given.
    pub(super) name: String,
    /// Column mapping; `None` if none is given.
    pub(super) map: Option<ColumnMap>,
}

impl FolderInfo {
    const FILE: &str = "dataset.json";

    /// Reads `dataset.json` in a folder; the default if it does not exist.
    ///
    /// # Errors
    /// If the file cannot be read, or is a link out of the folders of `root`.
    pub(super) fn in_folder(root: &Root) -> Result<Self> {
        let Some(path) = root.own_file(Self::FILE)? else {
            return Ok(Self::default());
        };
        Self::read(&path, &reading::json(&path)?)
    }

    /// Reads `dataset.json` at the top level of a ZIP file; the default if it does not exist.
    pub(super) fn in_archive(archive: &Archive) -> Result<Self> {
        if !archive.has(Self::FILE) {
            return Ok(Self::default());
        }
        let path = archive.path().join(Self::FILE);
        let text = archive.read_text(Self::FILE)?;
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
        let map = text_field(info, "map")
            .map(str::parse::<ColumnMap>)
            .transpose()
            .map_err(|problem| Error::data(path.display(), format_args!("map: {problem}")))?;
        Ok(Self {
            name: text_field(info, "name").unwrap_or_default().to_owned(),
            map,
        })
    }
}

fn text_field<'a>(info: &'a serde_json::Value, key: &str) -> Option<&'a str> {
    info.get(key).and_then(serde_json::Value::as_str)
}
