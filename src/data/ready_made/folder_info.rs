//! The optional `dataset.json` of a ready-made data set: [`FolderInfo`].

use std::path::Path;

use super::columns::map::ColumnMap;
use super::container::Archive;
use crate::data::root::Root;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::SetLight;

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
        let info: serde_json::Value = serde_json::from_str(&text).map_err(|e| Error::data(path.display(), e))?;
        Self::read(&path, &info)
    }

    fn read(path: &Path, info: &serde_json::Value) -> Result<Self> {
        let map = text_field(info, "map")
            .map(str::parse::<ColumnMap>)
            .transpose()
            .map_err(|problem| Error::data(path.display(), format_args!("map: {problem}")))?;
        Ok(Self { name: text_field(info, "name").unwrap_or_default().to_owned(), map })
    }
}

/// Light in which the photographs of a ZIP file were taken, from its `dataset.json`; lit by default.
pub(crate) fn light_of_archive(path: &Path) -> Result<SetLight> {
    let archive = Archive::open(path)?;
    if !archive.has(FolderInfo::FILE) {
        return Ok(SetLight::Lit);
    }
    let wrong = |e| Error::data(path.join(FolderInfo::FILE).display(), e);
    let text = archive.read_text(FolderInfo::FILE)?;
    let mut info: serde_json::Value = serde_json::from_str(&text).map_err(wrong)?;
    match info.get_mut("light") {
        Some(light) => serde_json::from_value(light.take()).map_err(wrong),
        None => Ok(SetLight::Lit),
    }
}

fn text_field<'a>(info: &'a serde_json::Value, key: &str) -> Option<&'a str> {
    info.get(key).and_then(serde_json::Value::as_str)
}
