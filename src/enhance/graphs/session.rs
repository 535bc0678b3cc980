//! Sessions of ONNX Runtime: creation, runs and early stop.
//!
//! Built-in network that is not an enhancer: [`Network`].

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ort::environment::Environment;
use ort::session::builder::{GraphOptimizationLevel, SessionBuilder};
use ort::session::{HasSelectedOutputs, OutputSelector, RunOptions, Session, SessionInputValue};
use ort::value::{DynValue, Outlet, Tensor, TensorElementType, ValueType};

use super::port::{Dim, Port};
use crate::conventions::ElementType;
use crate::failure::describe_load_failure;
use crate::inputs::{Tensor as InputTensor, TensorData};
use crate::libraries::Runtime;
use crate::outputs::{Output, OutputTensor, TensorSamples};
use darkqa_base::error::{Error, Result};

/// Run options of a session: the selected outputs, and the signal to stop.
pub(super) struct SessionOptions {
    options: RunOptions<HasSelectedOutputs>,
    /// True if every later run is to be stopped too.
    stopped: AtomicBool,
}

impl SessionOptions {
    /// Options for runs that return these outputs.
    pub(super) fn for_outputs(outputs: &[Output]) -> ort::Result<Self> {
        let selector =
            outputs.iter().fold(OutputSelector::no_default(), |selector, output| selector.with(&output.port.name));
        Ok(Self { options: RunOptions::new()?.with_outputs(selector), stopped: AtomicBool::new(false) })
    }

    /// Options for runs that return these outputs and release ONNX Runtime's memory arena at their end.
    pub(super) fn releasing_memory(outputs: &[Output]) -> ort::Result<Self> {
        let mut options = Self::for_outputs(outputs)?;
        options.options.set("memory.enable_memory_arena_shrinkage", "cpu:0")?;
        Ok(options)
    }

    /// Stops the current run. ONNX Runtime ends it between two nodes of the graph.
    pub(super) fn end_run(&self) {
        // If a run cannot be stopped, the program waits for it.
        if let Err(e) = self.options.terminate() {
            tracing::debug!("the enhancer cannot be stopped: {e}");
        }
    }

    /// Allows runs again after [`Self::end_run`], unless all are to be stopped.
    pub(super) fn allow_runs(&self) {
        if let Err(e) = self.options.unterminate() {
            tracing::debug!("the enhancer cannot go on: {e}");
        }
        if self.stopped.load(Ordering::SeqCst) {
            self.end_run();
        }
    }
}

// SAFETY: `ort` withholds `Sync` because a selected output may have a preallocated tensor, to which two runs could
// write at once. Outputs are never preallocated here (`SessionOptions::for_outputs` selects by name alone), and the
// session's mutex prevents concurrent runs. The only calls during a run are `terminate` and `unterminate`, which ONNX
// Runtime documents for use from another thread: they set one flag.
#[expect(unsafe_code, reason = "there is no other way to stop a run")]
unsafe impl Sync for SessionOptions {}

/// Handle that stops an enhancer from another thread.
#[derive(Clone)]
pub struct Stopper(pub(super) Arc<SessionOptions>);

impl Stopper {
    /// Stops the current image, with an error, and every later one.
    pub fn stop(&self) {
        self.0.stopped.store(true, Ordering::SeqCst);
        self.0.end_run();
    }
}

/// Message of an ONNX Runtime error, in one line.
pub(super) fn one_line(error: &ort::Error) -> String {
    error.message().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs a session on named inputs, and decodes its outputs with `read` before another run overwrites them. For a graph
/// with a fixed batch size, each image is repeated, and the first result is decoded.
pub(super) fn run<T>(
    session: &mut Session,
    options: &SessionOptions,
    batch: usize,
    inputs: Vec<(String, InputTensor)>,
    outputs: &[Output],
    read: impl FnOnce(&[OutputTensor<'_>]) -> T,
) -> ort::Result<T> {
    let inputs = inputs
        .into_iter()
        .map(|(name, input)| Ok((name, SessionInputValue::from(to_ort_tensor(input, batch)?))))
        .collect::<ort::Result<Vec<_>>>()?;
    let results = session.run_with_options(inputs, &options.options)?;
    let tensors = outputs
        .iter()
        .map(|output| {
            let value = &results[output.port.name.as_str()];
            output_tensor(value, &output.port.element, batch)
        })
        .collect::<ort::Result<Vec<_>>>()?;
    Ok(read(&tensors))
}

/// First image of an output.
fn output_tensor<'a>(value: &'a DynValue, element: &ElementType, batch: usize) -> ort::Result<OutputTensor<'a>> {
    let (dims, samples) = match element {
        ElementType::Uint8 => {
            let (dims, samples) = value.try_extract_tensor::<u8>()?;
            let (dims, samples) = first_image(batch, dims, samples);
            (dims, TensorSamples::Uint8(samples))
        }
        ElementType::Float16 => {
            let (dims, samples) = value.try_extract_tensor::<half::f16>()?;
            let (dims, samples) = first_image(batch, dims, samples);
            (dims, TensorSamples::Float16(samples))
        }
        ElementType::Float64 => {
            let (dims, samples) = value.try_extract_tensor::<f64>()?;
            let (dims, samples) = first_image(batch, dims, samples);
            (dims, TensorSamples::Float64(samples))
        }
        ElementType::Int32 => {
            let (dims, samples) = value.try_extract_tensor::<i32>()?;
            let (dims, samples) = first_image(batch, dims, samples);
            (dims, TensorSamples::Int32(samples))
        }
        ElementType::Int64 => {
            let (dims, samples) = value.try_extract_tensor::<i64>()?;
            let (dims, samples) = first_image(batch, dims, samples);
            (dims, TensorSamples::Int64(samples))
        }
        _ => {
            let (dims, samples) = value.try_extract_tensor::<f32>()?;
            let (dims, samples) = first_image(batch, dims, samples);
            (dims, TensorSamples::Float32(samples))
        }
    };
    Ok(OutputTensor { dims, samples })
}

/// Dimensions and samples of the first image of a batch.
fn first_image<'a, T>(batch: usize, dims: &[i64], samples: &'a [T]) -> (Vec<i64>, &'a [T]) {
    let mut dims = dims.to_vec();
    match dims.first_mut() {
        Some(first) if batch > 1 && usize::try_from(*first) == Ok(batch) => {
            *first = 1;
            (dims, &samples[..samples.len() / batch])
        }
        _ => (dims, samples),
    }
}

/// Converts a tensor for ONNX Runtime. A tensor of rank 4 with a first dimension of 1 is repeated `batch` times along
/// it.
fn to_ort_tensor(input: InputTensor, batch: usize) -> ort::Result<DynValue> {
    let InputTensor { mut dims, data } = input;
    let times = match dims.as_mut_slice() {
        [first @ 1, _, _, _] => {
            *first = batch;
            batch
        }
        _ => 1,
    };
    Ok(match data {
        TensorData::Bool(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Int8(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Int16(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Int32(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Int64(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Uint8(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Uint16(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Uint32(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Uint64(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Float16(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Bfloat16(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Float32(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
        TensorData::Float64(values) => Tensor::from_array((dims, repeat(values, times)))?.into_dyn(),
    })
}

fn repeat<T: Copy>(values: Vec<T>, times: usize) -> Vec<T> {
    if times == 1 { values } else { values.repeat(times) }
}

/// Session option for the folder of external data, of a model in memory (`onnxruntime_session_options_config_keys.h`).
const EXTERNAL_FOLDER: &str = "session.model_external_initializers_file_folder_path";

/// Source of the graph of a session.
pub(crate) enum GraphSource {
    Memory(Vec<u8>),
    /// The bytes of a model, and the folder of its external data.
    MemoryBeside {
        bytes: Vec<u8>,
        folder: PathBuf,
    },
    Path(PathBuf),
}

impl GraphSource {
    pub(super) fn commit(self, mut builder: SessionBuilder) -> ort::Result<Session> {
        match self {
            Self::Memory(bytes) => builder.commit_from_memory(&bytes),
            Self::MemoryBeside { bytes, folder } => {
                let folder = folder.to_string_lossy();
                builder.with_config_entry(EXTERNAL_FOLDER, folder)?.commit_from_memory(&bytes)
            }
            Self::Path(path) => builder.commit_from_file(path),
        }
    }
}

/// Builder of a session with this program's options. `threads` is the number of threads, by default the number of
/// cores.
pub(super) fn session_builder(environment: &Environment, threads: Option<NonZeroUsize>) -> ort::Result<SessionBuilder> {
    // With its own default, ONNX Runtime would pin one thread to each core, even to cores that other programs use.
    let threads = threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    let builder = Session::builder(environment)?
        .with_optimization_level(GraphOptimizationLevel::All)?
        .with_intra_threads(threads)?
        // ONNX Runtime keeps a memory plan for each image size, which doubles the memory without benefit.
        .with_memory_pattern(false)?
        .with_flush_to_zero()?;
    Ok(builder)
}

/// Maximum fixed batch size for which an image is repeated; chosen (some models are exported with a batch of a few
/// images).
const MAX_BATCH: usize = 64;

/// Sets a fixed batch dimension above 1 to 1 in all ports; returns the batch size, or 1 if it is not fixed.
pub(super) fn remove_batch(inputs: &mut [Port], outputs: &mut [Port]) -> usize {
    let Some(batch) = inputs.iter().find_map(fixed_batch) else {
        return 1;
    };
    for port in inputs.iter_mut().chain(outputs) {
        if fixed_batch(port) == Some(batch) {
            port.dims[0] = Dim::Known(1);
        }
    }
    batch
}

/// Fixed batch size of a port of rank 4, if it is from 2 to [`MAX_BATCH`].
fn fixed_batch(port: &Port) -> Option<usize> {
    match port.dims.as_slice() {
        [Dim::Known(batch @ 2..=MAX_BATCH), _, _, _] => Some(*batch),
        _ => None,
    }
}

/// Inputs or outputs of a session as ports.
pub(super) fn ports(outlets: &[Outlet]) -> Vec<Port> {
    outlets.iter().map(port).collect()
}

fn port(outlet: &Outlet) -> Port {
    let (element, dims) = match outlet.dtype() {
        ValueType::Tensor { ty, shape, dimension_symbols } => {
            let element = match ty {
                TensorElementType::Float32 => ElementType::Float32,
                TensorElementType::Float16 => ElementType::Float16,
                TensorElementType::Float64 => ElementType::Float64,
                TensorElementType::Bfloat16 => ElementType::Bfloat16,
                TensorElementType::Bool => ElementType::Bool,
                TensorElementType::Int8 => ElementType::Int8,
                TensorElementType::Int16 => ElementType::Int16,
                TensorElementType::Int32 => ElementType::Int32,
                TensorElementType::Int64 => ElementType::Int64,
                TensorElementType::Uint8 => ElementType::Uint8,
                TensorElementType::Uint16 => ElementType::Uint16,
                TensorElementType::Uint32 => ElementType::Uint32,
                TensorElementType::Uint64 => ElementType::Uint64,
                other => ElementType::Other(other.to_string()),
            };
            let dims = shape
                .iter()
                .zip(dimension_symbols.iter())
                .map(|(size, symbol)| match usize::try_from(*size) {
                    Ok(size) => Dim::Known(size),
                    Err(_) => Dim::Free(symbol.clone()),
                })
                .collect();
            (element, dims)
        }
        other => (ElementType::Other(other.to_string()), Vec::new()),
    };
    Port { name: outlet.name().to_owned(), element, dims }
}

/// A loaded network with one input and any number of outputs, all of 32-bit floats. It runs on one thread, so that its
/// outputs do not depend on the number of cores.
pub struct Network {
    name: &'static str,
    runtime: Runtime,
    session: Arc<Mutex<Session>>,
}

impl Network {
    /// Loads a network from the content of its ONNX file; `name` names it in errors.
    ///
    /// # Errors
    /// If ONNX Runtime refuses it.
    pub fn open(name: &'static str, model: &'static [u8], runtime: &Runtime) -> Result<Self> {
        // A thread of its own, so that enhancers can run at the same time.
        let runtime = runtime.with_new_thread()?;
        let environment = runtime.environment().clone();
        let session = runtime
            .thread()
            .run(move || session_builder(&environment, Some(NonZeroUsize::MIN))?.commit_from_memory(model))?
            .map_err(|e| {
                let problem = describe_load_failure(&one_line(&e), runtime.version());
                Error::Runtime(format!("{name}: {problem}"))
            })?;
        Ok(Self { name, session: Arc::new(Mutex::new(session)), runtime })
    }

    /// Runs the network on an input of these dimensions. Returns the outputs in the order of the graph, each flattened
    /// row by row.
    ///
    /// # Errors
    /// If the run fails, for example because memory is exhausted.
    pub fn run(&self, dims: Vec<usize>, input: Vec<f32>) -> Result<Vec<Vec<f32>>> {
        let session = Arc::clone(&self.session);
        self.runtime
            .thread()
            .run(move || {
                let mut session = session.lock().unwrap_or_else(PoisonError::into_inner);
                let input = SessionInputValue::from(Tensor::from_array((dims, input))?);
                let outputs = session.run([input])?;
                outputs
                    .values()
                    .map(|output| Ok(output.try_extract_tensor::<f32>()?.1.to_vec()))
                    .collect::<ort::Result<_>>()
            })?
            .map_err(|e| Error::Runtime(format!("{}: {}", self.name, one_line(&e))))
    }
}
