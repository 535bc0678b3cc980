//! What the integration tests share. Every test program compiles all of it and uses a part.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each integration test is a program of its own and uses a part of what is shared"
)]
#![allow(clippy::unwrap_used, reason = "a test that cannot set up its scene fails where it cannot")]

pub mod batches;
pub mod browser;
pub mod endpoint;
pub mod exr_files;
pub mod frames;
pub mod house;
pub mod icc_files;
pub mod image_files;
pub mod lerobot;
pub mod made;
pub mod onnx;
pub mod parquet_file;
pub mod process;
pub mod recording;
pub mod rooms;
pub mod run;
pub mod snapshot;
pub mod table;
pub mod tiff_files;
pub mod tools;

/// Keeps the ONNX Runtime of this test program from reporting anything; to be called before it is opened.
#[expect(unsafe_code, reason = "the environment is how ONNX Runtime is told")]
pub fn disable_telemetry() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    // SAFETY: the tests read the environment through the standard library, which locks it; ONNX Runtime, which does
    // not, is opened after this call alone, by every thread that opens it.
    ONCE.call_once(|| unsafe { darkqa_enhance::disable_telemetry() });
}
