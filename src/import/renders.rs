//! The record of how the scenes of a data set were rendered: `scenes.json`, which the script `hm3d_frames.py` writes.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::files::reading::text;

/// The value of `schema` in `scenes.json`.
const SCHEMA: &str = "darkqa.renders/1";

/// The record in `scenes.json`, without scenes that are not in the folder (`present` are those that are). `None` if there is no
/// such file, or another tool wrote it; the latter is said.
///
/// # Errors
/// If the file is not JSON, or a version of the script wrote it that is not known here.
pub(super) fn of(folder: &Path, present: &BTreeSet<&String>) -> Result<Option<Value>> {
    let path = folder.join("scenes.json");
    if !path.is_file() {
        return Ok(None);
    }
    let mut record: Value =
        serde_json::from_str(&text(&path)?).map_err(|e| Error::data(path.display(), e))?;
    match record["schema"].as_str() {
        Some(SCHEMA) => {}
        Some(other) if other.starts_with("darkqa.renders/") => {
            let problem = format_args!("{SCHEMA:?} expected, not {other:?}");
            return Err(Error::data(path.display(), problem));
        }
        _ => {
            tracing::warn!(
                "{}: not the record of hm3d_frames.py, so it is ignored",
                path.display()
            );
            return Ok(None);
        }
    }
    let Some(scenes) = record["scenes"].as_array_mut() else {
        let problem = "a list of scenes expected at the key scenes";
        return Err(Error::data(path.display(), problem));
    };
    let name = |scene: &Value| scene["scene"].as_str().unwrap_or_default().to_owned();
    let recorded: BTreeSet<String> = scenes.iter().map(name).collect();
    for scene in present.iter().filter(|scene| !recorded.contains(**scene)) {
        tracing::warn!("{}: nothing about the scene {scene}", path.display());
    }
    scenes.retain(|scene| present.contains(&name(scene)));
    for scene in recorded.iter().filter(|scene| !present.contains(scene)) {
        tracing::warn!("{}: the scene {scene} is not in the folder", path.display());
    }
    Ok(Some(record))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(content: &str) -> Result<Option<Value>> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("scenes.json"), content).unwrap();
        of(folder.path(), &BTreeSet::from([&"a".to_owned()]))
    }

    #[test]
    fn only_the_record_of_the_script_is_taken_and_only_scenes_that_are_there() {
        assert!(matches!(
            of(Path::new("/nowhere"), &BTreeSet::new()),
            Ok(None)
        ));
        let record = r#"{"schema": "darkqa.renders/1", "mode": "cover", "scenes": [{"scene": "a"}, {"scene": "b"}]}"#;
        let carried = read(record).unwrap().unwrap();
        assert_eq!(carried["mode"], "cover");
        assert_eq!(carried["scenes"], serde_json::json!([{"scene": "a"}]));
        assert!(matches!(read(r#"{"scenes": ["kitchen"]}"#), Ok(None)));
    }

    #[test]
    fn broken_records_are_refused() {
        for (content, says) in [
            ("{", "scenes.json"),
            (r#"{"schema": "darkqa.renders/2"}"#, "darkqa.renders/1"),
            (r#"{"schema": "darkqa.renders/1"}"#, "a list of scenes"),
        ] {
            let problem = read(content).unwrap_err().to_string();
            assert!(problem.contains(says), "{problem}");
        }
    }
}
