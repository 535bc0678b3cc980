//! How far a pixel of a model's output depends on the image around it, by trial: [`Reach`], [`Context`].
//!
//! One pixel in the middle of a trial image is changed by one code. The farthest sample of the output that moves shows the
//! reach: 7 pixels for Zero-DCE, as its seven 3 × 3 convolutions imply. A mean of the whole image moves too little with one pixel
//! (2 · 10⁻⁷ for BrightsightNet at 512 × 512), so a quarter of the image is inverted, too, and counts if it moves what is far from it.

use super::size_plan::SizeRule;
use super::texture::{CODES, texture};
use crate::conventions::Locality;
use crate::graphs::{Graph, RunResult};
use crate::planes::Planes;
use darkqa_ground::error;
use darkqa_ground::types::Rgb;

/// Difference of an output of 0..1 that counts as movement; above the last bits of 32-bit floats, below a thousandth of a
/// code. Chosen.
const MIN_CHANGE: f32 = 1e-6;

/// Least context of a tile, in pixels, where a tile has room for it: some pixels more than most models need. Chosen.
const MIN_CONTEXT: usize = 8;

/// Side of the trial image where the model takes any, in pixels; chosen.
pub(crate) const FREE_SIDE: usize = 128;

/// Steps of pixels that tiles may have to start at, the smallest first: networks that halve an image up to five times.
const ALIGNMENTS: [usize; 16] = [1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32];

/// Largest difference of outputs of 0..1 that count as the same; a tenth of a code. Chosen: above the rounding of other sums.
const MAX_EQUAL: f32 = 4e-4;

/// Context and alignment of the tiles of a model, measured once if nothing states them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Context {
    reach: Option<Result<Reach, String>>,
    /// Tiles start at multiples of this number of pixels.
    alignment: Option<usize>,
}

impl Context {
    /// Measures the context in pixels; the inner error explains why the model counts as global.
    pub(crate) fn measure(
        &mut self,
        graph: &Graph,
        rule: SizeRule,
    ) -> error::Result<Result<usize, String>> {
        match rule.tile {
            Some(Locality::Exact(context)) => return Ok(Ok(context)),
            Some(Locality::Global) => {
                return Ok(Err(
                    "it needs the whole image (tile = \"none\" in MODEL.onnx.toml or the preset)"
                        .to_owned(),
                ));
            }
            None => {}
        }
        let size = rule.run_size([FREE_SIDE; 2]);
        if self.reach.is_none() {
            self.reach = Some(Reach::probe(graph, size)?);
            graph.restart_clock();
        }
        let reach = self.reach.clone().unwrap_or_else(|| Err(String::new()));
        Ok(reach.and_then(|reach| {
            reach.context(size).ok_or_else(|| {
                format!(
                    "a pixel depends on others {} pixels away, which is more than a quarter of the size",
                    reach.0
                )
            })
        }))
    }

    /// The measured reach in pixels; `None` if it was not measured.
    pub(crate) fn reach(&self) -> Option<usize> {
        let reach = self.reach.as_ref()?.as_ref().ok()?;
        Some(reach.0)
    }

    /// Whether the alignment was not measured yet.
    pub(crate) fn lacks_alignment(&self) -> bool {
        self.alignment.is_none()
    }

    /// Multiple at which tiles of this height and width must start to equal the whole image: 2 to the power of the number of poolings. 1 if
    /// none is found; the comparison of seams then decides.
    pub(crate) fn measure_alignment(
        &mut self,
        graph: &Graph,
        tile: [usize; 2],
        context: usize,
    ) -> error::Result<usize> {
        if let Some(alignment) = self.alignment {
            return Ok(alignment);
        }
        let found = find_alignment(graph, tile, context)?.unwrap_or(1);
        graph.restart_clock();
        self.alignment = Some(found);
        Ok(found)
    }
}

/// The smallest of [`ALIGNMENTS`] by which an image may be moved without a change of the result, farther than the context from its
/// edges; `None` if there is none.
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

/// The part of an image that begins at this row and column.
fn crop(scene: &Rgb, [height, width]: [usize; 2], start: usize) -> Planes {
    let mut part = Rgb::black(height, width);
    let rows = scene.samples().chunks_exact(3 * scene.width()).skip(start);
    let lines = part.samples_mut().chunks_exact_mut(3 * width);
    for (line, row) in lines.zip(rows) {
        line.copy_from_slice(&row[3 * start..][..3 * width]);
    }
    Planes::from_rgb(&part)
}

/// Whether an output and that of the moved image agree where both are farther than `margin` from their edges.
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
                    let at = |row: usize, column: usize| channel * plane + row * width + column;
                    let was = still.samples[at(row + shift, column + shift)];
                    let is = moved.samples[at(row, column)];
                    (was - is).abs() <= MAX_EQUAL
                })
            })
        })
}

/// Farthest pixels, along a side, on which a pixel of the output depends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reach(usize);

impl Reach {
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

    /// Context that tiles of such sides need, in pixels; `None` if the reach is more than a quarter of a tile, so that the
    /// model counts as global.
    fn context(self, tile: [usize; 2]) -> Option<usize> {
        let quarter = tile[0].min(tile[1]) / 4;
        (self.0 <= quarter).then(|| self.0.max(MIN_CONTEXT.min(quarter)))
    }
}

/// Output of a trial; the inner error explains why it failed.
fn run_trial(graph: &Graph, planes: &Planes) -> error::Result<Result<Planes, String>> {
    graph.restart_clock();
    let unmeasured = |why: &str| {
        Err(format!(
            "the context that a pixel needs cannot be measured: the model {why}"
        ))
    };
    Ok(match graph.run_planes(planes)? {
        RunResult::Output(planes) => Ok(planes),
        RunResult::Failed(failure) => unmeasured(&failure.message()),
        RunResult::Unusable(_) => unmeasured("gave values outside its range"),
    })
}

/// The image with inverted codes from this row and column on.
fn with_inverted_corner(image: &Rgb, [top, left]: [usize; 2]) -> Rgb {
    let (mut changed, width) = (image.clone(), image.width());
    for row in changed.samples_mut().chunks_exact_mut(3 * width).skip(top) {
        for code in &mut row[3 * left..] {
            *code = 255 - *code;
        }
    }
    changed
}

/// Distance, along a side, of the farthest sample that differs from `middle`.
fn farthest_moved(before: &Planes, after: &Planes, middle: [usize; 2]) -> usize {
    changed_pixels(before, after, MIN_CHANGE)
        .map(|[y, x]| y.abs_diff(middle[0]).max(x.abs_diff(middle[1])))
        .max()
        .unwrap_or(0)
}

/// Distance, along a side, of the farthest sample that differs from the rows and columns from `corner` on; 0 if all are in them.
fn farthest_from_corner(before: &Planes, after: &Planes, corner: [usize; 2]) -> usize {
    changed_pixels(before, after, MAX_EQUAL)
        .map(|[y, x]| {
            let above = corner[0].saturating_sub(y);
            above.max(corner[1].saturating_sub(x))
        })
        .max()
        .unwrap_or(0)
}

/// Rows and columns of the samples that differ by more than `limit`; two NaNs do not differ.
fn changed_pixels<'a>(
    before: &'a Planes,
    after: &'a Planes,
    limit: f32,
) -> impl Iterator<Item = [usize; 2]> + 'a {
    let (pixels, width) = (before.height * before.width, before.width);
    before
        .samples
        .iter()
        .zip(&after.samples)
        .enumerate()
        .filter(move |(_, (a, b))| (*a - *b).abs() > limit)
        .map(move |(index, _)| {
            let pixel = index % pixels;
            [pixel / width, pixel % width]
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farthest_moved_sample_counts() {
        let planes = |samples: Vec<f32>| Planes {
            height: 5,
            width: 7,
            samples,
        };
        let before = planes(vec![0.5; 105]);
        let mut moved = before.samples.clone();
        // Within the last bits; in the second plane, row 4, column 1; in the third, row 2, column 4.
        moved[0] += 5e-7;
        moved[35 + 4 * 7 + 1] += 0.1;
        moved[70 + 2 * 7 + 4] -= 0.1;
        assert_eq!(farthest_moved(&before, &planes(moved), [2, 3]), 2);
        assert_eq!(farthest_moved(&before, &before, [2, 3]), 0);
        // The first sample is one row above the corner and two columns left of it.
        let mut moved = before.samples.clone();
        moved[7 + 1] += 0.01;
        moved[4 * 7 + 6] += 0.01;
        assert_eq!(farthest_from_corner(&before, &planes(moved), [2, 3]), 2);
    }

    #[test]
    fn a_corner_is_inverted_from_its_row_and_column_on() {
        let image = Rgb::new(2, 2, vec![10; 12]).unwrap();
        let changed = with_inverted_corner(&image, [1, 1]);
        assert_eq!(changed.samples()[..9], [10; 9]);
        assert_eq!(changed.samples()[9..], [245; 3]);
    }

    #[test]
    fn an_output_that_moves_with_the_image_is_the_same() {
        let planes = |phase: usize| Planes {
            height: 12,
            width: 12,
            samples: (0..144)
                .map(|i| ((i / 12 + phase) * 7 % 5 + (i % 12 + phase) * 3 % 11) as f32)
                .collect(),
        };
        assert!(same_interior(&planes(0), &planes(2), 2, 3));
        assert!(!same_interior(&planes(0), &planes(3), 2, 3));
        assert!(
            !same_interior(&planes(0), &planes(2), 2, 6),
            "nothing is compared"
        );
    }

    #[test]
    fn a_context_has_room_in_its_tile() {
        assert_eq!(Reach(7).context([512, 512]), Some(8));
        assert_eq!(Reach(12).context([48, 64]), Some(12));
        assert_eq!(Reach(13).context([48, 64]), None);
        assert_eq!(Reach(0).context([16, 24]), Some(4));
    }
}
