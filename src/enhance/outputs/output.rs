//! Choice of the graph outputs that are the enhanced image or operands of its expression: [`Output`].

use crate::conventions::sidecar::{ADD, OutputChoice};
use crate::conventions::{Channels, ElementType, TensorLayout, preset};
use crate::expressions::{ChannelSlice, Expression};
use crate::graphs::{Dim, Port, format_ports};

/// Usual names of the enhanced image in models with several outputs.
const IMAGE_NAMES: [&str; 8] =
    ["enhanced", "enhanced_image", "enhance_image", "enhance", "output", "output_image", "result", "image"];

/// Graph output that is the enhanced image, or an operand of its expression.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Output {
    /// Name, type and dimensions in the graph.
    pub(crate) port: Port,
    /// Order of the dimensions; `None` if it is known only after a run.
    pub(crate) layout: Option<TensorLayout>,
    /// Possible numbers of channels.
    pub(super) channels: Vec<usize>,
    /// Channels that are used; `None` for all.
    pub(crate) slice: Option<ChannelSlice>,
    /// Reason for the choice, for users; `stated` if sidecar or preset name the output.
    pub(crate) reason: &'static str,
}

impl Output {
    /// Chooses the image among the outputs: the stated one, else the only candidate, else the one on which name and
    /// structure agree. `fits` is true if an output can be an image with the given number of channels.
    ///
    /// # Errors
    /// If no output or several could be the image; the message follows the file's name.
    pub(crate) fn choose(
        outputs: &[Port],
        stated: Option<&OutputChoice>,
        channels: Channels,
        fits: impl Fn(&Port, usize) -> bool,
    ) -> Result<Self, String> {
        if let Some(OutputChoice::Name(name)) = stated
            && let Some((port, slice)) = find_slice(outputs, name)
        {
            if slice.count() != channels.count() {
                return Err(format!(
                    "MODEL.onnx.toml or the preset sets output = {name:?}, {} channels; expected {}",
                    slice.count(),
                    channels.description()
                ));
            }
            return Self::from_slice(port, slice, fits);
        }
        let images = candidate_images(outputs, |port| fits(port, channels.count()));
        let (index, reason) = match (images.as_slice(), stated) {
            ([only], None) => (*only, "the only output that can be the image"),
            // The index may refer to the authors' model, which can have more outputs than this export.
            ([only], Some(OutputChoice::Index(_))) if outputs.len() == 1 => (*only, "the only output"),
            (_, Some(choice)) => {
                let index = stated_output(outputs, choice, |port| fits(port, channels.count()))?;
                (index, "stated")
            }
            ([], None) => return Err(no_image_message(outputs, channels, fits)),
            (several, None) => match (index_by_name(outputs, several), zero_dce_index(outputs)) {
                (Some(name), None) => (name, "its name"),
                (None, Some(structure)) => (structure, "the second of Zero-DCE's three outputs"),
                (Some(name), Some(structure)) if name == structure => (name, "its name"),
                _ => return Err(ambiguous_message(outputs)),
            },
        };
        let port = outputs[index].clone();
        Ok(Self { layout: port.layout(channels.count()), port, channels: vec![channels.count()], slice: None, reason })
    }

    /// Outputs named by the expression of the image, in its order.
    ///
    /// # Errors
    /// If a name is neither an output nor `input`, or an output is not an image of one or three channels.
    pub(crate) fn for_expression(
        outputs: &[Port],
        image: &Expression,
        channels: Channels,
        fits: impl Fn(&Port, usize) -> bool,
    ) -> Result<Vec<Self>, String> {
        let channels: &[usize] = match channels {
            Channels::Rgb => &[3, 1],
            Channels::Y => &[1],
        };
        let known: Vec<&str> = outputs.iter().map(|port| port.name.as_str()).chain([INPUT]).collect();
        let slices: Vec<&str> =
            image.names().iter().filter(|name| find_slice(outputs, name).is_some()).map(String::as_str).collect();
        let known_names = [&known[..], &slices].concat();
        image
            .check_names("image", &known_names)
            .map_err(|problem| format!("{problem}; outputs: {}", format_ports(outputs)))?;
        let outputs: Vec<Self> = image
            .names()
            .iter()
            .filter(|name| *name != INPUT)
            .map(|name| {
                if let Some((port, slice)) = find_slice(outputs, name) {
                    return Self::from_slice(port, slice, &fits);
                }
                let port = outputs.iter().find(|port| port.name == *name);
                let port = port.filter(|port| channels.iter().any(|count| fits(port, *count))).ok_or_else(|| {
                    format!(
                        "image = \"{image}\" names output {name:?}, which is not an image of {}; outputs: {}",
                        if channels == [1] { "one channel (channels = \"y\")" } else { "one or three channels" },
                        format_ports(outputs)
                    )
                })?;
                Ok(Self {
                    layout: channels.iter().find_map(|count| port.layout(*count)),
                    port: port.clone(),
                    channels: channels.to_vec(),
                    slice: None,
                    reason: "stated",
                })
            })
            .collect::<Result<_, String>>()?;
        if outputs.is_empty() {
            return Err(format!(
                "image = \"{image}\" names none of its outputs, so it would do nothing; they are {}",
                known[..known.len() - 1].join(", ")
            ));
        }
        Ok(outputs)
    }
}

impl Output {
    /// Slice of an output's channels.
    ///
    /// # Errors
    /// If the output has fewer channels, or another size than the input.
    fn from_slice(port: &Port, slice: ChannelSlice, fits: impl Fn(&Port, usize) -> bool) -> Result<Self, String> {
        let count =
            port.channel_counts().into_iter().find(|count| *count >= slice.end && fits(port, *count)).ok_or_else(
                || {
                    format!(
                        "gives {port}, which has no channels {} to {} (counted from 0) of the input's size",
                        slice.first,
                        slice.end - 1
                    )
                },
            )?;
        Ok(Self {
            layout: port.layout(count),
            port: port.clone(),
            channels: vec![count],
            slice: Some(slice),
            reason: "stated",
        })
    }
}

/// Indices of the outputs that can be the image. Outputs without declared dimensions count only if there are no others.
fn candidate_images(outputs: &[Port], fits: impl Fn(&Port) -> bool) -> Vec<usize> {
    let (shaped, shapeless): (Vec<usize>, Vec<usize>) =
        (0..outputs.len()).filter(|&i| fits(&outputs[i])).partition(|&i| !outputs[i].dims.is_empty());
    if shaped.is_empty() { shapeless } else { shaped }
}

/// Output and channels of a name such as `x[4:7]`; `None` if the name is not a slice of an output.
fn find_slice<'a>(outputs: &'a [Port], name: &str) -> Option<(&'a Port, ChannelSlice)> {
    if outputs.iter().any(|port| port.name == name) {
        return None;
    }
    let (name, slice) = ChannelSlice::split(name)?;
    let port = outputs.iter().find(|port| port.name == name)?;
    Some((port, slice))
}

/// A name as written in expressions, in backticks if needed.
pub(crate) fn expression_name(name: &str) -> String {
    if name.chars().all(|c: char| c.is_ascii_alphanumeric() || c == '_')
        && !name.starts_with(|c: char| c.is_ascii_digit())
    {
        name.to_owned()
    } else {
        format!("`{name}`")
    }
}

/// Sidecar line for a light map by which the input is divided; `term` is the output's name as written in expressions.
pub(crate) fn light_map_line(term: &str) -> String {
    format!("image = \"clip(input / max({term}, 0.001), 0, 1)\"")
}

/// Message for a model without an image output, with the line to add or the export to change.
fn no_image_message(outputs: &[Port], channels: Channels, fits: impl Fn(&Port, usize) -> bool) -> String {
    if channels == Channels::Rgb
        && let Some((port, count)) = outputs.iter().find_map(|port| {
            let count =
                port.channel_counts().into_iter().find(|count| *count > 1 && *count != 3 && fits(port, *count))?;
            Some((port, count))
        })
    {
        let name = &port.name;
        return match count {
            4 => format!(
                "gives {port}, 4 channels, but an image has 3; if the fourth is opacity, {ADD}: `output = \"{name}[0:3]\"`; if they are reflectance and light: `image = \"{0}[0:3] * {0}[3:4]\"`",
                expression_name(name)
            ),
            6 => format!(
                "gives {port}, 6 channels, but an image has 3; {ADD} the half that is the image: `output = \"{name}[0:3]\"` or `output = \"{name}[3:6]\"`"
            ),
            24 => format!(
                "gives {port}, 24 channels, but an image has 3; if they are the curves of Zero-DCE, {ADD}: `image = \"curves(input, {0}[0:3], {0}[3:6], {0}[6:9], {0}[9:12], {0}[12:15], {0}[15:18], {0}[18:21], {0}[21:24])\"`",
                expression_name(name)
            ),
            _ => format!(
                "gives {port}, {count} channels, but an image has 3; {ADD} those that are the image (from 0, end excluded): `output = \"{name}[{}:{count}]\"`",
                count.saturating_sub(3)
            ),
        };
    }
    if channels == Channels::Rgb
        && let Some(port) = outputs.iter().find(|port| fits(port, 1))
    {
        return format!(
            "gives {port}, one channel, not an image; if it is a light map that the input is divided by, {ADD}: `{}`; if it is the enhanced luma, export it joined with the colours",
            light_map_line(&expression_name(&port.name))
        );
    }
    if let [port] = outputs {
        let problem = match (&port.element, port.dims.len()) {
            (ElementType::Other(_), _) => {
                Some("not a tensor of numbers; export it so that it gives one image as float32".to_owned())
            }
            (element, _) if !element.is_output_type() => {
                Some("an unsupported type; export it so that it gives float32 or uint8".to_owned())
            }
            (_, 1 | 2) => Some("a vector, not an image; export it so that it gives [1, 3, height, width]".to_owned()),
            (_, 5..) => {
                Some("several frames at a time; export it for single images of [1, 3, height, width]".to_owned())
            }
            _ => None,
        };
        if let Some(problem) = problem {
            return format!("gives {port}, {problem}");
        }
    }
    let what = match channels {
        Channels::Rgb => "an image",
        Channels::Y => "an image of one channel (channels = \"y\")",
    };
    format!("has no output that is {what} of the input's size; outputs: {}", format_ports(outputs))
}

/// Name of the degraded image in the expression `image`.
pub(super) const INPUT: &str = "input";

/// Message for a model with several possible image outputs, with the presets that list such outputs.
fn ambiguous_message(outputs: &[Port]) -> String {
    let presets = preset::with_outputs(outputs);
    let presets = match presets.as_slice() {
        [] => String::new(),
        names => {
            format!("; presets with such outputs: {} (--llie PRESET:FILE)", names.join(", "))
        }
    };
    format!(
        "has several outputs that could be the image: {}; {ADD}: `output = \"NAME\"` or `output = INDEX` (from 0){presets}; `darkqa-eval enhance doctor` shows which are plausible",
        format_ports(outputs)
    )
}

/// Index of the stated output.
///
/// # Errors
/// If the output does not exist or cannot be the image.
fn stated_output(outputs: &[Port], choice: &OutputChoice, fits: impl Fn(&Port) -> bool) -> Result<usize, String> {
    let found = match choice {
        OutputChoice::Index(index) => (*index < outputs.len()).then_some(*index),
        OutputChoice::Name(name) => outputs.iter().position(|port| port.name == *name),
    };
    let problem = match found {
        Some(index) if fits(&outputs[index]) => return Ok(index),
        Some(_) => "which is not an image",
        None => "which does not exist",
    };
    Err(format!("MODEL.onnx.toml or the preset sets {choice}, {problem}; outputs: {}", format_ports(outputs)))
}

/// Index of the only candidate with one of [`IMAGE_NAMES`]; `None` if several have one.
///
/// The name of the first output counts only if the others are named too; see [`Port::is_numbered`].
fn index_by_name(outputs: &[Port], images: &[usize]) -> Option<usize> {
    let mut matching = images.iter().copied().filter(|i: &usize| IMAGE_NAMES.contains(&outputs[*i].name.as_str()));
    let only = matching.next().filter(|_| matching.next().is_none())?;
    let is_named_by_user = only > 0 || !outputs.iter().any(Port::is_numbered);
    is_named_by_user.then_some(only)
}

/// Index of the image among Zero-DCE's three outputs, whatever their names; `None` for other outputs.
///
/// `enhance_net_nopool.forward` of <https://github.com/Li-Chongyi/Zero-DCE> returns the image after four curves, the
/// image after all eight, and the 8 × 3 = 24 channels of the curves themselves. No other published model has this
/// shape.
fn zero_dce_index(outputs: &[Port]) -> Option<usize> {
    let channels: Vec<Option<usize>> = outputs.iter().map(|port| port.dims.get(1).and_then(Dim::known)).collect();
    (channels == [Some(3), Some(3), Some(24)]).then_some(1)
}
