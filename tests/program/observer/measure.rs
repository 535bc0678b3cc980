//! The figures of `src/docs/observer.md` that no command of the program makes: enhancers that invent, the share of the outline,
//! and photographs. They take minutes, and are asked for by name:
//! `cargo test --release --test program observer::measure -- --ignored --nocapture`.

#![expect(clippy::print_stdout, reason = "the measured figures")]

use darkqa_eval::internals::questions::Control;
use darkqa_eval::internals::rooms::Rooms;

use super::made::{Asked, INVENTING, Outcome, Set, degraded, invented};
use super::{physical, spoiled};

/// The eye views of forty rooms.
fn rooms() -> Set {
    let rooms = Rooms {
        frames: 80,
        seed: 7,
        size: [640, 480],
        ..Rooms::default()
    };
    Set::rooms(rooms, |id| id.0.ends_with("/eye"))
}

fn row(name: &str, found: &Outcome) {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let n = found.score.n;
    println!(
        "| {name} | {} [{}, {}] | {} | {} | {} | {} | {n} |",
        percent(found.score.value),
        percent(found.score.low),
        percent(found.score.high),
        percent(found.evidence as f64 / n as f64),
        percent(found.seen as f64 / found.things as f64),
        percent(found.detected as f64 / found.things as f64),
        percent(found.explained),
    );
}

fn head(title: &str, set: &Set) {
    println!("\n{title}: {} frames", set.frames.len());
    println!("| image | expected score | from evidence | things seen | detected | R² | n |");
}

#[test]
#[ignore = "measures"]
fn enhancers_that_invent() {
    let set = rooms();
    let physical = physical();
    let dark = |asked: &Asked| degraded(asked, "L5-noise", &physical);
    head("Inventing enhancers on physical L5", &set);
    row("raw", &set.look(|_, asked| dark(asked)));
    for name in INVENTING {
        let image = |place: usize, asked: &Asked| {
            invented(name, &dark(asked), &set.other(place).image, place as u64)
        };
        row(name, &set.look(image));
        let gain = set.gain(|_, asked| dark(asked), image);
        println!(
            "{name} less raw: {:.1} [{:.1}, {:.1}]",
            100.0 * gain.value,
            100.0 * gain.low,
            100.0 * gain.high
        );
    }
}

#[test]
#[ignore = "measures"]
fn the_share_of_the_outline() {
    let set = rooms();
    let physical = physical();
    head("Share of the outline", &set);
    for share in [0.3, 0.4, 0.5, 0.6, 0.7] {
        let dark = set.look_with(share, |_, asked| degraded(asked, "L5-noise", &physical));
        row(&format!("{share}, physical L5"), &dark);
        for control in [
            Control::OtherRoom,
            Control::Mosaic12,
            Control::RandomMasks,
            Control::Shift4,
        ] {
            let found = set.look_with(share, |place, asked| spoiled(&set, place, asked, control));
            row(&format!("{share}, {control}"), &found);
        }
    }
}
