//! A sheet as SVG: [`svg`]. Words stay words; each says its width, so that another font takes the same room.

use std::fmt::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::font::{FAMILIES, Font};
use super::sheet::{Colour, Mark, Place, Sheet, Stroke, Turn, Words};
use crate::drawing::chart::INK;
use crate::error::Result;
use crate::types::Rgb;
use crate::types::text::escape_hidden;

/// How a picture is written as PNG.
pub(crate) type Png<'a> = &'a dyn Fn(&Rgb) -> Result<Vec<u8>>;

/// The sheet as SVG, its size in points.
///
/// # Errors
/// If a picture cannot be encoded.
pub(crate) fn svg(sheet: &Sheet, png: Png) -> Result<String> {
    let [width, height] = sheet.size.map(number);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"{FAMILIES}\" style=\"font-kerning:none\">\n"
    );
    for mark in &sheet.marks {
        text += &element(mark, png)?;
        text.push('\n');
    }
    text += "</svg>\n";
    Ok(escape_hidden(&text).into_owned())
}

/// A number with two decimals at most.
fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

fn numbers(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().copied().map(number).collect();
    values.join(" ")
}

fn hex([red, green, blue]: Colour) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn points(places: &[Place]) -> String {
    let places: Vec<String> = places
        .iter()
        .map(|[x, y]| format!("{},{}", number(*x), number(*y)))
        .collect();
    places.join(" ")
}

fn stroked(stroke: &Stroke) -> String {
    let mut text = format!(
        " stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"",
        hex(stroke.colour),
        number(stroke.width)
    );
    if !stroke.dash.is_empty() {
        let _ = write!(text, " stroke-dasharray=\"{}\"", numbers(&stroke.dash));
    }
    text
}

fn element(mark: &Mark, png: Png) -> Result<String> {
    Ok(match mark {
        Mark::Line { places, stroke } => format!(
            "<polyline points=\"{}\" fill=\"none\"{}/>",
            points(places),
            stroked(stroke)
        ),
        Mark::Area {
            corners,
            fill,
            opacity,
        } => format!(
            "<polygon points=\"{}\" fill=\"{}\" fill-opacity=\"{}\"/>",
            points(corners),
            hex(*fill),
            number(*opacity)
        ),
        Mark::Disc {
            centre: [x, y],
            radius,
            fill,
            edge,
        } => format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\"{}/>",
            number(*x),
            number(*y),
            number(*radius),
            fill.map_or_else(|| "none".to_owned(), hex),
            edge.as_ref().map(stroked).unwrap_or_default()
        ),
        Mark::Words(words) => text(words),
        Mark::Picture {
            corner: [x, y],
            size: [width, height],
            image,
        } => format!(
            "<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
            number(*x),
            number(*y),
            number(*width),
            number(*height),
            STANDARD.encode(png(image)?)
        ),
    })
}

fn text(words: &Words) -> String {
    let [x, y] = words.start.map(number);
    let turn = match words.turn {
        Turn::Right => String::new(),
        Turn::Up => format!(" transform=\"rotate(-90 {x} {y})\""),
    };
    let font = Font::bundled();
    // Only the width of words whose letters the font has is known.
    let length = if words.text.chars().all(|letter| font.has(letter)) {
        let width = number(font.width(&words.text, words.size));
        format!(" textLength=\"{width}\" lengthAdjust=\"spacingAndGlyphs\"")
    } else {
        String::new()
    };
    format!(
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" fill=\"{}\"{length}{turn}>{}</text>",
        number(words.size),
        hex(INK),
        escaped(&words.text)
    )
}

/// Text with the special characters of XML escaped.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
