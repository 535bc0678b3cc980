//! Tone curve of sRGB (IEC 61966-2-1): values to linear light ([`light`]), and light to codes ([`SrgbCodes`]).

use std::sync::LazyLock;

/// Linear light of an sRGB value in [0, 1].
pub(super) fn light(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
}

/// Lookup table from linear light to the nearest sRGB code.
pub(super) struct SrgbCodes {
    /// Lower limit in light of each code from 1: halfway, in codes, to the code below.
    lower_limits: Vec<f64>,
    /// Code of the lower end of each of [`Self::BINS`] equal bins of [0, 1], and of 1.
    first_codes: Vec<u32>,
}

/// Lookup table for 8-bit codes.
pub(super) static EIGHT: LazyLock<SrgbCodes> = LazyLock::new(|| SrgbCodes::up_to(255));
/// Lookup table for 16-bit codes.
pub(super) static SIXTEEN: LazyLock<SrgbCodes> = LazyLock::new(|| SrgbCodes::up_to(65_535));

impl SrgbCodes {
    /// Number of bins that narrow the search; chosen.
    const BINS: usize = 4096;

    fn up_to(max: u32) -> Self {
        let lower_limits: Vec<f64> = (1..=max).map(|code| light((f64::from(code) - 0.5) / f64::from(max))).collect();
        let first_codes = (0..=Self::BINS)
            .map(|bin| {
                let darkest = bin as f64 / Self::BINS as f64;
                lower_limits.partition_point(|limit| *limit <= darkest) as u32
            })
            .collect();
        Self { lower_limits, first_codes }
    }

    /// The code nearest to a value of light, which is clamped to [0, 1].
    pub(super) fn encode(&self, light: f64) -> u32 {
        let light = light.clamp(0.0, 1.0);
        let bin = (light * Self::BINS as f64) as usize;
        let first = self.first_codes[bin];
        let last = self.first_codes[(bin + 1).min(Self::BINS)];
        let limits = &self.lower_limits[first as usize..last as usize];
        first + limits.partition_point(|limit| *limit <= light) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_encoded_to_the_nearest_code() {
        for (codes, max) in [(&*EIGHT, 255), (&*SIXTEEN, 65_535)] {
            for code in 0..=max {
                for offset in [-0.499, 0.0, 0.499] {
                    let near = (f64::from(code) + offset).clamp(0.0, f64::from(max));
                    assert_eq!(codes.encode(light(near / f64::from(max))), code);
                }
            }
            assert_eq!([codes.encode(-1.0), codes.encode(2.0)], [0, max]);
        }
    }
}
