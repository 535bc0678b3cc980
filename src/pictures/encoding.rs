//! Encoders of image files: [`png()`] and [`jpeg`] for pixels, [`grey_png`] for maps, [`exr()`] for linear light.

use std::fmt;
use std::io::Cursor;

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage as _};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

use crate::payload_format::Quality;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Light, Rgb, Rgb16Image};

/// An error about an image whose file name is unknown here.
pub(crate) fn image_error(problem: impl fmt::Display) -> Error {
    Error::data("image", problem)
}

/// The length of a side, in pixels, as a 32-bit number.
///
/// # Errors
/// If the side is too long for any file format.
pub(crate) fn side(pixels: usize) -> Result<u32> {
    u32::try_from(pixels).map_err(|_| image_error(format_args!("a side of {pixels} pixels is too long")))
}

/// Encodes an image as a PNG file with fast compression: 26 times as fast as the default, with files 2 % larger.
///
/// # Errors
/// If a side is too long for the format.
pub fn png(image: &Rgb) -> Result<Vec<u8>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(image.samples(), width, height, ExtendedColorType::Rgb8)
        .map_err(image_error)?;
    Ok(file)
}

/// Encodes an image of 16-bit codes as a PNG file.
///
/// # Errors
/// If a side is too long for the format.
pub(crate) fn png_16(image: &Rgb16Image) -> Result<Vec<u8>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    let samples: Vec<u8> = image.samples().iter().flat_map(|code| code.to_ne_bytes()).collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&samples, width, height, ExtendedColorType::Rgb16)
        .map_err(image_error)?;
    Ok(file)
}

/// Encodes a map of one 16-bit number per pixel, row by row, as a grey PNG file.
///
/// # Errors
/// If a side is too long for the format, or the number of samples does not match the size.
pub fn grey_png(width: usize, height: usize, samples: &[u16]) -> Result<Vec<u8>> {
    if samples.len() != width * height {
        return Err(image_error("its samples do not fill its sides"));
    }
    let samples: Vec<u8> = samples.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&samples, side(width)?, side(height)?, ExtendedColorType::L16)
        .map_err(image_error)?;
    Ok(file)
}

/// Encodes a JPEG file without chroma subsampling, to keep the resolution of colour noise.
///
/// # Errors
/// If a side is too long for the format.
pub(crate) fn jpeg(samples: &[u8], width: u32, height: u32, quality: Quality) -> Result<Vec<u8>> {
    let (Ok(width), Ok(height)) = (u16::try_from(width), u16::try_from(height)) else {
        return Err(image_error(format_args!(
            "{width} × {height} pixels are too many for a JPEG; set --image max-side=N, or --image png"
        )));
    };
    let mut file = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut file, quality.0);
    encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::R_4_4_4);
    encoder.encode(samples, width, height, jpeg_encoder::ColorType::Rgb).map_err(image_error)?;
    Ok(file)
}

/// Encodes linear light as an OpenEXR file of 32-bit floats with lossless compression.
///
/// # Errors
/// If memory is insufficient.
pub fn exr(light: &Light) -> Result<Vec<u8>> {
    let (width, height) = (light.width(), light.height());
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        SpecificChannels::rgb(|at: Vec2<usize>| {
            let samples = &light.samples()[3 * (at.y() * width + at.x())..];
            (samples[0], samples[1], samples[2])
        }),
    );
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut file).map_err(image_error)?;
    Ok(file.into_inner())
}
