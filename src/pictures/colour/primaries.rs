//! Primaries and white points of RGB colour spaces ([`Primaries`]), and 3 × 3 matrices ([`Matrix`]).

/// A 3 × 3 matrix, row by row.
pub(crate) type Matrix = [[f64; 3]; 3];

/// The identity matrix.
pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// XYZ of D50, the white of ICC profiles (ICC.1:2022, section 7.2.16).
pub(super) const D50: [f64; 3] = [0.9642, 1.0, 0.8249];

/// Matrix of the Bradford chromatic adaptation, from XYZ to cone responses (Lam 1985).
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// CIE 1931 x and y of the primaries and of white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Primaries {
    pub red: [f64; 2],
    pub green: [f64; 2],
    pub blue: [f64; 2],
    pub white: [f64; 2],
}

impl Primaries {
    /// The points of red, green, blue and white.
    pub(crate) fn points(&self) -> [[f64; 2]; 4] {
        [self.red, self.green, self.blue, self.white]
    }

    /// Primaries of sRGB and BT.709 (IEC 61966-2-1).
    pub(crate) const SRGB: Self =
        Self { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: [0.3127, 0.3290] };

    /// Primaries of Display P3 (SMPTE EG 432-1).
    pub(super) const DISPLAY_P3: Self =
        Self { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], white: [0.3127, 0.3290] };

    /// Primaries of BT.2020, table 3.
    pub(super) const BT2020: Self =
        Self { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], white: [0.3127, 0.3290] };

    /// Primaries of digital cinema (SMPTE RP 431-2).
    pub(super) const DCI_P3: Self = Self { white: [0.314, 0.351], ..Self::DISPLAY_P3 };

    /// Primaries of NTSC of 1953 (BT.470, system M), with illuminant C.
    pub(super) const BT470_M: Self =
        Self { red: [0.67, 0.33], green: [0.21, 0.71], blue: [0.14, 0.08], white: [0.310, 0.316] };

    /// Primaries of PAL and SECAM (BT.470, systems B and G; BT.601 of 625 lines).
    pub(super) const BT470_BG: Self = Self { green: [0.29, 0.60], ..Self::SRGB };

    /// Primaries of NTSC (SMPTE 170M and 240M; BT.601 of 525 lines).
    pub(super) const SMPTE_170M: Self =
        Self { red: [0.630, 0.340], green: [0.310, 0.595], blue: [0.155, 0.070], white: [0.3127, 0.3290] };

    /// Primaries of film with illuminant C (H.273, table 2, number 8).
    pub(super) const FILM: Self =
        Self { red: [0.681, 0.319], green: [0.243, 0.692], blue: [0.145, 0.049], white: [0.310, 0.316] };

    /// Primaries of EBU Tech. 3213 (H.273, table 2, number 22).
    pub(super) const EBU_3213: Self =
        Self { red: [0.630, 0.340], green: [0.295, 0.605], blue: [0.155, 0.077], white: [0.3127, 0.3290] };

    /// Shares of red, green and blue in the luminance of white.
    pub(super) fn luminance(self) -> [f64; 3] {
        // Each column has luminance 1.
        let columns = transpose([self.red, self.green, self.blue].map(xyz_from_xy));
        times(inverse(columns), xyz_from_xy(self.white))
    }

    /// The matrix from linear light with these primaries to XYZ, with white adapted to D50.
    fn to_xyz(self) -> Matrix {
        let columns = transpose([self.red, self.green, self.blue].map(xyz_from_xy));
        let white = xyz_from_xy(self.white);
        let amounts = self.luminance();
        let scaled = columns.map(|row| [0, 1, 2].map(|i| row[i] * amounts[i]));
        let (from, to) = (times(BRADFORD, white), times(BRADFORD, D50));
        let scale = [0, 1, 2].map(|i| BRADFORD[i].map(|value| value * to[i] / from[i]));
        product(product(inverse(BRADFORD), scale), scaled)
    }

    /// The matrix from linear light with these primaries to linear light with the primaries of sRGB. White stays white.
    pub(crate) fn to_srgb(self) -> Matrix {
        if self == Self::SRGB {
            return IDENTITY;
        }
        xyz_to_srgb(self.to_xyz())
    }
}

/// The matrix from a linear RGB space to linear sRGB. `to_xyz` is the matrix from that space to XYZ with white at D50.
pub(super) fn xyz_to_srgb(to_xyz: Matrix) -> Matrix {
    product(inverse(Primaries::SRGB.to_xyz()), to_xyz)
}

/// XYZ of a point with luminance 1.
fn xyz_from_xy([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

fn transpose(m: Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

/// The product of a matrix and a column vector.
pub(crate) fn times(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn product(a: Matrix, b: Matrix) -> Matrix {
    transpose(transpose(b).map(|column| times(a, column)))
}

/// The inverse by Cramer's rule; not finite for a singular matrix.
fn inverse(m: Matrix) -> Matrix {
    let determinant: f64 = (0..3).map(|i| m[0][i] * cofactor(m, 0, i)).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(m, j, i) / determinant))
}

/// The cofactor of an element: the signed determinant of the matrix without its row and column.
fn cofactor(m: Matrix, row: usize, column: usize) -> f64 {
    // In this cyclic order, the determinant has the right sign.
    const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];
    let (r, c) = (OTHERS[row], OTHERS[column]);
    m[r[0]][c[0]] * m[r[1]][c[1]] - m[r[0]][c[1]] * m[r[1]][c[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: Matrix, expected: Matrix, tolerance: f64) {
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < tolerance, "{found} {expected}");
        }
    }

    /// The values that profiles of sRGB state (sRGB2014.icc of the ICC).
    #[test]
    fn srgb_has_the_colorants_of_its_profiles() {
        let expected = [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]];
        assert_close(Primaries::SRGB.to_xyz(), expected, 3e-4);
        assert_close(xyz_to_srgb(Primaries::SRGB.to_xyz()), IDENTITY, 1e-12);
    }

    /// The matrix of CSS Color 4, section 18, from linear Display P3 to linear sRGB.
    #[test]
    fn display_p3_has_the_matrix_of_css() {
        let expected = [
            [1.224_940_2, -0.224_940_4, 0.0],
            [-0.042_056_9, 1.042_057_1, 0.0],
            [-0.019_637_6, -0.078_636_1, 1.098_273_6],
        ];
        assert_close(Primaries::DISPLAY_P3.to_srgb(), expected, 1e-5);
    }

    /// BT.2087-0, table 2 (inverse), and BT.2020-2, table 4.
    #[test]
    fn bt2020_has_the_matrix_and_luminance_of_its_standards() {
        let expected = [[1.660_5, -0.587_6, -0.072_8], [-0.124_6, 1.132_9, -0.008_3], [-0.018_2, -0.100_6, 1.118_7]];
        assert_close(Primaries::BT2020.to_srgb(), expected, 1e-4);
        let shares = Primaries::BT2020.luminance();
        for (share, expected) in shares.iter().zip([0.2627, 0.6780, 0.0593]) {
            assert!((share - expected).abs() < 1e-4, "{shares:?}");
        }
    }

    #[test]
    fn an_inverse_undoes_a_matrix() {
        assert_close(product(BRADFORD, inverse(BRADFORD)), IDENTITY, 1e-14);
    }
}
