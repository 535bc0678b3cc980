//! PNG files whose samples are ids or other numbers: [`RawPng`].
//!
//! A label map holds ids, not colours, so a sample is used as it is stored: a palette index is not replaced by its colour,
//! and no value is scaled to a larger range.

use std::fmt;
use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, DecodingError, Reader, Transformations};

use darkqa_ground::types::text::words::words;

/// The form of the samples of a PNG file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleForm {
    /// Grey of 8 bits.
    Grey8,
    /// Grey of 16 bits.
    Grey16,
    /// Palette indices of 1 to 8 bits.
    Palette,
}

impl SampleForm {
    /// Each of the forms.
    pub const ALL: [Self; 3] = [Self::Grey8, Self::Grey16, Self::Palette];
}

words!(SampleForm { Grey8 = "8-bit grey", Grey16 = "16-bit grey", Palette = "palette" });

/// Why a PNG file is not read. The texts do not name the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RawPngError {
    /// The bytes are no PNG file, or are damaged.
    Broken(String),
    /// The image has too many pixels.
    TooLarge(String),
    /// The samples have another form than the expected ones.
    OtherForm(String),
}

impl fmt::Display for RawPngError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Broken(problem) | Self::TooLarge(problem) | Self::OtherForm(problem)) = self;
        f.write_str(problem)
    }
}

impl From<RawPngError> for String {
    fn from(error: RawPngError) -> Self {
        error.to_string()
    }
}

/// A PNG file with one number per pixel, not yet decompressed.
pub struct RawPng<'a> {
    reader: Reader<Cursor<&'a [u8]>>,
    /// Height and width in pixels.
    pub size: (usize, usize),
}

impl<'a> RawPng<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// If the file is no PNG, has another form than `forms`, or more than `most_pixels`.
    pub fn open(
        bytes: &'a [u8],
        forms: &[SampleForm],
        most_pixels: u64,
    ) -> Result<Self, RawPngError> {
        let mut decoder = Decoder::new(Cursor::new(bytes));
        decoder.set_transformations(Transformations::IDENTITY);
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        let expected = forms.iter().map(SampleForm::to_string).collect::<Vec<_>>();
        let expected = expected.join(" or ");
        let reader = decoder.read_info().map_err(|e| {
            RawPngError::Broken(format!("not a readable PNG ({e}); {expected} PNG expected"))
        })?;
        let info = reader.info();
        let (width, height) = (info.width, info.height);
        if u64::from(width) * u64::from(height) > most_pixels {
            return Err(RawPngError::TooLarge(format!(
                "{width} × {height} pixels are more than the {most_pixels} that are read"
            )));
        }
        let form = form(info.color_type, info.bit_depth);
        if !form.is_some_and(|form| forms.contains(&form)) {
            return Err(RawPngError::OtherForm(format!(
                "{} PNG of {} bits; {expected} expected, whose samples are the values themselves",
                color(info.color_type),
                info.bit_depth as u8
            )));
        }
        Ok(Self {
            reader,
            size: (height as usize, width as usize),
        })
    }

    /// The samples, row by row, each converted by `of`.
    pub fn samples<T: Clone>(mut self, of: impl Fn(u16) -> T) -> Result<Vec<T>, String> {
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

/// The sample at `x` of a row with fewer than 8 bits per sample: high bits first (PNG specification, section 7.2).
fn sample(row: &[u8], x: usize, bits: BitDepth) -> u16 {
    let bits = bits as usize;
    let (byte, place) = (x * bits / 8, x * bits % 8);
    u16::from((row[byte] << place) >> (8 - bits))
}

/// The form of the samples of a PNG file; `None` if ids cannot be read from them.
///
/// Grey of fewer than 8 bits is not read. Such a file may be an 8-bit one that an optimiser packed, in which 1 means 255,
/// 85 or 17.
fn form(color: ColorType, bits: BitDepth) -> Option<SampleForm> {
    match (color, bits) {
        (ColorType::Grayscale, BitDepth::Eight) => Some(SampleForm::Grey8),
        (ColorType::Grayscale, BitDepth::Sixteen) => Some(SampleForm::Grey16),
        (ColorType::Indexed, _) => Some(SampleForm::Palette),
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
mod tests;
