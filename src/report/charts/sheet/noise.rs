//! Figure of the noise terms, one image for each: [`noise()`].

use ndarray::Array2;

use super::{CELL, GAP, LINE, SheetCanvas, lines};
use crate::types::Rgb;

/// Noise term on the sensor.
#[derive(Debug, Clone)]
pub(crate) struct Signal {
    /// Label of the image.
    pub name: String,
    /// Values in ADU, height × width.
    pub adu: Array2<f32>,
}

/// Draws the middle of each signal at full resolution, with the mean and standard deviation of the whole signal.
///
/// Each signal has its own grey scale: black is three standard deviations below its mean and white three above, written
/// in ADU above the image. `foot` is written below all images.
#[must_use]
pub(crate) fn noise(signals: &[Signal], foot: &str) -> Rgb {
    const COLUMNS: usize = 3;
    let (height, width) = signals
        .iter()
        .map(|signal| signal.adu.dim())
        .reduce(|least, size| (least.0.min(size.0), least.1.min(size.1)))
        .unwrap_or((1, 1));
    let (height, width) = (height.min(CELL * 3 / 4), width.min(CELL));
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
        let first = [(signal.adu.nrows() - height) / 2, (signal.adu.ncols() - width) / 2];
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
    let variance = adu.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>() / n;
    [mean, variance.sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_and_white_are_three_deviations_from_the_mean() {
        let adu = Array2::from_shape_fn((8, 8), |(row, _)| if row % 2 == 0 { 1.0 } else { 3.0 });
        let [mean, deviation] = moments(&adu);
        assert!((mean - 2.0).abs() < 1e-9 && (deviation - 1.0).abs() < 1e-9);
        let name = "row".to_owned();
        let sheet = noise(&[Signal { name, adu }], "");
        assert!(sheet.samples().contains(&85) && sheet.samples().contains(&170));
    }

    #[test]
    fn flat_and_tiny_signals_are_grey() {
        let signals = [(1, 1), (500, 2), (2, 500), (9, 9)].map(|size| Signal {
            name: "a name that is longer than its place on the sheet is".to_owned(),
            adu: Array2::zeros(size),
        });
        let sheet = noise(&signals, "sony-a7s2, seed 0");
        assert!(sheet.samples().contains(&128));
        assert_eq!(noise(&[], "").width(), 3 * (GAP + CELL) + GAP);
    }
}
