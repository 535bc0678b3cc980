//! A graph loaded into ONNX Runtime, with the conversion of images to and from it: [`Graph`].

use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ort::session::Session;

use super::port::Port;
use super::session::{GraphSource, SessionOptions, Stopper, one_line, ports, remove_batch, run, session_builder};
use crate::conventions::Signature;
use crate::conventions::preset::Preset;
use crate::conventions::sidecar::{ADD, ModelSidecar};
use crate::failure::{RunFailure, describe_load_failure};
use crate::inputs::{DegradedImage, FedImage, InputEncoding, Tensor};
use crate::libraries::{JobEnd, JobLimits, Runtime};
use crate::limits::{ImageClock, MemoryLimit, TimeLimit};
use crate::outputs::{Composition, ImageTensor, InvalidValues};
use crate::planes::Planes;
use crate::probes::UnclampedImage;
use crate::sizing::TileWindow;
use darkqa_base::error::Result;
use darkqa_base::types::Rgb;

/// A loaded graph with its session.
pub(crate) struct Graph {
    pub(crate) signature: Arc<Signature>,
    pub(crate) encoding: InputEncoding,
    pub(crate) decoding: Arc<Composition>,
    /// Convention stated by sidecar and preset.
    pub(crate) convention: ModelSidecar,
    /// Message about differences between the graph and the model that the preset's authors published.
    pub(crate) preset_differences: Option<String>,
    runtime: Runtime,
    session: Arc<Mutex<Session>>,
    options: Arc<SessionOptions>,
    ports: Arc<Ports>,
    /// Options for runs after which ONNX Runtime releases its arena.
    releasing: Arc<SessionOptions>,
    clock: Mutex<ImageClock>,
    /// Limit of the process's memory during a run.
    memory: MemoryLimit,
}

/// Limits for loading a model, and then for each image. Loading can be slow because ONNX Runtime folds constants.
#[derive(Debug, Clone, Copy)]
pub struct LoadLimits {
    /// Limit of the time.
    pub time: TimeLimit,
    /// Limit of the process's memory.
    pub memory: MemoryLimit,
}

impl LoadLimits {
    /// No limits.
    pub const NONE: Self = Self { time: TimeLimit::NONE, memory: MemoryLimit::NONE };
}

/// All inputs and outputs of a graph. For a graph with a fixed batch size, their batch dimension is set to 1.
struct Ports {
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    /// The graph's fixed batch size, else 1.
    batch: usize,
}

/// Treatment of the arena, the memory that ONNX Runtime reserves for later runs, at the end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Arena {
    Kept,
    Released,
}

/// Result of a run of a model.
pub(crate) enum RunResult<T> {
    /// Decoded output.
    Output(T),
    /// The run failed, or its output is not an image of the input's size.
    Failed(RunFailure),
    /// The values of the input or output are invalid.
    Unusable(InvalidValues),
}

impl Graph {
    /// Loads a model with the convention of its sidecar and preset.
    ///
    /// # Errors
    /// The outer error is a failure of the runtime. The inner one is a message about the model, to follow the file's
    /// name.
    pub(crate) fn load(
        source: GraphSource,
        sidecar: &ModelSidecar,
        preset: Option<&Preset>,
        runtime: &Runtime,
        threads: Option<NonZeroUsize>,
        limits: LoadLimits,
    ) -> Result<std::result::Result<Self, String>> {
        let environment = runtime.environment().clone();
        let job_limits = JobLimits { time: limits.time.get(), memory: limits.memory };
        let end = runtime.thread().run_or_leave(job_limits, move || {
            session_builder(&environment, threads).and_then(|builder| source.commit(builder))
        })?;
        let session = match end {
            JobEnd::Finished(session) => session,
            JobEnd::TimedOut => {
                let problem = format!(
                    "takes longer than {} s to load; allow more with --llie-options timeout=SECONDS (0: no limit)",
                    limits.time
                );
                return Ok(Err(problem));
            }
            JobEnd::MemoryExceeded => {
                return Ok(Err(RunFailure::MemoryExceeded(limits.memory).message()));
            }
        };
        Ok(session
            .map_err(|e| describe_load_failure(&one_line(&e), runtime.version()))
            .and_then(|session| Self::new(session, sidecar, preset, runtime))
            .map(|mut graph| {
                graph.limit_time(limits.time);
                graph.limit_memory(limits.memory);
                graph
            }))
    }

    fn new(
        session: Session,
        sidecar: &ModelSidecar,
        preset: Option<&Preset>,
        runtime: &Runtime,
    ) -> std::result::Result<Self, String> {
        let (mut inputs, mut outputs) = (ports(session.inputs()), ports(session.outputs()));
        let batch = remove_batch(&mut inputs, &mut outputs);
        let convention = match preset {
            None => sidecar.clone(),
            Some(preset) => {
                let preset = preset.for_graph(sidecar, &inputs, &outputs)?;
                sidecar.clone().with_defaults(&preset)
            }
        };
        let preset_differences = preset.and_then(|preset| preset.differences(&inputs, &outputs));
        let ports = Ports { inputs, outputs, batch };
        let session = Arc::new(Mutex::new(session));
        let graph = Self::from_session(session, Arc::new(ports), convention, runtime)?;
        Ok(Self { preset_differences, ..graph })
    }

    fn from_session(
        session: Arc<Mutex<Session>>,
        ports: Arc<Ports>,
        convention: ModelSidecar,
        runtime: &Runtime,
    ) -> std::result::Result<Self, String> {
        let signature = Signature::infer(&ports.inputs, &ports.outputs, &convention)?;
        let options = SessionOptions::for_outputs(&signature.outputs).map_err(|e| one_line(&e))?;
        let releasing = SessionOptions::releasing_memory(&signature.outputs);
        let releasing = releasing.map_err(|e| one_line(&e))?;
        Ok(Self {
            encoding: InputEncoding::new(&signature, &convention),
            decoding: Arc::new(Composition::new(&signature, &convention)?),
            convention,
            preset_differences: None,
            signature: Arc::new(signature),
            runtime: runtime.clone(),
            session,
            options: Arc::new(options),
            releasing: Arc::new(releasing),
            ports,
            clock: Mutex::default(),
            memory: MemoryLimit::NONE,
        })
    }

    /// The same session with another convention of its inputs and outputs.
    ///
    /// # Errors
    /// If the graph contradicts the convention; the message follows the file's name.
    pub(crate) fn with_convention(&self, convention: ModelSidecar) -> std::result::Result<Self, String> {
        let (session, ports) = (Arc::clone(&self.session), Arc::clone(&self.ports));
        let mut graph = Self::from_session(session, ports, convention, &self.runtime)?;
        graph.clock = Mutex::new(*self.clock());
        graph.memory = self.memory;
        graph.preset_differences.clone_from(&self.preset_differences);
        Ok(graph)
    }

    /// Caveat about unused outputs of the image's size; `None` without such outputs, or if sidecar or preset state the
    /// image.
    pub(crate) fn unread_images(&self) -> Option<String> {
        let is_stated = self.convention.image.is_some() || self.convention.output.is_some();
        let unread: Vec<String> = self
            .signature
            .unread
            .iter()
            .filter(|port| self.signature.has_image_size(port))
            .map(|port| format!("{:?}", port.name))
            .collect();
        (!unread.is_empty() && !is_stated).then(|| {
            format!(
                "its output {:?} is read as the image, and {} of the same size {} not. If the image is made of several, {ADD}: `image = \"EXPRESSION\"`, else `output = {:?}`",
                self.signature.outputs[0].port.name,
                unread.join(", "),
                if unread.len() == 1 { "is" } else { "are" },
                self.signature.outputs[0].port.name
            )
        })
    }

    /// The ONNX Runtime that runs the graph.
    pub(crate) fn runtime(&self) -> &Runtime {
        &self.runtime
    }

    /// The graph's fixed batch size, else 1.
    pub(crate) fn batch(&self) -> usize {
        self.ports.batch
    }

    /// Sets the limit of the total time of one image's runs.
    pub(crate) fn limit_time(&mut self, limit: TimeLimit) {
        *self.clock() = ImageClock::new(limit);
    }

    /// Limit of the total time of one image's runs.
    pub(crate) fn time_limit(&self) -> TimeLimit {
        self.clock().time_limit()
    }

    /// Sets the limit of the process's memory while the model runs.
    pub(crate) fn limit_memory(&mut self, limit: MemoryLimit) {
        self.memory = limit;
    }

    /// Limit of the process's memory while the model runs.
    pub(crate) fn memory_limit(&self) -> MemoryLimit {
        self.memory
    }

    /// Restarts the clock for another image or a trial.
    pub(crate) fn restart_clock(&self) {
        self.set_used_time(Duration::ZERO);
    }

    /// Time that the current image has used so far.
    pub(crate) fn used_time(&self) -> Duration {
        self.clock().used()
    }

    /// Sets the time that the current image has used, after trials whose time does not count.
    pub(crate) fn set_used_time(&self, used: Duration) {
        self.clock().set_used(used);
    }

    fn clock(&self) -> MutexGuard<'_, ImageClock> {
        self.clock.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A handle that stops runs from another thread.
    pub(crate) fn stopper(&self) -> Stopper {
        Stopper(Arc::clone(&self.options))
    }

    /// Runs the model on a window of an image; returns the bytes of `part`, whose position is relative to the window.
    pub(crate) fn run_window(
        &self,
        dark: &DegradedImage<'_>,
        window: TileWindow,
        part: TileWindow,
    ) -> Result<RunResult<Vec<u8>>> {
        let fed = self.fed_window(dark, window);
        for input in &self.signature.extras {
            if let Err(problem) = input.check_tileable(&fed) {
                return Ok(RunResult::Failed(RunFailure::CannotTile(problem)));
            }
        }
        let part_in_image = TileWindow {
            left: window.left + part.left,
            top: window.top + part.top,
            right: window.left + part.right,
            bottom: window.top + part.bottom,
        };
        let dark = self.decoding.needs_dark().then(|| self.fed_window(dark, part_in_image).planes().into_owned());
        let (decoding, size) = (Arc::clone(&self.decoding), window.size());
        self.run(&self.options, &fed, move |outputs| decoding.bytes(outputs, size, part, dark.as_ref()))
    }

    /// Runs the model on a window of an image and ignores its output.
    pub(crate) fn probe(&self, image: &Rgb, window: TileWindow) -> Result<RunResult<()>> {
        self.probe_memory(image, window, Arena::Kept)
    }

    /// Runs the model like [`Self::probe`], and keeps or releases the arena afterwards, for measurements of memory.
    pub(crate) fn probe_memory(&self, image: &Rgb, window: TileWindow, arena: Arena) -> Result<RunResult<()>> {
        let options = match arena {
            Arena::Kept => &self.options,
            Arena::Released => &self.releasing,
        };
        let dark = DegradedImage::new(image);
        self.run(options, &self.fed_window(&dark, window), |_| Ok(()))
    }

    /// Runs the model on a whole image of floats, such as a resized one.
    pub(crate) fn run_planes(&self, planes: &Planes) -> Result<RunResult<Planes>> {
        let (decoding, size) = (Arc::clone(&self.decoding), planes.size());
        let dark = decoding.needs_dark().then(|| planes.clone());
        self.run(&self.options, &FedImage::Whole(planes), move |outputs| {
            decoding.planes(outputs, size, TileWindow::whole(size), dark.as_ref())
        })
    }

    /// Runs the model once on a whole image, and decodes its output by the conventions of several graphs, which share
    /// the input encoding.
    pub(crate) fn run_with_conventions(&self, image: &Rgb, graphs: &[Self]) -> Result<RunResult<Vec<UnclampedImage>>> {
        let decodings: Vec<Arc<Composition>> = graphs.iter().map(|graph| Arc::clone(&graph.decoding)).collect();
        let dark = Planes::from_rgb(image);
        let fed = dark.clone();
        self.run(&self.options, &FedImage::Whole(&fed), move |outputs| {
            let size = dark.size();
            Ok(decodings
                .iter()
                .map(|decoding| {
                    let dark = decoding.needs_dark().then_some(&dark);
                    match decoding.planes(outputs, size, TileWindow::whole(size), dark) {
                        Ok(planes) => UnclampedImage::from_planes(&planes),
                        // The plausibility rules then report the flaw.
                        Err(_) => UnclampedImage::not_a_number(size),
                    }
                })
                .collect())
        })
    }

    fn fed_window<'a>(&self, dark: &'a DegradedImage<'a>, window: TileWindow) -> FedImage<'a> {
        FedImage::Window { dark, window, pad: self.encoding.pad }
    }

    /// Tensors of all inputs, by name; `None` if expressions in the sidecar give values that are not finite.
    fn inputs(&self, fed: &FedImage<'_>) -> Option<Vec<(String, Tensor)>> {
        let image = self.encoding.tensor(fed)?;
        let mut inputs = vec![(self.signature.input.port.name.clone(), image)];
        for extra in &self.signature.extras {
            inputs.push((extra.port.name.clone(), extra.tensor(fed)?));
        }
        Some(inputs)
    }

    /// Runs the model, and decodes its outputs with `read` before another run overwrites them.
    fn run<T: Send + 'static>(
        &self,
        options: &Arc<SessionOptions>,
        fed: &FedImage<'_>,
        read: impl FnOnce(&[ImageTensor<'_>]) -> std::result::Result<T, InvalidValues> + Send + 'static,
    ) -> Result<RunResult<T>> {
        let Some(inputs) = self.inputs(fed) else {
            return Ok(RunResult::Unusable(InvalidValues::NonFiniteInput));
        };
        let size = fed.size();
        let (session, signature) = (Arc::clone(&self.session), Arc::clone(&self.signature));
        let (decoding, job_options) = (Arc::clone(&self.decoding), Arc::clone(options));
        let (clock, batch, start) = (*self.clock(), self.ports.batch, Instant::now());
        let limits = JobLimits { time: clock.remaining(), memory: self.memory };
        let job = move || {
            let mut session = session.lock().unwrap_or_else(PoisonError::into_inner);
            run(&mut session, &job_options, batch, inputs, &signature.outputs, |outputs| {
                match decoding.assign_layouts(outputs, size) {
                    Ok(images) => read(&images).map_or_else(RunResult::Unusable, RunResult::Output),
                    Err(wrong_size) => RunResult::Failed(wrong_size.failure(size)),
                }
            })
            .unwrap_or_else(|e| RunResult::Failed(RunFailure::from_message(size, one_line(&e))))
        };
        let end = self.runtime.thread().run_within(limits, || options.end_run(), job)?;
        self.clock().add(start.elapsed());
        Ok(match (end, clock.limit()) {
            (JobEnd::Finished(result), _) => result,
            (JobEnd::TimedOut, limit) => {
                options.allow_runs();
                RunResult::Failed(RunFailure::TimedOut(limit.unwrap_or_default()))
            }
            (JobEnd::MemoryExceeded, _) => {
                options.allow_runs();
                RunResult::Failed(RunFailure::MemoryExceeded(self.memory))
            }
        })
    }
}
