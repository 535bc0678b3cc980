//! The calibrated noise of a Sony A7S2 sensor (Wei et al., "Physics-based noise modeling for extreme low-light
//! photography", ELD, Profile-1): [`noise_at`] a system gain.
//!
//! The paper's range of K, [0.1, 6.0], is this camera's own, 0.0939 to 6.0106.

/// The range of a 14-bit sample above its black level, in ADU: 16383 − 512.
pub const ADU_RANGE: f64 = 15871.0;

/// K at ISO 100.
const GAIN_AT_ISO_100: f64 = 0.09391607086816033;

/// ln σ = slope · ln K + intercept + deviation · z, with z standard normal.
struct Fit {
    slope: f64,
    intercept: f64,
    deviation: f64,
}

const READ_SCALE: Fit = Fit {
    slope: 0.46210495986526035,
    intercept: 0.5657147358616816,
    deviation: 0.2633712220097871,
};

const ROW_DEVIATION: Fit = Fit {
    slope: 0.5275360468633209,
    intercept: -0.5917002648887661,
    deviation: 0.29428813016491145,
};

/// Shape λ of the read noise in seventieths: two calibrations for each of ISO 100 · 2^i.
const READ_SHAPE_70: [f64; 18] = [
    8.0, 9.0, 4.0, 3.0, 0.0, 0.0, -3.0, -4.0, -6.0, -6.0, -6.0, -6.0, -8.0, -8.0, -10.0, -9.0,
    -10.0, -10.0,
];

/// Offsets in ADU in the calibration's order R, G1, B, G2; its rows are those of [`READ_SHAPE_70`].
const BIAS: [[f64; 4]; 18] = [
    [1.4821643, 1.4681524, 1.4833444, 1.470076],
    [1.497519, 1.4802226, 1.4969686, 1.4816201],
    [-1.0175819, -1.0376643, -1.02153, -1.0378408],
    [-1.0171579, -1.0392196, -1.0185297, -1.0371416],
    [-0.26040897, -0.29516822, -0.26699188, -0.2944749],
    [-0.25755608, -0.28967762, -0.2618834, -0.2919002],
    [0.61129564, 0.57690895, 0.6100786, 0.57552356],
    [0.60525787, 0.5677652, 0.60092825, 0.5605873],
    [2.071886, 2.009204, 2.3060765, 2.2433784],
    [2.0913448, 2.0201814, 2.3282442, 2.2599304],
    [-1.3465632, -1.3705783, -1.3488727, -1.3657213],
    [-1.3218611, -1.3641046, -1.3314049, -1.3595291],
    [-1.5595009, -1.5976678, -1.3204409, -1.3571521],
    [-1.5529999, -1.601949, -1.3224984, -1.3585266],
    [1.1709546, 1.0815442, 1.1473132, 1.0724843],
    [1.1831634, 1.0717992, 1.178615, 1.0671343],
    [4.073152, 3.8571138, 4.2958155, 4.0960426],
    [4.0541706, 3.8497255, 4.292276, 4.0853047],
];

/// The sensor's noise at one gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Scale σ_TL of the read noise, in ADU.
    pub read_scale: f64,
    /// Shape λ of the read noise.
    pub read_shape: f64,
    /// Standard deviation σ_r of the row noise, in ADU.
    pub row_deviation: f64,
    /// Offset of each Bayer plane, in ADU, in the order R, Gr, Gb, B.
    pub bias: [f64; 4],
}

/// The noise at system gain `gain`.
///
/// `scatter` holds the standard normal numbers by which σ_TL and σ_r stand off their fits. `choices`, uniform in (0, 1),
/// choose between a gain's two calibrations with even odds, for λ and for the offsets. The calibration's own author
/// advises to take both near the gain: the offsets of ISO 25600 do not belong to K = 0.1.
#[must_use]
pub fn noise_at(gain: f64, scatter: [f64; 2], choices: [f64; 2]) -> SensorNoise {
    let pair = 2 * iso_step(gain);
    let [shape, bias] = choices.map(|choice| pair + usize::from(choice >= 0.5));
    let [r, g1, b, g2] = BIAS[bias];
    SensorNoise {
        read_scale: READ_SCALE.at(gain, scatter[0]),
        read_shape: READ_SHAPE_70[shape] / 70.0,
        row_deviation: ROW_DEVIATION.at(gain, scatter[1]),
        bias: [r, g1, g2, b],
    }
}

/// The i of the ISO 100 · 2^i whose gain is nearest, from 0 to 6 (ISO 6400, the last that the range of K reaches).
fn iso_step(gain: f64) -> usize {
    let step = (libm::log2(gain / GAIN_AT_ISO_100) + 0.5).floor();
    step.clamp(0.0, 6.0) as usize
}

impl Fit {
    fn at(&self, gain: f64, z: f64) -> f64 {
        libm::exp(self.slope * libm::log(gain) + self.intercept + self.deviation * z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fits_give_the_calibrated_medians() {
        for (gain, read, row) in [
            (0.1, 0.6075, 0.1642),
            (0.3, 1.0094, 0.2932),
            (1.0, 1.7607, 0.5534),
            (3.0, 2.9253, 0.9879),
            (6.0, 4.0297, 1.4241),
        ] {
            let noise = noise_at(gain, [0.0; 2], [0.0; 2]);
            assert!((noise.read_scale - read).abs() < 6e-5, "{gain}");
            assert!((noise.row_deviation - row).abs() < 6e-5, "{gain}");
        }
        let scattered = noise_at(1.0, [1.0, -1.0], [0.0; 2]);
        assert!((scattered.read_scale.ln() - 0.56571 - 0.26337).abs() < 1e-5);
        assert!((scattered.row_deviation.ln() + 0.59170 + 0.29429).abs() < 1e-5);
    }

    #[test]
    fn calibrations_are_those_of_the_nearest_iso() {
        for (gain, step) in [
            (0.01, 0),
            (0.1, 0),
            (0.1328, 0),
            (0.1329, 1),
            (0.7746, 3),
            (4.2, 5),
            (4.3, 6),
            (6.0, 6),
            (100.0, 6),
        ] {
            assert_eq!(iso_step(gain), step, "K = {gain}");
        }
        for (gain, shape) in [(0.1, 0.1143), (0.7746, -0.0429), (6.0, -0.1143)] {
            assert!((noise_at(gain, [0.0; 2], [0.0; 2]).read_shape - shape).abs() < 5e-5);
        }
        let first = noise_at(0.7746, [0.0; 2], [0.0, 0.5]);
        assert!((first.read_shape + 3.0 / 70.0).abs() < 1e-15);
        assert!((noise_at(0.7746, [0.0; 2], [0.5, 0.0]).read_shape + 4.0 / 70.0).abs() < 1e-15);
        assert!((first.bias[0] - 0.60525787).abs() < 1e-15);
    }

    /// The calibration's columns are R, G1, B, G2; the planes are R, Gr, Gb, B.
    #[test]
    fn offsets_reach_their_planes() {
        let bias = noise_at(6.0, [0.0; 2], [0.0; 2]).bias;
        let due = [-1.5595009, -1.5976678, -1.3571521, -1.3204409];
        assert!(bias.iter().zip(due).all(|(a, b)| (a - b).abs() < 1e-15));
    }
}
