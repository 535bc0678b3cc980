//! The figures of `src/docs/observer.md` that no command of the program makes: enhancers that invent, the share of the
//! outline, and photographs. They take minutes, and are asked for by name: `cargo test --release --test program
//! observer::measure -- --ignored --nocapture`.

#![expect(clippy::print_stdout, reason = "the measured figures")]

use darkqa_base::types::Control;
use darkqa_rooms::Rooms;

use super::local::{CHANGES, Elsewhere};
use super::made::{Asked, INVENTING, Outcome, Set, degraded, invented};
use super::{physical, spoiled};

/// The eye views of forty rooms.
fn rooms() -> Set {
    let rooms = Rooms { frames: 80, seed: 7, size: [640, 480], ..Rooms::default() };
    Set::rooms(rooms, |id| id.0.ends_with("/eye"))
}

fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

fn row(name: &str, found: &Outcome) {
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
        let image = |place: usize, asked: &Asked| invented(name, &dark(asked), &set.other(place).image, place as u64);
        row(name, &set.look(image));
        let gain = set.gain(|_, asked| dark(asked), image);
        println!("{name} less raw: {:.1} [{:.1}, {:.1}]", 100.0 * gain.value, 100.0 * gain.low, 100.0 * gain.high);
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
        for control in [Control::OtherRoom, Control::Mosaic12, Control::RandomMasks, Control::Shift4] {
            let found = set.look_with(share, |place, asked| spoiled(&set, place, asked, control));
            row(&format!("{share}, {control}"), &found);
        }
    }
}

/// 96 frames: all views of 48 rooms.
#[test]
#[ignore = "measures"]
fn local_changes_match_reference() {
    let rooms = Rooms { frames: 96, seed: 7, size: [640, 480], ..Rooms::default() };
    let set = Set::rooms(rooms, |_| true);
    head("Local changes", &set);
    row("none", &set.look(|_, asked| asked.image.clone()));
    for change in CHANGES {
        let found = set.look(|place, asked| change.apply(&asked.image, place as u64));
        row(&format!("{change:?}"), &found);
    }
    println!("\n| change | n | score without | with it | seen without | with it |");
    for change in CHANGES.into_iter().filter(|change| change.is_partial()) {
        let Elsewhere { scores, seen } = Elsewhere::of(&set, change);
        let n = scores[0].n;
        let scores = scores.map(|score| {
            let [value, low, high] = [score.value, score.low, score.high].map(percent);
            format!("{value} [{low}, {high}]")
        });
        println!("| {change:?} | {n} | {} | {} | {} | {} |", scores[0], scores[1], seen[0], seen[1]);
    }
}

/// The controls, and with a local change: the image of another room with a box in it is still the image of another
/// room.
#[test]
#[ignore = "measures"]
fn controls_with_local_changes() {
    let set = rooms();
    head("Controls", &set);
    for control in Control::ALL {
        let image = |place: usize, asked: &Asked| spoiled(&set, place, asked, control);
        row(control.name(), &set.look(image));
        if [Control::OtherRoom, Control::Mirrored].contains(&control) {
            for change in CHANGES {
                let image = |place: usize, asked: &Asked| change.apply(&image(place, asked), place as u64);
                row(&format!("{control}, {change:?}"), &set.look(image));
            }
        }
    }
}
