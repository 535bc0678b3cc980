//! OpenEXR files, whose samples are linear light: [`ExrFile`].

use std::io::Cursor;

use exr::block;
use exr::compression::Compression;
use exr::meta::attribute::{Chromaticities, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::{ReadChannels as _, ReadLayers as _, Vec2, read as read_image};

use crate::colour::conversion::Primaries;
use crate::decode_rule::DecodeRule;

/// The first four bytes of every OpenEXR file.
pub(super) const SIGNATURE: &[u8] = b"\x76\x2F\x31\x01";

/// Names of the colour channels.
const COLOUR_CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Lowest sample that is accepted and set to black: filters leave small negative values at edges (chosen).
const MIN_SAMPLE: f32 = -1e-3;

/// Number of the last compression that the decoder knows, DWAB.
const LAST_KNOWN_COMPRESSION: u8 = 9;

/// Maximum size of headers that are searched for the name of a compression, in bytes (chosen).
const MAX_HEADER_BYTES: usize = 1 << 20;

/// Tolerance for primaries that count as BT.709; files state six digits (chosen).
const PRIMARIES_TOLERANCE: f64 = 1e-4;

/// The facts in the headers of an OpenEXR file.
#[derive(Debug)]
pub(super) struct ExrFile {
    /// Width and height of the display window, in pixels.
    pub(super) size: (u32, u32),
    /// Number of layers with colour channels.
    pub(super) layers: usize,
    /// Primaries of the light; `None` for those of BT.709.
    pub(super) primaries: Option<Primaries>,
    /// Index of the first layer with colour channels.
    layer: usize,
}

impl ExrFile {
    /// Reads the headers.
    ///
    /// # Errors
    /// If they are broken, no layer has the three colour channels as floats, or the image is larger than the rule
    /// allows.
    pub(super) fn open(file: &[u8], rule: &DecodeRule) -> Result<Self, String> {
        let reader = block::read(Cursor::new(file), false).map_err(|e| unreadable(file, &e))?;
        let headers = reader.headers();
        let mut layers = (0..headers.len()).filter(|index| has_colours(&headers[*index]));
        let layer = layers
            .next()
            .ok_or("an OpenEXR image without a layer of the channels R, G and B; convert it to RGB first")?;
        let header = &headers[layer];
        let (window, data) = (header.shared_attributes.display_window, header.layer_size);
        let size = (window.size.width(), window.size.height());
        for (width, height) in [size, (data.width(), data.height())] {
            rule.check_size(width, height)?;
        }
        check_supported(header)?;
        Ok(Self {
            size: (size.0 as u32, size.1 as u32),
            layers: 1 + layers.count(),
            primaries: header
                .shared_attributes
                .chromaticities
                .as_ref()
                .map(primaries)
                .filter(|primaries| !are_bt709(primaries)),
            layer,
        })
    }

    /// Decodes the linear light of the first layer with colours: red, green and blue of each pixel, row by row.
    ///
    /// # Errors
    /// If the file is truncated or damaged, transparent in places, or has a sample that is negative or not finite.
    pub(super) fn light(&self, file: &[u8]) -> Result<Vec<f32>, String> {
        let reader = block::read(Cursor::new(file), false).map_err(|e| unreadable(file, &e))?;
        let header = &reader.headers()[self.layer];
        let window = header.shared_attributes.display_window;
        let shift = header.own_attributes.layer_position - window.position;
        let (width, height) = (window.size.width(), window.size.height());
        let image = read_image()
            .no_deep_data()
            .largest_resolution_level()
            .rgba_channels(
                move |_, _| CollectedLight::new(width * height),
                move |collected: &mut CollectedLight, at, pixel: (f32, f32, f32, f32)| {
                    let (r, g, b, alpha) = pixel;
                    let at: Vec2<i32> = at.to_i32() + shift;
                    let inside = (0..width as i32).contains(&at.x()) && (0..height as i32).contains(&at.y());
                    if inside {
                        let index = at.y() as usize * width + at.x() as usize;
                        collected.light[3 * index..][..3].copy_from_slice(&[r, g, b]);
                        collected.is_opaque &= alpha >= 1.0;
                    }
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_chunks(reader)
            .map_err(|e| format!("not a whole image: {}; copy or export it again", one_line(&e)))?;
        let collected = image.layer_data.channel_data.pixels;
        if !collected.is_opaque {
            return Err("the image is transparent in places; flatten it first".to_owned());
        }
        let mut light = collected.light;
        for (index, sample) in light.iter_mut().enumerate() {
            if !sample.is_finite() || *sample < MIN_SAMPLE {
                let (x, y) = (index / 3 % width, index / 3 / width);
                return Err(format!(
                    "{sample} at the pixel ({x}, {y}), channel {}, is not an amount of light; finite numbers from 0 expected, correct \
                     them in the program that wrote the file",
                    COLOUR_CHANNELS[index % 3]
                ));
            }
            *sample = sample.max(0.0);
        }
        Ok(light)
    }
}

/// Samples of the display window, collected while the file is decoded.
struct CollectedLight {
    light: Vec<f32>,
    is_opaque: bool,
}

impl CollectedLight {
    fn new(pixels: usize) -> Self {
        Self { light: vec![0.0; 3 * pixels], is_opaque: true }
    }
}

/// True if a layer is flat (not deep data) and has the three colour channels.
fn has_colours(header: &Header) -> bool {
    !header.deep
        && COLOUR_CHANNELS.iter().all(|name| {
            let name = Text::from(*name);
            header.channels.find_index_of_channel(&name).is_some()
        })
}

/// Checks that the channels are floats, that the compression is not DWA, and that the layer covers the display window.
fn check_supported(header: &Header) -> Result<(), String> {
    // The decoder of DWA allocates as much memory as the file states (found with mutated files).
    if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        let problem =
            "an OpenEXR image of the lossy compression DWAA or DWAB, which is not read; save it with ZIP or PIZ";
        return Err(problem.to_owned());
    }
    let has_integers = header
        .channels
        .list
        .iter()
        .filter(|channel| {
            let name = channel.name.to_string();
            name == "A" || COLOUR_CHANNELS.contains(&&*name)
        })
        .any(|channel| channel.sample_type == SampleType::U32);
    if has_integers {
        let problem = "an OpenEXR image of whole numbers; 16- or 32-bit floats expected";
        return Err(problem.to_owned());
    }
    let window = header.shared_attributes.display_window;
    let (start, size) = (header.own_attributes.layer_position - window.position, header.layer_size.to_i32());
    if covers(start.x(), size.x(), window.size.width()) && covers(start.y(), size.y(), window.size.height()) {
        return Ok(());
    }
    Err(format!(
        "its data window ({} × {} pixels from {}, {}) does not cover its display window of {} × {}, so that a part of the image is missing; crop it first",
        size.x(),
        size.y(),
        start.x(),
        start.y(),
        window.size.width(),
        window.size.height()
    ))
}

/// True if an interval covers 0 to `side`.
fn covers(start: i32, length: i32, side: usize) -> bool {
    start <= 0 && i64::from(start) + i64::from(length) >= side as i64
}

fn primaries(stated: &Chromaticities) -> Primaries {
    Primaries { red: xy(stated.red), green: xy(stated.green), blue: xy(stated.blue), white: xy(stated.white) }
}

fn xy(point: Vec2<f32>) -> [f64; 2] {
    [f64::from(point.x()), f64::from(point.y())]
}

/// True if the primaries are those of BT.709, which are also those of sRGB.
fn are_bt709(found: &Primaries) -> bool {
    found
        .points()
        .as_flattened()
        .iter()
        .zip(Primaries::SRGB.points().as_flattened())
        .all(|(found, expected)| (found - expected).abs() <= PRIMARIES_TOLERANCE)
}

/// Problem of a file whose headers the decoder refuses.
fn unreadable(file: &[u8], e: &exr::error::Error) -> String {
    match new_compression(file) {
        Some(name) => format!("an OpenEXR image of the compression {name}, which is not read; save it with ZIP or PIZ"),
        None => format!("not a readable OpenEXR image: {}", one_line(e)),
    }
}

/// The first stated compression that the decoder does not know: one of OpenEXR 3.4 or later.
fn new_compression(file: &[u8]) -> Option<String> {
    // Name, type and length of the attribute.
    const ATTRIBUTE: &[u8] = b"compression\0compression\0\x01\0\0\0";
    let headers = file.get(..MAX_HEADER_BYTES).unwrap_or(file);
    let method = headers
        .windows(ATTRIBUTE.len() + 1)
        .filter(|part| part.starts_with(ATTRIBUTE))
        .filter_map(|part| part.last())
        .find(|method| **method > LAST_KNOWN_COMPRESSION)?;
    Some(match method {
        10 | 11 => "HTJ2K".to_owned(),
        12 => "LJ2K".to_owned(),
        13 => "ZSTD".to_owned(),
        other => format!("number {other}"),
    })
}

fn one_line(e: &exr::error::Error) -> String {
    e.to_string().replace('\n', " ")
}
