//! Conventions of published models, taken from their authors' code: [`Preset`].

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::extra::{ExtraValue, SidecarNumber};
use super::sidecar::{ADD, ModelSidecar, OutputChoice};
use crate::expressions::Expression;
use crate::graphs::{Port, format_ports};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::suggestion;

/// TOML file of all presets.
const PRESETS: &str = include_str!("../presets.toml");

/// Maximum length of a preset name that counts only as a whole word of a file name, such as `sci`; chosen.
const MAX_SHORT_NAME: usize = 4;

/// Convention of a published model.
#[derive(Debug)]
pub(crate) struct Preset {
    /// Name as the user wrote it, such as `zero-dce`.
    pub(crate) name: String,
    /// Source, outputs and convention.
    pub(crate) content: PresetContent,
}

/// Entry of `presets.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PresetContent {
    /// Repository on GitHub.
    repository: String,
    /// Commit from which the convention was taken.
    commit: String,
    /// Files of the repository that define the convention.
    file: String,
    /// Authors, venue and year, and a remark.
    paper: String,
    /// Licence of code and weights.
    licence: String,
    /// Path of the official weights in the repository; `None` if they are linked from its README.
    weights: Option<String>,
    /// Example size for models that can be exported for one size only.
    one_size: Option<String>,
    /// Source of a ready-made ONNX file, for models that `models/export.py` does not export.
    ready_made: Option<String>,
    /// Possible names of the image output, in order of preference.
    names: Vec<String>,
    /// Names of all outputs of the repository's own export; the first is the image.
    #[serde(default)]
    own_export: Vec<String>,
    /// Lists of outputs in which the image is identified by its position.
    #[serde(default)]
    signatures: Vec<OutputList>,
    /// The image as an expression of outputs.
    image: Option<Expression>,
    /// The image within a single output that has more channels than an image.
    stacked: Option<StackedOutput>,
    /// The rest of the convention.
    pub(crate) sidecar: ModelSidecar,
}

/// List of a model's outputs, with the position of the image.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OutputList {
    /// Channels of each output, in order.
    channels: Vec<usize>,
    /// Position of the image, from 1.
    nth: usize,
}

/// The image within a single output that stacks several results along its channels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StackedOutput {
    /// Channels of the output.
    channels: usize,
    /// The image as an expression of `x`, the output.
    image: String,
}

impl StackedOutput {
    /// The image as an expression of the graph's output; `None` if the graph has other outputs than the preset.
    fn image_expression(&self, outputs: &[Port]) -> Option<Expression> {
        let [port] = outputs else { return None };
        port.layout(self.channels)?;
        let text = self.image.replace("x[", &format!("`{}`[", port.name));
        text.parse().ok()
    }
}

/// Rules of a preset for choosing the image output, in addition to the sidecar's keys; part of an enhancer's digest.
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

/// All presets by name.
fn all_presets() -> Result<BTreeMap<String, PresetContent>> {
    toml::from_str(PRESETS).map_err(|e| Error::data("presets.toml", e))
}

/// Value that a preset states for an input of this name, with the preset's name.
pub(crate) fn known_number(input: &str) -> Option<(SidecarNumber, String)> {
    all_presets().ok()?.into_iter().find_map(|(name, content)| match content.sidecar.extra.get(input)? {
        ExtraValue::Number(number) | ExtraValue::Map(number) => Some((*number, name)),
        ExtraValue::List(_) | ExtraValue::Noise(_) | ExtraValue::From(_) => None,
    })
}

/// Names of the presets that list outputs with these numbers of channels.
pub(crate) fn with_outputs(outputs: &[Port]) -> Vec<String> {
    all_presets()
        .unwrap_or_default()
        .into_iter()
        .filter(|(_, content)| content.index_by_channels(outputs).is_some())
        .map(|(name, _)| name)
        .collect()
}

impl PresetContent {
    /// Index of the image output, identified by the numbers of channels of all outputs.
    fn index_by_channels(&self, outputs: &[Port]) -> Option<usize> {
        let channels: Vec<Option<usize>> = outputs.iter().map(Port::channels).collect();
        let list = self.signatures.iter().find(|list| {
            list.channels.len() == channels.len() && list.channels.iter().zip(&channels).all(|(a, b)| Some(*a) == *b)
        })?;
        list.nth.checked_sub(1)
    }

    /// Index of the image output, identified by name. The name of the first output counts only if the others were named
    /// too; see [`Port::is_numbered`].
    fn index_by_name(&self, outputs: &[Port]) -> Option<usize> {
        if outputs.iter().map(|port| &port.name).eq(&self.own_export) {
            return Some(0);
        }
        let has_numbered = outputs.iter().any(Port::is_numbered);
        self.names
            .iter()
            .filter_map(|name| outputs.iter().position(|port| port.name == *name))
            .find(|index| *index > 0 || !has_numbered)
    }

    /// The preset's expression of the image; `None` if the graph lacks an output that it names.
    fn image_expression(&self, outputs: &[Port]) -> Option<&Expression> {
        self.image.as_ref().filter(|image| {
            image.names().iter().all(|name| name == "input" || outputs.iter().any(|port| port.name == *name))
        })
    }
}

impl PresetContent {
    /// Lines about this preset in the list of presets.
    fn entry(&self, name: &str) -> String {
        let folder = self.repository.split('/').next_back().unwrap_or(&self.repository);
        let file = format!("{name}.onnx");
        let weights = match &self.weights {
            Some(path) => format!("{folder}/{path}"),
            None => "WEIGHTS".to_owned(),
        };
        let size = self.one_size.as_ref().map_or_else(String::new, |size| format!(" --size {size}"));
        let export = match &self.ready_made {
            Some(source) => format!("  file: {source}\n"),
            None => format!(
                "  export: python models/export.py {name} {folder} {weights} {file}{size}{}\n",
                if self.weights.is_some() { "" } else { "; WEIGHTS are linked from its README" }
            ),
        };
        format!(
            "{name}: {self}\n  licence: {}\n  conventions: {}\n{export}  use: --llie {name}:{file}\n",
            self.licence,
            self.conventions()
        )
    }

    /// Convention of the authors' model as lines of a sidecar, with defaults for missing value ranges and rounding.
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
        let mut keys: BTreeMap<String, toml::Value> =
            [("range_in", "0..1"), ("range_out", "0..1"), ("rounding", "round")]
                .map(|(key, value)| (key.to_owned(), toml::Value::from(value)))
                .into();
        if let Ok(toml::Value::Table(stated)) = toml::Value::try_from(&self.sidecar) {
            keys.extend(stated);
        }
        let keys: Vec<String> = keys.into_iter().map(|(key, value)| format!("{key} = {value}")).collect();
        format!("RGB, {outputs}, {}", keys.join(", "))
    }
}

/// List of all presets as text, each with source, licence, convention and export command.
///
/// # Errors
/// If `presets.toml` is invalid, which is a bug.
pub fn list_of_presets() -> Result<String> {
    let entries = all_presets()?;
    Ok(entries.iter().map(|(name, content)| content.entry(name)).collect())
}

impl fmt::Display for PresetContent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { repository, commit, file, paper, .. } = self;
        write!(f, "{paper}; github.com/{repository} at {commit}: {file}")
    }
}

impl Preset {
    /// Splits `zero-dce:FILE` into preset and file. The preset is `None` if `model` is only a file.
    ///
    /// # Errors
    /// If the name before the colon is not a preset, and no file has the whole argument as its name.
    pub(crate) fn split(model: &Path) -> Result<(Option<Self>, PathBuf)> {
        let text = model.to_string_lossy();
        let Some((name, file)) = text.split_once(':').filter(|_| !model.exists()) else {
            return Ok((None, model.to_owned()));
        };
        // The colon belongs to a Windows drive or to a path.
        if name.len() < 2 || name.contains(['/', '\\', '.']) {
            return Ok((None, model.to_owned()));
        }
        let mut all = all_presets()?;
        // `zero-dce-pp` is an alias of `zero-dce++`.
        let known = name.replace("-pp", "++");
        let Some(content) = all.remove(&known) else {
            let names: Vec<String> = all.into_keys().collect();
            let near = suggestion(&known, &names);
            let names = names.join(", ");
            let problem = format_args!("{name:?} before the colon is not a preset; the presets are {names}{near}");
            return Err(Error::usage("--llie", problem));
        };
        let name = name.to_owned();
        Ok((Some(Self { name, content }), PathBuf::from(file)))
    }

    /// Another preset whose name occurs in the file name; `None` if this preset's family occurs in it, such as `ruas`
    /// of `ruas-lol`.
    pub(crate) fn other_preset_in_name(&self, file: &Path) -> Option<String> {
        let stem = file.file_stem()?.to_string_lossy().to_lowercase();
        if name_occurs(family(&self.name.replace("-pp", "++")), &stem) {
            return None;
        }
        all_presets()
            .ok()?
            .into_keys()
            .filter(|name| name_occurs(name, &stem) || name_occurs(family(name), &stem))
            .max_by_key(|name| (name_occurs(name, &stem), std::cmp::Reverse(name.len())))
    }

    /// Rules for choosing the image output.
    pub(crate) fn outputs(&self) -> PresetOutputs<'_> {
        PresetOutputs {
            names: &self.content.names,
            own_export: &self.content.own_export,
            signatures: &self.content.signatures,
            image: self.content.image.as_ref(),
            stacked: self.content.stacked.as_ref(),
        }
    }

    /// The preset's convention for a graph, with values for the inputs that the graph has and the choice of the image
    /// output.
    ///
    /// # Errors
    /// If the image output cannot be identified.
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
                // An export may take the number as a scalar or as a map; both mean the same to the model.
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
            let image = stacked.image_expression(outputs).ok_or_else(|| {
                format!(
                    "does not match preset {}: expected one output of {} channels, found {}; export it as `darkqa-eval enhance presets` shows",
                    self.name,
                    stacked.channels,
                    format_ports(outputs)
                )
            })?;
            stated.image = Some(image);
            return Ok(stated);
        }
        if outputs.len() == 1 {
            return Ok(stated);
        }
        if let Some(image) = self.content.image_expression(outputs) {
            stated.image = Some(image.clone());
            return Ok(stated);
        }
        let found = self.content.index_by_name(outputs);
        match found.or_else(|| self.content.index_by_channels(outputs)) {
            Some(index) if index < outputs.len() => {
                stated.output = Some(OutputChoice::Name(outputs[index].name.clone()));
                Ok(stated)
            }
            // The other outputs, such as curves, cannot be images.
            _ if self.is_only_image(outputs) => Ok(stated),
            _ => Err(format!(
                "does not match preset {}: expected {}, found {}; {ADD} the one that is the image: `output = \"NAME\"`",
                self.name,
                self.known_outputs(),
                format_ports(outputs)
            )),
        }
    }

    /// True if the image is a single output, and exactly one output can have one or three channels.
    fn is_only_image(&self, outputs: &[Port]) -> bool {
        self.content.image.is_none()
            && outputs.iter().filter(|port| port.channels().is_none_or(|count| matches!(count, 1 | 3))).count() == 1
    }

    /// Differences between a graph and the authors' model; `None` if there are none.
    pub(crate) fn differences(&self, inputs: &[Port], outputs: &[Port]) -> Option<String> {
        let content = &self.content;
        let is_known = match &content.stacked {
            Some(stacked) => stacked.image_expression(outputs).is_some(),
            None => {
                outputs.len() == 1
                    || content.image_expression(outputs).is_some()
                    || content.index_by_channels(outputs).is_some()
            }
        };
        // Some authors' models have one output; an export that adds others identifies it by name.
        let is_named = content.signatures.is_empty() && content.index_by_name(outputs).is_some();
        if !is_known && !is_named {
            return Some(format!(
                "outputs differ from the preset: expected {}, found {}",
                self.known_outputs(),
                format_ports(outputs)
            ));
        }
        let others: Vec<Port> =
            inputs.iter().filter(|port| !content.sidecar.extra.contains_key(&port.name)).cloned().collect();
        (others.len() > 1).then(|| format!("inputs differ from the preset: found {}", format_ports(&others)))
    }

    /// Description of the outputs that the preset expects.
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

/// Name shared by the variants of a preset: `ruas` for `ruas-lol`, `zero-dce` for `zero-dce++`.
fn family(name: &str) -> &str {
    match name.split_once('-') {
        Some((family @ ("ruas" | "pairlie"), _)) => family,
        _ => name.trim_end_matches('+'),
    }
}

/// True if a lower-case file stem contains a preset name. Punctuation is ignored; short names must be whole words.
fn name_occurs(name: &str, stem: &str) -> bool {
    let name = letters_of(name);
    stem.split(|c: char| !c.is_alphabetic()).any(|word| word == name)
        || name.len() > MAX_SHORT_NAME && letters_of(stem).contains(&name)
}

/// Letters and digits of a text, in lower case.
fn letters_of(text: &str) -> String {
    text.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "")
}
