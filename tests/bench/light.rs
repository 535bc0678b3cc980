//! What an image costs: one 2560×1440 frame through the ladder of both branches and through each part of it, a
//! 1000×1000 frame blurred by the motion of its camera, a 1280×720 frame from pixels to request, and a dark image
//! compared with its clean frame.
//!
//! `cargo bench --bench light` runs it; `RAYON_NUM_THREADS=1 cargo bench --bench light` on one core.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use darkqa_base::types::{FrameId, Rgb, Severity};
use darkqa_light::exposure::expose;
use darkqa_light::exposure::expose_into;
use darkqa_light::movement::blur::{blur, blurred_codes};
use darkqa_light::raw::negative::{Negative, ladder as develop_ladder};
use darkqa_light::raw::noise::{Term, add as add_noise};
use darkqa_light::raw::unprocess;
use darkqa_light::{
    Amplify, AppliedDegradation, AutoExposure, CameraModel, Draws, Exposures, FrameView, Motion, NoiseKey,
    NoiseProfile, Streak, Synthesis,
};
use darkqa_pictures::Payload;
use darkqa_pictures::PayloadFormat;
use darkqa_pictures::bilinear;
use darkqa_score::photographs::realism::psnr;
use darkqa_score::photographs::realism::ssim::ssim;

/// A frame with edges, ramps and some texture, made by integer arithmetic.
#[expect(clippy::unwrap_used, reason = "the size fits the samples")]
fn frame(height: usize, width: usize) -> Rgb {
    let sample = |i: usize| {
        let (y, x, channel) = (i / 3 / width, i / 3 % width, i % 3);
        let shade = (x * 200 / width + y * 55 / height + 40 * ((x / 97 + y / 61) % 2)) as u8;
        shade.wrapping_add((i.wrapping_mul(2_654_435_761) >> 28) as u8).wrapping_add(9 * channel as u8)
    };
    Rgb::new(height, width, (0..height * width * 3).map(sample).collect()).unwrap()
}

fn key() -> NoiseKey {
    NoiseKey::new(0, &FrameId("bench".into()))
}

fn ladder(c: &mut Criterion) {
    let clean = frame(1440, 2560);
    let (key, paper) = (key(), Synthesis::default());
    let mut dark = Severity::LADDER.map(|_| Rgb::black(1440, 2560));
    let mut group = c.benchmark_group("2560x1440");
    group.sample_size(10);
    group.throughput(Throughput::Elements((1440 * 2560) as u64));
    group.bench_function("exposure, five levels", |b| {
        b.iter(|| {
            for (level, dark) in Severity::LADDER.into_iter().zip(&mut dark) {
                expose_into(black_box(&clean), level.value(), dark);
            }
        });
    });
    group.bench_function("exposure, five levels, new images", |b| {
        b.iter(|| Severity::LADDER.map(|level| expose(black_box(&clean), level)));
    });
    group.bench_function("noise, five levels", |b| {
        b.iter(|| {
            develop_ladder(
                black_box(&clean),
                &key,
                &paper,
                &Severity::LADDER,
                &mut dark.each_mut().map(Rgb::samples_mut),
            );
        });
    });
    let fresh = Synthesis { draws: Draws::Fresh, ..Synthesis::default() };
    group.bench_function("noise, five levels, fresh draws", |b| {
        b.iter(|| {
            develop_ladder(
                black_box(&clean),
                &key,
                &fresh,
                &Severity::LADDER,
                &mut dark.each_mut().map(Rgb::samples_mut),
            );
        });
    });
    group.bench_function("noise, negative", |b| {
        b.iter(|| Negative::new(black_box(&clean), &key, &paper, Severity::L3));
    });
    let negative = Negative::new(&clean, &key, &paper, Severity::L3);
    group.bench_function("noise, one level from the negative", |b| {
        b.iter(|| negative.develop(black_box(Severity::L3)));
    });
    group.finish();
}

/// Each part alone, by sample of the sensor: what is left of the noise when a term is taken is the draw of its bits.
fn parts(c: &mut Criterion) {
    let clean = frame(1440, 2560);
    let (key, paper) = (key(), Synthesis::default());
    let state = paper.state(&key, Severity::L3);
    let mut group = c.benchmark_group("parts, 2560x1440");
    group.sample_size(10);
    group.throughput(Throughput::Elements((1440 * 2560) as u64));
    group.bench_function("unprocess", |b| {
        b.iter(|| unprocess(black_box(&clean), &state));
    });
    let mut raw = unprocess(&clean, &state);
    let sets: [(&str, &[Term]); 6] = [
        ("no term", &[]),
        ("shot", &[Term::Shot]),
        ("read", &[Term::Read]),
        ("row", &[Term::Row]),
        ("quantisation", &[Term::Quantisation]),
        ("all terms", &Term::ALL),
    ];
    for (name, terms) in sets {
        group.bench_function(name, |b| {
            b.iter(|| add_noise(black_box(&mut raw), &state, &key, Amplify::ShotOnly, terms));
        });
        raw = unprocess(&clean, &state);
    }
    group.finish();
}

/// A megapixel, so that the milliseconds are those of a megapixel: motion blur alone, the light that automatic exposure
/// takes, and whole images of both kinds.
#[expect(clippy::unwrap_used, reason = "the paths are short enough")]
fn motion(c: &mut Criterion) {
    let clean = frame(1000, 1000);
    let mut group = c.benchmark_group("1000x1000");
    group.sample_size(10);
    group.throughput(Throughput::Elements(1_000_000));
    for (length, angle) in
        [(1.69, 0.0), (6.78, 0.0), (16.0, 0.0), (64.0, 0.0), (4.0, 30.0), (16.0, 30.0), (16.0, 90.0), (64.0, 30.0)]
    {
        let streak = Streak::new(length, angle).unwrap();
        group.bench_function(format!("motion, {length} px at {angle}°"), |b| {
            b.iter(|| blurred_codes(black_box(&clean), streak));
        });
    }
    for angle in [0.0, 30.0] {
        let streak = Streak::new(16.0, angle).unwrap();
        group.bench_function(format!("blurred light, 16 px at {angle}°"), |b| {
            b.iter(|| blur(black_box(&clean).into(), streak));
        });
    }
    let view = FrameView { width: 1000, focal: None };
    let (auto, motion) = (AutoExposure::default(), Motion::default());
    for how in ["L5-auto", "L5-noise@physical"] {
        let how: darkqa_eval::Degradation = how.parse().unwrap();
        let physical = Synthesis::new(NoiseProfile::Physical, CameraModel::default());
        let applied = AppliedDegradation::new(&how, &physical, &auto, &motion, view, &key()).unwrap();
        group.bench_function(how.to_string(), |b| {
            b.iter(|| Exposures::default().degrade(black_box((&clean).into()), &applied, &key()));
        });
    }
    group.finish();
}

fn request(c: &mut Criterion) {
    let clean = frame(720, 1280);
    let (key, paper) = (key(), Synthesis::default());
    let mut group = c.benchmark_group("1280x720");
    group.sample_size(10);
    let noisy = || Negative::new(&clean, &key, &paper, Severity::L3).develop(Severity::L3);
    group.bench_function("noise L3", |b| b.iter(noisy));
    let dark = noisy();
    group.bench_function("noise L3 to PNG body", |b| {
        b.iter(|| Payload::encode(black_box(&dark), PayloadFormat::Png));
    });
    group.bench_function("frame to request, exposure L3", |b| {
        b.iter(|| Payload::encode(&expose(black_box(&clean), Severity::L3), PayloadFormat::Png));
    });
    group.bench_function("frame to request, noise L3", |b| {
        b.iter(|| Payload::encode(&noisy(), PayloadFormat::Png));
    });
    group.finish();
}

/// A frame of a walk, in the size of HM3D's, as OpenEQA's protocol sends it.
fn walk(c: &mut Criterion) {
    let clean = frame(1080, 1920);
    let (key, paper) = (key(), Synthesis::default());
    let mut group = c.benchmark_group("1920x1080");
    group.bench_function("scaled to 512", |b| {
        b.iter(|| bilinear(black_box(&clean), 512));
    });
    group.bench_function("noise L4, scaled to 512, to PNG body", |b| {
        b.iter(|| {
            let dark = Negative::new(&clean, &key, &paper, Severity::L4).develop(Severity::L4);
            Payload::encode(&bilinear(&dark, 512)?, PayloadFormat::Png)
        });
    });
    group.finish();
}

/// The fidelity of an image.
fn fidelity(c: &mut Criterion) {
    let clean = frame(1440, 2560);
    let dark = expose(&clean, Severity::L3);
    let mut group = c.benchmark_group("fidelity, 2560x1440");
    group.sample_size(10);
    group.bench_function("PSNR", |b| b.iter(|| psnr(black_box(&dark), &clean)));
    group.bench_function("SSIM", |b| b.iter(|| ssim(black_box(&dark), &clean)));
    group.finish();
}

criterion_group!(benches, ladder, parts, motion, request, walk, fidelity);
criterion_main!(benches);
