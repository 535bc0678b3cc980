//! The enhancers that darkqa-eval carries: [`BUILT_IN`]. `README.md` beside this file tells what each one does.

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
    BuiltIn {
        name: "lift",
        model: include_bytes!("lift.onnx"),
        sidecar: include_str!("lift.onnx.toml"),
    },
    BuiltIn {
        name: "gray-gain",
        model: include_bytes!("gray-gain.onnx"),
        sidecar: include_str!("gray-gain.onnx.toml"),
    },
];
