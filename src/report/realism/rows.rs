//! Table rows with means over pairs: of any synthesis method ([`MethodRow`]), and of a noise method ([`NoiseRow`]).

use serde::Serialize;

use darkqa_score::photographs::realism::mean::Mean;
use darkqa_score::photographs::realism::{ImageComparison, NoiseComparison, NoiseMethod, PairComparison};

/// Means over pairs for one way to synthesize the low-light images.
#[derive(Debug, Serialize)]
pub(super) struct MethodRow {
    pub psnr: Mean,
    pub ssim: Mean,
    pub kl: Mean,
    pub kl_other: Mean,
    /// Number of bins that are empty on the synthetic side only.
    pub empty_bins: Mean,
}

impl MethodRow {
    /// Computes the means over images; `None` without any.
    pub(super) fn new(images: &[&ImageComparison]) -> Option<Self> {
        Some(Self {
            psnr: mean(images, |image| image.psnr)?,
            ssim: mean(images, |image| image.ssim)?,
            kl: mean(images, |image| image.kl.nats)?,
            kl_other: mean(images, |image| image.kl_other.nats)?,
            empty_bins: mean(images, |image| image.kl.empty as f64)?,
        })
    }
}

fn mean(images: &[&ImageComparison], value: fn(&ImageComparison) -> f64) -> Option<Mean> {
    let values: Vec<f64> = images.iter().map(|image| value(image)).collect();
    Mean::from_values(&values)
}

/// Means over pairs for one noise method.
#[derive(Debug, Serialize)]
pub(super) struct NoiseRow {
    #[serde(flatten)]
    pub method: NoiseMethod,
    #[serde(flatten)]
    pub images: MethodRow,
    /// PSNR in dB of the sensor branch without noise.
    pub clean_psnr: Mean,
    pub differences: Differences,
}

/// Means of the paired differences from exposure drop alone.
#[derive(Debug, Serialize)]
pub(super) struct Differences {
    /// Difference in PSNR, in dB.
    pub psnr: Mean,
    pub ssim: Mean,
    /// Difference in KL divergence, in nats.
    pub kl: Mean,
}

impl NoiseRow {
    /// Rows of all noise methods. All pairs have the same methods in the same order.
    pub(super) fn all(pairs: &[&PairComparison]) -> Vec<Self> {
        let Some(first) = pairs.first() else {
            return Vec::new();
        };
        first
            .noise
            .iter()
            .enumerate()
            .filter_map(|(index, noise)| {
                let comparisons: Vec<(&ImageComparison, &NoiseComparison)> =
                    pairs.iter().filter_map(|pair| Some((&pair.exposure, pair.noise.get(index)?))).collect();
                Self::new(&noise.method, &comparisons)
            })
            .collect()
    }

    fn new(method: &NoiseMethod, pairs: &[(&ImageComparison, &NoiseComparison)]) -> Option<Self> {
        let images: Vec<&ImageComparison> = pairs.iter().map(|(_, noise)| &noise.image).collect();
        let clean: Vec<f64> = pairs.iter().map(|(_, noise)| noise.clean_psnr).collect();
        let differences: Vec<[f64; 3]> =
            pairs.iter().map(|(exposure, noise)| noise.image.differences(exposure)).collect();
        let [psnr, ssim, kl] = [0, 1, 2].map(|index: usize| {
            let values: Vec<f64> = differences.iter().map(|values| values[index]).collect();
            Mean::from_values(&values)
        });
        Some(Self {
            method: method.clone(),
            images: MethodRow::new(&images)?,
            clean_psnr: Mean::from_values(&clean)?,
            differences: Differences { psnr: psnr?, ssim: ssim?, kl: kl? },
        })
    }
}

/// Formats a mean with half the width of its interval, if it has one.
pub(super) fn mean_text(mean: &Mean, digits: usize) -> String {
    if mean.value.is_infinite() {
        let sign = if mean.value < 0.0 { "−" } else { "" };
        return format!("{sign}∞");
    }
    match mean.interval {
        Some([low, high]) => format!("{:.digits$} ±{:.digits$}", mean.value, (high - low) / 2.0),
        None => format!("{:.digits$}", mean.value),
    }
}

/// Formats a mean difference with its sign, and half the width of its interval, if it has one.
pub(super) fn difference_text(mean: &Mean, digits: usize) -> String {
    let sign = if mean.value > 0.0 { "+" } else { "" };
    format!("{sign}{}", mean_text(mean, digits).replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_signs_and_intervals() {
        for (numbers, text) in [
            (&[1.0, 2.0][..], "+1.50"),
            (&[-1.0, -2.0], "−1.50"),
            (&[0.0, 0.0], "0.00"),
            (&[1.0, 2.0, 3.0], "+2.00 ±2.48"),
            (&[f64::NEG_INFINITY, 1.0], "−∞"),
            (&[f64::INFINITY, 1.0], "+∞"),
        ] {
            assert_eq!(difference_text(&Mean::from_values(numbers).unwrap(), 2), text);
        }
    }
}
