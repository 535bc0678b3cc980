//! Stage 3 through its own door: models made by hand, on the ONNX Runtime that is found or installed.
mod command;
mod elsewhere;
mod endings;
mod fixed;
mod inputs;
mod models;
mod probe;
mod shipped;
mod sidecars;
mod sizes;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use crate::support::onnx::{self, Graph};
use crate::support::snapshot::redacted;
use darkqa_base::types::Rgb;
use darkqa_enhance::{Enhancer, Install, ModelFile, Runtime, RuntimeSearch};
use tempfile::TempDir;

fn runtime() -> Runtime {
    crate::support::disable_telemetry();
    let search =
        RuntimeSearch { library: std::env::var_os("ORT_DYLIB_PATH").map(PathBuf::from), install: Install::Allowed };
    search.open().unwrap()
}

fn open(path: &Path) -> darkqa_eval::Result<Enhancer> {
    Enhancer::open(ModelFile::read(path)?, &runtime(), NonZeroUsize::new(1))
}

/// A model in a folder of its own, loaded.
fn loaded(graph: &Graph) -> (TempDir, Enhancer) {
    let folder = tempfile::tempdir().unwrap();
    let enhancer = open(&graph.write(folder.path(), "model.onnx")).unwrap();
    (folder, enhancer)
}

/// A model with a sidecar.
fn stated(graph: &Graph, sidecar: &str) -> (TempDir, Enhancer) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("model.onnx.toml"), sidecar).unwrap();
    let enhancer = open(&graph.write(folder.path(), "model.onnx")).unwrap();
    (folder, enhancer)
}

/// The error of a model.
fn fault(graph: &Graph) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = graph.write(folder.path(), "model.onnx");
    let message = open(&path).err().unwrap().to_string();
    assert!(message.starts_with(&path.display().to_string()), "{message}");
    message
}

/// An image with all 256 bytes in it, where it is large enough.
fn image(height: usize, width: usize) -> Rgb {
    let samples = (0..height * width * 3).map(|i| (i * 37 % 256) as u8);
    Rgb::new(height, width, samples.collect()).unwrap()
}

/// An image with a function on each byte.
fn map(image: &Rgb, with: impl Fn(f64) -> f64) -> Rgb {
    let samples =
        image.samples().iter().map(|byte| (with(f64::from(*byte) / 255.0).clamp(0.0, 1.0) * 255.0).round() as u8);
    Rgb::new(image.height(), image.width(), samples.collect()).unwrap()
}

#[test]
fn the_runtime_is_opened_once() {
    let first = runtime();
    assert_eq!(first.path(), runtime().path());
    assert!(first.version().starts_with("1."));
    let folder = tempfile::tempdir().unwrap();
    let other = RuntimeSearch { library: Some(folder.path().join("other.so")), install: Install::Offline };
    let message = other.open().err().unwrap().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    ONNX Runtime: [TMP]/other.so cannot be loaded, because this process has already loaded [LIBRARY]; name a
        library of 1.17 or later with --llie-options ort-lib=FILE or ORT_DYLIB_PATH, or leave both out to search
        for one
    ");
}

#[test]
fn enhancers_run_in_parallel_independently() {
    let image = image(9, 14);
    std::thread::scope(|scope| {
        for factor in [1.0_f32, 2.0, 3.0, 4.0] {
            let image = &image;
            scope.spawn(move || {
                let (_folder, mut enhancer) = loaded(&onnx::gain(factor));
                for _ in 0..5 {
                    let result = enhancer.enhance(image).unwrap();
                    assert_eq!(result, map(image, |x| f64::from(factor) * x));
                }
            });
        }
    });
}

#[test]
fn callers_arithmetic_keeps_its_subnormal_numbers() {
    let (_folder, mut enhancer) = loaded(&onnx::identity());
    enhancer.enhance(&image(4, 4)).unwrap();
    let half = std::hint::black_box(f32::MIN_POSITIVE) / std::hint::black_box(2.0);
    assert!(half.is_subnormal());
}
