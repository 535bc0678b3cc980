//! The `darkqa-eval` program.

use std::process::ExitCode;

use darkqa_eval::cli;

#[expect(unsafe_code, reason = "a switch that ONNX Runtime reads from the environment alone")]
fn main() -> ExitCode {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    limit_heaps();
    // SAFETY: nothing has started a thread yet.
    unsafe { darkqa_enhance::disable_telemetry() };
    cli::main(std::env::args_os())
}

/// Limits glibc to one heap per core. By default it opens up to eight heaps per core, and each keeps the memory of
/// images that it once held. With the default, 48 frames on two cores take 680 MB; with two heaps they take 330 MB.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "a switch of the C library")]
fn limit_heaps() {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    // SAFETY: the call takes two numbers, and no other thread runs yet. If it fails, the default stays.
    unsafe { libc::mallopt(libc::M_ARENA_MAX, cores as libc::c_int) };
}
