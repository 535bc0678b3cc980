//! What the built-in rooms and the observer cost: a frame with all its maps, what the observer prepares for a
//! frame, and a look at one image of it; at 640×480 and 1280×720 pixels.
//!
//! `cargo bench --bench rooms` runs it, on all cores.

#![expect(clippy::unwrap_used, reason = "what is built in can be read")]

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use darkqa_questions::colors::Palette;
use darkqa_questions::observer::ObservedFrame;
use darkqa_questions::rules::Rules;
use darkqa_rooms::Room;
use darkqa_rooms::Rooms;
use darkqa_rooms::labels;

const SIZES: [[usize; 2]; 2] = [[640, 480], [1280, 720]];

/// The frames of six rooms, none of them drawn yet.
fn rooms(size: [usize; 2]) -> Vec<Room> {
    let rooms = Rooms { frames: 12, seed: 7, size, ..Rooms::default() };
    rooms.all().map(|(_, room)| room).step_by(2).collect()
}

fn bench(c: &mut Criterion) {
    for size in SIZES {
        of_size(c, size);
    }
}

fn of_size(c: &mut Criterion, size: [usize; 2]) {
    let mut group = c.benchmark_group(format!("rooms {}x{}", size[0], size[1]));
    group.sample_size(10);
    let mut next = 0;
    group.bench_function("draw a frame", |b| {
        b.iter_batched(
            || {
                next += 1;
                rooms(size).swap_remove(next % 6)
            },
            |room| black_box(room.frame().unwrap()),
            BatchSize::PerIteration,
        );
    });
    let frame = rooms(size)[0].frame().unwrap();
    let (rules, palette) = (Rules::built_in().unwrap(), Palette::built_in().unwrap());
    let observed = || ObservedFrame::new(&frame, &labels(), &rules, &palette).unwrap();
    group.bench_function("prepare the observer", |b| b.iter(|| black_box(observed())));
    let observed = observed();
    group.bench_function("look at an image", |b| {
        b.iter(|| black_box(observed.observe(&frame.rgb)));
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
