//! Conversion of images in cyan, magenta, yellow and black (CMYK) to sRGB: [`Inks`].
//!
//! Table of an ICC profile from CMYK ink amounts to colours: [`InkTable`].

use std::sync::{Arc, LazyLock};

use moxcms::{DataColorSpace, LutDataType, LutMultidimensionalType, LutStore, LutWarehouse};

use super::conversion::{D50, EIGHT, IDENTITY, Matrix, ToneCurve, interpolate, times, xyz_to_srgb};
use super::icc::InkProfile;
use super::{CACHED_PROFILES, ColourTag, MAX_PROFILE_BYTES, REMEDY, profile_too_large};
use crate::decode_rule::ColourRule;
use darkqa_base::types::values::Recent;
use darkqa_base::types::{ColourHandling, ColourNote, Digest};

/// Name of the colours of an image file without a profile, for its note.
const WITHOUT_PROFILE: &str = "CMYK without a profile";

/// Conversion of an image from CMYK to sRGB.
#[derive(Debug, Clone)]
pub(crate) enum Inks {
    /// Converts by a formula: each coloured ink absorbs its share of red, green or blue, and black absorbs its share of
    /// all three.
    Formula(ColourNote),
    /// Converts by the table of an ICC profile.
    Profile(Arc<CmykProfile>),
}

/// Table of a CMYK profile, with the profile's name and digest.
#[derive(Debug)]
pub(crate) struct CmykProfile {
    table: InkTable,
    name: String,
    digest: Digest,
}

impl Inks {
    /// Converts by the profile of the image file; by the formula if the file has none, or if the profile is ignored.
    ///
    /// # Errors
    /// If the profile is not for CMYK, or is broken. The message names the profile and the flag that ignores it.
    pub(crate) fn new(tag: &ColourTag, rule: ColourRule) -> Result<Self, String> {
        match (tag, rule) {
            (ColourTag::Profile(profile), ColourRule::Convert | ColourRule::Clip) => {
                cached_profile(profile).map(Self::Profile)
            }
            (ColourTag::Profile(_), ColourRule::Ignore) => Ok(Self::formula("CMYK, whose profile is ignored")),
            _ => Ok(Self::formula(WITHOUT_PROFILE)),
        }
    }

    /// Converts by the formula. `from` is the name of the colours in the note.
    fn formula(from: &str) -> Self {
        Self::Formula(ColourNote { from: from.to_owned(), profile: None, handling: ColourHandling::Converted })
    }

    /// Note about the conversion.
    pub(crate) fn note(&self) -> ColourNote {
        match self {
            Self::Formula(note) => note.clone(),
            Self::Profile(profile) => ColourNote {
                from: profile.name.clone(),
                profile: Some(profile.digest),
                handling: ColourHandling::Converted,
            },
        }
    }

    /// Converts pixels of four ink amounts, from 0 (none) to 255 (full), to sRGB codes of red, green and blue.
    pub(crate) fn srgb(&self, inks: &[u8]) -> Vec<u8> {
        let (pixels, _) = inks.as_chunks::<4>();
        match self {
            Self::Formula(_) => pixels.iter().flat_map(|inks| srgb_by_formula(*inks)).collect(),
            Self::Profile(profile) => {
                // Consecutive pixels with the same inks are converted once.
                let (mut last_inks, mut last_srgb) = ([0; 4], profile.table.srgb([0; 4]));
                pixels
                    .iter()
                    .flat_map(|inks| {
                        if last_inks != *inks {
                            last_inks = *inks;
                            last_srgb = profile.table.srgb(*inks);
                        }
                        last_srgb
                    })
                    .collect()
            }
        }
    }
}

/// Converts inks of unknown colour to sRGB codes (PostScript Language Reference, third edition, section 7.2.4, with
/// products in place of sums, as in programs that use libjpeg).
fn srgb_by_formula([cyan, magenta, yellow, black]: [u8; 4]) -> [u8; 3] {
    [cyan, magenta, yellow].map(|ink| {
        let light = u32::from(255 - ink) * u32::from(255 - black);
        ((light + 127) / 255) as u8
    })
}

/// Reads a profile. The most recent [`CACHED_PROFILES`] profiles are cached by their digests.
fn cached_profile(profile: &[u8]) -> Result<Arc<CmykProfile>, String> {
    static CACHE: LazyLock<Recent<Digest, Arc<CmykProfile>>> = LazyLock::new(|| Recent::new(CACHED_PROFILES));
    if profile.len() > MAX_PROFILE_BYTES {
        return Err(profile_too_large());
    }
    let digest = Digest::from_bytes(profile);
    CACHE.get(&digest, || {
        let (name, table) = name_and_table(profile).map_err(|problem| format!("{problem}; {REMEDY}"))?;
        Ok(Arc::new(CmykProfile { table, name, digest }))
    })
}

/// Reads the name and the table of a profile.
fn name_and_table(profile: &[u8]) -> Result<(String, InkTable), String> {
    let InkProfile { name, profile } = InkProfile::read(profile)?;
    // Both tables map the white of the paper to white. Most printer profiles have the colorimetric one.
    profile
        .lut_a_to_b_colorimetric
        .or(profile.lut_a_to_b_perceptual)
        .ok_or_else(|| "it has no table of colours (A2B)".to_owned())
        .and_then(|lut| InkTable::new(&lut, profile.pcs))
        .map_err(|reason| format!("the ICC profile {name:?} cannot be used: {reason}"))
        .map(|table| (name, table))
}

/// Table of colours on a grid of ink amounts, with a curve per ink before the grid, and a curve per value after it
/// (ICC.1:2022, sections 10.10 to 10.12). Between grid points, colours are interpolated linearly along each ink.
#[derive(Debug)]
pub(super) struct InkTable {
    /// Grid position of the 256 amounts of each ink: the point below, and the fraction of the way to the next point.
    positions: [Vec<(usize, f64)>; 4],
    /// Values of the grid points, in [0, 1]; the last ink varies fastest.
    grid: Vec<[f64; 3]>,
    /// Distance in `grid` between neighbours along each ink.
    strides: [usize; 4],
    after_grid: AfterGrid,
    /// Colour encoding of the values after these curves.
    encoding: ValueEncoding,
    to_srgb: Matrix,
}

/// Steps from the grid values to the colour values.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a profile has one")]
enum AfterGrid {
    /// One curve per value, with equally spaced entries.
    Tables([Vec<f64>; 3]),
    /// Optional first curves with a matrix and an offset, then the last curves.
    Curves { first: Option<([ToneCurve; 3], Matrix, [f64; 3])>, last: [ToneCurve; 3] },
}

/// Encoding of a colour as three values in [0, 1] (ICC.1:2022, section 6.3.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ValueEncoding {
    Xyz,
    /// CIELAB, where 1 is L* = 100, or a* and b* = 127.
    Lab,
    /// CIELAB in the 16 bits of `lut16Type`, where 1 is slightly above these.
    LegacyLab,
}

impl InkTable {
    /// Converts the table of a profile. `connection` is the profile connection space.
    ///
    /// # Errors
    /// If it does not map four inks to three values, or is truncated.
    fn new(table: &LutWarehouse, connection: DataColorSpace) -> Result<Self, String> {
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

    /// Converts a table of the type `lut8Type` or `lut16Type`; `None` if it is broken.
    fn from_lut(table: &LutDataType, is_lab: bool) -> Option<Self> {
        if (table.num_input_channels, table.num_output_channels) != (4, 3) {
            return None;
        }
        let points = [usize::from(table.num_clut_grid_points); 4];
        let before = split_channels::<4>(&unit_values(&table.input_table))?;
        let positions = grid_positions(points, |ink, amount| interpolate(&before[ink], amount))?;
        let encoding = match (is_lab, &table.clut_table) {
            (false, _) => ValueEncoding::Xyz,
            (true, LutStore::Store8(_)) => ValueEncoding::Lab,
            (true, LutStore::Store16(_)) => ValueEncoding::LegacyLab,
        };
        let after = AfterGrid::Tables(split_channels::<3>(&unit_values(&table.output_table))?);
        Self::build(points, positions, &table.clut_table, after, encoding)
    }

    /// Converts a table of the type `lutAToBType`; `None` if it is broken.
    fn from_a_to_b(table: &LutMultidimensionalType, is_lab: bool) -> Option<Self> {
        if (table.num_input_channels, table.num_output_channels) != (4, 3) {
            return None;
        }
        let points = [0, 1, 2, 3].map(|ink| usize::from(table.grid_points[ink]));
        let before = tone_curves::<4>(&table.a_curves)?;
        let positions = grid_positions(points, |ink, amount| before[ink].light(amount))?;
        let first = match &*table.m_curves {
            [] => None,
            curves => {
                let offset = [table.bias.v[0], table.bias.v[1], table.bias.v[2]];
                Some((tone_curves::<3>(curves)?, table.matrix.v, offset))
            }
        };
        let last = tone_curves::<3>(&table.b_curves)?;
        let after = AfterGrid::Curves { first, last };
        let encoding = if is_lab { ValueEncoding::Lab } else { ValueEncoding::Xyz };
        Self::build(points, positions, table.clut.as_ref()?, after, encoding)
    }

    /// Combines the parts of a table; `None` if the grid does not have the number of values that `points` requires.
    fn build(
        points: [usize; 4],
        positions: [Vec<(usize, f64)>; 4],
        grid: &LutStore,
        after_grid: AfterGrid,
        encoding: ValueEncoding,
    ) -> Option<Self> {
        let values = unit_values(grid);
        let (grid, rest) = values.as_chunks::<3>();
        let count = points.iter().try_fold(1_usize, |all, points| all.checked_mul(*points))?;
        (grid.len() == count && rest.is_empty()).then(|| Self {
            positions,
            grid: grid.to_vec(),
            strides: [points[1] * points[2] * points[3], points[2] * points[3], points[3], 1],
            after_grid,
            encoding,
            to_srgb: xyz_to_srgb(IDENTITY),
        })
    }

    /// Converts ink amounts, from 0 (none) to 255 (full), to sRGB codes. Colours outside the gamut of sRGB are clipped.
    fn srgb(&self, inks: [u8; 4]) -> [u8; 3] {
        let values = self.colour_values(self.grid_values(inks));
        let xyz = match self.encoding {
            // The value 1 means XYZ of 1 + 32767/32768.
            ValueEncoding::Xyz => values.map(|value| value * 65_535.0 / 32_768.0),
            ValueEncoding::Lab => {
                xyz_from_lab([values[0] * 100.0, values[1] * 255.0 - 128.0, values[2] * 255.0 - 128.0])
            }
            ValueEncoding::LegacyLab => {
                let codes = values.map(|value| value * 65_535.0);
                xyz_from_lab([codes[0] / 652.8, codes[1] / 256.0 - 128.0, codes[2] / 256.0 - 128.0])
            }
        };
        times(self.to_srgb, xyz).map(|light| EIGHT.encode(light) as u8)
    }

    /// Interpolates the grid between the sixteen points around the ink amounts.
    fn grid_values(&self, inks: [u8; 4]) -> [f64; 3] {
        let positions = [0, 1, 2, 3].map(|ink| self.positions[ink][usize::from(inks[ink])]);
        let mut sum = [0.0; 3];
        for corner in 0..16_usize {
            let (mut index, mut weight) = (0, 1.0);
            for (ink, (below, fraction)) in positions.iter().enumerate() {
                let is_above = corner >> ink & 1;
                index += (below + is_above) * self.strides[ink];
                weight *= if is_above == 1 { *fraction } else { 1.0 - fraction };
            }
            if weight > 0.0 {
                let value = self.grid[index];
                sum = [0, 1, 2].map(|i| sum[i] + weight * value[i]);
            }
        }
        sum
    }

    /// Applies the curves and the matrix after the grid.
    fn colour_values(&self, values: [f64; 3]) -> [f64; 3] {
        match &self.after_grid {
            AfterGrid::Tables(tables) => [0, 1, 2].map(|i| interpolate(&tables[i], values[i])),
            AfterGrid::Curves { first, last } => {
                let values = first.as_ref().map_or(values, |(curves, matrix, offset)| {
                    let values = times(*matrix, [0, 1, 2].map(|i| curves[i].light(values[i])));
                    [0, 1, 2].map(|i| (values[i] + offset[i]).clamp(0.0, 1.0))
                });
                [0, 1, 2].map(|i| last[i].light(values[i]))
            }
        }
    }
}

/// The numbers of a table, scaled to [0, 1].
fn unit_values(table: &LutStore) -> Vec<f64> {
    match table {
        LutStore::Store8(codes) => codes.iter().map(|code| f64::from(*code) / 255.0).collect(),
        LutStore::Store16(codes) => codes.iter().map(|code| f64::from(*code) / 65_535.0).collect(),
    }
}

/// Splits a table into `N` channels of equal length; `None` if a channel has fewer than two values.
fn split_channels<const N: usize>(values: &[f64]) -> Option<[Vec<f64>; N]> {
    let length = values.len() / N;
    if length < 2 || !values.len().is_multiple_of(N) {
        return None;
    }
    values.chunks_exact(length).map(<[f64]>::to_vec).collect::<Vec<Vec<f64>>>().try_into().ok()
}

/// Converts `N` curves; `None` for another number of curves, or if a parameter is not finite.
fn tone_curves<const N: usize>(curves: &[moxcms::ToneReprCurve]) -> Option<[ToneCurve; N]> {
    curves.iter().map(ToneCurve::from_profile).collect::<Result<Vec<ToneCurve>, _>>().ok()?.try_into().ok()
}

/// The grid positions of the 256 amounts of each ink. `points` is the number of grid points per ink, `before` the curve
/// per ink. `None` if an ink has fewer than two points.
fn grid_positions(points: [usize; 4], before: impl Fn(usize, f64) -> f64) -> Option<[Vec<(usize, f64)>; 4]> {
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

/// Converts CIELAB with the white D50 to XYZ (CIE 15:2018, section 8.2.1).
fn xyz_from_lab([lightness, a, b]: [f64; 3]) -> [f64; 3] {
    let y = (lightness + 16.0) / 116.0;
    let roots = [y + a / 500.0, y, y - b / 200.0];
    [0, 1, 2].map(|i| {
        let root = roots[i];
        let relative = if root > 6.0 / 29.0 { root * root * root } else { (root - 4.0 / 29.0) * 108.0 / 841.0 };
        relative * D50[i]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inks_without_a_profile_are_converted_by_the_formula() {
        let inks = Inks::new(&ColourTag::None, ColourRule::Convert).unwrap();
        assert_eq!(inks.note().from, "CMYK without a profile");
        for (amounts, codes) in [
            ([0, 0, 0, 0], [255, 255, 255]),
            ([255, 0, 0, 0], [0, 255, 255]),
            ([0, 0, 0, 255], [0, 0, 0]),
            ([0, 51, 102, 128], [127, 102, 76]),
        ] {
            assert_eq!(inks.srgb(&amounts), codes, "{amounts:?}");
        }
    }

    #[test]
    fn an_rgb_profile_is_refused_and_can_be_ignored() {
        let mut profile = vec![0; 200];
        profile[16..20].copy_from_slice(b"RGB ");
        let tag = ColourTag::Profile(profile);
        let problem = Inks::new(&tag, ColourRule::Convert).unwrap_err();
        assert!(problem.contains("not for CMYK") && problem.contains("--decode colour=ignore"), "{problem}");
        let ignored = Inks::new(&tag, ColourRule::Ignore).unwrap();
        assert_eq!(ignored.srgb(&[0, 0, 0, 255]), [0, 0, 0]);
    }

    fn lut_store(codes: Vec<u16>, is_16: bool) -> LutStore {
        if is_16 { LutStore::Store16(codes) } else { LutStore::Store8(codes.iter().map(|code| *code as u8).collect()) }
    }

    /// A table with two points per ink, whose lightness falls by a quarter for each full ink, and whose a and b are 0.
    fn grey_table(is_16: bool) -> LutDataType {
        let zero = if is_16 { 0x8000 } else { 128 };
        let clut: Vec<u16> = (0..16_u16)
            .flat_map(|corner| {
                let white = if is_16 { 0xFF00 } else { 255 };
                [white - white / 4 * corner.count_ones() as u16, zero, zero]
            })
            .collect();
        let identity = [0_u16, if is_16 { 65_535 } else { 255 }];
        LutDataType {
            num_input_channels: 4,
            num_output_channels: 3,
            num_clut_grid_points: 2,
            matrix: moxcms::Matrix3d::IDENTITY,
            num_input_table_entries: 2,
            num_output_table_entries: 2,
            input_table: lut_store(identity.repeat(4), is_16),
            clut_table: lut_store(clut, is_16),
            output_table: lut_store(identity.repeat(3), is_16),
            lut_type: if is_16 { moxcms::LutType::Lut16 } else { moxcms::LutType::Lut8 },
        }
    }

    #[test]
    fn lightness_is_converted_to_codes() {
        for is_16 in [false, true] {
            let table = LutWarehouse::Lut(grey_table(is_16));
            let table = InkTable::new(&table, DataColorSpace::Lab).unwrap();
            // Codes of L* 100, 75, 50 (CSS Color 4: lab(50 0 0) is rgb(119 119 119), lab(75 0 0) is rgb(185 185 185)).
            for (inks, code) in
                [([0, 0, 0, 0], 255_u8), ([0, 0, 0, 255], 185), ([255, 0, 255, 0], 119), ([128, 128, 128, 128], 119)]
            {
                for found in table.srgb(inks) {
                    assert!(found.abs_diff(code) <= 1, "{inks:?}: {found}, not {code}");
                }
            }
        }
    }

    #[test]
    fn broken_tables_are_refused() {
        let truncated = LutDataType { clut_table: LutStore::Store16(vec![0; 47]), ..grey_table(true) };
        let for_rgb = LutDataType { num_input_channels: 3, ..grey_table(true) };
        let without_curves = LutDataType { input_table: LutStore::Store16(Vec::new()), ..grey_table(true) };
        for table in [truncated, for_rgb, without_curves] {
            let table = LutWarehouse::Lut(table);
            assert!(InkTable::new(&table, DataColorSpace::Lab).is_err());
        }
        let whole = LutWarehouse::Lut(grey_table(true));
        assert!(InkTable::new(&whole, DataColorSpace::Rgb).is_err());
    }
}
