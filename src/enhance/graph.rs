//! A graph loaded into ONNX Runtime, with the conversion of images to and from it: [`Graph`].

use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use ort::session::Session;

use super::convention::TensorLayout;
use super::feeding::{Feeding, Input};
use super::planes::Planes;
use super::plausible::Codes;
use super::port::Port;
use super::reading::{OutOfRange, OutputReading, TensorSamples};
use super::runtime::Runtime;
use super::session::{GraphSource, SessionOptions, Stopper, builder, one_line, ports, run};
use super::sidecar::ModelSidecar;
use super::signature::Signature;
use super::tiles::TileWindow;
use crate::error::Result;
use crate::types::Rgb;

/// A loaded graph with its session.
pub(super) struct Graph {
    pub(super) signature: Arc<Signature>,
    pub(super) feeding: Feeding,
    pub(super) reading: Arc<OutputReading>,
    runtime: Runtime,
    session: Arc<Mutex<Session>>,
    options: Arc<SessionOptions>,
    /// All inputs and outputs, by name, type and dimensions.
    ports: Arc<[Vec<Port>; 2]>,
}

/// Result of a run of a model.
pub(super) enum RunResult<T> {
    /// What was read from the output.
    Output(T),
    /// It failed on an image of this size; the message follows the file's name.
    Failed(String),
    /// The values of the output are not those of an image.
    Unusable(OutOfRange),
}

impl Graph {
    /// Loads a model.
    ///
    /// # Errors
    /// The inner error is what is wrong with the model; the message follows the file's name.
    pub(super) fn load(
        source: GraphSource,
        convention: &ModelSidecar,
        runtime: &Runtime,
        threads: Option<NonZeroUsize>,
    ) -> Result<std::result::Result<Self, String>> {
        let environment = runtime.environment().clone();
        let session = runtime.run(move || {
            builder(&environment, threads).and_then(|builder| source.commit(builder))
        })?;
        Ok(session
            .map_err(|e| format!("ONNX Runtime cannot load it: {}", one_line(&e)))
            .and_then(|session| Self::new(session, convention, runtime)))
    }

    fn new(
        session: Session,
        convention: &ModelSidecar,
        runtime: &Runtime,
    ) -> std::result::Result<Self, String> {
        let ports = [ports(session.inputs()), ports(session.outputs())];
        let session = Arc::new(Mutex::new(session));
        Self::of_session(session, Arc::new(ports), convention, runtime)
    }

    fn of_session(
        session: Arc<Mutex<Session>>,
        ports: Arc<[Vec<Port>; 2]>,
        convention: &ModelSidecar,
        runtime: &Runtime,
    ) -> std::result::Result<Self, String> {
        let [inputs, outputs] = &*ports;
        let signature = Signature::of(inputs, outputs, convention)?;
        let options = SessionOptions::of(&signature.output.port.name).map_err(|e| one_line(&e))?;
        Ok(Self {
            feeding: Feeding::of(&signature, convention),
            reading: Arc::new(OutputReading::of(&signature, convention)),
            signature: Arc::new(signature),
            runtime: runtime.clone(),
            session,
            options: Arc::new(options),
            ports,
        })
    }

    /// The same session, fed and read by another convention.
    ///
    /// # Errors
    /// If the graph contradicts it; the message follows the file's name.
    pub(super) fn with_convention(
        &self,
        convention: &ModelSidecar,
    ) -> std::result::Result<Self, String> {
        let (session, ports) = (Arc::clone(&self.session), Arc::clone(&self.ports));
        Self::of_session(session, ports, convention, &self.runtime)
    }

    /// Outputs of the graph, used or not.
    pub(super) fn outputs(&self) -> &[Port] {
        &self.ports[1]
    }

    /// The ONNX Runtime that runs it.
    pub(super) fn runtime(&self) -> &Runtime {
        &self.runtime
    }

    /// A handle that ends a run from another thread.
    pub(super) fn stopper(&self) -> Stopper {
        Stopper(Arc::clone(&self.options))
    }

    /// Runs the model on a window of an image; returns the bytes of a part of the window.
    pub(super) fn window(
        &self,
        image: &Rgb,
        window: TileWindow,
        part: TileWindow,
    ) -> Result<RunResult<Vec<u8>>> {
        let (input, size) = (self.feeding.window(image, window), window.size());
        let reading = Arc::clone(&self.reading);
        self.run(input, size, move |samples, layout| {
            reading.bytes(samples, layout, size, part)
        })
    }

    /// Runs the model on a window of an image and ignores its output.
    pub(super) fn probe(&self, image: &Rgb, window: TileWindow) -> Result<RunResult<()>> {
        let input = self.feeding.window(image, window);
        self.run(input, window.size(), |_, _| Ok(()))
    }

    /// Runs the model on a whole image of floats.
    pub(super) fn planes(&self, planes: &Planes) -> Result<RunResult<Planes>> {
        let (input, size) = (self.feeding.planes(planes), [planes.height, planes.width]);
        let reading = Arc::clone(&self.reading);
        self.run(input, size, move |samples, layout| {
            reading.planes(samples, layout, size)
        })
    }

    /// Runs the model on a whole image; returns codes of 0..255 that are neither clamped nor rounded.
    pub(super) fn codes(&self, image: &Rgb) -> Result<RunResult<Codes>> {
        Ok(match self.planes(&Planes::of(image))? {
            RunResult::Output(planes) => RunResult::Output(Codes::of_planes(&planes)),
            RunResult::Failed(problem) => RunResult::Failed(problem),
            RunResult::Unusable(values) => RunResult::Unusable(values),
        })
    }

    /// Runs the model, and reads its output before another run overwrites it.
    fn run<T: Send + 'static>(
        &self,
        input: Input,
        size: [usize; 2],
        read: impl FnOnce(TensorSamples<'_>, TensorLayout) -> std::result::Result<T, OutOfRange>
        + Send
        + 'static,
    ) -> Result<RunResult<T>> {
        let (session, options) = (Arc::clone(&self.session), Arc::clone(&self.options));
        let (signature, reading) = (Arc::clone(&self.signature), Arc::clone(&self.reading));
        let [height, width] = size;
        self.runtime.run(move || {
            let mut session = session.lock().unwrap_or_else(PoisonError::into_inner);
            let result = run(
                &mut session,
                &options,
                &signature,
                input,
                |dims, samples| match reading.layout(dims, size) {
                    Some(layout) => read(samples, layout).map_or_else(RunResult::Unusable, RunResult::Output),
                    None => RunResult::Failed(format!(
                        "gave {dims:?} for an image of {width} × {height}: the output must have the size of the input; if it only takes multiples of some size, state it in MODEL.onnx.toml beside it: `multiple = 8`"
                    )),
                },
            );
            result.unwrap_or_else(|e| {
                let problem = one_line(&e);
                RunResult::Failed(format!(
                    "failed on an image of {width} × {height} ({problem}); if it only takes multiples of some size, state it in MODEL.onnx.toml beside it: `multiple = 8`"
                ))
            })
        })
    }
}
