//! ONNX file of an enhancer, with its sidecar and digest: [`ModelFile`].
//!
//! Lookup of built-in enhancers by name: [`find_built_in`].
//!
//! Weights of an ONNX model, and the flushing of subnormal ones to zero: [`Weights`].
//!
//! Training with weight decay leaves subnormal weights, below 2⁻¹²⁶. They do not affect the image, but cost some
//! processors a hundred cycles per operation. A quarter of Zero-DCE's published weights is subnormal: they made it
//! about 45 times slower on an Intel Xeon, and no slower on an AMD EPYC. ONNX Runtime's option
//! `session.set_denormal_as_zero` takes effect only in the thread that creates the first session of a process. So the
//! weights themselves are set to zero before a session is created; the images of Zero-DCE stay the same, byte for byte.
//! Weights in external files are not changed, because such models are loaded by path; for them, only the option
//! applies.
//!
//! Field numbers are those of `onnx/onnx.proto` (IR version 13).

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;

use super::protobuf::{FieldValue, Malformed, OnnxMessage, byte_fields, fields, without_value_info};
use crate::conventions::preset::{Preset, PresetOutputs};
use crate::conventions::sidecar::{self, ModelSidecar, OutputChoice};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::text::{is_in_names, nearest};
use darkqa_base::types::{Digest, EnhancerName};
use darkqa_models::{BUILT_IN, BuiltIn};

/// An ONNX model with its sidecar, read and checked as far as possible without ONNX Runtime.
#[derive(Debug)]
pub struct ModelFile {
    /// The argument that names the model, as the user wrote it.
    pub(crate) argument: PathBuf,
    /// Path of the file; for a built-in enhancer, its name in messages.
    pub(crate) path: PathBuf,
    pub(crate) name: EnhancerName,
    pub(crate) digest: Digest,
    pub(crate) bytes: Vec<u8>,
    pub(crate) weights: Weights,
    /// The sidecar of the model; empty without a file.
    pub(crate) sidecar: ModelSidecar,
    /// The preset, if one was named.
    pub(crate) preset: Option<Preset>,
}

impl ModelFile {
    /// Reads a model: a built-in enhancer (`lift`, `gray-gain`), `FILE.onnx` or `PRESET:FILE.onnx`.
    ///
    /// Also reads the optional sidecar `FILE.onnx.toml` and the files of external data.
    ///
    /// # Errors
    /// If a file cannot be read or is not an ONNX model, its name is not an [`EnhancerName`], the sidecar has an
    /// unknown key, or the built-in enhancer or the preset does not exist.
    pub fn read(model: &Path) -> Result<Self> {
        if let Some(built_in) = find_built_in(model)? {
            let path = PathBuf::from(format!("{} (built in)", built_in.name));
            let name = EnhancerName::new(built_in.name)?;
            let bytes = built_in.model.to_vec();
            let file = Self::from_bytes(path, name, None, bytes, built_in.sidecar)?;
            return Ok(Self { argument: model.to_owned(), ..file });
        }
        let (preset, path) = Preset::split(model)?;
        let bytes = read_model(&path)?;
        if let Some(preset) = &preset
            && let Some(other) = preset.other_preset_in_name(&path)
        {
            tracing::warn!(
                "{} is named like a model of preset {other}, but run with preset {}",
                path.display(),
                preset.name
            );
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let name = enhancer_name(&stem)?;
        if name.as_str() != stem {
            tracing::warn!("{} is named {name} in tables and records", path.display());
        }
        let text = sidecar::text_for(&path)?;
        let file = Self::from_bytes(path, name, preset, bytes, &text)?;
        Ok(Self { argument: model.to_owned(), ..file })
    }

    /// Parses an ONNX model and the TOML text of its sidecar, and computes the digest.
    fn from_bytes(
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
            argument: path.clone(),
            path,
            name,
            sidecar,
            preset,
            bytes,
            weights,
        })
    }

    /// The built-in enhancer with this digest; `None` if this version of the program has no such enhancer.
    #[must_use]
    pub fn built_in_with(digest: &str) -> Option<Self> {
        darkqa_models::BUILT_IN
            .iter()
            .filter_map(|built_in| Self::read(Path::new(built_in.name)).ok())
            .find(|file| file.digest.to_string() == digest)
    }

    /// Training data of the model; `None` if neither sidecar nor preset states it.
    #[must_use]
    pub fn trained_on(&self) -> Option<&str> {
        self.sidecar.trained_on.as_deref().or_else(|| {
            let preset = self.preset.as_ref()?;
            preset.content.sidecar.trained_on.as_deref()
        })
    }

    /// Sets the index of the output to read, unless the sidecar states an output. The digest does not change.
    #[must_use]
    pub fn with_output(mut self, index: usize) -> Self {
        let stated = &mut self.sidecar.output;
        *stated = stated.take().or(Some(OutputChoice::Index(index)));
        self
    }

    /// Name in tables and records: the file name without its extension, or the name of the built-in enhancer.
    #[must_use]
    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// Leaves the shapes of intermediate tensors out of a model with a Fourier transform; returns true if it had such
    /// shapes.
    pub(crate) fn leave_out_wrong_shapes(&mut self) -> bool {
        let Some(bytes) = without_value_info(&self.bytes) else {
            return false;
        };
        self.weights = Weights::find(&bytes).unwrap_or_default();
        self.bytes = bytes;
        true
    }

    /// Path of the file; for a built-in enhancer, its name in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Digest of everything that affects opening and probing the model.
    ///
    /// Unlike [`digest`](Self::digest), it depends on whether a value comes from the sidecar or from the preset, which
    /// changes the described convention but not the images.
    ///
    /// # Errors
    /// If a number of the sidecar is infinite or NaN.
    pub fn probe_digest(&self) -> Result<Digest> {
        let preset = self.preset.as_ref().map(|preset| &preset.name);
        let facts = (self.digest, &self.sidecar, preset);
        Digest::canonical("darkqa.enhancer-stated/1", &facts)
    }

    /// Digest of the model, its external data, and the convention of sidecar and preset.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.digest
    }
}

/// Name of an enhancer whose file has this stem. Each run of characters other than ASCII letters, digits, `_`, `-` and
/// `.` becomes `-`.
///
/// A stem that is not ASCII gets a suffix, the first 6 hexadecimal digits of its digest, because such stems often
/// differ only in the replaced characters.
fn enhancer_name(stem: &str) -> Result<EnhancerName> {
    if stem.chars().all(is_in_names) {
        return EnhancerName::new(stem);
    }
    let mut name = stem.split(|c: char| !is_in_names(c)).filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-");
    if !stem.is_ascii() {
        let digest = Digest::from_bytes(stem.as_bytes()).to_string();
        let digits = digest.rsplit(':').next().unwrap_or_default();
        let suffix: String = digits.chars().take(6).collect();
        name = [name, suffix].join("-");
    }
    EnhancerName::new(name.trim_matches('-'))
}

/// Input of an enhancer's digest: everything that determines an enhanced image, except the image before enhancement.
#[derive(Serialize)]
struct EnhancementFacts<'a> {
    file: Digest,
    /// Digests of the files of external data, by the `location` stated in the model.
    external: BTreeMap<&'a str, Digest>,
    convention: ModelSidecar,
    /// Rules of the preset for choosing an output, if they apply.
    outputs: Option<PresetOutputs<'a>>,
}

/// Digest of a model's bytes, its external data, and the convention of sidecar and preset.
///
/// Files of external data are read and hashed one after another, so that only one is in memory at a time.
fn digest(
    path: &Path,
    bytes: &[u8],
    sidecar: &ModelSidecar,
    weights: &Weights,
    preset: Option<&Preset>,
) -> Result<Digest> {
    let mut external = BTreeMap::new();
    for (location, size) in &weights.external {
        let file = external_path(path, location)?;
        let content = read_weights(path, &file, *size)?;
        external.insert(location.as_ref(), Digest::from_bytes(&content));
    }
    let sidecar = sidecar.clone();
    let convention = match preset {
        None => sidecar,
        Some(preset) => sidecar.with_defaults(&preset.content.sidecar),
    };
    // The preset chooses the output unless the convention states `output` or `image`, or the model has only one output.
    let preset_chooses_output = convention.output.is_none() && convention.image.is_none() && output_count(bytes) != 1;
    let facts = EnhancementFacts {
        file: Digest::from_bytes(bytes),
        external,
        convention: convention.without_defaults(),
        outputs: preset.filter(|_| preset_chooses_output).map(Preset::outputs),
    };
    Digest::canonical("darkqa.enhancer/2", &facts)
}

/// Number of outputs of a model: field 12 of its `GraphProto`, which is field 7 of the `ModelProto`
/// (`onnx/onnx.proto`).
fn output_count(model: &[u8]) -> usize {
    byte_fields(model, 0..model.len(), 7).map(|graph| byte_fields(model, graph, 12).count()).sum()
}

/// Path of a file of external data.
///
/// # Errors
/// If the file is not in the model's folder or a subfolder, by its name or by a link. ONNX Runtime refuses such names
/// too, and not in every version such links.
fn external_path(model: &Path, location: &str) -> Result<PathBuf> {
    let relative = Path::new(location);
    let is_inside = relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let folder = model.with_file_name("");
    let path = folder.join(relative);
    if is_inside && !location.is_empty() && !leads_out(model, &path) {
        return Ok(path);
    }
    Err(Error::Enhancer {
        path: model.to_owned(),
        problem: format!(
            "has its weights in {location:?}, outside its folder; copy them there as a file of their own, or export it again with the weights in \
             the same folder"
        ),
    })
}

/// True if a file exists and is, with links resolved, neither below the model's folder nor below the folder that the
/// model itself is a link into: in a hub's cache, both are links into one folder.
fn leads_out(model: &Path, file: &Path) -> bool {
    let Ok(real) = file.canonicalize() else {
        return false;
    };
    let folder = match model.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let model = model.canonicalize().ok();
    let own = model.as_deref().and_then(Path::parent);
    let folders = [folder.canonicalize().ok(), own.map(Path::to_owned)];
    !folders.iter().flatten().any(|folder| real.starts_with(folder))
}

/// Reads a file of external data.
///
/// # Errors
/// If the file is missing, shorter than `min_size` bytes, or cannot be read.
fn read_weights(model: &Path, file: &Path, min_size: u64) -> Result<Vec<u8>> {
    let problem = match std::fs::metadata(file) {
        Ok(data) if data.len() >= min_size => return files::at_most(file, MAX_WEIGHTS_BYTES),
        Ok(data) => format!(
            "its weights are incomplete: {} has {} of {min_size} bytes; copy or download it again",
            file.display(),
            data.len()
        ),
        Err(e) if e.kind() == ErrorKind::NotFound => format!(
            "its weights are missing: {}; copy this file to the same folder, or export the model as one file (external_data=False)",
            file.display()
        ),
        Err(e) => return Err(Error::file(file, "read", e)),
    };
    Err(Error::Enhancer { path: model.to_owned(), problem })
}

/// Maximum size of a file of external data, in bytes (chosen): 100 times the largest published enhancers.
const MAX_WEIGHTS_BYTES: u64 = 1 << 36;

/// Maximum size of an ONNX file, in bytes: the limit of a protobuf message (2³¹ − 1,
/// <https://protobuf.dev/programming-guides/encoding/>).
const MAX_MODEL_BYTES: u64 = i32::MAX as u64;

/// Reads an ONNX file.
///
/// # Errors
/// If the file is missing, cannot be read, or is larger than [`MAX_MODEL_BYTES`]. A file that is too large is not read.
fn read_model(path: &Path) -> Result<Vec<u8>> {
    let size = std::fs::metadata(path)
        .map_err(|e| match e.kind() {
            ErrorKind::NotFound => Error::usage("--llie", format_args!("{}: no such file", path.display())),
            _ => Error::file(path, "read", e),
        })?
        .len();
    if size > MAX_MODEL_BYTES {
        return Err(Error::Enhancer {
            path: path.to_owned(),
            problem: format!(
                "has {:.1} GB, but an ONNX file can have at most 2.1 GB; export it with its weights in a separate file (external_data=True)",
                size as f64 / 1e9
            ),
        });
    }
    files::at_most(path, MAX_MODEL_BYTES)
}

fn not_onnx(path: &Path, bytes: &[u8]) -> Error {
    let problem = if bytes.starts_with(b"version https://git-lfs") {
        "is a Git LFS pointer, not a model; fetch the model itself with `git lfs pull`"
    } else {
        "is not a complete ONNX model; download it again, or export it to ONNX if it is a PyTorch or TensorFlow model"
    };
    Error::Enhancer { path: path.to_owned(), problem: problem.to_owned() }
}

/// Finds the built-in enhancer named by the argument of `--llie`. `None` if the argument is a path: it has an
/// extension, a folder or a colon. So a file in the current folder that is named `lift` is never confused with the
/// enhancer.
///
/// # Errors
/// If the argument is neither a path nor the name of a built-in enhancer.
fn find_built_in(word: &Path) -> Result<Option<&'static BuiltIn>> {
    let Some(text) = word.to_str() else {
        return Ok(None);
    };
    if word.extension().is_some() || text.contains(['/', '\\', ':']) {
        return Ok(None);
    }
    BUILT_IN.iter().find(|enhancer| enhancer.name == text).map(Some).ok_or_else(|| {
        let names = BUILT_IN.map(|enhancer| enhancer.name);
        let near = nearest(text, &names);
        let near = near.map_or_else(String::new, |name| format!("; did you mean {name}?"));
        let names = names.join(", ");
        let problem = format_args!(
            "{text:?} is not a built-in enhancer ({names}); a file is named with extension or folder, {text}.onnx or ./{text}, and a \
             preset with its file, zero-dce:FILE.onnx{near}"
        );
        Error::usage("--llie", problem)
    })
}

/// Positions of the 32-bit floats in a model, and its files of external data.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Weights {
    /// Byte ranges of little-endian 32-bit floats.
    floats: Vec<Range<usize>>,
    /// Files of external data: their `location`, relative to the model's folder, and their minimum size in bytes.
    pub(crate) external: BTreeMap<String, u64>,
}

impl Weights {
    /// Finds the weights of a `ModelProto`: in its graph, subgraphs, functions and constants.
    ///
    /// # Errors
    /// If the bytes are not a protobuf message, or have no graph.
    pub(super) fn find(model: &[u8]) -> Result<Self, Malformed> {
        let mut weights = Self::default();
        let mut has_graph = false;
        // A stack instead of recursion, so that deep nesting cannot overflow the call stack.
        let mut stack = vec![(OnnxMessage::Model, 0..model.len())];
        while let Some((message, range)) = stack.pop() {
            if let OnnxMessage::Tensor = message {
                weights.add_tensor(model, range)?;
                continue;
            }
            has_graph |= matches!(message, OnnxMessage::Graph);
            for field in fields(model, range) {
                if let (number, FieldValue::Bytes(bytes)) = field?
                    && let Some(child) = message.child(number)
                {
                    stack.push((child, bytes));
                }
            }
        }
        if has_graph { Ok(weights) } else { Err(Malformed) }
    }

    /// Adds the positions of the floats of a `TensorProto`, or its file of external data.
    fn add_tensor(&mut self, model: &[u8], range: Range<usize>) -> Result<(), Malformed> {
        const FLOAT: u64 = 1;
        const EXTERNAL: u64 = 1;
        let (mut data_type, mut location) = (0, 0);
        let (mut floats, mut entries) = (Vec::new(), BTreeMap::new());
        for field in fields(model, range) {
            match field? {
                (2, FieldValue::Varint(value)) => data_type = value,
                (14, FieldValue::Varint(value)) => location = value,
                // float_data, packed or one by one; raw_data
                (4 | 9, FieldValue::Bytes(bytes)) | (4, FieldValue::Fixed32(bytes)) => {
                    floats.push(bytes);
                }
                (13, FieldValue::Bytes(entry)) => entries.extend(read_entry(model, entry)?),
                _ => {}
            }
        }
        if location == EXTERNAL {
            let [offset, length] = ["offset", "length"]
                .map(|key| entries.get(key).and_then(|text: &String| text.parse().ok()).unwrap_or(0_u64));
            let end = offset.saturating_add(length);
            if let Some(location) = entries.get("location") {
                let size = self.external.entry(location.clone()).or_default();
                *size = end.max(*size);
            }
        } else if data_type == FLOAT {
            self.floats.extend(floats);
        }
        Ok(())
    }

    /// Sets every subnormal float of `model` to zero, keeping its sign; returns the number of changed floats.
    ///
    /// `model` must be the buffer that was passed to [`Weights::find`].
    pub(crate) fn flush_subnormals(&self, model: &mut [u8]) -> usize {
        let mut flushed = 0;
        for range in &self.floats {
            let bytes = model.get_mut(range.clone()).unwrap_or_default();
            let (floats, _) = bytes.as_chunks_mut::<4>();
            for float in floats {
                let value = f32::from_le_bytes(*float);
                if value.is_subnormal() {
                    *float = 0.0_f32.copysign(value).to_le_bytes();
                    flushed += 1;
                }
            }
        }
        flushed
    }
}

/// Key and value of a `StringStringEntryProto`; `None` if one is missing.
fn read_entry(model: &[u8], entry: Range<usize>) -> Result<Option<(String, String)>, Malformed> {
    let (mut key, mut value) = (None, None);
    for field in fields(model, entry) {
        match field? {
            (1, FieldValue::Bytes(bytes)) => key = model.get(bytes),
            (2, FieldValue::Bytes(bytes)) => value = model.get(bytes),
            _ => {}
        }
    }
    let (Some(key), Some(value)) = (key, value) else {
        return Ok(None);
    };
    Ok(Some((decode_utf8(key)?, decode_utf8(value)?)))
}

fn decode_utf8(bytes: &[u8]) -> Result<String, Malformed> {
    String::from_utf8(bytes.to_vec()).map_err(|_| Malformed)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Protobuf field with fewer than 128 bytes of content.
    fn field(number: u8, content: &[u8]) -> Vec<u8> {
        [&[number << 3 | 2, content.len() as u8], content].concat()
    }

    /// ONNX model with `ir_version = 8` and one initialiser, whose external data is in `location`.
    fn model(location: &str) -> Vec<u8> {
        let entry = [field(1, b"location"), field(2, location.as_bytes())].concat();
        let tensor = [&[16, 1, 14 << 3, 1], field(13, &entry).as_slice()].concat();
        [&[8, 8], field(7, &field(5, &tensor)).as_slice()].concat()
    }

    /// Digest of the model `a.onnx` in a folder, after writing its sidecar.
    fn digest_with_sidecar(folder: &Path, sidecar: &str) -> Digest {
        std::fs::write(folder.join("a.onnx.toml"), sidecar).unwrap();
        ModelFile::read(&folder.join("a.onnx")).unwrap().digest()
    }

    #[test]
    fn digest_changes_with_every_file() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        std::fs::write(folder.join("a.onnx"), model("a.bin")).unwrap();
        std::fs::write(folder.join("a.bin"), [1]).unwrap();
        let first = digest_with_sidecar(folder, "");
        assert_eq!(first, digest_with_sidecar(folder, ""));
        std::fs::write(folder.join("a.bin"), [2]).unwrap();
        let other_weights = digest_with_sidecar(folder, "");
        let other_sidecar = digest_with_sidecar(folder, "output = 0");
        std::fs::write(folder.join("a.onnx"), model("./a.bin")).unwrap();
        let other_model = digest_with_sidecar(folder, "output = 0");
        let all = [first, other_weights, other_sidecar, other_model];
        for (i, digest) in all.iter().enumerate() {
            assert!(!all[..i].contains(digest), "{i}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn weights_are_not_read_through_links_out_of_the_folder() {
        use std::os::unix::fs::symlink;

        let outer = tempfile::tempdir().unwrap();
        let path = |name: &str| outer.path().join(name);
        for folder in ["own", "cache", "private"] {
            std::fs::create_dir(path(folder)).unwrap();
        }
        std::fs::write(path("private/a.bin"), [1]).unwrap();
        std::fs::write(path("own/a.onnx"), model("a.bin")).unwrap();
        symlink(path("private/a.bin"), path("own/a.bin")).unwrap();
        let refused = ModelFile::read(&path("own/a.onnx")).unwrap_err();
        assert!(refused.to_string().contains("outside its folder"), "{refused}");
        std::fs::remove_file(path("own/a.bin")).unwrap();
        std::fs::copy(path("private/a.bin"), path("own/a.bin")).unwrap();
        assert!(ModelFile::read(&path("own/a.onnx")).is_ok());
        // In a hub's cache, the model and its weights are links into the same folder.
        for name in ["a.onnx", "a.bin"] {
            symlink(path("own").join(name), path("cache").join(name)).unwrap();
        }
        assert!(ModelFile::read(&path("cache/a.onnx")).is_ok());
    }

    #[test]
    fn stating_a_default_does_not_change_the_digest() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        std::fs::write(folder.join("a.onnx"), model("a.bin")).unwrap();
        std::fs::write(folder.join("a.bin"), [1]).unwrap();
        let bare = digest_with_sidecar(folder, "");
        for same in [
            "# a remark",
            "color = \"rgb\"\npad = \"reflect\"\nrounding = \"round\"",
            "multiple = 1\nmean = [0, 0, 0]\nstd = [1, 1, 1]",
            "trained_on = \"LOL-v1\"",
            "[extra]",
        ] {
            assert_eq!(digest_with_sidecar(folder, same), bare, "{same}");
        }
        for other in ["color = \"bgr\"", "mean = [0.1, 0, 0]", "[extra]\na = 0"] {
            assert_ne!(digest_with_sidecar(folder, other), bare, "{other}");
        }
    }

    /// The digest covers the canonical JSON of the keys that the sidecar states, so that new keys do not change the
    /// digests of old files.
    #[test]
    fn digest_covers_only_stated_keys() {
        let folder = tempfile::tempdir().unwrap();
        let file = model("a.bin");
        std::fs::write(folder.path().join("a.onnx"), &file).unwrap();
        std::fs::write(folder.path().join("a.bin"), [1]).unwrap();
        let [weights_digest, file_digest] =
            [&[1][..], &file].map(|bytes| serde_json::to_string(&Digest::from_bytes(bytes)).unwrap());
        for (sidecar, convention) in [
            ("", ""),
            ("color_out = \"rgb\"\nchannels = \"rgb\"\ninput = \"image\"", ""),
            (
                "range_in = \"-1..1\"\noutput = 0\n[extra]\na = 0.5\nb = 1",
                r#""extra":{"a":0.5,"b":1.0},"output":0,"range_in":"-1..1""#,
            ),
            ("image = \"L ^ 0.2 * R\"\n[extra]\nr = { map = 5 }", r#""extra":{"r":{"map":5.0}},"image":"L ^ 0.2 * R""#),
        ] {
            let facts = format!(
                r#"darkqa.enhancer/2{}{{"convention":{{{convention}}},"external":{{"a.bin":{weights_digest}}},"file":{file_digest}}}"#,
                '\0'
            );
            let found = digest_with_sidecar(folder.path(), sidecar);
            assert_eq!(found, Digest::from_bytes(facts.as_bytes()), "{sidecar}");
        }
    }

    #[test]
    fn file_stems_become_enhancer_names() {
        let [plain, spaced, one, other, mixed] = ["zero-dce_v1.2", "zero dce (1)", "低光", "增强", "模型 v2"]
            .map(|stem| enhancer_name(stem).unwrap().to_string());
        assert_eq!(plain, "zero-dce_v1.2");
        assert_eq!(spaced, "zero-dce-1");
        assert!(one.len() == 6 && other.len() == 6 && one != other, "{one} {other}");
        assert!(mixed.starts_with("v2-"));
    }

    #[test]
    fn outputs_are_counted() {
        let graph = [field(12, b""), field(11, b""), field(12, b"")].concat();
        assert_eq!(output_count(&field(7, &graph)), 2);
        assert_eq!(output_count(&model("a.bin")), 0);
        assert_eq!(output_count(&[0xFF]), 0);
    }

    #[test]
    fn unusable_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let cases: [(&str, &[u8], &str); 4] = [
            ("text.onnx", b"not a model", "is not a complete ONNX model"),
            ("lfs.onnx", b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
            ("out.onnx", &model("../secret"), "outside its folder"),
            ("gone.onnx", &model("gone.bin"), "its weights are missing: "),
        ];
        for (name, content, part) in cases {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            let message = ModelFile::read(&path).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
        // A sparse file is too large although it has no data.
        let large = folder.path().join("large.onnx");
        let file = std::fs::File::create(&large).unwrap();
        file.set_len(MAX_MODEL_BYTES + 1).unwrap();
        let message = ModelFile::read(&large).unwrap_err().to_string();
        assert!(message.contains("2.1 GB"), "{message}");
        let missing = ModelFile::read(Path::new("missing.onnx")).unwrap_err();
        assert!(missing.to_string().starts_with("--llie: missing.onnx: no such file"));
    }

    #[test]
    fn built_in_enhancers_equal_their_files() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
        for BuiltIn { name, .. } in BUILT_IN {
            let built_in = ModelFile::read(Path::new(name)).unwrap();
            let file = ModelFile::read(&folder.join(format!("{name}.onnx"))).unwrap();
            assert_eq!(built_in.name(), file.name());
            assert_eq!(built_in.digest(), file.digest(), "{name}");
            assert!(built_in.weights.external.is_empty(), "{name}");
        }
    }

    #[test]
    fn argument_with_extension_or_folder_is_a_file() {
        for file in ["lift.onnx", "./lift", "models/lift", "C:lift", "lift.ort"] {
            assert!(find_built_in(Path::new(file)).unwrap().is_none(), "{file}");
        }
        let typo = find_built_in(Path::new("lfit")).err().unwrap().to_string();
        assert!(typo.contains("did you mean lift?"), "{typo}");
        for wrong in ["lfit", "zerodce", "Lift", ""] {
            let message = find_built_in(Path::new(wrong)).err().unwrap().to_string();
            assert!(message.contains("lift, gray-gain") && message.contains("--llie"), "{message}");
        }
    }

    const SUBNORMAL: f32 = 1e-40;

    /// A length-delimited field of fewer than 128 bytes.
    fn weights_field(number: u8, content: &[u8]) -> Vec<u8> {
        let length = u8::try_from(content.len()).unwrap();
        assert!(number < 16 && length < 128);
        [&[number << 3 | 2, length], content].concat()
    }

    /// A tensor of the given type with its data in the field `number`.
    fn tensor(data_type: u8, number: u8, floats: &[f32]) -> Vec<u8> {
        let bytes: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
        [&[2 << 3, data_type], weights_field(number, &bytes).as_slice()].concat()
    }

    fn weights_model(graph: &[u8]) -> Vec<u8> {
        [&[8, 8], weights_field(7, graph).as_slice()].concat()
    }

    /// Flushes the subnormal weights of a model; returns their number and the changed bytes.
    fn flush(mut bytes: Vec<u8>) -> (usize, Vec<u8>) {
        let count = Weights::find(&bytes).unwrap().flush_subnormals(&mut bytes);
        (count, bytes)
    }

    #[test]
    fn raw_and_packed_weights_are_flushed_with_their_sign() {
        let weights = [1.0, SUBNORMAL, -SUBNORMAL, 0.5, f32::MIN_POSITIVE];
        for number in [4, 9] {
            let (count, bytes) = flush(weights_model(&weights_field(5, &tensor(1, number, &weights))));
            let zeroed = [1.0, 0.0, -0.0, 0.5, f32::MIN_POSITIVE];
            let expected = weights_model(&weights_field(5, &tensor(1, number, &zeroed)));
            assert_eq!((count, bytes), (2, expected));
        }
    }

    #[test]
    fn unpacked_weights_are_flushed() {
        let tensor = [&[16, 1, 0x25], SUBNORMAL.to_le_bytes().as_slice()].concat();
        let (count, bytes) = flush(weights_model(&weights_field(5, &tensor)));
        assert_eq!(count, 1);
        assert!(bytes.ends_with(&[0; 4]));
    }

    #[test]
    fn weights_in_constants_and_subgraphs_are_flushed() {
        let tensor = tensor(1, 9, &[SUBNORMAL]);
        let constant = weights_field(1, &weights_field(5, &weights_field(5, &tensor)));
        let inside = weights_field(1, &weights_field(5, &weights_field(6, &weights_field(5, &tensor))));
        for graph in [constant, inside] {
            assert_eq!(flush(weights_model(&graph)).0, 1);
        }
    }

    #[test]
    fn other_types_keep_their_bytes() {
        // The same bytes as int64 (data type 7).
        let bytes = weights_model(&weights_field(5, &tensor(7, 9, &[SUBNORMAL; 2])));
        assert_eq!(flush(bytes.clone()), (0, bytes));
    }

    #[test]
    fn external_data_is_listed_with_its_minimum_size() {
        let entry = [weights_field(1, b"location"), weights_field(2, b"weights.bin")].concat();
        let offset = [weights_field(1, b"offset"), weights_field(2, b"8")].concat();
        let length = [weights_field(1, b"length"), weights_field(2, b"12")].concat();
        let content = [
            &[16, 1, 14 << 3, 1],
            weights_field(13, &entry).as_slice(),
            &weights_field(13, &offset),
            &weights_field(13, &length),
        ]
        .concat();
        let weights = Weights::find(&weights_model(&weights_field(5, &content))).unwrap();
        let expected = BTreeMap::from([("weights.bin".to_owned(), 20)]);
        assert_eq!(weights.external, expected);
        assert!(weights.floats.is_empty());
    }

    #[test]
    fn bytes_that_are_not_a_model_are_refused() {
        let cases: [&[u8]; 5] = [
            b"",
            b"hello",
            b"version https://git-lfs.github.com/spec/v1",
            b"<html>",
            &[8, 8], // a version and no graph
        ];
        for bytes in cases {
            assert_eq!(Weights::find(bytes), Err(Malformed), "{bytes:?}");
        }
    }

    #[test]
    fn deep_nesting_is_searched() {
        // Lengths beyond 127 need longer varints than `field` writes.
        let mut graph = Vec::new();
        for _ in 0..20_000 {
            for number in [6, 5, 1] {
                let mut length = graph.len();
                let mut wrapped = vec![number << 3 | 2];
                while length > 127 {
                    wrapped.push(length as u8 | 0x80);
                    length >>= 7;
                }
                wrapped.push(length as u8);
                // Built in reverse, so that wrapping is cheap.
                graph.extend(wrapped.into_iter().rev());
            }
        }
        graph.reverse();
        let mut bytes = vec![7 << 3 | 2];
        let mut length = graph.len();
        while length > 127 {
            bytes.push(length as u8 | 0x80);
            length >>= 7;
        }
        bytes.push(length as u8);
        bytes.extend(graph);
        assert_eq!(Weights::find(&bytes), Ok(Weights::default()));
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_cause_no_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut bytes = bytes;
            if let Ok(weights) = Weights::find(&bytes) {
                weights.flush_subnormals(&mut bytes);
            }
        }

        #[test]
        fn damaged_models_cause_no_panic(
            cut in 0_usize..60,
            at in 0_usize..60,
            byte in any::<u8>(),
        ) {
            let mut bytes = weights_model(&weights_field(5, &tensor(1, 9, &[SUBNORMAL; 4])));
            let length = bytes.len();
            bytes[at % length] = byte;
            bytes.truncate(length - cut % length);
            if let Ok(weights) = Weights::find(&bytes) {
                weights.flush_subnormals(&mut bytes);
            }
        }
    }
}
