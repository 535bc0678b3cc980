//! Plan for feeding an image to a model that does not accept its size, by padding and tiling: [`SizePlan`].
//!
//! Each side is planned on its own. A side equal to the model's fixed size is fed unchanged; a smaller one is padded at
//! the right or bottom and cropped afterwards; a larger one is cut into tiles of exactly that size, the first and last
//! of which touch the image's edges. The result equals that of the whole image only if a pixel depends only on the
//! pixels around it. Measured with Zero-DCE at 512 × 512: a mean difference of 0.006 codes of 255, compared with 5.4
//! for resizing the image and the result.
//!
//! Search by trial for the sizes that a model accepts, after a failure at an image's size: [`SizeSearch`].
//!
//! Counts of enhanced images in a [`SizeLog`]: whole, padded and tiled.
//!
//! Synthetic images for trials of a model: [`texture`].

use std::num::NonZeroUsize;
use std::ops::RangeInclusive;

use super::tiles::{Seam, TileGeometry, TilePlan, TileWindow, Tiling};
use crate::conventions::sidecar::{ADD, ModelSidecar};
use crate::conventions::{Locality, Padding};
use crate::failure::{RunFailure, format_size};
use crate::graphs::{Graph, RunResult};
use darkqa_base::error::Result;
use darkqa_base::types::{Rgb, SizeLog};

/// Side of a tile with `--llie-options tile=auto`, in pixels; measured: as fast as the whole image, with a twelfth of
/// its memory.
const TILE: usize = 256;

/// Maximum area, in pixels, of an image that `--llie-options tile=auto` does not cut and whose memory is not checked;
/// chosen.
pub(crate) const MAX_WHOLE: usize = 1280 * 720;

/// Context of tiles, in pixels, with `--llie-options tile=N` if neither sidecar nor preset states the exact context;
/// chosen.
const CONTEXT: usize = 32;

/// Sizes that a model accepts, as far as graph, sidecar, preset and trials show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SizeRule {
    /// Height and width that every run must have; `None` for any.
    pub(crate) fixed: [Option<usize>; 2],
    /// Free sides must be multiples of this number.
    pub(crate) multiple: usize,
    /// Minimum number of padded pixels, 0 or 1: with 1, even sides that are multiples are padded to the next one.
    pub(crate) least_fill: usize,
    /// Content of the padding.
    pub(crate) pad: Padding,
    /// Locality of the model, if sidecar or preset state it.
    pub(crate) tile: Option<Locality>,
}

impl SizeRule {
    /// The rule of a convention for a graph with these fixed sides.
    pub(crate) fn new(fixed: [Option<usize>; 2], convention: &ModelSidecar, pad: Padding) -> Self {
        let stated = convention.fixed.map(|[width, height]| [height, width]);
        Self {
            fixed: stated.map_or(fixed, |sides| sides.map(|side| Some(side.get()))),
            multiple: convention.multiple.map_or(1, NonZeroUsize::get),
            least_fill: usize::from(convention.pad_always == Some(true)),
            pad,
            tile: convention.tile,
        }
    }

    /// True if neither side is fixed.
    pub(crate) fn takes_any_size(self) -> bool {
        self.fixed == [None; 2]
    }

    /// Height and width, padded to the multiple.
    fn padded(self, size: [usize; 2]) -> [usize; 2] {
        size.map(|side| (side + self.least_fill).next_multiple_of(self.multiple))
    }

    /// Height and width of a run on the whole image: the fixed sides, and the other sides padded.
    pub(crate) fn run_size(self, size: [usize; 2]) -> [usize; 2] {
        let filled = self.padded(size);
        [0, 1].map(|side| self.fixed[side].unwrap_or(filled[side]))
    }

    /// True if the image must be padded or cut in a way that changes the result unless the model is local.
    pub(crate) fn needs_locality(self, size: [usize; 2]) -> bool {
        let whole = self.run_size(size);
        whole != size && whole != self.padded(size)
    }

    /// True if the image is enhanced in overlapping parts instead of being padded; the parts may differ where they
    /// overlap.
    fn is_cropped(self, size: [usize; 2]) -> bool {
        self.pad == Padding::Crop && self.takes_any_size() && size.iter().any(|side| side % self.multiple != 0)
    }

    /// Size to which an image with a side above `max_side` is reduced, of the same aspect ratio and in the model's
    /// multiples. `None` if the image is not reduced.
    pub(crate) fn reduced_size(self, size: [usize; 2], max_side: Option<NonZeroUsize>) -> Option<[usize; 2]> {
        let max_side = max_side?.get();
        let longest = size[0].max(size[1]);
        if longest <= max_side || !self.takes_any_size() {
            return None;
        }
        let multiple = self.multiple;
        Some(size.map(|side| {
            let scaled = (side * max_side + longest / 2) / longest;
            (scaled / multiple * multiple).max(multiple)
        }))
    }
}

/// Tiles of one image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SizePlan {
    pub(crate) geometry: TileGeometry,
    pub(crate) tiles: TilePlan,
    /// Consequence of tiles that differ at their seams.
    pub(crate) seams: SeamRule,
}

/// Consequence of tiles that differ at their seams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SeamRule {
    /// None: parts that overlap because the model needs multiples may differ.
    MayDiffer,
    /// An error, because the model is not local and must not be tiled.
    MustHold,
}

/// Reason why there is no plan; the message follows the file's name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum PlanError {
    /// The flag `--llie-options tile` contradicts sidecar or preset.
    TileFlag(String),
    /// Anything else.
    Other(String),
}

impl SizePlan {
    /// The plan for an image of this size. `context`, in pixels, is used for a model with a fixed size.
    pub(crate) fn new(size: [usize; 2], rule: SizeRule, tiling: Tiling, context: usize) -> Result<Self, PlanError> {
        let geometry = if rule.is_cropped(size) {
            crop_geometry(size, rule)?
        } else if rule.takes_any_size() {
            tile_geometry(size, rule, tiling)?
        } else {
            fixed_geometry(size, rule, context)
        };
        let tiles = TilePlan::new(geometry).ok_or_else(|| PlanError::Other(no_room_for_context(geometry)))?;
        Ok(Self {
            geometry,
            tiles,
            seams: if rule.is_cropped(size) { SeamRule::MayDiffer } else { SeamRule::MustHold },
        })
    }

    /// Height and width of a run.
    pub(crate) fn run_size(&self) -> [usize; 2] {
        [0, 1].map(|side| self.geometry.tile[side].min(self.geometry.area[side]))
    }
}

/// Overlapping parts whose sides are the largest multiples that fit into the image.
fn crop_geometry(size: [usize; 2], rule: SizeRule) -> Result<TileGeometry, PlanError> {
    let tile = size.map(|side| side / rule.multiple * rule.multiple);
    if tile.contains(&0) {
        return Err(PlanError::Other(format!(
            "takes images whose sides are multiples of {} pixels, but {} is smaller; `pad = \"crop\"` does not pad it",
            rule.multiple,
            format_size(size)
        )));
    }
    Ok(TileGeometry { area: size, tile, context: 0, multiple: 1 })
}

/// Tiles for a model that accepts any size, by `--llie-options tile` and the stated locality.
fn tile_geometry(size: [usize; 2], rule: SizeRule, tiling: Tiling) -> Result<TileGeometry, PlanError> {
    let area = rule.padded(size);
    let exact = match rule.tile {
        Some(Locality::Exact(context)) => Some(context),
        _ => None,
    };
    let context = exact.unwrap_or(CONTEXT);
    let tile = match (tiling, exact) {
        (Tiling::Side(side), _) if rule.tile == Some(Locality::Global) => {
            return Err(PlanError::TileFlag(side.to_string()));
        }
        (Tiling::Side(side), _) => square_tile(side.get(), rule.multiple),
        (Tiling::Auto, Some(_)) if size[0] * size[1] > MAX_WHOLE => square_tile(TILE.max(4 * context), rule.multiple),
        (Tiling::Auto | Tiling::Whole, _) => area,
    };
    Ok(TileGeometry { area, tile, context, multiple: rule.multiple })
}

/// Height and width of a square tile, rounded down to a multiple.
fn square_tile(side: usize, multiple: usize) -> [usize; 2] {
    [(side / multiple).max(1) * multiple; 2]
}

/// Tiles of a fixed size, to which smaller images are padded.
fn fixed_geometry(size: [usize; 2], rule: SizeRule, context: usize) -> TileGeometry {
    let tile = rule.run_size(size);
    // Tiles start at the stated multiples, if their size is a multiple, too.
    let multiple = if tile.iter().all(|side| side % rule.multiple == 0) { rule.multiple } else { 1 };
    let area = [0, 1].map(|side| tile[side].max(size[side].next_multiple_of(multiple)));
    TileGeometry { area, tile, context, multiple }
}

fn no_room_for_context(geometry: TileGeometry) -> String {
    format!(
        "cannot be cut into tiles of {} pixels: {} pixels of context on each side leave nothing; set larger tiles with --llie-options tile=N, or export it for a larger size",
        format_size(geometry.tile),
        geometry.context
    )
}

/// Message about an image of another size for a model with a fixed size that is not local.
pub(crate) fn not_local(rule: SizeRule, size: [usize; 2], why: &str) -> String {
    let [height, width] = rule.fixed.map(|side: Option<usize>| side.map_or("any".to_owned(), |side| side.to_string()));
    format!(
        "takes only images of {width} × {height}, but the image has {}; padding or tiling would change it, because {why}. Export it for any size: `torch.onnx.export(..., input_names=[\"input\"], output_names=[\"output\"], dynamic_axes={{\"input\": {{2: \"h\", 3: \"w\"}}, \"output\": {{2: \"h\", 3: \"w\"}}}})`, or for images of {}; or resize each image and back with --llie-options resize, which blurs it and changes its brightness by some codes of 255",
        format_size(size),
        format_size(size)
    )
}

/// Message about tiles of an image of this size that differ where they overlap.
pub(crate) fn seams_differ(rule: SizeRule, size: [usize; 2], plan: &SizePlan, seam: Seam) -> String {
    let differ = format!(
        "its {} tiles differ by up to {} codes at their seams, in {} of {} samples, so a pixel depends on more than {} pixels around it",
        plan.tiles.count(),
        seam.max_difference,
        seam.differing,
        seam.compared,
        plan.geometry.context
    );
    if !rule.takes_any_size() {
        return not_local(rule, size, &differ);
    }
    format!(
        "cannot be tiled: {differ}. Leave out --llie-options tile to enhance the whole image, or {ADD} more context: `tile = \"exact:N\"`"
    )
}

/// Multiples that are tried, in this order, for networks that halve an image repeatedly, and for patches of 14 pixels.
pub(crate) const MULTIPLES: [usize; 17] = [1, 4, 8, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64, 96, 112, 128];

/// Minimum side of a trial image, in pixels; chosen for networks that halve the image five times.
const MIN_SIDE: usize = 64;

/// Sizes that a model accepts, found by trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AcceptedSizes {
    /// Sides that are multiples of this number, which is above 1.
    Multiple(usize),
    /// Only this height and width, frozen by tracing.
    Traced([usize; 2]),
}

impl AcceptedSizes {
    /// Message about the accepted sizes, with the sidecar line that states them.
    pub(crate) fn message(self) -> String {
        match self {
            Self::Multiple(multiple) => format!(
                "it takes only sides that are multiples of {multiple} pixels (found by trial), so other images are padded; to confirm, {ADD}: `multiple = {multiple}`"
            ),
            Self::Traced(size) => format!(
                "it was traced for {} and takes no other size, so other images are padded or tiled; export it without int(x.shape[..]) in its code, or {ADD}: `fixed = [{}, {}]`",
                format_size(size),
                size[1],
                size[0]
            ),
        }
    }
}

/// Search for the accepted sizes, made once per model.
#[derive(Debug, Clone, Default)]
pub(crate) struct SizeSearch {
    /// Sizes that may be frozen into the graph.
    traced: Vec<[usize; 2]>,
    state: SearchState,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum SearchState {
    /// Not made yet.
    #[default]
    Open,
    /// Without result: no tried size works, or the model accepts any multiple.
    Nothing,
    Found(AcceptedSizes),
}

impl SizeSearch {
    /// A search that also tries these heights and widths.
    pub(crate) fn new(traced: Vec<[usize; 2]>) -> Self {
        Self { traced, state: SearchState::Open }
    }

    /// Result of the search; `None` before the search or without a result.
    pub(crate) fn found(&self) -> Option<AcceptedSizes> {
        match self.state {
            SearchState::Found(found) => Some(found),
            SearchState::Open | SearchState::Nothing => None,
        }
    }

    /// Makes the search at the first call, and returns its result.
    pub(crate) fn run(&mut self, graph: &Graph) -> Result<Option<AcceptedSizes>> {
        if self.state == SearchState::Open {
            let found = match find_multiple(graph)? {
                Some(1) => None,
                Some(multiple) => Some(AcceptedSizes::Multiple(multiple)),
                None => self.find_traced_size(graph)?.map(AcceptedSizes::Traced),
            };
            self.state = found.map_or(SearchState::Nothing, SearchState::Found);
        }
        Ok(self.found())
    }

    /// Tries the sizes that may be frozen into the graph; returns the first at which the model runs.
    fn find_traced_size(&self, graph: &Graph) -> Result<Option<[usize; 2]>> {
        for size in &self.traced {
            match run_trial(graph, *size)? {
                SizeOutcome::Runs => return Ok(Some(*size)),
                SizeOutcome::Fails => {}
                SizeOutcome::OverLimit => return Ok(None),
            }
        }
        Ok(None)
    }
}

/// First of [`MULTIPLES`] at which the model runs; `None` if it runs at none of them.
///
/// Each multiple is tried at a size that is not a multiple of any larger one, so that success is evidence for this
/// multiple.
fn find_multiple(graph: &Graph) -> Result<Option<usize>> {
    for multiple in MULTIPLES {
        match run_trial(graph, trial_size(multiple))? {
            SizeOutcome::Runs => return Ok(Some(multiple)),
            SizeOutcome::Fails => {}
            SizeOutcome::OverLimit => return Ok(None),
        }
    }
    Ok(None)
}

/// Height and width of the trial image for a multiple: the multiple times two different primes of at least 3.
fn trial_size(multiple: usize) -> [usize; 2] {
    let mut primes = (3..)
        .filter(|n: &usize| (2..*n).all(|divisor| !n.is_multiple_of(divisor)))
        .skip_while(|n| n * multiple < MIN_SIDE);
    [(); 2].map(|()| primes.next().map_or(multiple, |prime| prime * multiple))
}

/// Result of a trial.
enum SizeOutcome {
    /// The model returned an image of the input's size, with any values.
    Runs,
    Fails,
    /// The run exceeded the limit of time or memory, so further trials make no sense.
    OverLimit,
}

fn run_trial(graph: &Graph, size: [usize; 2]) -> Result<SizeOutcome> {
    let window = TileWindow::whole(size);
    graph.restart_clock();
    let result = graph.probe(&texture(size, &CODES[1]), window)?;
    Ok(match result {
        RunResult::Output(()) | RunResult::Unusable(_) => SizeOutcome::Runs,
        RunResult::Failed(RunFailure::TimedOut(_) | RunFailure::MemoryExceeded(_)) => SizeOutcome::OverLimit,
        RunResult::Failed(_) => SizeOutcome::Fails,
    })
}

/// Message about `failure` for a model whose accepted sizes were not found.
pub(crate) fn sizes_not_found(failure: &RunFailure, search: &SizeSearch) -> String {
    let words = failure.message();
    if !failure.may_depend_on_size() {
        return words;
    }
    let traced = if search.traced.is_empty() { "" } else { ", and the sizes in its constants" };
    let tried = MULTIPLES[1..].iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    // The message about an output of another size has its own advice.
    let advice = if matches!(failure, RunFailure::WrongSize { .. }) {
        ""
    } else {
        "; export it with dynamic_axes and without int(x.shape[..]) in its code, or for the size of the images"
    };
    format!("{words}. The multiples {tried}{traced} fail, too{advice}")
}

/// Counts an image, and records the fixed size or the multiple that its run needed.
pub(crate) fn count_image(log: &mut SizeLog, rule: SizeRule) {
    log.images += 1;
    if !rule.takes_any_size() {
        let [height, width] = rule.fixed;
        log.fixed = Some([width, height]);
    }
    if rule.multiple > 1 {
        log.multiple = Some(rule.multiple);
    }
}

/// Counts an image of height and width `size` that was enhanced by a plan: whole, padded or in tiles.
pub(crate) fn count_planned(log: &mut SizeLog, size: [usize; 2], rule: SizeRule, plan: &SizePlan, seam: Seam) {
    count_image(log, rule);
    let (is_padded, is_tiled) = (plan.geometry.area != size, plan.tiles.count() > 1);
    log.whole += usize::from(!is_padded && !is_tiled);
    if is_padded {
        log.padded += 1;
        log.pad = Some(rule.pad.to_string());
    }
    if is_tiled {
        let [height, width] = plan.run_size();
        log.tiled += 1;
        log.tile = log.tile.max(Some([width, height]));
        log.context = log.context.max(Some(plan.geometry.context));
        log.seam.compared += seam.compared;
        log.seam.black += seam.black;
        log.seam.differing += seam.differing;
        log.seam.most = log.seam.most.max(seam.max_difference);
    }
}

/// Ranges of codes of the trial images: as dark as an underexposed photograph, the whole range, and nearly black for
/// models whose gates saturate on brighter images. Code 0 is left out, because some models divide by it.
pub(crate) const CODES: [RangeInclusive<u8>; 3] = [4..=40, 4..=251, 1..=12];

/// An image of pseudorandom samples within a range of codes; deterministic.
pub(crate) fn texture([height, width]: [usize; 2], codes: &RangeInclusive<u8>) -> Rgb {
    let mut image = Rgb::black(height, width);
    let span = u32::from(codes.end() - codes.start()) + 1;
    let mut state = 1_u32;
    for sample in image.samples_mut() {
        // A linear congruential generator (Numerical Recipes, section 7.1).
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *sample = codes.start() + ((state >> 16) % span) as u8;
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: SizeRule = SizeRule { fixed: [None; 2], multiple: 1, least_fill: 0, pad: Padding::Reflect, tile: None };

    fn fixed(size: [usize; 2]) -> SizeRule {
        SizeRule { fixed: size.map(Some), ..RULE }
    }

    #[test]
    fn each_side_is_padded_or_cut_on_its_own() {
        // Height smaller, width larger, as an image of 250 × 110 for a model of 200 × 152.
        let plan = SizePlan::new([110, 250], fixed([152, 200]), Tiling::Auto, 8).unwrap();
        assert_eq!((plan.geometry.area, plan.run_size()), ([152, 250], [152, 200]));
        assert_eq!(plan.tiles.count(), 2);
        let starts: Vec<_> = plan.tiles.tiles().map(|(_, column)| column.input_start).collect();
        assert_eq!(starts, [0, 50]);
        let equal = SizePlan::new([152, 200], fixed([152, 200]), Tiling::Auto, 8).unwrap();
        assert_eq!((equal.geometry.area, equal.tiles.count()), ([152, 200], 1));
        // One side is free.
        let half = SizeRule { fixed: [Some(64), None], multiple: 8, ..RULE };
        let plan = SizePlan::new([60, 99], half, Tiling::Auto, 8).unwrap();
        assert_eq!((plan.geometry.area, plan.run_size()), ([64, 104], [64, 104]));
    }

    #[test]
    fn padding_to_the_stated_multiple_needs_no_local_model() {
        let eights = SizeRule { multiple: 8, ..fixed([96, 96]) };
        assert!(!eights.needs_locality([96, 96]) && !eights.needs_locality([90, 95]));
        for size in [[80, 96], [96, 97], [104, 96]] {
            assert!(eights.needs_locality(size), "{size:?}");
        }
        assert!(!RULE.needs_locality([13, 30]));
    }

    #[test]
    fn one_row_and_column_are_always_padded_if_stated() {
        let always = SizeRule { multiple: 16, least_fill: 1, ..RULE };
        for (size, area) in [([32, 30], [48, 32]), ([31, 47], [32, 48])] {
            let plan = SizePlan::new(size, always, Tiling::Auto, 0).unwrap();
            assert_eq!(plan.geometry.area, area);
        }
    }

    #[test]
    fn tiles_without_room_for_their_context_are_refused() {
        let refused = SizePlan::new([100, 100], fixed([20, 20]), Tiling::Auto, 8);
        assert!(matches!(refused, Err(PlanError::Other(problem)) if problem.contains("leave nothing")));
        let global = SizeRule { tile: Some(Locality::Global), ..RULE };
        let tile = Tiling::Side(NonZeroUsize::new(64).unwrap());
        let refused = SizePlan::new([100, 100], global, tile, 8);
        assert!(matches!(refused, Err(PlanError::TileFlag(_))));
    }

    #[test]
    fn images_are_reduced_to_multiples() {
        let eights = SizeRule { multiple: 8, ..RULE };
        let most = NonZeroUsize::new(40);
        assert_eq!(eights.reduced_size([64, 100], most), Some([24, 40]));
        assert_eq!(eights.reduced_size([24, 40], most), None);
        assert_eq!(fixed([8, 8]).reduced_size([64, 100], most), None);
    }

    #[test]
    fn trial_sizes_are_not_multiples_of_larger_ones() {
        for (index, multiple) in MULTIPLES.into_iter().enumerate() {
            let size = trial_size(multiple);
            assert!(size.iter().all(|side| *side >= MIN_SIDE && side % multiple == 0));
            for larger in &MULTIPLES[index + 1..] {
                let fits = size.iter().all(|side| side % larger == 0);
                assert!(!fits, "{size:?} is a multiple of {larger}");
            }
        }
    }

    #[test]
    fn textures_are_deterministic_and_within_the_range() {
        let image = texture([40, 60], &CODES[0]);
        assert_eq!(image, texture([40, 60], &CODES[0]));
        let codes = image.samples();
        assert_eq!((codes.iter().min(), codes.iter().max()), (Some(&4), Some(&40)));
    }
}
