//! Measurements agree with counting pixel by pixel.

use std::collections::BTreeMap;
use std::sync::Arc;

use ndarray::Array2;
use proptest::prelude::*;

use super::*;
use crate::colors::Palette;
use crate::rules::Rules;
use darkqa_base::types::{DepthKind, Frame, Intrinsics, Label, Labels, Rgb, SegmentName, Segmentation};

fn label(name: &str, canonical: &str) -> Label {
    Label { name: name.into(), canonical: canonical.into() }
}

fn labels() -> Labels {
    Labels {
        space: "test".into(),
        void: [0].into(),
        labels: [
            (1, label("wall", "wall")),
            (2, label("Night  Stand", "chest_of_drawers")),
            (3, label("dresser", "chest_of_drawers")),
            (4, label("chair", "chair")),
        ]
        .into(),
        expressible: BTreeSet::new(),
    }
}

fn frame(width: usize, height: usize, semantic: Vec<u16>) -> Frame {
    Frame {
        id: FrameId("s/0".into()),
        scene: "s".into(),
        rgb: Rgb::new(height, width, (0..width * height * 3).map(|i| (i * 37 % 256) as u8).collect()).unwrap(),
        depth: None,
        depth_kind: DepthKind::Planar,
        intrinsics: None,
        semantic: Some(Array2::from_shape_vec((height, width), semantic).unwrap()),
        segments: None,
        segmentation: Segmentation::Instances,
        names: Arc::default(),
        room: None,
    }
}

fn map<T: Clone>(width: usize, height: usize, values: &[T]) -> Array2<T> {
    Array2::from_shape_vec((height, width), values.to_vec()).unwrap()
}

fn measured(frame: &Frame) -> FrameStatistics {
    measured_by(frame, &Rules::built_in().unwrap())
}

fn measured_by(frame: &Frame, rules: &Rules) -> FrameStatistics {
    let palette = Palette::built_in().unwrap();
    measure(frame, &labels(), rules, &palette, Digest::from_bytes(b"")).unwrap()
}

/// The built-in rulebook with one text replaced.
fn rules(from: &str, to: &str) -> Rules {
    let text = include_str!("../rules.toml");
    assert!(text.contains(from), "{from}");
    Rules::parse(&text.replacen(from, to, 1)).unwrap()
}

#[test]
fn pixels_are_counted_by_class_and_segment() {
    // A chair in two pieces, a night stand with a corner labelled dresser, and void.
    #[rustfmt::skip]
    let semantic = vec![
        1, 1, 1, 1, 1, 1,
        1, 4, 1, 1, 4, 4,
        1, 1, 2, 2, 1, 0,
        1, 1, 2, 3, 1, 0,
    ];
    #[rustfmt::skip]
    let segments = vec![
        7, 7, 7, 7, 7, 7,
        7, 9, 7, 7, 9, 9,
        7, 7, 3, 3, 7, 0,
        7, 7, 3, 3, 0, 0,
    ];
    let mut frame = frame(6, 4, semantic);
    frame.segments = Some(map(6, 4, &segments));
    let found = measured(&frame);
    assert_eq!(found.classes, [("chair".into(), 3), ("chest_of_drawers".into(), 4), ("wall".into(), 15)].into());
    assert_eq!(found.loose, [("wall".into(), 1)].into());
    assert_eq!((found.void, found.effective_void, found.size), (2, 0, [6, 4]));
    let ids: Vec<u32> = found.segments.iter().map(|segment| segment.id).collect();
    assert_eq!(ids, [3, 7, 9]);
    let stand = &found.segments[0];
    assert_eq!((stand.class.as_str(), stand.word.as_str()), ("chest_of_drawers", "night stand"));
    assert_eq!((stand.area, stand.pure, stand.bbox), (4, 4, [2, 2, 4, 4]));
    assert_eq!((stand.rim, stand.rim_on_border), (4, 4));
    assert_eq!(found.segments[2].bbox, [1, 1, 6, 2]);
    assert_eq!(found.words, [("chair".into(), 3), ("night stand".into(), 4), ("wall".into(), 14)].into());
    // Without a map of segments, the connected components of a label are segments.
    frame.segments = None;
    let found = measured(&frame);
    let pieces: Vec<(&str, u64)> = found.segments.iter().map(|s| (s.word.as_str(), s.area)).collect();
    assert_eq!(pieces, [("wall", 15), ("chair", 1), ("chair", 2), ("night stand", 3), ("dresser", 1)]);
    assert!(found.loose.is_empty());
}

#[test]
fn unknown_numbers_are_void_and_counted() {
    let found = measured(&frame(3, 1, vec![1, 77, 77]));
    assert_eq!((found.unknown, found.void), ([(77, 2)].into(), 2));
}

#[test]
fn names_of_segments_override_the_words_of_labels() {
    let mut frame = frame(4, 1, vec![4, 4, 1, 1]);
    frame.segments = Some(map(4, 1, &[5_u32, 5, 70_000, 70_000]));
    let name = SegmentName { name: "Office Chair /otherroom".into(), canonical: "chair".into(), region: Some(3) };
    frame.names = Arc::new([(5, name)].into());
    let found = measured(&frame);
    let chair = &found.segments[0];
    assert_eq!((chair.word.as_str(), chair.place, chair.region), ("office chair", SegmentPlace::Elsewhere, Some(3)));
    assert_eq!(found.segments[1].word, "wall");
    // Without a semantic map, only the names of segments give classes.
    frame.semantic = None;
    let found = measured(&frame);
    assert_eq!(found.classes, [("chair".into(), 2)].into());
    assert_eq!((found.void, found.segments.len()), (2, 1));
    frame.names = Arc::default();
    let error =
        measure(&frame, &labels(), &Rules::built_in().unwrap(), &Palette::built_in().unwrap(), Digest::from_bytes(b""));
    assert!(error.unwrap_err().to_string().contains("frame \"s/0\": no classes"));
}

#[test]
fn parts_of_one_class_are_merged() {
    let mut frame = frame(7, 1, vec![4, 4, 1, 1, 4, 4, 1]);
    frame.segments = Some(map(7, 1, &[1_u32, 2, 2, 2, 3, 4, 5]));
    frame.segmentation = Segmentation::Parts;
    let found = measured(&frame);
    // Most of part 2 is wall, so it is not merged with the chair.
    let parts: Vec<(&str, u64, usize)> = found.segments.iter().map(|s| (s.class.as_str(), s.area, s.parts)).collect();
    assert_eq!(parts, [("chair", 1, 1), ("wall", 3, 1), ("chair", 2, 2), ("wall", 1, 1)]);
    assert_eq!(found.segments[1].pure, 2);
}

#[test]
fn depth_is_along_the_ray_if_the_camera_is_known() {
    let mut frame = frame(3, 1, vec![4, 4, 4]);
    frame.depth = Some(map(3, 1, &[1000_u32, 1000, 0]));
    assert_eq!(measured(&frame).depth.unwrap().along, DepthAxis::Axis);
    frame.intrinsics = Some(Intrinsics { fx: 1.0, fy: 1.0, cx: 1.0, cy: 0.0 });
    let found = measured(&frame);
    let depth = found.segments[0].depth.unwrap();
    // One pixel is one focal length off the axis: factor √2.
    assert_eq!((depth.valid, depth.p10, depth.median, depth.p90), (2, 1000, 1000, 1414));
    let whole = found.depth.unwrap();
    assert_eq!((whole.holes, whole.median, whole.along), (1, 1000, DepthAxis::Ray));
    frame.depth_kind = DepthKind::Euclid;
    let found = measured(&frame);
    assert_eq!((found.segments[0].depth.unwrap().p90, found.depth.unwrap().along), (1000, DepthAxis::Ray));
    frame.depth = Some(map(3, 1, &[15_000_u32, 15_001, 0]));
    assert_eq!(measured(&frame).segments[0].depth.unwrap().valid, 1);
}

#[test]
fn the_rim_of_a_mask_is_not_used_for_depth_and_colour() {
    let (width, height) = (12, 9);
    let [inside, core]: [Vec<bool>; 2] = [(3..10, 2..8), (4..9, 3..7)].map(|(columns, rows)| {
        (0..width * height).map(|i| columns.contains(&(i % width)) && rows.contains(&(i / width))).collect()
    });
    let ids = inside.iter().map(|inside| if *inside { 4 } else { 1 });
    let mut frame = frame(width, height, ids.collect());
    let samples = core.iter().flat_map(|core| if *core { [200, 30, 30] } else { [255; 3] });
    frame.rgb = Rgb::new(height, width, samples.collect()).unwrap();
    let depth: Vec<u32> = core.iter().map(|core| if *core { 2000 } else { 5 }).collect();
    frame.depth = Some(map(width, height, &depth));
    let found = measured(&frame);
    let chair = found.segments.iter().find(|segment| segment.class == "chair").unwrap();
    assert_eq!((chair.area, chair.core, chair.rim), (42, 20, 22));
    assert_eq!((chair.colors[3], chair.median, chair.bright), (20, [200, 30, 30], 0));
    let depth = chair.depth.unwrap();
    assert_eq!((depth.p10, depth.p90), (2000, 2000));
    let wall = found.segments.iter().find(|segment| segment.class == "wall").unwrap();
    assert!(wall.core < wall.area && wall.bright == wall.core);
}

#[test]
fn tiny_segments_count_only_for_their_class_and_word() {
    let semantic: Vec<u16> = (0..2000).map(|i| if i == 0 { 4 } else { 1 }).collect();
    let frame = frame(2000, 1, semantic);
    for (ppm, segments) in [("500", 2), ("501", 1)] {
        let rules = rules("detail_ppm = 500", &format!("detail_ppm = {ppm}"));
        let found = measured_by(&frame, &rules);
        assert_eq!(found.segments.len(), segments, "{ppm}");
        assert_eq!(found.class_pixels("chair"), 1, "{ppm}");
        assert!(found.words.contains_key("chair"), "{ppm}");
    }
}

#[test]
fn void_counts_if_it_is_wider_than_a_margin() {
    let (width, height) = (40, 200);
    let ids = (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            // A void border of 4 pixels left and right, and a hole of 5 × 6 pixels in the lower half.
            let is_hole = (10..15).contains(&x) && (150..156).contains(&y);
            u16::from((4..width - 4).contains(&x) && !is_hole)
        })
        .collect();
    let found = measured(&frame(width, height, ids));
    assert_eq!((found.void, found.effective_void, found.lower_void), (1630, 30, 30));
}

#[test]
fn words_have_one_spelling() {
    for (word, expected) in [
        ("  Kitchen   Cabinet ", ("kitchen cabinet", SegmentPlace::Here)),
        ("bed/otherroom", ("bed", SegmentPlace::Elsewhere)),
        ("bed /outside", ("bed", SegmentPlace::Elsewhere)),
        ("", ("", SegmentPlace::Here)),
    ] {
        assert_eq!(plain_word(word), (expected.0.to_owned(), expected.1));
    }
}

/// Area, number of rim pixels and depth quantiles of each segment, computed pixel by pixel.
fn reference(frame: &Frame) -> BTreeMap<u32, (u64, u64, Option<[u32; 3]>)> {
    let (segments, depth) = (frame.segments.as_ref().unwrap(), frame.depth.as_ref().unwrap());
    let (height, width) = segments.dim();
    let mut found = BTreeMap::new();
    for ((y, x), id) in segments.indexed_iter().filter(|(_, id)| **id != 0) {
        let entry = found.entry(*id).or_insert((0, 0, Vec::new(), Vec::new()));
        entry.0 += 1;
        // Beyond the upper and left edges, the wrapped index is outside the map too.
        let around = [(y.wrapping_sub(1), x), (y + 1, x), (y, x.wrapping_sub(1)), (y, x + 1)];
        let is_rim = around.iter().any(|place| segments.get(*place) != Some(id));
        entry.1 += u64::from(is_rim);
        let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
        let core = rows
            .flat_map(|j| (x.saturating_sub(1)..=(x + 1).min(width - 1)).map(move |i| (j, i)))
            .all(|place| segments[place] == *id);
        let depth = depth[(y, x)];
        if depth > 0 && depth <= 15_000 {
            entry.2.push(depth);
            if core {
                entry.3.push(depth);
            }
        }
        if core {
            // Marks that the segment has a core, even if the core has no depth.
            entry.3.push(0);
        }
    }
    found
        .into_iter()
        .map(|(id, (area, rim, all, core))| {
            let eroded: Vec<u32> = core.iter().copied().filter(|depth| *depth > 0).collect();
            let mut depths = if core.is_empty() { all } else { eroded };
            depths.sort_unstable();
            let quantiles = (!depths.is_empty())
                .then(|| [10, 50, 90].map(|percent| depths[(depths.len() * percent).div_ceil(100) - 1]));
            (id, (area, rim, quantiles))
        })
        .collect()
}

proptest! {
    #[test]
    fn measurements_of_any_maps_agree_with_the_reference(
        width in 1..24_usize, height in 1..24_usize, coarse in 1..6_usize, bits in any::<u128>(), seed in any::<u32>(),
    ) {
        let pixels = 0..width * height;
        let ids: Vec<u32> = pixels
            .clone()
            .map(|i| {
                let cell = i % width / coarse * 5 + i / width / coarse * 11;
                (bits >> (cell % 125) & 7) as u32
            })
            .collect();
        let mut frame = frame(width, height, ids.iter().map(|id| (id % 6) as u16).collect());
        let ids: Vec<u32> = ids.iter().map(|id| id * 1_000_003).collect();
        frame.segments = Some(map(width, height, &ids));
        let depths: Vec<u32> = pixels.map(|i| (i as u32).wrapping_mul(seed | 1) >> 18).collect();
        frame.depth = Some(map(width, height, &depths));
        let found = measured(&frame);
        let expected = reference(&frame);
        for segment in &found.segments {
            let (area, rim, depth) = expected[&segment.id];
            prop_assert_eq!((segment.area, segment.rim), (area, rim));
            prop_assert_eq!(segment.depth.map(|depth| [depth.p10, depth.median, depth.p90]), depth);
            prop_assert_eq!(segment.colors.iter().sum::<u64>(), segment.core);
        }
        let classed: u64 = found.classes.values().sum();
        prop_assert_eq!(classed + found.void, (width * height) as u64);
        for segmentation in [Segmentation::Instances, Segmentation::Parts] {
            let other = Frame { segmentation, segments: None, ..frame.clone() };
            measured(&other);
            measured(&Frame { segmentation, ..frame.clone() });
        }
    }
}

#[test]
fn the_light_of_a_frame_is_that_of_its_surfaces() {
    let (width, height) = (40, 20);
    // A window of code 255 above a wall of code 200 with a chair of code 90 in it, and void of code 250 below.
    let semantic: Vec<u16> = (0..width * height)
        .map(|i| match (i % width, i / width) {
            (_, 0..4) => 5,
            (_, 18..) => 0,
            (16..24, 8..12) => 4,
            _ => 1,
        })
        .collect();
    let mut frame = frame(width, height, semantic.clone());
    let codes = semantic.iter().flat_map(|class| [[250, 200, 0, 0, 90, 255][usize::from(*class)]; 3]);
    frame.rgb = Rgb::new(height, width, codes.collect()).unwrap();
    let mut labels = labels();
    labels.labels.insert(5, label("window", "window"));
    let rules = Rules::built_in().unwrap();
    let palette = Palette::built_in().unwrap();
    let measured = measure(&frame, &labels, &rules, &palette, Digest::from_bytes(b"")).unwrap();
    assert_eq!(measured.light, [200; 3]);
    // Around the chair is the wall; around the wall only the chair, because windows and void are no surfaces.
    for (class, around) in [("chair", 200), ("wall", 90)] {
        let segment = measured.segments.iter().find(|segment| segment.class == class);
        assert_eq!(segment.unwrap().around, Some(around), "{class}");
    }
}
