//! The table of a profile from four inks to colours: [`InkTable`].

use moxcms::{DataColorSpace, LutDataType, LutMultidimensionalType, LutStore, LutWarehouse};

use crate::colour::curve::{ToneCurve, interpolated};
use crate::colour::primaries::{D50, IDENTITY, Matrix, times, xyz_to_srgb};
use crate::colour::srgb::EIGHT;

/// A table of colours at a grid of amounts of four inks, with a curve for each ink before it, and a curve for each value after it
/// (ICC.1:2022, sections 10.10 to 10.12). Between the points of the grid, colours are interpolated linearly along each ink.
#[derive(Debug)]
pub(super) struct InkTable {
    /// For each ink, the place in the grid of each of its 256 amounts: the point below, and the share of the way to the next.
    places: [Vec<(usize, f64)>; 4],
    /// The values of the grid, in [0, 1]; the last ink varies fastest.
    grid: Vec<[f64; 3]>,
    /// The distance in `grid` between two neighbours along each ink.
    steps: [usize; 4],
    after: After,
    /// The meaning of the values after the curves.
    values: Values,
    to_srgb: Matrix,
}

/// The steps from the values of the grid to the values of colours.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a profile has one")]
enum After {
    /// A curve each, as values at equal distances.
    Tables([Vec<f64>; 3]),
    /// A curve each, a matrix with an offset, and a curve each. Without them, the curves alone.
    Curves {
        first: Option<([ToneCurve; 3], Matrix, [f64; 3])>,
        last: [ToneCurve; 3],
    },
}

/// The meaning of three values in [0, 1] (ICC.1:2022, section 6.3.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Values {
    Xyz,
    /// CIELAB, with the full scale at 100 and 127.
    Lab,
    /// CIELAB in 16 bits of `lut16Type`, with the full scale a little above.
    LegacyLab,
}

impl InkTable {
    /// The table of a profile.
    ///
    /// # Errors
    /// If it is not one from four inks to three values, or is cut.
    pub(super) fn new(table: &LutWarehouse, connection: DataColorSpace) -> Result<Self, String> {
        let is_lab = match connection {
            DataColorSpace::Lab => true,
            DataColorSpace::Xyz => false,
            _ => return Err("its connection space is neither Lab nor XYZ".to_owned()),
        };
        match table {
            LutWarehouse::Lut(table) => Self::from_lut(table, is_lab),
            LutWarehouse::Multidimensional(table) => Self::from_a_to_b(table, is_lab),
        }
        .ok_or_else(|| "its table is not one from four inks to three values, or is cut".to_owned())
    }

    /// The table of the type `lut8Type` or `lut16Type`. `None` if it is broken.
    fn from_lut(table: &LutDataType, is_lab: bool) -> Option<Self> {
        if (table.num_input_channels, table.num_output_channels) != (4, 3) {
            return None;
        }
        let points = [usize::from(table.num_clut_grid_points); 4];
        let before = channels::<4>(&values(&table.input_table))?;
        let places = places(points, |ink, amount| interpolated(&before[ink], amount))?;
        let values = match (is_lab, &table.clut_table) {
            (false, _) => Values::Xyz,
            (true, LutStore::Store8(_)) => Values::Lab,
            (true, LutStore::Store16(_)) => Values::LegacyLab,
        };
        let after = After::Tables(channels::<3>(&self::values(&table.output_table))?);
        Self::build(points, places, &table.clut_table, after, values)
    }

    /// The table of the type `lutAToBType`. `None` if it is broken.
    fn from_a_to_b(table: &LutMultidimensionalType, is_lab: bool) -> Option<Self> {
        if (table.num_input_channels, table.num_output_channels) != (4, 3) {
            return None;
        }
        let points = [0, 1, 2, 3].map(|ink| usize::from(table.grid_points[ink]));
        let before = curves::<4>(&table.a_curves)?;
        let places = places(points, |ink, amount| before[ink].light(amount))?;
        let first = match &*table.m_curves {
            [] => None,
            curves => {
                let offset = [table.bias.v[0], table.bias.v[1], table.bias.v[2]];
                Some((self::curves::<3>(curves)?, table.matrix.v, offset))
            }
        };
        let last = curves::<3>(&table.b_curves)?;
        let after = After::Curves { first, last };
        let values = if is_lab { Values::Lab } else { Values::Xyz };
        Self::build(points, places, table.clut.as_ref()?, after, values)
    }

    fn build(
        points: [usize; 4],
        places: [Vec<(usize, f64)>; 4],
        grid: &LutStore,
        after: After,
        values: Values,
    ) -> Option<Self> {
        let grid = self::values(grid);
        let (grid, rest) = grid.as_chunks::<3>();
        let whole = points
            .iter()
            .try_fold(1_usize, |all, points| all.checked_mul(*points))?;
        (grid.len() == whole && rest.is_empty()).then(|| Self {
            places,
            grid: grid.to_vec(),
            steps: [
                points[1] * points[2] * points[3],
                points[2] * points[3],
                points[3],
                1,
            ],
            after,
            values,
            to_srgb: xyz_to_srgb(IDENTITY),
        })
    }

    /// The sRGB codes of amounts of ink, 0 for none and 255 for full. Colours that sRGB does not have are clipped.
    pub(super) fn srgb(&self, inks: [u8; 4]) -> [u8; 3] {
        let values = self.after(self.interpolated(inks));
        let xyz = match self.values {
            // 1 stands for 1 + 32767/32768.
            Values::Xyz => values.map(|value| value * 65_535.0 / 32_768.0),
            Values::Lab => xyz([
                values[0] * 100.0,
                values[1] * 255.0 - 128.0,
                values[2] * 255.0 - 128.0,
            ]),
            Values::LegacyLab => {
                let codes = values.map(|value| value * 65_535.0);
                xyz([
                    codes[0] / 652.8,
                    codes[1] / 256.0 - 128.0,
                    codes[2] / 256.0 - 128.0,
                ])
            }
        };
        times(self.to_srgb, xyz).map(|light| EIGHT.encode(light) as u8)
    }

    /// The value of the grid between its sixteen points around amounts of ink.
    fn interpolated(&self, inks: [u8; 4]) -> [f64; 3] {
        let places = [0, 1, 2, 3].map(|ink| self.places[ink][usize::from(inks[ink])]);
        let mut sum = [0.0; 3];
        for corner in 0..16_usize {
            let (mut at, mut weight) = (0, 1.0);
            for (ink, (below, share)) in places.iter().enumerate() {
                let is_above = corner >> ink & 1;
                at += (below + is_above) * self.steps[ink];
                weight *= if is_above == 1 { *share } else { 1.0 - share };
            }
            if weight > 0.0 {
                let value = self.grid[at];
                sum = [0, 1, 2].map(|i| sum[i] + weight * value[i]);
            }
        }
        sum
    }

    fn after(&self, values: [f64; 3]) -> [f64; 3] {
        match &self.after {
            After::Tables(tables) => [0, 1, 2].map(|i| interpolated(&tables[i], values[i])),
            After::Curves { first, last } => {
                let values = first.as_ref().map_or(values, |(curves, matrix, offset)| {
                    let values = times(*matrix, [0, 1, 2].map(|i| curves[i].light(values[i])));
                    [0, 1, 2].map(|i| (values[i] + offset[i]).clamp(0.0, 1.0))
                });
                [0, 1, 2].map(|i| last[i].light(values[i]))
            }
        }
    }
}

/// The numbers of a table in [0, 1].
fn values(table: &LutStore) -> Vec<f64> {
    match table {
        LutStore::Store8(codes) => codes.iter().map(|code| f64::from(*code) / 255.0).collect(),
        LutStore::Store16(codes) => codes
            .iter()
            .map(|code| f64::from(*code) / 65_535.0)
            .collect(),
    }
}

/// A table of one channel after another; `None` if a channel has fewer than two values.
fn channels<const N: usize>(values: &[f64]) -> Option<[Vec<f64>; N]> {
    let length = values.len() / N;
    if length < 2 || !values.len().is_multiple_of(N) {
        return None;
    }
    let channels: Vec<Vec<f64>> = values.chunks_exact(length).map(<[f64]>::to_vec).collect();
    channels.try_into().ok()
}

/// A curve each; `None` if there are fewer or more, or a number is not finite.
fn curves<const N: usize>(curves: &[moxcms::ToneReprCurve]) -> Option<[ToneCurve; N]> {
    let curves: Vec<ToneCurve> = curves
        .iter()
        .map(ToneCurve::from_profile)
        .collect::<Result<_, _>>()
        .ok()?;
    curves.try_into().ok()
}

/// The places in a grid of these numbers of points of the 256 amounts of each ink; `None` if an ink has no two points.
fn places(
    points: [usize; 4],
    before: impl Fn(usize, f64) -> f64,
) -> Option<[Vec<(usize, f64)>; 4]> {
    if points.iter().any(|points| *points < 2) {
        return None;
    }
    Some([0, 1, 2, 3].map(|ink| {
        let last = points[ink] - 1;
        (0..=u8::MAX)
            .map(|amount| {
                let at = before(ink, f64::from(amount) / 255.0).clamp(0.0, 1.0) * last as f64;
                let below = (at as usize).min(last - 1);
                (below, at - below as f64)
            })
            .collect()
    }))
}

/// XYZ of CIELAB with the white D50 (CIE 15:2018, section 8.2.1).
fn xyz([lightness, a, b]: [f64; 3]) -> [f64; 3] {
    let y = (lightness + 16.0) / 116.0;
    let roots = [y + a / 500.0, y, y - b / 200.0];
    [0, 1, 2].map(|i| {
        let root = roots[i];
        let share = if root > 6.0 / 29.0 {
            root * root * root
        } else {
            (root - 4.0 / 29.0) * 108.0 / 841.0
        };
        share * D50[i]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table of two points an ink, whose lightness falls by a quarter for each full ink, and whose a and b are 0.
    fn grey(is_16: bool) -> LutDataType {
        let zero = if is_16 { 0x8000 } else { 128 };
        let clut: Vec<u16> = (0..16_u16)
            .flat_map(|corner| {
                let most = if is_16 { 0xFF00 } else { 255 };
                [most - most / 4 * corner.count_ones() as u16, zero, zero]
            })
            .collect();
        let straight = |channels: usize| [0_u16, if is_16 { 65_535 } else { 255 }].repeat(channels);
        let store = |codes: Vec<u16>| {
            if is_16 {
                LutStore::Store16(codes)
            } else {
                LutStore::Store8(codes.iter().map(|code| *code as u8).collect())
            }
        };
        LutDataType {
            num_input_channels: 4,
            num_output_channels: 3,
            num_clut_grid_points: 2,
            matrix: moxcms::Matrix3d::IDENTITY,
            num_input_table_entries: 2,
            num_output_table_entries: 2,
            input_table: store(straight(4)),
            clut_table: store(clut),
            output_table: store(straight(3)),
            lut_type: if is_16 {
                moxcms::LutType::Lut16
            } else {
                moxcms::LutType::Lut8
            },
        }
    }

    #[test]
    fn lightness_becomes_codes() {
        for is_16 in [false, true] {
            let table = LutWarehouse::Lut(grey(is_16));
            let table = InkTable::new(&table, DataColorSpace::Lab).unwrap();
            // Codes of L* 100, 75, 50 (CSS Color 4: lab(50 0 0) is rgb(119 119 119), lab(75 0 0) is rgb(185 185 185)).
            for (inks, code) in [
                ([0, 0, 0, 0], 255_u8),
                ([0, 0, 0, 255], 185),
                ([255, 0, 255, 0], 119),
                ([128, 128, 128, 128], 119),
            ] {
                for found in table.srgb(inks) {
                    assert!(found.abs_diff(code) <= 1, "{inks:?}: {found}, not {code}");
                }
            }
        }
    }

    #[test]
    fn broken_tables_are_refused() {
        let cut = LutDataType {
            clut_table: LutStore::Store16(vec![0; 47]),
            ..grey(true)
        };
        let of_rgb = LutDataType {
            num_input_channels: 3,
            ..grey(true)
        };
        let without_curves = LutDataType {
            input_table: LutStore::Store16(Vec::new()),
            ..grey(true)
        };
        for table in [cut, of_rgb, without_curves] {
            let table = LutWarehouse::Lut(table);
            assert!(InkTable::new(&table, DataColorSpace::Lab).is_err());
        }
        let whole = LutWarehouse::Lut(grey(true));
        assert!(InkTable::new(&whole, DataColorSpace::Rgb).is_err());
    }
}
