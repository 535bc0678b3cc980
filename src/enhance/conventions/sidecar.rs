//! Input and output convention stated in the user's `MODEL.onnx.toml` or in a preset: [`ModelSidecar`].

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::{fmt, fs};

use serde::{Deserialize, Serialize};

use super::convention::{ChannelOrder, Channels, Locality, Padding, Rounding, TensorLayout, ValueRange, ValueScale};
use super::extra::ExtraValue;
use crate::expressions::Expression;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::text::TomlFault;

/// Content of a sidecar. Every key is optional; an unknown key is an error.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ModelSidecar {
    /// Order of the input's dimensions.
    pub(crate) layout_in: Option<TensorLayout>,
    /// Order of the output's dimensions.
    pub(crate) layout_out: Option<TensorLayout>,
    /// Order of the channels of input and output.
    pub(crate) color: Option<ChannelOrder>,
    /// Order of the channels of the output, if it differs from `color`.
    pub(crate) color_out: Option<ChannelOrder>,
    /// Channels of input and output.
    pub(crate) channels: Option<Channels>,
    /// The model's input, as an expression of `image`, the dark image in 0..1.
    pub(crate) input: Option<Expression>,
    /// The enhanced image, as an expression of outputs in 0..1 and of `input`, the dark image in 0..1.
    pub(crate) image: Option<Expression>,
    /// Values of black and white in the input.
    pub(crate) range_in: Option<ValueRange>,
    /// Values of black and white in the output.
    pub(crate) range_out: Option<ValueRange>,
    /// Means subtracted from the channels of the input, in its channel order and range.
    pub(crate) mean: Option<[f32; 3]>,
    /// Standard deviations by which the channels of the input are then divided.
    pub(crate) std: Option<[f32; 3]>,
    /// Means added to the channels of the output after the multiplication by `std_out`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) mean_out: Option<[f32; 3]>,
    /// Standard deviations by which the channels of the output are multiplied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) std_out: Option<[f32; 3]>,
    /// Number of pixels of which height and width must be multiples.
    pub(crate) multiple: Option<NonZeroUsize>,
    /// Padding up to the multiple.
    pub(crate) pad: Option<Padding>,
    /// True if at least one row and one column are padded, even if the sides are multiples already.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) pad_always: Option<bool>,
    /// The only accepted width and height, for a graph that declares any size but was traced for this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) fixed: Option<[NonZeroUsize; 2]>,
    /// Output that is the enhanced image.
    pub(crate) output: Option<OutputChoice>,
    /// Context with which tiles are exact, or that the model needs the whole image.
    pub(crate) tile: Option<Locality>,
    /// Rounding of values to bytes.
    pub(crate) rounding: Option<Rounding>,
    /// Name of the training data, for reports. Not part of a digest, because it does not affect the images.
    #[serde(default, skip_serializing)]
    pub(crate) trained_on: Option<String>,
    /// Values of further inputs, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) extra: BTreeMap<String, ExtraValue>,
}

/// Output of a graph, by index or by name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "`output` is an index from 0 or a name in quotes")]
pub(crate) enum OutputChoice {
    /// Index among the outputs, from 0.
    Index(usize),
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

/// Path of a model's sidecar: the model's path followed by `.toml`.
pub(crate) fn path_for(model: &Path) -> PathBuf {
    let mut path = model.as_os_str().to_owned();
    path.push(".toml");
    path.into()
}

/// Start of messages that propose lines for the sidecar.
pub(crate) const ADD: &str = "add to MODEL.onnx.toml next to it";

/// Replaces the placeholder `MODEL.onnx.toml` in a text by the file name of the model's sidecar.
pub(crate) fn insert_sidecar_name(text: &str, model: &Path) -> String {
    let path = path_for(model);
    let name = path.file_name().unwrap_or_default();
    text.replace("MODEL.onnx.toml", &name.to_string_lossy())
}

/// Content of a model's sidecar; empty without a file.
pub(crate) fn text_for(model: &Path) -> Result<String> {
    let path = path_for(model);
    match fs::symlink_metadata(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let near = model.with_extension("toml");
            if near.exists() {
                tracing::warn!(
                    "{} is ignored: the settings of {} are read from {}",
                    near.display(),
                    model.display(),
                    path.display()
                );
            }
            Ok(String::new())
        }
        _ => files::settings(&path),
    }
}

/// Maximum number of characters of a faulty line that a message quotes.
const MAX_LINE: usize = 60;

/// End of messages about wrong keys, with the page that lists all keys.
const KEYS: &str = "; all keys: https://github.com/darkqa-eval/darkqa-eval/blob/main/src/docs/enhancers.md";

/// Maximum side, in pixels, of the key `fixed`; chosen, because this program handles no larger images.
const MAX_SIDE: usize = 1 << 16;

/// Maximum area, in pixels, of the key `fixed`: the default of `--decode max-pixels`.
const MAX_PIXELS: usize = 100_000_000;

/// Maximum multiple, in pixels; chosen: twice the largest of any published model, and small images padded to it still
/// fit into memory.
const MAX_MULTIPLE: usize = 1024;

/// Maximum length of the name of training data, in characters; chosen, because it is printed with each result.
const MAX_TRAINED_ON: usize = 60;

/// Maximum number of further inputs; chosen.
const MAX_EXTRA: usize = 64;

/// Maximum mean and standard deviation, and the inverse of the minimum standard deviation; chosen.
const MAX_SCALE: f32 = 1e6;

impl ModelSidecar {
    /// Parses and checks the text of the sidecar of `model`.
    ///
    /// # Errors
    /// If a key is unknown or a value is not allowed; the message names the file.
    pub(crate) fn parse(model: &Path, text: &str) -> Result<Self> {
        let path = path_for(model);
        let sidecar: Self = toml::from_str(text).map_err(|e| {
            let TomlFault { line, problem } = TomlFault::new(text, &e);
            let stated: String = text.lines().nth(line - 1).unwrap_or_default().trim().chars().take(MAX_LINE).collect();
            Error::line(&path, line, format_args!("`{stated}`: {problem}{KEYS}"))
        })?;
        match sidecar.check() {
            Ok(()) => Ok(sidecar),
            Err(problem) => Err(Error::data(path.display(), format_args!("{problem}{KEYS}"))),
        }
    }

    /// Checks everything that needs no graph.
    fn check(&self) -> Result<(), String> {
        self.check_bounds()?;
        if self.output.is_some() && self.image.is_some() {
            return Err(
                "`output` and `image` are both set; delete `output`, because `image` names its outputs".to_owned()
            );
        }
        for (name, value) in &self.extra {
            value.check(name)?;
        }
        match &self.input {
            Some(input) => input.check_names("input", &["image"]),
            None => Ok(()),
        }
    }

    /// Means and standard deviations of the input; `None` if neither is stated.
    pub(crate) fn mean_and_std_in(&self) -> Option<[[f32; 3]; 2]> {
        let is_stated = self.mean.is_some() || self.std.is_some();
        is_stated.then(|| [self.mean.unwrap_or([0.0; 3]), self.std.unwrap_or([1.0; 3])])
    }

    /// Means and standard deviations of the output; `None` if neither is stated.
    pub(crate) fn mean_and_std_out(&self) -> Option<[[f32; 3]; 2]> {
        let is_stated = self.mean_out.is_some() || self.std_out.is_some();
        is_stated.then(|| [self.mean_out.unwrap_or([0.0; 3]), self.std_out.unwrap_or([1.0; 3])])
    }

    /// The sidecar with another scale of the input.
    pub(crate) fn with_input_scale(self, scale: ValueScale) -> Self {
        let [mean, std] = scale.mean_and_std().map_or([self.mean, self.std], |both| both.map(Some));
        Self { range_in: Some(scale.range()), mean, std, ..self }
    }

    /// The sidecar with another scale of the output.
    pub(crate) fn with_output_scale(self, scale: ValueScale) -> Self {
        let stated = [self.mean_out, self.std_out];
        let [mean_out, std_out] = scale.mean_and_std().map_or(stated, |both| both.map(Some));
        Self { range_out: Some(scale.range()), mean_out, std_out, ..self }
    }

    /// Checks that numbers are within their bounds.
    fn check_bounds(&self) -> Result<(), String> {
        let are_means_valid =
            [self.mean, self.mean_out].into_iter().flatten().flatten().all(|mean: f32| mean.abs() <= MAX_SCALE);
        let are_deviations_valid = [self.std, self.std_out]
            .into_iter()
            .flatten()
            .flatten()
            .all(|deviation: f32| (1.0 / MAX_SCALE..=MAX_SCALE).contains(&deviation));
        if !are_means_valid || !are_deviations_valid {
            return Err(format!(
                "`mean` takes three numbers of at most {MAX_SCALE}, `std` three from {} to {MAX_SCALE}",
                1.0 / MAX_SCALE
            ));
        }
        if self.multiple.is_some_and(|multiple| multiple.get() > MAX_MULTIPLE) {
            return Err(format!("`multiple` can be at most {MAX_MULTIPLE} pixels"));
        }
        if let Some([width, height]) = self.fixed {
            let is_too_long = width.max(height).get() > MAX_SIDE;
            if is_too_long || width.get() * height.get() > MAX_PIXELS {
                return Err(format!(
                    "the sides in `fixed` can be at most {MAX_SIDE} pixels, and their product at most {MAX_PIXELS}"
                ));
            }
        }
        if self
            .trained_on
            .as_ref()
            .is_some_and(|text| text.chars().count() > MAX_TRAINED_ON || text.contains(char::is_control))
        {
            return Err(format!("`trained_on` must be one line of at most {MAX_TRAINED_ON} characters"));
        }
        if self.extra.len() > MAX_EXTRA {
            return Err(format!("`[extra]` can have at most {MAX_EXTRA} inputs"));
        }
        Ok(())
    }

    /// The sidecar without keys that equal the defaults, so that sidecars of the same meaning have the same digest.
    pub(crate) fn without_defaults(self) -> Self {
        fn unless<T: PartialEq>(value: Option<T>, default: &T) -> Option<T> {
            value.filter(|value| value != default)
        }
        let color = self.color.unwrap_or_default();
        Self {
            color: unless(self.color, &ChannelOrder::default()),
            color_out: unless(self.color_out, &color),
            channels: unless(self.channels, &Channels::default()),
            input: self.input.filter(|input| !input.is_name("image")),
            mean: unless(self.mean, &[0.0; 3]),
            std: unless(self.std, &[1.0; 3]),
            mean_out: unless(self.mean_out, &[0.0; 3]),
            std_out: unless(self.std_out, &[1.0; 3]),
            multiple: unless(self.multiple, &NonZeroUsize::MIN),
            pad: unless(self.pad, &Padding::default()),
            pad_always: unless(self.pad_always, &false),
            rounding: unless(self.rounding, &Rounding::default()),
            ..self
        }
    }

    /// The sidecar with missing keys taken from a preset.
    pub(crate) fn with_defaults(self, preset: &Self) -> Self {
        let mut extra = preset.extra.clone();
        extra.extend(self.extra);
        // Both keys select the output to read, so one of them overrides both of the preset's.
        let (output, image) = match (self.output, self.image) {
            (None, None) => (preset.output.clone(), preset.image.clone()),
            stated => stated,
        };
        Self {
            layout_in: self.layout_in.or(preset.layout_in),
            layout_out: self.layout_out.or(preset.layout_out),
            color: self.color.or(preset.color),
            color_out: self.color_out.or(preset.color_out),
            channels: self.channels.or(preset.channels),
            input: self.input.or_else(|| preset.input.clone()),
            image,
            range_in: self.range_in.or(preset.range_in),
            range_out: self.range_out.or(preset.range_out),
            mean: self.mean.or(preset.mean),
            std: self.std.or(preset.std),
            mean_out: self.mean_out.or(preset.mean_out),
            std_out: self.std_out.or(preset.std_out),
            multiple: self.multiple.or(preset.multiple),
            pad: self.pad.or(preset.pad),
            pad_always: self.pad_always.or(preset.pad_always),
            fixed: self.fixed.or(preset.fixed),
            output,
            tile: self.tile.or(preset.tile),
            rounding: self.rounding.or(preset.rounding),
            trained_on: self.trained_on.or_else(|| preset.trained_on.clone()),
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
            mean_out = [0.5, 0.5, 0.5]
            std_out = [0.5, 0.5, 0.5]
            multiple = 8
            pad = "replicate"
            pad_always = true
            fixed = [64, 48]
            output = "enhanced"
            tile = "exact:12"
            rounding = "truncate"
            color_out = "rgb"
            channels = "y"
            input = "image ^ 0.8"
            trained_on = "LOL-v1"
            [extra]
            exposure = 0.5
            z = { noise = "normal", std = 0.9 }
        "#;
        let read = ModelSidecar::parse(Path::new("m.onnx"), text).unwrap();
        assert_eq!(read.layout_in, Some(TensorLayout::Nhwc));
        assert_eq!(read.tile, Some(Locality::Exact(12)));
        assert_eq!(read.extra.len(), 2);
        assert_eq!((read.color_out, read.channels), (Some(ChannelOrder::Rgb), Some(Channels::Y)));
        assert_eq!(read.input, "image ^ 0.8".parse().ok());
        assert_eq!(read.output, Some(OutputChoice::Name("enhanced".into())));
        assert_eq!(ModelSidecar::default().with_defaults(&read), read);
        let own = ModelSidecar { multiple: NonZeroUsize::new(4), ..ModelSidecar::default() };
        assert_eq!(own.with_defaults(&read).multiple, NonZeroUsize::new(4));
    }

    #[test]
    fn errors_about_keys_and_values_name_the_file() {
        let model = Path::new("a/model.onnx");
        for (text, part) in [
            ("range = \"-1..1\"", "line 1: `range = \"-1..1\"`: unknown field"),
            ("color = \"rgb\"\nmultiple = 4 4", "line 2: `multiple = 4 4`: "),
            ("range_in = \"0..2\"", "0..2"),
            ("output = -1", "index from 0"),
            ("output = [1]", "index from 0"),
            ("output", "expected"),
            ("multiple = 0", "nonzero"),
            ("multiple = 1025", "at most 1024"),
            ("multiple = 2147483648", "at most 1024"),
            ("fixed = [64, 0]", "nonzero"),
            ("fixed = [64]", "length"),
            ("fixed = [99999999999, 8]", "at most 65536"),
            ("fixed = [60000, 60000]", "product at most 100000000"),
            ("pad_always = 1", "boolean"),
            ("std = [1, 0, 1]", "`std` three from"),
            ("std = [1, nan, 1]", "`std` three from"),
            ("std = [1, -1, 1]", "`std` three from"),
            ("mean = [inf, 0, 0]", "at most 1000000"),
            ("mean = [nan, 0, 0]", "at most 1000000"),
            ("tile = \"exact\"", "exact:N"),
            ("[extra]\ngamma = nan", "extra.gamma"),
            ("[extra]\na = { from = \"image +\" }", "the end"),
            ("[extra]\nimage = \"y\"", "other keys stand above [extra]"),
            ("channels = \"yuv\"", "yuv"),
            ("input = \"2 * imag\"", "names `imag`"),
            ("image = \"(1\"", "a closing parenthesis"),
            ("output = \"a\"\nimage = \"a\"", "delete `output`"),
        ] {
            let message = ModelSidecar::parse(model, text).unwrap_err().to_string();
            assert!(message.starts_with("a/model.onnx.toml"), "{message}");
            assert!(message.contains(part), "{message}");
        }
    }
}
