//! A graph loaded into ONNX Runtime, with the way images are fed to it and read back: [`Graph`].

use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use ort::session::Session;

use super::convention::TensorLayout;
use super::feeding::{Feeding, Input};
use super::planes::Planes;
use super::reading::{OutOfRange, OutputReading, TensorSamples};
use super::runtime::Runtime;
use super::session::{GraphSource, SessionOptions, Stopper, builder, ports, run, said};
use super::sidecar::ModelSidecar;
use super::signature::Signature;
use super::tiles::TileWindow;
use crate::error::Result;
use crate::types::Rgb;

/// A model that is loaded and ready.
pub(super) struct Graph {
    pub(super) signature: Arc<Signature>,
    pub(super) feeding: Feeding,
    pub(super) reading: Arc<OutputReading>,
    runtime: Runtime,
    session: Arc<Mutex<Session>>,
    options: Arc<SessionOptions>,
}

/// What became of a run.
pub(super) enum RunResult<T> {
    /// It gave this.
    Gave(T),
    /// It failed on an image of this size; what is wrong, to follow the file's name.
    Failed(String),
    /// Its values cannot be those of an image.
    Unusable(OutOfRange),
}

impl Graph {
    /// Loads a model.
    ///
    /// # Errors
    /// The inner one says what is wrong with the model, to follow the file's name.
    pub(super) fn load(
        source: GraphSource,
        stated: &ModelSidecar,
        runtime: &Runtime,
        threads: Option<NonZeroUsize>,
    ) -> Result<std::result::Result<Self, String>> {
        let environment = runtime.environment().clone();
        let session = runtime.run(move || {
            builder(&environment, threads).and_then(|builder| source.commit(builder))
        })?;
        Ok(session
            .map_err(|e| format!("ONNX Runtime cannot load it: {}", said(&e)))
            .and_then(|session| Self::new(session, stated, runtime)))
    }

    fn new(
        session: Session,
        stated: &ModelSidecar,
        runtime: &Runtime,
    ) -> std::result::Result<Self, String> {
        let (inputs, outputs) = (ports(session.inputs()), ports(session.outputs()));
        let signature = Signature::of(&inputs, &outputs, stated)?;
        let options = SessionOptions::of(&signature.output.port.name).map_err(|e| said(&e))?;
        Ok(Self {
            feeding: Feeding::of(&signature, stated),
            reading: Arc::new(OutputReading::of(&signature, stated)),
            signature: Arc::new(signature),
            runtime: runtime.clone(),
            session: Arc::new(Mutex::new(session)),
            options: Arc::new(options),
        })
    }

    /// A handle that ends a run from another thread.
    pub(super) fn stopper(&self) -> Stopper {
        Stopper(Arc::clone(&self.options))
    }

    /// Runs on a window of an image, and gives the bytes of a part of the window.
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

    /// Runs on a window of an image without a look at what it gives.
    pub(super) fn probe(&self, image: &Rgb, window: TileWindow) -> Result<RunResult<()>> {
        let input = self.feeding.window(image, window);
        self.run(input, window.size(), |_, _| Ok(()))
    }

    /// Runs on a whole image of floats.
    pub(super) fn planes(&self, planes: &Planes) -> Result<RunResult<Planes>> {
        let (input, size) = (self.feeding.planes(planes), [planes.height, planes.width]);
        let reading = Arc::clone(&self.reading);
        self.run(input, size, move |samples, layout| {
            reading.planes(samples, layout, size)
        })
    }

    /// Runs the model, and reads what it gives before another run writes over it.
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
            let ran = run(
                &mut session,
                &options,
                &signature,
                input,
                |dims, samples| match reading.layout(dims, size) {
                    Some(layout) => read(samples, layout).map_or_else(RunResult::Unusable, RunResult::Gave),
                    None => RunResult::Failed(format!(
                        "gave {dims:?} for an image of {width} × {height}: it does not keep the size of an image; where it takes multiples of some size alone, say it in MODEL.onnx.toml beside it: `multiple = 8`"
                    )),
                },
            );
            ran.unwrap_or_else(|e| {
                let words = said(&e);
                RunResult::Failed(format!(
                    "failed on an image of {width} × {height} ({words}); where it takes multiples of some size alone, say it in MODEL.onnx.toml beside it: `multiple = 8`"
                ))
            })
        })
    }
}
