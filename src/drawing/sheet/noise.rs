//! The terms of the noise model as separate images: [`noise()`].

use ndarray::Array2;

use super::{CELL, GAP, LINE, SheetCanvas, lines};
use crate::types::Rgb;

/// One noise term on the sensor.
#[derive(Debug, Clone)]
pub(crate) struct Signal {
    /// Label of the image.
    pub name: String,
    /// Values in ADU, height × width.
    pub adu: Array2<f32>,
}

/// A sheet with the middle of each signal at full resolution around mid grey, with its mean and standard deviation, which are
/// those of the whole signal.
///
/// Black is three standard deviations below the mean, and white three above it. So all signals look alike, and each has its own scale
/// in ADU beside it. `foot` stands below them.
#[must_use]
pub(crate) fn noise(signals: &[Signal], foot: &str) -> Rgb {
    const COLUMNS: usize = 3;
    let side = |length: fn(&Array2<f32>) -> usize, max: usize| {
        signals
            .iter()
            .map(|signal| length(&signal.adu))
            .min()
            .unwrap_or(1)
            .min(max)
    };
    let (height, width) = (side(Array2::nrows, CELL * 3 / 4), side(Array2::ncols, CELL));
    let step = [GAP + 3 * LINE + height, GAP + CELL];
    let below = signals.len().div_ceil(COLUMNS) * step[0] + GAP;
    let sheet_width = COLUMNS * step[1] + GAP;
    let foot = lines(foot, sheet_width.saturating_sub(2 * GAP));
    let mut sheet = SheetCanvas::new(below + foot.len() * LINE + GAP, sheet_width);
    for (index, signal) in signals.iter().enumerate() {
        let top = GAP + index / COLUMNS * step[0];
        let left = GAP + index % COLUMNS * step[1];
        let [mean, deviation] = moments(&signal.adu);
        sheet.write([top, left], CELL, &signal.name, [0; 3]);
        let numbers = format!("mean {mean:.3}, std {deviation:.3} ADU");
        sheet.write([top + LINE, left], CELL, &numbers, [0; 3]);
        let reach = 3.0 * deviation;
        let ends = format!("black {:.3}, white {:.3} ADU", mean - reach, mean + reach);
        sheet.write([top + 2 * LINE, left], CELL, &ends, [90; 3]);
        let first = [
            (signal.adu.nrows() - height) / 2,
            (signal.adu.ncols() - width) / 2,
        ];
        let scale = if deviation > 0.0 { 127.5 / reach } else { 0.0 };
        sheet.fill([top + 3 * LINE, left], [height, width], |row, column| {
            let value = f64::from(signal.adu[[first[0] + row, first[1] + column]]);
            [(127.5 + (value - mean) * scale).round().clamp(0.0, 255.0) as u8; 3]
        });
    }
    for (line, text) in foot.iter().enumerate() {
        sheet.write([below + line * LINE, GAP], sheet_width, text, [90; 3]);
    }
    sheet.finish()
}

/// Mean and standard deviation of a signal, in ADU.
fn moments(adu: &Array2<f32>) -> [f64; 2] {
    let n = adu.len().max(1) as f64;
    let mean = adu.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
    let variance = adu
        .iter()
        .map(|x| (f64::from(*x) - mean).powi(2))
        .sum::<f64>()
        / n;
    [mean, variance.sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_deviations_are_black_and_white() {
        let adu = Array2::from_shape_fn((8, 8), |(row, _)| if row % 2 == 0 { 1.0 } else { 3.0 });
        let [mean, deviation] = moments(&adu);
        assert!((mean - 2.0).abs() < 1e-9 && (deviation - 1.0).abs() < 1e-9);
        let name = "row".to_owned();
        let sheet = noise(&[Signal { name, adu }], "");
        let has = |code: u8| sheet.samples().contains(&code);
        assert!(has(85) && has(170));
    }

    #[test]
    fn flat_and_tiny_signals_are_grey() {
        let signal = |size| Signal {
            name: "a name that is longer than its place on the sheet is".to_owned(),
            adu: Array2::zeros(size),
        };
        let sheet = noise(
            &[
                signal((1, 1)),
                signal((500, 2)),
                signal((2, 500)),
                signal((9, 9)),
            ],
            "sony-a7s2, seed 0",
        );
        assert!(sheet.samples().contains(&128));
        assert_eq!(noise(&[], "").width(), 3 * (GAP + CELL) + GAP);
    }
}
