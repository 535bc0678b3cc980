//! The `darkqa-eval` program.

use std::process::ExitCode;

use darkqa_eval::{cli, enhance};

#[expect(
    unsafe_code,
    reason = "a switch that ONNX Runtime reads from the environment alone"
)]
fn main() -> ExitCode {
    // SAFETY: nothing has started a thread yet.
    unsafe { enhance::forbid_telemetry() };
    cli::main(std::env::args_os())
}
