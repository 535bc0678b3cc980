//! Conventions of published models, as their authors' code has them: [`Preset`].

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::extra::{ExtraValue, Number};
use super::sidecar::{ADD, ModelSidecar, OutputChoice};
use crate::expressions::Expression;
use crate::graphs::{Port, list};
use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::text::near_name::suggestion;

/// TOML file of all presets.
const PRESETS: &str = include_str!("../presets.toml");

/// Length of a preset's name up to which it must be a word of a file's name; chosen.
const SHORT: usize = 4;

/// Convention of a published model.
#[derive(Debug)]
pub(crate) struct Preset {
    /// Name as the user gave it, as `zero-dce`.
    pub(crate) name: String,
    /// Source, outputs, and statements in the form of a sidecar.
    pub(crate) content: PresetContent,
}

/// Entry of the file of presets.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PresetContent {
    /// Repository on GitHub.
    repository: String,
    /// Commit of the repository that was read.
    commit: String,
    /// Files in it that were read.
    file: String,
    /// Authors, place and year, and a remark.
    paper: String,
    /// Licence of code and weights.
    licence: String,
    /// Path of the official weights in the repository; `None` if they are linked from its README.
    weights: Option<String>,
    /// Size of an example, if the export needs one.
    one_size: Option<String>,
    /// Source of the file, if the project's script does not export it.
    ready_made: Option<String>,
    /// Names of the output that is the image, the first one first.
    names: Vec<String>,
    /// All outputs of the repository's own export, by name; the first is the image.
    #[serde(default)]
    own_export: Vec<String>,
    /// Lists of outputs whose image is known by its place.
    #[serde(default)]
    signatures: Vec<OutputList>,
    /// The image as an expression of outputs.
    image: Option<Expression>,
    /// The image in a single output of more channels than it has.
    stacked: Option<StackedOutput>,
    /// All else.
    pub(crate) sidecar: ModelSidecar,
}

/// A list of outputs, and which of them is the image.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OutputList {
    /// Channels of each output, in order.
    channels: Vec<usize>,
    /// Place of the image, from 1.
    nth: usize,
}

/// The image in a single output of several things, one behind the other.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StackedOutput {
    /// Channels of the output.
    channels: usize,
    /// The image as an expression of `x`, the output.
    image: String,
}

impl StackedOutput {
    /// The image as an expression of the output of a graph; `None` if the graph has other outputs.
    fn image_of(&self, outputs: &[Port]) -> Option<Expression> {
        let [port] = outputs else { return None };
        let named = || self.image.replace("x[", &format!("`{}`[", port.name));
        port.layout(self.channels)?;
        named().parse().ok()
    }
}

/// The preset's rules that choose an output, in addition to the sidecar's keys; part of an enhancer's digest.
#[derive(Serialize)]
pub(crate) struct PresetOutputs<'a> {
    names: &'a [String],
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    own_export: &'a [String],
    signatures: &'a [OutputList],
    image: Option<&'a Expression>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stacked: Option<&'a StackedOutput>,
}

/// All presets by their names.
fn all() -> Result<BTreeMap<String, PresetContent>> {
    toml::from_str(PRESETS).map_err(|e| Error::data("presets.toml", e))
}

/// Number that a preset gives an input of this name, and the preset's name.
pub(crate) fn number_of(input: &str) -> Option<(Number, String)> {
    all()
        .ok()?
        .into_iter()
        .find_map(|(name, content)| match content.sidecar.extra.get(input)? {
            ExtraValue::Number(number) | ExtraValue::Map(number) => Some((*number, name)),
            ExtraValue::List(_) | ExtraValue::Noise(_) | ExtraValue::From(_) => None,
        })
}

/// Names of the presets that know a list of outputs by its channels.
pub(crate) fn that_know(outputs: &[Port]) -> Vec<String> {
    all()
        .unwrap_or_default()
        .into_iter()
        .filter(|(_, content)| content.by_channels(outputs).is_some())
        .map(|(name, _)| name)
        .collect()
}

impl PresetContent {
    /// Index of the image, by the channels of all outputs.
    fn by_channels(&self, outputs: &[Port]) -> Option<usize> {
        let channels: Vec<Option<usize>> = outputs.iter().map(Port::channels).collect();
        let list = self.signatures.iter().find(|list| {
            list.channels.len() == channels.len()
                && list
                    .channels
                    .iter()
                    .zip(&channels)
                    .all(|(a, b)| Some(*a) == *b)
        })?;
        list.nth.checked_sub(1)
    }

    /// The image, by the names of the outputs. The name of a first output counts only if the others were named too: see
    /// [`Port::is_numbered`].
    fn by_name(&self, outputs: &[Port]) -> Option<usize> {
        if outputs.iter().map(|port| &port.name).eq(&self.own_export) {
            return Some(0);
        }
        let place = |name: &String| outputs.iter().position(|port| port.name == *name);
        let numbered = outputs.iter().any(Port::is_numbered);
        self.names
            .iter()
            .filter_map(place)
            .find(|place| *place > 0 || !numbered)
    }

    /// Whether the outputs have all names of the expression of the image.
    fn image_of(&self, outputs: &[Port]) -> Option<&Expression> {
        self.image.as_ref().filter(|image| {
            image
                .names()
                .iter()
                .all(|name| name == "input" || outputs.iter().any(|port| port.name == *name))
        })
    }
}

impl PresetContent {
    /// The lines of a preset in the list of all.
    fn entry(&self, name: &str) -> String {
        let folder = self
            .repository
            .split('/')
            .next_back()
            .unwrap_or(&self.repository);
        let file = format!("{name}.onnx");
        let weights = match &self.weights {
            Some(path) => format!("{folder}/{path}"),
            None => "WEIGHTS".to_owned(),
        };
        let size = self.one_size.as_ref();
        let size = size.map_or_else(String::new, |size| format!(" --size {size}"));
        let export = match &self.ready_made {
            Some(source) => format!("  file: {source}\n"),
            None => format!(
                "  export: python models/export.py {name} {folder} {weights} {file}{size}{}\n",
                if self.weights.is_some() {
                    ""
                } else {
                    "; WEIGHTS are linked from its README"
                }
            ),
        };
        format!(
            "{name}: {self}\n  licence: {}\n  conventions: {}\n{export}  use: --llie {name}:{file}\n",
            self.licence,
            self.conventions()
        )
    }

    /// How the authors' model is fed and read: the lines of a sidecar, with the usual ranges where the preset states none.
    fn conventions(&self) -> String {
        let image = self
            .image
            .as_ref()
            .map(ToString::to_string)
            .or_else(|| self.stacked.as_ref().map(|stacked| stacked.image.clone()));
        let outputs = match image {
            Some(image) => format!("image = {image:?}"),
            None => format!("output {}", self.names.join(" or ")),
        };
        let usual = [
            ("range_in", "0..1"),
            ("range_out", "0..1"),
            ("rounding", "round"),
        ];
        let mut keys: BTreeMap<String, toml::Value> = usual
            .map(|(key, value)| (key.to_owned(), toml::Value::from(value)))
            .into();
        if let Ok(toml::Value::Table(stated)) = toml::Value::try_from(&self.sidecar) {
            keys.extend(stated);
        }
        let keys: Vec<String> = keys
            .into_iter()
            .map(|(key, value)| format!("{key} = {value}"))
            .collect();
        format!("RGB, {outputs}, {}", keys.join(", "))
    }
}

/// The list of all presets, with source, licence, conventions and export of each.
///
/// # Errors
/// If the file of presets is broken, which is a bug.
pub fn list_of_presets() -> Result<String> {
    let entries = all()?;
    Ok(entries
        .iter()
        .map(|(name, content)| content.entry(name))
        .collect())
}

impl fmt::Display for PresetContent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            repository,
            commit,
            file,
            paper,
            ..
        } = self;
        write!(f, "{paper}; github.com/{repository} at {commit}: {file}")
    }
}

impl Preset {
    /// Splits `zero-dce:FILE` into preset and file; there is no preset if `model` is only a file.
    ///
    /// # Errors
    /// If the word before the colon is not a preset, and the whole is not a file.
    pub(crate) fn split(model: &Path) -> Result<(Option<Self>, PathBuf)> {
        let text = model.to_string_lossy();
        let Some((name, file)) = text.split_once(':').filter(|_| !model.exists()) else {
            return Ok((None, model.to_owned()));
        };
        // The colon belongs to a drive of Windows, or to a path.
        if name.len() < 2 || name.contains(['/', '\\', '.']) {
            return Ok((None, model.to_owned()));
        }
        let mut all = all()?;
        // The shell needs no quotes for zero-dce-pp.
        let known = name.replace("-pp", "++");
        let Some(content) = all.remove(&known) else {
            let names: Vec<String> = all.into_keys().collect();
            let near = suggestion(&known, &names);
            let names = names.join(", ");
            let problem = format_args!(
                "{name:?} before the colon is not a preset; the presets are {names}{near}"
            );
            return Err(Error::usage("--llie", problem));
        };
        let name = name.to_owned();
        Ok((Some(Self { name, content }), PathBuf::from(file)))
    }

    /// The preset that a file is named after, if it is not this one or a sibling of it, as `ruas-upe` of `ruas-lol`.
    pub(crate) fn named_after(&self, file: &Path) -> Option<String> {
        let letters = |text: &str| {
            text.to_lowercase()
                .replace(|c: char| !c.is_alphanumeric(), "")
        };
        let stem = file.file_stem()?.to_string_lossy().to_lowercase();
        let words: Vec<&str> = stem.split(|c: char| !c.is_alphabetic()).collect();
        let all_letters = letters(&stem);
        // A short name may be a part of any word.
        let is_named = |name: &str| {
            let name = letters(name);
            words.contains(&&*name) || name.len() > SHORT && all_letters.contains(&name)
        };
        let family = |name: &str| match name.split_once('-') {
            Some((family @ ("ruas" | "pairlie"), _)) => family.to_owned(),
            _ => name.trim_end_matches('+').to_owned(),
        };
        if is_named(&family(&self.name.replace("-pp", "++"))) {
            return None;
        }
        all()
            .ok()?
            .into_keys()
            .filter(|name| is_named(name) || is_named(&family(name)))
            .max_by_key(|name| (is_named(name), std::cmp::Reverse(name.len())))
    }

    /// The rules that choose an output.
    pub(crate) fn outputs(&self) -> PresetOutputs<'_> {
        PresetOutputs {
            names: &self.content.names,
            own_export: &self.content.own_export,
            signatures: &self.content.signatures,
            image: self.content.image.as_ref(),
            stacked: self.content.stacked.as_ref(),
        }
    }

    /// The preset's statements for a graph: the values of its further inputs, and how the image is read.
    ///
    /// # Errors
    /// If none of the outputs is known to be the image.
    pub(crate) fn for_graph(
        &self,
        sidecar: &ModelSidecar,
        inputs: &[Port],
        outputs: &[Port],
    ) -> std::result::Result<ModelSidecar, String> {
        let mut stated = self.content.sidecar.clone();
        stated.extra = inputs
            .iter()
            .filter_map(|port| {
                let value = stated.extra.get(&port.name)?.clone();
                // The same number at each pixel is the same for the model, whichever form its export takes.
                let value = match value {
                    ExtraValue::Number(number) if !port.is_scalar() => ExtraValue::Map(number),
                    ExtraValue::Map(number) if port.is_scalar() => ExtraValue::Number(number),
                    other => other,
                };
                Some((port.name.clone(), value))
            })
            .collect();
        if sidecar.output.is_some() || sidecar.image.is_some() {
            return Ok(stated);
        }
        if let Some(stacked) = &self.content.stacked {
            let image = stacked.image_of(outputs).ok_or_else(|| {
                format!(
                    "does not match preset {}: expected one output of {} channels, found {}; export it as `darkqa-eval enhance presets` shows",
                    self.name,
                    stacked.channels,
                    list(outputs)
                )
            })?;
            stated.image = Some(image);
            return Ok(stated);
        }
        if outputs.len() == 1 {
            return Ok(stated);
        }
        if let Some(image) = self.content.image_of(outputs) {
            stated.image = Some(image.clone());
            return Ok(stated);
        }
        let found = self.content.by_name(outputs);
        match found.or_else(|| self.content.by_channels(outputs)) {
            Some(index) if index < outputs.len() => {
                stated.output = Some(OutputChoice::Name(outputs[index].name.clone()));
                Ok(stated)
            }
            // Another output, such as curves, cannot be a part of the image.
            _ if self.is_only_image(outputs) => Ok(stated),
            _ => Err(format!(
                "does not match preset {}: expected {}, found {}; {ADD} the one that is the image: `output = \"NAME\"`",
                self.name,
                self.known_outputs(),
                list(outputs)
            )),
        }
    }

    /// Whether one output alone has three channels or one, or may have.
    fn is_only_image(&self, outputs: &[Port]) -> bool {
        self.content.image.is_none()
            && outputs
                .iter()
                .filter(|port| port.channels().is_none_or(|count| matches!(count, 1 | 3)))
                .count()
                == 1
    }

    /// Differences between a graph and the authors' model; `None` if there are none.
    pub(crate) fn differing(&self, inputs: &[Port], outputs: &[Port]) -> Option<String> {
        let content = &self.content;
        let known = outputs.len() == 1
            || content.image_of(outputs).is_some()
            || content.by_channels(outputs).is_some();
        let is_stacked = |stacked: &StackedOutput| stacked.image_of(outputs).is_some();
        let known = content.stacked.as_ref().map_or(known, is_stacked);
        // Some authors' models have one output; an export that adds others identifies it by name.
        let named = content.signatures.is_empty() && content.by_name(outputs).is_some();
        if !known && !named {
            return Some(format!(
                "outputs differ from the preset: expected {}, found {}",
                self.known_outputs(),
                list(outputs)
            ));
        }
        let others: Vec<Port> = inputs
            .iter()
            .filter(|port| !content.sidecar.extra.contains_key(&port.name))
            .cloned()
            .collect();
        (others.len() > 1)
            .then(|| format!("inputs differ from the preset: found {}", list(&others)))
    }

    /// The outputs that the preset knows, in words.
    fn known_outputs(&self) -> String {
        let content = &self.content;
        let mut known = vec![format!("an image named {}", content.names.join(" or "))];
        if let Some(image) = &content.image {
            known.insert(0, format!("outputs for {image}"));
        }
        known.extend(content.signatures.iter().map(|list| {
            let channels: Vec<String> = list.channels.iter().map(ToString::to_string).collect();
            format!("outputs of {} channels", channels.join(", "))
        }));
        known.join("; or ")
    }
}

#[cfg(test)]
mod tests;
