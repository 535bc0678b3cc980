//! Sample images of the first frames by level, as a table of the page ([`samples_of`]) and as a figure ([`figure`]).

use std::collections::BTreeSet;
use std::fmt::Write;

use serde::Serialize;

use crate::text::words::light;
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::text::escape_hidden;
use darkqa_base::types::{AxisLevel, Condition, EnhancerName, FrameId, RunGroup, Thumbnail, Variant};

/// Table of sample images at the levels of one axis.
#[derive(Serialize)]
pub struct SampleTable {
    /// File name of the figure, without its extension.
    #[serde(skip)]
    pub name: &'static str,
    levels: Vec<String>,
    rows: Vec<SampleRow>,
}

#[derive(Serialize)]
struct SampleRow {
    name: String,
    images: Vec<Option<SampleImage>>,
}

#[derive(Serialize)]
struct SampleImage {
    url: String,
    alt: String,
}

/// Maximum number of frames in a table (chosen).
const MAX_FRAMES: usize = 3;

/// Sample images of the first frames: a table for each axis, with a row for each frame, variant and enhancer. Empty
/// without thumbnails.
pub fn samples_of(thumbnails: &[Thumbnail]) -> Vec<SampleTable> {
    Axis::present(|axis| thumbnails.iter().any(|thumbnail| thumbnail.condition.level().axis() == Some(axis)))
        .into_iter()
        .filter_map(|axis| {
            let on_axis: Vec<&Thumbnail> =
                thumbnails.iter().filter(|thumbnail| thumbnail.condition.level().belongs_to(axis)).collect();
            axis_table(&on_axis, axis)
        })
        .collect()
}

/// Table of the thumbnails on one axis; `None` without any.
fn axis_table(thumbnails: &[&Thumbnail], axis: Axis) -> Option<SampleTable> {
    let mut frames: Vec<&FrameId> = thumbnails.iter().map(|thumbnail| &thumbnail.frame).collect();
    frames.sort_unstable();
    frames.dedup();
    let levels: BTreeSet<AxisLevel> = thumbnails.iter().map(|thumbnail| thumbnail.condition.level()).collect();
    let lights = row_lights(thumbnails);
    let mut rows = Vec::new();
    for frame in frames.into_iter().take(MAX_FRAMES) {
        for (variant, enhancer) in &lights {
            let images = levels
                .iter()
                .map(|level| {
                    let thumbnail = thumbnails.iter().find(|thumbnail| {
                        thumbnail.frame == *frame
                            && thumbnail.condition.level() == *level
                            && belongs_to_row(&thumbnail.condition, variant, *enhancer)
                    })?;
                    Some(SampleImage {
                        url: thumbnail.small.clone(),
                        alt: format!("{} at {}", frame, thumbnail.condition),
                    })
                })
                .collect();
            rows.push(SampleRow { name: format!("{frame}, {}", light(variant, *enhancer)), images });
        }
    }
    let level_names = levels.iter().map(|level| match *level {
        AxisLevel::PAIR => level.to_string(),
        _ => format!("{level}, {} {}", level.value(), axis.unit),
    });
    (!rows.is_empty()).then(|| SampleTable {
        name: match axis {
            Axis::MOTION => "blur_samples",
            _ => "samples",
        },
        levels: level_names.collect(),
        rows,
    })
}

/// True if an image of a condition belongs to the row of a variant and an enhancer. Clean frames (L0) belong to all
/// variants of their run groups.
fn belongs_to_row(condition: &Condition, variant: &Variant, enhancer: Option<&EnhancerName>) -> bool {
    let is_clean_frame =
        condition.level() == AxisLevel::L0 && RunGroup::overlap(condition.group.as_ref(), variant.group.as_ref());
    condition.enhancer.as_ref() == enhancer && (condition.variant() == *variant || is_clean_frame)
}

/// Variant and enhancer of each row of a frame. Clean frames are in the rows of the degraded ones; they get a row of
/// their own if no degraded image has the same enhancer (or none).
fn row_lights<'a>(thumbnails: &[&'a Thumbnail]) -> BTreeSet<(Variant, Option<&'a EnhancerName>)> {
    let (mut lights, clean): (BTreeSet<_>, BTreeSet<_>) = thumbnails
        .iter()
        .map(|thumbnail| &thumbnail.condition)
        .map(|condition| (condition.variant(), condition.enhancer.as_ref()))
        .partition(|(variant, _)| variant.is_degraded());
    for (_, enhancer) in clean {
        if lights.iter().all(|(_, other)| *other != enhancer) {
            lights.insert((Variant::NONE, enhancer));
        }
    }
    lights
}

/// Width and height of an image in the figure, in pixels.
const CELL: [usize; 2] = [200, 150];

/// Width of the row names and height of the level names, in pixels.
const HEAD: [usize; 2] = [180, 28];

/// Draws a table as one SVG, with the images embedded.
pub fn figure(samples: &SampleTable) -> String {
    let size = [HEAD[0] + samples.levels.len() * (CELL[0] + 4), HEAD[1] + samples.rows.len() * (CELL[1] + 4)];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n",
        size[0], size[1]
    );
    for (index, level) in samples.levels.iter().enumerate() {
        let x = HEAD[0] + index * (CELL[0] + 4) + CELL[0] / 2;
        let _ = writeln!(svg, "<text x=\"{x}\" y=\"18\" text-anchor=\"middle\">{level}</text>");
    }
    for (index, row) in samples.rows.iter().enumerate() {
        let y = HEAD[1] + index * (CELL[1] + 4);
        for (line, part) in row.name.split(", ").enumerate() {
            let baseline = y + CELL[1] / 2 + line * 18;
            let part = escape_xml(part);
            let _ = writeln!(svg, "<text x=\"8\" y=\"{baseline}\">{part}</text>");
        }
        for (column, image) in row.images.iter().enumerate() {
            let x = HEAD[0] + column * (CELL[0] + 4);
            if let Some(image) = image {
                let _ = writeln!(
                    svg,
                    "<image x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" href=\"{}\"/>",
                    CELL[0], CELL[1], image.url
                );
            }
        }
    }
    svg + "</svg>\n"
}

/// Escapes hidden characters, and the special characters of XML.
fn escape_xml(text: &str) -> String {
    escape_hidden(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Digest;

    /// The only table of some thumbnails.
    fn single_table(thumbnails: &[Thumbnail]) -> SampleTable {
        let mut tables = samples_of(thumbnails);
        assert_eq!(tables.len(), 1);
        tables.remove(0)
    }

    /// Image URLs of a row; empty without an image.
    fn urls(row: &SampleRow) -> Vec<String> {
        row.images
            .iter()
            .map(|image| image.as_ref().map(|image| image.url.clone()))
            .map(Option::unwrap_or_default)
            .collect()
    }

    fn thumbnail(condition: &str) -> Thumbnail {
        Thumbnail {
            frame: FrameId("a<b>&c".into()),
            condition: condition.parse().unwrap(),
            image: Digest::from_bytes(condition.as_bytes()),
            small: format!("data:{condition}"),
            crop: String::new(),
            stops: 0.0,
            size: None,
            objects: Vec::new(),
        }
    }

    #[test]
    fn each_axis_has_a_table() {
        let all = ["L0", "L3-auto", "T8.33-motion", "T33.33-motion"].map(thumbnail);
        let tables = samples_of(&all);
        let names: Vec<&str> = tables.iter().map(|table| table.name).collect();
        assert_eq!(names, ["samples", "blur_samples"]);
        assert_eq!(tables[0].levels, ["L0, 0 EV", "L3, 6 EV"]);
        assert_eq!(tables[1].levels, ["L0, 0 ms", "T8.33, 8.33 ms", "T33.33, 33.33 ms"]);
        assert!(tables[1].rows.len() == 1 && tables[1].rows[0].images.iter().all(Option::is_some));
        assert!(samples_of(&[]).is_empty());
    }

    #[test]
    fn clean_frames_are_in_rows_of_the_same_enhancer() {
        let thumbnails = ["L0", "L3-ev", "L3-noise", "L3-noise+lift"].map(thumbnail);
        let samples = single_table(&thumbnails);
        let rows: Vec<Vec<String>> = samples.rows.iter().map(urls).collect();
        assert_eq!(rows[0], ["data:L0", "data:L3-ev"]);
        assert_eq!(rows[1], ["data:L0", "data:L3-noise"]);
        assert_eq!(rows[2], ["", "data:L3-noise+lift"]);
        let enhanced = ["L0", "L0+lift", "L3-ev", "L3-noise", "L3-noise+lift"].map(thumbnail);
        let enhanced = single_table(&enhanced);
        let rows: Vec<Vec<String>> = enhanced.rows.iter().map(urls).collect();
        assert_eq!(rows[1], ["data:L0", "data:L3-noise"]);
        assert_eq!(rows[2], ["data:L0+lift", "data:L3-noise+lift"]);
        let clean = ["L0", "L0+lift", "L3-noise"].map(thumbnail);
        let clean = single_table(&clean);
        let rows: BTreeSet<Vec<String>> = clean.rows.iter().map(urls).collect();
        let expected = [["data:L0", "data:L3-noise"], ["data:L0+lift", ""]];
        assert_eq!(rows, expected.map(|row| row.map(str::to_owned).to_vec()).into());
    }

    #[test]
    fn figures_embed_images_and_escape_names() {
        let thumbnails = ["L0", "L3-ev", "L3-noise", "L3-noise+lift"].map(thumbnail);
        let svg = figure(&single_table(&thumbnails));
        assert_eq!(svg.matches("<image").count(), 5);
        assert!(svg.contains("a&lt;b&gt;&amp;c") && !svg.contains("a<b>"));
    }
}
