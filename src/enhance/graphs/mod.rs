//! Graphs loaded into ONNX Runtime: inputs, outputs, sessions and runs.

mod graph;
mod network;
mod port;
mod session;

pub use graph::LoadLimits;
pub(super) use graph::{Arena, Graph, RunResult};
pub use network::Network;
pub(super) use port::{Dim, Port, format_ports};
pub(super) use session::GraphSource;
pub use session::Stopper;
