//! A user's ONNX model on ONNX Runtime's CPU provider: [`Enhancer`].
//!
//! Copies of an enhancer that run in parallel: [`Enhancer::twin`].

mod accessors;

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use super::conventions::Description;
use super::conventions::sidecar::{self, ADD};
use super::failure::{RunFailure, describe_invalid_values, format_size};
use super::files::{ModelFile, RandomOperators, computed_products, traced_sizes};
use super::graphs::{Graph, GraphSource, LoadLimits, RunResult, Stopper};
use super::inputs::DegradedImage;
use super::libraries::Runtime;
use super::limits::{self, MAX_CONSECUTIVE_OVERRUNS, MemoryCheck, MemoryLimit, TimeLimit, out_of_memory};
use super::outputs::InvalidValues;
use super::planes::Planes;
use super::probes::Usage;
use super::sizing::reach::{self, Context};
use super::sizing::{
    AcceptedSizes, MULTIPLES, PlanError, SeamRule, SizePlan, SizeRule, SizeSearch, TileWindow, TiledImage, Tiling,
    count_image, count_planned, not_local, seams_differ, sizes_not_found,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Digest, EnhancerName, Rgb, SizeLog};

/// Method to fit an image to a model that accepts a single size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fitting {
    /// Pad the image or cut it into tiles. Refused if a pixel of the output depends on distant pixels.
    #[default]
    Tiles,
    /// Resize the image to the fixed size, and the result back (`--llie-options resize`). The model sees a distorted
    /// image, and the result is blurred.
    Resize,
}

/// Warning about a graph that draws random numbers; `None` without random operators.
fn random_remark(random: &RandomOperators) -> Option<String> {
    let names: Vec<&str> = random.names.iter().map(String::as_str).collect();
    (!names.is_empty()).then(|| {
        format!(
            "its graph draws random numbers ({}), so its images depend on their order and are not reproducible; export it without them",
            names.join(", ")
        )
    })
}

/// Source of a model's graph, and the number of subnormal weights that were set to zero. Takes the bytes out of `file`.
fn graph_source(
    file: &mut ModelFile,
    random: &RandomOperators,
    has_wrong_shapes: bool,
) -> Result<(GraphSource, usize)> {
    if file.weights.external.is_empty() {
        let flushed = file.weights.flush_subnormals(&mut file.bytes);
        let bytes = random.with_seeds(std::mem::take(&mut file.bytes));
        return Ok((GraphSource::Memory(bytes), flushed));
    }
    // ONNX Runtime locates external data relative to the model's path, so such a model is loaded from its file, without
    // changes.
    if !has_wrong_shapes {
        return Ok((GraphSource::Path(file.path.clone()), 0));
    }
    let path = std::path::absolute(&file.path).map_err(|e| Error::file(&file.path, "locate", e))?;
    let source = GraphSource::MemoryBeside { bytes: std::mem::take(&mut file.bytes), folder: path.with_file_name("") };
    Ok((source, 0))
}

/// Side, in pixels, of a test image that should fit in memory with any model; chosen.
const SMALL_SIDE: usize = 64;

/// Result of one attempt to enhance an image: the enhanced image, or a failed run that may succeed at another input
/// size.
type Attempt = std::result::Result<Rgb, RunFailure>;

/// A loaded enhancement model.
pub struct Enhancer {
    /// The argument that names the model, as the user wrote it.
    argument: PathBuf,
    digest: Digest,
    path: PathBuf,
    name: EnhancerName,
    graph: Graph,
    tiling: Tiling,
    fitting: Fitting,
    max_side: Option<NonZeroUsize>,
    search: SizeSearch,
    /// Heights and widths of images on which the model failed without padding.
    refused: BTreeSet<[usize; 2]>,
    /// Reach of an output pixel into the input, and alignment of tiles; measured on first use.
    context: Context,
    memory: MemoryCheck,
    log: SizeLog,
    /// Number of consecutive images that exceeded the time or memory limit.
    consecutive_overruns: usize,
    description: Description,
    usage: Usage,
    /// Largest number of threads for an image.
    threads: usize,
    /// Index of this enhancer among the twins that share `usage`.
    twin: usize,
}

impl Enhancer {
    /// Loads a model from the bytes in `file`, which its digest identifies; a model with external data is read again
    /// from its path. `threads` is the number of threads for one image, by default the number of cores.
    ///
    /// # Errors
    /// If ONNX Runtime refuses the model, or if its image input or image output cannot be identified.
    pub fn open(file: ModelFile, runtime: &Runtime, threads: Option<NonZeroUsize>) -> Result<Self> {
        Self::open_within(file, runtime, threads, LoadLimits::NONE)
    }

    /// Loads a model like [`Self::open`], with limits of time and memory for loading and for each image.
    ///
    /// # Errors
    /// As [`Self::open`], or if loading exceeds the limits. ONNX Runtime is then unusable for the rest of the process.
    pub fn open_within(
        mut file: ModelFile,
        runtime: &Runtime,
        threads: Option<NonZeroUsize>,
        limits: LoadLimits,
    ) -> Result<Self> {
        let traced = traced_sizes(&file.bytes);
        let has_wrong_shapes = file.leave_out_wrong_shapes();
        let random = RandomOperators::find(&file.bytes).unwrap_or_default();
        let products = computed_products(&file.bytes);
        let threads = if products.is_empty() { threads } else { Some(NonZeroUsize::MIN) };
        let (source, flushed) = graph_source(&mut file, &random, has_wrong_shapes)?;
        let graph =
            Graph::load(source, &file.sidecar, file.preset.as_ref(), runtime, threads, limits)?.map_err(|problem| {
                let path = file.path.clone();
                let problem = sidecar::insert_sidecar_name(&problem, &path);
                Error::Enhancer { path, problem }
            })?;
        let remarks = graph
            .unread_images()
            .into_iter()
            .chain(random_remark(&random))
            .map(|remark| sidecar::insert_sidecar_name(&remark, &file.path))
            .collect();
        let enhancer = Self {
            argument: file.argument,
            digest: file.digest,
            path: file.path,
            name: file.name,
            graph,
            tiling: Tiling::Auto,
            fitting: Fitting::Tiles,
            max_side: None,
            search: SizeSearch::new(traced),
            refused: BTreeSet::new(),
            context: Context::default(),
            memory: MemoryCheck::new(),
            log: SizeLog::default(),
            consecutive_overruns: 0,
            description: Description {
                sidecar: file.sidecar,
                preset: file.preset,
                has_assumed_ranges: false,
                remarks,
                one_thread: products,
                has_wrong_shapes,
                flushed,
            },
            usage: Usage::default(),
            threads: threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get),
            twin: 0,
        };
        enhancer.note_convention();
        Ok(enhancer)
    }

    /// Sets how images are cut into tiles; the default is [`Tiling::Auto`].
    #[must_use]
    pub fn with_tiling(self, tiling: Tiling) -> Self {
        Self { tiling, ..self }
    }

    /// Sets how images of other sizes are fitted to a model with a fixed size; the default is [`Fitting::Tiles`].
    #[must_use]
    pub fn with_fitting(self, fitting: Fitting) -> Self {
        Self { fitting, ..self }
    }

    /// Sets the time limit for one image; the default is no limit, but 600 s in the command-line program.
    #[must_use]
    pub fn with_time_limit(mut self, limit: TimeLimit) -> Self {
        self.graph.limit_time(limit);
        self
    }

    /// Sets a limit on the memory of the whole process while the model runs; the default is no limit.
    #[must_use]
    pub fn with_memory_limit(mut self, limit: MemoryLimit) -> Self {
        self.graph.limit_memory(limit);
        self
    }

    /// Sets the maximum longer side, in pixels: larger images are reduced to it, enhanced and scaled back.
    #[must_use]
    pub fn with_max_side(self, max_side: Option<NonZeroUsize>) -> Self {
        Self { max_side, ..self }
    }

    /// Name in tables and records: the file's name without its extension.
    #[must_use]
    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// Counts of whole, padded, tiled and resized images so far.
    #[must_use]
    pub fn sizes(&self) -> &SizeLog {
        &self.log
    }

    /// Text table of the model's input and output conventions, with the source of each value.
    #[must_use]
    pub fn describe(&self) -> String {
        self.description.text(&self.path, &self.graph, &self.graph.convention)
    }

    /// A handle that stops the enhancer from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.graph.stopper()
    }

    /// Enhances an image; the result has the same size.
    ///
    /// For a model with a fixed size, the image is padded, tiled or resized, as chosen by [`Self::with_fitting`]. If
    /// the model fails at the image's size, the sizes that it accepts are searched by trial, once per model.
    ///
    /// # Errors
    /// If the model fails on this image, if its output has another size or values that are NaN or out of range, if
    /// tiles differ where they overlap, or if a memory or time limit is exceeded.
    pub fn enhance(&mut self, image: &Rgb) -> Result<Rgb> {
        if self.consecutive_overruns >= MAX_CONSECUTIVE_OVERRUNS {
            return Err(self.error(format!(
                "is no longer run, because {MAX_CONSECUTIVE_OVERRUNS} images in a row exceeded the limit of time or memory (--llie-options timeout, max-memory)"
            )));
        }
        self.graph.restart_clock();
        let size = [image.height(), image.width()];
        let attempt = match self.attempt(image, self.rule(size))? {
            Err(failure) if failure.may_depend_on_size() => self.attempt_at_found_size(image, failure)?,
            attempt => attempt,
        };
        match attempt {
            Err(RunFailure::TimedOut(_)) => {
                self.consecutive_overruns += 1;
                self.log.too_long += 1;
            }
            Err(RunFailure::MemoryExceeded(_)) => self.consecutive_overruns += 1,
            _ => self.consecutive_overruns = 0,
        }
        self.usage.set_sizes(self.twin, &self.log);
        attempt.map_err(|failure| self.run_error(&failure, size))
    }

    /// Enhances an image as [`Self::enhance`] does, without counting it: neither in the usage record, nor among the images
    /// in a row that exceeded a limit.
    ///
    /// # Errors
    /// As [`Self::enhance`].
    pub fn enhance_uncounted(&mut self, image: &Rgb) -> Result<Rgb> {
        let (log, overruns) = (self.log.clone(), self.consecutive_overruns);
        let enhanced = self.enhance(image);
        (self.log, self.consecutive_overruns) = (log, overruns);
        self.usage.set_sizes(self.twin, &self.log);
        enhanced
    }

    /// Size rule for an image of this height and width, from the graph, the convention and earlier trials.
    fn rule(&self, size: [usize; 2]) -> SizeRule {
        let signature = &self.graph.signature;
        let fixed = [signature.height, signature.width];
        let mut rule = SizeRule::new(fixed, &self.graph.convention, self.graph.encoding.pad);
        match self.search.found() {
            Some(AcceptedSizes::Multiple(multiple)) if self.refused.contains(&size) => {
                rule.multiple = multiple;
            }
            Some(AcceptedSizes::Traced(traced)) => rule.fixed = traced.map(Some),
            _ => {}
        }
        rule
    }

    /// Enhances an image at a size found by trial, after `failure` at the image's own size.
    fn attempt_at_found_size(&mut self, image: &Rgb, failure: RunFailure) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        let rule = self.rule(size);
        if !rule.takes_any_size() {
            return Ok(Err(failure));
        }
        let is_new = self.search.found().is_none();
        let used = self.graph.used_time();
        let found = self.search.run(&self.graph)?;
        self.graph.set_used_time(used);
        match (found, self.graph.convention.multiple) {
            (Some(found), Some(stated)) => Err(self.error(format!(
                "{}; `multiple = {stated}` in MODEL.onnx.toml or the preset does not fit: {}",
                failure.message(),
                found.message()
            ))),
            (None, Some(_)) => Ok(Err(failure)),
            (Some(found), None) => {
                self.refused.insert(size);
                if is_new {
                    let advice = sidecar::insert_sidecar_name(&found.message(), &self.path);
                    tracing::warn!("{}: {advice}", self.path.display());
                }
                self.attempt(image, self.rule(size))
            }
            (None, None) => self.attempt_padded(image, failure),
        }
    }

    /// Enhances an image padded to the first of [`MULTIPLES`] at which the model runs or exceeds a limit. Some models
    /// accept any size above a minimum, and fail on smaller images.
    fn attempt_padded(&mut self, image: &Rgb, failure: RunFailure) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        let mut tried = vec![size];
        for multiple in MULTIPLES {
            let rule = SizeRule { multiple, ..self.rule(size) };
            let whole = rule.run_size(size);
            if !tried.contains(&whole) {
                tried.push(whole);
                match self.attempt(image, rule)? {
                    Err(failure) if failure.may_depend_on_size() => {}
                    attempt => return Ok(attempt),
                }
            }
        }
        Ok(Err(failure))
    }

    /// Enhances an image at an input size that `rule` allows.
    fn attempt(&mut self, image: &Rgb, mut rule: SizeRule) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        if let Some(smaller) = rule.reduced_size(size, self.max_side) {
            let attempt = self.attempt_resized(image, rule, smaller)?;
            self.log.reduced += usize::from(attempt.is_ok());
            return Ok(attempt);
        }
        let needs_fitting = rule.needs_locality(size);
        if needs_fitting && self.fitting == Fitting::Resize {
            let attempt = self.attempt_resized(image, rule, rule.run_size(size))?;
            self.log.resized += usize::from(attempt.is_ok());
            return Ok(attempt);
        }
        let mut context = 0;
        if !rule.takes_any_size() {
            self.check_memory(rule, rule.run_size(size), size)?;
        }
        if needs_fitting {
            let found = self.context.measure(&self.graph, rule)?;
            self.log.reach = self.context.reach();
            context = found.map_err(|why| self.error(not_local(rule, size, &why)))?;
            let tile = rule.run_size([reach::FREE_SIDE; 2]);
            let alignment = self.alignment(rule, tile, context)?;
            if alignment > 1 && rule.tile.is_none() {
                // The reach was measured at one position within a block of `alignment` pixels; at others it may be
                // larger.
                context += alignment - 1;
            }
            rule.multiple = alignment;
        }
        let mut plan = SizePlan::new(size, rule, self.tiling, context).map_err(|e| self.plan_error(e))?;
        if rule.takes_any_size() && plan.seams == SeamRule::MustHold && plan.tiles.count() > 1 {
            rule.multiple = self.alignment(rule, plan.run_size(), plan.geometry.context)?;
            plan = SizePlan::new(size, rule, self.tiling, context).map_err(|e| self.plan_error(e))?;
        }
        if rule.takes_any_size() {
            self.check_memory(rule, plan.run_size(), size)?;
        }
        self.attempt_planned(image, rule, &plan)
    }

    /// Number of pixels at whose multiples tiles must start: from `rule` if it is above 1, otherwise measured by trial.
    fn alignment(&mut self, rule: SizeRule, tile: [usize; 2], context: usize) -> Result<usize> {
        if rule.multiple > 1 {
            return Ok(rule.multiple);
        }
        let is_new = self.context.lacks_alignment();
        let found = self.context.measure_alignment(&self.graph, tile, context)?;
        if is_new && found > 1 {
            let advice = format!(
                "its tiles must start at multiples of {found} pixels (found by trial); to confirm, {ADD}: `multiple = {found}`"
            );
            let advice = sidecar::insert_sidecar_name(&advice, &self.path);
            tracing::warn!("{}: {advice}", self.path.display());
        }
        Ok(found)
    }

    /// Fails if a large run needs more memory than is available. The input has height and width `input`, the image
    /// `size`.
    fn check_memory(&mut self, rule: SizeRule, input: [usize; 2], size: [usize; 2]) -> Result<()> {
        let used = self.graph.used_time();
        let checked = self.memory.run(&self.graph, rule, input, size)?;
        self.graph.set_used_time(used);
        checked.map_err(|problem| self.error(problem))
    }

    /// Enhances an image tile by tile, as planned.
    fn attempt_planned(&mut self, image: &Rgb, rule: SizeRule, plan: &SizePlan) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        let mut canvas = TiledImage::new(plan.geometry.area);
        let dark = DegradedImage::new(image);
        for (row, column) in plan.tiles.tiles() {
            let input = TileWindow::for_input(row, column);
            let output = TileWindow::for_output(row, column);
            match self.graph.run_window(&dark, input, output)? {
                RunResult::Output(bytes) => canvas.add(row, column, &bytes),
                RunResult::Failed(failure) => return Ok(Err(failure)),
                RunResult::Unusable(values) => return Err(self.invalid_values_error(values, image)),
            }
        }
        let (enhanced, seam) = canvas.finish(size);
        if plan.seams == SeamRule::MustHold && !seam.agrees() {
            return Err(self.error(seams_differ(rule, size, plan, seam)));
        }
        count_planned(&mut self.log, size, rule, plan, seam);
        Ok(Ok(enhanced))
    }

    /// Resizes an image to height and width `input`, enhances it, and resizes the result back.
    fn attempt_resized(&mut self, image: &Rgb, rule: SizeRule, input: [usize; 2]) -> Result<Attempt> {
        self.check_memory(rule, input, [image.height(), image.width()])?;
        let planes = Planes::from_rgb(image).resized(input[0], input[1]).map_err(|e| self.error(e))?;
        let enhanced = match self.graph.run_planes(&planes)? {
            RunResult::Output(planes) => planes,
            RunResult::Failed(failure) => return Ok(Err(failure)),
            RunResult::Unusable(values) => return Err(self.invalid_values_error(values, image)),
        };
        let enhanced = enhanced
            .resized(image.height(), image.width())
            .map_err(|e| self.error(e))?
            .to_rgb(self.graph.decoding.rounding)
            .ok_or_else(|| self.error("gave no pixels"))?;
        count_image(&mut self.log, rule);
        Ok(Ok(enhanced))
    }

    fn plan_error(&self, problem: PlanError) -> Error {
        match problem {
            PlanError::Other(problem) => self.error(problem),
            PlanError::TileFlag(side) => Error::usage(
                "--llie-options tile",
                format_args!(
                    "{side} is not possible: {} needs the whole image (tile = \"none\" in its .onnx.toml file or preset)",
                    self.name
                ),
            ),
        }
    }

    /// Error for a failed run on an image of height and width `size`.
    fn run_error(&self, failure: &RunFailure, size: [usize; 2]) -> Error {
        let rule = self.rule(size);
        self.error(match failure {
            RunFailure::NoMemory { fed, requested } if self.fails_when_small(rule, *fed, *requested) => format!(
                "{} and on one of {}: its graph needs that memory at any size; export it again, or use a smaller model",
                failure.message(),
                format_size(rule.run_size([SMALL_SIDE; 2]))
            ),
            RunFailure::NoMemory { .. } => out_of_memory(failure, rule, size),
            RunFailure::TimedOut(_) | RunFailure::MemoryExceeded(_) => failure.message(),
            _ if !rule.takes_any_size() => format!(
                "{}; its graph or MODEL.onnx.toml fixes the size {}",
                failure.message(),
                format_size(rule.run_size(size))
            ),
            _ => sizes_not_found(failure, &self.search),
        })
    }

    /// True if a run on a small image of another size than `fed` fails to allocate the same number of bytes.
    fn fails_when_small(&self, rule: SizeRule, fed: [usize; 2], bytes: Option<u64>) -> bool {
        let size = rule.run_size([SMALL_SIDE; 2]);
        if size == fed {
            return false;
        }
        self.graph.restart_clock();
        let image = Rgb::black(size[0], size[1]);
        match self.graph.probe(&image, TileWindow::whole(size)) {
            Ok(RunResult::Failed(RunFailure::NoMemory { requested, .. })) => requested.is_some() && requested == bytes,
            _ => false,
        }
    }

    /// Error about this model; the message is the file's name followed by `problem`.
    pub(super) fn error(&self, problem: impl AsRef<str>) -> Error {
        Error::Enhancer { path: self.path.clone(), problem: sidecar::insert_sidecar_name(problem.as_ref(), &self.path) }
    }

    fn invalid_values_error(&self, values: InvalidValues, image: &Rgb) -> Error {
        let size = [image.height(), image.width()];
        self.error(describe_invalid_values(values, self.graph.decoding.range(), size))
    }
}

impl Enhancer {
    /// A copy of this enhancer with its own session and thread. It starts with the sizes, context and memory cost
    /// measured so far, and shares the usage record, in which `number` identifies the twin.
    ///
    /// # Errors
    /// If the model's file has changed, or its session cannot be opened.
    pub fn twin(&self, number: usize, threads: NonZeroUsize) -> Result<Self> {
        let file = ModelFile::read(&self.argument)?;
        if file.digest() != self.digest {
            return Err(Error::Enhancer {
                path: self.path.clone(),
                problem: "was changed during the run; restore it, or start a new run".to_owned(),
            });
        }
        let runtime = self.graph.runtime().with_new_thread()?;
        let limits = LoadLimits { time: self.graph.time_limit(), memory: self.graph.memory_limit() };
        let mut twin = Self::open_within(file, &runtime, Some(threads), limits)?;
        twin.graph = twin.graph.with_convention(self.convention().clone()).map_err(|problem| self.error(problem))?;
        Ok(Self {
            tiling: self.tiling,
            fitting: self.fitting,
            max_side: self.max_side,
            search: self.search.clone(),
            refused: self.refused.clone(),
            context: self.context.clone(),
            memory: self.memory.clone(),
            log: SizeLog::default(),
            usage: self.usage.clone(),
            twin: number,
            ..twin
        })
    }
}

/// Number of sets of enhancers that can run in parallel: at most `cores`, and as many as fit into the free memory. The
/// memory of one set is estimated as the resident memory of the process, to be measured after the first image of each
/// enhancer.
pub fn sets_in_memory(cores: usize) -> usize {
    match (limits::resident(), limits::available()) {
        (Some(resident), Some(available)) => {
            let more = available / resident.max(1);
            cores.min(1 + usize::try_from(more).unwrap_or(cores))
        }
        // Without figures about memory, only one set is known to fit.
        _ => 1,
    }
}
