//! Which output of a graph is the enhanced image: [`Output::choose`].

use super::convention::TensorLayout;
use super::port::{Dim, Port, list};
use super::sidecar::OutputChoice;

/// The names that exporters give the enhanced image where a model has other outputs beside it.
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

/// The output that is an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Output {
    /// The graph's words for it.
    pub(super) port: Port,
    /// The order of its dimensions; `None` where only a run shows it.
    pub(super) layout: Option<TensorLayout>,
    /// Why it is this one.
    pub(super) why: &'static str,
}

impl Output {
    /// The image among the outputs: the stated one, the only one, else the one that names and structure agree on.
    ///
    /// # Errors
    /// A sentence that follows the file's name.
    pub(super) fn choose(
        outputs: &[Port],
        stated: Option<&OutputChoice>,
        fits: impl Fn(&Port) -> bool,
    ) -> Result<Self, String> {
        let images: Vec<usize> = (0..outputs.len()).filter(|&i| fits(&outputs[i])).collect();
        let (index, why) = match (images.as_slice(), stated) {
            ([only], None) => (*only, "the only output that can be the image"),
            // A preset's index is that of its authors' model, whose other outputs an export may have left out.
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
            why,
        })
    }
}

/// The output that is stated, where it can be the image.
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
        Some(_) => "which is none of its image outputs",
        None => "which it does not have",
    };
    Err(format!(
        "its sidecar says {choice}, {problem}; it has {}",
        list(outputs)
    ))
}

/// The one image output with a telling name.
///
/// An exporter that is given fewer names than there are outputs spends them from the first on and numbers the rest:
/// `output` is then the first output, whatever that is (of Zero-DCE, the wrong one). So a name at the first place tells
/// something only where the others have names too.
fn by_name(outputs: &[Port], images: &[usize]) -> Option<usize> {
    let named = |i: &usize| IMAGE_NAMES.contains(&outputs[*i].name.as_str());
    let mut telling = images.iter().copied().filter(named);
    let one = telling.next().filter(|_| telling.next().is_none())?;
    let named_by_hand = one > 0 || !outputs.iter().any(|port| is_numbered(&port.name));
    named_by_hand.then_some(one)
}

/// Whether an exporter made up this name: a number, a path of modules, or an operator's name.
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

/// The second of Zero-DCE's three outputs, which is the image whatever their names are.
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
