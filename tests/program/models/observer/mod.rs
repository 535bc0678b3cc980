//! The observer answers from the pixels and not from the labels: what it must not see, what it must, and what changes
//! nothing.

mod local;
mod made;
mod measure;
mod run;

use std::sync::LazyLock;

use crate::support::table::check_rows;
use darkqa_base::types::Control;
use darkqa_base::types::{Digest, Family};
use darkqa_eval::Rgb;
use darkqa_light::{CameraModel, NoiseProfile, Synthesis};
use darkqa_rooms::Rooms;

use local::{CHANGES, Change, Elsewhere};
use made::{Asked, Outcome, Set, degraded, invented, mapped};

/// Forty-eight small frames with some two hundred questions.
static SMALL: LazyLock<Set> = LazyLock::new(|| {
    let rooms = Rooms { frames: 48, seed: 7, size: [160, 120], ..Rooms::default() };
    Set::rooms(rooms, |_| true)
});

/// The noise profile whose read noise is amplified, too.
fn physical() -> Synthesis {
    Synthesis::new(NoiseProfile::Physical, CameraModel::default())
}

fn spoiled(set: &Set, place: usize, asked: &Asked, control: Control) -> Rgb {
    let key = Digest::from_bytes(asked.id.0.as_bytes());
    match control {
        Control::OtherRoom => set.other(place).image.clone(),
        control => darkqa_questions::observer::controls::control_image(control, &asked.image, &asked.known, &key),
    }
}

#[test]
fn without_the_right_image_it_guesses() {
    let set = &*SMALL;
    let n: usize = set.frames.iter().map(|frame| frame.questions.len()).sum();
    assert!(n >= 150, "{n}");
    let controls = Control::ALL.into_iter().filter(|control| control.removes_all_information());
    check_rows(controls, |control| {
        let found = set.look(|place, asked| spoiled(set, place, asked, control));
        assert!(found.is_chance(), "{control}: {found:?}");
        assert!(50 * found.evidence <= n, "{control}: {found:?}");
        assert!(200 * found.seen <= found.things, "{control}: {found:?}");
    });
}

/// The rule of an observer that answers from the labels wherever there is any contrast fails the same test.
#[test]
fn label_trusting_observer_is_found() {
    let set = &*SMALL;
    let by_labels = |control: Control| -> Outcome {
        set.judged(
            |place, asked| spoiled(set, place, asked, control),
            |asked, _, question| {
                // Any contrast at all: the untouched frame answers.
                let seen = asked.known.observe(&asked.image);
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
fn tone_and_gain_keep_answers() {
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
    assert!(levels.windows(2).all(|pair| falls(&pair[0], &pair[1])), "{levels:?}");
    let seen = levels.map(|level| level.seen);
    assert!(seen[0] > seen[1] && seen[1] > seen[2], "{seen:?}");
    assert!(levels[2].score.value > 2.0 * levels[2].chance / 1.5, "{levels:?}");
}

#[test]
fn what_is_invented_adds_nothing() {
    let set = &*SMALL;
    let physical = physical();
    let dark = |asked: &Asked| degraded(asked, "L4-noise", &physical);
    check_rows(["blotches", "stripes", "unsharp mask", "foreign edges"], |name| {
        let gain = set.gain(
            |_, asked| dark(asked),
            |place, asked| invented(name, &dark(asked), &set.other(place).image, place as u64),
        );
        assert!(gain.low <= 0.0, "{name}: {gain:?}");
    });
}

#[test]
fn a_covered_part_hides_nothing_elsewhere() {
    let set = &*SMALL;
    let covered = CHANGES.into_iter().filter(|change| change.is_partial());
    check_rows(covered, |change| {
        let Elsewhere { scores, seen } = Elsewhere::of(set, change);
        let [without, with] = scores.map(|score| score.value);
        // Nine questions at least: one of them may be lost.
        assert!(with >= 0.88 * without, "{change:?}: {scores:?}");
        assert!(10 * seen[1] >= 8 * seen[0], "{change:?}: {seen:?}");
    });
}

#[test]
fn uneven_light_hides_little() {
    let set = &*SMALL;
    check_rows([Change::Lamp, Change::Gradient, Change::StrayLight], |change| {
        let found = set.look(|place, asked| change.apply(&asked.image, place as u64));
        assert!(found.score.value >= 0.85, "{change:?}: {found:?}");
    });
}

#[test]
fn foreign_local_changes_show_nothing() {
    let set = &*SMALL;
    check_rows(CHANGES, |change| {
        let image = |place: usize, _: &Asked| change.apply(&set.other(place).image, place as u64);
        let found = set.look(image);
        assert!(found.is_chance(), "{change:?}: {found:?}");
        assert!(200 * found.seen <= found.things, "{change:?}: {found:?}");
    });
}

/// A thing that is painted in another colour has that colour, and not the one that is known: its own light does not
/// hide it.
#[test]
fn a_repainted_thing_loses_its_colour() {
    let set = &*SMALL;
    let repainted = |asked: &Asked| {
        let colored = asked.questions.iter().find(|question| question.family == Family::Color)?;
        let id = colored.evidence.value()["segments"][0]["id"].as_u64()?;
        let image = mapped(&asked.image, |y, x, channel, code| {
            let own = u64::from(asked.segments[y * asked.image.width() + x]) == id;
            let painted = [0.3, 0.7, 1.0][channel] * code;
            if own { painted } else { code }
        });
        let answer = |image: &Rgb| asked.known.observe(image).answer(colored, &set.rules, &set.palette);
        Some([&asked.image, &image].map(|image| answer(image) == colored.choices.truth()))
    };
    let found: Vec<[bool; 2]> = set.frames.iter().filter_map(repainted).collect();
    let right = |image: usize| found.iter().filter(|right| right[image]).count();
    assert!(found.len() >= 5, "{found:?}");
    assert_eq!(right(0), found.len());
    assert!(2 * right(1) <= right(0), "{found:?}");
}

#[test]
fn observer_accepts_any_size() {
    let asked = &SMALL.frames[0];
    for [height, width] in [[1, 1], [3, 2], [120, 160], [240, 320], [50, 350]] {
        let seen = asked.known.observe(&Rgb::black(height, width));
        assert_eq!((seen.seen_count(), seen.detected_count()), (0, 0), "{height} × {width}");
    }
    // A frame of twice the size, by repeated pixels, is the same frame.
    let mut large = Rgb::black(240, 320);
    for (i, pixel) in large.samples_mut().chunks_exact_mut(3).enumerate() {
        let from = (i / 320 / 2 * 160 + i % 320 / 2) * 3;
        pixel.copy_from_slice(&asked.image.samples()[from..from + 3]);
    }
    let (own, twice) = (asked.known.observe(&asked.image), asked.known.observe(&large));
    assert_eq!((own.seen_count(), own.explained_variance()), (twice.seen_count(), twice.explained_variance()));
}
