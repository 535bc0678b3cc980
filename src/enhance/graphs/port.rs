//! Inputs and outputs of a graph: [`Port`].

use std::fmt;

use crate::conventions::{ElementType, TensorLayout};

/// Maximum number of channels of an output (heuristic: Zero-DCE's curve maps have 24).
const MAX_CHANNELS: usize = 64;

/// An input or output of a graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Port {
    pub(crate) name: String,
    pub(crate) element: ElementType,
    /// Dimensions; empty for a scalar and for an undeclared rank.
    pub(crate) dims: Vec<Dim>,
}

/// One dimension of a tensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Dim {
    /// Fixed size.
    Known(usize),
    /// Dynamic size with its symbolic name in the graph; the name may be empty.
    Free(String),
}

impl Dim {
    pub(crate) fn known(&self) -> Option<usize> {
        match self {
            Self::Known(size) => Some(*size),
            Self::Free(_) => None,
        }
    }

    /// True if the dimension can have this size.
    pub(crate) fn can_be(&self, size: usize) -> bool {
        self.known().is_none_or(|known| known == size)
    }

    /// True if two dimensions can have the same size.
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

impl Port {
    /// Layout of an image with `channels` channels; `None` if the dimensions do not determine it.
    pub(crate) fn layout(&self, channels: usize) -> Option<TensorLayout> {
        let mut fitting = TensorLayout::ALL.into_iter().filter(|layout| {
            let [channel_axis, _, _] = layout.axes();
            self.dims.len() == layout.rank()
                && self.dims[channel_axis].known() == Some(channels)
                && (layout.rank() == 3 || self.dims[0].can_be(1))
        });
        // The layout is ambiguous if a second one fits.
        fitting.next().filter(|_| fitting.next().is_none())
    }

    /// True if the port can be an RGB image: one of the last three dimensions can be 3, and none is 1 (a grey image).
    pub(crate) fn may_be_image(&self) -> bool {
        let last = &self.dims[self.dims.len().saturating_sub(3)..];
        let is_grey = last.iter().any(|dim| dim.known() == Some(1));
        (3..=4).contains(&self.dims.len()) && !is_grey && last.iter().any(|dim| dim.can_be(3))
    }

    /// True if the port can be an output image in this layout, with `count` channels and the height and width of the
    /// input.
    pub(crate) fn can_be_image(&self, layout: TensorLayout, count: usize, [height, width]: [&Dim; 2]) -> bool {
        // Without declared dimensions any shape is possible.
        let [channels, rows, columns] = layout.axes();
        let is_shape_possible = self.dims.is_empty()
            || self.dims.len() == layout.rank()
                && self.dims[channels].can_be(count)
                && self.dims[rows].can_equal(height)
                && self.dims[columns].can_equal(width)
                && !self.has_channels_as_side([rows, columns], [height, width])
                && (layout.rank() == 3 || self.dims[0].can_be(1));
        is_shape_possible && self.element.is_output_type()
    }

    /// True if one of the two axes is a channel axis, not a side of the image: its size is fixed and small, but the
    /// other axis and both sides of the input are dynamic.
    fn has_channels_as_side(&self, axes: [usize; 2], input: [&Dim; 2]) -> bool {
        let is_input_dynamic = input.iter().all(|side| side.known().is_none());
        let has_small_side = match axes.map(|axis| self.dims[axis].known()) {
            [Some(size), None] | [None, Some(size)] => size <= MAX_CHANNELS,
            _ => false,
        };
        is_input_dynamic && has_small_side
    }

    /// Possible channel counts: the fixed, small sizes at the channel axes of all layouts of this rank.
    pub(crate) fn channel_counts(&self) -> Vec<usize> {
        TensorLayout::ALL
            .into_iter()
            .filter(|layout| layout.rank() == self.dims.len())
            .filter_map(|layout| self.dims[layout.axes()[0]].known())
            .filter(|count| *count <= MAX_CHANNELS)
            .collect()
    }

    /// Declared number of channels of an image: 3 if a layout has three channels, else the size of the third axis from
    /// the end (CHW); `None` if that size is dynamic.
    pub(crate) fn channels(&self) -> Option<usize> {
        let rgb = self.layout(3).map(|_| 3);
        let chw_axis = self.dims.len().checked_sub(3);
        rgb.or_else(|| self.dims.get(chw_axis?).and_then(Dim::known))
    }

    /// True if an exporter generated the name: a number, a module path or an operator's name.
    ///
    /// If the user passes fewer names than the graph has outputs, the exporter applies them to the first outputs and
    /// generates the rest. The output that got the name `output` is then not necessarily the image: in Zero-DCE it is
    /// another one.
    pub(crate) fn is_numbered(&self) -> bool {
        const OPERATORS: [&str; 19] = [
            "add", "cat", "clamp", "clip", "concat", "conv", "conv2d", "div", "getitem", "identity", "max", "min",
            "mul", "pow", "relu", "sigmoid", "slice", "sub", "tanh",
        ];
        let name = &self.name;
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_').to_ascii_lowercase();
        stem.is_empty() || name.contains(['/', ':', '.']) || OPERATORS.contains(&stem.as_str())
    }

    /// True if the port is a single number: all dimensions are 1. One of them may be dynamic instead, such as the batch
    /// size.
    pub(crate) fn is_scalar(&self) -> bool {
        let dynamic = self.dims.iter().filter(|dim| dim.known().is_none()).count();
        dynamic <= 1 && self.dims.iter().all(|dim| dim.can_be(1))
    }
}

/// Ports as a comma-separated list for messages; `none` without ports.
pub(crate) fn format_ports(ports: &[Port]) -> String {
    if ports.is_empty() {
        return "none".to_owned();
    }
    let ports: Vec<String> = ports.iter().map(Port::to_string).collect();
    ports.join(", ")
}
