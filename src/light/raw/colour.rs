//! Conversion between linear sRGB and the colour space of a camera: [`rgb_to_camera`], [`inverse`].

/// 3 × 3 colour matrix, row by row, applied to a column vector of red, green and blue.
pub(crate) type Matrix = [[f64; 3]; 3];

/// XYZ → camera, for the four cameras of the Darmstadt Noise Dataset (Brooks et al. 2019, `random_ccm`).
const XYZ_TO_CAMERA: [Matrix; 4] = [
    [[1.0234, -0.2969, -0.2266], [-0.5625, 1.6328, -0.0469], [-0.0703, 0.2188, 0.6406]],
    [[0.4913, -0.0541, -0.0202], [-0.6130, 1.3513, 0.2906], [-0.1564, 0.2151, 0.7183]],
    [[0.8380, -0.2630, -0.0639], [-0.2887, 1.0725, 0.2496], [-0.0627, 0.1427, 0.5438]],
    [[0.6596, -0.2079, -0.0562], [-0.4782, 1.3016, 0.1933], [-0.0970, 0.1581, 0.5181]],
];

/// Linear sRGB → XYZ, D65 (Brooks et al. 2019, `random_ccm`).
const SRGB_TO_XYZ: Matrix =
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]];

/// Linear sRGB → camera, for a weighted mean of the four cameras. The rows sum to 1, so that grey stays grey (Brooks et
/// al. 2019).
///
/// `weights` must be non-negative and not all zero; their sum does not matter.
#[must_use]
pub(crate) fn rgb_to_camera(weights: [f64; 4]) -> Matrix {
    let total: f64 = weights.iter().sum();
    let mut mix = [[0.0; 3]; 3];
    for (weight, camera) in weights.iter().zip(XYZ_TO_CAMERA) {
        for (mix_row, row) in mix.iter_mut().zip(camera) {
            for (sum, value) in mix_row.iter_mut().zip(row) {
                *sum += weight / total * value;
            }
        }
    }
    product(&mix, &SRGB_TO_XYZ).map(|row| {
        let sum = row[0] + row[1] + row[2];
        row.map(|value| value / sum)
    })
}

/// Inverse of a matrix, by cofactors. A zero determinant is not checked: the matrices of [`rgb_to_camera`] are far from
/// singular.
#[must_use]
pub(crate) fn inverse(matrix: &Matrix) -> Matrix {
    let [a, b, c] = *matrix;
    let cofactors = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = a[0] * cofactors[0][0] + a[1] * cofactors[0][1] + a[2] * cofactors[0][2];
    std::array::from_fn(|row| cofactors.map(|cofactor| cofactor[row] / determinant))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn product(left: &Matrix, right: &Matrix) -> Matrix {
    left.map(|row| {
        std::array::from_fn(|column| row[0] * right[0][column] + row[1] * right[1][column] + row[2] * right[2][column])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIXES: [[f64; 4]; 4] =
        [[1.0, 1.0, 1.0, 1.0], [0.9, 0.001, 0.3, 0.2], [0.0, 1.0, 0.0, 0.0], [0.2, 0.1, 0.0, 7.0]];

    #[test]
    fn grey_stays_grey() {
        for weights in MIXES {
            for row in rgb_to_camera(weights) {
                assert!((row.iter().sum::<f64>() - 1.0).abs() < 5e-16);
            }
        }
    }

    #[test]
    fn inverse_times_matrix_is_identity() {
        for weights in MIXES {
            let matrix = rgb_to_camera(weights);
            let identity = product(&matrix, &inverse(&matrix));
            for (i, row) in identity.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    assert!((value - f64::from(u8::from(i == j))).abs() < 1e-14);
                }
            }
        }
    }

    /// The expected values are from an independent implementation.
    #[test]
    fn camera_mixes_match_reference_matrices() {
        let mean = [
            [0.6460054538, 0.2714313899, 0.0825631563],
            [0.0825578502, 0.7557543488, 0.161687801],
            [0.0145444844, 0.2250190894, 0.7604364262],
        ];
        let uneven = [
            [0.6218507358, 0.2552155048, 0.1229337595],
            [0.0815851812, 0.7259717238, 0.192443095],
            [0.0112382471, 0.2211703924, 0.7675913605],
        ];
        for (weights, expected) in [([3.0; 4], mean), ([1.0, 2.0, 3.0, 4.0], uneven)] {
            let found = rgb_to_camera(weights);
            for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                assert!((found - expected).abs() < 1e-9, "{found} against {expected}");
            }
        }
    }
}
