//! A sheet as PDF: [`pdf`]. One page of the size of the sheet; words are words of the bundled font, of which the file holds the letters
//! that occur. Nothing in the file depends on when or where it was written.

use krilla::color::rgb;
use krilla::configure::{ConfigurationBuilder, PdfVersion};
use krilla::geom::{Path, PathBuilder, Point, Size, Transform};
use krilla::image::Image;
use krilla::metadata::Metadata;
use krilla::num::NormalizedF32;
use krilla::page::PageSettings;
use krilla::paint::{Fill, LineJoin, Stroke as PdfStroke, StrokeDash};
use krilla::surface::Surface;
use krilla::text::{Font as PdfFont, GlyphId, KrillaGlyph};
use krilla::{Document, SerializeSettings};

use super::font::{FILE, Font};
use super::sheet::{Colour, Mark, Place, Sheet, Stroke, Turn, Words};
use crate::error::{Error, Result};
use crate::report::chart::INK;

/// Four arcs of a circle by cubic curves have their handles at this share of the radius: 4 (√2 − 1) / 3.
const HANDLE: f64 = 0.552_284_749_8;

/// The sheet as a PDF file of version 1.4, which every TeX takes without a warning.
///
/// # Errors
/// If the sheet has no size, or the file cannot be made.
pub(crate) fn pdf(sheet: &Sheet, title: &str) -> Result<Vec<u8>> {
    let version = ConfigurationBuilder::new().with_version(PdfVersion::Pdf14);
    let configuration = version.finish().map_err(|e| failed(&e))?;
    let mut document = Document::new_with(SerializeSettings {
        xmp_metadata: false,
        enable_tagging: false,
        configuration,
        ..SerializeSettings::default()
    });
    let name = Metadata::new().title(title.to_owned());
    document.set_metadata(name.document_id(title.to_owned()));
    let [width, height] = sheet.size;
    let settings = PageSettings::from_wh(width as f32, height as f32);
    let settings = settings.ok_or_else(|| failed(&"a figure without a size"))?;
    let font = PdfFont::new(FILE.to_vec().into(), 0);
    let font = font.ok_or_else(|| failed(&"the bundled font cannot be read"))?;
    {
        let mut page = document.start_page_with(settings);
        let mut surface = page.surface();
        for mark in &sheet.marks {
            draw(&mut surface, mark, &font);
        }
        surface.finish();
        page.finish();
    }
    document.finish().map_err(|e| failed(&e))
}

fn failed(problem: &impl std::fmt::Debug) -> Error {
    Error::data("figure as PDF", format!("{problem:?}"))
}

fn draw(surface: &mut Surface<'_>, mark: &Mark, font: &PdfFont) {
    match mark {
        Mark::Line { places, stroke } => {
            painted(surface, path(places, End::Open), None, Some(stroke), 1.0);
        }
        Mark::Area {
            corners,
            fill,
            opacity,
        } => painted(
            surface,
            path(corners, End::Closed),
            Some(*fill),
            None,
            *opacity,
        ),
        Mark::Disc {
            centre,
            radius,
            fill,
            edge,
        } => painted(surface, circle(*centre, *radius), *fill, edge.as_ref(), 1.0),
        Mark::Words(words) => write_words(surface, words, font),
        Mark::Picture {
            corner: [x, y],
            size: [width, height],
            image,
        } => {
            let opaque = image.samples().chunks_exact(3);
            let opaque = opaque.flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255]);
            let picture = Image::from_rgba8(
                opaque.collect(),
                image.width() as u32,
                image.height() as u32,
            );
            if let Some(size) = Size::from_wh(*width as f32, *height as f32) {
                surface.push_transform(&Transform::from_translate(*x as f32, *y as f32));
                surface.draw_image(picture, size);
                surface.pop();
            }
        }
    }
}

/// Whether a path returns to its start.
#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    Open,
    Closed,
}

fn path(places: &[Place], end: End) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (index, [x, y]) in places.iter().enumerate() {
        let (x, y) = (*x as f32, *y as f32);
        if index == 0 {
            path.move_to(x, y);
        } else {
            path.line_to(x, y);
        }
    }
    if end == End::Closed {
        path.close();
    }
    path.finish()
}

fn circle([x, y]: Place, radius: f64) -> Option<Path> {
    let handle = HANDLE * radius;
    let mut path = PathBuilder::new();
    path.move_to((x + radius) as f32, y as f32);
    // From a quarter to the next: the ends of the arc, each as (across, down) in radii.
    let quarters = [
        ([1.0, 0.0], [0.0, 1.0]),
        ([0.0, 1.0], [-1.0, 0.0]),
        ([-1.0, 0.0], [0.0, -1.0]),
        ([0.0, -1.0], [1.0, 0.0]),
    ];
    for (from, to) in quarters {
        let at = |near: [f64; 2], other: [f64; 2]| {
            [
                (x + radius * near[0] + handle * other[0]) as f32,
                (y + radius * near[1] + handle * other[1]) as f32,
            ]
        };
        let ([x1, y1], [x2, y2], [x3, y3]) = (at(from, to), at(to, from), at(to, [0.0, 0.0]));
        path.cubic_to(x1, y1, x2, y2, x3, y3);
    }
    path.close();
    path.finish()
}

fn colour([red, green, blue]: Colour) -> rgb::Color {
    rgb::Color::new(red, green, blue)
}

fn painted(
    surface: &mut Surface<'_>,
    path: Option<Path>,
    fill: Option<Colour>,
    stroke: Option<&Stroke>,
    opacity: f64,
) {
    let Some(path) = path else {
        return;
    };
    surface.set_fill(fill.map(|fill| Fill {
        paint: colour(fill).into(),
        opacity: NormalizedF32::new(opacity as f32).unwrap_or(NormalizedF32::ONE),
        ..Fill::default()
    }));
    surface.set_stroke(stroke.map(|stroke| PdfStroke {
        paint: colour(stroke.colour).into(),
        width: stroke.width as f32,
        line_join: LineJoin::Round,
        dash: (!stroke.dash.is_empty()).then(|| StrokeDash {
            array: stroke.dash.iter().map(|length| *length as f32).collect(),
            offset: 0.0,
        }),
        ..PdfStroke::default()
    }));
    surface.draw_path(&path);
}

fn write_words(surface: &mut Surface<'_>, words: &Words, font: &PdfFont) {
    let letters = Font::bundled().letters(&words.text);
    let glyphs = letters.into_iter().map(|letter| {
        let glyph = GlyphId::new(letter.glyph.to_u32());
        KrillaGlyph::new(glyph, letter.advance, 0.0, 0.0, 0.0, letter.bytes, None)
    });
    let glyphs: Vec<KrillaGlyph> = glyphs.collect();
    let [x, y] = words.start.map(|part| part as f32);
    surface.set_stroke(None);
    surface.set_fill(Some(Fill {
        paint: colour(INK).into(),
        ..Fill::default()
    }));
    let angle = match words.turn {
        Turn::Right => 0.0,
        Turn::Up => -90.0,
    };
    surface.push_transform(&Transform::from_rotate_at(angle, x, y));
    surface.draw_glyphs(
        Point::from_xy(x, y),
        &glyphs,
        font.clone(),
        &words.text,
        words.size as f32,
        false,
    );
    surface.pop();
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::sheet::Anchor;
    use super::*;
    use crate::types::Rgb;

    fn sheet() -> Sheet {
        let mut sheet = Sheet {
            size: [100.0, 50.0],
            ..Sheet::default()
        };
        sheet.words("accuracy −5 μ", [10.0, 20.0], 8.0, Anchor::Start);
        sheet.line(&[[0.0, 0.0], [50.0, 25.0]], &Stroke::solid(INK, 1.0));
        sheet.area(vec![[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]], [1, 2, 3], 0.2);
        sheet.marks.push(Mark::Picture {
            corner: [5.0, 5.0],
            size: [20.0, 10.0],
            image: Arc::new(Rgb::black(2, 4)),
        });
        sheet
    }

    fn has(file: &[u8], words: &str) -> bool {
        file.windows(words.len())
            .any(|part| part == words.as_bytes())
    }

    #[test]
    fn the_file_has_its_font_and_is_the_same_twice() {
        let file = pdf(&sheet(), "accuracy").unwrap();
        assert_eq!(file, pdf(&sheet(), "accuracy").unwrap());
        assert!(file.starts_with(b"%PDF-1.4"));
        for present in ["/FontFile2", "+Arimo", "/ToUnicode", "/MediaBox", "/Image"] {
            assert!(has(&file, present), "{present}");
        }
        for absent in ["/Type3", "/CreationDate", "/ModDate"] {
            assert!(!has(&file, absent), "{absent}");
        }
        let mut moved = sheet();
        moved.line(&[[0.0, 0.0], [50.0, 26.0]], &Stroke::solid(INK, 1.0));
        assert_ne!(file, pdf(&moved, "accuracy").unwrap());
        // A part of the font is smaller than the whole.
        assert!(file.len() < FILE.len());
    }

    #[test]
    fn a_sheet_without_words_has_no_font_and_one_without_a_size_is_refused() {
        let mut bare = sheet();
        bare.marks.remove(0);
        assert!(!has(&pdf(&bare, "bare").unwrap(), "/FontFile2"));
        bare.size = [0.0, 0.0];
        assert!(pdf(&bare, "bare").is_err());
    }

    #[test]
    fn letters_that_the_font_lacks_are_named() {
        let mut sheet = sheet();
        assert!(sheet.check_letters().is_ok());
        sheet.words("模型", [0.0, 0.0], 8.0, Anchor::Start);
        let error = sheet.check_letters().unwrap_err().to_string();
        assert!(
            error.contains("模型") && error.contains("--label"),
            "{error}"
        );
    }
}
