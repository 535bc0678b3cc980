//! Photographs of a frame's scene in the dark, from the field `dark` of `frames.jsonl`: [`DarkPhoto`].

use std::collections::BTreeSet;
use std::path::PathBuf;

use serde::Deserialize;

use darkqa_base::types::PhotoName;

/// Photograph of a frame's scene in the dark.
#[derive(Debug, Clone, PartialEq)]
pub struct DarkPhoto {
    /// Name of the condition that shows the photograph.
    pub name: PhotoName,
    /// Image file.
    pub path: PathBuf,
    /// Difference in exposure from the frame (shutter time and gain), in EV, positive if darker; `None` if unknown.
    pub ev: Option<f64>,
}

/// Value of `dark` in a line of `frames.jsonl`: a path, an object, or a list of these.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "a path, {\"path\", \"ev\", \"name\"} or a list of them expected for dark")]
pub(super) enum DarkField {
    One(DarkEntry),
    /// Photographs, brightest or darkest first.
    Several(Vec<DarkEntry>),
}

/// Photograph in the field `dark`.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum DarkEntry {
    /// Path of its file.
    Path(PathBuf),
    /// Path with exposure and name.
    Details(PhotoDetails),
}

/// Path of a photograph, with its exposure and name if known.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PhotoDetails {
    path: PathBuf,
    ev: Option<f64>,
    name: Option<String>,
}

impl DarkField {
    /// Converts the field to photographs, in order. `resolve` finds the file of a path in the data. Photographs without
    /// a name are called `dark`, `dark-2` and so on by their position.
    ///
    /// # Errors
    /// If a name is invalid or occurs twice, an `ev` is not in (0, 30], or `resolve` fails.
    pub(super) fn into_photos(
        self,
        resolve: impl Fn(PathBuf) -> Result<PathBuf, String>,
    ) -> Result<Vec<DarkPhoto>, String> {
        let entries = match self {
            Self::One(entry) => vec![entry],
            Self::Several(entries) => entries,
        };
        let mut names = BTreeSet::new();
        entries.into_iter().enumerate().map(|(index, entry)| {
            let PhotoDetails { path, ev, name } = match entry {
                DarkEntry::Details(details) => details,
                DarkEntry::Path(path) => PhotoDetails {
                    path,
                    ev: None,
                    name: None,
                },
            };
            let name = match name {
                None => PhotoName::numbered(index),
                Some(name) => PhotoName::new(&name).map_err(|e| e.to_string())?,
            };
            if let Some(ev) = ev.filter(|ev| !(ev.is_finite() && *ev > 0.0 && *ev <= 30.0)) {
                return Err(format!(
                    "dark {name}: an ev of {ev}; a number above 0, at most 30, expected, the stops by which it was exposed darker than rgb"
                ));
            }
            if !names.insert(name.clone()) {
                return Err(format!(
                    "two photographs are named {name}; give each its own name"
                ));
            }
            Ok(DarkPhoto {
                name,
                path: resolve(path)?,
                ev,
            })
        }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photos(json: &str) -> Result<Vec<(String, Option<f64>)>, String> {
        let field: DarkField = serde_json::from_str(json).map_err(|e| e.to_string())?;
        let photos = field.into_photos(|path| {
            let exists = path.starts_with("low");
            exists.then_some(path).ok_or("no such file".to_owned())
        })?;
        Ok(photos.into_iter().map(|photo| (photo.name.to_string(), photo.ev)).collect())
    }

    fn named(name: &str, ev: Option<f64>) -> (String, Option<f64>) {
        (name.to_owned(), ev)
    }

    #[test]
    fn default_names_are_numbered_by_position() {
        for (json, expected) in [
            (r#""low/0.png""#, vec![named("dark", None)]),
            ("[]", vec![]),
            (r#"["low/0.png","low/1.png"]"#, vec![named("dark", None), named("dark-2", None)]),
            (
                r#"["low/0.png",{"path":"low/1.png","ev":4.5},{"path":"low/2.png","name":"lamp"}]"#,
                vec![named("dark", None), named("dark-2", Some(4.5)), named("lamp", None)],
            ),
        ] {
            assert_eq!(photos(json), Ok(expected), "{json}");
        }
    }

    #[test]
    fn invalid_photographs_are_errors() {
        for (json, part) in [
            ("3", "for dark"),
            (r#"{"file":"low/0.png"}"#, "for dark"),
            (r#""high/0.png""#, "no such file"),
            (r#"{"path":"low/0.png","ev":-2}"#, "an ev of -2; a number above 0, at most 30, expected"),
            (r#"{"path":"low/0.png","ev":31}"#, "an ev of 31"),
            (r#"{"path":"low/0.png","name":"L3-ev"}"#, "not a valid name of a dark photograph"),
            (r#"[{"path":"low/0.png","name":"dark-2"},"low/1.png"]"#, "two photographs are named dark-2"),
        ] {
            let error = photos(json).unwrap_err();
            assert!(error.contains(part), "{json}: {error}");
        }
    }
}
