//! Graphs loaded into ONNX Runtime: inputs, outputs, sessions and runs.

mod graph;
mod port;
mod session;

pub use graph::LoadLimits;
pub use session::{Network, Stopper};

pub(super) use graph::{Arena, Graph, RunResult};
pub(super) use port::{Dim, Port, format_ports};
pub(super) use session::GraphSource;
