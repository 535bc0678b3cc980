//! Conversion of decoded video to sRGB: [`StatedColours`] and [`FrameConversion`].

use std::sync::Arc;

use crate::colour::{CodeDepth, CodePoints, ColourSpace, Meaning};
use darkqa_base::types::ColourHandling;

/// Primaries and transfer that a video states, by the numbers of ITU-T H.273, tables 2 and 3. The same rules hold for
/// images: the numbers in `cICP` of a PNG file have the same meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatedColours {
    /// Number of the primaries; 2 if they are not stated.
    pub primaries: u8,
    /// Number of the transfer; 2 if it is not stated.
    pub transfer: u8,
}

/// Conversion of RGB codes of 16 bits to sRGB codes of 8 bits.
#[derive(Debug, Clone)]
pub struct FrameConversion {
    space: Arc<ColourSpace>,
    /// Light of each code, per channel.
    tables: [Vec<f64>; 3],
}

impl StatedColours {
    /// The conversion of RGB codes of full range; `None` if they are taken as sRGB codes.
    ///
    /// # Errors
    /// If these colours are not converted. The error names the reason, without a remedy.
    pub fn conversion(self) -> Result<Option<FrameConversion>, String> {
        let points = CodePoints { primaries: self.primaries, transfer: self.transfer };
        // Frames have 8 bits at the end, in which linear light has too few codes.
        match points.meaning(CodeDepth::Eight)? {
            Meaning::Srgb | Meaning::Linear => Ok(None),
            Meaning::Other(space) => {
                Ok(Some(FrameConversion { tables: space.conversion.tables(u16::MAX.into()), space }))
            }
        }
    }
}

impl FrameConversion {
    /// Name of the colours, as `HLG (HDR), BT.2020`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.space.name()
    }

    /// True for HDR, where light above diffuse white becomes white.
    #[must_use]
    pub fn is_hdr(&self) -> bool {
        self.space.handling == ColourHandling::Clipped
    }

    /// Converts interleaved RGB samples. Also returns the number of pixels with a channel above white.
    #[must_use]
    pub fn convert(&self, samples: &[u16]) -> (Vec<u8>, usize) {
        let conversion = &self.space.conversion;
        let mut clipped = 0;
        let mut converted = Vec::with_capacity(samples.len());
        for pixel in samples.as_chunks::<3>().0 {
            let lights = [0, 1, 2].map(|i| self.tables[i][usize::from(pixel[i])]);
            let (codes, is_clipped) = conversion.encode_8(lights);
            clipped += usize::from(is_clipped);
            converted.extend(codes);
        }
        (converted, clipped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conversion(primaries: u8, transfer: u8) -> Option<FrameConversion> {
        StatedColours { primaries, transfer }.conversion().unwrap()
    }

    #[test]
    fn frames_have_the_codes_of_images() {
        let samples: Vec<u16> = (0..3000_u32).map(|i| (i * 7919 % 65_536) as u16).collect();
        for (primaries, transfer) in [(9, 16), (9, 18), (9, 1), (12, 13), (1, 5)] {
            let (frame, _) = conversion(primaries, transfer).unwrap().convert(&samples);
            let points = CodePoints { primaries, transfer };
            let Ok(Meaning::Other(space)) = points.meaning(CodeDepth::Sixteen) else {
                panic!("{primaries}/{transfer}")
            };
            let mut image = samples.clone();
            space.conversion.convert_16(&mut image);
            for (code, deep) in frame.iter().zip(&image) {
                assert!((f64::from(*code) - f64::from(*deep) / 257.0).abs() < 0.51);
            }
        }
    }

    #[test]
    fn pixels_above_white_are_counted() {
        let hlg = conversion(9, 18).unwrap();
        assert!(hlg.is_hdr());
        let [grey, white, above] = [0.5, 0.749, 0.8].map(|value| [(value * 65_535.0) as u16; 3]);
        let (codes, clipped) = hlg.convert(&[grey, white, above].concat());
        assert_eq!((clipped, codes[6]), (1, 255));
        assert!(codes[0] < 200 && codes[3] < 255, "{codes:?}");
        assert!(!conversion(9, 1).unwrap().is_hdr());
    }

    #[test]
    fn codes_of_sdr_video_are_kept() {
        assert!(conversion(1, 1).is_none());
        assert!(conversion(2, 2).is_none());
    }
}
