//! Erosion of all masks of an image in one pass: [`cores`].

/// Calls `visit(y, left, right, mask)`, row by row, for every run of pixels whose square of radius `radius` is within
/// their own mask. Masks continue beyond the edge of the image, because depth has no flying pixels there. Mask 0 is
/// skipped.
///
/// Each run of a row is shortened by the radius. For each column, `streaks` counts the consecutive rows in which the
/// column was inside such a shortened run of the same mask.
pub(super) fn cores(
    masks: &[u32],
    [width, height]: [usize; 2],
    radius: usize,
    mut visit: impl FnMut(usize, usize, usize, u32),
) {
    let whole = 2 * radius as u32 + 1;
    let mut streaks = vec![0_u32; width];
    // Above the first row and below the last row, the masks of these rows continue.
    for y in 0..height + radius {
        if y < height {
            let row = &masks[y * width..][..width];
            let above = (y > 0).then(|| &masks[(y - 1) * width..][..width]);
            for (left, right) in runs(row) {
                let (from, to) = (
                    if left == 0 { 0 } else { left + radius },
                    if right == width { width } else { right.saturating_sub(radius) },
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

/// Runs of equal values of a row, as left and right (exclusive).
pub(super) fn runs<T: PartialEq>(row: &[T]) -> impl Iterator<Item = (usize, usize)> {
    let mut left = 0;
    std::iter::from_fn(move || {
        let run = (left, left + run_length(row.get(left..)?)?);
        left = run.1;
        Some(run)
    })
}

/// Number of equal values at the start; `None` if the list is empty.
fn run_length<T: PartialEq>(values: &[T]) -> Option<usize> {
    /// Number of values compared without a branch, so that the compiler can use SIMD.
    const LANES: usize = 32;
    let first = values.first()?;
    let count_different = |lanes: &[T; LANES]| -> u32 { lanes.iter().map(|value| u32::from(value != first)).sum() };
    let (chunks, _) = values.as_chunks::<LANES>();
    let whole = LANES * chunks.iter().take_while(|lanes| count_different(lanes) == 0).count();
    let rest = values[whole..].iter().take_while(|value| *value == first).count();
    Some(whole + rest)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The core mask of each pixel, computed pixel by pixel.
    fn reference(masks: &[u32], [width, height]: [usize; 2], radius: usize) -> Vec<u32> {
        (0..width * height)
            .map(|i| {
                let (x, y) = (i % width, i / width);
                let columns = x.saturating_sub(radius)..=(x + radius).min(width - 1);
                let mut rows = y.saturating_sub(radius)..=(y + radius).min(height - 1);
                let is_core = rows.all(|y| columns.clone().all(|x| masks[y * width + x] == masks[i]));
                if is_core { masks[i] } else { 0 }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn cores_match_reference(
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
            prop_assert_eq!(found, reference(&masks, [width, height], radius));
        }
    }
}
