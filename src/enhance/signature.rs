//! Roles of a graph's tensors: the degraded image, the enhanced image and further numbers ([`Signature::of`]).
//!
//! A graph states element types, ranks and fixed sizes. Value range and colour order come from a sidecar or a preset; by
//! default they are those of the published models: RGB, 0..1.

use super::convention::{ElementType, TensorLayout};
use super::output::Output;
use super::port::{Port, list};
use super::sidecar::ModelSidecar;

/// Inputs and outputs of a graph, by their roles.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Signature {
    /// The input that is the degraded image.
    pub(super) input: ImageInput,
    /// Height that the input must have, in pixels; `None` for any.
    pub(super) height: Option<usize>,
    /// Width that the input must have, in pixels; `None` for any.
    pub(super) width: Option<usize>,
    /// Further inputs, which are single numbers.
    pub(super) extras: Vec<NumberInput>,
    /// The output that is the enhanced image.
    pub(super) output: Output,
}

/// An input that is an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ImageInput {
    /// Name, type and dimensions in the graph.
    pub(super) port: Port,
    /// Order of its dimensions.
    pub(super) layout: TensorLayout,
}

/// An input of one number.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NumberInput {
    /// Name, type and dimensions in the graph.
    pub(super) port: Port,
    /// Value that every run uses.
    pub(super) value: f32,
}

impl Signature {
    /// Finds the role of each tensor.
    ///
    /// # Errors
    /// What was found and how to repair it; the message follows the file's name.
    pub(super) fn of(
        inputs: &[Port],
        outputs: &[Port],
        convention: &ModelSidecar,
    ) -> Result<Self, String> {
        let (image, layout) = image_input(inputs, convention)?;
        let [_, height, width] = layout.places().map(|place| &image.dims[place]);
        let extras = inputs.iter().filter(|port| port.name != image.name);
        let extras = extras.map(|port| extra(port, convention));
        let extras = extras.collect::<Result<Vec<_>, String>>()?;
        if let Some(name) = convention
            .extra
            .keys()
            .find(|name| !extras.iter().any(|extra| extra.port.name == **name))
            && !extras.is_empty()
        {
            return Err(format!(
                "its sidecar or preset gives a value for {name:?}, which is not one of its inputs; it has {}",
                list(inputs)
            ));
        }
        let fits = |port: &Port| {
            let layout = convention.layout_out.or(port.layout()).unwrap_or(layout);
            port.can_be_image(layout, [height, width])
        };
        let output = Output::choose(outputs, convention.output.as_ref(), fits)?;
        Ok(Self {
            height: height.known(),
            width: width.known(),
            extras,
            output,
            input: ImageInput {
                port: image.clone(),
                layout,
            },
        })
    }

    /// Whether the graph fixes neither height nor width.
    pub(super) fn takes_any_size(&self) -> bool {
        self.height.is_none() && self.width.is_none()
    }
}

/// The input that is the image, and its layout.
fn image_input<'a>(
    inputs: &'a [Port],
    convention: &ModelSidecar,
) -> Result<(&'a Port, TensorLayout), String> {
    let unsupported = |port: &Port| matches!(port.element, ElementType::Other(_));
    let images: Vec<&Port> = inputs.iter().filter(|port| !port.is_scalar()).collect();
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
                "takes {} images, but only one can be given: {}; export it so that the graph makes the others",
                several.len(),
                list(inputs)
            ));
        }
    };
    if unsupported(image) {
        return Err(format!(
            "takes {image}; export it with float32, float16 or uint8"
        ));
    }
    if let [first, _, _, _] = image.dims.as_slice()
        && !first.can_be(1)
    {
        return Err(format!(
            "takes {image}, several images at a time; export it for a batch of 1 or of any size"
        ));
    }
    let layout = match (convention.layout_in, image.layout()) {
        (Some(stated), Some(found)) if stated != found => None,
        (Some(stated), _) => Some(stated).filter(|stated| stated.rank() == image.dims.len()),
        (None, Some(found)) => Some(found),
        (None, None) if image.may_be_image() => {
            return Err(format!(
                "takes {image}, whose dimensions do not show which are the three channels; state it in MODEL.onnx.toml beside it: `layout_in = \"nchw\"` (or nhwc, chw, hwc)"
            ));
        }
        (None, None) => {
            return Err(format!(
                "takes {image}, which is not an image of three channels"
            ));
        }
    };
    match layout {
        Some(layout) if image.dims[layout.places()[0]].can_be(3) => Ok((image, layout)),
        _ => Err(format!(
            "takes {image}, which contradicts layout_in in its sidecar or preset"
        )),
    }
}

/// The value of an input that is a single number.
fn extra(port: &Port, convention: &ModelSidecar) -> Result<NumberInput, String> {
    if !matches!(port.element, ElementType::Float32 | ElementType::Float16) {
        return Err(format!(
            "takes {port} in addition to the image, but only single floats are supported; export it with the value inside the graph"
        ));
    }
    let value = convention.extra.get(&port.name).ok_or_else(|| {
        format!(
            "takes {port} in addition to the image, and its value is unknown; state it in MODEL.onnx.toml beside the model: `[extra]` and below it `{} = 0.5`, or the value that its authors use",
            quoted(&port.name)
        )
    })?;
    Ok(NumberInput {
        port: port.clone(),
        value: *value,
    })
}

/// A name as a key of a TOML file, in quotes if needed.
fn quoted(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) {
        name.to_owned()
    } else {
        format!("{name:?}")
    }
}

#[cfg(test)]
mod tests;
