//! Uncompressed image of a camera driver, without a file format: [`RawImage`].

mod layout;
mod mosaic;
mod yuv;

use std::borrow::Cow;

use darkqa_base::error::Error;
use darkqa_base::types::{Image, Rgb, Rgb16Image};

use self::layout::{Depth, Layout, Order};
use self::mosaic::{RawSample, demosaic};
use self::yuv::YuvLayout;
use super::decode_rule::MAX_PIXELS;
use super::encoding::{png, png_16};

/// Uncompressed image of a camera driver. Encodings have the names of ROS (`sensor_msgs/image_encodings.hpp`).
#[derive(Debug, Clone)]
pub struct RawImage<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Bytes from the start of one row to the start of the next; rows may end with padding.
    pub step: usize,
    /// Name of the encoding, such as `bgr8` or `bayer_rggb16`.
    pub encoding: String,
    /// True if 16-bit samples have their high byte first.
    pub is_big_endian: bool,
    /// The rows, with their padding.
    pub data: Cow<'a, [u8]>,
}

/// The pixels of a raw image, in the bit depth of its samples.
#[derive(Debug, PartialEq, Eq)]
pub enum RawPixels {
    /// 8-bit codes.
    Codes8(Rgb),
    /// 16-bit codes.
    Rgb16Image(Rgb16Image),
}

impl RawPixels {
    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Codes8(image) => (image.width(), image.height()),
            Self::Rgb16Image(image) => (image.width(), image.height()),
        }
    }

    /// The largest sample of a 16-bit image; `None` for 8 bits.
    pub fn peak_16(&self) -> Option<u16> {
        match self {
            Self::Codes8(_) => None,
            Self::Rgb16Image(image) => image.samples().iter().copied().max(),
        }
    }

    /// Scales a 16-bit image so that `white` becomes 65535, and clips larger codes. Images of 8 bits do not change.
    #[must_use]
    pub fn with_white(self, white: u16) -> Self {
        let Self::Rgb16Image(mut image) = self else {
            return self;
        };
        let white = u32::from(white.max(1));
        for sample in image.samples_mut() {
            let scaled = (u32::from(*sample) * u32::from(u16::MAX) + white / 2) / white;
            *sample = u16::try_from(scaled).unwrap_or(u16::MAX);
        }
        Self::Rgb16Image(image)
    }

    /// Encodes the image as a PNG file of the same bit depth.
    ///
    /// # Errors
    /// If a side is too long for the format.
    pub fn png(&self) -> Result<Vec<u8>, Error> {
        match self {
            Self::Codes8(image) => png(image),
            Self::Rgb16Image(image) => png_16(image),
        }
    }
}

/// True for the name of an encoding in YUV, such as `yuv422_yuy2` or `nv12`. Messages do not state its matrix and
/// range.
pub fn is_yuv(encoding: &str) -> bool {
    YuvLayout::from_encoding(encoding).is_some()
}

impl RawImage<'_> {
    /// True if images of this encoding can be decoded.
    pub fn has_known_encoding(&self) -> bool {
        self.is_yuv() || Layout::from_encoding(&self.encoding).is_ok()
    }

    /// True for an image in YUV.
    pub fn is_yuv(&self) -> bool {
        is_yuv(&self.encoding)
    }

    /// Converts the image to RGB: grey becomes three equal channels, alpha is dropped, a mosaic is interpolated
    /// bilinearly, and YUV is converted by the matrix of BT.601 for the limited range.
    ///
    /// # Errors
    /// If the encoding is unknown, or the data are shorter than the size requires.
    pub fn decode(&self) -> Result<RawPixels, String> {
        if let Some(layout) = YuvLayout::from_encoding(&self.encoding) {
            self.check_size()?;
            let samples = layout
                .decode([self.width, self.height], self.step, &self.data)
                .map_err(|problem| format!("{}: {problem}", self.encoding))?;
            let image = Image::new(self.height, self.width, samples);
            return image.map(RawPixels::Codes8).map_err(|e| e.to_string());
        }
        let layout = Layout::from_encoding(&self.encoding)?;
        self.check_size()?;
        let rows = self.rows_of(self.width * layout.channels * layout.depth.bytes())?;
        let pixels = match layout.depth {
            Depth::Eight => RawPixels::Codes8(self.image(layout, rows, |row, samples| {
                samples.extend_from_slice(row);
            })?),
            Depth::Sixteen => RawPixels::Rgb16Image(self.image(layout, rows, |row, samples| {
                let pairs = row.as_chunks::<2>().0.iter();
                if self.is_big_endian {
                    samples.extend(pairs.map(|pair| u16::from_be_bytes(*pair)));
                } else {
                    samples.extend(pairs.map(|pair| u16::from_le_bytes(*pair)));
                }
            })?),
        };
        Ok(pixels)
    }

    /// Refuses an image without pixels or with too many.
    fn check_size(&self) -> Result<(), String> {
        let (width, height) = (self.width, self.height);
        let pixels = (width as u64).saturating_mul(height as u64);
        if pixels == 0 || pixels > MAX_PIXELS {
            return Err(format!("{width} × {height} pixels; 1 to {MAX_PIXELS} pixels expected"));
        }
        Ok(())
    }

    /// The rows without their padding. `row` is the length of a row in bytes.
    fn rows_of(&self, row: usize) -> Result<impl Iterator<Item = &[u8]>, String> {
        let Self { width, height, step, ref data, .. } = *self;
        if step < row {
            return Err(format!("rows of {step} bytes; {width} pixels of {} need {row}", self.encoding));
        }
        let needed = step.saturating_mul(height - 1).saturating_add(row);
        if data.len() < needed {
            return Err(format!("{} bytes; {height} rows of {step} bytes expected", data.len()));
        }
        Ok(data.chunks(step).take(height).map(move |line| &line[..row]))
    }

    /// Builds the image. `read` appends the samples of one row to a buffer.
    fn image<'a, T: RawSample>(
        &self,
        layout: Layout,
        rows: impl Iterator<Item = &'a [u8]>,
        read: impl Fn(&[u8], &mut Vec<T>),
    ) -> Result<Image<T>, String> {
        let (width, height) = (self.width, self.height);
        let mut samples = Vec::with_capacity(width * height * 3);
        match layout.order {
            Order::Channels([0, 1, 2]) if layout.channels == 3 => {
                rows.for_each(|row| read(row, &mut samples));
            }
            Order::Channels(order) => {
                let mut line = Vec::with_capacity(width * layout.channels);
                for row in rows {
                    line.clear();
                    read(row, &mut line);
                    for pixel in line.chunks_exact(layout.channels) {
                        samples.extend_from_slice(&order.map(|channel| pixel[channel]));
                    }
                }
            }
            Order::Mosaic(red) => {
                let mut sites = Vec::with_capacity(width * height);
                rows.for_each(|row| read(row, &mut sites));
                demosaic(&sites, width, red, &mut samples);
            }
        }
        Image::new(height, width, samples).map_err(|e| e.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image<'a>(encoding: &str, size: [usize; 2], step: usize, data: &'a [u8]) -> RawImage<'a> {
        RawImage {
            width: size[0],
            height: size[1],
            step,
            encoding: encoding.to_owned(),
            is_big_endian: false,
            data: data.into(),
        }
    }

    /// The samples of an image of one row of two pixels.
    fn samples_8(encoding: &str, data: &[u8]) -> Vec<u8> {
        match image(encoding, [2, 1], data.len(), data).decode() {
            Ok(RawPixels::Codes8(image)) => image.samples().to_vec(),
            other => panic!("{encoding}: {other:?}"),
        }
    }

    #[test]
    fn channels_are_reordered_to_rgb() {
        assert_eq!(samples_8("rgb8", &[1, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6]);
        assert_eq!(samples_8("bgr8", &[1, 2, 3, 4, 5, 6]), [3, 2, 1, 6, 5, 4]);
        assert_eq!(samples_8("8UC3", &[1, 2, 3, 4, 5, 6]), [3, 2, 1, 6, 5, 4]);
        let four = [1, 2, 3, 0, 4, 5, 6, 9];
        assert_eq!(samples_8("rgba8", &four), [1, 2, 3, 4, 5, 6]);
        assert_eq!(samples_8("bgra8", &four), [3, 2, 1, 6, 5, 4]);
        assert_eq!(samples_8("mono8", &[7, 9]), [7, 7, 7, 9, 9, 9]);
    }

    #[test]
    fn padding_of_rows_is_skipped() {
        let data = [1, 2, 3, 99, 4, 5, 6, 99];
        let RawPixels::Codes8(found) = image("rgb8", [1, 2], 4, &data).decode().unwrap() else {
            panic!("8 bits expected")
        };
        assert_eq!(found.samples(), [1, 2, 3, 4, 5, 6]);
        // The padding of the last row may be missing.
        assert!(image("rgb8", [1, 2], 4, &data[..7]).decode().is_ok());
        assert!(image("rgb8", [1, 2], 4, &data[..6]).decode().is_err());
    }

    #[test]
    fn sixteen_bits_keep_their_byte_order_and_scale() {
        let mut raw = image("mono16", [2, 1], 4, &[0x34, 0x12, 0xff, 0x0f]);
        let little = raw.decode().unwrap();
        assert_eq!(little.peak_16(), Some(0x1234));
        raw.is_big_endian = true;
        assert_eq!(raw.decode().unwrap().peak_16(), Some(0xff0f));
        let RawPixels::Rgb16Image(scaled) = little.with_white(4095) else { panic!("16 bits expected") };
        assert_eq!(scaled.samples()[3..], [65535; 3]);
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        for (encoding, size, step, bytes, expected) in [
            ("rgb8", [0, 1], 3, 3, "0 × 1 pixels"),
            ("rgb8", [2, 1], 3, 6, "rows of 3 bytes; 2 pixels of rgb8 need 6"),
            ("mono16", [2, 2], 4, 7, "7 bytes; 2 rows of 4 bytes expected"),
            ("rgb8", [usize::MAX, 2], usize::MAX, 9, "pixels; 1 to"),
            ("rgb8", [1, 9], usize::MAX, 9, "9 bytes; 9 rows"),
            ("16UC1", [1, 1], 2, 2, "depth"),
            ("yuv420p", [1, 1], 2, 2, "unknown encoding"),
        ] {
            let data = vec![0; bytes];
            let problem = image(encoding, size, step, &data).decode().unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
    }
}
