//! Record of how scenes were rendered: `scenes.json`, written by the script `hm3d_frames.py`.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::files::reading::text;

/// Value of `schema` in `scenes.json`.
const SCHEMA: &str = "darkqa.renders/1";

/// Reads `scenes.json`, without scenes that are not in `present`, the scenes of the folder. `None` if the file does not
/// exist, or, with a warning, if it is from another tool.
///
/// # Errors
/// If the file is not JSON, or is from an unknown version of the script.
pub(super) fn read(folder: &Path, present: &BTreeSet<&String>) -> Result<Option<Value>> {
    let path = folder.join("scenes.json");
    if !path.is_file() {
        return Ok(None);
    }
    let mut record: Value = serde_json::from_str(&text(&path)?).map_err(|e| Error::data(path.display(), e))?;
    match record["schema"].as_str() {
        Some(SCHEMA) => {}
        Some(other) if other.starts_with("darkqa.renders/") => {
            let problem = format_args!("{SCHEMA:?} expected, not {other:?}");
            return Err(Error::data(path.display(), problem));
        }
        _ => {
            tracing::warn!("{}: not the record of hm3d_frames.py, so it is ignored", path.display());
            return Ok(None);
        }
    }
    let Some(scenes) = record["scenes"].as_array_mut() else {
        let problem = "a list of scenes expected at the key scenes";
        return Err(Error::data(path.display(), problem));
    };
    let recorded: BTreeSet<String> = scenes.iter().map(scene_name).collect();
    for scene in present.iter().filter(|scene| !recorded.contains(**scene)) {
        tracing::warn!("{}: nothing about the scene {scene}", path.display());
    }
    scenes.retain(|scene| present.contains(&scene_name(scene)));
    for scene in recorded.iter().filter(|scene| !present.contains(scene)) {
        tracing::warn!("{}: the scene {scene} is not in the folder", path.display());
    }
    Ok(Some(record))
}

fn scene_name(scene: &Value) -> String {
    scene["scene"].as_str().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(content: &str) -> Result<Option<Value>> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("scenes.json"), content).unwrap();
        read(folder.path(), &BTreeSet::from([&"a".to_owned()]))
    }

    #[test]
    fn record_is_limited_to_present_scenes() {
        assert!(matches!(read(Path::new("/nowhere"), &BTreeSet::new()), Ok(None)));
        let record = r#"{"schema": "darkqa.renders/1", "mode": "cover", "scenes": [{"scene": "a"}, {"scene": "b"}]}"#;
        let found = read_text(record).unwrap().unwrap();
        assert_eq!(found["mode"], "cover");
        assert_eq!(found["scenes"], serde_json::json!([{"scene": "a"}]));
        assert!(matches!(read_text(r#"{"scenes": ["kitchen"]}"#), Ok(None)));
    }

    #[test]
    fn invalid_records_are_refused() {
        for (content, message) in [
            ("{", "scenes.json"),
            (r#"{"schema": "darkqa.renders/2"}"#, "darkqa.renders/1"),
            (r#"{"schema": "darkqa.renders/1"}"#, "a list of scenes"),
        ] {
            let problem = read_text(content).unwrap_err().to_string();
            assert!(problem.contains(message), "{problem}");
        }
    }
}
