//! PNG files whose samples are numbers such as ids, not colours: [`RawPng`].
//!
//! Samples are used as stored: a palette index is not replaced by its colour, and values are not scaled to a larger
//! range.

use std::fmt;
use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, DecodingError, Reader, Transformations};

use darkqa_base::types::text::words::words;

/// Type of the samples of a PNG file.
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
    /// All forms.
    pub const ALL: [Self; 3] = [Self::Grey8, Self::Grey16, Self::Palette];
}

words!(SampleForm { Grey8 = "8-bit grey", Grey16 = "16-bit grey", Palette = "palette" });

/// Reason why a PNG file is refused. The texts do not name the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RawPngError {
    /// The file is not a PNG file, or is damaged.
    Broken(String),
    /// The image has too many pixels.
    TooLarge(String),
    /// The samples have an unexpected form.
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
    /// If the file is not a PNG file, its form is not one of `forms`, or it has more than `max_pixels` pixels.
    pub fn open(bytes: &'a [u8], forms: &[SampleForm], max_pixels: u64) -> Result<Self, RawPngError> {
        let mut decoder = Decoder::new(Cursor::new(bytes));
        decoder.set_transformations(Transformations::IDENTITY);
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        let expected = forms.iter().map(SampleForm::to_string).collect::<Vec<_>>().join(" or ");
        let reader = decoder
            .read_info()
            .map_err(|e| RawPngError::Broken(format!("not a readable PNG ({e}); {expected} PNG expected")))?;
        let info = reader.info();
        let (width, height) = (info.width, info.height);
        if u64::from(width) * u64::from(height) > max_pixels {
            return Err(RawPngError::TooLarge(format!(
                "{width} × {height} pixels are more than the {max_pixels} that are read"
            )));
        }
        let form = sample_form(info.color_type, info.bit_depth);
        if !form.is_some_and(|form| forms.contains(&form)) {
            return Err(RawPngError::OtherForm(format!(
                "{} PNG of {} bits; {expected} expected, whose samples are the values themselves",
                color_name(info.color_type),
                info.bit_depth as u8
            )));
        }
        Ok(Self { reader, size: (height as usize, width as usize) })
    }

    /// Decompresses the samples, row by row, each converted by `convert`.
    pub fn samples<T: Clone>(mut self, convert: impl Fn(u16) -> T) -> Result<Vec<T>, String> {
        let bits = self.reader.info().bit_depth;
        let (height, width) = self.size;
        let mut samples = Vec::with_capacity(height * width);
        let row_size = self.reader.output_line_size(self.reader.info().width).ok_or("too large for this machine")?;
        if self.reader.info().interlaced {
            let size = self.reader.output_buffer_size().ok_or("too large for this machine")?;
            let mut bytes = vec![0; size];
            self.reader.next_frame(&mut bytes).map_err(|e| decoding_error(&e))?;
            for row in bytes.chunks_exact(row_size) {
                append_row(row, width, bits, &convert, &mut samples);
            }
        } else {
            let mut row = vec![0; row_size];
            while self.reader.read_row(&mut row).map_err(|e| decoding_error(&e))?.is_some() {
                append_row(&row, width, bits, &convert, &mut samples);
            }
        }
        if samples.len() != height * width {
            return Err("an animated PNG; a single image expected".to_owned());
        }
        Ok(samples)
    }
}

fn decoding_error(e: &DecodingError) -> String {
    format!("not a whole PNG: {e}")
}

/// Appends the `width` samples of a row, each converted by `convert`.
fn append_row<T>(row: &[u8], width: usize, bits: BitDepth, convert: impl Fn(u16) -> T, samples: &mut Vec<T>) {
    match bits {
        BitDepth::Sixteen => {
            let (pairs, _) = row.as_chunks::<2>();
            samples.extend(pairs.iter().map(|pair| convert(u16::from_be_bytes(*pair))));
        }
        BitDepth::Eight => samples.extend(row.iter().map(|byte| convert((*byte).into()))),
        BitDepth::One | BitDepth::Two | BitDepth::Four => {
            samples.extend((0..width).map(|x| convert(packed_sample(row, x, bits))));
        }
    }
}

/// The sample at `x` of a row with fewer than 8 bits per sample: high bits first (PNG specification, section 7.2).
fn packed_sample(row: &[u8], x: usize, bits: BitDepth) -> u16 {
    let bits = bits as usize;
    let (byte, shift) = (x * bits / 8, x * bits % 8);
    u16::from((row[byte] << shift) >> (8 - bits))
}

/// The form of the samples of a PNG file; `None` if they are unsuitable as ids.
///
/// Grey of fewer than 8 bits is refused: an optimiser may have packed an 8-bit file, so that 1 stands for 255, 85 or
/// 17.
fn sample_form(color: ColorType, bits: BitDepth) -> Option<SampleForm> {
    match (color, bits) {
        (ColorType::Grayscale, BitDepth::Eight) => Some(SampleForm::Grey8),
        (ColorType::Grayscale, BitDepth::Sixteen) => Some(SampleForm::Grey16),
        (ColorType::Indexed, _) => Some(SampleForm::Palette),
        _ => None,
    }
}

fn color_name(color: ColorType) -> &'static str {
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
