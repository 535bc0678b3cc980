//! Choice of the outputs of a graph that are the enhanced image, or from which it is made: [`Output`].

use crate::conventions::sidecar::{ADD, OutputChoice};
use crate::conventions::{Channels, ElementType, TensorLayout, preset};
use crate::expressions::{ChannelSlice, Expression};
use crate::graphs::{Dim, Port, format_ports};

/// Names that exporters give the enhanced image if a model has other outputs too.
const IMAGE_NAMES: [&str; 8] = [
    "enhanced",
    "enhanced_image",
    "enhance_image",
    "enhance",
    "output",
    "output_image",
    "result",
    "image",
];

/// An output that is the enhanced image, or a name in the expression of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Output {
    /// Name, type and dimensions in the graph.
    pub(crate) port: Port,
    /// Order of its dimensions; `None` if only a run shows it.
    pub(crate) layout: Option<TensorLayout>,
    /// Numbers of channels that it may have.
    pub(super) channels: Vec<usize>,
    /// The channels that are read; `None` for all.
    pub(crate) slice: Option<ChannelSlice>,
    /// Reason for the choice, for users; `stated` if sidecar or preset state it.
    pub(crate) reason: &'static str,
}

impl Output {
    /// The image among the outputs: the stated one, the only one, else the one on which names and structure agree. `fits` tells whether an
    /// output can be the image.
    ///
    /// # Errors
    /// The message follows the file's name.
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
        let fits_count = &fits;
        let fits = |port: &Port| fits_count(port, channels.count());
        let images = candidate_images(outputs, fits);
        let (index, reason) = match (images.as_slice(), stated) {
            ([only], None) => (*only, "the only output that can be the image"),
            // An index may count the outputs of the authors' model. An export may have fewer.
            ([only], Some(OutputChoice::Index(_))) if outputs.len() == 1 => {
                (*only, "the only output")
            }
            (_, Some(choice)) => (stated_output(outputs, choice, fits)?, "stated"),
            ([], None) => return Err(no_image_message(outputs, channels, fits_count)),
            (several, None) => match (index_by_name(outputs, several), zero_dce_index(outputs)) {
                (Some(name), None) => (name, "its name"),
                (None, Some(structure)) => (structure, "the second of Zero-DCE's three outputs"),
                (Some(name), Some(structure)) if name == structure => (name, "its name"),
                _ => return Err(ambiguous_message(outputs)),
            },
        };
        let port = outputs[index].clone();
        Ok(Self {
            layout: port.layout(channels.count()),
            port,
            channels: vec![channels.count()],
            slice: None,
            reason,
        })
    }

    /// The outputs that an expression of the image names, in its order.
    ///
    /// # Errors
    /// If a name is neither an output nor `input`, or an output is no image of one or three channels.
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
        let names = outputs.iter().map(|port| port.name.as_str());
        let known: Vec<&str> = names.chain([INPUT]).collect();
        let slices: Vec<&str> = image
            .names()
            .iter()
            .filter(|name| find_slice(outputs, name).is_some())
            .map(String::as_str)
            .collect();
        let known_names = [&known[..], &slices].concat();
        image
            .check_names("image", &known_names)
            .map_err(|problem| format!("{problem}; outputs: {}", format_ports(outputs)))?;
        let outputs: Vec<Self> = image.names().iter().filter(|name| *name != INPUT)
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
    /// Some channels of an output.
    ///
    /// # Errors
    /// If it has fewer channels, or another size than the input.
    fn from_slice(
        port: &Port,
        slice: ChannelSlice,
        fits: impl Fn(&Port, usize) -> bool,
    ) -> Result<Self, String> {
        let count = port
            .channel_counts()
            .into_iter()
            .find(|count| *count >= slice.end && fits(port, *count))
            .ok_or_else(|| {
                format!(
                    "gives {port}, which has no channels {} to {} (counted from 0) of the input's size",
                    slice.first,
                    slice.end - 1
                )
            })?;
        Ok(Self {
            layout: port.layout(count),
            port: port.clone(),
            channels: vec![count],
            slice: Some(slice),
            reason: "stated",
        })
    }
}

/// Indices of the outputs that can be the image: those whose dimensions the graph states, else those without stated dimensions.
fn candidate_images(outputs: &[Port], fits: impl Fn(&Port) -> bool) -> Vec<usize> {
    let fitting = |has_dims: bool| -> Vec<usize> {
        (0..outputs.len())
            .filter(|&i| outputs[i].dims.is_empty() != has_dims && fits(&outputs[i]))
            .collect()
    };
    let shaped = fitting(true);
    if shaped.is_empty() {
        fitting(false)
    } else {
        shaped
    }
}

/// The output and the channels that a name such as `x[4:7]` means; `None` if it means no channels of an output.
fn find_slice<'a>(outputs: &'a [Port], name: &str) -> Option<(&'a Port, ChannelSlice)> {
    if outputs.iter().any(|port| port.name == name) {
        return None;
    }
    let (name, slice) = ChannelSlice::split(name)?;
    let port = outputs.iter().find(|port| port.name == name)?;
    Some((port, slice))
}

/// A name as expressions write it, in backticks if needed.
pub(crate) fn expression_name(name: &str) -> String {
    if name
        .chars()
        .all(|c: char| c.is_ascii_alphanumeric() || c == '_')
        && !name.starts_with(|c: char| c.is_ascii_digit())
    {
        name.to_owned()
    } else {
        format!("`{name}`")
    }
}

/// The line of a sidecar for a light map that the input is divided by; `term` is its output as expressions write it.
pub(crate) fn light_map_line(term: &str) -> String {
    format!("image = \"clip(input / max({term}, 0.001), 0, 1)\"")
}

/// Why none of the outputs is the image, and what to state or export.
fn no_image_message(
    outputs: &[Port],
    channels: Channels,
    fits: impl Fn(&Port, usize) -> bool,
) -> String {
    let wide = |port: &&Port| {
        port.channel_counts()
            .into_iter()
            .filter(|count| *count > 1 && *count != 3)
            .find(|count| fits(port, *count))
    };
    if channels == Channels::Rgb
        && let Some((port, count)) = outputs.iter().find_map(|port| Some((port, wide(&port)?)))
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
            (ElementType::Other(_), _) => Some(
                "not a tensor of numbers; export it so that it gives one image as float32"
                    .to_owned(),
            ),
            (element, _) if !element.is_output_type() => {
                Some("an unsupported type; export it so that it gives float32 or uint8".to_owned())
            }
            (_, 1 | 2) => Some(
                "a vector, not an image; export it so that it gives [1, 3, height, width]"
                    .to_owned(),
            ),
            (_, 5..) => Some(
                "several frames at a time; export it for single images of [1, 3, height, width]"
                    .to_owned(),
            ),
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
    format!(
        "has no output that is {what} of the input's size; outputs: {}",
        format_ports(outputs)
    )
}

/// Name of the dark image in an expression of the image.
pub(super) const INPUT: &str = "input";

/// Question to the user if the image among the outputs is unknown. Presets that know such a list are named.
fn ambiguous_message(outputs: &[Port]) -> String {
    let presets = preset::with_outputs(outputs);
    let presets = match presets.as_slice() {
        [] => String::new(),
        names => {
            format!(
                "; presets with such outputs: {} (--llie PRESET:FILE)",
                names.join(", ")
            )
        }
    };
    format!(
        "has several outputs that could be the image: {}; {ADD}: `output = \"NAME\"` or `output = INDEX` (from 0){presets}; `darkqa-eval enhance doctor` shows which are plausible",
        format_ports(outputs)
    )
}

/// Index of the stated output, which must exist and be able to be the image.
fn stated_output(
    outputs: &[Port],
    choice: &OutputChoice,
    fits: impl Fn(&Port) -> bool,
) -> Result<usize, String> {
    let found = match choice {
        OutputChoice::Index(index) => (*index < outputs.len()).then_some(*index),
        OutputChoice::Name(name) => outputs.iter().position(|port| port.name == *name),
    };
    let problem = match found {
        Some(index) if fits(&outputs[index]) => return Ok(index),
        Some(_) => "which is not an image",
        None => "which does not exist",
    };
    Err(format!(
        "MODEL.onnx.toml or the preset sets {choice}, {problem}; outputs: {}",
        format_ports(outputs)
    ))
}

/// The only image output that has one of [`IMAGE_NAMES`].
///
/// A name of the first output counts only if the others are named too: see [`Port::is_numbered`].
fn index_by_name(outputs: &[Port], images: &[usize]) -> Option<usize> {
    let mut matching = images
        .iter()
        .copied()
        .filter(|i: &usize| IMAGE_NAMES.contains(&outputs[*i].name.as_str()));
    let only = matching.next().filter(|_| matching.next().is_none())?;
    let named_by_hand = only > 0 || !outputs.iter().any(Port::is_numbered);
    named_by_hand.then_some(only)
}

/// Index of the second of Zero-DCE's three outputs, which is the image whatever their names are.
///
/// `enhance_net_nopool.forward` of <https://github.com/Li-Chongyi/Zero-DCE> returns the image after four curves, the
/// image after all eight, and the 8 × 3 = 24 channels of the curves themselves. No other published model has this shape.
fn zero_dce_index(outputs: &[Port]) -> Option<usize> {
    let channels: Vec<Option<usize>> = outputs
        .iter()
        .map(|port| port.dims.get(1).and_then(Dim::known))
        .collect();
    (channels == [Some(3), Some(3), Some(24)]).then_some(1)
}
