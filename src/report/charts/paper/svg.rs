//! Writers of a sheet as SVG: [`svg`] for a file, with its own colours, and [`page_svg`] for the page, with the colours
//! of its theme. Text can be selected; its `textLength` keeps its width if another font is used.

use std::fmt::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::font::{FAMILIES, Font};
use super::sheet::{Anchor, Colour, GRID, PAPER, Point, Shape, ShapeGroup, Sheet, Stroke, TextDirection, TextLabel};
use crate::charts::chart::{COLOURS, INK};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Rgb;
use darkqa_base::types::text::escape_hidden;

/// Encoder of an image as PNG.
pub(super) type Png<'a> = &'a dyn Fn(&Rgb) -> Result<Vec<u8>>;

/// Writes a sheet as SVG, with its size in points.
///
/// # Errors
/// If an image cannot be encoded.
pub fn svg(sheet: &Sheet, png: Png) -> Result<String> {
    let writer = SvgWriter { target: SvgTarget::File(png) };
    let [width, height] = sheet.size.map(|length| writer.number(length));
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"{FAMILIES}\" style=\"font-kerning:none\">\n"
    );
    for shape in sheet.ungrouped() {
        text += &writer.element(shape, &Tags::default())?;
        text.push('\n');
    }
    text += "</svg>\n";
    Ok(escape_hidden(&text).into_owned())
}

/// Writes a sheet without images as SVG for the page, whose style sheet sets its size and what most shapes have in
/// common. `attributes` are those of the root.
///
/// # Errors
/// If the sheet has an image.
pub(super) fn page_svg(sheet: &Sheet, font_size: f64, attributes: &str) -> Result<String> {
    let writer = SvgWriter { target: SvgTarget::Page { font_size } };
    let [width, height, size] = [sheet.size[0], sheet.size[1], font_size].map(|length| writer.number(length));
    let mut text = format!("<svg viewBox=\"0 0 {width} {height}\" font-size=\"{size}\"{attributes}>");
    for shape in &sheet.shapes {
        text += &writer.element(shape, &Tags::default())?;
    }
    text += "</svg>";
    Ok(text)
}

/// Number of bytes up to which the width of a text on the page does not matter (chosen).
const SHORT: usize = 12;

/// Destination of an SVG.
enum SvgTarget<'a> {
    File(Png<'a>),
    /// The page; a label of this font size says nothing about it.
    Page {
        font_size: f64,
    },
}

/// Class, data and title of an element.
#[derive(Default)]
struct Tags {
    /// Attributes, each after a space.
    attributes: String,
    /// The title as an element; empty for none.
    title: String,
}

impl Tags {
    fn new(group: &ShapeGroup) -> Self {
        let mut attributes = String::new();
        if !group.class.is_empty() {
            let _ = write!(attributes, " class=\"{}\"", group.class);
        }
        for (name, value) in &group.data {
            let _ = write!(attributes, " data-{name}=\"{}\"", escape_attribute(value));
        }
        let title = match &*group.title {
            "" => String::new(),
            title => format!("<title>{}</title>", escape_xml(title)),
        };
        Self { attributes, title }
    }

    /// An element with these tags and its own attributes.
    fn element(&self, name: &str, own: &str) -> String {
        let Self { attributes, title } = self;
        match &**title {
            "" => format!("<{name}{attributes} {own}/>"),
            title => format!("<{name}{attributes} {own}>{title}</{name}>"),
        }
    }
}

/// Writer of the elements.
struct SvgWriter<'a> {
    target: SvgTarget<'a>,
}

impl SvgWriter<'_> {
    fn is_page(&self) -> bool {
        matches!(self.target, SvgTarget::Page { .. })
    }

    /// Number with at most two decimals, or one on the page, whose drawings are larger.
    fn number(&self, value: f64) -> String {
        let decimals = if self.is_page() { 1 } else { 2 };
        let text = format!("{value:.decimals$}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        if text == "-0" { "0" } else { text }.to_owned()
    }

    fn point_list(&self, points: &[Point]) -> String {
        let points: Vec<String> =
            points.iter().map(|[x, y]| format!("{},{}", self.number(*x), self.number(*y))).collect();
        points.join(" ")
    }

    /// A colour; on the page, a variable of the theme.
    fn colour(&self, colour: Colour) -> String {
        if self.is_page() {
            let line = COLOURS.iter().position(|line| *line == colour);
            match (colour, line) {
                (_, Some(line)) => return format!("var(--line-{line})"),
                (INK | [0, 0, 0], _) => return "var(--ink)".to_owned(),
                (GRID, _) => return "var(--line)".to_owned(),
                (PAPER, _) => return "var(--paper)".to_owned(),
                _ => {}
            }
        }
        let [red, green, blue] = colour;
        format!("#{red:02x}{green:02x}{blue:02x}")
    }

    /// Attributes of a stroke, each after a space.
    fn stroke(&self, stroke: &Stroke) -> String {
        let mut text =
            format!(" stroke=\"{}\" stroke-width=\"{}\"", self.colour(stroke.colour), self.number(stroke.width));
        if !self.is_page() {
            text += " stroke-linejoin=\"round\"";
        }
        if !stroke.dash.is_empty() {
            let dash: Vec<String> = stroke.dash.iter().map(|length| self.number(*length)).collect();
            let _ = write!(text, " stroke-dasharray=\"{}\"", dash.join(" "));
        }
        text
    }

    fn element(&self, shape: &Shape, tags: &Tags) -> Result<String> {
        Ok(match shape {
            Shape::Line { points, stroke } => {
                let fill = if self.is_page() { "" } else { " fill=\"none\"" };
                let own = format!("points=\"{}\"{fill}{}", self.point_list(points), self.stroke(stroke));
                tags.element("polyline", &own)
            }
            Shape::Area { corners, fill, opacity } => {
                let mut own = format!("points=\"{}\" fill=\"{}\"", self.point_list(corners), self.colour(*fill));
                if !self.is_page() || *opacity < 1.0 {
                    let opacity = format!("{opacity:.2}");
                    let opacity = opacity.trim_end_matches('0').trim_end_matches('.');
                    let _ = write!(own, " fill-opacity=\"{opacity}\"");
                }
                tags.element("polygon", &own)
            }
            Shape::Disc { centre: [x, y], radius, fill, edge } => {
                let own = format!(
                    "cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\"{}",
                    self.number(*x),
                    self.number(*y),
                    self.number(*radius),
                    fill.map_or_else(|| "none".to_owned(), |fill| self.colour(fill)),
                    edge.as_ref().map(|edge| self.stroke(edge)).unwrap_or_default()
                );
                tags.element("circle", &own)
            }
            Shape::Label(label) => self.text_element(label, tags),
            Shape::Group(group) => self.group(group)?,
            Shape::Picture { corner: [x, y], size: [width, height], image } => {
                let SvgTarget::File(png) = self.target else {
                    return Err(Error::data("figure", "has a picture"));
                };
                let own = format!(
                    "x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"",
                    self.number(*x),
                    self.number(*y),
                    self.number(*width),
                    self.number(*height),
                    STANDARD.encode(png(image)?)
                );
                tags.element("image", &own)
            }
        })
    }

    /// A group. A group of a single shape is written as that shape with the tags of the group.
    fn group(&self, group: &ShapeGroup) -> Result<String> {
        let tags = Tags::new(group);
        if let [shape] = &*group.shapes
            && !matches!(shape, Shape::Group(_))
        {
            return self.element(shape, &tags);
        }
        let mut text = format!("<g{}>{}", tags.attributes, tags.title);
        for shape in &group.shapes {
            text += &self.element(shape, &Tags::default())?;
        }
        Ok(text + "</g>")
    }

    fn text_element(&self, label: &TextLabel, tags: &Tags) -> String {
        let start = if self.is_page() { label.position() } else { label.start };
        let [x, y] = start.map(|length| self.number(length));
        let rotation = match label.direction {
            TextDirection::Right => String::new(),
            TextDirection::Up => format!(" transform=\"rotate(-90 {x} {y})\""),
        };
        let size = self.number(label.size);
        let style = match self.target {
            SvgTarget::Page { font_size } => {
                let anchor = match label.anchor {
                    Anchor::Start => "",
                    Anchor::Middle => " text-anchor=\"middle\"",
                    Anchor::End => " text-anchor=\"end\"",
                };
                let size =
                    if size == self.number(font_size) { String::new() } else { format!(" font-size=\"{size}\"") };
                let length = if label.text.len() > SHORT { self.text_length(label) } else { String::new() };
                format!("{anchor}{size}{length}")
            }
            SvgTarget::File(_) => {
                format!(" font-size=\"{size}\" fill=\"{}\"{}", self.colour(INK), self.text_length(label))
            }
        };
        let Tags { attributes, title } = tags;
        format!("<text{attributes} x=\"{x}\" y=\"{y}\"{style}{rotation}>{title}{}</text>", escape_xml(&label.text))
    }

    /// Attributes that keep the width of a text; none if the font lacks a character, so that the width is unknown.
    fn text_length(&self, label: &TextLabel) -> String {
        let font = Font::bundled();
        if !label.text.chars().all(|letter| font.has(letter)) {
            return String::new();
        }
        format!(" textLength=\"{}\" lengthAdjust=\"spacingAndGlyphs\"", self.number(label.width()))
    }
}

/// Escapes the special characters of XML.
fn escape_xml(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Escapes the special characters of the value of an attribute.
pub(super) fn escape_attribute(text: &str) -> String {
    escape_xml(text).replace('"', "&quot;")
}
