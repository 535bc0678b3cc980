//! A PNG file of numbers: [`RawPng`].
//!
//! A label map says ids, not colours, so a sample is taken as it is stored: a palette is not looked up, and no bits are
//! spread over a larger range.

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, DecodingError, Reader, Transformations};

use super::picture::MOST_PIXELS;
use crate::types::words::words;

/// What the samples of a PNG file are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// Grey of 8 bits.
    Grey8,
    /// Grey of 16 bits.
    Grey16,
    /// Places in a palette, of 1 to 8 bits.
    Palette,
}

words!(Form { Grey8 = "8-bit grey", Grey16 = "16-bit grey", Palette = "palette" });

/// A PNG file of one number a pixel, not yet inflated.
pub(super) struct RawPng<'a> {
    reader: Reader<Cursor<&'a [u8]>>,
    /// Height and width.
    pub(super) size: (usize, usize),
}

impl<'a> RawPng<'a> {
    /// Reads the header; a file of another form than `forms` or of too many pixels is refused.
    pub(super) fn open(bytes: &'a [u8], forms: &[Form]) -> Result<Self, String> {
        let mut decoder = Decoder::new(Cursor::new(bytes));
        decoder.set_transformations(Transformations::IDENTITY);
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        let expected = forms.iter().map(Form::to_string).collect::<Vec<_>>();
        let expected = expected.join(" or ");
        let reader = decoder
            .read_info()
            .map_err(|e| format!("not a readable PNG ({e}); {expected} PNG expected"))?;
        let info = reader.info();
        let (width, height) = (info.width, info.height);
        if u64::from(width) * u64::from(height) > MOST_PIXELS {
            return Err(format!(
                "{width} × {height} pixels are more than the {MOST_PIXELS} that are read"
            ));
        }
        let form = form(info.color_type, info.bit_depth);
        if !form.is_some_and(|form| forms.contains(&form)) {
            return Err(format!(
                "{} PNG of {} bits; {expected} expected, whose samples are the values themselves",
                color(info.color_type),
                info.bit_depth as u8
            ));
        }
        Ok(Self {
            reader,
            size: (height as usize, width as usize),
        })
    }

    /// The samples, row by row, each as `of` makes it.
    pub(super) fn samples<T: Clone>(mut self, of: impl Fn(u16) -> T) -> Result<Vec<T>, String> {
        let not_whole = |e: DecodingError| format!("not a whole PNG: {e}");
        let bits = self.reader.info().bit_depth;
        let (height, width) = self.size;
        let mut samples = Vec::with_capacity(height * width);
        let mut take = |row: &[u8]| match bits {
            BitDepth::Sixteen => {
                let (pairs, _) = row.as_chunks::<2>();
                samples.extend(pairs.iter().map(|pair| of(u16::from_be_bytes(*pair))));
            }
            BitDepth::Eight => samples.extend(row.iter().map(|byte| of((*byte).into()))),
            BitDepth::One | BitDepth::Two | BitDepth::Four => {
                samples.extend((0..width).map(|x| of(sample(row, x, bits))));
            }
        };
        let line = self.reader.output_line_size(self.reader.info().width);
        let line = line.ok_or("too large for this machine")?;
        if self.reader.info().interlaced {
            let wide = self.reader.output_buffer_size();
            let mut bytes = vec![0; wide.ok_or("too large for this machine")?];
            self.reader.next_frame(&mut bytes).map_err(not_whole)?;
            bytes.chunks_exact(line).for_each(take);
        } else {
            let mut row = vec![0; line];
            while self.reader.read_row(&mut row).map_err(not_whole)?.is_some() {
                take(&row);
            }
        }
        if samples.len() != height * width {
            return Err("an animated PNG; a single image expected".to_owned());
        }
        Ok(samples)
    }
}

/// The sample at `x` of a row of so many bits a sample, as the PNG specification packs it (section 7.2): high bits first.
fn sample(row: &[u8], x: usize, bits: BitDepth) -> u16 {
    let bits = bits as usize;
    let (byte, place) = (x * bits / 8, x * bits % 8);
    u16::from((row[byte] << place) >> (8 - bits))
}

/// The form of a PNG file that has one.
///
/// Grey of fewer than 8 bits has none: such a file may as well be one of 8 bits that an optimiser packed, where 1 stands
/// for 255, 85 or 17.
fn form(color: ColorType, bits: BitDepth) -> Option<Form> {
    match (color, bits) {
        (ColorType::Grayscale, BitDepth::Eight) => Some(Form::Grey8),
        (ColorType::Grayscale, BitDepth::Sixteen) => Some(Form::Grey16),
        (ColorType::Indexed, _) => Some(Form::Palette),
        _ => None,
    }
}

fn color(color: ColorType) -> &'static str {
    match color {
        ColorType::Grayscale => "a grey",
        ColorType::Indexed => "a palette",
        ColorType::Rgb => "an RGB",
        ColorType::Rgba => "an RGBA",
        ColorType::GrayscaleAlpha => "a grey-and-alpha",
    }
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A PNG file of the given packed rows.
    pub(crate) fn png(
        (height, width): (u32, u32),
        color: ColorType,
        bits: BitDepth,
        data: &[u8],
    ) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(color);
        encoder.set_depth(bits);
        if color == ColorType::Indexed {
            // Every colour the same: were the palette looked up, no place would be told from another.
            encoder.set_palette(vec![200; 3 << (bits as u8)]);
        }
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn read(bytes: &[u8], forms: &[Form]) -> Result<Vec<u16>, String> {
        RawPng::open(bytes, forms)?.samples(|sample| sample)
    }

    #[test]
    fn places_in_a_palette_stay_places() {
        for (bits, data, expected) in [
            (
                BitDepth::Eight,
                vec![0, 7, 255, 1, 2, 3],
                [0, 7, 255, 1, 2, 3],
            ),
            (
                BitDepth::Four,
                vec![0x07, 0xf0, 0x12, 0x30],
                [0, 7, 15, 1, 2, 3],
            ),
            (
                BitDepth::Two,
                vec![0b00_01_11_00, 0b01_10_11_00],
                [0, 1, 3, 1, 2, 3],
            ),
            (
                BitDepth::One,
                vec![0b0110_0000, 0b1010_0000],
                [0, 1, 1, 1, 0, 1],
            ),
        ] {
            let bytes = png((2, 3), ColorType::Indexed, bits, &data);
            assert_eq!(
                read(&bytes, &[Form::Palette]).unwrap(),
                expected,
                "{bits:?}"
            );
        }
    }

    #[test]
    fn grey_is_read_as_it_is() {
        let shallow = png((1, 2), ColorType::Grayscale, BitDepth::Eight, &[40, 255]);
        assert_eq!(read(&shallow, &[Form::Grey8]).unwrap(), [40, 255]);
        let deep = png(
            (2, 1),
            ColorType::Grayscale,
            BitDepth::Sixteen,
            &[1, 2, 255, 255],
        );
        let opened = RawPng::open(&deep, &[Form::Grey16]).unwrap();
        assert_eq!(opened.size, (2, 1));
        assert_eq!(opened.samples(|sample| sample).unwrap(), [258, 65_535]);
    }

    #[test]
    fn other_forms_are_refused_by_name() {
        let (all, deep) = ([Form::Grey8, Form::Grey16, Form::Palette], [Form::Grey16]);
        for (color, bits, size, forms, says) in [
            (
                ColorType::Rgb,
                BitDepth::Eight,
                3,
                &all[..],
                "an RGB PNG of 8 bits; 8-bit grey or 16-bit grey or palette",
            ),
            (
                ColorType::Rgba,
                BitDepth::Sixteen,
                8,
                &all,
                "an RGBA PNG of 16 bits",
            ),
            (
                ColorType::GrayscaleAlpha,
                BitDepth::Eight,
                2,
                &all,
                "a grey-and-alpha PNG",
            ),
            (
                ColorType::Grayscale,
                BitDepth::Four,
                1,
                &all,
                "a grey PNG of 4 bits",
            ),
            (
                ColorType::Grayscale,
                BitDepth::Eight,
                1,
                &deep,
                "a grey PNG of 8 bits; 16-bit grey expected",
            ),
            (
                ColorType::Indexed,
                BitDepth::Eight,
                1,
                &deep,
                "a palette PNG of 8 bits; 16-bit grey expected",
            ),
        ] {
            let problem = read(&png((1, 1), color, bits, &vec![0; size]), forms).unwrap_err();
            assert!(problem.contains(says), "{problem}");
        }
        let problem = read(b"\xff\xd8\xff\xe0", &deep).unwrap_err();
        assert!(problem.starts_with("not a readable PNG"), "{problem}");
    }

    #[test]
    fn a_bomb_is_refused_before_it_is_inflated() {
        let mut bytes = png((1, 1), ColorType::Grayscale, BitDepth::Sixteen, &[0, 0]);
        bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        seal(&mut bytes);
        let problem = read(&bytes, &[Form::Grey16]).unwrap_err();
        assert!(
            problem.starts_with("65536 × 65536 pixels are more"),
            "{problem}"
        );
    }

    /// Makes the checksum of the file's header fit its changed content.
    fn seal(bytes: &mut [u8]) {
        let sum = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 }
            })
        })
    }

    proptest! {
        #[test]
        fn no_bytes_panic(at in 16_usize..90, value in any::<u8>(), end in 33_usize..100) {
            let mut bytes = png((3, 5), ColorType::Indexed, BitDepth::Two, &[0x1b; 6]);
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
            seal(&mut bytes);
            bytes.truncate(end);
            let _ = read(&bytes, &[Form::Grey8, Form::Grey16, Form::Palette]);
        }
    }
}
