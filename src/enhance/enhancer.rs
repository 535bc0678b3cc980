//! A user's ONNX model on ONNX Runtime's CPU provider: [`Enhancer`].

use std::num::NonZeroUsize;
use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::types::{EnhancerName, Rgb};

use super::convention::{Padding, Tile};
use super::describe::Description;
use super::file::ModelFile;
use super::graph::{Graph, RunResult};
use super::memory::{self, MemoryCost, PROBES};
use super::planes::Planes;
use super::reading::OutOfRange;
use super::runtime::Runtime;
use super::session::{GraphSource, Stopper};
use super::sidecar::ModelSidecar;
use super::tiles::{Cutting, MULTIPLES, TilePlan, TileWindow, TiledImage, Tiling};

/// The sides of tiles where nobody says them, in pixels: measured as fast as the whole image with a twelfth of its memory.
const TILE: usize = 256;
/// The most pixels of an image that is not cut into tiles by itself.
const WHOLE: usize = 1280 * 720;
/// The context of tiles that are asked for without anybody saying how much is exact.
const CONTEXT: usize = 32;

/// What is known of the memory that a model needs.
#[derive(Debug, Clone, Copy, PartialEq)]
enum MemoryEstimate {
    /// Nothing yet.
    Unknown,
    /// It cannot be told.
    Untold,
    /// So much a pixel.
    Of(MemoryCost),
}

/// An enhancement model, loaded and ready.
pub struct Enhancer {
    path: PathBuf,
    name: EnhancerName,
    graph: Graph,
    stated: ModelSidecar,
    tiling: Tiling,
    most_side: Option<NonZeroUsize>,
    cost: MemoryEstimate,
    description: Description,
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
        let none = ModelSidecar::default();
        let preset = file.preset.as_ref();
        let stated = file
            .sidecar
            .clone()
            .over(preset.map_or(&none, |preset| &preset.states));
        let flushed = file.weights.flush_subnormals(&mut file.bytes);
        // ONNX Runtime finds external data only from the model's path.
        let source = if file.weights.external.is_empty() {
            GraphSource::Memory(file.bytes)
        } else {
            GraphSource::Path(file.path.clone())
        };
        let graph = Graph::load(source, &stated, runtime, threads)?.map_err(|problem| {
            let path = file.path.clone();
            Error::Enhancer { path, problem }
        })?;
        Ok(Self {
            path: file.path,
            name: file.name,
            graph,
            stated,
            tiling: Tiling::Auto,
            most_side: None,
            cost: MemoryEstimate::Unknown,
            description: Description {
                sidecar: file.sidecar,
                preset: file.preset,
                flushed,
            },
        })
    }

    /// Cuts images otherwise.
    #[must_use]
    pub fn with_tiling(self, tiling: Tiling) -> Self {
        Self { tiling, ..self }
    }

    /// Enhances images whose longer side is longer in that size, and scales the result back.
    #[must_use]
    pub fn with_most_side(self, most_side: Option<NonZeroUsize>) -> Self {
        Self { most_side, ..self }
    }

    /// The name in tables and records: the file's name without its extension.
    #[must_use]
    pub fn name(&self) -> &EnhancerName {
        &self.name
    }

    /// What was found in the graph and beside it, and why it is taken to be so: lines of text.
    #[must_use]
    pub fn describe(&self) -> String {
        self.description.text(&self.path, &self.graph, &self.stated)
    }

    /// A handle that ends a run from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.graph.stopper()
    }

    /// Enhances an image; the result has the same size.
    ///
    /// Where the model is of a fixed size the image is cut into tiles of it, if they are exact, or else resized to it and its
    /// result back, with a bilinear filter.
    ///
    /// # Errors
    /// Where the model fails on this image, gives another size than it was given, or values that are not numbers or of
    /// another range than was said; where tiles do not fit together.
    pub fn enhance(&mut self, dark: &Rgb) -> Result<Rgb> {
        let size = [dark.height(), dark.width()];
        if let Some(smaller) = self.reduced(size) {
            return self.resized(dark, smaller);
        }
        let fixed = [
            self.graph.signature.height.unwrap_or(size[0]),
            self.graph.signature.width.unwrap_or(size[1]),
        ];
        let cut_exactly = matches!(self.stated.tile, Some(Tile::Exact(_)))
            && fixed.iter().zip(size).all(|(fixed, size)| *fixed <= size);
        if fixed != size && !cut_exactly {
            return self.resized(dark, fixed);
        }
        let multiples: &[usize] = match self.stated.multiple {
            Some(multiple) => &[multiple.get()],
            None if fixed == size && self.graph.signature.takes_any_size() => &MULTIPLES,
            None => &[1],
        };
        self.estimate(dark, fixed)?;
        let mut first = None;
        for multiple in multiples {
            match self.enhanced(dark, fixed, *multiple)? {
                Ok(enhanced) => return Ok(enhanced),
                Err(problem) => drop(first.get_or_insert(problem)),
            }
        }
        Err(self.fault(first.unwrap_or_default()))
    }

    /// Refuses a large image that would need more memory than there is, before it is spent.
    fn estimate(&mut self, dark: &Rgb, fixed: [usize; 2]) -> Result<()> {
        let size = [dark.height(), dark.width()];
        let pixels = size[0] * size[1];
        let multiple = self.stated.multiple.map_or(1, NonZeroUsize::get);
        let cut = self.cut(size, fixed, multiple)?;
        let probed =
            size.iter().all(|side| *side >= PROBES[1]) && self.graph.signature.takes_any_size();
        if pixels <= WHOLE || cut.tile != cut.area || !probed {
            return Ok(());
        }
        if self.cost == MemoryEstimate::Unknown {
            self.cost = self
                .probed(dark)?
                .map_or(MemoryEstimate::Untold, MemoryEstimate::Of);
        }
        let MemoryEstimate::Of(cost) = self.cost else {
            return Ok(());
        };
        let Some(available) = memory::available() else {
            return Ok(());
        };
        cost.fits(pixels, available).map_err(|[needed, available]| {
            self.fault(format!(
                "would need about {needed:.1} GB of memory for an image of {} × {}, and {available:.1} GB are free; --tile 256 does with a fraction of it where the model is local, --llie-max-side 1280 with a smaller image where it is not",
                size[1], size[0]
            ))
        })
    }

    /// What small parts of an image need; `None` where that tells nothing.
    fn probed(&self, dark: &Rgb) -> Result<Option<MemoryCost>> {
        let mut resident = [0; 2];
        for (side, resident) in PROBES.into_iter().zip(&mut resident) {
            let window = TileWindow {
                left: 0,
                top: 0,
                right: side,
                bottom: side,
            };
            let ran = self.graph.probe(dark, window)?;
            let (RunResult::Gave(()), Some(bytes)) = (ran, memory::resident()) else {
                return Ok(None);
            };
            *resident = bytes;
        }
        Ok(MemoryCost::of(resident))
    }

    /// The size in which an image is enhanced that is too large for its own: of the same shape, and of the model's multiple.
    fn reduced(&self, size: [usize; 2]) -> Option<[usize; 2]> {
        let most = self.most_side.map(NonZeroUsize::get)?;
        let longest = size[0].max(size[1]);
        if longest <= most || !self.graph.signature.takes_any_size() {
            return None;
        }
        let multiple = self.stated.multiple.map_or(1, NonZeroUsize::get);
        Some(size.map(|side| {
            let scaled = (side * most + longest / 2) / longest;
            (scaled / multiple * multiple).max(multiple)
        }))
    }

    /// Enhances an image whose sides are filled up to multiples; a problem that another multiple may solve is given back.
    fn enhanced(
        &self,
        dark: &Rgb,
        fixed: [usize; 2],
        multiple: usize,
    ) -> Result<std::result::Result<Rgb, String>> {
        let size = [dark.height(), dark.width()];
        let cut = self.cut(size, fixed, multiple)?;
        let plan = TilePlan::of(cut).ok_or_else(|| self.too_small(cut))?;
        let mut canvas = TiledImage::new(cut.area);
        for (row, column) in plan.tiles() {
            let (seen, taken) = (
                TileWindow::seen(row, column),
                TileWindow::taken(row, column),
            );
            match self.graph.window(dark, seen, taken)? {
                RunResult::Gave(bytes) => canvas.put(row, column, &bytes),
                RunResult::Failed(problem) => return Ok(Err(problem)),
                RunResult::Unusable(values) => return Err(self.unusable(values, dark)),
            }
        }
        let (enhanced, seam) = canvas.finish();
        if !self.crops(size, multiple) && !seam.holds() {
            return Err(self.fault(format!(
                "is not to be cut: its {} tiles differ by up to {} codes at their seams in {} of {} samples, so that a pixel depends on more than {} pixels around it. Leave --tile out for the whole image, or state more context (tile = \"exact:N\" in MODEL.onnx.toml)",
                plan.count(),
                seam.most,
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

    /// Whether an image is seen in parts of multiples that overlap, so that their seams need not hold.
    fn crops(&self, size: [usize; 2], multiple: usize) -> bool {
        self.graph.feeding.pad == Padding::Crop && size.iter().any(|side| side % multiple != 0)
    }

    /// The area that tiles cover, and how they are cut.
    fn cut(&self, size: [usize; 2], fixed: [usize; 2], multiple: usize) -> Result<Cutting> {
        let down = |side: usize| side / multiple * multiple;
        if self.crops(size, multiple) {
            let tile = size.map(down);
            if tile.contains(&0) {
                return Err(self.fault(format!(
                    "takes images of multiples of {multiple} pixels, and {} × {} is smaller than that",
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
        let stated = match self.stated.tile {
            Some(Tile::Exact(context)) => Some(context),
            _ => None,
        };
        let context = stated.unwrap_or(CONTEXT);
        let square = |side: usize| [down(side).max(multiple); 2];
        let tile = match (self.tiling, stated) {
            _ if fixed != size => fixed,
            (Tiling::Of(asked), _) if self.stated.tile == Some(Tile::None) => {
                return Err(Error::usage(
                    "--tile",
                    format_args!(
                        "{asked}, but {} is said to need the whole image (tile = \"none\" in its sidecar or preset)",
                        self.name
                    ),
                ));
            }
            (Tiling::Of(asked), _) => square(asked.get()),
            (Tiling::Auto, Some(_)) if size[0] * size[1] > WHOLE => square(TILE.max(4 * context)),
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
            "cannot be cut into tiles of {} × {} pixels: with {} pixels of context on each side nothing is left of them; --tile N says larger ones",
            cut.tile[1], cut.tile[0], cut.context
        ))
    }

    /// Enhances an image in the size that the model takes.
    fn resized(&self, dark: &Rgb, fixed: [usize; 2]) -> Result<Rgb> {
        let planes = Planes::of(dark).resized(fixed[0], fixed[1]);
        let planes = planes.map_err(|e| self.fault(e))?;
        let enhanced = match self.graph.planes(&planes)? {
            RunResult::Gave(planes) => planes,
            RunResult::Failed(problem) => return Err(self.fault(problem)),
            RunResult::Unusable(values) => return Err(self.unusable(values, dark)),
        };
        let enhanced = enhanced.resized(dark.height(), dark.width());
        let enhanced = enhanced.map_err(|e| self.fault(e))?;
        enhanced
            .to_rgb(self.graph.reading.rounding)
            .ok_or_else(|| self.fault("gave no pixels".to_owned()))
    }

    fn fault(&self, problem: String) -> Error {
        Error::Enhancer {
            path: self.path.clone(),
            problem,
        }
    }

    fn unusable(&self, values: OutOfRange, image: &Rgb) -> Error {
        let range = self.graph.reading.range;
        self.fault(match values {
            OutOfRange::NotNumbers => format!(
                "gave values that are not numbers (NaN) for an image of {} × {}; its weights or a division by zero in it are at fault",
                image.width(),
                image.height()
            ),
            OutOfRange::Beyond {
                least,
                most,
                likely,
            } => format!(
                "gave values from {least} to {most}, which are not of {range} as is usual; where they are of {likely}, say so in MODEL.onnx.toml beside it: `range_out = \"{likely}\"` (or `range_out = \"{range}\"` where they are as they should be)"
            ),
        })
    }
}

/// The top left part of an image.
fn cropped(image: &Rgb, [height, width]: [usize; 2]) -> Rgb {
    let mut part = Rgb::black(height, width);
    let lines = part.samples_mut().chunks_exact_mut(3 * width);
    for (to, from) in lines.zip(image.samples().chunks_exact(3 * image.width())) {
        to.copy_from_slice(&from[..3 * width]);
    }
    part
}
