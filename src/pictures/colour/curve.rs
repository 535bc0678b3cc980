//! Tone curves from channel values to linear light: [`ToneCurve`].

use moxcms::ToneReprCurve;

use super::srgb;

/// Luminance of diffuse white in HDR, which becomes the white of sRGB, in cd/m² (BT.2408-7, section 2.2).
pub(super) const WHITE_NITS: f64 = 203.0;

/// A tone curve from values in [0, 1] to linear light, in [0, 1] except for PQ.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ToneCurve {
    /// The curve of sRGB.
    Srgb,
    /// The curve of PQ (BT.2100-2, table 4), in units of [`WHITE_NITS`].
    Pq,
    /// The curve of HLG (BT.2100-2, table 5), to the light of the scene; 1 is the peak.
    Hlg,
    /// A power function with this exponent.
    Gamma(f64),
    /// At least two equally spaced values of light, interpolated linearly.
    Table(Vec<f64>),
    /// The segmented curve of ICC.1:2022, section 10.18, with its parameters g, a, b, c, d, e and f.
    Segments([f64; 7]),
}

impl ToneCurve {
    /// Converts a curve of an ICC profile.
    ///
    /// # Errors
    /// If a number is not finite, or the number of parameters is unknown.
    pub(super) fn from_profile(curve: &ToneReprCurve) -> Result<Self, String> {
        let numbers = match curve {
            ToneReprCurve::Lut(table) => match table[..] {
                [] => return Ok(Self::Gamma(1.0)),
                // An unsigned fixed-point number with 8 integer and 8 fractional bits.
                [gamma] => return Ok(Self::Gamma(f64::from(gamma) / 256.0)),
                _ => {
                    return Ok(Self::Table(table.iter().map(|value| f64::from(*value) / 65_535.0).collect()));
                }
            },
            ToneReprCurve::Parametric(numbers) => numbers,
        };
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err("a curve of the ICC profile has a number that is not finite".to_owned());
        }
        let numbers: Vec<f64> = numbers.iter().map(|number| f64::from(*number)).collect();
        Ok(Self::Segments(match numbers[..] {
            [g] => [g, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [g, a, b] => [g, a, b, 0.0, -b / a, 0.0, 0.0],
            [g, a, b, c] => [g, a, b, 0.0, -b / a, c, c],
            [g, a, b, c, d] => [g, a, b, c, d, 0.0, 0.0],
            [g, a, b, c, d, e, f] => [g, a, b, c, d, e, f],
            _ => return Err("a curve of the ICC profile has an unknown form".to_owned()),
        }))
    }

    /// Linear light of a value in [0, 1], clamped to [0, 1] except for PQ.
    pub(super) fn light(&self, value: f64) -> f64 {
        let light = match self {
            Self::Srgb => srgb::light(value),
            Self::Pq => return pq(value) / WHITE_NITS,
            Self::Hlg => hlg(value),
            Self::Gamma(gamma) => libm::pow(value, *gamma),
            Self::Table(values) => interpolate(values, value),
            Self::Segments([g, a, b, c, d, e, f]) => {
                if value >= *d {
                    libm::pow((a * value + b).max(0.0), *g) + e
                } else {
                    c * value + f
                }
            }
        };
        // NaN becomes 0, too.
        if light > 0.0 { light.min(1.0) } else { 0.0 }
    }
}

impl ToneCurve {
    /// True for a curve that profiles of BT.709 have: the inverse of the camera's curve, or the gamma of 1.961 that
    /// approximates it. Its codes differ from that curve by at most one 8-bit sRGB code (chosen).
    pub(super) fn is_video(&self) -> bool {
        let is_near = |other: fn(f64) -> f64| {
            (0..=64).map(|i| f64::from(i) / 64.0).all(|value| {
                let [found, expected] =
                    [self.light(value), other(value)].map(|light| f64::from(srgb::SIXTEEN.encode(light)) / 257.0);
                (found - expected).abs() <= 1.0
            })
        };
        is_near(bt709) || is_near(|value| libm::pow(value, 1.961))
    }
}

/// Luminance of a value of PQ, in cd/m² (BT.2100-2, table 4).
fn pq(value: f64) -> f64 {
    const M1: f64 = 2610.0 / 16_384.0;
    const M2: f64 = 2523.0 / 32.0;
    const C1: f64 = 3424.0 / 4096.0;
    const C2: f64 = 2413.0 / 128.0;
    const C3: f64 = 2392.0 / 128.0;
    let power = libm::pow(value, 1.0 / M2);
    10_000.0 * libm::pow((power - C1).max(0.0) / (C2 - C3 * power), 1.0 / M1)
}

/// Light of the scene of a value of HLG (BT.2100-2, table 5).
fn hlg(value: f64) -> f64 {
    const A: f64 = 0.178_832_77;
    const B: f64 = 0.284_668_92;
    const C: f64 = 0.559_910_73;
    if value <= 0.5 { value * value / 3.0 } else { (libm::exp((value - C) / A) + B) / 12.0 }
}

/// Linear light of a value by the inverse of the curve of BT.709-6, item 1.2.
fn bt709(value: f64) -> f64 {
    const ALPHA: f64 = 1.099_296_826_809_44;
    const BETA: f64 = 0.018_053_968_510_807;
    if value < 4.5 * BETA { value / 4.5 } else { libm::pow((value + ALPHA - 1.0) / ALPHA, 1.0 / 0.45) }
}

/// Interpolates linearly between at least two equally spaced values, at a position in [0, 1].
pub(super) fn interpolate(values: &[f64], at: f64) -> f64 {
    let position = at * (values.len() - 1) as f64;
    let low = (position as usize).min(values.len() - 2);
    let fraction = position - low as f64;
    values[low] + fraction * (values[low + 1] - values[low])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segments(numbers: &[f32]) -> ToneReprCurve {
        ToneReprCurve::Parametric(numbers.to_vec())
    }

    fn table(numbers: &[u16]) -> ToneReprCurve {
        ToneReprCurve::Lut(numbers.to_vec())
    }

    #[test]
    fn curves_of_profiles_follow_the_specification() {
        let srgb = [2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045];
        for (curve, at, expected) in [
            (table(&[]), 0.3, 0.3),
            (table(&[512]), 0.5, 0.25),
            (table(&[0, 65_535]), 0.3, 0.3),
            (table(&[0, 0, 65_535]), 0.75, 0.5),
            (table(&[0, 0, 65_535]), 1.0, 1.0),
            (segments(&[2.0]), 0.5, 0.25),
            (segments(&[2.0, 2.0, -0.5]), 0.5, 0.25),
            (segments(&[2.0, 2.0, -0.5]), 0.2, 0.0),
            (segments(&[2.0, 2.0, -0.5, 0.125]), 0.2, 0.125),
            (segments(&[2.0, 2.0, -0.5, 0.125]), 0.5, 0.375),
            (segments(&srgb), 0.03, 0.03 / 12.92),
            (segments(&srgb), 0.5, srgb::light(0.5)),
            (segments(&[2.0, 1.0, 0.0, 0.5, 0.4, 0.01, 0.02]), 0.2, 0.12),
            (segments(&[2.0, 1.0, 0.0, 0.5, 0.4, 0.01, 0.02]), 0.5, 0.26),
        ] {
            let found = ToneCurve::from_profile(&curve).unwrap().light(at);
            assert!((found - expected).abs() < 1e-7, "{curve:?} at {at}: {found}");
        }
        for (curve, at) in [(segments(&[-1.0]), 0.0), (segments(&[2.0, 9.0, 0.0]), 1.0)] {
            let clipped = ToneCurve::from_profile(&curve).unwrap().light(at);
            assert!((clipped - 1.0).abs() < f64::EPSILON);
        }
        assert!(ToneCurve::from_profile(&segments(&[f32::NAN])).is_err());
        assert!(ToneCurve::from_profile(&segments(&[1.0, 1.0])).is_err());
    }

    #[test]
    fn the_bt709_curve_is_continuous() {
        let join = 4.5 * 0.018_053_968_510_807;
        let step = bt709(join + 1e-9) - bt709(join - 1e-9);
        assert!(step.abs() < 1e-8, "{step}");
        // With the rounded constants 1.099 and 0.018 it is 0.25959.
        assert!((bt709(0.5) - 0.25959).abs() < 2e-4, "{}", bt709(0.5));
    }

    #[test]
    fn curves_of_video_are_recognized() {
        let camera = [1.0 / 0.45, 1.0 / 1.099, 0.099 / 1.099, 1.0 / 4.5, 0.081];
        for (curve, expected) in [
            (segments(&camera), true),
            (table(&[502]), true),
            (segments(&[1.961]), true),
            (table(&[461]), false),
            (table(&[563]), false),
            (table(&[512]), false),
            (segments(&[2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045]), false),
        ] {
            let found = ToneCurve::from_profile(&curve).unwrap();
            assert_eq!(found.is_video(), expected, "{curve:?}");
        }
    }

    /// PQ: SMPTE ST 2084, 0.508078 for 100 cd/m². HLG: half the signal is a twelfth of the peak.
    #[test]
    fn hdr_curves_have_the_values_of_their_standards() {
        for (value, nits) in [(0.0, 0.0), (0.508_078, 100.0), (0.751_827, 1000.0), (1.0, 10_000.0)] {
            assert!((pq(value) - nits).abs() <= nits * 1e-4, "{value}: {}", pq(value));
        }
        for (value, light) in [(0.0, 0.0), (0.5, 1.0 / 12.0), (0.500_001, 1.0 / 12.0), (1.0, 1.0)] {
            assert!((hlg(value) - light).abs() < 1e-5, "{value}: {}", hlg(value));
        }
    }
}
