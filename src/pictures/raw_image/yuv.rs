//! Images in YUV with 8 bits a sample: [`YuvLayout`].

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
    pub(super) fn from_encoding(encoding: &str) -> Option<Self> {
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
    pub(super) fn decode(self, [width, height]: [usize; 2], step: usize, data: &[u8]) -> Result<Vec<u8>, String> {
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
    use super::super::{RawImage, RawPixels};
    use super::*;

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
    fn padding_of_rows_is_skipped() {
        let data = bytes(6);
        let padded = [&data[..2], &[9; 2], &data[2..4], &[9; 2], &data[4..], &[9; 2]].concat();
        assert_eq!(decode("nv12", [2, 2], 4, &padded), decode("nv12", [2, 2], 2, &data));
        let quad = [&data[..4], &[9; 4], &data[..4]].concat();
        assert_eq!(decode("uyvy", [2, 2], 8, &quad).unwrap(), decode("uyvy", [2, 1], 4, &data[..4]).unwrap().repeat(2));
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
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
