//! The inner part of every mask at once: [`cores`].

/// Calls `visit(y, left, right, mask)` for every run of pixels whose square of radius `radius` lies within their own mask,
/// row by row; the image's edge is no rim, for nothing flies there. Mask 0 is none.
///
/// One pass: a run of a row keeps its middle, and a column counts for how many rows it has been in the middle of one mask.
pub(super) fn cores(
    masks: &[u32],
    [width, height]: [usize; 2],
    radius: usize,
    mut visit: impl FnMut(usize, usize, usize, u32),
) {
    let whole = 2 * radius as u32 + 1;
    let mut streaks = vec![0_u32; width];
    // Above the first row and below the last the mask goes on as it is there.
    for y in 0..height + radius {
        if y < height {
            let row = &masks[y * width..][..width];
            let above = (y > 0).then(|| &masks[(y - 1) * width..][..width]);
            for (left, right) in runs(row) {
                let (from, to) = (
                    if left == 0 { 0 } else { left + radius },
                    if right == width {
                        width
                    } else {
                        right.saturating_sub(radius)
                    },
                );
                let (from, to) = (from.min(right), to.max(from.min(right)));
                streaks[left..from].fill(0);
                streaks[to..right].fill(0);
                let streaks = &mut streaks[from..to];
                match above {
                    None => streaks.fill(radius as u32 + 1),
                    Some(above) => {
                        for (streak, above) in streaks.iter_mut().zip(&above[from..to]) {
                            *streak = if *above == row[left] { *streak + 1 } else { 1 };
                        }
                    }
                }
            }
        } else {
            for streak in streaks.iter_mut().filter(|streak| **streak > 0) {
                *streak += 1;
            }
        }
        let Some(center) = y.checked_sub(radius) else {
            continue;
        };
        let row = &masks[center * width..][..width];
        let mut x = 0;
        while x < width {
            if streaks[x] < whole || row[x] == 0 {
                x += 1;
                continue;
            }
            let left = x;
            while x < width && streaks[x] >= whole && row[x] == row[left] {
                x += 1;
            }
            visit(center, left, x, row[left]);
        }
    }
}

/// The runs of equal values of a row, as left and right, the latter exclusive.
pub(super) fn runs<T: PartialEq>(row: &[T]) -> impl Iterator<Item = (usize, usize)> {
    let mut left = 0;
    std::iter::from_fn(move || {
        let run = (left, left + streak(row.get(left..)?)?);
        left = run.1;
        Some(run)
    })
}

/// How many values at the front are the same; `None` where there are none.
fn streak<T: PartialEq>(values: &[T]) -> Option<usize> {
    /// Compared at once, without a way out between.
    const LANES: usize = 32;
    let first = values.first()?;
    let strangers = |lanes: &[T; LANES]| -> u32 {
        let strange = lanes.iter().map(|value| u32::from(value != first));
        strange.sum()
    };
    let (chunks, _) = values.as_chunks::<LANES>();
    let whole = LANES
        * chunks
            .iter()
            .take_while(|lanes| strangers(lanes) == 0)
            .count();
    let rest = values[whole..].iter();
    Some(whole + rest.take_while(|value| *value == first).count())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The same, pixel by pixel.
    fn plainly(masks: &[u32], [width, height]: [usize; 2], radius: usize) -> Vec<u32> {
        let at = |x: usize, y: usize| masks[y * width + x];
        let whole = |x: usize, y: usize| {
            let rows = y.saturating_sub(radius)..=(y + radius).min(height - 1);
            rows.flat_map(|j| {
                (x.saturating_sub(radius)..=(x + radius).min(width - 1)).map(move |i| (i, j))
            })
            .all(|(i, j)| at(i, j) == at(x, y))
        };
        (0..width * height)
            .map(|i| {
                if whole(i % width, i / width) {
                    masks[i]
                } else {
                    0
                }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn cores_are_what_they_are(
            width in 1..14_usize, height in 1..14_usize, radius in 0..4_usize, bits in any::<u64>(), coarse in 1..5_usize,
        ) {
            let masks: Vec<u32> = (0..width * height)
                .map(|i| {
                    let cell = i % width / coarse * 7 + i / width / coarse * 13;
                    (bits >> (cell % 62) & 3) as u32
                })
                .collect();
            let mut found = vec![0; width * height];
            cores(&masks, [width, height], radius, |y, left, right, mask| {
                found[y * width + left..y * width + right].fill(mask);
            });
            prop_assert_eq!(found, plainly(&masks, [width, height], radius));
        }
    }
}
