//! OpenEXR files, which hold linear light: [`ExrFile`].

use std::io::Cursor;

use exr::block;
use exr::compression::Compression;
use exr::meta::attribute::{Chromaticities, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::{ReadChannels as _, ReadLayers as _, Vec2, read as read_image};

use crate::colour::primaries::Primaries;
use crate::reading_rule::ReadingRule;

/// The first four bytes of every OpenEXR file.
pub(super) const SIGNATURE: &[u8] = b"\x76\x2F\x31\x01";

/// The names of the channels of colour.
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// The most negative light that counts as black: filters leave such values at edges (chosen).
const LEAST: f32 = -1e-3;

/// How far primaries may be away from those of BT.709; files state them with six digits (chosen).
const PRIMARIES_OFF: f64 = 1e-4;

/// A file whose headers are read.
#[derive(Debug)]
pub(super) struct ExrFile {
    /// Width and height of the image, in pixels: of the display window.
    pub(super) size: (u32, u32),
    /// The number of layers with colours.
    pub(super) layers: usize,
    /// The primaries of the light, if they are not those of BT.709.
    pub(super) primaries: Option<Primaries>,
    /// Place of the first layer with colours among all.
    layer: usize,
}

impl ExrFile {
    /// Reads the headers.
    ///
    /// # Errors
    /// If they are broken, or no layer has the three channels of colour as floats, or the image is larger than the rule allows.
    pub(super) fn open(file: &[u8], rule: &ReadingRule) -> Result<Self, String> {
        let reader = block::read(Cursor::new(file), false).map_err(|e| unreadable(&e))?;
        let headers = reader.headers();
        let mut layers = (0..headers.len()).filter(|place| has_colours(&headers[*place]));
        let layer = layers.next().ok_or(
            "an OpenEXR image without a layer of the channels R, G and B; convert it to RGB first",
        )?;
        let header = &headers[layer];
        let (window, data) = (header.shared_attributes.display_window, header.layer_size);
        let size = (window.size.width(), window.size.height());
        for (width, height) in [size, (data.width(), data.height())] {
            rule.check_size(width, height)?;
        }
        check(header)?;
        let stated = header.shared_attributes.chromaticities.as_ref();
        Ok(Self {
            size: (size.0 as u32, size.1 as u32),
            layers: 1 + layers.count(),
            primaries: stated.map(primaries).filter(are_others),
            layer,
        })
    }

    /// The light, row by row, red first, as the file states it.
    ///
    /// # Errors
    /// If the file is cut or damaged, transparent in places, or a number in it is no amount of light.
    pub(super) fn light(&self, file: &[u8]) -> Result<Vec<f32>, String> {
        let reader = block::read(Cursor::new(file), false).map_err(|e| unreadable(&e))?;
        let header = &reader.headers()[self.layer];
        let window = header.shared_attributes.display_window;
        let shift = header.own_attributes.layer_position - window.position;
        let (width, height) = (window.size.width(), window.size.height());
        let image = read_image()
            .no_deep_data()
            .largest_resolution_level()
            .rgba_channels(
                move |_, _| Collected::new(width * height),
                move |collected: &mut Collected, at, (r, g, b, alpha): (f32, f32, f32, f32)| {
                    let at: Vec2<i32> = at.to_i32() + shift;
                    let inside =
                        (0..width as i32).contains(&at.x()) && (0..height as i32).contains(&at.y());
                    if inside {
                        let place = at.y() as usize * width + at.x() as usize;
                        collected.light[3 * place..][..3].copy_from_slice(&[r, g, b]);
                        collected.is_opaque &= alpha >= 1.0;
                    }
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_chunks(reader)
            .map_err(|e| {
                format!(
                    "not a whole image: {}; copy or export it again",
                    one_line(&e)
                )
            })?;
        let collected = image.layer_data.channel_data.pixels;
        if !collected.is_opaque {
            return Err("the image is transparent in places; flatten it first".to_owned());
        }
        let mut light = collected.light;
        for (place, sample) in light.iter_mut().enumerate() {
            if !sample.is_finite() || *sample < LEAST {
                let (x, y) = (place / 3 % width, place / 3 / width);
                return Err(format!(
                    "{sample} at the pixel ({x}, {y}), channel {}, is not an amount of light; finite numbers from 0 expected, correct \
                     them in the program that wrote the file",
                    CHANNELS[place % 3]
                ));
            }
            *sample = sample.max(0.0);
        }
        Ok(light)
    }
}

/// The samples that are read.
struct Collected {
    light: Vec<f32>,
    is_opaque: bool,
}

impl Collected {
    fn new(pixels: usize) -> Self {
        Self {
            light: vec![0.0; 3 * pixels],
            is_opaque: true,
        }
    }
}

/// Whether a layer is flat and has the three channels of colour.
fn has_colours(header: &Header) -> bool {
    !header.deep
        && CHANNELS.iter().all(|name| {
            let name = Text::from(*name);
            header.channels.find_index_of_channel(&name).is_some()
        })
}

/// Checks that the channels are floats, that they are not compressed by DWA, and that the layer covers the image.
fn check(header: &Header) -> Result<(), String> {
    // Their decoder takes the sizes of its memory from the file, however large they are (found by mutated files).
    if matches!(
        header.compression,
        Compression::DWAA(_) | Compression::DWAB(_)
    ) {
        let problem = "an OpenEXR image of the lossy compression DWAA or DWAB, which is not read; save it with ZIP or PIZ";
        return Err(problem.to_owned());
    }
    let mut used = header.channels.list.iter().filter(|channel| {
        let name = channel.name.to_string();
        name == "A" || CHANNELS.contains(&&*name)
    });
    if used.any(|channel| channel.sample_type == SampleType::U32) {
        let problem = "an OpenEXR image of whole numbers; 16- or 32-bit floats expected";
        return Err(problem.to_owned());
    }
    let window = header.shared_attributes.display_window;
    let (start, end) = (
        header.own_attributes.layer_position - window.position,
        header.layer_size.to_i32(),
    );
    let covers = |start: i32, length: i32, side: usize| {
        start <= 0 && i64::from(start) + i64::from(length) >= side as i64
    };
    if covers(start.x(), end.x(), window.size.width())
        && covers(start.y(), end.y(), window.size.height())
    {
        return Ok(());
    }
    Err(format!(
        "its data window ({} × {} pixels from {}, {}) does not cover its display window of {} × {}, so that a part of the image is missing; crop it first",
        end.x(),
        end.y(),
        start.x(),
        start.y(),
        window.size.width(),
        window.size.height()
    ))
}

fn primaries(stated: &Chromaticities) -> Primaries {
    let pair = |at: Vec2<f32>| [f64::from(at.x()), f64::from(at.y())];
    Primaries {
        red: pair(stated.red),
        green: pair(stated.green),
        blue: pair(stated.blue),
        white: pair(stated.white),
    }
}

fn are_others(found: &Primaries) -> bool {
    let numbers = |of: &Primaries| [of.red, of.green, of.blue, of.white];
    let mut off = numbers(found)
        .into_iter()
        .zip(numbers(&Primaries::SRGB))
        .flat_map(|(a, b)| [a[0] - b[0], a[1] - b[1]]);
    off.any(|off| off.is_nan() || off.abs() > PRIMARIES_OFF)
}

fn unreadable(e: &exr::error::Error) -> String {
    format!("not a readable OpenEXR image: {}", one_line(e))
}

fn one_line(e: &exr::error::Error) -> String {
    e.to_string().replace('\n', " ")
}
