//! Inputs and outputs of a graph: [`Port`].

use std::fmt;

use crate::conventions::{ElementType, TensorLayout};

/// Maximum number of channels of an output; chosen (Zero-DCE's curves have 24).
const MAX_CHANNELS: usize = 64;

/// An input or output of a graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Port {
    pub(crate) name: String,
    pub(crate) element: ElementType,
    /// Dimensions; empty for a scalar, and if the graph does not declare the rank.
    pub(crate) dims: Vec<Dim>,
}

/// One dimension of a tensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Dim {
    /// Fixed size.
    Known(usize),
    /// Dynamic size, with its symbolic name in the graph, which may be empty.
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
            self.dims.len() == layout.rank()
                && self.dims[layout.axes()[0]].known() == Some(channels)
                && (layout.rank() == 3 || self.dims[0].can_be(1))
        });
        // If two dimensions can be the channels, the layout is ambiguous.
        fitting.next().filter(|_| fitting.next().is_none())
    }

    /// True if the port can be an RGB image; false for a grey image, which has a dimension of 1 instead of 3.
    pub(crate) fn may_be_image(&self) -> bool {
        let last = &self.dims[self.dims.len().saturating_sub(3)..];
        let is_grey = last.iter().any(|dim| dim.known() == Some(1));
        (3..=4).contains(&self.dims.len()) && !is_grey && last.iter().any(|dim| dim.can_be(3))
    }

    /// True if the port can be an image in this layout with `count` channels and this height and width.
    pub(crate) fn can_be_image(
        &self,
        layout: TensorLayout,
        count: usize,
        [height, width]: [&Dim; 2],
    ) -> bool {
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

    /// True if one of the dimensions `sides` is fixed to a small number while the other and the sides of the input are dynamic: the small
    /// number then counts channels, not pixels.
    fn has_channels_as_side(&self, sides: [usize; 2], input: [&Dim; 2]) -> bool {
        let is_input_dynamic = input.iter().all(|side| side.known().is_none());
        let has_small_side = match sides.map(|side| self.dims[side].known()) {
            [Some(size), None] | [None, Some(size)] => size <= MAX_CHANNELS,
            _ => false,
        };
        is_input_dynamic && has_small_side
    }

    /// Fixed sizes of the dimensions that can be channels.
    pub(crate) fn channel_counts(&self) -> Vec<usize> {
        TensorLayout::ALL
            .into_iter()
            .filter(|layout| layout.rank() == self.dims.len())
            .filter_map(|layout| self.dims[layout.axes()[0]].known())
            .filter(|count| *count <= MAX_CHANNELS)
            .collect()
    }

    /// Number of channels that the graph declares for an image; `None` if it declares none.
    pub(crate) fn channels(&self) -> Option<usize> {
        let three = self.layout(3).map(|_| 3);
        let first = self.dims.len().checked_sub(3);
        three.or_else(|| self.dims.get(first?).and_then(Dim::known))
    }

    /// True if an exporter generated the name: a number, a path of modules, or an operator's name.
    ///
    /// An exporter that gets fewer names than outputs names the first outputs and numbers the rest. A first output named `output` is then
    /// not necessarily the image (for Zero-DCE it is not).
    pub(crate) fn is_numbered(&self) -> bool {
        const OPERATORS: [&str; 19] = [
            "add", "cat", "clamp", "clip", "concat", "conv", "conv2d", "div", "getitem",
            "identity", "max", "min", "mul", "pow", "relu", "sigmoid", "slice", "sub", "tanh",
        ];
        let name = &self.name;
        let word = name
            .trim_end_matches(|c: char| c.is_ascii_digit() || c == '_')
            .to_ascii_lowercase();
        word.is_empty() || name.contains(['/', ':', '.']) || OPERATORS.contains(&word.as_str())
    }

    /// True if the port is a single number: all dimensions are 1, except that one may be dynamic, such as the batch.
    pub(crate) fn is_scalar(&self) -> bool {
        let dynamic = self.dims.iter().filter(|dim| dim.known().is_none()).count();
        dynamic <= 1 && self.dims.iter().all(|dim| dim.can_be(1))
    }
}

/// Ports as text, for messages.
pub(crate) fn format_ports(ports: &[Port]) -> String {
    if ports.is_empty() {
        return "none".to_owned();
    }
    let ports: Vec<String> = ports.iter().map(Port::to_string).collect();
    ports.join(", ")
}
