//! `questions`: from files to questions, the same whatever the threads, the order and the interruptions; and what is
//! wrong with a data set is said.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::run::{PROGRAM, called};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;
use darkqa_base::labels::space;
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};
use serde_json::{Value, json};
use tempfile::TempDir;

const SIZE: (u32, u32) = (320, 240);

/// A thing in the picture: its label, its word, its box, its depth in millimetres and its colour.
type Thing = (u16, &'static str, [u32; 4], u16, [u8; 3]);

/// A bedroom as NYU40 labels it.
const BEDROOM: [Thing; 7] = [
    (1, "wall", [0, 0, 320, 120], 5000, [228, 226, 220]),
    (2, "floor", [0, 120, 320, 240], 3500, [120, 90, 60]),
    (4, "bed", [30, 100, 170, 200], 2500, [180, 20, 25]),
    (18, "pillow", [60, 104, 100, 124], 2600, [245, 245, 245]),
    (17, "dresser", [200, 70, 260, 150], 3200, [20, 60, 170]),
    (11, "picture", [220, 15, 260, 50], 4900, [20, 130, 40]),
    (5, "chair", [262, 150, 310, 225], 1500, [12, 12, 12]),
];

/// A frame of a data set that a test makes.
struct View {
    scene: &'static str,
    things: Vec<Thing>,
}

fn bedroom(scene: &'static str) -> View {
    View { scene, things: BEDROOM.to_vec() }
}

/// A data set as `import` leaves it.
struct Data(TempDir);

impl Data {
    fn of(views: &[View]) -> Self {
        let data = Self(tempfile::tempdir().unwrap());
        let mut lines = String::new();
        for (i, view) in views.iter().enumerate() {
            data.draw(i, &view.things);
            writeln!(lines, "{}", line(view.scene, i)).unwrap();
        }
        data.write("frames.jsonl", &lines);
        let classes = space("nyu40").unwrap().labels.into_iter();
        data.label("nyu40", classes.map(|(id, label)| (id, label.name, label.canonical)));
        data
    }

    /// Writes what the numbers stand for.
    fn label(&self, space: &str, classes: impl Iterator<Item = (u16, String, String)>) {
        let class = |(id, name, canonical)| json!({"id": id, "name": name, "canonical": canonical});
        let classes: Vec<Value> = classes.map(class).collect();
        let file = json!({"schema": "darkqa.classes/1", "space": space, "void_id": 0, "classes": classes});
        self.write("classes.json", &file.to_string());
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    fn draw(&self, frame: usize, things: &[Thing]) {
        let at = |x: u32, y: u32| {
            let inside = |(_, thing): &(usize, &Thing)| {
                let [left, top, right, bottom] = thing.2;
                (left..right).contains(&x) && (top..bottom).contains(&y)
            };
            things.iter().enumerate().rfind(inside)
        };
        let map = |value: &dyn Fn(usize, &Thing) -> u16| {
            ImageBuffer::<Luma<u16>, Vec<u16>>::from_fn(SIZE.0, SIZE.1, |x, y| {
                Luma([at(x, y).map_or(0, |(i, thing)| value(i, thing))])
            })
        };
        let image = RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| Rgb(at(x, y).map_or([0; 3], |(_, thing)| thing.4)));
        image.save(self.path(&format!("rgb{frame}.png"))).unwrap();
        let save = |name: &str, map: ImageBuffer<Luma<u16>, Vec<u16>>| {
            map.save(self.path(&format!("{name}{frame}.png"))).unwrap();
        };
        save("sem", map(&|_, thing| thing.0));
        save("over", map(&|i, _| i as u16 + 1));
        save("depth", map(&|_, thing| thing.3));
    }

    /// Changes the line of the first frame.
    fn change(&self, change: impl FnOnce(&mut Value)) {
        let text = fs::read_to_string(self.path("frames.jsonl")).unwrap();
        let (first, rest) = text.split_once('\n').unwrap();
        let mut first: Value = serde_json::from_str(first).unwrap();
        change(&mut first);
        self.write("frames.jsonl", &format!("{first}\n{rest}"));
    }

    fn ask(&self, out: &Path, flags: &[&str]) -> Outcome {
        let mut command = Command::new(PROGRAM);
        let out = out.join("q.jsonl");
        let command = command.arg("questions").arg(self.0.path()).arg("--out");
        let output = command.arg(&out).args(flags).output().unwrap();
        Outcome {
            code: output.status.code().unwrap(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
            questions: fs::read_to_string(out).unwrap_or_default(),
        }
    }
}

fn line(scene: &str, frame: usize) -> Value {
    json!({
        "scene": scene, "frame": frame.to_string(),
        "rgb": format!("rgb{frame}.png"), "sem": format!("sem{frame}.png"), "over": format!("over{frame}.png"),
        "depth": format!("depth{frame}.png"), "depth_scale": 0.001,
        "intrinsics": {"fx": 300.0, "fy": 300.0, "cx": 159.5, "cy": 119.5},
    })
}

struct Outcome {
    code: i32,
    out: String,
    err: String,
    questions: String,
}

impl Outcome {
    fn lines(&self) -> Vec<Value> {
        assert_eq!(self.code, 0, "{}", self.err);
        self.questions.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    fn of(&self, family: &str) -> Vec<Value> {
        let mut lines = self.lines();
        lines.retain(|line| line["family"] == family);
        lines
    }

    /// Refused with words in which all of these occur.
    fn refused(&self, words: &[&str]) {
        assert_eq!(self.code, 2, "{}{}", self.out, self.err);
        for word in words {
            assert!(self.err.contains(word), "{word:?} is not in {}", self.err);
        }
    }
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn bedroom_has_every_question_family() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    let outcome = data.ask(out.path(), &["--balance", "none"]);
    let answers: Vec<(String, String)> = ["room_type", "affordance", "presence", "color", "closest"]
        .into_iter()
        .map(|family| {
            let asked = outcome.of(family);
            assert_eq!(asked.len(), 1, "{family}: {}", outcome.questions);
            (asked[0]["question"].to_string(), asked[0]["answer"].to_string())
        })
        .collect();
    assert_eq!(answers[0].1, "\"bedroom\"");
    assert_eq!(answers[4].1, "\"chair\"", "{answers:?}");
    for line in outcome.lines() {
        let choices = line["choices"].as_array().unwrap();
        assert!(choices.contains(&line["answer"]), "{line}");
        let rules = &line["evidence"]["rules"];
        assert_eq!(rules["digest"].as_str().unwrap().len(), 64, "{line}");
    }
    let depths = &outcome.of("closest")[0]["evidence"]["segments"];
    assert!(depths.as_array().unwrap().len() >= 2, "{depths}");
}

#[test]
fn threads_and_interrupts_keep_bytes() {
    let views: Vec<View> = ["a", "b", "c", "d", "e", "f", "g"].map(bedroom).into();
    let (data, whole) = (Data::of(&views), folder());
    let first = data.ask(whole.path(), &["--threads", "1"]);
    assert_eq!(first.code, 0, "{}", first.err);
    let statistics = |folder: &Path| fs::read(folder.join("q.statistics.jsonl")).unwrap();
    let same = |folder: &Path, flags: &[&str]| {
        let again = data.ask(folder, flags);
        assert_eq!(again.questions, first.questions);
        assert_eq!(again.out.lines().count(), first.out.lines().count());
        assert_eq!(statistics(folder), statistics(whole.path()));
    };
    same(folder().path(), &["--threads", "4"]);

    let text = fs::read_to_string(data.path("frames.jsonl")).unwrap();
    let lines: Vec<&str> = text.lines().rev().collect();
    data.write("frames.jsonl", &lines.join("\n"));
    same(folder().path(), &[]);

    // Stopped in the middle of a line.
    let cut = folder();
    let kept = statistics(whole.path());
    fs::write(cut.path().join("q.statistics.jsonl"), &kept[..kept.len() / 2]).unwrap();
    same(cut.path(), &[]);
}

#[test]
fn measurements_are_cached_by_content() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    data.ask(out.path(), &[]);
    let kept = out.path().join("q.statistics.jsonl");
    // What was kept is what the rules see: a depth changed there decides the answer.
    let before = fs::read_to_string(&kept).unwrap();
    let mut frame: Value = serde_json::from_str(before.trim()).unwrap();
    for segment in frame["segments"].as_array_mut().unwrap() {
        if segment["class"] == "chest_of_drawers" {
            segment["depth"]["p10"] = 490.into();
            segment["depth"]["median"] = 500.into();
            segment["depth"]["p90"] = 510.into();
        }
    }
    fs::write(&kept, format!("{frame}\n")).unwrap();
    let closest = |outcome: &Outcome| outcome.of("closest")[0]["answer"].clone();
    assert_eq!(closest(&data.ask(out.path(), &[])), "dresser");
    // Another image under the same name is measured anew.
    let mut things = BEDROOM;
    things[4].4 = [22, 60, 170];
    data.draw(0, &things);
    assert_eq!(closest(&data.ask(out.path(), &[])), "chair");
}

#[test]
fn no_depth_questions_without_depth() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    data.change(|line| {
        line.as_object_mut().unwrap().retain(|key, _| !key.starts_with("depth"));
    });
    let outcome = data.ask(out.path(), &["--balance", "none"]);
    assert_eq!(outcome.of("closest").len(), 0);
    assert_eq!(outcome.of("room_type").len(), 1);
}

#[test]
fn labels_limit_presence_denials() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    let denied = |flags: &[&str]| -> Vec<String> {
        let candidates = out.path().join("c.jsonl");
        let mut all = vec!["--candidates", candidates.to_str().unwrap()];
        all.extend(flags);
        assert_eq!(data.ask(out.path(), &all).code, 0);
        let text = fs::read_to_string(&candidates).unwrap();
        text.lines()
            .map(|line| serde_json::from_str::<Value>(line).unwrap())
            .filter(|line| line["family"] == "presence" && line["answer"] == "no" && line["reason"].is_null())
            .map(|line| line["about"].as_str().unwrap().to_owned())
            .collect()
    };
    let of_nyu40 = denied(&[]);
    assert!(of_nyu40.contains(&"toilet".to_owned()), "{of_nyu40:?}");
    // NYU40 puts plants and stools under catch-alls.
    check_rows(["plant", "stool"], |hidden| {
        assert!(!of_nyu40.contains(&hidden.to_owned()), "{of_nyu40:?}");
    });
    let own = [(1, "wall"), (2, "floor"), (4, "bed"), (11, "picture"), (17, "chest_of_drawers"), (18, "cushion")];
    data.label("own", own.map(|(id, name)| (id, name.to_owned(), name.to_owned())).into_iter());
    assert_eq!(denied(&[]), Vec::<String>::new());
}

#[test]
fn verdicts_leave_out_what_was_rejected() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    let page = out.path().join("review.html");
    let page = page.to_str().unwrap();
    let before = data.ask(out.path(), &["--balance", "none", "--review", page]);
    let color = before.of("color")[0]["id"].as_str().unwrap().to_owned();
    let html = fs::read_to_string(page).unwrap();
    assert!(html.contains(&color) && html.contains("rgb0.png"));
    // The rule's answer stands in no element of the page, but only where its script finds it once the person has
    // answered.
    let (head, script) = html.split_once("<script>").unwrap();
    assert!(!head.contains(&color) && script.contains("if (!own) return;"));
    let verdicts = out.path().join("verdicts.jsonl");
    fs::write(&verdicts, json!({"id": color, "verdict": "reject"}).to_string()).unwrap();
    let flags = ["--balance", "none", "--verdicts", verdicts.to_str().unwrap()];
    let after = data.ask(out.path(), &flags);
    let ids = |outcome: &Outcome| -> Vec<String> {
        let mut ids: Vec<String> = outcome.lines().iter().map(|line| line["id"].to_string()).collect();
        ids.sort();
        ids
    };
    assert!(!ids(&after).contains(&format!("{color:?}")));
    // The rest stands, and another colour may have come in its place.
    for id in ids(&before) {
        assert!(ids(&after).contains(&id) || id == format!("{color:?}"), "{id}");
    }
}

#[test]
fn two_people_check_on_their_own() {
    let views: Vec<View> = ["a", "b", "c"].map(bedroom).into();
    let (data, out) = (Data::of(&views), folder());
    let asked = data.ask(out.path(), &["--balance", "none"]).lines();
    let checked = |person: &str, ambiguous: usize| {
        let lines = asked.iter().enumerate().map(|(i, question)| {
            let (found, verdict) = match i {
                0 => ("wrong", "reject"),
                i if i == ambiguous => ("ambiguous", "reject"),
                _ => ("right", "accept"),
            };
            let line = json!({
                "id": question["id"], "person": person, "found": found, "verdict": verdict,
                "family": question["family"], "frame": question["frame"],
            });
            format!("{line}\n")
        });
        let path = out.path().join(format!("verdicts-{person}.jsonl"));
        fs::write(&path, lines.collect::<String>()).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (anna, ben) = (checked("anna", 1), checked("ben", 2));
    let after = data.ask(out.path(), &["--balance", "none", "--verdicts", &anna, "--verdicts", &ben]);
    assert_eq!(after.lines().len(), asked.len() - 3);
    let all = asked.len();
    let same = format!("{:.1}", 100.0 * (all - 2) as f64 / all as f64);
    let said = format!("anna and ben found the same of {same} [");
    assert!(after.out.contains(&said), "{}", after.out);
    assert!(after.out.contains("Cohen's κ of finding a question right: 0."), "{}", after.out);
    // A file of one person has shares, but no κ.
    let alone = data.ask(out.path(), &["--balance", "none", "--verdicts", &anna]);
    assert!(alone.out.contains("anna") && !alone.out.contains("κ"), "{}", alone.out);
    let json = data.ask(out.path(), &["--json", "--verdicts", &anna, "--verdicts", &ben]);
    let json: Value = serde_json::from_str(&json.out).unwrap();
    assert_eq!(json["checks"]["agreements"][0]["people"], json!(["anna", "ben"]));
    assert_eq!(json["checks"]["agreements"][0]["questions"], all);
}

/// The page is written into the folder of the command, into a new folder and beside the data: its links lead to the
/// images.
#[test]
fn page_finds_images_from_anywhere() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    let root = out.path().join("root");
    fs::create_dir_all(&root).unwrap();
    let beside = data.path("review.html");
    check_rows(["review.html", "new/deep/review.html", beside.to_str().unwrap()], |page| {
        called(Command::new(PROGRAM).current_dir(&root).arg("questions").arg(data.0.path()).args([
            "--out",
            "elsewhere/q.jsonl",
            "--review",
            page,
        ]))
        .ended(0);
        let page = root.join(page);
        let html = fs::read_to_string(&page).unwrap();
        let (_, link) = html.split_once("\"image\":\"").unwrap();
        let (link, _) = link.split_once('"').unwrap();
        let image = page.parent().unwrap().join(link);
        assert!(image.is_file(), "{link} of {}", page.display());
    });
}

#[test]
fn rule_file_is_recorded_per_question() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    let digest = |outcome: &Outcome, of: &str| outcome.lines()[0]["evidence"]["rules"][of].clone();
    let first = data.ask(out.path(), &[]);
    let rules = out.path().join("rules.toml");
    let built_in = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/src/questions/rules.toml")).unwrap();
    fs::write(&rules, built_in.replace("crushed = 3 ", "crushed = 4 ")).unwrap();
    let outcome = data.ask(out.path(), &["--rules", rules.to_str().unwrap()]);
    assert_ne!(digest(&outcome, "digest"), digest(&first, "digest"));
    assert_eq!(digest(&outcome, "colors"), digest(&first, "colors"));
    fs::write(&rules, "[measure\n").unwrap();
    data.ask(out.path(), &["--rules", rules.to_str().unwrap()]).refused(&["rules.toml", "line 1"]);
    let colors = out.path().join("colors.txt");
    fs::write(&colors, "x\n".repeat(1024)).unwrap();
    data.ask(out.path(), &["--colors", colors.to_str().unwrap()]).refused(&["colors.txt", "row 1"]);
}

#[test]
fn statistics_are_written_in_every_form() {
    let (data, out) = (Data::of(&[bedroom("a"), bedroom("b")]), folder());
    let stats = out.path().join("stats");
    let outcome = data.ask(out.path(), &["--stats", stats.to_str().unwrap(), "--json"]);
    let json: Value = serde_json::from_str(&outcome.out).unwrap();
    assert_eq!(json, serde_json::from_slice::<Value>(&fs::read(stats.join("statistics.json")).unwrap()).unwrap());
    let csv = fs::read_to_string(stats.join("statistics.csv")).unwrap();
    assert!(csv.lines().any(|line| line.contains("bed")), "{csv}");
    let figure = fs::read_to_string(stats.join("statistics.svg")).unwrap();
    assert!(figure.starts_with("<svg") && figure.trim_end().ends_with("</svg>"));
}

#[test]
fn sets_are_compared_by_appearance() {
    let (data, out, other) = (Data::of(&[bedroom("a")]), folder(), folder());
    let to_other = ["--against", other.path().to_str().unwrap()];
    let with_json = [to_other[0], to_other[1], "--json"];
    data.ask(out.path(), &to_other).refused(&["neither a frames.jsonl nor any PNG"]);
    // A folder of plain pictures: half of white, without any edge.
    let grey = RgbImage::from_pixel(SIZE.0, SIZE.1, Rgb([188; 3]));
    grey.save(other.path().join("grey.png")).unwrap();
    let json: Value = serde_json::from_str(&data.ask(out.path(), &with_json).out).unwrap();
    let rows = &json["against"]["rows"];
    let [light, edges, segments] = [0, 1, 2].map(|row: usize| rows[row]["quartiles"].clone());
    assert!((light[1][1].as_f64().unwrap() + 1.0).abs() < 0.01, "{light}");
    assert_eq!(edges[1], json!([0.0, 0.0, 0.0]));
    assert!(edges[0][1].as_f64().unwrap() > 1.0, "{edges}");
    // Seven things with maps, and no maps.
    assert_eq!(segments, json!([[7.0, 7.0, 7.0], null]));
    // A set is within itself, and what is asked is the same with the comparison as without it.
    let own = ["--against", data.0.path().to_str().unwrap()];
    let (alone, compared) = (data.ask(out.path(), &[]), data.ask(out.path(), &own));
    assert!(compared.out.contains("within") && !compared.out.contains("above"), "{}", compared.out);
    assert!(!alone.out.contains("within"), "{}", alone.out);
    assert_eq!(alone.questions, compared.questions);
}

#[test]
fn questions_are_evaluated_as_they_are() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    let outcome = data.ask(out.path(), &["--balance", "none"]);
    data.write("questions.jsonl", &outcome.questions);
    let run = out.path().join("run");
    called(
        Command::new(PROGRAM)
            .args(["--model", "random", "--levels", "L0,L5", "--data"])
            .arg(data.0.path())
            .arg("--out")
            .arg(&run),
    )
    .ended(0);
    let records = walk(&run, "records.jsonl");
    let asked = outcome.lines().len();
    // At L0, and at L5 in both variants.
    assert_eq!(records.lines().count(), 3 * asked, "{records}");
}

/// The content of all files of this name below a folder.
fn walk(folder: &Path, name: &str) -> String {
    let mut text = String::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &walk(&path, name);
        } else if path.file_name().is_some_and(|own| own == name) {
            text += &fs::read_to_string(path).unwrap();
        }
    }
    text
}

#[test]
fn unknown_numbers_are_counted_or_refused() {
    let mut things = BEDROOM;
    things[5].0 = 77;
    let view = View { scene: "s", things: things.to_vec() };
    let (data, out) = (Data::of(&[view]), folder());
    let outcome = data.ask(out.path(), &["--json"]);
    assert_eq!(outcome.code, 0, "{}", outcome.err);
    assert!(outcome.out.contains("77"), "{}", outcome.out);
    data.ask(out.path(), &["--strict"]).refused(&["frame \"s/0\"", "77", "classes.json"]);
}

#[test]
fn classes_can_be_places_in_palette() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    let grey = data.ask(out.path(), &[]);
    let deep = image::open(data.path("sem0.png")).unwrap().into_luma16();
    let places: Vec<u8> = deep.pixels().map(|pixel| pixel.0[0] as u8).collect();
    let file = fs::File::create(data.path("sem0.png")).unwrap();
    let mut encoder = png::Encoder::new(file, SIZE.0, SIZE.1);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette((0..=255_u8).flat_map(|i| [i ^ 0x55, i, 255 - i]).collect::<Vec<_>>());
    encoder.write_header().unwrap().write_image_data(&places).unwrap();
    assert_eq!(data.ask(out.path(), &[]).questions, grey.questions);
}

#[test]
fn segments_of_8_bits_are_refused() {
    let (data, out) = (Data::of(&[bedroom("s")]), folder());
    GrayImage::new(SIZE.0, SIZE.1).save(data.path("over0.png")).unwrap();
    data.ask(out.path(), &[]).refused(&["over0.png", "a grey PNG of 8 bits", "16-bit grey"]);
}

#[test]
fn maps_of_another_size_are_refused() {
    check_rows(["sem", "over", "depth"], |map| {
        let (data, out) = (Data::of(&[bedroom("s")]), folder());
        let small = ImageBuffer::<Luma<u16>, Vec<u16>>::new(SIZE.0 / 2, SIZE.1);
        small.save(data.path(&format!("{map}0.png"))).unwrap();
        let words = [&format!("{map}0.png")[..], "240 × 160", "240 × 320"];
        data.ask(out.path(), &[]).refused(&words);
    });
}

#[test]
fn broken_frame_does_not_stop_others() {
    let (data, out) = (Data::of(&[bedroom("a"), bedroom("b")]), folder());
    let bytes = fs::read(data.path("rgb1.png")).unwrap();
    fs::write(data.path("rgb1.png"), &bytes[..bytes.len() / 2]).unwrap();
    let outcome = data.ask(out.path(), &[]);
    assert_eq!(outcome.code, 1, "{}", outcome.err);
    insta::assert_snapshot!(redacted(&outcome.err), @"
    ERROR [TMP]/rgb1.png: not a whole image: the file ends before its end mark, at byte 958; copy or export it
        again
    ");
    assert!(outcome.questions.contains("a/0") && !outcome.questions.contains("b/1"));
}

#[test]
fn thousandfold_depth_scale_is_refused() {
    let rows = [(1.0, "deeper than any room"), (1e-6, "depth_scale")];
    check_rows(rows, |(scale, part)| {
        let (data, out) = (Data::of(&[bedroom("s")]), folder());
        data.change(|line| line["depth_scale"] = scale.into());
        let outcome = data.ask(out.path(), &[]);
        let message = format!("{}{}", outcome.out, outcome.err);
        assert!(message.contains(part), "{scale}: {message}");
        assert!(!outcome.questions.contains("closest"));
    });
}

#[test]
fn broken_lines_are_named() {
    let (data, out) = (Data::of(&[bedroom("a"), bedroom("b")]), folder());
    let text = fs::read_to_string(data.path("frames.jsonl")).unwrap();
    data.write("frames.jsonl", &text.replace("\"rgb\":\"rgb1.png\"", "\"rgb\":"));
    data.ask(out.path(), &[]).refused(&["frames.jsonl, line 2"]);
    data.write("frames.jsonl", &text.replace("rgb1.png", "missing.png"));
    let outcome = data.ask(out.path(), &[]);
    assert!(outcome.code != 0 && outcome.err.contains("missing.png"), "{}", outcome.err);
    data.write("frames.jsonl", &text.replace("\"frame\":\"1\"", "\"frame\":\"0\"").replace("\"b\"", "\"a\""));
    data.ask(out.path(), &[]).refused(&["frames.jsonl, line 2", "a/0"]);
    data.write("frames.jsonl", "");
    assert_eq!(data.ask(out.path(), &[]).code, 2);
}

#[test]
fn a_folder_without_classes_is_refused() {
    let (data, out) = (Data::of(&[bedroom("a")]), folder());
    fs::remove_file(data.path("classes.json")).unwrap();
    data.ask(out.path(), &[]).refused(&["classes.json", "darkqa-eval import"]);
    data.write("classes.json", r#"{"schema":"darkqa.classes/2","space":"nyu40","classes":[]}"#);
    data.ask(out.path(), &[]).refused(&["classes.json", "darkqa.classes/1"]);
}
