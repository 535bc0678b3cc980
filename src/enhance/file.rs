//! An enhancement model on disk: [`ModelFile`].

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;

use crate::error::{Error, Result};
use crate::types::{Digest, EnhancerName};

use super::built_in::BuiltIn;
use super::preset::Preset;
use super::sidecar::{self, ModelSidecar};
use super::weights::Weights;

/// An ONNX file with its sidecar, read and checked as far as possible without ONNX Runtime.
#[derive(Debug)]
pub struct ModelFile {
    /// Path of the file; for an enhancer of the program, what messages call it.
    pub(super) path: PathBuf,
    pub(super) name: EnhancerName,
    pub(super) digest: Digest,
    pub(super) bytes: Vec<u8>,
    pub(super) weights: Weights,
    /// The user's sidecar; empty if there is none.
    pub(super) sidecar: ModelSidecar,
    /// The preset, if one was named.
    pub(super) preset: Option<Preset>,
}

impl ModelFile {
    /// Reads a model: an enhancer of the program (`lift`, `gray-gain`), or `FILE.onnx` or `PRESET:FILE.onnx` with its sidecar
    /// `FILE.onnx.toml` if there is one, and the files of its external data.
    ///
    /// # Errors
    /// If a file cannot be read or is not an ONNX model, its name is not an [`EnhancerName`], the sidecar has an unknown key,
    /// or the enhancer of the program or the preset does not exist.
    pub fn read(model: &Path) -> Result<Self> {
        if let Some(built_in) = BuiltIn::named(model)? {
            let path = PathBuf::from(format!("{} (built in)", built_in.name));
            let name = EnhancerName::new(built_in.name)?;
            return Self::of(path, name, None, built_in.model.to_vec(), built_in.sidecar);
        }
        let (preset, path) = Preset::split(model)?;
        let bytes = std::fs::read(&path).map_err(|e| Error::file(&path, "read", e))?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let name = EnhancerName::new(&stem)?;
        let text = sidecar::text_for(&path)?;
        Self::of(path, name, preset, bytes, &text)
    }

    /// The model of these bytes, with the text of its sidecar.
    fn of(
        path: PathBuf,
        name: EnhancerName,
        preset: Option<Preset>,
        bytes: Vec<u8>,
        sidecar: &str,
    ) -> Result<Self> {
        let weights = Weights::find(&bytes).map_err(|_| not_onnx(&path, &bytes))?;
        let sidecar = ModelSidecar::parse(&path, sidecar)?;
        Ok(Self {
            digest: digest(&path, &bytes, &sidecar, &weights, preset.as_ref())?,
            path,
            name,
            sidecar,
            preset,
            bytes,
            weights,
        })
    }

    /// Name in tables and records: the file's name without its extension, or that of an enhancer of the program.
    #[must_use]
    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// Digest of the model, its external data, and the convention of sidecar and preset.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.digest
    }
}

/// Content of an enhancer's digest: all that decides an enhanced image, except the degraded one.
#[derive(Serialize)]
struct EnhancementFacts<'a> {
    file: Digest,
    /// Digests of external data, by the location that the model states.
    external: BTreeMap<&'a str, Digest>,
    convention: ModelSidecar,
}

/// Digest of a model's content, its external data and the convention of sidecar and preset. Each file is hashed alone, so
/// that only one is in memory at a time.
fn digest(
    path: &Path,
    bytes: &[u8],
    sidecar: &ModelSidecar,
    weights: &Weights,
    preset: Option<&Preset>,
) -> Result<Digest> {
    let mut external = BTreeMap::new();
    for location in &weights.external {
        let file = external_path(path, location)?;
        let content = std::fs::read(&file).map_err(|e| Error::file(file, "read", e))?;
        external.insert(location.as_ref(), Digest::of(&content));
    }
    let sidecar = sidecar.clone();
    let convention = match preset {
        None => sidecar,
        Some(preset) => sidecar.with_defaults(&preset.convention),
    };
    let facts = EnhancementFacts {
        file: Digest::of(bytes),
        external,
        convention: convention.without_defaults(),
    };
    Digest::canonical("darkqa.enhancer/2", &facts)
}

/// Path of a file with external data, which must be in the model's folder or below (ONNX Runtime refuses others too).
fn external_path(model: &Path, location: &str) -> Result<PathBuf> {
    let relative = Path::new(location);
    let inside = relative
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if !inside || location.is_empty() {
        return Err(Error::Enhancer {
            path: model.to_owned(),
            problem: format!(
                "names {location:?} as a file of its weights, which is outside its folder; export it again with the weights beside it"
            ),
        });
    }
    Ok(model.with_file_name("").join(relative))
}

fn not_onnx(path: &Path, bytes: &[u8]) -> Error {
    let problem = if bytes.starts_with(b"version https://git-lfs") {
        "is a Git LFS pointer, not a model; fetch the model itself with `git lfs pull`"
    } else {
        "is not a complete ONNX model; download it again, or export it to ONNX if it is a PyTorch or TensorFlow model"
    };
    Error::Enhancer {
        path: path.to_owned(),
        problem: problem.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `ir_version = 8` and a graph with only one initialiser, whose external data is in `location`.
    fn model(location: &str) -> Vec<u8> {
        let field = |number: u8, content: &[u8]| {
            [&[number << 3 | 2, content.len() as u8], content].concat()
        };
        let entry = [field(1, b"location"), field(2, location.as_bytes())].concat();
        let tensor = [&[16, 1, 14 << 3, 1], field(13, &entry).as_slice()].concat();
        [&[8, 8], field(7, &field(5, &tensor)).as_slice()].concat()
    }

    #[test]
    fn the_digest_changes_with_every_part() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, content: &[u8]| {
            std::fs::write(folder.path().join(name), content).unwrap();
        };
        let digest = || {
            ModelFile::read(&folder.path().join("a.onnx"))
                .unwrap()
                .digest()
        };
        write("a.onnx", &model("a.bin"));
        write("a.bin", &[1]);
        let first = digest();
        assert_eq!(first, digest());
        write("a.bin", &[2]);
        let second = digest();
        write("a.onnx.toml", b"output = 0");
        let third = digest();
        write("a.onnx", &model("./a.bin"));
        let all = [first, second, third, digest()];
        for (i, digest) in all.iter().enumerate() {
            assert!(!all[..i].contains(digest), "{i}");
        }
    }

    #[test]
    fn stating_a_default_does_not_change_the_digest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.onnx");
        std::fs::write(&path, model("a.bin")).unwrap();
        std::fs::write(folder.path().join("a.bin"), [1]).unwrap();
        let digest = |sidecar: &str| {
            std::fs::write(folder.path().join("a.onnx.toml"), sidecar).unwrap();
            ModelFile::read(&path).unwrap().digest()
        };
        let bare = digest("");
        for same in [
            "# a remark",
            "color = \"rgb\"\npad = \"reflect\"\nrounding = \"round\"",
            "multiple = 1\nmean = [0, 0, 0]\nstd = [1, 1, 1]",
            "[extra]",
        ] {
            assert_eq!(digest(same), bare, "{same}");
        }
        for other in ["color = \"bgr\"", "mean = [0.1, 0, 0]", "[extra]\na = 0"] {
            assert_ne!(digest(other), bare, "{other}");
        }
    }

    #[test]
    fn a_file_that_cannot_be_used_is_refused_with_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let cases: [(&str, &[u8], &str); 5] = [
            ("text.onnx", b"not a model", "is not a complete ONNX model"),
            (
                "lfs.onnx",
                b"version https://git-lfs.github.com/spec/v1\n",
                "git lfs pull",
            ),
            ("out.onnx", &model("../secret"), "outside its folder"),
            ("gone.onnx", &model("gone.bin"), "gone.bin: cannot read"),
            ("a b.onnx", &model("x"), "rename the file"),
        ];
        for (name, content, part) in cases {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            let message = ModelFile::read(&path).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
        let missing = ModelFile::read(Path::new("missing.onnx")).unwrap_err();
        assert!(
            missing
                .to_string()
                .starts_with("missing.onnx: cannot read: ")
        );
    }
}
