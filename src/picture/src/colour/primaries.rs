//! Primaries and white points of RGB colours: [`Primaries`]; and matrices of three rows: [`Matrix`].

/// A matrix of three rows.
pub(crate) type Matrix = [[f64; 3]; 3];

/// The matrix that changes nothing.
pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The white of profiles, D50 (ICC.1:2022, section 7.2.16).
pub(super) const D50: [f64; 3] = [0.9642, 1.0, 0.8249];

/// The cone responses by which whites are adapted (Lam 1985, "Bradford").
const BRADFORD: Matrix = [
    [0.8951, 0.2664, -0.1614],
    [-0.7502, 1.7135, 0.0367],
    [0.0389, -0.0685, 1.0296],
];

/// x and y of the primaries and of white (CIE 1931).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Primaries {
    pub red: [f64; 2],
    pub green: [f64; 2],
    pub blue: [f64; 2],
    pub white: [f64; 2],
}

impl Primaries {
    /// Primaries of sRGB and BT.709 (IEC 61966-2-1).
    pub(crate) const SRGB: Self = Self {
        red: [0.64, 0.33],
        green: [0.30, 0.60],
        blue: [0.15, 0.06],
        white: [0.3127, 0.3290],
    };

    /// Primaries of Display P3 (SMPTE EG 432-1).
    pub(super) const DISPLAY_P3: Self = Self {
        red: [0.680, 0.320],
        green: [0.265, 0.690],
        blue: [0.150, 0.060],
        white: [0.3127, 0.3290],
    };

    /// The matrix from linear light with these primaries to XYZ, with white at D50.
    fn to_xyz(self) -> Matrix {
        let xyz = |[x, y]: [f64; 2]| [x / y, 1.0, (1.0 - x - y) / y];
        let columns = transposed([xyz(self.red), xyz(self.green), xyz(self.blue)]);
        let white = xyz(self.white);
        let amounts = times(inverse(columns), white);
        let scaled = columns.map(|row| [0, 1, 2].map(|i| row[i] * amounts[i]));
        let (from, to) = (times(BRADFORD, white), times(BRADFORD, D50));
        let scale = [0, 1, 2].map(|i| BRADFORD[i].map(|value| value * to[i] / from[i]));
        product(product(inverse(BRADFORD), scale), scaled)
    }

    /// The matrix from linear light with these primaries to that with the primaries of sRGB. White stays white.
    pub(crate) fn to_srgb(self) -> Matrix {
        if self == Self::SRGB {
            return IDENTITY;
        }
        xyz_to_srgb(self.to_xyz())
    }
}

/// The matrix from RGB to sRGB, both linear, from that to XYZ with white at D50.
pub(super) fn xyz_to_srgb(to_xyz: Matrix) -> Matrix {
    product(inverse(Primaries::SRGB.to_xyz()), to_xyz)
}

fn transposed(m: Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

/// The product of a matrix and a column.
pub(crate) fn times(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn product(a: Matrix, b: Matrix) -> Matrix {
    transposed(transposed(b).map(|column| times(a, column)))
}

/// The inverse by Cramer's rule. Of a singular matrix it is not finite.
fn inverse(m: Matrix) -> Matrix {
    let minor = |r: [usize; 2], c: [usize; 2]| {
        m[r[0]][c[0]] * m[r[1]][c[1]] - m[r[0]][c[1]] * m[r[1]][c[0]]
    };
    let others = |i: usize| [[1, 2], [2, 0], [0, 1]][i];
    let determinant: f64 = (0..3).map(|i| m[0][i] * minor([1, 2], others(i))).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| minor(others(j), others(i)) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: Matrix, expected: Matrix, off: f64) {
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < off, "{found} {expected}");
        }
    }

    /// The values that profiles of sRGB state (sRGB2014.icc of the ICC).
    #[test]
    fn srgb_has_the_colorants_of_its_profiles() {
        let expected = [
            [0.43607, 0.38515, 0.14307],
            [0.22249, 0.71687, 0.06061],
            [0.01392, 0.09708, 0.71410],
        ];
        close(Primaries::SRGB.to_xyz(), expected, 3e-4);
        close(xyz_to_srgb(Primaries::SRGB.to_xyz()), IDENTITY, 1e-12);
    }

    /// The matrix of CSS Color 4, section 18, from linear Display P3 to linear sRGB.
    #[test]
    fn display_p3_has_the_matrix_of_css() {
        let expected = [
            [1.224_940_2, -0.224_940_4, 0.0],
            [-0.042_056_9, 1.042_057_1, 0.0],
            [-0.019_637_6, -0.078_636_1, 1.098_273_6],
        ];
        close(Primaries::DISPLAY_P3.to_srgb(), expected, 1e-5);
    }

    #[test]
    fn an_inverse_undoes_a_matrix() {
        close(product(BRADFORD, inverse(BRADFORD)), IDENTITY, 1e-14);
    }
}
