//! Protobuf messages of an ONNX file that contain nodes or weights: [`OnnxMessage`].

/// Type of a message of `onnx.proto` that can contain nodes or weights.
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
    /// Type of the message in the field with this number; `None` if it can contain neither nodes nor weights.
    pub(super) fn child(self, number: u64) -> Option<Self> {
        match (self, number) {
            (Self::Model, 7) | (Self::Attribute, 6 | 11) => Some(Self::Graph),
            (Self::Model, 25) => Some(Self::Function),
            (Self::Graph, 1) | (Self::Function, 7) => Some(Self::Node),
            (Self::Node, 5) => Some(Self::Attribute),
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Some(Self::SparseTensor),
            (Self::Graph, 5) | (Self::Attribute, 5 | 10) | (Self::SparseTensor, 1) => Some(Self::Tensor),
            _ => None,
        }
    }

    /// Type of the message in the field with this number; `None` if it cannot contain nodes.
    pub(super) fn child_with_nodes(self, number: u64) -> Option<Self> {
        self.child(number).filter(|child| !matches!(child, Self::SparseTensor | Self::Tensor))
    }
}
