//! What the built-in rooms and the observer cost: a frame of 1280×720 pixels with all its maps, and a look at one image of it.
//!
//! `cargo bench --bench rooms` runs it, on all cores.

#![expect(clippy::unwrap_used, reason = "what is built in can be read")]

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use darkqa_eval::internals::questions::{ObservedFrame, Palette, Rules};
use darkqa_eval::internals::rooms::{Room, Rooms, labels};

const ROOMS: Rooms = Rooms {
    frames: 12,
    seed: 7,
    size: [1280, 720],
};

/// The frames of six rooms, none of them drawn yet.
fn rooms() -> Vec<Room> {
    ROOMS.all().map(|(_, room)| room).step_by(2).collect()
}

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("rooms 1280x720");
    group.sample_size(10);
    let mut next = 0;
    group.bench_function("draw a frame", |b| {
        b.iter_batched(
            || {
                next += 1;
                rooms().swap_remove(next % 6)
            },
            |room| black_box(room.frame().unwrap()),
            BatchSize::PerIteration,
        );
    });
    let frame = rooms()[0].frame().unwrap();
    let (rules, palette) = (Rules::built_in().unwrap(), Palette::built_in().unwrap());
    let watched = ObservedFrame::new(&frame, &labels(), &rules, &palette).unwrap();
    group.bench_function("look at an image", |b| {
        b.iter(|| black_box(watched.look(&frame.rgb)));
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
