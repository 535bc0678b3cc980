//! The photographs of a frame's scene in the dark, as a line of `frames.jsonl` names them: [`DarkPhoto`].

use std::collections::BTreeSet;
use std::path::PathBuf;

use serde::Deserialize;

use crate::types::PhotoName;

/// A photograph of a frame's scene in the dark.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DarkPhoto {
    /// The name of the condition in which it is shown.
    pub(crate) name: PhotoName,
    /// Its file.
    pub(crate) path: PathBuf,
    /// How much darker than its frame it was exposed, in EV, by shutter and gain; `None` if the data do not state it.
    pub(crate) ev: Option<f64>,
}

/// The value of `dark` in a line of `frames.jsonl`: a path, an object, or a list of them.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a path, {\"path\", \"ev\", \"name\"} or a list of them expected for dark"
)]
pub(super) enum DarkField {
    /// One photograph.
    One(DarkEntry),
    /// Several, brightest or darkest first.
    Several(Vec<DarkEntry>),
}

/// One photograph of the field `dark`.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum DarkEntry {
    /// Its path alone.
    Path(PathBuf),
    /// Its path with its known facts.
    Known(KnownPhoto),
}

/// A photograph with facts about it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct KnownPhoto {
    path: PathBuf,
    ev: Option<f64>,
    name: Option<String>,
}

impl DarkField {
    /// The photographs in their order; one without a name is `dark`, `dark-2` and so on by its place. `existing` turns a path of the
    /// line into that of a file.
    ///
    /// # Errors
    /// If a name is none, or is given twice, an exposure is no drop, or a file is missing.
    pub(super) fn photos(
        self,
        existing: impl Fn(PathBuf) -> Result<PathBuf, String>,
    ) -> Result<Vec<DarkPhoto>, String> {
        let entries = match self {
            Self::One(entry) => vec![entry],
            Self::Several(entries) => entries,
        };
        let mut names = BTreeSet::new();
        entries.into_iter().enumerate().map(|(place, entry)| {
            let KnownPhoto { path, ev, name } = match entry {
                DarkEntry::Known(known) => known,
                DarkEntry::Path(path) => KnownPhoto {
                    path,
                    ev: None,
                    name: None,
                },
            };
            let name = match name {
                None => PhotoName::numbered(place),
                Some(name) => PhotoName::new(&name).map_err(|e| e.to_string())?,
            };
            if let Some(ev) = ev.filter(|ev| !(ev.is_finite() && *ev > 0.0 && *ev <= 30.0)) {
                return Err(format!(
                    "dark {name}: an ev of {ev}; a number above 0 expected, the stops by which it was exposed darker than rgb"
                ));
            }
            if !names.insert(name.clone()) {
                return Err(format!(
                    "two photographs are named {name}; give each its own name"
                ));
            }
            Ok(DarkPhoto {
                name,
                path: existing(path)?,
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
        let photos = field.photos(|path| {
            let is_there = path.starts_with("low");
            is_there.then_some(path).ok_or("no such file".to_owned())
        })?;
        let named = photos.into_iter();
        Ok(named
            .map(|photo| (photo.name.to_string(), photo.ev))
            .collect())
    }

    #[test]
    fn photographs_are_named_by_their_place_or_as_they_are() {
        let named = |name: &str, ev| (name.to_owned(), ev);
        for (json, expected) in [
            (r#""low/0.png""#, vec![named("dark", None)]),
            ("[]", vec![]),
            (
                r#"["low/0.png","low/1.png"]"#,
                vec![named("dark", None), named("dark-2", None)],
            ),
            (
                r#"["low/0.png",{"path":"low/1.png","ev":4.5},{"path":"low/2.png","name":"lamp"}]"#,
                vec![
                    named("dark", None),
                    named("dark-2", Some(4.5)),
                    named("lamp", None),
                ],
            ),
        ] {
            assert_eq!(photos(json), Ok(expected), "{json}");
        }
    }

    #[test]
    fn what_is_no_photograph_is_told() {
        for (json, part) in [
            ("3", "for dark"),
            (r#"{"file":"low/0.png"}"#, "for dark"),
            (r#""high/0.png""#, "no such file"),
            (
                r#"{"path":"low/0.png","ev":-2}"#,
                "an ev of -2; a number above 0 expected",
            ),
            (
                r#"{"path":"low/0.png","name":"L3-ev"}"#,
                "not a valid name of a dark photograph",
            ),
            (
                r#"[{"path":"low/0.png","name":"dark-2"},"low/1.png"]"#,
                "two photographs are named dark-2",
            ),
        ] {
            let error = photos(json).unwrap_err();
            assert!(error.contains(part), "{json}: {error}");
        }
    }
}
