//! Morphological opening of a mask, which removes thin margins: [`open_mask`].

use super::erosion::runs;

/// Opens a mask in place with a square of radius `radius`: only pixels covered by squares that are entirely within the
/// mask remain. Pixels outside the image are not in the mask, so an unlabelled border around the image is also a
/// margin.
pub(super) fn open_mask(set: &mut [bool], [width, height]: [usize; 2], radius: usize) {
    let whole = 2 * radius + 1;
    let mut streaks = vec![0_usize; width];
    // The centers of such squares, widened by the radius along their rows.
    let mut spread = vec![false; set.len()];
    for y in 0..height {
        let row = &set[y * width..][..width];
        for (left, right) in runs(row) {
            let is_long_enough = row[left] && right - left >= whole;
            let (from, to) = if is_long_enough { (left + radius, right - radius) } else { (right, right) };
            streaks[left..from].fill(0);
            streaks[to..right].fill(0);
            for streak in &mut streaks[from..to] {
                *streak += 1;
            }
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
    // Then the same along the columns: `since` is the distance to the last center above, then to the next one below.
    set.fill(false);
    for direction in [Direction::Down, Direction::Up] {
        let mut since = vec![radius + 1; width];
        for i in 0..height {
            let y = if direction == Direction::Down { i } else { height - 1 - i };
            let (centers, row) = (&spread[y * width..][..width], &mut set[y * width..][..width]);
            for ((since, center), pixel) in since.iter_mut().zip(centers).zip(row) {
                *since = if *center { 0 } else { *since + 1 };
                *pixel |= *since <= radius;
            }
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Down,
    Up,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn reference(set: &[bool], [width, height]: [usize; 2], radius: usize) -> Vec<bool> {
        let mut expected = vec![false; set.len()];
        let side = 2 * radius + 1;
        for top in 0..(height + 1).saturating_sub(side) {
            for left in 0..(width + 1).saturating_sub(side) {
                let square = (top..top + side).flat_map(|y| (left..left + side).map(move |x| y * width + x));
                if square.clone().all(|i| set[i]) {
                    square.for_each(|i| expected[i] = true);
                }
            }
        }
        expected
    }

    proptest! {
        #[test]
        fn pixels_covered_by_squares_remain(
            width in 1..16_usize, height in 1..16_usize, radius in 1..4_usize, bits in any::<u128>(), coarse in 1..6_usize,
        ) {
            let mut set: Vec<bool> = (0..width * height)
                .map(|i| {
                    let cell = i % width / coarse * 5 + i / width / coarse * 17;
                    bits >> (cell % 127) & 3 != 0
                })
                .collect();
            let expected = reference(&set, [width, height], radius);
            open_mask(&mut set, [width, height], radius);
            prop_assert_eq!(set, expected);
        }
    }
}
