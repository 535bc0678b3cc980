//! Uncompressed image of a camera driver, without a file format: [`RawImage`].
//!
//! Arrangement of the samples in a raw image: [`SampleLayout`].
//!
//! Demosaicing of integer codes, for all four Bayer patterns: [`demosaic`].
//!
//! The crate `light` has another implementation, for linear light in floats, for patterns that begin with red.
//!
//! Images in YUV with 8 bits a sample: [`YuvLayout`].

use std::borrow::Cow;

use super::decode_rule::MAX_PIXELS;
use super::payload::{png, png_16};
use darkqa_base::error::Error;
use darkqa_base::types::{Image, Rgb, Rgb16Image, Sample};

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
        self.is_yuv() || SampleLayout::from_encoding(&self.encoding).is_ok()
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
        let layout = SampleLayout::from_encoding(&self.encoding)?;
        self.check_size()?;
        let rows = self.rows_of(self.width * layout.channels * layout.depth.bytes())?;
        let pixels = match layout.depth {
            BitDepth::Eight => RawPixels::Codes8(self.image(layout, rows, |row, samples| {
                samples.extend_from_slice(row);
            })?),
            BitDepth::Sixteen => RawPixels::Rgb16Image(self.image(layout, rows, |row, samples| {
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
        layout: SampleLayout,
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

/// Arrangement of the samples of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SampleLayout {
    channels: usize,
    depth: BitDepth,
    order: Order,
}

/// Bit depth of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BitDepth {
    Eight,
    Sixteen,
}

/// Meaning of the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Indices of the red, green and blue channels.
    Channels([usize; 3]),
    /// One channel behind a Bayer mosaic, with row and column (0 or 1) of the first red site.
    Mosaic([usize; 2]),
}

impl BitDepth {
    /// Size of a sample, in bytes.
    fn bytes(self) -> usize {
        match self {
            Self::Eight => 1,
            Self::Sixteen => 2,
        }
    }
}

impl SampleLayout {
    /// The layout of an encoding, by its name in ROS or Foxglove. `8UC3` and `8UC4` have the channel order of OpenCV
    /// (BGR).
    ///
    /// # Errors
    /// If the encoding is unknown, or its numbers are not colours.
    fn from_encoding(encoding: &str) -> Result<Self, String> {
        let (rgb, bgr) = (Order::Channels([0, 1, 2]), Order::Channels([2, 1, 0]));
        let (name, depth) = match encoding {
            "8UC1" => ("mono", BitDepth::Eight),
            "8UC3" => ("bgr", BitDepth::Eight),
            "8UC4" => ("bgra", BitDepth::Eight),
            _ => match (encoding.strip_suffix("16"), encoding.strip_suffix('8')) {
                (Some(name), _) => (name, BitDepth::Sixteen),
                (None, Some(name)) => (name, BitDepth::Eight),
                (None, None) => (encoding, BitDepth::Eight),
            },
        };
        let (channels, order) = match name {
            "mono" => (1, Order::Channels([0; 3])),
            "rgb" => (3, rgb),
            "bgr" => (3, bgr),
            "rgba" => (4, rgb),
            "bgra" => (4, bgr),
            "bayer_rggb" => (1, Order::Mosaic([0, 0])),
            "bayer_grbg" => (1, Order::Mosaic([0, 1])),
            "bayer_gbrg" => (1, Order::Mosaic([1, 0])),
            "bayer_bggr" => (1, Order::Mosaic([1, 1])),
            "16UC1" | "32FC1" => {
                return Err(format!("encoding {encoding:?} is depth or another measure, not an image"));
            }
            _ => {
                return Err(format!(
                    "unknown encoding {encoding:?}; rgb8, bgr8, rgba8, bgra8, mono8, bayer_*8 or the same with 16, uyvy, yuyv, nv12, nv21, nv16, nv61 or nv24 expected"
                ));
            }
        };
        Ok(Self { channels, depth, order })
    }
}

/// A sample of a raw image.
pub(super) trait RawSample: Sample + Into<u32> + TryFrom<u32> {}

impl RawSample for u8 {}

impl RawSample for u16 {}

/// Appends the RGB samples of a Bayer mosaic. A missing colour of a site is the rounded mean of the two or four nearest
/// sites with that colour; beyond an edge, rows and columns are mirrored. `red` is the row and column (0 or 1) of the
/// first red site.
fn demosaic<T: RawSample>(sites: &[T], width: usize, red: [usize; 2], samples: &mut Vec<T>) {
    let height = sites.len() / width;
    for y in 0..height {
        let [above, below] = neighbours(y, height).map(|row| &sites[row * width..][..width]);
        let here = &sites[y * width..][..width];
        for x in 0..width {
            let [left, right] = neighbours(x, width);
            let site = here[x];
            let cross = [above[x], below[x], here[left], here[right]];
            let corners = [above[left], above[right], below[left], below[right]];
            // Two neighbours are repeated, so that every mean is of four samples.
            let horizontal = [here[left], here[left], here[right], here[right]];
            let vertical = [above[x], above[x], below[x], below[x]];
            samples.extend_from_slice(&match (y % 2 == red[0], x % 2 == red[1]) {
                (true, true) => [site, mean(cross), mean(corners)],
                (false, false) => [mean(corners), mean(cross), site],
                (true, false) => [mean(horizontal), site, mean(vertical)],
                (false, true) => [mean(vertical), site, mean(horizontal)],
            });
        }
    }
}

/// The mean of four samples, rounded half up.
fn mean<T: RawSample>(sites: [T; 4]) -> T {
    let sum: u32 = sites.into_iter().map(Into::into).sum();
    T::try_from((sum + 2) / 4).unwrap_or_default()
}

/// The indices before and after `i` below `count`, mirrored at the edges so that they keep their parity.
fn neighbours(i: usize, count: usize) -> [usize; 2] {
    let last = count - 1;
    let before = if i == 0 { 1.min(last) } else { i - 1 };
    let after = if i == last { last.saturating_sub(1) } else { i + 1 };
    [before, after]
}

/// Arrangement of the samples of an image in YUV, as V4L2 defines it for the pixel format of the same name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum YuvLayout {
    /// Two pixels share four bytes.
    Packed {
        /// Positions of the two luma samples, of U and of V in the four bytes.
        luma: [usize; 2],
        u: usize,
        v: usize,
    },
    /// A plane of luma samples, then a plane of pairs of chroma samples.
    Planes {
        /// Columns and rows that share a pair.
        shared: [usize; 2],
        /// Position of U in a pair, 0 or 1.
        u: usize,
    },
}

impl YuvLayout {
    /// The layout of an encoding, by its name in ROS, Foxglove or V4L2; `None` if it is not one of YUV. ROS names UYVY
    /// `yuv422` (`sensor_msgs/image_encodings.hpp`).
    fn from_encoding(encoding: &str) -> Option<Self> {
        let packed = |luma, u, v| Self::Packed { luma, u, v };
        let planes = |shared, u| Self::Planes { shared, u };
        Some(match &*encoding.to_ascii_lowercase() {
            "uyvy" | "yuv422" => packed([1, 3], 0, 2),
            "vyuy" => packed([1, 3], 2, 0),
            "yuyv" | "yuy2" | "yuv422_yuy2" => packed([0, 2], 1, 3),
            "yvyu" => packed([0, 2], 3, 1),
            "nv12" => planes([2, 2], 0),
            "nv21" => planes([2, 2], 1),
            "nv16" => planes([2, 1], 0),
            "nv61" => planes([2, 1], 1),
            "nv24" => planes([1, 1], 0),
            "nv42" => planes([1, 1], 1),
            _ => return None,
        })
    }

    /// Converts an image to RGB samples, with the chroma of the nearest pair. `step` is the number of bytes from the
    /// start of one row to the start of the next.
    ///
    /// # Errors
    /// If the width is odd where two columns share their chroma, or the data are shorter than the size requires.
    fn decode(self, [width, height]: [usize; 2], step: usize, data: &[u8]) -> Result<Vec<u8>, String> {
        let is_shared = !matches!(self, Self::Planes { shared: [1, _], .. });
        if is_shared && !width.is_multiple_of(2) {
            return Err(format!("{width} columns; an even number expected"));
        }
        match self {
            Self::Packed { luma, u, v } => {
                let row = width * 2;
                let needed = step.saturating_mul(height - 1).saturating_add(row);
                if step < row || data.len() < needed {
                    let count = data.len();
                    return Err(format!(
                        "{count} bytes in rows of {step}; {width} × {height} pixels need rows of {row}"
                    ));
                }
                let mut samples = Vec::with_capacity(width * height * 3);
                let rows = data.chunks(step).take(height);
                for pair in rows.flat_map(|line| line[..row].chunks_exact(4)) {
                    for position in luma {
                        samples.extend(rgb(pair[position], pair[u], pair[v]));
                    }
                }
                Ok(samples)
            }
            Self::Planes { shared, u } => {
                let chroma_rows = height.div_ceil(shared[1]);
                // V4L2: a row of chroma has the length of a row of luma if two columns share a pair, else twice the
                // length.
                let needed = |stride: usize| {
                    let chroma = (stride.saturating_mul(2) / shared[0]).saturating_mul(chroma_rows);
                    stride.saturating_mul(height).saturating_add(chroma)
                };
                // Some drivers state the bytes of all planes for a row of pixels; their rows have no padding.
                let stride = [step, width]
                    .into_iter()
                    .find(|stride| *stride >= width && needed(*stride) <= data.len())
                    .ok_or_else(|| {
                        let (count, needed) = (data.len(), needed(width));
                        format!("{count} bytes; {width} × {height} pixels need {needed}")
                    })?;
                let mut samples = Vec::with_capacity(width * height * 3);
                let (luma, chroma) = data.split_at(stride * height);
                let chroma_stride = stride * 2 / shared[0];
                for y in 0..height {
                    let row = &luma[y * stride..][..width];
                    let pairs = &chroma[y / shared[1] * chroma_stride..];
                    for (x, luma) in row.iter().enumerate() {
                        let pair = &pairs[x / shared[0] * 2..][..2];
                        samples.extend(rgb(*luma, pair[u], pair[1 - u]));
                    }
                }
                Ok(samples)
            }
        }
    }
}

/// Converts a pixel by the matrix of BT.601 for the limited range (luma 16 to 235, chroma 16 to 240), in the integers
/// of OpenCV (`ITUR_BT_602_CY` and following in `color_yuv.simd.hpp`), which `cv_bridge` uses.
fn rgb(luma: u8, u: u8, v: u8) -> [u8; 3] {
    let luma = (i32::from(luma) - 16).max(0) * 1_220_542;
    let [u, v] = [u, v].map(|chroma| i32::from(chroma) - 128);
    [1_673_527 * v, -852_492 * v - 409_993 * u, 2_116_026 * u]
        .map(|chroma| ((luma + chroma + (1 << 19)) >> 20).clamp(0, 255) as u8)
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

    const PATTERNS: [[usize; 2]; 4] = [[0, 0], [0, 1], [1, 0], [1, 1]];

    /// The colour channel of a site: 0 red, 1 green, 2 blue.
    fn channel(y: usize, x: usize, red: [usize; 2]) -> usize {
        match (y % 2 == red[0], x % 2 == red[1]) {
            (true, true) => 0,
            (false, false) => 2,
            _ => 1,
        }
    }

    /// A mosaic with the values `value(row, column, channel)`.
    fn mosaic(width: usize, height: usize, red: [usize; 2], value: impl Fn(usize, usize, usize) -> u16) -> Vec<u16> {
        (0..height)
            .flat_map(|y| (0..width).map(move |x| (y, x)))
            .map(|(y, x)| value(y, x, channel(y, x, red)))
            .collect()
    }

    #[test]
    fn constant_colours_stay_constant_to_the_border() {
        for red in PATTERNS {
            for (width, height) in [(2, 2), (3, 5), (8, 6)] {
                let sites = mosaic(width, height, red, |_, _, channel| [10, 500, 65535][channel]);
                let mut samples = Vec::new();
                demosaic(&sites, width, red, &mut samples);
                assert_eq!(samples, [10, 500, 65535].repeat(width * height), "{red:?}");
            }
        }
    }

    /// Away from the edges, each channel of a pixel is the mean of the nearest sites with that colour.
    #[test]
    fn pixels_are_means_of_their_neighbours() {
        let (width, height) = (9, 7);
        for red in PATTERNS {
            let sites = mosaic(width, height, red, |y, x, _| ((y * 31 + x * 17) % 64) as u16);
            let mut samples = Vec::new();
            demosaic(&sites, width, red, &mut samples);
            for (y, x) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (y, x))) {
                for colour in 0..3 {
                    let of_colour: Vec<(usize, u32)> = (y - 1..=y + 1)
                        .flat_map(|j| (x - 1..=x + 1).map(move |i| (j, i)))
                        .filter(|&(j, i)| channel(j, i, red) == colour)
                        .map(|(j, i)| {
                            let distance = j.abs_diff(y) + i.abs_diff(x);
                            (distance, u32::from(sites[j * width + i]))
                        })
                        .collect();
                    let least = of_colour.iter().map(|(distance, _)| *distance).min();
                    let nearest: Vec<u32> = of_colour
                        .into_iter()
                        .filter(|(distance, _)| Some(*distance) == least)
                        .map(|(_, value)| value)
                        .collect();
                    let count = nearest.len() as u32;
                    let expected = (nearest.iter().sum::<u32>() + count / 2) / count;
                    let found = samples[(y * width + x) * 3 + colour];
                    assert_eq!(u32::from(found), expected, "{red:?} {y} {x} {colour}");
                }
            }
        }
    }

    #[test]
    fn a_single_row_or_column_does_not_panic() {
        for red in PATTERNS {
            for width in [1, 4] {
                let mut samples = Vec::new();
                demosaic(&[1_u8, 2, 3, 4], width, red, &mut samples);
                assert_eq!(samples.len(), 12);
            }
        }
    }

    /// Bytes that vary over the whole range.
    fn bytes(count: usize) -> Vec<u8> {
        (0..count).map(|i| ((i * 7919 + i * i * 31) >> 3) as u8).collect()
    }

    fn decode(encoding: &str, [width, height]: [usize; 2], step: usize, data: &[u8]) -> Result<Vec<u8>, String> {
        let image =
            RawImage { width, height, step, encoding: encoding.to_owned(), is_big_endian: false, data: data.into() };
        match image.decode()? {
            RawPixels::Codes8(image) => Ok(image.samples().to_vec()),
            other @ RawPixels::Rgb16Image(_) => panic!("{other:?}"),
        }
    }

    /// The samples are of `cv2.cvtColor` (OpenCV 5.0.0) with `COLOR_YUV2RGB_UYVY`, `_YUY2`, `_YVYU`, `_NV12` and
    /// `_NV21`.
    #[test]
    fn samples_are_those_of_opencv() {
        let packed = bytes(4 * 2 * 2);
        let planes = bytes(4 * 2 * 3 / 2);
        for (encodings, step, data, expected) in [
            (
                ["uyvy", "yuv422"],
                8,
                &packed,
                [
                    255, 232, 0, 255, 189, 0, 255, 122, 255, 255, 151, 255, 0, 26, 208, 0, 116, 255, 63, 255, 255, 0,
                    178, 143,
                ],
            ),
            (
                ["yuyv", "yuv422_yuy2"],
                8,
                &packed,
                [
                    96, 0, 196, 255, 131, 255, 255, 107, 255, 255, 117, 255, 194, 255, 4, 0, 111, 0, 115, 141, 255, 0,
                    0, 178,
                ],
            ),
            (
                ["yvyu", "yvyu"],
                8,
                &packed,
                [
                    155, 0, 121, 255, 115, 255, 255, 117, 255, 255, 128, 255, 56, 255, 180, 0, 148, 0, 255, 96, 105,
                    143, 0, 0,
                ],
            ),
            (
                ["nv12", "nv12"],
                4,
                &planes,
                [
                    0, 59, 208, 49, 255, 255, 162, 255, 52, 144, 255, 35, 0, 251, 255, 0, 252, 255, 147, 255, 37, 166,
                    255, 57,
                ],
            ),
            (
                ["nv21", "nv21"],
                4,
                &planes,
                [
                    164, 0, 0, 255, 207, 0, 87, 255, 147, 69, 255, 130, 255, 156, 0, 255, 157, 0, 72, 255, 132, 91,
                    255, 152,
                ],
            ),
        ] {
            for encoding in encodings {
                assert_eq!(decode(encoding, [4, 2], step, data).unwrap(), expected, "{encoding}");
            }
        }
    }

    #[test]
    fn black_and_white_are_of_the_limited_range() {
        assert_eq!(rgb(16, 128, 128), [0; 3]);
        assert_eq!(rgb(235, 128, 128), [255; 3]);
        assert_eq!(rgb(0, 128, 128), [0; 3]);
        assert_eq!(rgb(255, 128, 128), [255; 3]);
    }

    #[test]
    fn all_layouts_of_one_image_agree() {
        // Two columns and two rows share their chroma in this image, so that no layout loses any.
        let luma = bytes(16);
        let (u, v) = ([30, 200, 90, 128], [220, 10, 128, 77]);
        let chroma = |x: usize, y: usize| y / 2 * 2 + x / 2;
        let pairs = |columns: usize, rows: usize, swap: bool| {
            let mut data = luma.clone();
            for (y, x) in (0..4).step_by(rows).flat_map(|y| (0..4).step_by(columns).map(move |x| (y, x))) {
                let pair = [u[chroma(x, y)], v[chroma(x, y)]];
                data.extend(if swap { [pair[1], pair[0]] } else { pair });
            }
            data
        };
        let quads = |order: [usize; 4]| {
            let mut data = Vec::new();
            for (y, x) in (0..4).flat_map(|y| [(y, 0), (y, 2)]) {
                let quad = [luma[y * 4 + x], luma[y * 4 + x + 1], u[chroma(x, y)], v[chroma(x, y)]];
                data.extend(order.map(|i| quad[i]));
            }
            data
        };
        let expected = decode("nv12", [4, 4], 4, &pairs(2, 2, false)).unwrap();
        for (encoding, step, data) in [
            ("nv21", 4, pairs(2, 2, true)),
            ("NV16", 4, pairs(2, 1, false)),
            ("nv61", 4, pairs(2, 1, true)),
            ("nv24", 4, pairs(1, 1, false)),
            ("nv42", 4, pairs(1, 1, true)),
            // The step counts all planes.
            ("nv12", 6, pairs(2, 2, false)),
            ("nv24", 12, pairs(1, 1, false)),
            ("yuv422", 8, quads([2, 0, 3, 1])),
            ("uyvy", 8, quads([2, 0, 3, 1])),
            ("vyuy", 8, quads([3, 0, 2, 1])),
            ("yuv422_yuy2", 8, quads([0, 2, 1, 3])),
            ("yuyv", 8, quads([0, 2, 1, 3])),
            ("yvyu", 8, quads([0, 3, 1, 2])),
        ] {
            let found = decode(encoding, [4, 4], step, &data).unwrap();
            assert_eq!(found, expected, "{encoding}");
        }
        // Control: U and V are not exchanged without effect.
        assert_ne!(decode("nv21", [4, 4], 4, &pairs(2, 2, false)).unwrap(), expected);
    }

    #[test]
    fn yuv_padding_of_rows_is_skipped() {
        let data = bytes(6);
        let padded = [&data[..2], &[9; 2], &data[2..4], &[9; 2], &data[4..], &[9; 2]].concat();
        assert_eq!(decode("nv12", [2, 2], 4, &padded), decode("nv12", [2, 2], 2, &data));
        let quad = [&data[..4], &[9; 4], &data[..4]].concat();
        assert_eq!(decode("uyvy", [2, 2], 8, &quad).unwrap(), decode("uyvy", [2, 1], 4, &data[..4]).unwrap().repeat(2));
    }

    #[test]
    fn yuv_sizes_that_do_not_fit_are_refused() {
        for (encoding, size, step, bytes, expected) in [
            ("nv12", [3, 2], 3, 99, "nv12: 3 columns"),
            ("uyvy", [1, 1], 4, 4, "uyvy: 1 columns"),
            ("nv12", [2, 2], 2, 5, "nv12: 5 bytes; 2 × 2 pixels need 6"),
            ("nv12", [0, 0], 0, 0, "0 × 0 pixels"),
            ("nv24", [1, 1], usize::MAX, 2, "2 bytes"),
            ("uyvy", [2, 1], 3, 4, "rows of 3; 2 × 1 pixels need rows of 4"),
            ("uyvy", [2, 2], 4, 7, "7 bytes"),
        ] {
            let problem = decode(encoding, size, step, &vec![0; bytes]).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
        // The last row of chroma serves an odd number of rows.
        assert_eq!(decode("nv12", [2, 3], 2, &bytes(10)).unwrap().len(), 18);
        assert_eq!(decode("nv24", [1, 1], 1, &[16, 128, 128]).unwrap(), [0; 3]);
    }
}
