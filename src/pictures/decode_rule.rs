//! The settings that decide how image files are read: [`DecodeRule`].

use std::sync::Arc;

use clap::ValueEnum;

use darkqa_base::types::flags::flag_words;
use darkqa_base::types::{DepthNote, InputNote, Light};

/// Default maximum number of pixels in an image (chosen).
pub const MAX_PIXELS: u64 = 100_000_000;

/// Maximum ratio of the longer to the shorter side of an image (chosen).
const MAX_ASPECT_RATIO: usize = 1000;

/// The settings that decide how image files are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecodeRule {
    /// Maximum number of pixels. A larger image is refused before it is decompressed.
    pub max_pixels: u64,
    /// Handling of colours that are not sRGB.
    pub colour: ColourRule,
    /// Interpretation of the samples of 16-bit PNG and TIFF images.
    pub transfer: Transfer,
    /// Gain applied to linear light, in EV; `None` for none.
    pub exposure_ev: Option<f32>,
}

impl DecodeRule {
    /// The default without a limit, for files of which only the headers are read.
    pub(super) const UNBOUNDED: Self =
        Self { max_pixels: u64::MAX, colour: ColourRule::Convert, transfer: Transfer::Srgb, exposure_ev: None };

    /// Checks the width and height of an image, in pixels. The aspect ratio is limited because scaling a very narrow
    /// image can take far more memory than the image itself.
    ///
    /// # Errors
    /// If it has too many pixels, or if `max_pixels` is the default and the aspect ratio is too large.
    pub(super) fn check_size(&self, width: usize, height: usize) -> Result<(), String> {
        let pixels = (width as u64).saturating_mul(height as u64);
        if pixels > self.max_pixels {
            return Err(format!(
                "{width} × {height} pixels are more than the {} that are read; shrink it first, or raise --decode max-pixels",
                self.max_pixels
            ));
        }
        let is_narrow = width.max(height) > MAX_ASPECT_RATIO * width.min(height);
        if is_narrow && self.max_pixels == MAX_PIXELS {
            return Err(format!(
                "{width} × {height} pixels: one side is more than {MAX_ASPECT_RATIO} times the other; cut it, or set --decode max-pixels={}",
                MAX_PIXELS - 1
            ));
        }
        Ok(())
    }

    /// Changes that reading makes to an image, except colours and orientation. `is_light` is true for linear light,
    /// false for codes.
    #[must_use]
    pub fn input_note(&self, is_light: bool) -> InputNote {
        InputNote {
            depth: is_light.then_some(DepthNote::Light),
            exposure_ev: self.exposure_ev.filter(|_| is_light),
            no_light: if is_light { Vec::new() } else { self.linear_flags() },
            ..InputNote::default()
        }
    }

    /// Applies `--decode exposure` to linear light.
    #[must_use]
    pub fn scale_exposure(&self, light: Arc<Light>) -> Arc<Light> {
        let Some(ev) = self.exposure_ev else {
            return light;
        };
        let mut light = Arc::unwrap_or_clone(light);
        let factor = libm::exp2(f64::from(ev));
        for sample in light.samples_mut() {
            let scaled = f64::from(*sample) * factor;
            *sample = scaled.min(f64::from(f32::MAX)) as f32;
        }
        Arc::new(light)
    }

    /// The flags in use that affect only linear light.
    fn linear_flags(&self) -> Vec<String> {
        let linear = (self.transfer == Transfer::Linear).then_some("--decode transfer=linear");
        let exposure = self.exposure_ev.map(|_| "--decode exposure");
        [linear, exposure].into_iter().flatten().map(str::to_owned).collect()
    }
}

/// Interpretation of the samples of 16-bit images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Transfer {
    /// Codes of sRGB
    #[default]
    Srgb,
    /// Linear light
    Linear,
}

/// Handling of images whose file states other colours than sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ColourRule {
    /// Convert them to sRGB; HDR is refused
    #[default]
    Convert,
    /// Convert HDR (HLG and PQ), too: light above 203 cd/m² becomes white
    Clip,
    /// Take their codes as sRGB
    Ignore,
}

flag_words!(ColourRule, Transfer);

impl Default for DecodeRule {
    fn default() -> Self {
        Self { max_pixels: MAX_PIXELS, colour: ColourRule::default(), transfer: Transfer::default(), exposure_ev: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_aspect_ratio_are_limited() {
        let rule = DecodeRule::default();
        for (width, height, fits) in [
            (10_000, 10_000, true),
            (10_000, 10_001, false),
            (1_000, 1, true),
            (1, 1_001, false),
            (4_000_000, 1, false),
        ] {
            let found = rule.check_size(width, height);
            assert_eq!(found.is_ok(), fits, "{width} × {height}: {found:?}");
        }
        let user_limit = DecodeRule { max_pixels: MAX_PIXELS - 1, ..rule };
        assert_eq!(user_limit.check_size(1, 1_001), Ok(()));
    }
}
