//! Which tensors of a graph are the dark image, the enhanced one and further numbers: [`Signature::of`].
//!
//! A graph says element types, ranks and the sizes it knows. What it cannot say (value range, colour order) a sidecar or a
//! preset states; else it is taken to be the convention of the published models: RGB, 0..1.

use std::fmt;

use super::convention::{Element, Layout};
use super::sidecar::{OutputChoice, Sidecar};

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

/// An input or output of a graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Port {
    /// Its name.
    pub(super) name: String,
    /// What its elements are.
    pub(super) element: Element,
    /// Its dimensions; empty for a number, and where the graph does not say even how many there are.
    pub(super) dims: Vec<Dim>,
}

/// One dimension of a tensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Dim {
    /// A size that the graph fixes.
    Known(usize),
    /// Any size, with the graph's name for it, which may be empty.
    Free(String),
}

impl Dim {
    fn known(&self) -> Option<usize> {
        match self {
            Self::Known(size) => Some(*size),
            Self::Free(_) => None,
        }
    }

    /// Whether the dimension can have this size.
    fn can_be(&self, size: usize) -> bool {
        self.known().is_none_or(|known| known == size)
    }

    /// Whether two dimensions can have the same size.
    fn can_equal(&self, other: &Self) -> bool {
        other.known().is_none_or(|size| self.can_be(size))
    }
}

impl fmt::Display for Dim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(size) => write!(f, "{size}"),
            Self::Free(name) if name.is_empty() => write!(f, "?"),
            Self::Free(name) => write!(f, "{name}"),
        }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} ({} [", self.name, self.element)?;
        for (i, dim) in self.dims.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{dim}")?;
        }
        write!(f, "])")
    }
}

/// How a graph is to be fed and read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Signature {
    /// The input that is the dark image.
    pub(super) input: Image,
    /// The height in pixels that the input has to have; `None` for any.
    pub(super) height: Option<usize>,
    /// The width in pixels that the input has to have; `None` for any.
    pub(super) width: Option<usize>,
    /// Further inputs of one number each.
    pub(super) extras: Vec<Extra>,
    /// The output that is the enhanced image; its layout where the graph or the sidecar says it.
    pub(super) output: Output,
}

/// An input that is an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Image {
    /// The graph's words for it.
    pub(super) port: Port,
    /// The order of its dimensions.
    pub(super) layout: Layout,
}

/// The output that is an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Output {
    /// The graph's words for it.
    pub(super) port: Port,
    /// The order of its dimensions; `None` where only a run shows it.
    pub(super) layout: Option<Layout>,
    /// Why it is this one.
    pub(super) why: &'static str,
}

/// An input of one number.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Extra {
    /// The graph's words for it.
    pub(super) port: Port,
    /// Its value.
    pub(super) value: f32,
}

impl Signature {
    /// Decides which tensors are what.
    ///
    /// # Errors
    /// A sentence that says what was found and what mends it; it is to follow the file's name.
    pub(super) fn of(inputs: &[Port], outputs: &[Port], stated: &Sidecar) -> Result<Self, String> {
        let (image, layout) = image_input(inputs, stated)?;
        let [_, height, width] = layout.places().map(|place| &image.dims[place]);
        let extras = inputs.iter().filter(|port| port.name != image.name);
        let extras = extras.map(|port| extra(port, stated));
        let extras = extras.collect::<Result<Vec<_>, String>>()?;
        if let Some(name) = stated
            .extra
            .keys()
            .find(|name| !extras.iter().any(|extra| extra.port.name == **name))
            && !extras.is_empty()
        {
            return Err(format!(
                "its sidecar gives a value for {name:?}, which is no further input; it has {}",
                list(inputs)
            ));
        }
        let fits = |port: &Port| can_be_image(port, [height, width], stated.layout_out, layout);
        let output = choose_output(outputs, stated.output.as_ref(), fits)?;
        Ok(Self {
            height: height.known(),
            width: width.known(),
            extras,
            output,
            input: Image {
                port: image.clone(),
                layout,
            },
        })
    }
}

impl Signature {
    /// Whether the graph fixes neither height nor width.
    pub(super) fn takes_any_size(&self) -> bool {
        self.height.is_none() && self.width.is_none()
    }
}

/// The layout of an image of three channels, where its dimensions say it.
fn layout(port: &Port) -> Option<Layout> {
    let mut fitting = Layout::ALL.into_iter().filter(|layout| {
        port.dims.len() == layout.rank()
            && port.dims[layout.places()[0]].known() == Some(3)
            && (layout.rank() == 3 || port.dims[0].can_be(1))
    });
    // A size of 3 in two places says nothing.
    fitting.next().filter(|_| fitting.next().is_none())
}

/// The input that is the image, and its layout.
fn image_input<'a>(inputs: &'a [Port], stated: &Sidecar) -> Result<(&'a Port, Layout), String> {
    let numbers = |port: &Port| matches!(port.element, Element::Other(_));
    let images: Vec<&Port> = inputs.iter().filter(|port| !is_scalar(port)).collect();
    let image = match images.as_slice() {
        [image] => *image,
        [] => {
            return Err(format!(
                "has no image among its inputs; it has {}",
                list(inputs)
            ));
        }
        several => {
            return Err(format!(
                "takes {} images where one is what there is: {}; export it with the others made inside the graph",
                several.len(),
                list(inputs)
            ));
        }
    };
    if numbers(image) {
        return Err(format!(
            "takes {image}; float32, float16 or uint8 is supported: export it so"
        ));
    }
    if let [first, _, _, _] = image.dims.as_slice()
        && !first.can_be(1)
    {
        return Err(format!(
            "takes {image}, several images at a time; export it for a batch of 1 or of any size"
        ));
    }
    let layout = match (stated.layout_in, layout(image)) {
        (Some(stated), Some(found)) if stated != found => None,
        (Some(stated), _) => Some(stated).filter(|stated| stated.rank() == image.dims.len()),
        (None, Some(found)) => Some(found),
        (None, None) if may_be_image(image) => {
            return Err(format!(
                "takes {image}, which does not say where its three channels are; say it in MODEL.onnx.toml beside it: `layout_in = \"nchw\"` (or nhwc, chw, hwc)"
            ));
        }
        (None, None) => {
            return Err(format!(
                "takes {image}, which is no image of three channels"
            ));
        }
    };
    match layout {
        Some(layout) if image.dims[layout.places()[0]].can_be(3) => Ok((image, layout)),
        _ => Err(format!(
            "takes {image}, which is not as its sidecar says (layout_in)"
        )),
    }
}

/// Whether the dimensions leave room for three channels somewhere; a plane of grey, which has a 1 in their place, does not.
fn may_be_image(port: &Port) -> bool {
    let last = &port.dims[port.dims.len().saturating_sub(3)..];
    let grey = last.iter().any(|dim| dim.known() == Some(1));
    (3..=4).contains(&port.dims.len()) && !grey && last.iter().any(|dim| dim.can_be(3))
}

/// Whether a port holds one number.
fn is_scalar(port: &Port) -> bool {
    port.dims.iter().all(|dim| dim.known() == Some(1))
}

/// The value of an input of one number.
fn extra(port: &Port, stated: &Sidecar) -> Result<Extra, String> {
    if !matches!(port.element, Element::Float32 | Element::Float16) {
        return Err(format!(
            "takes {port} beside the image; one float is supported: export it with a value inside the graph"
        ));
    }
    let value = stated.extra.get(&port.name).ok_or_else(|| {
        format!(
            "takes {port} beside the image, and its value is not known; say it in MODEL.onnx.toml beside it: `[extra]` and below it `{} = 0.5`, or whatever its authors take",
            quoted(&port.name)
        )
    })?;
    Ok(Extra {
        port: port.clone(),
        value: *value,
    })
}

/// A key of a TOML file.
fn quoted(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) {
        name.to_owned()
    } else {
        format!("{name:?}")
    }
}

/// Whether an output can be an image of the input's size: in the stated layout, else in the one that its 3 tells, else in that
/// of the input. What the graph leaves open can.
fn can_be_image(
    port: &Port,
    [height, width]: [&Dim; 2],
    stated: Option<Layout>,
    of_input: Layout,
) -> bool {
    let layout = stated.or(layout(port)).unwrap_or(of_input);
    let [channels, rows, columns] = layout.places();
    let shape = port.dims.is_empty()
        || port.dims.len() == layout.rank()
            && port.dims[channels].can_be(3)
            && port.dims[rows].can_equal(height)
            && port.dims[columns].can_equal(width)
            && (layout.rank() == 3 || port.dims[0].can_be(1));
    shape && !matches!(port.element, Element::Other(_))
}

/// The image among the outputs: the stated one, the only one, else the one that names and structure agree on.
fn choose_output(
    outputs: &[Port],
    stated: Option<&OutputChoice>,
    fits: impl Fn(&Port) -> bool,
) -> Result<Output, String> {
    let images: Vec<usize> = (0..outputs.len()).filter(|&i| fits(&outputs[i])).collect();
    let (index, why) = match (images.as_slice(), stated) {
        ([only], None) => (*only, "the only output that can be the image"),
        // A preset's index is that of its authors' model, whose other outputs an export may have left out.
        ([only], Some(OutputChoice::Index(_))) if outputs.len() == 1 => (*only, "the only output"),
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
    Ok(Output {
        layout: layout(&port),
        port,
        why,
    })
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

fn list(ports: &[Port]) -> String {
    if ports.is_empty() {
        return "none".to_owned();
    }
    let ports: Vec<String> = ports.iter().map(Port::to_string).collect();
    ports.join(", ")
}

#[cfg(test)]
mod tests;
