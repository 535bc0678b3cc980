//! Choice of the output of a graph that is the enhanced image: [`Output::choose`].

use super::convention::TensorLayout;
use super::port::{Dim, Port, list};
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

/// The output that is the enhanced image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Output {
    /// Name, type and dimensions in the graph.
    pub(super) port: Port,
    /// Order of its dimensions; `None` if only a run shows it.
    pub(super) layout: Option<TensorLayout>,
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
        fits: impl Fn(&Port) -> bool,
    ) -> Result<Self, String> {
        let images: Vec<usize> = (0..outputs.len()).filter(|&i| fits(&outputs[i])).collect();
        let (index, reason) = match (images.as_slice(), stated) {
            ([only], None) => (*only, "the only output that can be the image"),
            // A preset's index counts the outputs of the authors' model. An export may have fewer.
            ([only], Some(OutputChoice::Index(_))) if outputs.len() == 1 => {
                (*only, "the only output")
            }
            (_, Some(choice)) => (stated_output(outputs, choice, &fits)?, "stated"),
            ([], None) => {
                return Err(format!(
                    "has no output that is an image of the input's size; it has {}",
                    list(outputs)
                ));
            }
            (several, None) => match (by_name(outputs, several), by_structure(outputs)) {
                (Some(name), None) => (name, "its name"),
                (None, Some(structure)) => (structure, "the second of Zero-DCE's three outputs"),
                (Some(name), Some(structure)) if name == structure => (name, "its name"),
                _ => {
                    return Err(format!(
                        "has several outputs that could be the image: {}; say which in MODEL.onnx.toml beside it: `output = \"NAME\"` or `output = INDEX`, counted from 0; or name a preset, as --llie ruas-lol:FILE",
                        list(outputs)
                    ));
                }
            },
        };
        let port = outputs[index].clone();
        Ok(Self {
            layout: port.layout(),
            port,
            reason,
        })
    }
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
/// An exporter that gets fewer names than outputs names the first ones and numbers the rest. `output` is then the first
/// output, whatever that is (for Zero-DCE, the wrong one). So a name of the first output counts only if the others are
/// named too.
fn by_name(outputs: &[Port], images: &[usize]) -> Option<usize> {
    let named = |i: &usize| IMAGE_NAMES.contains(&outputs[*i].name.as_str());
    let mut matching = images.iter().copied().filter(named);
    let only = matching.next().filter(|_| matching.next().is_none())?;
    let named_by_hand = only > 0 || !outputs.iter().any(|port| is_numbered(&port.name));
    named_by_hand.then_some(only)
}

/// Whether an exporter generated this name: a number, a path of modules, or an operator's name.
fn is_numbered(name: &str) -> bool {
    const OPERATORS: [&str; 19] = [
        "add", "cat", "clamp", "clip", "concat", "conv", "conv2d", "div", "getitem", "identity",
        "max", "min", "mul", "pow", "relu", "sigmoid", "slice", "sub", "tanh",
    ];
    let word = name
        .trim_end_matches(|c: char| c.is_ascii_digit() || c == '_')
        .to_ascii_lowercase();
    word.is_empty() || name.contains(['/', ':', '.']) || OPERATORS.contains(&word.as_str())
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
