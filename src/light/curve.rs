//! Curves between sRGB codes and linear light, and their inverses.
//!
//! Every transcendental function comes from `libm`, so that the results are the same bits on every machine.

/// Exponent that approximates the sRGB curve (DarkQA, eqs. 1 and 3).
pub const GAMMA: f64 = 2.2;

/// Smallest base of the powers (DarkQA, ε of eq. 1).
pub const FLOOR: f64 = 1e-8;

/// Linear light of a display value in [0, 1] (DarkQA, eq. 1).
#[must_use]
pub fn gamma_expand(display: f64) -> f64 {
    libm::pow(display.max(FLOOR), GAMMA)
}

/// The display value of linear light in [0, 1] (DarkQA, eq. 3).
#[must_use]
pub fn gamma_compress(linear: f64) -> f64 {
    libm::pow(linear.max(FLOOR), 1.0 / GAMMA)
}

/// The inverse of the tone curve 3x² − 2x³, for values in [0, 1] (Brooks et al. 2019, `inverse_smoothstep`).
#[must_use]
pub fn inverse_smoothstep(display: f64) -> f64 {
    let display = display.clamp(0.0, 1.0);
    0.5 - libm::sin(libm::asin(1.0 - 2.0 * display) / 3.0)
}

/// Factor 2^−ΔEV on linear light (DarkQA, eq. 2).
#[cfg(test)]
#[must_use]
pub fn light_factor(drop_ev: f64) -> f64 {
    libm::exp2(-drop_ev)
}

/// Factor 2^(−ΔEV/2.2) on display values: the exposure drop after gamma compression (DarkQA, eqs. 2 and 3).
#[must_use]
pub fn display_factor(drop_ev: f64) -> f64 {
    libm::exp2(-drop_ev / GAMMA)
}

/// The tone curve 3x² − 2x³, for values in [0, 1].
#[inline(always)]
#[must_use]
pub fn smoothstep(display: f32) -> f32 {
    display * display * (3.0 - 2.0 * display)
}

/// The nearest 8-bit code of a display value, which is clamped to [0, 1]. Truncation would add a bias of half a code, 7
/// % of a grey at L5.
#[cfg(test)]
#[must_use]
pub fn to_code(display: f64) -> u8 {
    (255.0 * display.clamp(0.0, 1.0) + 0.5).floor() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_expansion_and_compression_are_inverse() {
        for code in 1..=255u8 {
            let x = f64::from(code) / 255.0;
            assert!((gamma_compress(gamma_expand(x)) - x).abs() < 1e-14);
            assert_eq!(to_code(x), code);
        }
        assert!((gamma_compress(gamma_expand(0.0)) * 255.0 - 0.059).abs() < 0.001);
    }

    #[test]
    fn the_tone_curve_is_inverted() {
        for step in 0..=1000 {
            let x = f64::from(step) / 1000.0;
            let t = inverse_smoothstep(x);
            assert!((t * t * (3.0 - 2.0 * t) - x).abs() < 5e-16, "{x}");
        }
    }

    /// Greys of the sensor branch before the exposure drop, without noise and forward tone curve.
    #[test]
    fn shadows_are_lifted_by_the_inverse_tone_curve() {
        for (code, lifted) in [(0.0, 0.06), (16.0, 38.91), (64.0, 83.41), (192.0, 172.35)] {
            let linear = gamma_expand(inverse_smoothstep(code / 255.0));
            assert!((gamma_compress(linear) * 255.0 - lifted).abs() < 0.006);
        }
    }
}
