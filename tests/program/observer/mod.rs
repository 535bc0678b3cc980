//! The observer answers from the pixels and not from the labels: what it must not see, what it must, and what changes nothing.

mod made;
mod measure;
mod run;

use std::sync::LazyLock;

use crate::support::table::check_rows;
use darkqa_eval::Rgb;
use darkqa_eval::internals::questions::{self, Control};
use darkqa_eval::internals::rooms::Rooms;
use darkqa_eval::synthesis::{CameraModel, LightReading, Synthesis};
use darkqa_eval::types::Digest;

use made::{Asked, Outcome, Set, degraded, invented, mapped};

/// Forty-eight small frames with some two hundred questions.
static SMALL: LazyLock<Set> = LazyLock::new(|| {
    let rooms = Rooms {
        frames: 48,
        seed: 7,
        size: [160, 120],
        ..Rooms::default()
    };
    Set::rooms(rooms, |_| true)
});

/// The light reading whose read noise is amplified, too.
fn physical() -> Synthesis {
    Synthesis::of(LightReading::Physical, CameraModel::default())
}

fn spoiled(set: &Set, place: usize, asked: &Asked, control: Control) -> Rgb {
    let key = Digest::of(asked.id.0.as_bytes());
    match control {
        Control::OtherRoom => set.other(place).image.clone(),
        control => questions::spoiled(control, &asked.image, &asked.known, &key),
    }
}

#[test]
fn without_the_right_image_it_guesses() {
    let set = &*SMALL;
    let n: usize = set.frames.iter().map(|frame| frame.questions.len()).sum();
    assert!(n >= 150, "{n}");
    let controls = Control::ALL
        .into_iter()
        .filter(|control| control.leaves_nothing());
    check_rows(controls, |control| {
        let found = set.look(|place, asked| spoiled(set, place, asked, control));
        assert!(found.is_chance(), "{control}: {found:?}");
        assert!(50 * found.evidence <= n, "{control}: {found:?}");
        assert!(200 * found.seen <= found.things, "{control}: {found:?}");
    });
}

/// The rule of an observer that answers from the labels wherever there is any contrast fails the same test.
#[test]
fn an_observer_that_trusts_the_labels_is_found_out() {
    let set = &*SMALL;
    let by_labels = |control: Control| -> Outcome {
        set.judged(
            |place, asked| spoiled(set, place, asked, control),
            |asked, _, question| {
                // Any contrast at all: the untouched frame answers.
                let seen = asked.known.look(&asked.image);
                seen.answer(question, &set.rules, &set.palette)
            },
        )
    };
    for control in [Control::OtherRoom, Control::Mosaic12, Control::PinkNoise] {
        let found = by_labels(control);
        assert!(!found.is_chance(), "{control}: {found:?}");
    }
}

#[test]
fn a_tone_curve_and_a_gain_change_no_answer() {
    let set = &*SMALL;
    let clean = set.look(|_, asked| asked.image.clone());
    assert!(clean.score.value >= 0.97, "{clean:?}");
    assert_eq!(clean.seen, clean.things);
    let curved = set.look(|_, asked| {
        mapped(&asked.image, |_, _, channel, code| {
            let power = [0.8, 1.0, 1.25][channel];
            let gain = [250.0, 235.0, 245.0][channel];
            gain * (code / 255.0_f64).powf(power)
        })
    });
    assert!(curved.score.value >= 0.97, "{curved:?}");
    assert!(curved.explained > 0.999, "{curved:?}");
}

#[test]
fn more_noise_leaves_no_more() {
    let set = &*SMALL;
    let paper = Synthesis::default();
    let look = |how: &str, reading: &Synthesis| set.look(|_, asked| degraded(asked, how, reading));
    let dark = look("L5-ev", &paper);
    let noisy = look("L5-noise", &paper);
    let physical = physical();
    let levels = ["L1-noise", "L3-noise", "L5-noise"].map(|how| look(how, &physical));
    let falls = |bright: &Outcome, dark: &Outcome| dark.score.low <= bright.score.high;
    assert!(falls(&dark, &noisy), "{dark:?} {noisy:?}");
    assert!(falls(&noisy, &levels[2]), "{noisy:?} {levels:?}");
    assert!(
        levels.windows(2).all(|pair| falls(&pair[0], &pair[1])),
        "{levels:?}"
    );
    let seen = levels.map(|level| level.seen);
    assert!(seen[0] > seen[1] && seen[1] > seen[2], "{seen:?}");
    assert!(
        levels[2].score.value > 2.0 * levels[2].chance / 1.5,
        "{levels:?}"
    );
}

#[test]
fn what_is_invented_adds_nothing() {
    let set = &*SMALL;
    let physical = physical();
    let dark = |asked: &Asked| degraded(asked, "L4-noise", &physical);
    check_rows(
        ["blotches", "stripes", "unsharp mask", "foreign edges"],
        |name| {
            let gain = set.gain(
                |_, asked| dark(asked),
                |place, asked| invented(name, &dark(asked), &set.other(place).image, place as u64),
            );
            assert!(gain.low <= 0.0, "{name}: {gain:?}");
        },
    );
}

#[test]
fn an_image_of_any_size_is_looked_at() {
    let asked = &SMALL.frames[0];
    for [height, width] in [[1, 1], [3, 2], [120, 160], [240, 320], [50, 350]] {
        let seen = asked.known.look(&Rgb::black(height, width));
        assert_eq!((seen.seen(), seen.detected()), (0, 0), "{height} × {width}");
    }
    // A frame of twice the size, by repeated pixels, is the same frame.
    let mut large = Rgb::black(240, 320);
    for (i, pixel) in large.samples_mut().chunks_exact_mut(3).enumerate() {
        let from = (i / 320 / 2 * 160 + i % 320 / 2) * 3;
        pixel.copy_from_slice(&asked.image.samples()[from..from + 3]);
    }
    let (own, twice) = (asked.known.look(&asked.image), asked.known.look(&large));
    assert_eq!(
        (own.seen(), own.explained()),
        (twice.seen(), twice.explained())
    );
}
