//! Writer of a sheet as SVG: [`svg`]. Text can be selected; its `textLength` keeps its width if another font is used.

use std::fmt::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::font::{FAMILIES, Font};
use super::sheet::{Colour, Point, Shape, Sheet, Stroke, TextDirection, TextLabel};
use crate::error::Result;
use crate::report::charts::chart::INK;
use crate::types::Rgb;
use crate::types::text::escape_hidden;

/// Encoder of an image as PNG.
pub(crate) type Png<'a> = &'a dyn Fn(&Rgb) -> Result<Vec<u8>>;

/// Writes a sheet as SVG, with its size in points.
///
/// # Errors
/// If an image cannot be encoded.
pub(crate) fn svg(sheet: &Sheet, png: Png) -> Result<String> {
    let [width, height] = sheet.size.map(number);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"{FAMILIES}\" style=\"font-kerning:none\">\n"
    );
    for shape in &sheet.shapes {
        text += &element(shape, png)?;
        text.push('\n');
    }
    text += "</svg>\n";
    Ok(escape_hidden(&text).into_owned())
}

/// Number with at most two decimals.
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

fn point_list(points: &[Point]) -> String {
    let points: Vec<String> = points.iter().map(|[x, y]| format!("{},{}", number(*x), number(*y))).collect();
    points.join(" ")
}

/// SVG attributes of a stroke, each after a space.
fn stroke_attributes(stroke: &Stroke) -> String {
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

fn element(shape: &Shape, png: Png) -> Result<String> {
    Ok(match shape {
        Shape::Line { points, stroke } => {
            format!("<polyline points=\"{}\" fill=\"none\"{}/>", point_list(points), stroke_attributes(stroke))
        }
        Shape::Area { corners, fill, opacity } => format!(
            "<polygon points=\"{}\" fill=\"{}\" fill-opacity=\"{}\"/>",
            point_list(corners),
            hex(*fill),
            number(*opacity)
        ),
        Shape::Disc { centre: [x, y], radius, fill, edge } => format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\"{}/>",
            number(*x),
            number(*y),
            number(*radius),
            fill.map_or_else(|| "none".to_owned(), hex),
            edge.as_ref().map(stroke_attributes).unwrap_or_default()
        ),
        Shape::Label(label) => text_element(label),
        Shape::Picture { corner: [x, y], size: [width, height], image } => format!(
            "<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
            number(*x),
            number(*y),
            number(*width),
            number(*height),
            STANDARD.encode(png(image)?)
        ),
    })
}

fn text_element(label: &TextLabel) -> String {
    let [x, y] = label.start.map(number);
    let rotation = match label.direction {
        TextDirection::Right => String::new(),
        TextDirection::Up => format!(" transform=\"rotate(-90 {x} {y})\""),
    };
    let font = Font::bundled();
    // The width is unknown if the font lacks a character.
    let length = if label.text.chars().all(|letter| font.has(letter)) {
        let width = number(font.width(&label.text, label.size));
        format!(" textLength=\"{width}\" lengthAdjust=\"spacingAndGlyphs\"")
    } else {
        String::new()
    };
    format!(
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" fill=\"{}\"{length}{rotation}>{}</text>",
        number(label.size),
        hex(INK),
        escape_xml(&label.text)
    )
}

/// Escapes the special characters of XML.
fn escape_xml(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
