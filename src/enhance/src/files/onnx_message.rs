//! The messages of an ONNX file that lead to nodes and weights: [`OnnxMessage`].

/// A message of `onnx.proto` that has nodes or weights in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OnnxMessage {
    Model,
    Graph,
    Function,
    Node,
    Attribute,
    SparseTensor,
    Tensor,
}

impl OnnxMessage {
    /// The message in a field; `None` if it has neither nodes nor weights.
    pub(super) fn in_field(self, number: u64) -> Option<Self> {
        match (self, number) {
            (Self::Model, 7) | (Self::Attribute, 6 | 11) => Some(Self::Graph),
            (Self::Model, 25) => Some(Self::Function),
            (Self::Graph, 1) | (Self::Function, 7) => Some(Self::Node),
            (Self::Node, 5) => Some(Self::Attribute),
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Some(Self::SparseTensor),
            (Self::Graph, 5) | (Self::Attribute, 5 | 10) | (Self::SparseTensor, 1) => {
                Some(Self::Tensor)
            }
            _ => None,
        }
    }

    /// The message in a field if it has nodes in it.
    pub(super) fn with_nodes(self, number: u64) -> Option<Self> {
        let inner = self.in_field(number);
        inner.filter(|inner| !matches!(inner, Self::SparseTensor | Self::Tensor))
    }
}
