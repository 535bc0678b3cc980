//! A user's ONNX model on ONNX Runtime's CPU provider: [`Enhancer`].

mod known;
pub(super) mod twin;

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::{Digest, EnhancerName, Rgb, SizeLog};

use super::conventions::Description;
use super::conventions::sidecar::{self, ADD};
use super::failure::{RunFailure, by, unusable};
use super::files::{ModelFile, RandomOperators, traced_sizes};
use super::graphs::{Graph, GraphSource, LoadLimits, RunResult, Stopper};
use super::inputs::DarkImage;
use super::libraries::Runtime;
use super::limits::{MOST_ENDED, MemoryCheck, MemoryLimit, TimeLimit, no_memory};
use super::outputs::OutOfRange;
use super::planes::Planes;
use super::probes::Usage;
use super::sizing::reach::{self, Context};
use super::sizing::{
    MULTIPLES, NoPlan, SeamRule, SizePlan, SizeRule, SizeSearch, TakenSizes, TileWindow,
    TiledImage, Tiling, count_image, count_planned, global, not_found, seams_differ,
};

/// How an image of another size reaches a model of a fixed size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fitting {
    /// It is filled or cut into tiles, if the model is local; otherwise it is refused.
    #[default]
    Tiles,
    /// It is resized to the fixed size, and the result back (`--llie-options resize`): its shape is not kept, and it is blurred.
    Resize,
}

/// The remark on a graph with random operators.
fn random_words(random: &RandomOperators) -> Option<String> {
    let names: Vec<&str> = random.names.iter().map(String::as_str).collect();
    (!names.is_empty()).then(|| {
        format!(
            "its graph draws random numbers ({}), so its images depend on their order and are not reproducible; export it without them",
            names.join(", ")
        )
    })
}

/// Side, in pixels, of an image for which any model should get its memory; chosen.
const SMALL: usize = 64;

/// Result of one attempt at an image: the enhanced image, or what another size may change.
type Attempt = std::result::Result<Rgb, RunFailure>;

/// A loaded enhancement model.
pub struct Enhancer {
    /// The words that name it, as the user gave them.
    named: PathBuf,
    digest: Digest,
    path: PathBuf,
    name: EnhancerName,
    graph: Graph,
    tiling: Tiling,
    fitting: Fitting,
    max_side: Option<NonZeroUsize>,
    search: SizeSearch,
    /// Heights and widths of images at which the model failed as they are.
    refused: BTreeSet<[usize; 2]>,
    context: Context,
    memory: MemoryCheck,
    log: SizeLog,
    /// Images in a row that took too much time or memory.
    ended: usize,
    description: Description,
    usage: Usage,
    /// Number of this enhancer among those that share the usage.
    twin: usize,
}

impl Enhancer {
    /// Loads a model from the bytes that [`ModelFile::read`] read, so that the digest is that of the model that runs.
    /// `threads` is the number of threads for one image, by default the number of cores.
    ///
    /// # Errors
    /// If the file is not an ONNX model, ONNX Runtime refuses it, or its inputs and outputs are not one RGB image each.
    pub fn open(file: ModelFile, runtime: &Runtime, threads: Option<NonZeroUsize>) -> Result<Self> {
        Self::open_within(file, runtime, threads, LoadLimits::NONE)
    }

    /// Loads a model as [`Self::open`] does, within limits that hold for each image, too.
    ///
    /// # Errors
    /// As [`Self::open`], or if loading takes more than the limits. ONNX Runtime cannot be used any more then.
    pub fn open_within(
        mut file: ModelFile,
        runtime: &Runtime,
        threads: Option<NonZeroUsize>,
        limits: LoadLimits,
    ) -> Result<Self> {
        let flushed = file.weights.flush_subnormals(&mut file.bytes);
        let traced = traced_sizes(&file.bytes);
        let random = RandomOperators::find(&file.bytes).unwrap_or_default();
        // ONNX Runtime finds external data only from the model's path.
        let source = if file.weights.external.is_empty() {
            GraphSource::Memory(random.seeded(file.bytes))
        } else {
            GraphSource::Path(file.path.clone())
        };
        let graph = Graph::load(
            source,
            &file.sidecar,
            file.preset.as_ref(),
            runtime,
            threads,
            limits,
        )?
        .map_err(|problem| {
            let path = file.path.clone();
            let problem = sidecar::named(&problem, &path);
            Error::Enhancer { path, problem }
        })?;
        let remarks = graph
            .unread_images()
            .into_iter()
            .chain(random_words(&random))
            .map(|words| sidecar::named(&words, &file.path))
            .collect();
        let enhancer = Self {
            named: file.named,
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
            ended: 0,
            description: Description {
                sidecar: file.sidecar,
                preset: file.preset,
                assumed: false,
                remarks,
                flushed,
            },
            usage: Usage::default(),
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

    /// Sets how images reach a model of a fixed size; the default is [`Fitting::Tiles`].
    #[must_use]
    pub fn with_fitting(self, fitting: Fitting) -> Self {
        Self { fitting, ..self }
    }

    /// Sets the longest time that one image may take; the default of this call is none, that of the program 600 s.
    #[must_use]
    pub fn with_time_limit(mut self, limit: TimeLimit) -> Self {
        self.graph.limit_time(limit);
        self
    }

    /// Sets the memory that the process may take while the model runs; the default of this call is any.
    #[must_use]
    pub fn with_memory_limit(mut self, limit: MemoryLimit) -> Self {
        self.graph.limit_memory(limit);
        self
    }

    /// Sets the largest longer side, in pixels: larger images are reduced to it, enhanced and scaled back.
    #[must_use]
    pub fn with_max_side(self, max_side: Option<NonZeroUsize>) -> Self {
        Self { max_side, ..self }
    }

    /// Name in tables and records: the file's name without its extension.
    #[must_use]
    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// In which sizes the images were enhanced so far.
    #[must_use]
    pub fn sizes(&self) -> &SizeLog {
        &self.log
    }

    /// A table, as text, of how the model is fed and read, with the source of each value.
    #[must_use]
    pub fn describe(&self) -> String {
        self.description
            .text(&self.path, &self.graph, &self.graph.convention)
    }

    /// A handle that ends a run from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.graph.stopper()
    }

    /// Enhances an image; the result has the same size.
    ///
    /// If the model has a fixed size, the image is filled or cut into tiles of that size, if the model is local. If it fails at
    /// the image's size, the sizes that it takes are searched by trial, once.
    ///
    /// # Errors
    /// If the model fails on this image, gives another size than it was given, or values that are not numbers or not in the
    /// expected range; if tiles differ where they overlap; if memory or time do not suffice.
    pub fn enhance(&mut self, image: &Rgb) -> Result<Rgb> {
        if self.ended >= MOST_ENDED {
            return Err(self.fault(format!(
                "is no longer run, because {MOST_ENDED} images in a row exceeded the limit of time or memory (--llie-options timeout, max-memory)"
            )));
        }
        self.graph.restart_clock();
        let size = [image.height(), image.width()];
        let attempt = match self.attempt(image, self.rule(size))? {
            Err(failure) if failure.is_of_size() => self.in_another_size(image, failure)?,
            attempt => attempt,
        };
        match attempt {
            Err(RunFailure::TooLong(_)) => {
                self.ended += 1;
                self.log.too_long += 1;
            }
            Err(RunFailure::TooLarge(_)) => self.ended += 1,
            _ => self.ended = 0,
        }
        self.usage.set_sizes(self.twin, &self.log);
        attempt.map_err(|failure| self.failed(&failure, size))
    }

    /// Sizes that the model takes, for an image of this size, as far as they are known by now.
    fn rule(&self, size: [usize; 2]) -> SizeRule {
        let signature = &self.graph.signature;
        let fixed = [signature.height, signature.width];
        let mut rule = SizeRule::new(fixed, &self.graph.convention, self.graph.feeding.pad);
        match self.search.found() {
            Some(TakenSizes::Multiple(multiple)) if self.refused.contains(&size) => {
                rule.multiple = multiple;
            }
            Some(TakenSizes::Traced(traced)) => rule.fixed = traced.map(Some),
            _ => {}
        }
        rule
    }

    /// Enhances an image at whose own size the model failed: in sizes that are found by trial.
    fn in_another_size(&mut self, image: &Rgb, failure: RunFailure) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        let rule = self.rule(size);
        if !rule.takes_any_size() {
            return Ok(Err(failure));
        }
        let is_new = self.search.found().is_none();
        let found = self.search.run(&self.graph)?;
        self.graph.restart_clock();
        match (found, self.graph.convention.multiple) {
            (Some(found), Some(stated)) => Err(self.fault(format!(
                "{}; `multiple = {stated}` in MODEL.onnx.toml or the preset does not fit: {}",
                failure.words(),
                found.words()
            ))),
            (None, Some(_)) => Ok(Err(failure)),
            (Some(found), None) => {
                self.refused.insert(size);
                if is_new {
                    let words = sidecar::named(&found.words(), &self.path);
                    tracing::warn!("{}: {words}", self.path.display());
                }
                self.attempt(image, self.rule(size))
            }
            (None, None) => self.filled_by_trial(image, failure),
        }
    }

    /// Enhances an image filled to the first multiple at which the model runs, though it needs none in general: it may be too
    /// small for it.
    fn filled_by_trial(&mut self, image: &Rgb, failure: RunFailure) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        let mut tried = vec![size];
        for multiple in MULTIPLES {
            let rule = SizeRule {
                multiple,
                ..self.rule(size)
            };
            let whole = rule.whole(size);
            if !tried.contains(&whole) {
                tried.push(whole);
                if let Ok(enhanced) = self.attempt(image, rule)? {
                    return Ok(Ok(enhanced));
                }
            }
        }
        Ok(Err(failure))
    }

    /// Enhances an image by a rule of sizes.
    fn attempt(&mut self, image: &Rgb, mut rule: SizeRule) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        if let Some(smaller) = rule.reduced(size, self.max_side) {
            let attempt = self.resized(image, rule, smaller)?;
            self.log.reduced += usize::from(attempt.is_ok());
            return Ok(attempt);
        }
        let must_fit = rule.needs_locality(size);
        if must_fit && self.fitting == Fitting::Resize {
            let attempt = self.resized(image, rule, rule.whole(size))?;
            self.log.resized += usize::from(attempt.is_ok());
            return Ok(attempt);
        }
        let mut context = 0;
        if !rule.takes_any_size() {
            self.check_memory(rule, rule.whole(size), size)?;
        }
        if must_fit {
            let found = self.context.measure(&self.graph, rule)?;
            self.log.reach = self.context.reach();
            context = found.map_err(|why| self.fault(global(rule, size, &why)))?;
            let tile = rule.whole([reach::FREE_SIDE; 2]);
            let alignment = self.alignment(rule, tile, context)?;
            if alignment > 1 && rule.tile.is_none() {
                // A pixel at another place of its block may see farther.
                context += alignment - 1;
            }
            rule.multiple = alignment;
        }
        let mut plan =
            SizePlan::new(size, rule, self.tiling, context).map_err(|e| self.no_plan(e))?;
        if rule.takes_any_size() && plan.seams == SeamRule::MustHold && plan.tiles.count() > 1 {
            rule.multiple = self.alignment(rule, plan.fed(), plan.cut.context)?;
            plan = SizePlan::new(size, rule, self.tiling, context).map_err(|e| self.no_plan(e))?;
        }
        if rule.takes_any_size() {
            self.check_memory(rule, plan.fed(), size)?;
        }
        self.planned(image, rule, &plan)
    }

    /// The multiple at which tiles start: the stated one, or that which is found by trial.
    fn alignment(&mut self, rule: SizeRule, tile: [usize; 2], context: usize) -> Result<usize> {
        if rule.multiple > 1 {
            return Ok(rule.multiple);
        }
        let is_new = self.context.is_unaligned();
        let found = self.context.alignment(&self.graph, tile, context)?;
        if is_new && found > 1 {
            let words = format!(
                "its tiles must start at multiples of {found} pixels (found by trial); to confirm, {ADD}: `multiple = {found}`"
            );
            let words = sidecar::named(&words, &self.path);
            tracing::warn!("{}: {words}", self.path.display());
        }
        Ok(found)
    }

    /// Refuses a large run that would need more memory than is available.
    fn check_memory(&mut self, rule: SizeRule, fed: [usize; 2], size: [usize; 2]) -> Result<()> {
        let checked = self.memory.run(&self.graph, rule, fed, size)?;
        self.graph.restart_clock();
        checked.map_err(|problem| self.fault(problem))
    }

    /// Enhances an image by its plan.
    fn planned(&mut self, image: &Rgb, rule: SizeRule, plan: &SizePlan) -> Result<Attempt> {
        let size = [image.height(), image.width()];
        let mut canvas = TiledImage::new(plan.cut.area);
        let dark = DarkImage::new(image);
        for (row, column) in plan.tiles.tiles() {
            let (input, output) = (
                TileWindow::input_of(row, column),
                TileWindow::output_of(row, column),
            );
            match self.graph.window(&dark, input, output)? {
                RunResult::Output(bytes) => canvas.add(row, column, &bytes),
                RunResult::Failed(failure) => return Ok(Err(failure)),
                RunResult::Unusable(values) => return Err(self.unusable(values, image)),
            }
        }
        let (enhanced, seam) = canvas.finish(size);
        if plan.seams == SeamRule::MustHold && !seam.holds() {
            return Err(self.fault(seams_differ(rule, size, plan, seam)));
        }
        count_planned(&mut self.log, size, rule, plan, seam);
        Ok(Ok(enhanced))
    }

    /// Enhances an image that is resized to `fed`, and resizes the result back.
    fn resized(&mut self, image: &Rgb, rule: SizeRule, fed: [usize; 2]) -> Result<Attempt> {
        self.check_memory(rule, fed, [image.height(), image.width()])?;
        let planes = Planes::from_rgb(image).resized(fed[0], fed[1]);
        let planes = planes.map_err(|e| self.fault(e))?;
        let enhanced = match self.graph.planes(&planes)? {
            RunResult::Output(planes) => planes,
            RunResult::Failed(failure) => return Ok(Err(failure)),
            RunResult::Unusable(values) => return Err(self.unusable(values, image)),
        };
        let enhanced = enhanced.resized(image.height(), image.width());
        let enhanced = enhanced.map_err(|e| self.fault(e))?;
        let enhanced = enhanced
            .to_rgb(self.graph.reading.rounding)
            .ok_or_else(|| self.fault("gave no pixels"))?;
        count_image(&mut self.log, rule);
        Ok(Ok(enhanced))
    }

    fn no_plan(&self, problem: NoPlan) -> Error {
        match problem {
            NoPlan::Other(problem) => self.fault(problem),
            NoPlan::TileFlag(side) => Error::usage(
                "--llie-options tile",
                format_args!(
                    "{side} is not possible: {} needs the whole image (tile = \"none\" in its .onnx.toml file or preset)",
                    self.name
                ),
            ),
        }
    }

    /// The error for an image of this size on which the model failed in every size that was tried.
    fn failed(&self, failure: &RunFailure, size: [usize; 2]) -> Error {
        let rule = self.rule(size);
        self.fault(match failure {
            RunFailure::NoMemory { requested, .. } if self.fails_when_small(rule, *requested) => format!(
                "{} and on one of {}: its graph needs that memory at any size; export it again, or use a smaller model",
                failure.words(),
                by(rule.whole([SMALL; 2]))
            ),
            RunFailure::NoMemory { .. } => no_memory(failure, rule, size),
            RunFailure::TooLong(_) | RunFailure::TooLarge(_) => failure.words(),
            _ if !rule.takes_any_size() => format!(
                "{}; its graph or MODEL.onnx.toml fixes the size {}",
                failure.words(),
                by(rule.whole(size))
            ),
            _ => not_found(failure, &self.search),
        })
    }

    /// Whether it needs as many bytes at once for a small image, and does not get them.
    fn fails_when_small(&self, rule: SizeRule, bytes: Option<u64>) -> bool {
        let size = rule.whole([SMALL; 2]);
        self.graph.restart_clock();
        let image = Rgb::black(size[0], size[1]);
        let ran = self.graph.probe(&image, TileWindow::whole(size));
        match ran {
            Ok(RunResult::Failed(RunFailure::NoMemory { requested, .. })) => {
                requested.is_some() && requested == bytes
            }
            _ => false,
        }
    }

    pub(super) fn fault(&self, problem: impl AsRef<str>) -> Error {
        Error::Enhancer {
            path: self.path.clone(),
            problem: sidecar::named(problem.as_ref(), &self.path),
        }
    }

    fn unusable(&self, values: OutOfRange, image: &Rgb) -> Error {
        let size = [image.height(), image.width()];
        self.fault(unusable(values, self.graph.reading.range(), size))
    }
}
