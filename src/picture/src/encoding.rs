//! Image files written to memory: [`png()`] and [`jpeg`] of pixels, [`grey_png`] of maps, [`exr()`] of linear light.

use std::fmt;
use std::io::Cursor;

use exr::prelude::{
    Encoding, Image, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage as _,
};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

use crate::payload_format::Quality;
use darkqa_ground::error::{Error, Result};
use darkqa_ground::types::{Light, Rgb, Rgb16Image};

/// An error about an image that has no name here.
pub(crate) fn image_error(problem: impl fmt::Display) -> Error {
    Error::data("image", problem)
}

/// A side as file formats count it.
///
/// # Errors
/// If it is too long.
pub(crate) fn side(pixels: usize) -> Result<u32> {
    u32::try_from(pixels)
        .map_err(|_| image_error(format_args!("a side of {pixels} pixels is too long")))
}

/// An image as a lossless PNG file, at the lowest compression effort: 26 times faster than the default, files are 2 % larger.
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

/// An image of 16-bit codes as a lossless PNG file.
///
/// # Errors
/// If a side is too long for the format.
pub(crate) fn png_16(image: &Rgb16Image) -> Result<Vec<u8>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    let samples: Vec<u8> = image
        .samples()
        .iter()
        .flat_map(|code| code.to_ne_bytes())
        .collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&samples, width, height, ExtendedColorType::Rgb16)
        .map_err(image_error)?;
    Ok(file)
}

/// A map of one 16-bit number a pixel as a grey PNG file, of a width and height in pixels, row by row.
///
/// # Errors
/// If a side is too long for the format, or the samples do not fill the sides.
pub fn grey_png(width: usize, height: usize, samples: &[u16]) -> Result<Vec<u8>> {
    if samples.len() != width * height {
        return Err(image_error("its samples do not fill its sides"));
    }
    let samples: Vec<u8> = samples
        .iter()
        .flat_map(|value| value.to_ne_bytes())
        .collect();
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Adaptive)
        .write_image(
            &samples,
            side(width)?,
            side(height)?,
            ExtendedColorType::L16,
        )
        .map_err(image_error)?;
    Ok(file)
}

/// A JPEG file without chroma subsampling, so that colour noise keeps its resolution as far as the quality allows.
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
    encoder
        .encode(samples, width, height, jpeg_encoder::ColorType::Rgb)
        .map_err(image_error)?;
    Ok(file)
}

/// The bytes of an OpenEXR file of linear light: 32-bit floats, compressed without loss.
///
/// # Errors
/// Only if memory is short.
pub fn exr(light: &Light) -> Result<Vec<u8>> {
    let (width, height) = (light.width(), light.height());
    let pixel = |at: Vec2<usize>| {
        let samples = &light.samples()[3 * (at.y() * width + at.x())..];
        (samples[0], samples[1], samples[2])
    };
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        SpecificChannels::rgb(pixel),
    );
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut file)
        .map_err(image_error)?;
    Ok(file.into_inner())
}
