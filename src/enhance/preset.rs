//! Conventions of published models, as their authors' code has them: [`Preset`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::sidecar::ModelSidecar;
use crate::error::{Error, Result};

/// TOML file of all presets, a sidecar each.
const PRESETS: &str = include_str!("presets.toml");

/// Convention of a published model.
#[derive(Debug)]
pub(super) struct Preset {
    /// Name as the user gave it, as `zero-dce`.
    pub(super) name: String,
    /// Statements of the preset, in the form of a sidecar.
    pub(super) convention: ModelSidecar,
}

impl Preset {
    /// Splits `zero-dce:FILE` into preset and file; there is no preset if `model` is only a file.
    ///
    /// # Errors
    /// If the word before the colon is not a preset, and the whole is not a file.
    pub(super) fn split(model: &Path) -> Result<(Option<Self>, PathBuf)> {
        let text = model.to_string_lossy();
        let Some((name, file)) = text.split_once(':').filter(|_| !model.exists()) else {
            return Ok((None, model.to_owned()));
        };
        // The colon belongs to a drive of Windows, or to a path.
        if name.len() < 2 || name.contains(['/', '\\', '.']) {
            return Ok((None, model.to_owned()));
        }
        let mut all: BTreeMap<String, ModelSidecar> =
            toml::from_str(PRESETS).map_err(|e| Error::data("presets.toml", e))?;
        // The authors write Zero-DCE++; the key of the file is zero-dce-pp.
        let known = name.replace("++", "-pp");
        let Some(convention) = all.remove(&known) else {
            let names = all.into_keys().collect::<Vec<_>>().join(", ");
            let problem =
                format_args!("{name:?} before the colon is not a preset; the presets are {names}");
            return Err(Error::usage("--llie", problem));
        };
        let name = name.to_owned();
        Ok((Some(Self { name, convention }), PathBuf::from(file)))
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
            let model = format!("{name}:a/b.onnx");
            let (preset, file) = Preset::split(Path::new(&model)).unwrap();
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
