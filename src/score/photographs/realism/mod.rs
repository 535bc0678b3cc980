//! Similarity of a synthetic image to a real one: [`psnr`], [`ssim`](ssim::ssim), and the divergence of their noise
//! ([`residual`]). Also the camera gain estimated from the noise of a real image ([`gain`]), and the check that two
//! images show the same scene ([`scene`]).

pub mod gain;
pub mod mean;
pub(crate) mod quantile;
pub mod residual;
pub mod scene;
pub mod smooth;
pub mod ssim;

use std::fmt;

use residual::Divergence;
use scene::SceneMatch;
use serde::Serialize;
pub use ssim::same_size;

use darkqa_base::error::{Error, Result};
use darkqa_base::types::{ProfileName, Rgb};

/// Similarity of one synthetic image to the real one.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct ImageComparison {
    /// Peak signal-to-noise ratio in dB; null in JSON if it is infinite.
    pub psnr: f64,
    /// Structural similarity, at most 1.
    pub ssim: f64,
    /// Divergence of the residuals by the requested rule for empty bins.
    pub kl: Divergence,
    /// Divergence of the residuals by the other rule.
    pub kl_other: Divergence,
}

impl ImageComparison {
    /// Difference of the PSNR in dB, of the SSIM and of the divergence in nats from those of another image of the same
    /// pair.
    #[must_use]
    pub fn differences(&self, other: &Self) -> [f64; 3] {
        [(self.psnr, other.psnr), (self.ssim, other.ssim), (self.kl.nats, other.kl.nats)].map(|(own, other)| {
            // Two perfect images differ by 0, although both have an infinite PSNR.
            if own.total_cmp(&other).is_eq() { 0.0 } else { own - other }
        })
    }
}

/// Comparison of the synthetic images of one pair with its real image.
#[derive(Debug, Clone)]
pub struct PairComparison {
    /// Name of the pair.
    pub pair: String,
    /// Exposure drop of the pair in EV.
    pub drop: f32,
    /// Agreement of the structure of both images.
    pub scene: SceneMatch,
    /// Image made by exposure drop alone.
    pub exposure: ImageComparison,
    /// Images made with sensor noise, in the same order for all pairs.
    pub noise: Vec<NoiseComparison>,
}

/// Comparison of one image made with sensor noise.
#[derive(Debug, Clone)]
pub struct NoiseComparison {
    /// Method by which the image was made.
    pub method: NoiseMethod,
    pub image: ImageComparison,
    /// PSNR in dB of the sensor simulation without noise, which measures the error of its tones alone.
    pub clean_psnr: f64,
}

/// A way to make images with sensor noise.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NoiseMethod {
    /// Name of the noise profile.
    #[serde(rename = "reading")]
    pub profile: ProfileName,
    pub camera: CameraOrigin,
}

/// Source of the camera gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CameraOrigin {
    /// The settings.
    Given,
    /// A fit to the other pairs.
    OtherPairs,
    /// A fit to the same pairs that are evaluated.
    SamePairs,
}

impl CameraOrigin {
    /// Word in CSV and JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::OtherPairs => "other-pairs",
            Self::SamePairs => "same-pairs",
        }
    }
}

impl fmt::Display for NoiseMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fitted = match self.camera {
            CameraOrigin::Given => "",
            CameraOrigin::OtherPairs => ", gain fitted to the other pairs",
            CameraOrigin::SamePairs => ", gain fitted to the same pairs",
        };
        f.pad(&format!("{}{fitted}", self.profile))
    }
}

/// Peak signal-to-noise ratio in dB, peak 255, over all samples; infinite for equal images.
///
/// # Errors
/// If the sizes differ.
pub fn psnr(a: &Rgb, b: &Rgb) -> Result<f64> {
    same_size(a, b)?;
    // A `u32` can sum 2¹⁶ squares of 255 and takes a third of the time of a `u64`.
    let mean = a
        .samples()
        .chunks(1 << 16)
        .zip(b.samples().chunks(1 << 16))
        .map(|(a, b)| {
            let squares: u32 = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum();
            u64::from(squares)
        })
        .sum::<u64>() as f64
        / a.samples().len() as f64;
    Ok(10.0 * libm::log10(255.0 * 255.0 / mean))
}

/// Exposure drop between two images in EV: log2 of the ratio of their mean linear light (gamma 2.2).
///
/// # Errors
/// If one of the images is black.
pub fn exposure_drop(normal: &Rgb, low: &Rgb) -> Result<f32> {
    let linear: [f64; 256] = std::array::from_fn(|code| libm::pow((code as f64 / 255.0).max(1e-8), 2.2));
    let images = [normal, low];
    if images.iter().any(|image| image.samples().iter().all(|code| *code == 0)) {
        let problem = "an image is black, so its exposure drop cannot be estimated; set it with --ev";
        return Err(Error::data("pair", problem));
    }
    let [normal_light, low_light] = images.map(|image| {
        let mut counts = [0_u64; 256];
        for code in image.samples() {
            counts[usize::from(*code)] += 1;
        }
        counts.iter().zip(linear).map(|(n, light)| *n as f64 * light).sum::<f64>() / image.samples().len() as f64
    });
    Ok(libm::log2(normal_light / low_light) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_images_have_infinite_psnr() {
        let image = Rgb::new(12, 12, vec![9; 432]).unwrap();
        assert!(psnr(&image, &image).unwrap().is_infinite());
        assert!((ssim::ssim(&image, &image).unwrap() - 1.0).abs() < 1e-12);
        assert!(exposure_drop(&image, &image).unwrap().abs() < 1e-9);
    }

    #[test]
    fn a_difference_of_one_is_48_db() {
        let [a, b] = [9, 10].map(|code| Rgb::new(2, 2, vec![code; 12]).unwrap());
        assert!((psnr(&a, &b).unwrap() - 48.130_803_608_679_1).abs() < 1e-9);
        let other = Rgb::black(3, 2);
        let error = psnr(&a, &other).unwrap_err().to_string();
        assert!(error.contains("2 × 2 pixels against 2 × 3"), "{error}");
    }

    #[test]
    fn equal_numbers_do_not_differ_even_if_infinite() {
        let kl = residual::Divergence { nats: 0.5, empty: 0 };
        let perfect = ImageComparison { psnr: f64::INFINITY, ssim: 1.0, kl, kl_other: kl };
        let same = perfect.differences(&perfect);
        assert!(same.iter().all(|difference| difference.abs() < 1e-12));
        let worse = ImageComparison { psnr: 30.0, ssim: 0.75, ..perfect };
        let [psnr, ssim, kl] = worse.differences(&perfect);
        assert!(psnr.is_infinite() && psnr < 0.0);
        assert!((ssim + 0.25).abs() < 1e-12 && kl.abs() < 1e-12);
    }

    #[test]
    fn an_exposure_drop_is_estimated() {
        let [light, dark] = [200, 100].map(|code| Rgb::new(2, 2, vec![code; 12]).unwrap());
        assert!((exposure_drop(&light, &dark).unwrap() - 2.2).abs() < 1e-6);
        assert!(exposure_drop(&light, &Rgb::black(2, 2)).is_err());
    }
}
