//! How far a pixel of a model's output depends on the image around it, by trial: [`Reach`], [`Context`].
//!
//! One pixel in the middle of a trial image is changed by one code. The farthest sample of the output that moves shows the
//! reach: 7 pixels for Zero-DCE, as its seven 3 × 3 convolutions imply; the whole image for a model that takes a mean of it.

use super::convention::Tile;
use super::graph::{Graph, RunResult};
use super::planes::Planes;
use super::size_plan::SizeRule;
use super::texture::{CODES, texture};
use darkqa_ground::error;

/// Difference of an output of 0..1 that counts as movement; above the last bits of 32-bit floats, below a thousandth of a
/// code. Chosen.
const MOVED: f32 = 1e-6;

/// Least context of a tile, in pixels, where a tile has room for it: some pixels more than most models need. Chosen.
const LEAST_CONTEXT: usize = 8;

/// Side of the trial image where the model takes any, in pixels; chosen.
const FREE_SIDE: usize = 128;

/// Context of the tiles of a model of a fixed size, measured once if nothing states it.
#[derive(Debug, Clone, Default)]
pub(super) struct Context(Option<Result<Reach, String>>);

impl Context {
    /// The context in pixels; the inner error says why the model counts as global.
    pub(super) fn of(
        &mut self,
        graph: &Graph,
        rule: SizeRule,
    ) -> error::Result<Result<usize, String>> {
        match rule.tile {
            Some(Tile::Exact(context)) => return Ok(Ok(context)),
            Some(Tile::None) => {
                return Ok(Err(
                    "it needs the whole image (tile = \"none\" in its sidecar or preset)"
                        .to_owned(),
                ));
            }
            None => {}
        }
        let size = rule.whole([FREE_SIDE; 2]);
        if self.0.is_none() {
            self.0 = Some(Reach::probe(graph, size)?);
            graph.restart_clock();
        }
        let reach = self.0.clone().unwrap_or_else(|| Err(String::new()));
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
    pub(super) fn reach(&self) -> Option<usize> {
        let reach = self.0.as_ref()?.as_ref().ok()?;
        Some(reach.0)
    }
}

/// Farthest pixels, along a side, on which a pixel of the output depends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reach(usize);

impl Reach {
    /// Reach of a model, measured at one size (height, width); the inner error says why it cannot be.
    fn probe(graph: &Graph, size: [usize; 2]) -> error::Result<Result<Self, String>> {
        let mut farthest = 0;
        for codes in &CODES {
            let mut image = texture(size, codes);
            let before = match output(graph, &Planes::of(&image))? {
                Ok(before) => before,
                Err(problem) => return Ok(Err(problem)),
            };
            let middle = size.map(|side| side / 2);
            let at = 3 * (middle[0] * size[1] + middle[1]);
            for sample in &mut image.samples_mut()[at..at + 3] {
                *sample += 1;
            }
            let after = match output(graph, &Planes::of(&image))? {
                Ok(after) => after,
                Err(problem) => return Ok(Err(problem)),
            };
            farthest = farthest.max(farthest_moved(&before, &after, middle));
        }
        Ok(Ok(Self(farthest)))
    }

    /// Context that tiles of such sides need, in pixels; `None` if the reach is more than a quarter of a tile, so that the
    /// model counts as global.
    fn context(self, tile: [usize; 2]) -> Option<usize> {
        let quarter = tile[0].min(tile[1]) / 4;
        (self.0 <= quarter).then(|| self.0.max(LEAST_CONTEXT.min(quarter)))
    }
}

/// Output of a trial; the inner error says why there is none.
fn output(graph: &Graph, planes: &Planes) -> error::Result<Result<Planes, String>> {
    graph.restart_clock();
    let unmeasured = |why: &str| Err(format!("how far it looks cannot be measured: it {why}"));
    Ok(match graph.planes(planes)? {
        RunResult::Output(planes) => Ok(planes),
        RunResult::Failed(failure) => unmeasured(&failure.words()),
        RunResult::Unusable(_) => unmeasured("gave values that are not those of an image"),
    })
}

/// Distance, along a side, of the farthest sample that differs from `middle`.
fn farthest_moved(before: &Planes, after: &Planes, middle: [usize; 2]) -> usize {
    let pairs = before.samples.iter().zip(&after.samples);
    let moved = pairs.enumerate().filter(|(_, (a, b))| {
        // Of two values that are not numbers neither has moved.
        (*a - *b).abs() > MOVED
    });
    let pixels = before.height * before.width;
    let distances = moved.map(|(index, _)| {
        let pixel = index % pixels;
        let (y, x) = (pixel / before.width, pixel % before.width);
        y.abs_diff(middle[0]).max(x.abs_diff(middle[1]))
    });
    distances.max().unwrap_or(0)
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
    }

    #[test]
    fn a_context_has_room_in_its_tile() {
        assert_eq!(Reach(7).context([512, 512]), Some(8));
        assert_eq!(Reach(12).context([48, 64]), Some(12));
        assert_eq!(Reach(13).context([48, 64]), None);
        assert_eq!(Reach(0).context([16, 24]), Some(4));
    }
}
