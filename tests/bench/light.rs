//! What an image costs: one 2560×1440 frame through the ladder of both branches, and from decoded frame to request.
//!
//! `cargo bench` runs it; `RAYON_NUM_THREADS=1 cargo bench` on one core.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use darkqa_eval::ask::{Format, Payload};
use darkqa_eval::synthesis::{Negative, NoiseKey, Synthesis, expose};
use darkqa_eval::types::{DarkLevel, FrameId, Rgb};

/// A frame with edges, ramps and some texture, made by integer arithmetic.
#[expect(clippy::unwrap_used, reason = "the size fits the samples")]
fn frame(height: usize, width: usize) -> Rgb {
    let sample = |i: usize| {
        let (y, x, channel) = (i / 3 / width, i / 3 % width, i % 3);
        let shade = (x * 200 / width + y * 55 / height + 40 * ((x / 97 + y / 61) % 2)) as u8;
        shade.wrapping_add((i.wrapping_mul(2_654_435_761) >> 28) as u8 + 9 * channel as u8)
    };
    Rgb::new(height, width, (0..height * width * 3).map(sample).collect()).unwrap()
}

fn ladder(c: &mut Criterion) {
    let clean = frame(1440, 2560);
    let (key, paper) = (
        NoiseKey::new(0, &FrameId("bench".into())),
        Synthesis::default(),
    );
    let mut group = c.benchmark_group("2560x1440");
    group.sample_size(10);
    group.throughput(Throughput::Elements((1440 * 2560) as u64));
    group.bench_function("exposure, five levels", |b| {
        b.iter(|| DarkLevel::ALL.map(|level| expose(black_box(&clean), level)));
    });
    group.bench_function("noise, negative", |b| {
        b.iter(|| Negative::new(black_box(&clean), &key, &paper, DarkLevel::L3));
    });
    let negative = Negative::new(&clean, &key, &paper, DarkLevel::L3);
    group.bench_function("noise, one level from the negative", |b| {
        b.iter(|| negative.develop(black_box(DarkLevel::L3)));
    });
    group.bench_function("noise, five levels", |b| {
        b.iter(|| {
            let negative = Negative::new(black_box(&clean), &key, &paper, DarkLevel::L3);
            DarkLevel::ALL.map(|level| negative.develop(level))
        });
    });
    group.finish();
}

fn request(c: &mut Criterion) {
    let clean = frame(720, 1280);
    let (key, paper) = (
        NoiseKey::new(0, &FrameId("bench".into())),
        Synthesis::default(),
    );
    let mut group = c.benchmark_group("1280x720");
    group.sample_size(10);
    group.bench_function("frame to request, exposure L3", |b| {
        b.iter(|| Payload::encode(&expose(black_box(&clean), DarkLevel::L3), Format::Png, None));
    });
    group.bench_function("frame to request, noise L3", |b| {
        b.iter(|| {
            let dark = Negative::new(black_box(&clean), &key, &paper, DarkLevel::L3)
                .develop(DarkLevel::L3);
            Payload::encode(&dark, Format::Png, None)
        });
    });
    group.finish();
}

criterion_group!(benches, ladder, request);
criterion_main!(benches);
