//! What it costs to measure a frame for its questions: one of 2560×1440 with 80 segments, alone and from its files.
//!
//! `cargo bench --bench questions` runs it, on one core.

use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use darkqa_base::types::{DepthKind, Digest, Frame, FrameId, Intrinsics, Label, Labels, Rgb, Segmentation};
use darkqa_eval::internals::dataset::open_frames;
use darkqa_questions::colors::Palette;
use darkqa_questions::rules::Rules;
use darkqa_questions::statistics::measure;
use image::{ImageBuffer, Luma, RgbImage};
use ndarray::Array2;

const SIZE: (usize, usize) = (1440, 2560);
const CLASSES: [&str; 8] = ["wall", "chair", "table", "picture", "cabinet", "cushion", "sofa", "bed"];

/// The segment of a pixel: a grid of 10 × 8 discs that lie before a wall.
fn segment(y: usize, x: usize) -> usize {
    let (column, row) = (x / 256, y / 180);
    let (dx, dy) = ((x % 256).abs_diff(128), (y % 180).abs_diff(90));
    if dx * dx + 2 * dy * dy < 110 * 110 { 1 + row * 10 + column } else { 0 }
}

fn class(y: usize, x: usize) -> u16 {
    match segment(y, x) {
        0 => 1,
        segment => (segment % (CLASSES.len() - 1)) as u16 + 2,
    }
}

fn depth(y: usize, x: usize) -> u32 {
    let (far, near) = (4000 - y / 2, 900 + 31 * segment(y, x));
    let texture = (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503)) >> 7 & 15;
    (if segment(y, x) == 0 { far } else { near } + texture) as u32
}

#[expect(clippy::unwrap_used, reason = "the size fits the samples")]
fn rgb() -> Rgb {
    let (height, width) = SIZE;
    let sample = |i: usize| {
        let (y, x, channel) = (i / 3 / width, i / 3 % width, i % 3);
        let texture = (i.wrapping_mul(2_654_435_761) >> 28 & 15) as u8;
        (40 + 23 * (segment(y, x) % 7) + 30 * channel) as u8 + texture
    };
    Rgb::new(height, width, (0..height * width * 3).map(sample).collect()).unwrap()
}

fn frame() -> Frame {
    Frame {
        id: FrameId("bench/1".into()),
        scene: "bench".into(),
        rgb: rgb(),
        depth: Some(Array2::from_shape_fn(SIZE, |(y, x)| depth(y, x))),
        depth_kind: DepthKind::Planar,
        intrinsics: Some(Intrinsics { fx: 1280.0, fy: 1280.0, cx: 1279.5, cy: 719.5 }),
        semantic: Some(Array2::from_shape_fn(SIZE, |(y, x)| class(y, x))),
        segments: Some(Array2::from_shape_fn(SIZE, |(y, x)| segment(y, x) as u32)),
        segmentation: Segmentation::Instances,
        names: Arc::default(),
        room: None,
    }
}

fn labels() -> Labels {
    let label = |name: &&str| Label { name: (*name).into(), canonical: (*name).into() };
    Labels {
        space: "bench".into(),
        void: [0].into(),
        labels: (1..).zip(CLASSES.iter().map(label)).collect(),
        expressible: CLASSES.map(String::from).into(),
    }
}

/// Writes the same frame as a data set.
#[expect(clippy::unwrap_used, reason = "a folder of the bench's own")]
fn write(folder: &Path) {
    let (height, width) = (SIZE.0 as u32, SIZE.1 as u32);
    let grey = |name: &str, value: &dyn Fn(usize, usize) -> u32| {
        let image: ImageBuffer<Luma<u16>, Vec<u16>> =
            ImageBuffer::from_fn(width, height, |x, y| Luma([value(y as usize, x as usize) as u16]));
        image.save(folder.join(name)).unwrap();
    };
    let image = RgbImage::from_raw(width, height, rgb().samples().to_vec()).unwrap();
    image.save(folder.join("rgb.png")).unwrap();
    grey("depth.png", &depth);
    grey("sem.png", &|y, x| class(y, x).into());
    grey("over.png", &|y, x| segment(y, x) as u32);
    let line = r#"{"scene":"bench","frame":"1","rgb":"rgb.png","depth":"depth.png","depth_scale":0.001,"sem":"sem.png","over":"over.png","intrinsics":{"fx":1280,"fy":1280,"cx":1279.5,"cy":719.5}}"#;
    std::fs::write(folder.join("frames.jsonl"), line).unwrap();
}

#[expect(clippy::unwrap_used, reason = "what is built in and what the bench has written")]
fn stage(c: &mut Criterion) {
    let (rules, palette, labels) = (Rules::built_in().unwrap(), Palette::built_in().unwrap(), labels());
    let key = Digest::from_bytes(b"bench");
    let mut group = c.benchmark_group("questions, 2560x1440");
    group.sample_size(10);
    group.throughput(Throughput::Elements((SIZE.0 * SIZE.1) as u64));
    let frame = frame();
    group.bench_function("measure", |b| {
        b.iter(|| measure(black_box(&frame), &labels, &rules, &palette, key).unwrap());
    });
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let dataset = open_frames(folder.path(), &[]).unwrap();
    let name = dataset.frames().next().unwrap();
    group.bench_function("read and decode", |b| {
        b.iter(|| dataset.files(black_box(name)).unwrap().decode().unwrap());
    });
    group.bench_function("files to statistics", |b| {
        b.iter(|| {
            let files = dataset.files(black_box(name)).unwrap();
            let key = files.digest().unwrap();
            measure(&files.decode().unwrap(), &labels, &rules, &palette, key).unwrap()
        });
    });
    group.finish();
}

criterion_group!(benches, stage);
criterion_main!(benches);
