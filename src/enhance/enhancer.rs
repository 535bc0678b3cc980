//! A user's ONNX model on ONNX Runtime's CPU provider: [`Enhancer`].

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::types::enhancer_note::{ProbeNote, ProbeOutcome};
use crate::types::{EnhancerName, Rgb};

use super::convention::{ElementType, Padding, Tile, ValueRange};
use super::describe::Description;
use super::file::ModelFile;
use super::graph::{Graph, RunResult};
use super::memory::{self, MemoryCost, PROBES};
use super::planes::Planes;
use super::probe::RangePair;
use super::probe_run::of_type;
use super::reading::OutOfRange;
use super::runtime::Runtime;
use super::session::{GraphSource, Stopper};
use super::sidecar::ModelSidecar;
use super::tiles::{Cutting, MULTIPLES, TilePlan, TileWindow, TiledImage, Tiling};
use super::usage::Usage;

/// Side of a tile with `--tile auto`, in pixels: measured to be as fast as the whole image, with a twelfth of its memory.
const TILE: usize = 256;
/// Largest image, in pixels, that `--tile auto` does not cut and whose memory is not checked; chosen.
const MAX_WHOLE: usize = 1280 * 720;
/// Context of tiles, in pixels, if `--tile N` is set and no sidecar or preset states the exact context; chosen.
const CONTEXT: usize = 32;

/// Memory that a model needs, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
enum MemoryEstimate {
    /// It has not been measured yet.
    Unknown,
    /// It cannot be measured.
    Unmeasurable,
    /// It was measured, per pixel.
    Known(MemoryCost),
}

/// A loaded enhancement model.
pub struct Enhancer {
    path: PathBuf,
    name: EnhancerName,
    graph: Graph,
    convention: ModelSidecar,
    tiling: Tiling,
    max_side: Option<NonZeroUsize>,
    cost: MemoryEstimate,
    description: Description,
    usage: Usage,
}

impl Enhancer {
    /// Loads a model from the bytes that [`ModelFile::read`] read, so that the digest is that of the model that runs.
    /// `threads` is the number of threads for one image, by default the number of cores.
    ///
    /// # Errors
    /// If the file is not an ONNX model, ONNX Runtime refuses it, or its inputs and outputs are not one RGB image each.
    pub fn open(
        mut file: ModelFile,
        runtime: &Runtime,
        threads: Option<NonZeroUsize>,
    ) -> Result<Self> {
        let empty = ModelSidecar::default();
        let preset = file.preset.as_ref();
        let convention = file
            .sidecar
            .clone()
            .with_defaults(preset.map_or(&empty, |preset| &preset.convention));
        let flushed = file.weights.flush_subnormals(&mut file.bytes);
        // ONNX Runtime finds external data only from the model's path.
        let source = if file.weights.external.is_empty() {
            GraphSource::Memory(file.bytes)
        } else {
            GraphSource::Path(file.path.clone())
        };
        let graph = Graph::load(source, &convention, runtime, threads)?.map_err(|problem| {
            let path = file.path.clone();
            Error::Enhancer { path, problem }
        })?;
        let enhancer = Self {
            path: file.path,
            name: file.name,
            graph,
            convention,
            tiling: Tiling::Auto,
            max_side: None,
            cost: MemoryEstimate::Unknown,
            description: Description {
                sidecar: file.sidecar,
                preset: file.preset,
                probed: false,
                flushed,
            },
            usage: Usage::default(),
        };
        enhancer.note_convention();
        Ok(enhancer)
    }

    /// Notes how the model is fed and read, with the source of each value.
    fn note_convention(&self) {
        let lines = self.description.lines(&self.graph, &self.convention);
        self.usage.update(|note| note.convention = lines);
    }

    /// A handle to what it did so far.
    #[must_use]
    pub(crate) fn usage(&self) -> Usage {
        self.usage.clone()
    }

    /// Path of the model's file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn graph(&self) -> &Graph {
        &self.graph
    }

    /// What sidecar and preset state.
    pub(super) fn convention(&self) -> &ModelSidecar {
        &self.convention
    }

    /// The ranges in which it is fed and read now.
    pub(super) fn ranges(&self) -> RangePair {
        RangePair {
            input: self.graph.feeding.range,
            output: self.graph.reading.range,
        }
    }

    /// The ranges of input and output that the sidecar, a preset or the element types state. A preset that states none stands for
    /// 0..1, which all authors of presets use.
    pub(super) fn stated_ranges(&self) -> [Option<ValueRange>; 2] {
        let signature = &self.graph.signature;
        let of = |stated: Option<ValueRange>, element: &ElementType| {
            let preset = self.description.preset.as_ref().map(|_| ValueRange::Unit);
            stated.or(of_type(element)).or(preset)
        };
        let Self { convention, .. } = self;
        [
            of(convention.range_in, &signature.input.port.element),
            of(convention.range_out, &signature.output.port.element),
        ]
    }

    /// Height and width of a frame of the probe: the given ones, in the model's multiples, or those that it fixes.
    pub(super) fn probe_size(&self, [height, width]: [usize; 2]) -> [usize; 2] {
        let multiple = self.convention.multiple.map_or(1, NonZeroUsize::get);
        let signature = &self.graph.signature;
        let side = |fixed: Option<usize>, wanted: usize| {
            fixed.unwrap_or_else(|| wanted.next_multiple_of(multiple))
        };
        [side(signature.height, height), side(signature.width, width)]
    }

    /// Notes what the probe found. Ranges that were open are known now.
    pub(super) fn set_probed(&mut self, probe: ProbeNote) {
        self.description.probed = probe.outcome == ProbeOutcome::Plausible;
        self.usage.update(|note| note.probe = Some(probe));
        self.note_convention();
    }

    /// Sets how images are cut into tiles; the default is [`Tiling::Auto`].
    #[must_use]
    pub fn with_tiling(self, tiling: Tiling) -> Self {
        Self { tiling, ..self }
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

    /// A table, as text, of how the model is fed and read, with the source of each value.
    #[must_use]
    pub fn describe(&self) -> String {
        self.description
            .text(&self.path, &self.graph, &self.convention)
    }

    /// A handle that ends a run from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.graph.stopper()
    }

    /// Enhances an image; the result has the same size.
    ///
    /// If the model has a fixed size, the image is cut into tiles of that size, if they are exact. Otherwise it is resized to
    /// that size and the result is resized back, with a bilinear filter.
    ///
    /// # Errors
    /// If the model fails on this image, gives another size than it was given, or values that are not numbers or not in the
    /// expected range; if tiles differ where they overlap.
    pub fn enhance(&mut self, image: &Rgb) -> Result<Rgb> {
        let size = [image.height(), image.width()];
        if let Some(smaller) = self.reduced_size(size) {
            return self.enhance_resized(image, smaller);
        }
        let fixed = [
            self.graph.signature.height.unwrap_or(size[0]),
            self.graph.signature.width.unwrap_or(size[1]),
        ];
        let cut_exactly = matches!(self.convention.tile, Some(Tile::Exact(_)))
            && fixed.iter().zip(size).all(|(fixed, size)| *fixed <= size);
        if fixed != size && !cut_exactly {
            return self.enhance_resized(image, fixed);
        }
        let multiples: &[usize] = match self.convention.multiple {
            Some(multiple) => &[multiple.get()],
            None if fixed == size && self.graph.signature.takes_any_size() => &MULTIPLES,
            None => &[1],
        };
        self.check_memory(image, fixed)?;
        let mut first_problem = None;
        for multiple in multiples {
            match self.enhance_padded(image, fixed, *multiple)? {
                Ok(enhanced) => return Ok(enhanced),
                Err(problem) => drop(first_problem.get_or_insert(problem)),
            }
        }
        Err(self.fault(first_problem.unwrap_or_default()))
    }

    /// Refuses a large image that would need more memory than is available.
    fn check_memory(&mut self, image: &Rgb, fixed: [usize; 2]) -> Result<()> {
        let size = [image.height(), image.width()];
        let pixels = size[0] * size[1];
        let multiple = self.convention.multiple.map_or(1, NonZeroUsize::get);
        let cut = self.cutting(size, fixed, multiple)?;
        let can_probe =
            size.iter().all(|side| *side >= PROBES[1]) && self.graph.signature.takes_any_size();
        if pixels <= MAX_WHOLE || cut.tile != cut.area || !can_probe {
            return Ok(());
        }
        if self.cost == MemoryEstimate::Unknown {
            self.cost = self
                .memory_cost(image)?
                .map_or(MemoryEstimate::Unmeasurable, MemoryEstimate::Known);
        }
        let MemoryEstimate::Known(cost) = self.cost else {
            return Ok(());
        };
        let Some(available) = memory::available() else {
            return Ok(());
        };
        cost.fits(pixels, available).map_err(|[needed, available]| {
            self.fault(format!(
                "would need about {needed:.1} GB of memory for an image of {} × {}, and {available:.1} GB are free; --tile 256 needs a fraction of it, if a pixel depends only on the pixels around it; otherwise --llie-max-side 1280 enhances a smaller image",
                size[1], size[0]
            ))
        })
    }

    /// Memory cost, measured on small parts of an image; `None` if it cannot be measured.
    fn memory_cost(&self, image: &Rgb) -> Result<Option<MemoryCost>> {
        let mut resident = [0; 2];
        for (side, resident) in PROBES.into_iter().zip(&mut resident) {
            let window = TileWindow {
                left: 0,
                top: 0,
                right: side,
                bottom: side,
            };
            let result = self.graph.probe(image, window)?;
            let (RunResult::Output(()), Some(bytes)) = (result, memory::resident()) else {
                return Ok(None);
            };
            *resident = bytes;
        }
        Ok(MemoryCost::of(resident))
    }

    /// Size to which a too large image is reduced: of the same shape, in the model's multiples. `None` if it is not reduced.
    fn reduced_size(&self, size: [usize; 2]) -> Option<[usize; 2]> {
        let max_side = self.max_side.map(NonZeroUsize::get)?;
        let longest = size[0].max(size[1]);
        if longest <= max_side || !self.graph.signature.takes_any_size() {
            return None;
        }
        let multiple = self.convention.multiple.map_or(1, NonZeroUsize::get);
        Some(size.map(|side| {
            let scaled = (side * max_side + longest / 2) / longest;
            (scaled / multiple * multiple).max(multiple)
        }))
    }

    /// Enhances an image whose sides are padded to multiples. The inner error is a problem that another multiple may solve.
    fn enhance_padded(
        &self,
        image: &Rgb,
        fixed: [usize; 2],
        multiple: usize,
    ) -> Result<std::result::Result<Rgb, String>> {
        let size = [image.height(), image.width()];
        let cut = self.cutting(size, fixed, multiple)?;
        let plan = TilePlan::of(cut).ok_or_else(|| self.too_small(cut))?;
        let mut canvas = TiledImage::new(cut.area);
        for (row, column) in plan.tiles() {
            let (input, output) = (
                TileWindow::input_of(row, column),
                TileWindow::output_of(row, column),
            );
            match self.graph.window(image, input, output)? {
                RunResult::Output(bytes) => canvas.add(row, column, &bytes),
                RunResult::Failed(problem) => return Ok(Err(problem)),
                RunResult::Unusable(values) => return Err(self.unusable(values, image)),
            }
        }
        let (enhanced, seam) = canvas.finish();
        if !self.crops(size, multiple) && !seam.holds() {
            return Err(self.fault(format!(
                "cannot be cut: its {} tiles differ by up to {} codes at their seams, in {} of {} samples, so a pixel depends on more than {} pixels around it. Leave out --tile to enhance the whole image, or state more context (tile = \"exact:N\" in MODEL.onnx.toml)",
                plan.count(),
                seam.max_difference,
                seam.differing,
                seam.compared,
                cut.context
            )));
        }
        Ok(Ok(if cut.area == size {
            enhanced
        } else {
            cropped(&enhanced, size)
        }))
    }

    /// Whether an image is enhanced in overlapping parts instead of padded, which may differ where they overlap.
    fn crops(&self, size: [usize; 2], multiple: usize) -> bool {
        self.graph.feeding.pad == Padding::Crop && size.iter().any(|side| side % multiple != 0)
    }

    /// Area that the tiles cover, and their size and context.
    fn cutting(&self, size: [usize; 2], fixed: [usize; 2], multiple: usize) -> Result<Cutting> {
        let round_down = |side: usize| side / multiple * multiple;
        if self.crops(size, multiple) {
            let tile = size.map(round_down);
            if tile.contains(&0) {
                return Err(self.fault(format!(
                    "takes images whose sides are multiples of {multiple} pixels, and {} × {} is smaller than that",
                    size[1], size[0]
                )));
            }
            return Ok(Cutting {
                area: size,
                tile,
                context: 0,
                multiple: 1,
            });
        }
        let area = size.map(|side| side.next_multiple_of(multiple));
        let exact_context = match self.convention.tile {
            Some(Tile::Exact(context)) => Some(context),
            _ => None,
        };
        let context = exact_context.unwrap_or(CONTEXT);
        let square = |side: usize| [round_down(side).max(multiple); 2];
        let tile = match (self.tiling, exact_context) {
            _ if fixed != size => fixed,
            (Tiling::Side(side), _) if self.convention.tile == Some(Tile::None) => {
                return Err(Error::usage(
                    "--tile",
                    format_args!(
                        "{side} is not possible: {} needs the whole image (tile = \"none\" in its sidecar or preset)",
                        self.name
                    ),
                ));
            }
            (Tiling::Side(side), _) => square(side.get()),
            (Tiling::Auto, Some(_)) if size[0] * size[1] > MAX_WHOLE => {
                square(TILE.max(4 * context))
            }
            (Tiling::Auto | Tiling::Whole, _) => area,
        };
        Ok(Cutting {
            area,
            tile,
            context,
            multiple,
        })
    }

    fn too_small(&self, cut: Cutting) -> Error {
        self.fault(format!(
            "cannot be cut into tiles of {} × {} pixels: with {} pixels of context on each side nothing is left of them; set larger ones with --tile N",
            cut.tile[1], cut.tile[0], cut.context
        ))
    }

    /// Enhances an image that is resized to `fixed`, and resizes the result back.
    fn enhance_resized(&self, image: &Rgb, fixed: [usize; 2]) -> Result<Rgb> {
        let planes = Planes::of(image).resized(fixed[0], fixed[1]);
        let planes = planes.map_err(|e| self.fault(e))?;
        let enhanced = match self.graph.planes(&planes)? {
            RunResult::Output(planes) => planes,
            RunResult::Failed(problem) => return Err(self.fault(problem)),
            RunResult::Unusable(values) => return Err(self.unusable(values, image)),
        };
        let enhanced = enhanced.resized(image.height(), image.width());
        let enhanced = enhanced.map_err(|e| self.fault(e))?;
        enhanced
            .to_rgb(self.graph.reading.rounding)
            .ok_or_else(|| self.fault("gave no pixels".to_owned()))
    }

    pub(super) fn fault(&self, problem: String) -> Error {
        Error::Enhancer {
            path: self.path.clone(),
            problem,
        }
    }

    fn unusable(&self, values: OutOfRange, image: &Rgb) -> Error {
        let range = self.graph.reading.range;
        self.fault(match values {
            OutOfRange::NotNumbers => format!(
                "gave values that are not numbers (NaN) for an image of {} × {}; check its weights and its divisions by zero",
                image.width(),
                image.height()
            ),
            OutOfRange::Beyond { min, max, likely } => format!(
                "gave values from {min} to {max}, but {range} is usual; if its range is {likely}, state it in MODEL.onnx.toml beside it: `range_out = \"{likely}\"` (or `range_out = \"{range}\"` if the values are right)"
            ),
        })
    }
}

/// Top left part of an image.
fn cropped(image: &Rgb, [height, width]: [usize; 2]) -> Rgb {
    let mut part = Rgb::black(height, width);
    let lines = part.samples_mut().chunks_exact_mut(3 * width);
    for (to, from) in lines.zip(image.samples().chunks_exact(3 * image.width())) {
        to.copy_from_slice(&from[..3 * width]);
    }
    part
}
