//! Roles of a graph's tensors: the degraded image, the enhanced image and further inputs ([`Signature::infer`]).
//!
//! A graph declares element types, ranks and fixed sizes. Value range and colour order come from a sidecar or a preset;
//! the default is that of most published models, RGB in 0..1.

use super::convention::{Channels, TensorLayout};
use super::sidecar::{ADD, ModelSidecar};
use crate::graphs::{Port, format_ports};
use crate::inputs::{FurtherInput, is_map_or_noise};
use crate::outputs::Output;

/// Inputs and outputs of a graph, by role.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Signature {
    /// The input that is the degraded image.
    pub(crate) input: ImageInput,
    /// Fixed height of the input, in pixels; `None` for any.
    pub(crate) height: Option<usize>,
    /// Fixed width of the input, in pixels; `None` for any.
    pub(crate) width: Option<usize>,
    /// Further inputs.
    pub(crate) extras: Vec<FurtherInput>,
    /// The output that is the enhanced image, or the outputs named by the expression `image`, in its order.
    pub(crate) outputs: Vec<Output>,
    /// Outputs that are not used.
    pub(crate) unread: Vec<Port>,
}

/// An input that is an image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ImageInput {
    /// Name, type and dimensions in the graph.
    pub(crate) port: Port,
    /// Order of its dimensions.
    pub(crate) layout: TensorLayout,
}

impl Signature {
    /// Infers the role of each tensor.
    ///
    /// # Errors
    /// A message with a remedy, to follow the file's name.
    pub(crate) fn infer(inputs: &[Port], outputs: &[Port], convention: &ModelSidecar) -> Result<Self, String> {
        let (image, layout) = image_input(inputs, convention)?;
        let [_, height, width] = layout.axes().map(|place| &image.dims[place]);
        let channels = convention.channels.unwrap_or_default();
        if channels == Channels::Y {
            check_equal("mean", convention.mean)?;
            check_equal("std", convention.std)?;
        }
        let input = ImageInput { port: image.clone(), layout };
        let extras = inputs
            .iter()
            .filter(|port| port.name != image.name)
            .map(|port| {
                let value = convention.extra.get(&port.name);
                FurtherInput::new(port, value, layout, input.takes_any_side())
            })
            .collect::<Result<Vec<_>, String>>()?;
        if let Some(name) = convention.extra.keys().find(|name| !extras.iter().any(|extra| extra.port.name == **name)) {
            return Err(format!(
                "MODEL.onnx.toml sets {name:?} under [extra], which is not an input besides the image; move that line above [extra] if it is another key, else delete it; inputs: {}",
                format_ports(inputs)
            ));
        }
        let fits = |port: &Port, count: usize| {
            let layout = convention.layout_out.or(port.layout(count)).unwrap_or(layout);
            port.can_be_image(layout, count, [height, width])
        };
        let read = match &convention.image {
            Some(expression) => Output::for_expression(outputs, expression, channels, fits)?,
            None => vec![Output::choose(outputs, convention.output.as_ref(), channels, fits)?],
        };
        let unread =
            outputs.iter().filter(|port| !read.iter().any(|output| output.port.name == port.name)).cloned().collect();
        Ok(Self { height: height.known(), width: width.known(), extras, unread, outputs: read, input })
    }
}

/// Checks that the numbers for the channels of a model of the luma are equal; `key` is the sidecar's.
fn check_equal(key: &str, numbers: Option<[f32; 3]>) -> Result<(), String> {
    match numbers {
        Some([a, b, c]) if a.to_bits() != b.to_bits() || b.to_bits() != c.to_bits() => Err(format!(
            "takes one channel (channels = \"y\"), but {key} = {:?} in MODEL.onnx.toml or the preset has different numbers; write the same one three times",
            [a, b, c]
        )),
        _ => Ok(()),
    }
}

impl ImageInput {
    /// True if the input accepts any height or any width.
    pub(crate) fn takes_any_side(&self) -> bool {
        let [_, height, width] = self.layout.axes();
        [height, width].iter().any(|place| self.port.dims[*place].known().is_none())
    }
}

impl Signature {
    /// True if an output can be an image of the input's size with one or three channels.
    pub(crate) fn has_image_size(&self, port: &Port) -> bool {
        let layout = self.input.layout;
        let [_, height, width] = layout.axes().map(|place| &self.input.port.dims[place]);
        [1, 3].into_iter().any(|count| {
            let layout = port.layout(count).unwrap_or(layout);
            port.channels().is_some() && port.can_be_image(layout, count, [height, width])
        })
    }
}

/// Finds the input that is the image, and its layout.
fn image_input<'a>(inputs: &'a [Port], convention: &ModelSidecar) -> Result<(&'a Port, TensorLayout), String> {
    let channels = convention.channels.unwrap_or_default();
    let images: Vec<&Port> =
        inputs.iter().filter(|port| !port.is_scalar() && !convention.extra.contains_key(&port.name)).collect();
    // Without a clear candidate, take the first one: the error message then names it.
    let Some(image) = images
        .iter()
        .find(|port| port.layout(channels.count()).is_some() && !is_map_or_noise(&port.name))
        .or(images.first())
        .copied()
    else {
        if let Some(port) = inputs.iter().find(|port| port.dims.is_empty() && port.element.is_input_type()) {
            return Err(format!(
                "takes {port}, an input without a shape; export it with one, such as [1, 3, height, width]"
            ));
        }
        return Err(format!(
            "has no input that can be an image; export it with an input of [1, 3, height, width]; inputs: {}",
            format_ports(inputs)
        ));
    };
    if !image.element.is_input_type() {
        return Err(format!("takes {image}, an unsupported type; export it with float32, float16 or uint8"));
    }
    if let [first, _, _, _] = image.dims.as_slice()
        && !first.can_be(1)
    {
        return Err(format!(
            "takes {image}, several images at a time; export it with batch size 1 or a dynamic batch axis"
        ));
    }
    if let Some(problem) = unusable_shape(image) {
        return Err(format!("takes {image}, {problem}"));
    }
    let layout = match (convention.layout_in, image.layout(channels.count())) {
        (Some(stated), Some(found)) if stated != found => None,
        (Some(stated), _) => Some(stated).filter(|stated| stated.rank() == image.dims.len()),
        (None, Some(found)) => Some(found),
        (None, None) if channels == Channels::Rgb && image.layout(1).is_some() => {
            return Err(format!(
                "takes {image}, an image of one channel; if that is the luma, {ADD}: `channels = \"y\"`"
            ));
        }
        (None, None) if channels == Channels::Y && image.layout(3).is_some() => {
            return Err(format!(
                "takes {image}, an image of three channels, but MODEL.onnx.toml or the preset sets `channels = \"y\"` (one channel); delete that line"
            ));
        }
        (None, None) if image.may_be_image() => {
            return Err(format!(
                "takes {image}, whose shape does not show where the {} are; {ADD}: `layout_in = \"nchw\"` (or nhwc, chw, hwc)",
                channels.description()
            ));
        }
        (None, None) => {
            return Err(format!(
                "takes {image}, which is not an image of {}; export it for images of [1, {}, height, width]",
                channels.description(),
                channels.count()
            ));
        }
    };
    match layout {
        Some(layout) if image.dims[layout.axes()[0]].can_be(channels.count()) => Ok((image, layout)),
        _ => Err(format!(
            "takes {image}, which does not fit `layout_in` in MODEL.onnx.toml or the preset; correct or delete that line"
        )),
    }
}

/// Reason why an input of these dimensions cannot be the image, with export advice; `None` if it can.
fn unusable_shape(port: &Port) -> Option<String> {
    let [three, one] = [3, 1].map(|count| port.layout(count).is_some());
    match port.dims.len() {
        ..3 => {
            Some("a vector, not an image; export it for images of [1, 3, height, width]".to_owned())
        }
        3 | 4 if three || one => None,
        3 | 4 => port
            .channel_counts()
            .into_iter()
            .find(|count| (2..=16).contains(count) && *count != 3)
            .map(|count| {
                format!(
                    "{count} channels, but an image has 3; export it so that it takes the image alone and computes the other channels in the graph"
                )
            }),
        rank => Some(format!(
            "several frames at a time ({rank} dimensions); export it for single images of [1, 3, height, width]"
        )),
    }
}

#[cfg(test)]
mod tests;
