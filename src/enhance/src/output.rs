//! Choice of the outputs of a graph that are the enhanced image, or from which it is made: [`Output`].

use super::convention::{Channels, TensorLayout};
use super::expression::Expression;
use super::port::{Dim, Port, list};
use super::preset;
use super::sidecar::OutputChoice;

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
pub(super) struct Output {
    /// Name, type and dimensions in the graph.
    pub(super) port: Port,
    /// Order of its dimensions; `None` if only a run shows it.
    pub(super) layout: Option<TensorLayout>,
    /// Numbers of channels that it may have.
    pub(super) channels: &'static [usize],
    /// Reason for the choice, for users; `stated` if sidecar or preset state it.
    pub(super) reason: &'static str,
}

impl Output {
    /// The image among the outputs: the stated one, the only one, else the one that names and structure agree on. `fits`
    /// says whether an output can be the image.
    ///
    /// # Errors
    /// The message follows the file's name.
    pub(super) fn choose(
        outputs: &[Port],
        stated: Option<&OutputChoice>,
        channels: Channels,
        fits: impl Fn(&Port, usize) -> bool,
    ) -> Result<Self, String> {
        let fits = |port: &Port| fits(port, channels.count());
        let images: Vec<usize> = (0..outputs.len()).filter(|&i| fits(&outputs[i])).collect();
        let (index, reason) = match (images.as_slice(), stated) {
            ([only], None) => (*only, "the only output that can be the image"),
            // An index may count the outputs of the authors' model. An export may have fewer.
            ([only], Some(OutputChoice::Index(_))) if outputs.len() == 1 => {
                (*only, "the only output")
            }
            (_, Some(choice)) => (stated_output(outputs, choice, fits)?, "stated"),
            ([], None) => {
                let what = match channels {
                    Channels::Rgb => "an image",
                    Channels::Y => "an image of one channel (channels = \"y\")",
                };
                return Err(format!(
                    "has no output that is {what} of the input's size; it has {}",
                    list(outputs)
                ));
            }
            (several, None) => match (by_name(outputs, several), by_structure(outputs)) {
                (Some(name), None) => (name, "its name"),
                (None, Some(structure)) => (structure, "the second of Zero-DCE's three outputs"),
                (Some(name), Some(structure)) if name == structure => (name, "its name"),
                _ => return Err(ambiguous(outputs)),
            },
        };
        let port = outputs[index].clone();
        Ok(Self {
            layout: port.layout(channels.count()),
            port,
            channels: match channels {
                Channels::Rgb => &[3],
                Channels::Y => &[1],
            },
            reason,
        })
    }

    /// The outputs that an expression of the image names, in its order.
    ///
    /// # Errors
    /// If a name is neither an output nor `input`, or an output is no image of one or three channels.
    pub(super) fn named(
        outputs: &[Port],
        image: &Expression,
        channels: Channels,
        fits: impl Fn(&Port, usize) -> bool,
    ) -> Result<Vec<Self>, String> {
        let channels: &'static [usize] = match channels {
            Channels::Rgb => &[3, 1],
            Channels::Y => &[1],
        };
        let names = outputs.iter().map(|port| port.name.as_str());
        let known: Vec<&str> = names.chain([INPUT]).collect();
        let unknown = |problem| {
            format!(
                "cannot be read: {problem}; its outputs are {}",
                list(outputs)
            )
        };
        image.check_names("image", &known).map_err(unknown)?;
        let names = image.names().iter().filter(|name| *name != INPUT);
        let outputs = names.filter_map(|name| outputs.iter().find(|port| port.name == *name));
        let outputs: Vec<Self> = outputs
            .map(|port| {
                if !channels.iter().any(|count| fits(port, *count)) {
                    return Err(format!(
                        "gives {port}, which image = \"{image}\" names, but which is not an image of {}",
                        if channels == [1] { "one channel (channels = \"y\")" } else { "one or three channels" }
                    ));
                }
                Ok(Self {
                    layout: channels.iter().find_map(|count| port.layout(*count)),
                    port: port.clone(),
                    channels,
                    reason: "stated",
                })
            })
            .collect::<Result<_, _>>()?;
        if outputs.is_empty() {
            return Err(format!(
                "is not used: image = \"{image}\" names none of its outputs, which are {}",
                known[..known.len() - 1].join(", ")
            ));
        }
        Ok(outputs)
    }
}

/// Name of the dark image in an expression of the image.
pub(super) const INPUT: &str = "input";

/// What is asked where nothing tells which output is the image. Presets are named if they know such a list.
fn ambiguous(outputs: &[Port]) -> String {
    let presets = preset::that_know(outputs);
    let presets = match presets.as_slice() {
        [] => String::new(),
        names => {
            let known = "; the models of these presets have such outputs:";
            format!("{known} {} (--llie PRESET:FILE)", names.join(", "))
        }
    };
    format!(
        "has several outputs that could be the image: {}; say which in MODEL.onnx.toml beside it: `output = \"NAME\"` or `output = INDEX`, counted from 0{presets}; `darkqa-eval enhance --doctor` draws what each gives, and which are plausible",
        list(outputs)
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
        Some(_) => "which is not one of its image outputs",
        None => "which it does not have",
    };
    Err(format!(
        "its sidecar or preset states {choice}, {problem}; it has {}",
        list(outputs)
    ))
}

/// The only image output that has one of [`IMAGE_NAMES`].
///
/// A name of the first output counts only if the others are named too: see [`Port::is_numbered`].
fn by_name(outputs: &[Port], images: &[usize]) -> Option<usize> {
    let named = |i: &usize| IMAGE_NAMES.contains(&outputs[*i].name.as_str());
    let mut matching = images.iter().copied().filter(named);
    let only = matching.next().filter(|_| matching.next().is_none())?;
    let named_by_hand = only > 0 || !outputs.iter().any(Port::is_numbered);
    named_by_hand.then_some(only)
}

/// Index of the second of Zero-DCE's three outputs, which is the image whatever their names are.
///
/// `enhance_net_nopool.forward` of <https://github.com/Li-Chongyi/Zero-DCE> returns the image after four curves, the
/// image after all eight, and the 8 × 3 = 24 channels of the curves themselves. No other published model has this shape.
fn by_structure(outputs: &[Port]) -> Option<usize> {
    let channels: Vec<Option<usize>> = outputs
        .iter()
        .map(|port| port.dims.get(1).and_then(Dim::known))
        .collect();
    (channels == [Some(3), Some(3), Some(24)]).then_some(1)
}
