//! Sessions of ONNX Runtime: creation, runs and early stop.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;

use ort::environment::Environment;
use ort::session::builder::{GraphOptimizationLevel, SessionBuilder};
use ort::session::{HasSelectedOutputs, OutputSelector, RunOptions, Session, SessionInputValue};
use ort::value::{DynValue, Outlet, Tensor, TensorElementType, ValueType};

use super::convention::ElementType;
use super::feeding::{Input, TensorData};
use super::port::{Dim, Port};
use super::reading::TensorSamples;
use super::signature::{NumberInput, Signature};

/// Options of the runs of a session: the selected output, and the signal to stop.
pub(super) struct SessionOptions(RunOptions<HasSelectedOutputs>);

impl SessionOptions {
    /// Options for runs that return one output.
    pub(super) fn of(output: &str) -> ort::Result<Self> {
        let selected = OutputSelector::no_default().with(output);
        Ok(Self(RunOptions::new()?.with_outputs(selected)))
    }
}

// SAFETY: `ort` withholds `Sync` because a selected output may hold a preallocated tensor, which two runs would write at
// once. None is ever preallocated here (`SessionOptions::of` selects by name alone), and the session's mutex keeps runs
// apart. The only call during a run is `terminate`, which ONNX Runtime documents for use from another thread.
#[expect(unsafe_code, reason = "there is no other way to stop a run")]
unsafe impl Sync for SessionOptions {}

/// Handle that stops an enhancer from another thread.
#[derive(Clone)]
pub struct Stopper(pub(super) Arc<SessionOptions>);

impl Stopper {
    /// Stops the current image, with an error, and every later one.
    pub fn stop(&self) {
        // If a run cannot be stopped, the program waits for it.
        if let Err(e) = self.0.0.terminate() {
            tracing::debug!("the enhancer cannot be stopped: {e}");
        }
    }
}

/// Message of an error of ONNX Runtime, in one line.
pub(super) fn one_line(error: &ort::Error) -> String {
    let words: Vec<&str> = error.message().split_whitespace().collect();
    words.join(" ")
}

/// Runs a session on an image, and reads its output before another run overwrites it.
pub(super) fn run<T>(
    session: &mut Session,
    options: &SessionOptions,
    signature: &Signature,
    input: Input,
    read: impl FnOnce(&[i64], TensorSamples<'_>) -> T,
) -> ort::Result<T> {
    let mut inputs: Vec<(&str, SessionInputValue<'_>)> = Vec::new();
    inputs.push((&signature.input.port.name, tensor(input)?.into()));
    for extra in &signature.extras {
        inputs.push((&extra.port.name, number(extra)?.into()));
    }
    let outputs = session.run_with_options(inputs, &options.0)?;
    let output = &outputs[signature.output.port.name.as_str()];
    match signature.output.port.element {
        ElementType::Uint8 => {
            let (dims, samples) = output.try_extract_tensor::<u8>()?;
            Ok(read(dims, TensorSamples::Uint8(samples)))
        }
        ElementType::Float16 => {
            let (dims, samples) = output.try_extract_tensor::<half::f16>()?;
            Ok(read(dims, TensorSamples::Float16(samples)))
        }
        _ => {
            let (dims, samples) = output.try_extract_tensor::<f32>()?;
            Ok(read(dims, TensorSamples::Float32(samples)))
        }
    }
}

fn tensor(input: Input) -> ort::Result<DynValue> {
    let Input { dims, data } = input;
    Ok(match data {
        TensorData::Float32(values) => Tensor::from_array((dims, values))?.into_dyn(),
        TensorData::Float16(values) => Tensor::from_array((dims, values))?.into_dyn(),
        TensorData::Uint8(values) => Tensor::from_array((dims, values))?.into_dyn(),
    })
}

fn number(extra: &NumberInput) -> ort::Result<DynValue> {
    let dims = vec![1_usize; extra.port.dims.len()];
    Ok(match extra.port.element {
        ElementType::Float16 => {
            Tensor::from_array((dims, vec![half::f16::from_f32(extra.value)]))?.into_dyn()
        }
        _ => Tensor::from_array((dims, vec![extra.value]))?.into_dyn(),
    })
}

/// Source of the graph of a session.
pub(super) enum GraphSource {
    Memory(Vec<u8>),
    Path(PathBuf),
}

impl GraphSource {
    pub(super) fn commit(self, mut builder: SessionBuilder) -> ort::Result<Session> {
        match self {
            Self::Memory(bytes) => builder.commit_from_memory(&bytes),
            Self::Path(path) => builder.commit_from_file(path),
        }
    }
}

/// Builder of a session with this program's options. `threads` is the number of threads, by default that of the cores.
pub(super) fn builder(
    environment: &Environment,
    threads: Option<NonZeroUsize>,
) -> ort::Result<SessionBuilder> {
    // By default ONNX Runtime pins one thread to each core, even if other programs use it.
    let threads = threads
        .or_else(|| std::thread::available_parallelism().ok())
        .map_or(1, NonZeroUsize::get);
    let builder = Session::builder(environment)?
        .with_optimization_level(GraphOptimizationLevel::All)?
        .with_intra_threads(threads)?
        // A memory plan fits images of one size only, but all are kept: twice the memory without benefit.
        .with_memory_pattern(false)?
        .with_flush_to_zero()?;
    Ok(builder)
}

/// Inputs or outputs of a session as ports.
pub(super) fn ports(outlets: &[Outlet]) -> Vec<Port> {
    outlets.iter().map(port).collect()
}

fn port(outlet: &Outlet) -> Port {
    let (element, dims) = match outlet.dtype() {
        ValueType::Tensor {
            ty,
            shape,
            dimension_symbols,
        } => {
            let element = match ty {
                TensorElementType::Float32 => ElementType::Float32,
                TensorElementType::Float16 => ElementType::Float16,
                TensorElementType::Uint8 => ElementType::Uint8,
                other => ElementType::Other(other.to_string()),
            };
            let dims = shape
                .iter()
                .zip(dimension_symbols.iter())
                .map(|(size, symbol)| {
                    usize::try_from(*size).map_or_else(|_| Dim::Free(symbol.clone()), Dim::Known)
                });
            (element, dims.collect())
        }
        other => (ElementType::Other(other.to_string()), Vec::new()),
    };
    Port {
        name: outlet.name().to_owned(),
        element,
        dims,
    }
}
