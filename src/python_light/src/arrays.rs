//! NumPy arrays ↔ images: [`Batch`], [`to_numpy`].

use darkqa_ground::types::Rgb;
use darkqa_ground::types::images::Sample;
use numpy::{
    Element, IxDyn, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::errors::wrong_type;

/// Most pixels of an image; chosen. An array of any size may be a view of a single sample.
const MAX_PIXELS: usize = 1 << 28;

/// Bytes that an image takes besides its samples, at most.
const BYTES_OF_IMAGE: usize = 128;

/// A sample of an array that is returned.
pub(crate) trait Output: Sample + Element + Send + Sync {}

impl Output for u8 {}
impl Output for f32 {}

/// The images of an argument.
pub(crate) struct Batch {
    pub(crate) images: Vec<Rgb>,
    /// Number of images, if it is an axis of the array.
    count: Option<usize>,
    height: usize,
    pub(crate) width: usize,
}

impl Batch {
    /// Copies the images of an array of any memory layout.
    ///
    /// # Errors
    /// `TypeError` if it is no array of `uint8`, `ValueError` if it has another shape or an image has no pixel.
    pub(crate) fn read(image: &Bound<'_, PyAny>) -> PyResult<Self> {
        let untyped = image
            .cast::<PyUntypedArray>()
            .map_err(|_| wrong_type("image", "a numpy.ndarray of dtype uint8", image))?;
        let array = image.cast::<PyArrayDyn<u8>>().map_err(|_| {
            let dtype = untyped.dtype();
            PyTypeError::new_err(format!(
                "image: dtype uint8 (sRGB codes from 0 to 255) expected, got {dtype}"
            ))
        })?;
        let shape = untyped.shape();
        let (count, height, width) = match *shape {
            [height, width, 3] => (None, height, width),
            [count, height, width, 3] => (Some(count), height, width),
            _ => return Err(wrong_shape(shape, "")),
        };
        if height == 0 || width == 0 {
            return Err(wrong_shape(shape, " with at least one pixel"));
        }
        let array = array
            .try_readonly()
            .map_err(|_| PyValueError::new_err("image: another call is writing to this array"))?;
        if height.saturating_mul(width) > MAX_PIXELS {
            return Err(wrong_shape(shape, " with at most 2**28 pixels"));
        }
        let size = 3 * height * width;
        // All samples, and those of each image.
        require_memory(count.unwrap_or(1), 2 * size)?;
        let samples = samples(&array);
        let images = samples.chunks_exact(size).map(|samples| {
            Rgb::new(height, width, samples.to_vec())
                .map_err(|problem| PyValueError::new_err(problem.to_string()))
        });
        Ok(Self {
            images: images.collect::<PyResult<_>>()?,
            count,
            height,
            width,
        })
    }

    /// Number of images; `None` for a single image without an axis for it.
    pub(crate) fn count(&self) -> Option<usize> {
        self.count
    }

    /// The shape of an array with `levels` images for each image, if that is an axis.
    pub(crate) fn output_shape(&self, levels: &[usize]) -> Vec<usize> {
        let mut shape: Vec<usize> = self.count.into_iter().collect();
        shape.extend_from_slice(levels);
        shape.extend([self.height, self.width, 3]);
        shape
    }
}

/// Holds the memory of as many images for a moment. A library that runs out of memory would end the interpreter.
///
/// # Errors
/// `MemoryError` if the system does not have it.
pub(crate) fn require_memory(images: usize, bytes: usize) -> PyResult<()> {
    let bytes = images.saturating_mul(bytes.saturating_add(BYTES_OF_IMAGE));
    let mut memory: Vec<u8> = Vec::new();
    memory
        .try_reserve_exact(bytes)
        .map_err(|_| PyMemoryError::new_err(format!("image: {images} images take {bytes} bytes")))
}

/// The samples in the order of the axes.
fn samples<'a>(array: &'a PyReadonlyArrayDyn<'_, u8>) -> std::borrow::Cow<'a, [u8]> {
    // `as_slice` also returns the samples of arrays in the order of Fortran, as they lie in memory.
    match array.as_slice() {
        Ok(samples) if array.is_c_contiguous() => samples.into(),
        _ => array.as_array().iter().copied().collect(),
    }
}

fn wrong_shape(shape: &[usize], further: &str) -> PyErr {
    let got: Vec<String> = shape.iter().map(ToString::to_string).collect();
    PyValueError::new_err(format!(
        "image: shape (H, W, 3) or (N, H, W, 3){further} expected, got ({})",
        got.join(", ")
    ))
}

/// A new array of this shape.
pub(crate) fn to_numpy<'py, T: Output>(
    py: Python<'py>,
    samples: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    let array = PyArray1::from_vec(py, samples).reshape(IxDyn(shape))?;
    Ok(array.into_any())
}
