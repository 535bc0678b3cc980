//! The networks that darkqa-eval carries: the enhancers, [`BUILT_IN`], and a model that answers from the pixels,
//! [`ROOM_NET`]. `README.md` beside this file describes them.

/// An ONNX model with its sidecar.
#[derive(Debug)]
pub struct BuiltIn {
    /// Name, as in `--llie lift` and in tables.
    pub name: &'static str,
    /// Content of the ONNX file, whose weights are all inside.
    pub model: &'static [u8],
    /// Text of the sidecar; empty if the model needs none.
    pub sidecar: &'static str,
}

/// All enhancers, the same bytes as the files in this folder, so that they have the same digests.
pub const BUILT_IN: [BuiltIn; 2] = [
    BuiltIn { name: "lift", model: include_bytes!("lift.onnx"), sidecar: include_str!("lift.onnx.toml") },
    BuiltIn {
        name: "gray-gain",
        model: include_bytes!("gray-gain.onnx"),
        sidecar: include_str!("gray-gain.onnx.toml"),
    },
];

/// The network of `--model room-net`: ONNX, with an input `image` of 1×3×144×192 floats from 0 to 1, and the outputs
/// `classes` (1×144×192, numbers of mpcat40), `distance` (1×144×192, in metres) and `rooms` (1×6, shares of the room
/// types).
pub const ROOM_NET: &[u8] = include_bytes!("room-net.onnx");
