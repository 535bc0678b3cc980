//! What is stated about a model, by a user beside it, in `MODEL.onnx.toml`, or by a preset: [`ModelSidecar`].

use std::collections::BTreeMap;
use std::fmt;
use std::io::ErrorKind;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::convention::{ChannelOrder, Padding, Rounding, TensorLayout, Tile, ValueRange};
use crate::error::{Error, Result};

/// The statements of a sidecar; every key may be missing, an unknown key is an error.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ModelSidecar {
    /// The dimensions of the input.
    pub(super) layout_in: Option<TensorLayout>,
    /// Those of the output.
    pub(super) layout_out: Option<TensorLayout>,
    /// The order of channels, of both.
    pub(super) color: Option<ChannelOrder>,
    /// What black and white are in the input.
    pub(super) range_in: Option<ValueRange>,
    /// What they are in the output.
    pub(super) range_out: Option<ValueRange>,
    /// Taken from each channel of the input, in its order and range.
    pub(super) mean: Option<[f32; 3]>,
    /// What each channel is then divided by.
    pub(super) std: Option<[f32; 3]>,
    /// Of what the height and the width must be multiples.
    pub(super) multiple: Option<NonZeroUsize>,
    /// What fills an image up to a multiple.
    pub(super) pad: Option<Padding>,
    /// Which output is the enhanced image.
    pub(super) output: Option<OutputChoice>,
    /// Whether tiles are exact.
    pub(super) tile: Option<Tile>,
    /// How a value becomes a byte.
    pub(super) rounding: Option<Rounding>,
    /// The values of further inputs of one number each.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) extra: BTreeMap<String, f32>,
}

/// An output by its place, counted from 0, or by its name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "`output` is an index from 0 or a name in quotes"
)]
pub(super) enum OutputChoice {
    /// Its place among the outputs, from 0.
    Index(usize),
    /// Its name.
    Name(String),
}

impl fmt::Display for OutputChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "output = {index}"),
            Self::Name(name) => write!(f, "output = {name:?}"),
        }
    }
}

/// The path of a model's sidecar: the model's own with `.toml` after it.
pub(super) fn path_for(model: &Path) -> PathBuf {
    let mut path = model.as_os_str().to_owned();
    path.push(".toml");
    path.into()
}

/// The text of the sidecar of a model; empty where there is none.
pub(super) fn text_for(model: &Path) -> Result<String> {
    let path = path_for(model);
    match std::fs::read_to_string(&path) {
        Ok(text) => Ok(text),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(String::new()),
        Err(error) => Err(Error::file(path, "read", error)),
    }
}

impl ModelSidecar {
    /// Reads the text of the sidecar of `model`.
    ///
    /// # Errors
    /// With the file: an unknown key, or a value that cannot be.
    pub(super) fn parse(model: &Path, text: &str) -> Result<Self> {
        let wrong = |problem: &str| {
            Error::data(
                path_for(model).display(),
                format_args!("{problem}; models/README.md has all keys"),
            )
        };
        let read: Self = toml::from_str(text).map_err(|e| wrong(e.message()))?;
        let finite = |numbers: Option<[f32; 3]>| numbers.into_iter().flatten().all(f32::is_finite);
        if !finite(read.mean) || !finite(read.std) || read.std.is_some_and(|std| std.contains(&0.0))
        {
            return Err(wrong("mean and std are three numbers each, std not 0"));
        }
        if let Some((name, value)) = read.extra.iter().find(|(_, value)| !value.is_finite()) {
            return Err(wrong(&format!(
                "extra.{name} is {value}; a number expected"
            )));
        }
        Ok(read)
    }

    /// The same without the statements that say what holds anyway: two sidecars that mean the same have one digest.
    pub(super) fn resolved(self) -> Self {
        fn unless<T: PartialEq>(stated: Option<T>, usual: &T) -> Option<T> {
            stated.filter(|stated| stated != usual)
        }
        Self {
            color: unless(self.color, &ChannelOrder::default()),
            mean: unless(self.mean, &[0.0; 3]),
            std: unless(self.std, &[1.0; 3]),
            multiple: unless(self.multiple, &NonZeroUsize::MIN),
            pad: unless(self.pad, &Padding::default()),
            rounding: unless(self.rounding, &Rounding::default()),
            ..self
        }
    }

    /// What is stated here, and for the rest what a preset states.
    pub(super) fn over(self, preset: &Self) -> Self {
        let mut extra = preset.extra.clone();
        extra.extend(self.extra);
        Self {
            layout_in: self.layout_in.or(preset.layout_in),
            layout_out: self.layout_out.or(preset.layout_out),
            color: self.color.or(preset.color),
            range_in: self.range_in.or(preset.range_in),
            range_out: self.range_out.or(preset.range_out),
            mean: self.mean.or(preset.mean),
            std: self.std.or(preset.std),
            multiple: self.multiple.or(preset.multiple),
            pad: self.pad.or(preset.pad),
            output: self.output.or_else(|| preset.output.clone()),
            tile: self.tile.or(preset.tile),
            rounding: self.rounding.or(preset.rounding),
            extra,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_read() {
        let text = r#"
            layout_in = "nhwc"
            layout_out = "chw"
            color = "bgr"
            range_in = "0..255"
            range_out = "-1..1"
            mean = [0.5, 0.5, 0.5]
            std = [1, 1, 1]
            multiple = 8
            pad = "replicate"
            output = "enhanced"
            tile = "exact:12"
            rounding = "truncate"
            [extra]
            exposure = 0.5
        "#;
        let read = ModelSidecar::parse(Path::new("m.onnx"), text).unwrap();
        assert_eq!(read.layout_in, Some(TensorLayout::Nhwc));
        assert_eq!(read.tile, Some(Tile::Exact(12)));
        assert_eq!(read.extra, [("exposure".to_owned(), 0.5)].into());
        assert_eq!(read.output, Some(OutputChoice::Name("enhanced".into())));
        assert_eq!(ModelSidecar::default().over(&read), read);
        let own = ModelSidecar {
            multiple: NonZeroUsize::new(4),
            ..ModelSidecar::default()
        };
        assert_eq!(own.over(&read).multiple, NonZeroUsize::new(4));
    }

    #[test]
    fn unknown_keys_and_values_are_errors_that_name_the_file() {
        let model = Path::new("a/model.onnx");
        for (text, part) in [
            ("range = \"-1..1\"", "range"),
            ("range_in = \"0..2\"", "0..2"),
            ("output = -1", "index from 0"),
            ("output = [1]", "index from 0"),
            ("output", "expected"),
            ("multiple = 0", "nonzero"),
            ("std = [1, 0, 1]", "std not 0"),
            ("tile = \"exact\"", "exact:8"),
            ("[extra]\ngamma = nan", "extra.gamma"),
        ] {
            let message = ModelSidecar::parse(model, text).unwrap_err().to_string();
            assert!(message.starts_with("a/model.onnx.toml: "), "{message}");
            assert!(message.contains(part), "{message}");
        }
    }
}
