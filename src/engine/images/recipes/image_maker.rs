//! Software versions and enhancer settings that decide images besides their recipes: [`Maker`].

use serde::Serialize;

use darkqa_enhance::SizeArgs;

/// Program, machine and enhancer settings that decide the bytes of an image besides its recipe. The number of threads
/// is not included: six models (Zero-DCE, RUAS, SCI, Retinexformer, DarkIR, `lift`) gave the same bytes with 1, 2 and 3
/// threads, and a graph that may give others runs on one.
#[derive(Debug, Serialize)]
pub(crate) struct Maker {
    /// Version of this program, because encoders may change with it.
    program: &'static str,
    /// Processor and operating system, because results of ONNX Runtime may depend on them.
    machine: [&'static str; 2],
    /// Name and version of ONNX Runtime; `None` if no enhancer is open.
    runtime: Option<(String, String)>,
    tile: String,
    max_side: Option<usize>,
    resize: bool,
}

impl Maker {
    /// This program, with this version of ONNX Runtime and these sizes of enhanced images.
    pub(crate) fn new(runtime: Option<(String, String)>, sizes: &SizeArgs) -> Self {
        Self {
            program: env!("CARGO_PKG_VERSION"),
            machine: [std::env::consts::ARCH, std::env::consts::OS],
            runtime,
            tile: sizes.tile.to_string(),
            max_side: sizes.llie_max_side.map(std::num::NonZeroUsize::get),
            resize: sizes.llie_resize,
        }
    }

    /// Version of this program.
    pub(crate) fn program(&self) -> &'static str {
        self.program
    }
}
