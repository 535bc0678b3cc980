//! The built-in rooms, held to what their generator knows.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use crate::support::run::{Bench, records, words};
use crate::support::snapshot::each;
use darkqa_base::types::{Digest, Family, Frame, FrameId};
use darkqa_eval::internals::dataset::{DataSource, open_frames};
use darkqa_questions::balance::BalanceMode;
use darkqa_questions::colors::Palette;
use darkqa_questions::room::RoomSource;
use darkqa_questions::rule_context::RuleResult;
use darkqa_questions::rules::ClassFlag;
use darkqa_questions::rules::Rules;
use darkqa_questions::statistics::measure;
use darkqa_questions::{Generated, GeneratedQuestion, QuestionRequest, generate};
use darkqa_rooms::Room;
use darkqa_rooms::RoomTruth;
use darkqa_rooms::Rooms;
use darkqa_rooms::ThingTruth;
use darkqa_rooms::VERSION;
use darkqa_rooms::labels;
use rayon::prelude::*;

/// What is seen of a frame by number, and what its generator knows of it.
struct Seen {
    truth: RoomTruth,
    pixels: BTreeMap<u32, usize>,
}

impl Seen {
    fn of(room: &Room, frame: &Frame) -> Self {
        let mut pixels = BTreeMap::new();
        for number in frame.segments.as_ref().unwrap() {
            *pixels.entry(*number).or_insert(0) += 1;
        }
        Self { truth: room.truth(), pixels }
    }

    /// The things of a class that are in view.
    fn of_class(&self, class: &str) -> Vec<&ThingTruth> {
        self.pixels
            .keys()
            .filter_map(|number| {
                let place = (*number as usize).checked_sub(1)?;
                self.truth.things.get(place)
            })
            .filter(|thing| thing.class == class)
            .collect()
    }
}

/// Questions about the rooms of a seed, by Algorithm 1, with what the generator knows of their frames; and what is
/// wrong with every colour that could be asked, with the number of these.
fn asked(rooms: Rooms) -> (Generated, BTreeMap<FrameId, Seen>, (usize, Vec<String>)) {
    let (rules, palette, labels) = (Rules::built_in().unwrap(), Palette::built_in().unwrap(), labels());
    let rooms: Vec<(FrameId, Room)> = rooms.all().collect();
    let measured = rooms.par_iter().map(|(id, room)| {
        let frame = room.frame().unwrap();
        let key = Digest::from_bytes(id.0.as_bytes());
        let statistics = measure(&frame, &labels, &rules, &palette, key).unwrap();
        (statistics, (id.clone(), Seen::of(room, &frame)))
    });
    let (statistics, seen): (Vec<_>, BTreeMap<FrameId, Seen>) = measured.unzip();
    let order = QuestionRequest {
        dataset: "rooms",
        labels: &labels,
        rules: &rules,
        palette: &palette,
        families: Family::by_rule().collect(),
        room_source: RoomSource::Signature,
        balance: BalanceMode::default(),
        rejected: BTreeSet::new(),
    };
    let (mut colors, mut faults) = (0, Vec::new());
    let made = generate(&statistics, &order, |frame, result| {
        let RuleResult::Viable(candidate) = result else {
            return;
        };
        if candidate.family != Family::Color {
            return;
        }
        colors += 1;
        let number = candidate.evidence["segments"][0]["id"].as_u64().unwrap();
        let paint = seen[frame].truth.things[number as usize - 1].color;
        if paint != candidate.answer() {
            faults.push(format!("{frame} {}: {paint:?}", candidate.text));
        }
    });
    (made.unwrap(), seen, (colors, faults))
}

/// Where each activity of the rulebook is done.
const DONE_IN: [(&str, &[&str]); 10] = [
    ("sleep", &["bedroom"]),
    ("take a shower", &["bathroom"]),
    ("use the toilet", &["bathroom"]),
    ("wash my hands", &["bathroom", "kitchen"]),
    ("cook a meal", &["kitchen"]),
    ("watch TV on the sofa", &["living room"]),
    ("relax on a sofa", &["living room"]),
    ("have dinner with my family", &["dining room"]),
    ("work at a desk", &["office"]),
    ("do the laundry", &[]),
];

/// The word by which questions call a thing; its class if they do not name it.
fn called(thing: &ThingTruth) -> String {
    static RULES: LazyLock<Rules> = LazyLock::new(|| Rules::built_in().unwrap());
    let word = RULES.book().question_word(thing.class, thing.word);
    word.unwrap_or(thing.class).to_owned()
}

/// Error of an answer according to the room generator.
fn wrong(asked: &GeneratedQuestion, seen: &Seen) -> Option<String> {
    let (answer, about) = (asked.answer(), asked.about.as_str());
    let truth = match &asked.question.family {
        Family::RoomType => seen.truth.room.to_owned(),
        Family::Affordance => {
            let (_, rooms) = DONE_IN.iter().find(|(known, _)| *known == about)?;
            let suits = rooms.contains(&seen.truth.room);
            if suits { "yes" } else { "no" }.to_owned()
        }
        Family::Presence => {
            let is_visible = seen
                .of_class(about)
                .into_iter()
                .any(|thing| asked.question.text.contains(&format!(" {} in", called(thing))));
            if is_visible { "yes" } else { "no" }.to_owned()
        }
        Family::Color => {
            // One of them is asked about; the others are slivers.
            let things = seen.of_class(about);
            let largest = things.iter().max_by_key(|thing| {
                let place = seen.truth.things.iter().position(|other| std::ptr::eq(other, **thing));
                seen.pixels.get(&(place.unwrap() as u32 + 1))
            });
            largest.map_or("", |thing| thing.color).to_owned()
        }
        Family::Closest => {
            let offered = asked.question.choices.texts();
            let offered = seen
                .pixels
                .keys()
                .filter_map(|number| {
                    let place = (*number as usize).checked_sub(1)?;
                    seen.truth.things.get(place)
                })
                .filter(|thing| offered.contains(&called(thing)));
            let winner = offered.min_by(|a, b| a.distance.total_cmp(&b.distance));
            called(winner?)
        }
        Family::Other(_) => return None,
    };
    (truth != answer).then(|| {
        format!(
            "{} {}: {answer:?}, but {truth:?} ({:?})",
            asked.question.frame, asked.question.text, asked.question.evidence
        )
    })
}

/// Frames enough for five hundred questions, as many of each kind of room as of any other.
fn many(seed: u64) -> Rooms {
    Rooms { frames: 168, seed, size: [240, 180], ..Rooms::default() }
}

#[test]
fn the_questions_are_right_and_even() {
    let (made, mut seen, (colors, lit_wrong)) = asked(many(7));
    assert!(made.asked.len() >= 500, "{}", made.asked.len());
    // Every colour that passes the rules is that of the paint, in light and in shade.
    assert!(lit_wrong.is_empty() && colors >= 70, "{colors}: {lit_wrong:?}");
    let faults: Vec<String> =
        made.asked.iter().filter_map(|asked| wrong(asked, &seen[&asked.question.frame])).collect();
    let counts = format!("{} of {}", faults.len(), made.asked.len());
    assert!(faults.is_empty(), "{counts}:\n{}", faults.join("\n"));

    // Every family, and no answer much more often than another.
    let mut answers: BTreeMap<&Family, BTreeMap<&str, usize>> = BTreeMap::new();
    for asked in &made.asked {
        let of_family = answers.entry(&asked.question.family).or_default();
        *of_family.entry(asked.answer()).or_insert(0) += 1;
    }
    for family in Family::by_rule() {
        let counts = &answers[&family];
        let total: usize = counts.values().sum();
        let most = counts.values().max().unwrap();
        let binary = counts.len() == 2;
        assert!(total >= 15, "{family}: {total}");
        let share = 100 * most / total;
        assert!(share <= if binary { 55 } else { 45 }, "{family}: {counts:?}");
    }
    let chance =
        made.asked.iter().map(|asked| 1.0 / asked.question.choices.len() as f64).sum::<f64>() / made.asked.len() as f64;
    assert!((0.30..0.37).contains(&chance), "{chance}");

    // Every class that is asked about is there in at least five frames.
    let rules = Rules::built_in().unwrap();
    let classes = rules.book().class.iter();
    for (class, _) in classes.filter(|(_, class)| class.flags.contains(&ClassFlag::Asked)) {
        let frames = seen.values().filter(|seen| !seen.of_class(class).is_empty());
        let count = frames.count();
        assert!(count >= 5, "{class}: in {count} frames");
    }

    // No colour is the answer so often that naming it always would pay.
    let colors = &answers[&Family::Color];
    let most = colors.values().max().unwrap();
    assert!(100 * most <= 20 * colors.values().sum::<usize>(), "{colors:?}");

    // A generator that is wrong about everything is found out by every family; a wrong class is often another that is
    // there.
    for seen in seen.values_mut() {
        spoil(&mut seen.truth);
    }
    for family in Family::by_rule() {
        let of_family = made.asked.iter().filter(|asked| asked.question.family == family);
        let found = of_family.clone().filter(|asked| wrong(asked, &seen[&asked.question.frame]).is_some());
        let (found, all) = (found.count(), of_family.count());
        assert!(4 * found >= all, "{family}: {found} of {all}");
    }
}

/// Another room with other colours, whose farthest things are the nearest, and none of whose plain classes are there.
fn spoil(truth: &mut RoomTruth) {
    truth.room = "garage";
    for thing in &mut truth.things {
        thing.color = if thing.color == "red" { "blue" } else { "red" };
        thing.distance = -thing.distance;
    }
    truth.things.reverse();
}

/// The pixels of one small frame.
fn pixels(rooms: Rooms, place: usize) -> Digest {
    let (_, room) = rooms.all().nth(place).unwrap();
    let frame = room.frame().unwrap();
    let depth = frame.depth.as_ref().unwrap().iter().flat_map(|depth| depth.to_le_bytes());
    let segments = frame.segments.as_ref().unwrap().iter().flat_map(|id| id.to_le_bytes());
    let maps: Vec<u8> = depth.chain(segments).collect();
    Digest::from_parts([frame.rgb.samples(), &maps])
}

#[test]
fn seed_gives_same_bytes_everywhere() {
    let rooms = Rooms { frames: 12, seed: 7, size: [160, 120], ..Rooms::default() };
    let all = |threads: usize| -> Vec<Digest> {
        let cores = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        cores.install(|| (0..12).into_par_iter().map(|place| pixels(rooms, place)).collect())
    };
    let made = all(1);
    assert_eq!(made, all(3));
    // Another number of frames leaves them as they are; another seed or version does not. Where this digest changes,
    // `rooms::VERSION` must, and with it `results/reference` and the digest of every picture of a room.
    assert_eq!(pixels(Rooms { frames: 4, ..rooms }, 3), made[3]);
    assert_ne!(pixels(Rooms { seed: 8, ..rooms }, 3), made[3]);
    let digests: Vec<[u8; 32]> = made.iter().map(|digest| *digest.as_bytes()).collect();
    let whole = Digest::from_parts(digests.iter().map(|digest| &digest[..]));
    assert_eq!((VERSION, &*whole.to_string()), (2, PINNED));
}

/// The pixels and maps of twelve small frames of version 2.
const PINNED: &str = "c5491c84daf164e02b0e216ece0341d6587fc9a1a7dbd2b87cb27afdda41968b";

#[test]
fn stored_rooms_match_built_in() {
    let bench = Bench::new();
    let size = ["--frames", "4", "--size", "160x120"];
    bench.complete(&[&["rooms", "--out", "frames"][..], &size].concat());
    let folder = open_frames(&bench.path("frames"), &[]).unwrap();
    let rooms = Rooms { frames: 4, size: [160, 120], ..Rooms::default() };
    let built_in = DataSource::Rooms(rooms).open_without_questions(&[]).unwrap();
    assert_eq!(folder.labels(), built_in.labels());
    assert_eq!(folder.title(), built_in.title());
    let mut count = 0;
    for name in built_in.frames() {
        let [kept, drawn] = [&folder, &built_in].map(|set| set.frame(name).unwrap());
        assert!(kept.rgb == drawn.rgb, "{name}");
        assert_eq!((&kept.depth, &kept.semantic), (&drawn.depth, &drawn.semantic));
        assert_eq!((&kept.segments, &kept.names), (&drawn.segments, &drawn.names));
        assert_eq!((&kept.room, kept.intrinsics), (&drawn.room, drawn.intrinsics));
        count += 1;
    }
    assert_eq!(count, 4);
    let again = bench.call(&[&["rooms", "--out", "frames"][..], &size].concat());
    insta::assert_snapshot!(again.messages(), @"
    exit code: 2
    error: frames/frames.jsonl: the folder has frames already; --force overwrites them, another --out keeps both
    ");
    // The frames on disk and those in the program are asked the same, and answered alike.
    let run = |data: &str, out: &str| {
        bench.complete(&words(&format!("--model observer --data {data} --levels L0,L4 --out {out}")));
        records(&bench.path(out))
            .into_iter()
            .map(|record| {
                (record["question"].to_string(), record["condition"].to_string(), record["reply"].to_string())
            })
            .collect::<BTreeSet<_>>()
    };
    assert_eq!(run("frames", "a"), run("rooms:frames=4,size=160x120", "b"));
}

#[test]
fn senseless_settings_are_named() {
    let bench = Bench::new();
    let data = ["frames=0", "size=640", "size=9x9", "seed=x", "doors=4"];
    let errors = each(data, |setting| {
        let data = format!("rooms:{setting}");
        bench.call(&["--model", "random", "--data", &data]).messages()
    });
    insta::assert_snapshot!(errors, @"
    frames=0
      exit code: 2
      error: invalid value 'rooms:frames=0' for '--data <DIR|FILE|rooms:…>': frames=0: a number from 1 to 1000000
          expected
    size=640
      exit code: 2
      error: invalid value 'rooms:size=640' for '--data <DIR|FILE|rooms:…>': size=640: WIDTHxHEIGHT of 32 to 8192
          pixels expected
    size=9x9
      exit code: 2
      error: invalid value 'rooms:size=9x9' for '--data <DIR|FILE|rooms:…>': size=9x9: WIDTHxHEIGHT of 32 to 8192
          pixels expected
    seed=x
      exit code: 2
      error: invalid value 'rooms:seed=x' for '--data <DIR|FILE|rooms:…>': seed=x: a whole number expected
    doors=4
      exit code: 2
      error: invalid value 'rooms:doors=4' for '--data <DIR|FILE|rooms:…>': doors=4: frames=N, seed=N,
          size=WIDTHxHEIGHT or light=linear expected
    ");
    // A file without questions is no wish for those of the rules.
    bench.file("empty.jsonl", "\n");
    let refused = bench.call(&words("--model random --data rooms:frames=1 --questions empty.jsonl"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: empty.jsonl: no questions in it
    ");
    let refused = bench.call(&["rooms", "--out", "x", "--size", "big"]);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: invalid value 'big' for '--size <WIDTHxHEIGHT>': WIDTHxHEIGHT of 32 to 8192 pixels expected
    ");
}
