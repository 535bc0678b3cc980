//! What of a set of pixels is more than a margin: [`opened`].

use super::rim::runs;

/// The opening of a set by a square of radius `radius`, in place: what the squares cover that lie wholly within it. Outside of
/// the image there is nothing of the set, so that an unlabelled frame around the picture is a margin, too.
pub(super) fn opened(set: &mut [bool], [width, height]: [usize; 2], radius: usize) {
    let whole = 2 * radius + 1;
    let mut streaks = vec![0_usize; width];
    // The centres of squares, spread along their rows.
    let mut spread = vec![false; set.len()];
    for y in 0..height {
        let row = &set[y * width..][..width];
        for (left, right) in runs(row) {
            let held = row[left] && right - left >= whole;
            let (from, to) = if held {
                (left + radius, right - radius)
            } else {
                (right, right)
            };
            streaks[left..from].fill(0);
            streaks[to..right].fill(0);
            streaks[from..to].iter_mut().for_each(|streak| *streak += 1);
        }
        let Some(center) = y.checked_sub(radius) else {
            continue;
        };
        let row = &mut spread[center * width..][..width];
        let mut filled = 0;
        for (x, streak) in streaks.iter().enumerate() {
            if *streak >= whole {
                row[filled.max(x - radius)..=x + radius].fill(true);
                filled = x + radius + 1;
            }
        }
    }
    // Then along the columns: how far it is to the last centre above, then to the next below.
    set.fill(false);
    for rows in [RowRange::Down, RowRange::Up] {
        let mut since = vec![radius + 1; width];
        for i in 0..height {
            let y = if rows == RowRange::Down {
                i
            } else {
                height - 1 - i
            };
            let (centers, row) = (
                &spread[y * width..][..width],
                &mut set[y * width..][..width],
            );
            for ((since, center), pixel) in since.iter_mut().zip(centers).zip(row) {
                *since = if *center { 0 } else { *since + 1 };
                *pixel |= *since <= radius;
            }
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum RowRange {
    Down,
    Up,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn plainly(set: &[bool], [width, height]: [usize; 2], radius: usize) -> Vec<bool> {
        let mut out = vec![false; set.len()];
        let side = 2 * radius + 1;
        for top in 0..(height + 1).saturating_sub(side) {
            for left in 0..(width + 1).saturating_sub(side) {
                let square = || {
                    (top..top + side).flat_map(|y| (left..left + side).map(move |x| y * width + x))
                };
                if square().all(|i| set[i]) {
                    square().for_each(|i| out[i] = true);
                }
            }
        }
        out
    }

    proptest! {
        #[test]
        fn what_squares_cover_stays(
            width in 1..16_usize, height in 1..16_usize, radius in 1..4_usize, bits in any::<u128>(), coarse in 1..6_usize,
        ) {
            let mut set: Vec<bool> = (0..width * height)
                .map(|i| {
                    let cell = i % width / coarse * 5 + i / width / coarse * 17;
                    bits >> (cell % 127) & 3 != 0
                })
                .collect();
            let expected = plainly(&set, [width, height], radius);
            opened(&mut set, [width, height], radius);
            prop_assert_eq!(set, expected);
        }
    }
}
