//! What it costs to enhance an image, from bytes to bytes, at 640×360 and 1280×720.
//!
//! `cargo bench --bench enhance` runs the project's own model; `DARKQA_BENCH_LLIE=zero-dce:FILE.onnx` any other, in
//! tiles of `DARKQA_BENCH_TILE` pixels or as it is by itself, on `DARKQA_BENCH_THREADS` threads or all cores.

use std::env;
use std::hint::black_box;
use std::path::PathBuf;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use darkqa_base::types::Rgb;
use darkqa_enhance::{Enhancer, Install, ModelFile, RuntimeSearch, Tiling, disable_telemetry};

/// A dark frame with texture, made by integer arithmetic.
#[expect(clippy::unwrap_used, reason = "the size fits the samples")]
fn frame(height: usize, width: usize) -> Rgb {
    let sample = |i: usize| {
        let (y, x) = (i / 3 / width, i / 3 % width);
        let shade = x * 40 / width + y * 20 / height + 15 * ((x / 97 + y / 61) % 2);
        shade as u8 + (i.wrapping_mul(2_654_435_761) >> 29 & 7) as u8
    };
    Rgb::new(height, width, (0..height * width * 3).map(sample).collect()).unwrap()
}

#[expect(clippy::unwrap_used, reason = "a bench without its model is none")]
#[expect(unsafe_code, reason = "ONNX Runtime is told by the environment alone")]
fn enhance(c: &mut Criterion) {
    // SAFETY: no other thread runs yet.
    unsafe { disable_telemetry() };
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/models/gray-gain.onnx");
    let model = env::var_os("DARKQA_BENCH_LLIE").map_or(own.into(), PathBuf::from);
    let number = |name: &str| env::var(name).ok().map(|text| text.parse().unwrap());
    let search = RuntimeSearch { library: env::var_os("ORT_DYLIB_PATH").map(PathBuf::from), install: Install::Allowed };
    let file = ModelFile::read(&model).unwrap();
    let enhancer = Enhancer::open(file, &search.open().unwrap(), number("DARKQA_BENCH_THREADS"));
    let tiling = number("DARKQA_BENCH_TILE").map_or(Tiling::Auto, Tiling::Side);
    let mut enhancer = enhancer.unwrap().with_tiling(tiling);
    let mut group = c.benchmark_group(enhancer.name().to_string());
    group.sample_size(10);
    for (height, width) in [(360, 640), (720, 1280)] {
        let dark = frame(height, width);
        group.throughput(Throughput::Elements((height * width) as u64));
        group.bench_function(format!("{width}x{height}"), |b| {
            b.iter(|| enhancer.enhance(black_box(&dark)).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, enhance);
criterion_main!(benches);
