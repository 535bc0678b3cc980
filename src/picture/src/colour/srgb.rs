//! The curve of sRGB between codes and linear light (IEC 61966-2-1): [`light`], and [`SrgbCodes`] for the way back.

use std::sync::LazyLock;

/// Linear light of a value in [0, 1].
pub(super) fn light(value: f64) -> f64 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        libm::pow((value + 0.055) / 1.055, 2.4)
    }
}

/// The nearest codes of linear light.
pub(super) struct SrgbCodes {
    /// The least light of each code above 0: halfway, in codes, from the code below.
    steps: Vec<f64>,
    /// The code of the darkest light of each of [`Self::BINS`] equal parts of [0, 1].
    first: Vec<u32>,
}

/// 8-bit codes.
pub(super) static EIGHT: LazyLock<SrgbCodes> = LazyLock::new(|| SrgbCodes::up_to(255));
/// 16-bit codes.
pub(super) static SIXTEEN: LazyLock<SrgbCodes> = LazyLock::new(|| SrgbCodes::up_to(65_535));

impl SrgbCodes {
    /// The number of parts in which a search begins; chosen.
    const BINS: usize = 4096;

    fn up_to(most: u32) -> Self {
        let step = |code: u32| light((f64::from(code) - 0.5) / f64::from(most));
        let steps: Vec<f64> = (1..=most).map(step).collect();
        let bins = 0..=Self::BINS;
        let first = bins.map(|bin| {
            let darkest = bin as f64 / Self::BINS as f64;
            steps.partition_point(|step| *step <= darkest) as u32
        });
        Self {
            first: first.collect(),
            steps,
        }
    }

    /// The nearest code of light, which is clamped to [0, 1].
    pub(super) fn encode(&self, light: f64) -> u32 {
        let light = light.clamp(0.0, 1.0);
        let bin = (light * Self::BINS as f64) as usize;
        let (first, last) = (self.first[bin], self.first[(bin + 1).min(Self::BINS)]);
        let steps = &self.steps[first as usize..last as usize];
        first + steps.partition_point(|step| *step <= light) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_come_back_and_steps_stand_between_them() {
        for (codes, most) in [(&*EIGHT, 255), (&*SIXTEEN, 65_535)] {
            let value = |code: f64| light(code / f64::from(most));
            for code in 0..=most {
                let at = f64::from(code);
                assert_eq!(codes.encode(value(at)), code);
                assert_eq!(codes.encode(value((at + 0.499).min(f64::from(most)))), code);
                assert_eq!(codes.encode(value((at - 0.499).max(0.0))), code);
            }
            assert_eq!([codes.encode(-1.0), codes.encode(2.0)], [0, most]);
        }
    }
}
