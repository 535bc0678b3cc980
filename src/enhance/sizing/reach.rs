//! Measurement of a model's receptive field ([`PixelReach`]), and of the context and alignment of its tiles ([`Context`]).
//!
//! One pixel in the middle of a trial image is changed by one code. The distance of the farthest output sample that
//! changes is the reach: 7 pixels for Zero-DCE, as its seven 3 × 3 convolutions imply. A global mean changes too little
//! with one pixel (2 · 10⁻⁷ for BrightsightNet at 512 × 512). So a quarter of the image is inverted, too, and changes
//! far from that quarter also count.

use super::size_plan::{CODES, SizeRule, texture};
use crate::conventions::Locality;
use crate::graphs::{Graph, RunResult};
use crate::planes::Planes;
use darkqa_base::error;
use darkqa_base::types::Rgb;

/// Minimum change of an output in 0..1 that counts; above rounding errors of 32-bit floats, below a thousandth of a
/// code. Chosen.
const MIN_CHANGE: f32 = 1e-6;

/// Minimum context of a tile, in pixels, if the tile has room for it: slightly more than most models need. Chosen.
const MIN_CONTEXT: usize = 8;

/// Side, in pixels, of the trial image for models that accept any size; chosen.
pub(crate) const FREE_SIDE: usize = 128;

/// Multiples of pixels at which tiles may have to start, in ascending order, for networks that halve an image up to
/// five times.
const ALIGNMENTS: [usize; 16] = [1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32];

/// Maximum difference of outputs in 0..1 that count as equal: a tenth of a code. Chosen above the rounding of sums in
/// another order.
const MAX_EQUAL: f32 = 4e-4;

/// Context and alignment of a model's tiles, measured once if they are not stated.
#[derive(Debug, Clone, Default)]
pub(crate) struct Context {
    reach: Option<Result<PixelReach, String>>,
    /// Multiple of pixels at which tiles start.
    alignment: Option<usize>,
}

impl Context {
    /// Context in pixels, stated or measured. The inner error explains why the model counts as global.
    pub(crate) fn measure(&mut self, graph: &Graph, rule: SizeRule) -> error::Result<Result<usize, String>> {
        match rule.tile {
            Some(Locality::Exact(context)) => return Ok(Ok(context)),
            Some(Locality::Global) => {
                return Ok(Err(
                    "it needs the whole image (tile = \"none\" in MODEL.onnx.toml or the preset)".to_owned()
                ));
            }
            None => {}
        }
        let size = rule.run_size([FREE_SIDE; 2]);
        if self.reach.is_none() {
            let used = graph.used_time();
            self.reach = Some(PixelReach::probe(graph, size)?);
            graph.set_used_time(used);
        }
        let reach = self.reach.clone().unwrap_or_else(|| Err(String::new()));
        Ok(reach.and_then(|reach| {
            reach.context(size).ok_or_else(|| {
                format!("a pixel depends on others {} pixels away, which is more than a quarter of the size", reach.0)
            })
        }))
    }

    /// The measured reach in pixels; `None` if it was not measured.
    pub(crate) fn reach(&self) -> Option<usize> {
        let reach = self.reach.as_ref()?.as_ref().ok()?;
        Some(reach.0)
    }

    /// True if the alignment has not been measured yet.
    pub(crate) fn lacks_alignment(&self) -> bool {
        self.alignment.is_none()
    }

    /// Multiple at which tiles of this height and width must start to give the same result as the whole image: 2 to the
    /// power of the number of pooling layers. 1 if none is found; the comparison of seams then detects wrong tiles.
    pub(crate) fn measure_alignment(
        &mut self,
        graph: &Graph,
        tile: [usize; 2],
        context: usize,
    ) -> error::Result<usize> {
        if let Some(alignment) = self.alignment {
            return Ok(alignment);
        }
        let used = graph.used_time();
        let found = find_alignment(graph, tile, context)?.unwrap_or(1);
        graph.set_used_time(used);
        self.alignment = Some(found);
        Ok(found)
    }
}

/// Smallest of [`ALIGNMENTS`] by which the input can be shifted without changing the output, except within the context
/// of the edges; `None` without one.
fn find_alignment(graph: &Graph, tile: [usize; 2], context: usize) -> error::Result<Option<usize>> {
    let largest = ALIGNMENTS[ALIGNMENTS.len() - 1];
    let scene = texture(tile.map(|side| side + largest), &CODES[0]);
    let Ok(still) = run_trial(graph, &crop(&scene, tile, 0))? else {
        return Ok(None);
    };
    for shift in ALIGNMENTS {
        let Ok(moved) = run_trial(graph, &crop(&scene, tile, shift))? else {
            return Ok(None);
        };
        if same_interior(&still, &moved, shift, context) {
            return Ok(Some(shift));
        }
    }
    Ok(None)
}

/// Crops an image to this size, starting at row and column `start`.
fn crop(scene: &Rgb, [height, width]: [usize; 2], start: usize) -> Planes {
    let mut part = Rgb::black(height, width);
    let rows = scene.samples().chunks_exact(3 * scene.width()).skip(start);
    let lines = part.samples_mut().chunks_exact_mut(3 * width);
    for (line, row) in lines.zip(rows) {
        line.copy_from_slice(&row[3 * start..][..3 * width]);
    }
    Planes::from_rgb(&part)
}

/// True if the output of an image and that of the shifted image agree where both are farther than `margin` from their
/// edges.
fn same_interior(still: &Planes, moved: &Planes, shift: usize, margin: usize) -> bool {
    let (height, width) = (still.height, still.width);
    let rows = margin..(height - shift.min(height)).saturating_sub(margin);
    let columns = margin..(width - shift.min(width)).saturating_sub(margin);
    let plane = height * width;
    let channels = still.samples.len() / plane.max(1);
    !rows.is_empty()
        && !columns.is_empty()
        && (0..channels).all(|channel| {
            rows.clone().all(|row| {
                columns.clone().all(|column| {
                    let index = channel * plane + row * width + column;
                    let shifted_index = index + shift * width + shift;
                    (still.samples[shifted_index] - moved.samples[index]).abs() <= MAX_EQUAL
                })
            })
        })
}

/// Maximum distance, along a side, of the input pixels on which an output pixel depends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PixelReach(usize);

impl PixelReach {
    /// Measures the reach of a model at one size (height, width); the inner error explains why it cannot be measured.
    fn probe(graph: &Graph, size: [usize; 2]) -> error::Result<Result<Self, String>> {
        let mut farthest = 0;
        for codes in &CODES {
            let mut image = texture(size, codes);
            let before = match run_trial(graph, &Planes::from_rgb(&image))? {
                Ok(before) => before,
                Err(problem) => return Ok(Err(problem)),
            };
            let middle = size.map(|side| side / 2);
            let at = 3 * (middle[0] * size[1] + middle[1]);
            for sample in &mut image.samples_mut()[at..at + 3] {
                *sample += 1;
            }
            let after = match run_trial(graph, &Planes::from_rgb(&image))? {
                Ok(after) => after,
                Err(problem) => return Ok(Err(problem)),
            };
            let corner = Planes::from_rgb(&with_inverted_corner(&image, middle));
            let corner = match run_trial(graph, &corner)? {
                Ok(corner) => corner,
                Err(problem) => return Ok(Err(problem)),
            };
            farthest = farthest
                .max(farthest_moved(&before, &after, middle))
                .max(farthest_from_corner(&before, &corner, middle));
        }
        Ok(Ok(Self(farthest)))
    }

    /// Context for tiles of this height and width, in pixels; `None` if the reach exceeds a quarter of a side, so that
    /// the model counts as global.
    fn context(self, tile: [usize; 2]) -> Option<usize> {
        let quarter = tile[0].min(tile[1]) / 4;
        (self.0 <= quarter).then(|| self.0.max(MIN_CONTEXT.min(quarter)))
    }
}

/// Runs a trial; the inner error is a message about a failure of the model.
fn run_trial(graph: &Graph, planes: &Planes) -> error::Result<Result<Planes, String>> {
    graph.restart_clock();
    let why = match graph.run_planes(planes)? {
        RunResult::Output(planes) => return Ok(Ok(planes)),
        RunResult::Failed(failure) => failure.message(),
        RunResult::Unusable(_) => "gave values outside its range".to_owned(),
    };
    Ok(Err(format!("the context that a pixel needs cannot be measured: the model {why}")))
}

/// Inverts the codes of an image in the rectangle from this row and column to the bottom right corner.
fn with_inverted_corner(image: &Rgb, [top, left]: [usize; 2]) -> Rgb {
    let (mut changed, width) = (image.clone(), image.width());
    for row in changed.samples_mut().chunks_exact_mut(3 * width).skip(top) {
        for code in &mut row[3 * left..] {
            *code = 255 - *code;
        }
    }
    changed
}

/// Maximum distance, along a side, between `middle` and the changed samples.
fn farthest_moved(before: &Planes, after: &Planes, middle: [usize; 2]) -> usize {
    changed_pixels(before, after, MIN_CHANGE)
        .map(|[y, x]| y.abs_diff(middle[0]).max(x.abs_diff(middle[1])))
        .max()
        .unwrap_or(0)
}

/// Maximum distance, along a side, between the changed samples and the rectangle from `corner` to the bottom right; 0
/// if all are within it.
fn farthest_from_corner(before: &Planes, after: &Planes, corner: [usize; 2]) -> usize {
    changed_pixels(before, after, MAX_EQUAL)
        .map(|[y, x]| {
            let above = corner[0].saturating_sub(y);
            above.max(corner[1].saturating_sub(x))
        })
        .max()
        .unwrap_or(0)
}

/// Rows and columns of the samples that differ by more than `limit`; NaN does not count as different.
fn changed_pixels<'a>(before: &'a Planes, after: &'a Planes, limit: f32) -> impl Iterator<Item = [usize; 2]> + 'a {
    let (pixels, width) = (before.height * before.width, before.width);
    before.samples.iter().zip(&after.samples).enumerate().filter(move |(_, (a, b))| (*a - *b).abs() > limit).map(
        move |(index, _)| {
            let pixel = index % pixels;
            [pixel / width, pixel % width]
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of 5 × 7 pixels.
    fn small_planes(samples: Vec<f32>) -> Planes {
        Planes { height: 5, width: 7, samples }
    }

    #[test]
    fn farthest_changed_sample_counts() {
        let before = small_planes(vec![0.5; 105]);
        let mut moved = before.samples.clone();
        // A change within rounding errors; one in the second plane at row 4, column 1; one in the third at row 2,
        // column 4.
        moved[0] += 5e-7;
        moved[35 + 4 * 7 + 1] += 0.1;
        moved[70 + 2 * 7 + 4] -= 0.1;
        assert_eq!(farthest_moved(&before, &small_planes(moved), [2, 3]), 2);
        assert_eq!(farthest_moved(&before, &before, [2, 3]), 0);
        // The first sample is one row above the corner and two columns left of it.
        let mut moved = before.samples.clone();
        moved[7 + 1] += 0.01;
        moved[4 * 7 + 6] += 0.01;
        assert_eq!(farthest_from_corner(&before, &small_planes(moved), [2, 3]), 2);
    }

    #[test]
    fn corner_is_inverted() {
        let image = Rgb::new(2, 2, vec![10; 12]).unwrap();
        let changed = with_inverted_corner(&image, [1, 1]);
        assert_eq!(changed.samples()[..9], [10; 9]);
        assert_eq!(changed.samples()[9..], [245; 3]);
    }

    /// A pattern of 12 × 12 pixels, shifted by this number of pixels.
    fn shifted_pattern(shift: usize) -> Planes {
        Planes {
            height: 12,
            width: 12,
            samples: (0..144).map(|i| ((i / 12 + shift) * 7 % 5 + (i % 12 + shift) * 3 % 11) as f32).collect(),
        }
    }

    #[test]
    fn shifted_outputs_agree_in_their_interior() {
        let still = shifted_pattern(0);
        assert!(same_interior(&still, &shifted_pattern(2), 2, 3));
        assert!(!same_interior(&still, &shifted_pattern(3), 2, 3));
        assert!(!same_interior(&still, &shifted_pattern(2), 2, 6), "nothing is compared");
    }

    #[test]
    fn context_fits_into_its_tile() {
        assert_eq!(PixelReach(7).context([512, 512]), Some(8));
        assert_eq!(PixelReach(12).context([48, 64]), Some(12));
        assert_eq!(PixelReach(13).context([48, 64]), None);
        assert_eq!(PixelReach(0).context([16, 24]), Some(4));
    }
}
