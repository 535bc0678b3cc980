//! Value of one graph input: [`Tensor`].
//!
//! Image of one run of a model, from which all inputs are computed: [`FedImage`], [`DegradedImage`].

use std::borrow::Cow;
use std::cell::OnceCell;

use half::{bf16, f16};

use crate::conventions::{ElementType, Padding, SidecarNumber};
use crate::planes::Planes;
use crate::sizing::TileWindow;
use darkqa_base::types::{Digest, Rgb};

/// Dimensions and elements of an input.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tensor {
    pub(crate) dims: Vec<usize>,
    pub(crate) data: TensorData,
}

/// Elements of an input, by type.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum TensorData {
    Bool(Vec<bool>),
    Int8(Vec<i8>),
    Int16(Vec<i16>),
    Int32(Vec<i32>),
    Int64(Vec<i64>),
    Uint8(Vec<u8>),
    Uint16(Vec<u16>),
    Uint32(Vec<u32>),
    Uint64(Vec<u64>),
    Float16(Vec<f16>),
    Bfloat16(Vec<bf16>),
    Float32(Vec<f32>),
    Float64(Vec<f64>),
}

impl TensorData {
    /// The number, repeated `count` times.
    ///
    /// A fraction is rounded to the nearest float of the type, but not to infinity or 0. Integers and booleans must be
    /// represented exactly.
    ///
    /// # Errors
    /// If the number does not fit; the message names the number and the type.
    pub(super) fn repeated(element: &ElementType, number: SidecarNumber, count: usize) -> Result<Self, String> {
        let fitting = match element {
            ElementType::Bool => match number {
                SidecarNumber::Bool(value) => Some(Self::Bool(vec![value; count])),
                _ => None,
            },
            ElementType::Int8 => repeat_integer(number, count).map(Self::Int8),
            ElementType::Int16 => repeat_integer(number, count).map(Self::Int16),
            ElementType::Int32 => repeat_integer(number, count).map(Self::Int32),
            ElementType::Int64 => repeat_integer(number, count).map(Self::Int64),
            ElementType::Uint8 => repeat_integer(number, count).map(Self::Uint8),
            ElementType::Uint16 => repeat_integer(number, count).map(Self::Uint16),
            ElementType::Uint32 => repeat_integer(number, count).map(Self::Uint32),
            ElementType::Uint64 => repeat_integer(number, count).map(Self::Uint64),
            _ => fitting_float(element, number).map(|value| match element {
                ElementType::Float16 => Self::Float16(vec![f16::from_f64(value); count]),
                ElementType::Bfloat16 => Self::Bfloat16(vec![bf16::from_f64(value); count]),
                ElementType::Float64 => Self::Float64(vec![value; count]),
                _ => Self::Float32(vec![value as f32; count]),
            }),
        };
        fitting.ok_or_else(|| format!("{number} does not fit its type {element}"))
    }

    /// Elements from numbers, each of which must fit the type as in [`TensorData::repeated`].
    ///
    /// # Errors
    /// If a number does not fit; the message names the number and the type.
    pub(super) fn from_numbers(element: &ElementType, numbers: &[SidecarNumber]) -> Result<Self, String> {
        let mut all = Self::repeated(element, SidecarNumber::Integer(0), 0).or_else(|_| {
            // For booleans, 0 does not fit.
            Self::repeated(element, SidecarNumber::Bool(false), 0)
        })?;
        for number in numbers {
            match (&mut all, Self::repeated(element, *number, 1)?) {
                (Self::Bool(all), Self::Bool(one)) => all.extend(one),
                (Self::Int8(all), Self::Int8(one)) => all.extend(one),
                (Self::Int16(all), Self::Int16(one)) => all.extend(one),
                (Self::Int32(all), Self::Int32(one)) => all.extend(one),
                (Self::Int64(all), Self::Int64(one)) => all.extend(one),
                (Self::Uint8(all), Self::Uint8(one)) => all.extend(one),
                (Self::Uint16(all), Self::Uint16(one)) => all.extend(one),
                (Self::Uint32(all), Self::Uint32(one)) => all.extend(one),
                (Self::Uint64(all), Self::Uint64(one)) => all.extend(one),
                (Self::Float16(all), Self::Float16(one)) => all.extend(one),
                (Self::Bfloat16(all), Self::Bfloat16(one)) => all.extend(one),
                (Self::Float32(all), Self::Float32(one)) => all.extend(one),
                (Self::Float64(all), Self::Float64(one)) => all.extend(one),
                // Unreachable: both have the same type.
                _ => {}
            }
        }
        Ok(all)
    }

    /// Elements of a float type; `None` for another type.
    pub(super) fn from_floats(element: &ElementType, values: Vec<f32>) -> Option<Self> {
        Some(match element {
            ElementType::Float16 => Self::Float16(values.into_iter().map(f16::from_f32).collect()),
            ElementType::Bfloat16 => Self::Bfloat16(values.into_iter().map(bf16::from_f32).collect()),
            ElementType::Float32 => Self::Float32(values),
            ElementType::Float64 => Self::Float64(values.into_iter().map(f64::from).collect()),
            _ => return None,
        })
    }
}

/// Converts a number to an integer type, if that is exact, and repeats it `count` times.
fn repeat_integer<T: Copy + TryFrom<i128>>(number: SidecarNumber, count: usize) -> Option<Vec<T>> {
    let whole = match number {
        SidecarNumber::Integer(value) => i128::from(value),
        // Integers of 2^64 or more fit no type; smaller ones convert to `i128` exactly.
        SidecarNumber::Float(value) if value.fract() == 0.0 && value.abs() < 2.0_f64.powi(65) => value as i128,
        SidecarNumber::Float(_) | SidecarNumber::Bool(_) => return None,
    };
    T::try_from(whole).ok().map(|value| vec![value; count])
}

/// The number as a float, if it fits the float type by the rules of [`TensorData::repeated`].
fn fitting_float(element: &ElementType, number: SidecarNumber) -> Option<f64> {
    match number {
        SidecarNumber::Bool(_) => None,
        SidecarNumber::Integer(integer) => {
            let value = round_to_type(element, integer as f64)?;
            (value.is_finite() && value as i128 == i128::from(integer)).then_some(value)
        }
        SidecarNumber::Float(value) => {
            let rounded = round_to_type(element, value)?;
            (rounded.is_finite() && (rounded != 0.0 || value == 0.0)).then_some(value)
        }
    }
}

/// The value rounded to a float type; `None` for another type.
fn round_to_type(element: &ElementType, value: f64) -> Option<f64> {
    match element {
        ElementType::Float16 => Some(f16::from_f64(value).to_f64()),
        ElementType::Bfloat16 => Some(bf16::from_f64(value).to_f64()),
        ElementType::Float32 => Some(f64::from(value as f32)),
        ElementType::Float64 => Some(value),
        _ => None,
    }
}

/// A whole degraded image. Noise inputs depend on its digest, which is computed at most once.
pub(crate) struct DegradedImage<'a> {
    pub(super) rgb: &'a Rgb,
    digest: OnceCell<Digest>,
}

impl<'a> DegradedImage<'a> {
    pub(crate) fn new(rgb: &'a Rgb) -> Self {
        Self { rgb, digest: OnceCell::new() }
    }
}

/// Image that is fed to a model in one run.
pub(crate) enum FedImage<'a> {
    /// A window of a degraded image, padded beyond the image's edges.
    Window { dark: &'a DegradedImage<'a>, window: TileWindow, pad: Padding },
    /// A whole image of floats.
    Whole(&'a Planes),
}

impl FedImage<'_> {
    /// Height and width in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        match self {
            Self::Window { window, .. } => window.size(),
            Self::Whole(planes) => [planes.height, planes.width],
        }
    }

    /// Row and column of the first pixel within the whole image.
    pub(super) fn origin(&self) -> [usize; 2] {
        match self {
            Self::Window { window, .. } => [window.top, window.left],
            Self::Whole(_) => [0, 0],
        }
    }

    /// True if the whole degraded image is included.
    pub(super) fn is_whole(&self) -> bool {
        match self {
            Self::Window { dark, window, .. } => {
                [window.top, window.left] == [0, 0]
                    && window.bottom >= dark.rgb.height()
                    && window.right >= dark.rgb.width()
            }
            Self::Whole(_) => true,
        }
    }

    /// The image as red, green and blue planes in 0..1.
    pub(crate) fn planes(&self) -> Cow<'_, Planes> {
        let (dark, window, pad) = match self {
            Self::Whole(planes) => return Cow::Borrowed(planes),
            Self::Window { dark, window, pad } => (dark.rgb, window, *pad),
        };
        let [height, width] = window.size();
        let mut samples = Vec::with_capacity(3 * height * width);
        for channel in 0..3 {
            for row in (window.top..window.bottom).map(|at| pad.source(at, dark.height())) {
                for column in (window.left..window.right).map(|at| pad.source(at, dark.width())) {
                    let byte = match (row, column) {
                        (Some(row), Some(column)) => dark.samples()[3 * (row * dark.width() + column) + channel],
                        _ => 0,
                    };
                    samples.push(f32::from(byte) / 255.0);
                }
            }
        }
        Cow::Owned(Planes { height, width, samples })
    }

    /// Digest of the size and pixels of the whole degraded image.
    pub(super) fn digest(&self) -> Digest {
        match self {
            Self::Window { dark, .. } => *dark.digest.get_or_init(|| {
                let size = [dark.rgb.height(), dark.rgb.width()];
                image_digest(size, dark.rgb.samples())
            }),
            Self::Whole(planes) => {
                let bytes: Vec<u8> = planes.samples.iter().flat_map(|x| x.to_le_bytes()).collect();
                image_digest([planes.height, planes.width], &bytes)
            }
        }
    }
}

/// Digest of the height and width of an image and the bytes of its samples.
fn image_digest(size: [usize; 2], bytes: &[u8]) -> Digest {
    let [height, width] = size.map(|side| (side as u64).to_le_bytes());
    Digest::from_parts([&height[..], &width, bytes])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(element: &ElementType, number: SidecarNumber) -> Result<TensorData, String> {
        TensorData::repeated(element, number, 1)
    }

    #[test]
    fn fitting_numbers_are_converted_to_every_type() {
        let (whole, half) = (SidecarNumber::Integer(3), SidecarNumber::Float(0.5));
        let rows = [
            (ElementType::Bool, SidecarNumber::Bool(true), TensorData::Bool(vec![true])),
            (ElementType::Int8, whole, TensorData::Int8(vec![3])),
            (ElementType::Int16, whole, TensorData::Int16(vec![3])),
            (ElementType::Int32, whole, TensorData::Int32(vec![3])),
            (ElementType::Int64, SidecarNumber::Float(3.0), TensorData::Int64(vec![3])),
            (ElementType::Uint8, whole, TensorData::Uint8(vec![3])),
            (ElementType::Uint16, whole, TensorData::Uint16(vec![3])),
            (ElementType::Uint32, whole, TensorData::Uint32(vec![3])),
            (ElementType::Uint64, whole, TensorData::Uint64(vec![3])),
            (ElementType::Float16, half, TensorData::Float16(vec![f16::from_f32(0.5)])),
            (ElementType::Bfloat16, half, TensorData::Bfloat16(vec![bf16::from_f32(0.5)])),
            (ElementType::Float32, SidecarNumber::Float(0.1), TensorData::Float32(vec![0.1])),
            (ElementType::Float32, whole, TensorData::Float32(vec![3.0])),
            (ElementType::Float64, SidecarNumber::Float(0.1), TensorData::Float64(vec![0.1])),
        ];
        for (element, number, data) in rows {
            assert_eq!(one(&element, number), Ok(data), "{element} {number}");
        }
    }

    #[test]
    fn error_names_the_number_and_the_type_it_does_not_fit() {
        for (element, number, text) in [
            (ElementType::Int32, SidecarNumber::Float(3.5), "3.5"),
            (ElementType::Int32, SidecarNumber::Integer(1 << 40), "1099511627776"),
            (ElementType::Int64, SidecarNumber::Float(1e30), "1e30"),
            (ElementType::Int64, SidecarNumber::Bool(true), "true"),
            (ElementType::Uint8, SidecarNumber::Integer(-1), "-1"),
            (ElementType::Uint8, SidecarNumber::Integer(256), "256"),
            (ElementType::Bool, SidecarNumber::Integer(1), "1"),
            (ElementType::Float16, SidecarNumber::Float(1e6), "1000000.0"),
            (ElementType::Float16, SidecarNumber::Integer(2049), "2049"),
            (ElementType::Bfloat16, SidecarNumber::Integer(257), "257"),
            (ElementType::Float32, SidecarNumber::Integer((1 << 24) + 1), "16777217"),
            (ElementType::Float32, SidecarNumber::Float(1e39), "1e39"),
            (ElementType::Float32, SidecarNumber::Float(1e-60), "1e-60"),
            (ElementType::Float64, SidecarNumber::Integer((1 << 53) + 1), "9007199254740993"),
            (ElementType::Float32, SidecarNumber::Bool(true), "true"),
            (ElementType::Other("string".into()), SidecarNumber::Integer(1), "1"),
        ] {
            let message = one(&element, number).unwrap_err();
            assert_eq!(message, format!("{text} does not fit its type {element}"));
        }
    }

    /// A window with two rows of an image.
    fn columns<'a>(dark: &'a DegradedImage<'a>, left: usize, right: usize) -> FedImage<'a> {
        FedImage::Window { dark, window: TileWindow { left, top: 0, right, bottom: 2 }, pad: Padding::Reflect }
    }

    #[test]
    fn window_has_padding_origin_and_digest() {
        let rgb = Rgb::new(1, 3, vec![0, 51, 102, 51, 51, 51, 255, 0, 0]).unwrap();
        let dark = DegradedImage::new(&rgb);
        let padded = columns(&dark, 1, 5);
        let planes = padded.planes().into_owned();
        assert_eq!((planes.height, planes.width), (2, 4));
        assert_eq!(planes.samples[..8], [0.2, 1.0, 0.2, 0.0, 0.2, 1.0, 0.2, 0.0]);
        assert_eq!(padded.origin(), [0, 1]);
        let part = columns(&dark, 0, 2);
        assert!(columns(&dark, 0, 3).is_whole() && columns(&dark, 0, 5).is_whole());
        assert!(!padded.is_whole() && !part.is_whole());
        assert_eq!(part.digest(), padded.digest());
        let transposed = Rgb::new(3, 1, rgb.samples().to_vec()).unwrap();
        let transposed = DegradedImage::new(&transposed);
        assert_ne!(part.digest(), columns(&transposed, 0, 1).digest());
    }
}
