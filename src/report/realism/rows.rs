//! Rows of the tables of a comparison: means over pairs, [`MethodRow`], and those of a way to make noise, [`NoiseRow`].

use serde::Serialize;

use darkqa_score::photographs::realism::mean::Mean;
use darkqa_score::photographs::realism::{
    ImageComparison, NoiseComparison, NoiseMethod, PairComparison,
};

/// Means over pairs for one way of making the low-light images.
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
    /// Means over images; `None` without any.
    pub(super) fn new(images: &[&ImageComparison]) -> Option<Self> {
        let mean = |number: fn(&ImageComparison) -> f64| {
            let numbers: Vec<f64> = images.iter().map(|image| number(image)).collect();
            Mean::from_values(&numbers)
        };
        Some(Self {
            psnr: mean(|m| m.psnr)?,
            ssim: mean(|m| m.ssim)?,
            kl: mean(|m| m.kl.nats)?,
            kl_other: mean(|m| m.kl_other.nats)?,
            empty_bins: mean(|m| m.kl.empty as f64)?,
        })
    }
}

/// Means over pairs for one way of making images with sensor noise.
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

/// Means over pairs of the differences from exposure drop alone, pair by pair.
#[derive(Debug, Serialize)]
pub(super) struct Differences {
    /// Difference of the PSNR in dB.
    pub psnr: Mean,
    pub ssim: Mean,
    /// Difference of the divergence in nats.
    pub kl: Mean,
}

impl NoiseRow {
    /// The rows of all ways of making noise, which are the same, in the same order, for all pairs.
    pub(super) fn all(pairs: &[&PairComparison]) -> Vec<Self> {
        let first = pairs.iter().take(1).flat_map(|pair| &pair.noise);
        first
            .enumerate()
            .filter_map(|(index, first)| {
                let of_pairs: Vec<(&ImageComparison, &NoiseComparison)> = pairs
                    .iter()
                    .filter_map(|pair| {
                        let noise = pair.noise.get(index)?;
                        Some((&pair.exposure, noise))
                    })
                    .collect();
                Self::new(&first.method, &of_pairs)
            })
            .collect()
    }

    fn new(method: &NoiseMethod, pairs: &[(&ImageComparison, &NoiseComparison)]) -> Option<Self> {
        let images: Vec<&ImageComparison> = pairs.iter().map(|(_, noise)| &noise.image).collect();
        let clean: Vec<f64> = pairs.iter().map(|(_, noise)| noise.clean_psnr).collect();
        let differences: Vec<[f64; 3]> = pairs
            .iter()
            .map(|(exposure, noise)| noise.image.differences(exposure))
            .collect();
        let mean = |index: usize| {
            let numbers: Vec<f64> = differences.iter().map(|numbers| numbers[index]).collect();
            Mean::from_values(&numbers)
        };
        Some(Self {
            method: method.clone(),
            images: MethodRow::new(&images)?,
            clean_psnr: Mean::from_values(&clean)?,
            differences: Differences {
                psnr: mean(0)?,
                ssim: mean(1)?,
                kl: mean(2)?,
            },
        })
    }
}

/// A mean as text with half of its interval, if it has one.
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

/// A mean difference as text, with its sign and half of its interval, if it has one.
pub(super) fn difference_text(mean: &Mean, digits: usize) -> String {
    let sign = if mean.value > 0.0 { "+" } else { "" };
    format!("{sign}{}", mean_text(mean, digits).replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_signs_and_intervals_from_three_on() {
        for (numbers, text) in [
            (&[1.0, 2.0][..], "+1.50"),
            (&[-1.0, -2.0], "−1.50"),
            (&[0.0, 0.0], "0.00"),
            (&[1.0, 2.0, 3.0], "+2.00 ±2.48"),
            (&[f64::NEG_INFINITY, 1.0], "−∞"),
            (&[f64::INFINITY, 1.0], "+∞"),
        ] {
            assert_eq!(
                difference_text(&Mean::from_values(numbers).unwrap(), 2),
                text
            );
        }
    }
}
