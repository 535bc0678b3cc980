//! What the integration tests share. Every test program compiles all of it and uses a part.
#![allow(
    dead_code,
    reason = "each integration test is a program of its own and uses a part of what is shared"
)]
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its scene fails where it cannot"
)]

pub mod onnx;
