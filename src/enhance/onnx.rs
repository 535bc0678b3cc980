//! A user's ONNX model on ONNX Runtime's CPU provider: [`Enhancer`].

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use ort::session::builder::{GraphOptimizationLevel, SessionBuilder};
use ort::session::{HasSelectedOutputs, OutputSelector, RunOptions, Session};
use ort::value::{Outlet, Tensor, TensorElementType, ValueType};

use crate::error::{Error, Result};
use crate::types::{Digest, EnhancerName, Rgb};

use super::file::ModelFile;
use super::runtime::Runtime;
use super::signature::{Dim, Element, Port, Signature};
use super::tensor::Planes;

/// An enhancement model, loaded and ready.
pub struct Enhancer {
    path: PathBuf,
    name: EnhancerName,
    digest: Digest,
    signature: Signature,
    runtime: Runtime,
    session: Arc<Mutex<Session>>,
    options: Arc<Options>,
}

/// How a session is run: which output is wanted, and whether it is to end early.
struct Options(RunOptions<HasSelectedOutputs>);

// SAFETY: `ort` withholds `Sync` because a selected output may hold a preallocated tensor, which two runs would write at
// once. None is ever preallocated here (`Enhancer::open` selects by name alone), runs are held apart by the session's
// mutex, and the one call made beside a run is `terminate`, which ONNX Runtime documents for use from another thread.
#[expect(unsafe_code, reason = "a run can be ended in no other way")]
unsafe impl Sync for Options {}

/// Ends the run of an enhancer from another thread.
#[derive(Clone)]
pub struct Stopper(Arc<Options>);

impl Stopper {
    /// Ends the image that is being made, with an error, and every later one.
    pub fn stop(&self) {
        // A run that cannot be ended is one that is waited for.
        if let Err(e) = self.0.0.terminate() {
            tracing::debug!("the enhancer cannot be stopped: {e}");
        }
    }
}

/// What a run gave: the tensor's dimensions and samples.
struct Output {
    dims: Vec<i64>,
    samples: Vec<f32>,
}

impl Enhancer {
    /// Loads a model from the file as it was read, so that its digest is that of what runs; `threads` is how many threads one image is computed with, `None` for as many as there are cores.
    ///
    /// # Errors
    /// Where the file is no ONNX model, ONNX Runtime refuses it, or its inputs and outputs are not one RGB image each.
    pub fn open(
        mut file: ModelFile,
        runtime: &Runtime,
        threads: Option<NonZeroUsize>,
    ) -> Result<Self> {
        let path = file.path.clone();
        let fault = |problem: String| Error::Enhancer {
            path: path.clone(),
            problem,
        };
        let flushed = file.weights.flush_subnormals(&mut file.bytes);
        if flushed > 0 {
            tracing::debug!(
                "{}: {flushed} subnormal weights set to zero",
                path.display()
            );
        }
        // ONNX Runtime finds external data only from the model's path.
        let source = if file.weights.external.is_empty() {
            Source::Memory(file.bytes)
        } else {
            Source::Path(file.path.clone())
        };
        let environment = runtime.environment().clone();
        let session = runtime
            .run(move || builder(&environment, threads).and_then(|builder| source.commit(builder)))?
            .map_err(|e| fault(format!("ONNX Runtime cannot load it: {e}")))?;
        let signature = Signature::of(
            &ports(session.inputs()),
            &ports(session.outputs()),
            file.sidecar.output.as_ref(),
        )
        .map_err(fault)?;
        let selected = OutputSelector::no_default().with(&signature.output);
        let options = RunOptions::new().map_err(|e| fault(e.to_string()))?;
        Ok(Self {
            path: file.path,
            name: file.name,
            digest: file.digest,
            signature,
            runtime: runtime.clone(),
            session: Arc::new(Mutex::new(session)),
            options: Arc::new(Options(options.with_outputs(selected))),
        })
    }

    /// The name in tables and records: the file's name without its extension.
    #[must_use]
    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// The digest of the model, its sidecar and its external data; see [`ModelFile::digest`].
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// A handle that ends a run from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        Stopper(Arc::clone(&self.options))
    }

    /// Enhances an image; the result has the same size.
    ///
    /// Where the model is of a fixed size the image is resized to it and its result back, with a bilinear filter.
    ///
    /// # Errors
    /// Where the model fails on this image, gives another size than it was given, or values that are not numbers.
    pub fn enhance(&mut self, dark: &Rgb) -> Result<Rgb> {
        let planes = Planes::of(dark);
        let height = self.signature.height.unwrap_or(planes.height);
        let width = self.signature.width.unwrap_or(planes.width);
        let mended = if (height, width) == (planes.height, planes.width) {
            self.infer(planes)?
        } else {
            let input = planes.resized(height, width).map_err(|e| self.fault(e))?;
            let mended = self.infer(input)?;
            if mended.samples.iter().any(|sample| sample.is_nan()) {
                return Err(self.not_numbers(dark));
            }
            mended
                .resized(dark.height(), dark.width())
                .map_err(|e| self.fault(e))?
        };
        mended.to_rgb().ok_or_else(|| self.not_numbers(dark))
    }

    /// Runs the model on an image of a size that it takes.
    fn infer(&self, input: Planes) -> Result<Planes> {
        let (height, width) = (input.height, input.width);
        let (session, options) = (Arc::clone(&self.session), Arc::clone(&self.options));
        let output = self.signature.output.clone();
        let result = self.runtime.run(move || {
            let mut session = session.lock().unwrap_or_else(PoisonError::into_inner);
            run(&mut session, &options.0, input, &output)
        })?;
        let Output { dims, samples } = result.map_err(|e| {
            self.fault(format!(
                "failed on an image of {width} × {height} (a model for multiples of a certain size has to pad inside its graph): {}",
                e.message().trim()
            ))
        })?;
        let sizes: Vec<Option<usize>> = dims.iter().map(|&dim| usize::try_from(dim).ok()).collect();
        if sizes != [Some(1), Some(3), Some(height), Some(width)] {
            return Err(self.fault(format!(
                "gave {dims:?} for [1, 3, {height}, {width}]: it does not keep the size of an image; pad to the multiple it needs inside the graph, or export it with that fixed size"
            )));
        }
        Ok(Planes {
            height,
            width,
            samples,
        })
    }

    fn fault(&self, problem: String) -> Error {
        Error::Enhancer {
            path: self.path.clone(),
            problem,
        }
    }

    fn not_numbers(&self, image: &Rgb) -> Error {
        self.fault(format!(
            "gave values that are not numbers (NaN) for an image of {} × {}; its weights or a division by zero in it are at fault",
            image.width(),
            image.height()
        ))
    }
}

fn run(
    session: &mut Session,
    options: &RunOptions<HasSelectedOutputs>,
    input: Planes,
    output: &str,
) -> ort::Result<Output> {
    let shape = [1, 3, input.height, input.width];
    let tensor = Tensor::from_array((shape, input.samples))?;
    let outputs = session.run_with_options(ort::inputs![tensor], options)?;
    let (shape, samples) = outputs[output].try_extract_tensor::<f32>()?;
    Ok(Output {
        dims: shape.to_vec(),
        samples: samples.to_vec(),
    })
}

/// Where a session gets its graph from.
enum Source {
    Memory(Vec<u8>),
    Path(PathBuf),
}

impl Source {
    fn commit(self, mut builder: SessionBuilder) -> ort::Result<Session> {
        match self {
            Self::Memory(bytes) => builder.commit_from_memory(&bytes),
            Self::Path(path) => builder.commit_from_file(path),
        }
    }
}

/// The options of a session.
fn builder(
    environment: &ort::environment::Environment,
    threads: Option<NonZeroUsize>,
) -> ort::Result<SessionBuilder> {
    // Left alone, ONNX Runtime pins one thread to each core, against whatever else runs there.
    let threads = threads
        .or_else(|| std::thread::available_parallelism().ok())
        .map_or(1, NonZeroUsize::get);
    let builder = Session::builder(environment)?
        .with_optimization_level(GraphOptimizationLevel::All)?
        .with_intra_threads(threads)?
        // Plans of one image's memory do not fit the next one's size, and are kept: twice the memory for nothing.
        .with_memory_pattern(false)?
        .with_flush_to_zero()?;
    Ok(builder)
}

fn ports(outlets: &[Outlet]) -> Vec<Port> {
    outlets.iter().map(port).collect()
}

/// An input or output of a session in this module's own words.
fn port(outlet: &Outlet) -> Port {
    let (element, dims) = match outlet.dtype() {
        ValueType::Tensor {
            ty,
            shape,
            dimension_symbols,
        } => {
            let element = match ty {
                TensorElementType::Float32 => Element::Float32,
                other => Element::Other(other.to_string()),
            };
            let dims = shape
                .iter()
                .zip(dimension_symbols.iter())
                .map(|(size, symbol)| {
                    usize::try_from(*size).map_or_else(|_| Dim::Free(symbol.clone()), Dim::Known)
                });
            (element, dims.collect())
        }
        other => (Element::Other(other.to_string()), Vec::new()),
    };
    Port {
        name: outlet.name().to_owned(),
        element,
        dims,
    }
}
