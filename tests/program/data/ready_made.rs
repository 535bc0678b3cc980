//! Ready-made sets, `check` and `init` from the command line.

use std::fs;

use serde_json::{Value, json};

use crate::support::run::{Bench, words};
use crate::support::snapshot::{each, lines_with, redacted};

/// A folder with `set.json`: two questions whose answers are numbers from 0 or from 1, and one that is open.
fn bench() -> Bench {
    let bench = Bench::new();
    for (name, shade) in [("a.png", 40), ("b.png", 90)] {
        let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([shade, 60, 30]));
        picture.save(bench.path(name)).unwrap();
    }
    let rows = json!([
        {"id": 1, "image": "a.png", "question": "Which?", "options": ["x", "y", "z"], "answer": 1},
        {"id": 2, "image": "b.png", "question": "Which?", "options": ["x", "y", "z"], "answer": 1},
        {"id": 3, "image": "b.png", "question": "How many?", "answer": 7},
    ]);
    bench.file("set.json", rows.to_string());
    bench
}

#[test]
fn ambiguous_answers_need_a_mapping() {
    let bench = bench();
    let run = |line: &str| bench.call(&words(&format!("--data set.json --model random --levels L0 {line}")));
    let called = run("");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: set.json: object 1: the answer "1" may be read as index0 or as index1, which differ among the options
        ["x", "y", "z"]; --map answer=answer:index0 or --map answer=answer:index1 says which is meant
    "#);
    let called = run("--map answer=answer:index1");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: set.json: no options in 1 of 3 rows, where the answer is e.g. "7"; --skip open leaves it out
    "#);
    let called = run("--map answer=answer:index1 --open skip --out run");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
    set: 2 questions on 2 images in 1 family (no column of families)
    question = question, image = image (files 2), options = options, answer = answer (index1), id = id
    left out: 1 of 3 rows (no options)
    ");
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    let reading = manifest["settings"]["reading of the data"].to_string();
    assert!(
        reading.contains("set: 2 questions on 2 images") && reading.contains("answer = answer (index1)"),
        "{reading}"
    );
    let records = fs::read_to_string(bench.path("run/records.jsonl")).unwrap();
    assert!(records.lines().all(|line| line.contains("\"truth\":0")), "{records}");
    // The other reading makes other truths of the same questions: nothing is mixed.
    let called = run("--map answer=answer:index0 --open skip --out run");
    assert_eq!(called.code, Some(2), "{called:?}");
    // Images are made again from the flags in the manifest.
    let called = bench.call(&words("show run 1 --condition L0"));
    assert_eq!(called.code, Some(0), "{called:?}");
}

#[test]
fn outside_paths_need_data_root() {
    let bench = bench();
    fs::create_dir(bench.path("set")).unwrap();
    let line = json!({"id": 1, "image": "../a.png", "question": "?", "choices": ["x", "y"], "answer": "x"});
    bench.file("set/set.jsonl", line.to_string());
    let called = bench.call(&words("--data set/set.jsonl --model random --levels L0"));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: set/set.jsonl, line 1: "../a.png" lies outside set/, the folder of the data; --data-root [TMP] allows
        the folder that it names; --skip bad leaves such rows out
    "#);
    bench.complete(&words("--data set/set.jsonl --model random --levels L0 --data-root ."));
    let frames = json!({"scene": "s", "frame": "0", "rgb": "../a.png"});
    bench.file("frames/frames.jsonl", frames.to_string());
    let question = json!({"id": 1, "frame": "s/0", "question": "?", "choices": ["x", "y"], "answer": "x"});
    bench.file("frames/questions.jsonl", question.to_string());
    let called = bench.call(&words("--data frames --model random --levels L0"));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: frames/frames.jsonl, line 1: "../a.png" lies outside frames/, the folder of the data; --data-root [TMP]
        allows the folder that it names
    "#);
    bench.complete(&words("--data frames --model random --levels L0 --data-root ."));
    let line = "synthesize frames --out dark --levels L5 --variant ev";
    let called = bench.call(&words(line));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: frames/frames.jsonl, line 1: "../a.png" lies outside frames/, the folder of the data; --data-root [TMP]
        allows the folder that it names
    "#);
    bench.complete(&words(&format!("{line} --data-root .")));
}

#[cfg(unix)]
#[test]
fn outside_links_are_named_and_skipped() {
    let bench = bench();
    fs::create_dir(bench.path("images")).unwrap();
    fs::copy(bench.path("a.png"), bench.path("images/own.png")).unwrap();
    std::os::unix::fs::symlink(bench.path("b.png"), bench.path("images/b.png")).unwrap();
    let line = "synthesize images --out dark --levels L5 --variant ev";
    let called = bench.call(&words(line));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN images: 1 link leads out of the folder and is not followed: b.png; --data-root [TMP] allows the folder
        that it leads to
    ");
    assert!(bench.path("dark/own_L5-ev.png").exists() && !bench.path("dark/b_L5-ev.png").exists());
    let called = bench.call(&words(&format!("{line} --data-root .")));
    assert_eq!((called.code, called.stderr.contains("link")), (Some(0), false), "{called:?}");
    assert!(bench.path("dark/b_L5-ev.png").exists());
}

/// Each kind of file that a data set may replace by a link, in a folder of its own, and the call that reads it.
#[cfg(unix)]
#[test]
fn links_out_of_data_are_not_read() {
    use std::os::unix::fs::symlink;

    let bench = bench();
    fs::create_dir(bench.path("private")).unwrap();
    let make = |path: &str| {
        let path = bench.path(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    };
    let secret = make("private/secret.png");
    image::RgbImage::new(9, 7).save(&secret).unwrap();
    let question = |image: &str, key: &str| {
        json!({"id": 1, key: image, "question": "?", "choices": ["x", "y"], "answer": "x"}).to_string()
    };
    let frame = json!({"scene": "s", "frame": "0", "rgb": "a.png"}).to_string();
    bench.file("private/questions.jsonl", question("a.png", "image"));
    bench.file("private/frames.jsonl", &frame);
    bench.file("private/classes.json", r#"{"space":"mpcat40"}"#);
    let link = |target: &str, path: &str| symlink(bench.path(target), make(path)).unwrap();
    for class in ["pictures/cat/0.png", "pictures/dog/0.png", "folders/cat/0.png", "folders/dog/0.png"] {
        fs::copy(bench.path("a.png"), make(class)).unwrap();
    }
    link("private/secret.png", "pictures/dog/1.png");
    link("private", "folders/bird");
    for set in ["questions", "frames", "maps"] {
        fs::copy(bench.path("a.png"), make(&format!("{set}/a.png"))).unwrap();
    }
    link("private/questions.jsonl", "questions/questions.jsonl");
    link("private/frames.jsonl", "frames/frames.jsonl");
    bench.file("frames/questions.jsonl", question("s/0", "frame"));
    link("private/classes.json", "maps/classes.json");
    bench.file("maps/frames.jsonl", &frame);
    link("private", "hub/datasets--x--y/blobs");
    let picture = make("hub/datasets--x--y/snapshots/1/a.png");
    symlink("../../blobs/secret.png", picture).unwrap();
    bench.file("hub/datasets--x--y/snapshots/1/questions.jsonl", question("a.png", "image"));
    bench.file("hub/datasets--x--y/refs/main", "1");
    link("private/questions.jsonl", "pattern/part-1.jsonl");
    let calls = each(
        [
            "--data pictures --label-folders ?",
            "--data folders --label-folders ?",
            "--data questions",
            "--data frames",
            "--data maps",
            "--data hub/datasets--x--y",
            "--data pattern/*.jsonl",
        ],
        |data| {
            let line = format!("{data} --model random --levels L0 --out run");
            let called = bench.call(&words(&line));
            let records = fs::read_to_string(bench.path("run/records.jsonl")).unwrap_or_default();
            assert!(!records.contains(r#""width":9,"height":7"#), "{data}");
            let _ = fs::remove_dir_all(bench.path("run"));
            called.messages()
        },
    );
    insta::assert_snapshot!(calls, @r#"
    --data pictures --label-folders ?
      exit code: 0
       WARN pictures: 1 link leads out of the folder and is not followed: dog/1.png; --data-root [TMP]/private
          allows the folder that it leads to
       WARN a photograph may show things of several of the 2 classes, and the folder names one of them: that name is
          the true choice; with boxes or tags, make questions instead
    --data folders --label-folders ?
      exit code: 0
       WARN folders: 1 link leads out of the folder and is not followed: bird; --data-root [TMP]/private allows the
          folder that it leads to
       WARN a photograph may show things of several of the 2 classes, and the folder names one of them: that name is
          the true choice; with boxes or tags, make questions instead
    --data questions
      exit code: 2
      error: questions/questions.jsonl: leads out of questions, the folder of the data; --data-root [TMP]/private
          allows the folder that it leads to
    --data frames
      exit code: 2
      error: frames/frames.jsonl: leads out of frames, the folder of the data; --data-root [TMP]/private allows the
          folder that it leads to
    --data maps
      exit code: 2
      error: maps/classes.json: leads out of maps, the folder of the data; --data-root [TMP]/private allows the
          folder that it leads to
    --data hub/datasets--x--y
      exit code: 2
      error: hub/datasets--x--y/snapshots/1/questions.jsonl, line 1: "a.png" lies outside 1/, the folder of the
          data; --data-root [TMP]/private allows the folder that it names; --skip bad leaves such rows out
    --data pattern/*.jsonl
      exit code: 2
       WARN pattern: 1 link leads out of the folder and is not followed: part-1.jsonl; --data-root [TMP]/private
          allows the folder that it leads to
      error: --data: pattern/*.jsonl: no file has such a name
    "#);
    // The flag in the messages allows them.
    for data in ["--data questions", "--data frames", "--data pictures --label-folders ?"] {
        let line = format!("{data} --model random --levels L0 --out run --data-root private");
        bench.complete(&words(&line));
        fs::remove_dir_all(bench.path("run")).unwrap();
    }
}

#[test]
fn check_names_everything_that_is_wrong() {
    let bench = bench();
    let line = "check --data set.json --map answer=answer:index1 --open skip";
    let called = bench.call(&words(line));
    insta::assert_snapshot!(called.lines_with("ok: "), @"
    exit code: 0
    ok: 2 questions, 3 warnings
    ");
    let called = bench.call(&words(&format!("{line} --model gpt-4o --llie none.onnx --prompts nowhere")));
    insta::assert_snapshot!(called.lines_with("problem"), @"
    exit code: 1
    problem  --prompts: no folder nowhere, and the built-in prompts are paper, terse, letter
    problem  OPENAI_API_KEY: no key for https://api.openai.com/v1: set this variable, or name another with
        --api-key-env NAME or a file with --api-key-file FILE; name your own server with --base-url URL;
        --api-key-env none sends no key
    problem  --llie: none.onnx: no such file
    warning  what a run would take is not estimated, as long as there are problems
    3 problems, 3 warnings
    ");
    assert!(called.stdout.ends_with(" warnings\n") && called.stdout.contains("3 problems"), "{}", called.stdout);
    let cut = fs::read(bench.path("a.png")).unwrap();
    fs::write(bench.path("a.png"), &cut[..cut.len() - 20]).unwrap();
    let called = bench.call(&words(&format!("{line} --deep")));
    insta::assert_snapshot!(called.lines_with("problem"), @"
    exit code: 1
    problem  a.png: not a whole image: the file ends before its end mark, at byte 257; copy or export it again
    1 problem, 4 warnings
    ");
    insta::assert_snapshot!(called.lines_with("×"), @"
    exit code: 1
    ok       1 image, 0 kB, 1 of 64×48
    ");
    fs::remove_file(bench.path("a.png")).unwrap();
    let called = bench.call(&words(&format!("{line} --json")));
    let report: Value = serde_json::from_str(&called.stdout).unwrap();
    assert_eq!((called.code, &report["problems"]), (Some(1), &json!(1)), "{report}");
}

#[test]
fn template_checks_and_runs_unchanged() {
    let bench = Bench::new();
    let made = bench.complete(&words("init my-data"));
    for line in made.lines().filter(|line| line.starts_with("  darkqa-eval ")) {
        assert!(line.contains("my-data"), "{made}");
    }
    let table = fs::read_to_string(bench.path("my-data/questions.csv")).unwrap();
    assert_eq!(table.lines().count(), 7, "{table}");
    let checked = bench.complete(&words("check my-data"));
    insta::assert_snapshot!(redacted(&checked), @"
    ok       my-data: 6 questions on 3 images in 3 families (column category)
    ok       question = question, image = image (files 3), options = A B C D, answer = answer (letter), id =
        content
    ok       6 questions, 5 with 2 choices, 1 with 3 choices; chance 47.2 %
    ok       families: presence 3, affordance 2, closest 1
    ok       power: 6 questions in 3 frames detects no difference between two conditions; 5 points need about 453
        frames (one model; level 2.50 % after correction; assumed: 20 % of answers change without an effect,
        correlation 0.05 in a frame)
    ok       3 images, 556 kB, 3 of 480×360
    ok       median brightness 127 of 255 (3 images)
    warning  no model is named: --model NAME adds it to the check, and what a run would take
    ok: 6 questions, 1 warning
    ");
    bench.complete(&words("--data my-data --model random --levels L0,L3"));
    let again = bench.call(&words("init my-data"));
    insta::assert_snapshot!(again.messages(), @"
    exit code: 2
    error: my-data/README.txt: exists already; init overwrites nothing: name another folder
    ");
    bench.file("pictures/room2.png", "mine");
    let third = bench.call(&words("init pictures"));
    insta::assert_snapshot!(third.messages(), @"
    exit code: 2
    error: pictures/room2.png: exists already; init overwrites nothing: name another folder
    ");
    let own = bench.call(&words("init own --frames my-data"));
    assert_eq!(own.code, Some(0), "{own:?}");
    let table = fs::read_to_string(bench.path("own/questions.csv")).unwrap();
    let lines = table.lines().skip(1);
    assert_eq!(lines.filter(|line| line.starts_with("room")).count(), 6);
    // A folder of images gets the questions beside them.
    fs::create_dir(bench.path("mine")).unwrap();
    fs::copy(bench.path("my-data/room1.png"), bench.path("mine/room1.png")).unwrap();
    let beside = bench.complete(&words("init mine --frames mine"));
    insta::assert_snapshot!(redacted(&beside), @"
    mine: 2 questions

    next:
      darkqa-eval check mine
      darkqa-eval --data mine --model gpt-4o --dry-run
      darkqa-eval --data mine --model gpt-4o
    ");
    let check = own.stdout.lines().find(|line| line.contains(" check ")).unwrap();
    let command: Vec<&str> = check.split_whitespace().skip(1).collect();
    let checked = bench.complete(&command);
    insta::assert_snapshot!(redacted(&checked), @"
    ok       own: 6 questions on 3 images in 1 family (column category)
    ok       question = question, image = image (files 3), options = A B C D, answer = answer (letter), id =
        content
    ok       6 questions, 6 with 2 choices; chance 50.0 %
    ok       families: form 6
    ok       power: 6 questions in 3 frames detects no difference between two conditions; 5 points need about 453
        frames (one model; level 2.50 % after correction; assumed: 20 % of answers change without an effect,
        correlation 0.05 in a frame)
    ok       3 images, 556 kB, 3 of 480×360
    ok       median brightness 127 of 255 (3 images)
    warning  no model is named: --model NAME adds it to the check, and what a run would take
    ok: 6 questions, 1 warning
    ");
    assert!(!checked.contains("always the"), "{checked}");
}

#[test]
fn unread_table_is_named() {
    let bench = Bench::new();
    bench.complete(&words("init my-data"));
    fs::create_dir(bench.path("empty")).unwrap();
    let empty = bench.call(&words("--data empty --model random"));
    insta::assert_snapshot!(empty.messages(), @"
    exit code: 2
    error: empty: the folder is empty: no questions.jsonl or questions.csv in this folder, and no frames.jsonl
        with classes.json to make questions of; --questions FILE names some, and --ask home asks about photographs
        without any
    ");
    let line = json!({"id": "a", "frame": "room1.png", "question": "A?", "choices": ["yes", "no"], "answer": "no", "family": "f"});
    bench.file("my-data/questions.jsonl", format!("{line}\n"));
    let both = bench.call(&words("--data my-data --model random --levels L0 --out run"));
    insta::assert_snapshot!(both.messages(), @"
    exit code: 0
     WARN my-data/questions.csv is not read, because questions.jsonl is in the same folder; --data
        my-data/questions.csv reads it alone
    ");
}

#[test]
fn nested_images_need_question_file() {
    let bench = Bench::new();
    bench.complete(&words("init flat"));
    fs::create_dir_all(bench.path("data/images")).unwrap();
    fs::copy(bench.path("flat/room1.png"), bench.path("data/images/room1.png")).unwrap();
    let line =
        json!({"id": "a", "frame": "images/room1.png", "question": "A?", "choices": ["yes", "no"], "answer": "no"});
    bench.file("data/questions.jsonl", format!("{line}\n"));
    let folder = bench.call(&words("check data"));
    insta::assert_snapshot!(folder, @"
    exit code: 1
    stdout:
    problem  data: neither a frames.jsonl nor any PNG, JPEG, WebP, TIFF, BMP or OpenEXR image in this folder; name
        data/questions.jsonl if its lines have paths such as images/IMAGE
    warning  no model is named: --model NAME adds it to the check, and what a run would take
    1 problem, 1 warning
    stderr:
     WARN --data: no effect: the data are named without it
    ");
    let named = bench.complete(&words("check data/questions.jsonl"));
    insta::assert_snapshot!(lines_with(&named, "1 question"), @"
    ok       questions: 1 question on 1 image in 1 family (no column of families)
    ok       1 question, 1 with 2 choices; chance 50.0 %
    ok       power: 1 question detects no difference between two conditions; 5 points need about 856 questions
        (one model; level 2.50 % after correction; assumed: 20 % of answers change without an effect, correlation
        0.05 in a question)
    ok: 1 question, 3 warnings
    ");
}

#[test]
fn repeated_ids_of_own_format_are_named() {
    let bench = Bench::new();
    bench.complete(&words("init data"));
    fs::remove_file(bench.path("data/questions.csv")).unwrap();
    let line = |question: &str| json!({"id": "a", "frame": "room1.png", "question": question, "choices": ["yes", "no"], "answer": "yes"});
    bench.file("data/questions.jsonl", format!("{}\n{}\n", line("A?"), line("B?")));
    let called = bench.call(&words("--data data --model random"));
    insta::assert_snapshot!(lines_with(&called.stderr, "id"), @"WARN data/questions.jsonl: some questions have no id or the same, so all get an id from their content");
}

#[test]
fn answer_outside_options_is_refused() {
    let bench = Bench::new();
    bench.complete(&words("init data"));
    fs::remove_file(bench.path("data/questions.csv")).unwrap();
    let line = |id: &str, answer: &str| json!({"id": id, "frame": "room1.png", "question": "A?", "choices": ["yes", "no"], "answer": answer});
    bench.file("data/questions.jsonl", format!("{}\n{}\n", line("a", "yes"), line("b", "A")));
    let refused = bench.call(&words("--data data --model random"));
    insta::assert_snapshot!(refused.messages(), @r#"
    exit code: 2
    error: data/questions.jsonl: 1 of 2 rows are broken; the first: line 2: the answer "A" is not one of the
        options ["yes", "no"] (read as text, which fits 1 row); --skip bad=50% leaves it out
    "#);
}

/// Eight yes-or-no questions, two about each of four images; the last two pairs have one "no" each.
fn pairs() -> Bench {
    let bench = Bench::new();
    let mut rows = Vec::new();
    for number in 0..8 {
        let name = format!("{}.png", number / 2);
        let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([20 * (number as u8 / 2), 60, 30]));
        picture.save(bench.path(&name)).unwrap();
        let answer = if [5, 7].contains(&number) { "no" } else { "yes" };
        rows.push(json!({"id": number, "image": name, "pair": number / 2, "question": format!("Is it {number}?"), "answer": answer}));
    }
    bench.file("set.json", json!(rows).to_string());
    bench
}

/// The fields of the first line of a CSV file whose first fields are these.
fn line_of(table: &str, starts: &str) -> Vec<String> {
    let line = table.lines().find(|line| line.starts_with(starts));
    let line = line.unwrap_or_else(|| panic!("no line {starts}: {table}"));
    line.split(',').map(str::to_owned).collect()
}

#[test]
fn grouped_set_has_strict_score() {
    let bench = pairs();
    let line = "--data set.json --model random --blind-model random --levels L0,L3";
    bench.complete(&words(&format!("{line} --out plain")));
    // Without groups there is no such table, and nothing is stored.
    assert!(!bench.path("plain/groups.csv").exists());
    let read = |name: &str| fs::read_to_string(bench.path(name)).unwrap();
    assert!(!read("plain/questions.jsonl").contains("group"));
    assert!(!read("plain/report.html").contains("Whole groups right"));
    let printed = bench.complete(&words(&format!("{line} --out run --map group=pair --full")));
    insta::assert_snapshot!(lines_with(&printed, "of a group"), @"
    All questions of a group right, in % of the complete groups, with 95 % intervals; accuracy of the same subject
        beside it
    ");
    // The same trials, the same replies.
    assert_eq!(read("plain/records.jsonl").lines().count(), read("run/records.jsonl").lines().count());
    let keys = |name: &str| {
        let records = read(name);
        let mut keys: Vec<String> =
            records.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["key"].to_string()).collect();
        keys.sort();
        keys
    };
    assert_eq!(keys("plain/records.jsonl"), keys("run/records.jsonl"));
    let question: Value = serde_json::from_str(read("run/questions.jsonl").lines().next().unwrap()).unwrap();
    assert_eq!((&question["group"], &question["group_size"]), (&json!("0"), &json!(2)));
    // The table is what the records say.
    let table = read("run/groups.csv");
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let at = |name: &str| head.iter().position(|head| *head == name).unwrap();
    for (condition, starts) in [("L0", "L0,none,"), ("L3-ev", "L3,ev,"), ("L3-noise", "L3,noise,")] {
        let mut right = [true; 4];
        for line in read("run/records.jsonl").lines() {
            let record: Value = serde_json::from_str(line).unwrap();
            if record["condition"] == condition {
                let number: usize = record["question"].as_str().unwrap().parse().unwrap();
                right[number / 2] &= record["outcome"] == "right";
            }
        }
        let row = line_of(&table, &format!("random,image,{starts}"));
        let expected = right.iter().filter(|right| **right).count();
        assert_eq!(row[at("right")], expected.to_string(), "{table}");
        assert_eq!((&*row[at("n")], &*row[at("incomplete")]), ("4", "0"));
        assert_eq!(row[at("value")], (expected as f64 / 4.0).to_string());
    }
    assert_eq!(line_of(&table, "random,blind,")[at("n")], "4");
    assert_eq!(line_of(&table, "chance,")[at("value")], "0.25");
    // The summary has the same rows.
    let summary = |run: &str| -> Value { serde_json::from_str(&read(&format!("{run}/summary.json"))).unwrap() };
    let groups = &summary("run")["groups"];
    assert_eq!(groups.as_array().unwrap().len(), table.lines().count() - 1);
    for (row, line) in groups.as_array().unwrap().iter().zip(table.lines().skip(1)) {
        for (head, cell) in head.iter().zip(line.split(',')) {
            let same = match &row[head] {
                Value::Null => cell.is_empty(),
                Value::String(text) => text == cell,
                number => number.as_f64() == cell.parse().ok(),
            };
            assert!(same, "{head}: {cell} {row}");
        }
    }
    assert!(summary("plain").get("groups").is_none());
    for name in ["run/report.html", "run/tables.tex"] {
        assert!(read(name).contains("group"), "{name}");
    }
    assert!(read("run/report.html").contains("Whole groups right"));
}

#[test]
fn report_counts_incomplete_groups() {
    let bench = pairs();
    let line = "--data set.json --model random --levels L0 --map group=pair";
    bench.complete(&words(&format!("{line} --limit 5 --out run")));
    let table = fs::read_to_string(bench.path("run/groups.csv")).unwrap();
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let at = |name: &str| head.iter().position(|head| *head == name).unwrap();
    let row = line_of(&table, "random,image,L0,");
    assert_eq!((&*row[at("n")], &*row[at("incomplete")]), ("2", "1"), "{table}");
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("1 group of which questions of the set are left out or not drawn"), "{page}");
    // The run goes on with the rest, without the flag too: stored groups stay.
    bench.complete(&words("--data set.json --model random --levels L0 --limit 5 --out run"));
    let questions = fs::read_to_string(bench.path("run/questions.jsonl")).unwrap();
    assert_eq!(questions.matches("\"group_size\":2").count(), 5, "{questions}");
    bench.complete(&words(&format!("{line} --out run")));
    let table = fs::read_to_string(bench.path("run/groups.csv")).unwrap();
    let row = line_of(&table, "random,image,L0,");
    assert_eq!((&*row[at("n")], &*row[at("incomplete")]), ("4", "0"), "{table}");
    // A question cannot change its group within a run.
    let called = bench.call(&words("--data set.json --model random --levels L0 --map group=image --out run"));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    set: 8 questions on 4 images in 1 family (no column of families)
    question = question, image = image (files 4), answer = answer (yes/no), id = id
    group = image: 4 groups of 2 questions
    error: run: question "0" has another group than in this run; so have 7 more questions; restore --data and
        --questions, or use another --out
    "#);
}

/// Twenty-four questions with an image each; some files are missing or hold other bytes.
fn with_unusable(unusable: &[(usize, Option<Vec<u8>>)]) -> Bench {
    let bench = Bench::new();
    let mut lines = String::new();
    fs::create_dir(bench.path("img")).unwrap();
    for number in 0..24 {
        let name = format!("img/{number}.png");
        let picture = image::RgbImage::from_pixel(32, 24, image::Rgb([number as u8 * 9, 60, 30]));
        picture.save(bench.path(&name)).unwrap();
        let line = json!({"id": number.to_string(), "image": name, "question": "Which?", "choices": ["x", "y"], "answer": "x"});
        lines.push_str(&line.to_string());
        lines.push('\n');
    }
    for (number, bytes) in unusable {
        let path = bench.path(&format!("img/{number}.png"));
        match bytes {
            Some(bytes) => fs::write(path, bytes).unwrap(),
            None => fs::remove_file(path).unwrap(),
        }
    }
    bench.file("set.jsonl", lines);
    bench
}

/// A PNG of transparent pixels, which is not shown.
fn transparent() -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let picture = image::RgbaImage::from_pixel(32, 24, image::Rgba([1, 2, 3, 90]));
    picture.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

#[test]
fn unusable_image_is_skipped_and_counted() {
    for bytes in [
        None,
        Some(Vec::new()),
        Some(b"<html>404</html>".to_vec()),
        Some(b"GIF89a\x01\0\x01\0\0\0\0;".to_vec()),
        Some(transparent()),
    ] {
        let bench = with_unusable(&[(7, bytes)]);
        let run = |line: &str| bench.call(&words(&format!("--data set.jsonl --model random --levels L0 {line}")));
        let called = run("--out run");
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(called.stderr.contains("--skip bad") && called.stderr.contains('7'), "{}", called.stderr);
        let called = run("--out run --bad skip");
        assert_eq!(called.code, Some(0), "{called:?}");
        assert!(called.stderr.contains("left out: 1 of 24"), "{}", called.stderr);
        assert!(called.stderr.contains("7.png"), "{}", called.stderr);
        let records = fs::read_to_string(bench.path("run/records.jsonl")).unwrap();
        assert_eq!(records.lines().count(), 23);
        let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
        assert!(manifest.contains("left out: 1 of 24"), "{manifest}");
    }
}

#[test]
fn unusable_and_missing_share_limit() {
    let bench = with_unusable(&[(3, None), (7, Some(transparent()))]);
    let run = |line: &str| bench.call(&words(&format!("--data set.jsonl --model random --levels L0 {line}")));
    let called = run("--bad skip --out run");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: set: 2 of 24 questions are broken; the first: img/7.png: the image is transparent in places; flatten it
        first; --skip bad leaves out at most 5 %: repair the data, or raise the limit with --skip bad=9%
    ");

    let called = run("--bad skip:9% --out run");
    assert_eq!(called.code, Some(0), "{called:?}");
    let records = fs::read_to_string(bench.path("run/records.jsonl")).unwrap();
    assert_eq!(records.lines().count(), 22);
    let checked = bench.call(&words("check set.jsonl --model random --levels L0 --bad skip:9%"));
    assert_eq!(checked.code, Some(0), "{checked:?}");
}

#[test]
fn question_bank_skips_unusable_photographs() {
    let bench = with_unusable(&[(7, Some(b"no image".to_vec()))]);
    let bank = json!({"id": "a", "question": "Which?", "choices": ["x \n", "y"]});
    bench.file("bank.jsonl", bank.to_string());
    let run =
        |line: &str| bench.call(&words(&format!("--data img --ask bank.jsonl --model random --levels L0,L3 {line}")));
    assert_eq!(run("--out run").code, Some(2));
    let called = run("--out run --bad skip");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
    --ask bank.jsonl: 23 questions about 23 images without answers (1 each); each model is compared with its own
        answers at L0, and is asked without images, too
    left out: 1 of 24 images (unusable images); the first: img/7.png: not an image: PNG, JPEG, WebP, TIFF, BMP or
        OpenEXR expected
    ");
}

#[test]
fn changed_image_stops_continued_run() {
    let bench = with_unusable(&[]);
    let run = || bench.call(&words("--data set.jsonl --model random --levels L0 --out run"));
    assert_eq!(run().code, Some(0));
    for number in [4, 5] {
        fs::copy(bench.path("img/1.png"), bench.path(&format!("img/{number}.png"))).unwrap();
    }
    let called = run();
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: run: the image "img/4.png" of question "4" has changed since the run began; so has 1 more question;
        restore the file or its --data, or use another --out
    "#);
    // Another answer has a message of its own.
    let text = fs::read_to_string(bench.path("set.jsonl")).unwrap();
    let bench = with_unusable(&[]);
    let run = || bench.call(&words("--data set.jsonl --model random --levels L0 --out run"));
    assert_eq!(run().code, Some(0));
    bench.file("set.jsonl", text.replacen("\"answer\":\"x\"", "\"answer\":\"y\"", 1));
    let called = run();
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: run: question "0" has another answer than in this run: "y", before "x"; restore --data and --questions,
        or use another --out
    "#);
}
