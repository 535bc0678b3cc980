//! Conversion between NumPy arrays and images: [`Batch`], [`to_numpy`].
//!
//! Python exceptions about arguments.

use numpy::{
    Element, IxDyn, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use darkqa_base::error::Error;
use darkqa_base::types::Rgb;
use darkqa_base::types::images::Sample;

/// Maximum number of pixels of an image; chosen. Even a huge array can be a view of a single sample.
const MAX_PIXELS: usize = 1 << 28;

/// Upper bound of the bytes that an image takes in addition to its samples.
const IMAGE_OVERHEAD: usize = 128;

/// Element type of a returned array.
pub(crate) trait ArrayElement: Sample + Element + Send + Sync {}

impl ArrayElement for u8 {}

impl ArrayElement for f32 {}

/// Images of the argument `image`.
pub(crate) struct Batch {
    pub(crate) images: Vec<Rgb>,
    /// Number of images; `None` for an array without a batch axis.
    count: Option<usize>,
    height: usize,
    pub(crate) width: usize,
}

impl Batch {
    /// Copies the images of an array of any memory layout.
    ///
    /// # Errors
    /// `TypeError` if `image` is not an array of `uint8`, `ValueError` if it has another shape, no pixels or too many.
    pub(crate) fn read(image: &Bound<'_, PyAny>) -> PyResult<Self> {
        let untyped =
            image.cast::<PyUntypedArray>().map_err(|_| wrong_type("image", "a numpy.ndarray of dtype uint8", image))?;
        let array = image.cast::<PyArrayDyn<u8>>().map_err(|_| {
            let dtype = untyped.dtype();
            PyTypeError::new_err(format!("image: dtype uint8 (sRGB codes from 0 to 255) expected, got {dtype}"))
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
        let array =
            array.try_readonly().map_err(|_| PyValueError::new_err("image: another call is writing to this array"))?;
        if height.saturating_mul(width) > MAX_PIXELS {
            return Err(wrong_shape(shape, " with at most 2**28 pixels"));
        }
        let size = 3 * height * width;
        // Twice the samples: a copy of the array, and the images.
        require_memory(count.unwrap_or(1), 2 * size)?;
        let images = samples(&array)
            .chunks_exact(size)
            .map(|samples| {
                Rgb::new(height, width, samples.to_vec()).map_err(|problem| PyValueError::new_err(problem.to_string()))
            })
            .collect::<PyResult<_>>()?;
        Ok(Self { images, count, height, width })
    }

    /// Number of images; `None` for a single image without a batch axis.
    pub(crate) fn count(&self) -> Option<usize> {
        self.count
    }

    /// Shape of the output array; `levels` is the length of the axis of levels, or empty without that axis.
    pub(crate) fn output_shape(&self, levels: &[usize]) -> Vec<usize> {
        let mut shape: Vec<usize> = self.count.into_iter().collect();
        shape.extend_from_slice(levels);
        shape.extend([self.height, self.width, 3]);
        shape
    }
}

/// Checks that the memory for `images` images of `bytes` bytes each can be allocated, because an allocation that fails
/// later would end the interpreter.
///
/// # Errors
/// `MemoryError` if the allocation fails.
pub(crate) fn require_memory(images: usize, bytes: usize) -> PyResult<()> {
    let bytes = images.saturating_mul(bytes.saturating_add(IMAGE_OVERHEAD));
    let mut memory: Vec<u8> = Vec::new();
    memory
        .try_reserve_exact(bytes)
        .map_err(|_| PyMemoryError::new_err(format!("image: {images} images take {bytes} bytes")))
}

/// Samples of an array in C order.
fn samples<'a>(array: &'a PyReadonlyArrayDyn<'_, u8>) -> std::borrow::Cow<'a, [u8]> {
    // `as_slice` also accepts arrays in Fortran order, and returns their samples in memory order.
    match array.as_slice() {
        Ok(samples) if array.is_c_contiguous() => samples.into(),
        _ => array.as_array().iter().copied().collect(),
    }
}

fn wrong_shape(shape: &[usize], further: &str) -> PyErr {
    let got: Vec<String> = shape.iter().map(ToString::to_string).collect();
    PyValueError::new_err(format!("image: shape (H, W, 3) or (N, H, W, 3){further} expected, got ({})", got.join(", ")))
}

/// New array of this shape.
pub(crate) fn to_numpy<'py, T: ArrayElement>(
    py: Python<'py>,
    samples: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    let array = PyArray1::from_vec(py, samples).reshape(IxDyn(shape))?;
    Ok(array.into_any())
}

/// `TypeError` with the argument's name, the expected value, and the type of the given one.
pub(crate) fn wrong_type(name: &str, expected: &str, given: &Bound<'_, PyAny>) -> PyErr {
    let given = match given.get_type().name() {
        Ok(name) => name.to_string(),
        Err(_) => "another type".to_owned(),
    };
    PyTypeError::new_err(format!("{name}: {expected} expected, got {given}"))
}

/// `ValueError` with the message of an error of the synthesis. The program's flag at its start becomes the argument's
/// name.
pub(crate) fn value_error(error: &Error) -> PyErr {
    let text = error.to_string();
    PyValueError::new_err(text.strip_prefix("--").unwrap_or(&text).to_owned())
}
