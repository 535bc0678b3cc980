//! Which tensors of a graph are the dark image, the enhanced one and further numbers: [`Signature::of`].
//!
//! A graph says element types, ranks and the sizes it knows. What it cannot say (value range, colour order) a sidecar or a
//! preset states; else it is taken to be the convention of the published models: RGB, 0..1.

use super::convention::{ElementType, TensorLayout};
use super::output::Output;
use super::port::{Port, list};
use super::sidecar::ModelSidecar;

/// How a graph is to be fed and read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Signature {
    /// The input that is the dark image.
    pub(super) input: ImageInput,
    /// The height in pixels that the input has to have; `None` for any.
    pub(super) height: Option<usize>,
    /// The width in pixels that the input has to have; `None` for any.
    pub(super) width: Option<usize>,
    /// Further inputs of one number each.
    pub(super) extras: Vec<NumberInput>,
    /// The output that is the enhanced image; its layout where the graph or the sidecar says it.
    pub(super) output: Output,
}

/// An input that is an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ImageInput {
    /// The graph's words for it.
    pub(super) port: Port,
    /// The order of its dimensions.
    pub(super) layout: TensorLayout,
}

/// An input of one number.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NumberInput {
    /// The graph's words for it.
    pub(super) port: Port,
    /// Its value.
    pub(super) value: f32,
}

impl Signature {
    /// Decides which tensors are what.
    ///
    /// # Errors
    /// A sentence that says what was found and how to repair it; it is to follow the file's name.
    pub(super) fn of(
        inputs: &[Port],
        outputs: &[Port],
        stated: &ModelSidecar,
    ) -> Result<Self, String> {
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
        let fits = |port: &Port| {
            let layout = stated.layout_out.or(port.layout()).unwrap_or(layout);
            port.can_be_image(layout, [height, width])
        };
        let output = Output::choose(outputs, stated.output.as_ref(), fits)?;
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
    stated: &ModelSidecar,
) -> Result<(&'a Port, TensorLayout), String> {
    let numbers = |port: &Port| matches!(port.element, ElementType::Other(_));
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
    let layout = match (stated.layout_in, image.layout()) {
        (Some(stated), Some(found)) if stated != found => None,
        (Some(stated), _) => Some(stated).filter(|stated| stated.rank() == image.dims.len()),
        (None, Some(found)) => Some(found),
        (None, None) if image.may_be_image() => {
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

/// The value of an input of one number.
fn extra(port: &Port, stated: &ModelSidecar) -> Result<NumberInput, String> {
    if !matches!(port.element, ElementType::Float32 | ElementType::Float16) {
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
    Ok(NumberInput {
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

#[cfg(test)]
mod tests;
