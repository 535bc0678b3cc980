//! What the authors of published models do: [`Preset`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::sidecar::ModelSidecar;
use crate::error::{Error, Result};

/// All presets.
const PRESETS: &str = include_str!("presets.toml");

/// What a published model wants, by its name.
#[derive(Debug)]
pub(super) struct Preset {
    /// Its name, as `zero-dce`.
    pub(super) name: String,
    /// What it states.
    pub(super) states: ModelSidecar,
}

impl Preset {
    /// The preset and the file that `zero-dce:FILE` names; no preset where it names a file alone.
    ///
    /// # Errors
    /// Where what stands before the colon is no preset, and the whole is no file.
    pub(super) fn split(said: &Path) -> Result<(Option<Self>, PathBuf)> {
        let text = said.to_string_lossy();
        let Some((name, file)) = text.split_once(':').filter(|_| !said.exists()) else {
            return Ok((None, said.to_owned()));
        };
        // A drive of Windows, or a part of a path.
        if name.len() < 2 || name.contains(['/', '\\', '.']) {
            return Ok((None, said.to_owned()));
        }
        let mut all: BTreeMap<String, ModelSidecar> =
            toml::from_str(PRESETS).map_err(|e| Error::data("presets.toml", e))?;
        // The authors write it with two plus signs.
        let known = name.replace("++", "-pp");
        let Some(states) = all.remove(&known) else {
            let names = all.into_keys().collect::<Vec<_>>().join(", ");
            let problem = format_args!("{name:?} before the colon is no preset; {names}");
            return Err(Error::usage("--llie", problem));
        };
        let name = name.to_owned();
        Ok((Some(Self { name, states }), PathBuf::from(file)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_stand_before_a_colon() {
        for name in [
            "zero-dce",
            "zero-dce++",
            "zero-dce-pp",
            "ruas-lol",
            "ruas-upe",
            "retinexformer",
            "darkir",
            "sci",
            "iat",
            "pairlie",
            "enlightengan",
        ] {
            let said = format!("{name}:a/b.onnx");
            let (preset, file) = Preset::split(Path::new(&said)).unwrap();
            assert_eq!(
                (preset.unwrap().name.as_str(), file),
                (name, "a/b.onnx".into())
            );
        }
        for plain in ["a/b.onnx", "./x:y.onnx", "C:\\m.onnx"] {
            let (preset, file) = Preset::split(Path::new(plain)).unwrap();
            assert!(preset.is_none() && file == Path::new(plain), "{plain}");
        }
        let message = Preset::split(Path::new("zerodce:b.onnx"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("zero-dce, "), "{message}");
    }

    #[test]
    fn every_preset_is_described_and_stands_in_the_help() {
        let all: BTreeMap<String, ModelSidecar> = toml::from_str(PRESETS).unwrap();
        let [readme, help] = [
            include_str!("../../models/README.md"),
            include_str!("settings.rs"),
        ];
        let missing: Vec<String> = all
            .into_keys()
            .filter(|name| {
                let as_authors = name.replace("-pp", "++");
                [readme, help]
                    .iter()
                    .any(|text| !text.contains(name) && !text.contains(&as_authors))
            })
            .collect();
        assert!(
            missing.is_empty(),
            "models/README.md or the help of --llie lacks {missing:?}"
        );
    }
}
