use super::*;
use crate::commands::calibrate::frames::Cfa;

const BAYER: Layout = Layout { cfa: Cfa::Rggb, height: 64, width: 48 };

/// Pseudorandom numbers from 0 to 2³² − 1.
struct Numbers(u64);

impl Iterator for Numbers {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        Some((self.0 >> 32) as u32)
    }
}

/// Frame of codes around `level`, uniformly distributed over 2 · `spread` + 1 codes.
fn frame(layout: Layout, seed: u64, level: u16, spread: u32) -> Vec<u16> {
    Numbers(seed)
        .take(layout.height * layout.width)
        .map(|number| level + (number % (2 * spread + 1)) as u16 - spread as u16)
        .collect()
}

/// Noise by its definition, with loops over sites, for a pair of frames without hot pixels.
fn noise_by_sites(layout: Layout, a: &[u16], b: &[u16]) -> [f64; 2] {
    let planes = layout.cfa.planes();
    let mut d: Vec<f64> = a.iter().zip(b).map(|(a, b)| f64::from(*a) - f64::from(*b)).collect();
    for wanted in 0..planes {
        let sites: Vec<usize> = (0..d.len())
            .filter(|site| {
                let (row, column) = (site / layout.width, site % layout.width);
                layout.cfa.plane(row, column % layout.cfa.step()) == wanted
            })
            .collect();
        let mean = sites.iter().map(|site| d[*site]).sum::<f64>() / sites.len() as f64;
        for site in &sites {
            d[*site] -= mean;
        }
    }
    let (mut within, mut means) = (0.0, Vec::new());
    for row in d.chunks(layout.width) {
        let mean = row.iter().sum::<f64>() / layout.width as f64;
        within += row.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
        means.push(mean);
    }
    let step = layout.cfa.step();
    let free = d.len() - layout.height - (planes - step);
    let within = within / free as f64 / 2.0;
    let row = means.iter().map(|mean| mean * mean).sum::<f64>() / (layout.height - step) as f64;
    [within, row / 2.0 - within / layout.width as f64]
}

#[test]
fn noise_matches_its_definition() {
    for cfa in [Cfa::Rggb, Cfa::Mono] {
        let layout = Layout { cfa, ..BAYER };
        let (a, b) = (frame(layout, 1, 500, 9), frame(layout, 2, 510, 9));
        let hot = HotPixels::none(layout.plane_rows());
        let found = PairSums::new(layout, [&a, &b], &hot).noise();
        let [within, row] = noise_by_sites(layout, &a, &b);
        assert!((found.within - within).abs() < 1e-9 * within, "{cfa}");
        assert!((found.row - row).abs() < 1e-9, "{cfa}");
        // Uniform over 19 codes: the variance is (19² − 1) / 12 = 30.
        assert!((found.within - 30.0).abs() < 2.0, "{}", found.within);
    }
}

/// A fixed pattern has no effect, and offsets of whole rows only affect the row noise.
#[test]
fn fixed_pattern_cancels_and_rows_are_row_noise() {
    let hot = HotPixels::none(BAYER.plane_rows());
    let (a, b) = (frame(BAYER, 3, 500, 9), frame(BAYER, 4, 500, 9));
    let plain = PairSums::new(BAYER, [&a, &b], &hot).noise();
    let pattern = frame(BAYER, 5, 1000, 400);
    let with = |frame: &[u16]| -> Vec<u16> { frame.iter().zip(&pattern).map(|(a, b)| a + b).collect() };
    let fixed = PairSums::new(BAYER, [&with(&a), &with(&b)], &hot).noise();
    assert_eq!(plain, fixed);
    let rows: Vec<u16> = b
        .chunks(BAYER.width)
        .zip(Numbers(6))
        .flat_map(|(row, number)| row.iter().map(move |code| code + (number % 20) as u16))
        .collect();
    let shifted = PairSums::new(BAYER, [&a, &rows], &hot).noise();
    assert!((shifted.within - plain.within).abs() < 1e-9);
    // Uniform over 20 codes in one of the two frames: variance 33.25.
    assert!((shifted.row - plain.row - 33.25 / 2.0).abs() < 5.0);
}

#[test]
fn hot_pixels_are_left_out() {
    let (mut a, b) = (frame(BAYER, 7, 500, 9), frame(BAYER, 8, 500, 9));
    let columns: Vec<Vec<u32>> = (0..BAYER.plane_rows())
        .map(|plane_row| match plane_row {
            0 => vec![0, 1, 2],
            5 => vec![9, 11, 23],
            _ => Vec::new(),
        })
        .collect();
    let hot = HotPixels::new(columns);
    let clean = PairSums::new(BAYER, [&a, &b], &hot);
    let (tiles, noise) = (clean.tiles(), clean.noise());
    for plane_row in [0, 5] {
        let [row, parity] = BAYER.place(plane_row);
        for column in hot.columns(plane_row) {
            a[row * BAYER.width + 2 * column + parity] = 60_000;
        }
    }
    let spoiled = PairSums::new(BAYER, [&a, &b], &hot);
    assert_eq!(spoiled.tiles(), tiles);
    assert_eq!(spoiled.noise(), noise);
    let [spoiled, clean] = [spoiled, clean].map(|sums| sums.neighbours().correlation(&[1.0; 4]));
    assert!((spoiled - clean).abs() < 1e-15);
    // Control: without the mask, hot pixels do affect the sums.
    let unmasked = PairSums::new(BAYER, [&a, &b], &HotPixels::none(BAYER.plane_rows()));
    assert!(unmasked.noise().within > 1000.0 * noise.within);
    assert_eq!(hot.count(), 6);
}

#[test]
fn smoothing_causes_correlation() {
    let layout = Layout { height: 256, width: 256, ..BAYER };
    let hot = HotPixels::none(layout.plane_rows());
    let frames = [9, 10].map(|seed| frame(layout, seed, 500, 90));
    let smoothed: [Vec<u16>; 2] = [0, 1].map(|i: usize| {
        frames[i]
            .chunks(layout.width)
            .flat_map(|row| (0..row.len()).map(|x| row[x].midpoint(row[(x + 2) % row.len()])))
            .collect()
    });
    let [plain, smoothed] = [frames, smoothed].map(|[a, b]| {
        let sums = PairSums::new(layout, [&a, &b], &hot);
        sums.neighbours().correlation(&[1.0; 4])
    });
    assert!(plain.abs() < 0.015, "{plain}");
    assert!((smoothed - 0.5).abs() < 0.02, "{smoothed}");
}

#[test]
fn tiles_have_local_light_and_noise() {
    let hot = HotPixels::none(BAYER.plane_rows());
    let mut lit = [frame(BAYER, 11, 500, 9), frame(BAYER, 12, 500, 9)];
    // The lower right tile of green in red rows is brighter.
    for frame in &mut lit {
        for row in (56..64).step_by(2) {
            for column in (43..48).step_by(2) {
                frame[row * BAYER.width + column] += 300;
            }
        }
    }
    let tiles = PairSums::new(BAYER, [&lit[0], &lit[1]], &hot).tiles();
    assert_eq!(tiles.len(), 4 * TILES * TILES);
    for (index, tile) in tiles.iter().enumerate() {
        // Four rows of three sites; each row has its own mean.
        assert_eq!((tile.plane, tile.count, tile.free), (index / 64, 12.0, 8.0));
        let level = if index == 127 { 800.0 } else { 500.0 };
        assert!((tile.mean() - level).abs() < 5.0, "{index}: {}", tile.mean());
    }
    let variance = mean_variance(&tiles, 1.0);
    assert!((variance - 30.0).abs() < 2.0, "{variance}");
    // Row offsets do not change the variance.
    let shifted: [Vec<u16>; 2] = [(&lit[0], 13), (&lit[1], 14)].map(|(frame, seed)| {
        frame
            .chunks(BAYER.width)
            .zip(Numbers(seed))
            .flat_map(|(row, number)| row.iter().map(move |code| code + (number % 90) as u16))
            .collect()
    });
    let shifted = PairSums::new(BAYER, [&shifted[0], &shifted[1]], &hot).tiles();
    for (tile, shifted) in tiles.iter().zip(&shifted) {
        assert!((tile.variance(1.0) - shifted.variance(1.0)).abs() < 1e-6);
    }
}

fn mean_variance(tiles: &[TileSums], ratio: f64) -> f64 {
    tiles.iter().map(|tile| tile.variance(ratio)).sum::<f64>() / tiles.len() as f64
}

/// Two frames with the same pattern of light, the second with 5 % more light. With the ratio of their light the pattern
/// does not affect the variance and the correlation of neighbours; without the ratio it does.
#[test]
fn light_patterns_cancel_with_the_ratio_of_light() {
    let layout = Layout { height: 256, width: 256, ..BAYER };
    let hot = HotPixels::none(layout.plane_rows());
    let [a, b]: [Vec<u16>; 2] = [(15, 1.0), (16, 1.05)].map(|(seed, factor)| {
        frame(layout, seed, 500, 9)
            .into_iter()
            .enumerate()
            .map(|(site, code)| {
                let light = 4000.0 + 20.0 * (site % layout.width) as f64;
                code + (factor * light).round() as u16
            })
            .collect()
    });
    let sums = PairSums::new(layout, [&a, &b], &hot);
    let (tiles, neighbours) = (sums.tiles(), sums.neighbours());
    let ratio = 1.0 / 1.05;
    let [equal, unequal] = [ratio, 1.0].map(|ratio| mean_variance(&tiles, ratio));
    // Unlike shot noise, the noise of both frames is equal here: 30 · (1 + ratio²) / (2 ratio) = 30.04.
    assert!((equal - 30.0).abs() < 0.6, "{equal}");
    assert!(unequal > 1.5 * equal, "{unequal}");
    let [equal, unequal] = [ratio, 1.0].map(|ratio| neighbours.correlation(&[ratio; 4]));
    assert!(equal.abs() < 0.015 && unequal > 0.5, "{equal}, {unequal}");
}
