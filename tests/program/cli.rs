//! The command line as a contract: its help, and one clear line for each wrong word.

use std::collections::BTreeSet;
use std::fs;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::onnx;
use crate::support::run::{Bench, called, model_args, words};
use crate::support::snapshot::{each, lines_with, redacted};
use crate::support::table::check_rows;
use serde_json::json;

#[test]
fn the_help_is_as_it_was() {
    let bench = Bench::new();
    let help = called(bench.command(&["--help"]).env("COLUMNS", "110"));
    assert_eq!(help.code, Some(0));
    let help = help.stdout.replace("darkqa-eval.exe", "darkqa-eval");
    let long = help.lines().map(str::trim_end).collect::<Vec<_>>().join("\n");
    insta::assert_snapshot!(long);
}

/// A frame with one question; `wrong` changes the question.
fn data(bench: &Bench, wrong: impl FnOnce(&mut serde_json::Value)) {
    let image = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([(x * 30) as u8, (y * 30) as u8, 90]));
    std::fs::create_dir_all(bench.path("frames")).unwrap();
    image.save(bench.path("frames/a.png")).unwrap();
    let mut question =
        json!({"id": "q", "frame": "a.png", "question": "Is it?", "choices": ["yes", "no"], "answer": "no"});
    wrong(&mut question);
    bench.file("frames/questions.jsonl", question.to_string());
}

/// The only line of a call that must end with exit code 2 and leave no run.
fn refused(bench: &Bench, line: &str) -> String {
    let refused = bench.call(&words(line));
    assert_eq!(refused.code, Some(2), "{line:?}: {refused:?}");
    assert_eq!(refused.stderr.trim_end().lines().count(), 1, "{line:?}: {}", refused.stderr);
    assert!(refused.stderr.starts_with("error: "), "{line:?}: {}", refused.stderr);
    assert!(refused.stdout.is_empty());
    assert!(!bench.path("run").exists(), "{line:?} left a run behind");
    redacted(&refused.stderr)
}

#[test]
fn global_flags_work_around_command() {
    let bench = Bench::new();
    bench.complete(&words("--model random --levels L0 --limit 2 --no-parquet --out run"));
    bench.file("flags.toml", "quiet = true\n");
    for flag in ["--quiet", "--color never", "--config flags.toml"] {
        let before = bench.complete(&words(&format!("{flag} report run")));
        let after = bench.complete(&words(&format!("report {flag} run")));
        assert!(!before.is_empty());
        assert_eq!(before, after, "{flag}");
    }
}

#[test]
fn evaluation_flags_before_command_are_refused() {
    let bench = Bench::new();
    insta::assert_snapshot!(
        refused(&bench, "--levels L0 report nowhere"),
        @"error: --levels stands before the command report; put its flags after it"
    );
}

#[test]
fn evaluation_words_show_correct_form() {
    let bench = Bench::new();
    let lines = ["run", "evaluate", "eval"].map(|word| [format!("{word} --model random"), format!("--quiet {word}")]);
    let errors = each(lines.concat(), |line| refused(&bench, line));
    insta::assert_snapshot!(errors, @"
    run --model random
      error: no command run: an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]
    --quiet run
      error: no command run: an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]
    evaluate --model random
      error: no command evaluate: an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]
    --quiet evaluate
      error: no command evaluate: an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]
    eval --model random
      error: no command eval: an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]
    --quiet eval
      error: no command eval: an evaluation has none; leave the word out: darkqa-eval --model NAME [OPTIONS]
    ");
}

#[test]
fn guessed_commands_show_their_name_here_and_it_works() {
    let bench = Bench::new();
    for run in ["one", "two"] {
        bench.complete(&words(&format!("--model random --data rooms:frames=2,size=64x48 --levels L0,L3 --out {run}")));
    }
    let lines = ["compare one two", "summary one", "share one", "one", "one/nowhere"];
    insta::assert_snapshot!(each(lines.map(str::to_owned).to_vec(), |line| refused(&bench, line)), @"
    compare one two
      error: no command compare: to compare runs: darkqa-eval report RUN RUN
    summary one
      error: no command summary: to read a run: darkqa-eval report RUN
    share one
      error: no command share: to share a run: darkqa-eval bundle RUN --out NAME.zip
    one
      error: no command one: it is a run; to read it: darkqa-eval report one
    one/nowhere
      error: unrecognized subcommand 'one/nowhere'
    ");
    // A recording is no data set, whether or not it is named as one.
    bench.file("drive.mcap", "");
    let lines = ["drive.mcap", "import drive.mcap", "import drive.bag --src a --out b", "import clip.mp4"];
    insta::assert_snapshot!(each(lines.map(str::to_owned).to_vec(), |line| refused(&bench, line)), @"
    drive.mcap
      error: no command drive.mcap: to take frames of it: darkqa-eval import mcap drive.mcap
    import drive.mcap
      error: no kind of data set drive.mcap: to take frames of it: darkqa-eval import mcap drive.mcap
    import drive.bag --src a --out b
      error: no kind of data set drive.bag: to take frames of it: darkqa-eval import rosbag drive.bag
    import clip.mp4
      error: no kind of data set clip.mp4: to take frames of it: darkqa-eval import video clip.mp4
    ");
    bench.complete(&words("rooms --out photos --frames 1 --size 64x48"));
    insta::assert_snapshot!(
        refused(&bench, "photos"),
        @"error: no command photos: it is a file or folder; to ask about it: darkqa-eval --model NAME --data photos"
    );
    for line in [
        "report one two",
        "report one",
        "bundle one --out one.zip",
        "--model random --data photos",
        "synthesize photos --out dark",
    ] {
        bench.complete(&words(line));
    }
}

#[test]
fn wrong_words_name_their_flag() {
    let bench = Bench::new();
    let lines = [
        "--modle x",
        "--limit 3",
        "--model random --levels L7",
        "--model random --limit 0",
        "--model random --data nowhere",
        "--model random --families smell",
        "--model random --config nowhere.toml",
        "--model random --resume nowhere",
        "--model random --out a --resume b",
        "--resume nowhere",
        "--model random --threads 1025",
        "--model random --max-failures 0",
        "--model random --model random",
        "--model random --image webp",
        "--model random --prompts nowhere",
        "--model script:nowhere.jsonl",
        // Found before the rooms are drawn, which would take hours.
        "--model random --data rooms:frames=100000 --llie nowhere.onnx",
    ];
    insta::assert_snapshot!(each(lines, |line| refused(&bench, line)), @r#"
    --modle x
      error: unexpected argument '--modle' found; tip: a similar argument exists: '--model'
    --limit 3
      error: --model: no model is named: a model's name at the endpoint, or room-net, observer or random to try
          without one; it would be asked about 48 built-in rooms from L0 to L5, and --help lists what can be set
    --model random --levels L7
      error: invalid value 'L7' for '--levels <LEVELS>': level: "L7" is not one of L0, L1, L2, L3, L4, L5 and not a
          number of stops such as 3.3 or E3.3
    --model random --limit 0
      error: invalid value '0' for '--limit <N>': number would be zero for non-zero type
    --model random --data nowhere
      error: --data: nowhere: no such file or folder
    --model random --families smell
      error: --families: no question of the family smell; there are: room_type, affordance, presence, closest
    --model random --config nowhere.toml
      error: nowhere.toml: cannot read: [OS ERROR]
    --model random --resume nowhere
      error: --resume: nowhere: no such folder; it must hold a run, and --out DIR begins a new one
    --model random --out a --resume b
      error: the argument '--out <DIR>' cannot be used with '--resume <DIR>'
    --resume nowhere
      error: --model: no model is named: --resume takes the same flags as the run had, the model's name among them
    --model random --threads 1025
      error: invalid value '1025' for '--threads <N>': a number from 1 to 1024 expected
    --model random --max-failures 0
      error: invalid value '0' for '--stop failures=<N>': number would be zero for non-zero type
    --model random --model random
      error: --model: random is named twice; in a file of models, give each its own name
    --model random --image webp
      error: invalid value 'webp' for '--image <FORMAT>': png, or jpeg:QUALITY with a quality from 1 to 100, as
          jpeg:95, expected
    --model random --prompts nowhere
      error: --prompts: no folder nowhere, and the built-in prompts are paper, terse, letter
    --model script:nowhere.jsonl
      error: nowhere.jsonl: cannot read: [OS ERROR]
    --model random --data rooms:frames=100000 --llie nowhere.onnx
      error: --llie: nowhere.onnx: no such file
    "#);
}

#[test]
fn call_without_words_shows_first_steps() {
    let called = Bench::new().call(&[]);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: --model: no model is named: a model's name at the endpoint, or room-net, observer or random to try
        without one; it would be asked about 48 built-in rooms from L0 to L5, and --help lists what can be set
      darkqa-eval --model room-net --llie lift                    try it, without key or data
      darkqa-eval --model gpt-4o --data my-frames/ --dry-run      your own images: the requests, tokens and
        dollars it would take
      darkqa-eval --help                                          every flag and command
      https://github.com/darkqa-eval/darkqa-eval                  the documentation
    ");
}

#[test]
fn completions_and_manual_come_from_flags() {
    let bench = Bench::new();
    check_rows(["bash", "zsh", "fish", "powershell", "elvish"], |shell| {
        let script = bench.complete(&["completions", shell]);
        assert!(script.contains("llie-options"), "{shell}");
    });
    bench.complete(&["man", "pages"]);
    let page = |name: &str| std::fs::read_to_string(bench.path(&format!("pages/{name}.1"))).unwrap();
    assert!(page("darkqa-eval").contains("llie\\-options"));
    assert!(page("darkqa-eval-openeqa").contains("judge\\-base\\-url"));
    assert!(page("darkqa-eval-batch-export").contains("file\\-size"));
}

#[test]
fn estimate_names_built_in_models() {
    let bench = Bench::new();
    let said = bench.complete(&words(
        "--model observer --blind-model random --data rooms:frames=3,size=96x64 --levels L0,L3 --dry-run",
    ));
    insta::assert_snapshot!(redacted(&said), @"
    Nothing was sent. 70 of 70 trials are left to ask.
    at no endpoint, built in: observer 30, observer:other-room 30, random (blind) 10
    power: 10 questions in 2 scenes detects no difference between two conditions; 5 points need about 217 scenes
        (one model; level 2.50 % after correction; assumed: 20 % of answers change without an effect, correlation
        0.05 in a scene)
    only 3 frames (8 are needed): intervals and tests would be rough
    ");
}

#[test]
fn a_dry_run_needs_no_key() {
    let bench = Bench::with_questions(3);
    let args = words("--data set.jsonl --model gpt-4o --dry-run");
    let run = bench.complete(&args);
    assert!(run.starts_with("Nothing was sent. 33 of 33"), "{run}");
    insta::assert_snapshot!(lines_with(&run, "asked at"), @"asked at https://api.openai.com/v1");
    bench.file("two.toml", "[[model]]\nid = \"a\"\n[[model]]\nid = \"b\"\nendpoints = [\"http://127.0.0.1:9/v1\"]\n");
    let two = bench.complete(&words("--data set.jsonl --models two.toml --dry-run"));
    insta::assert_snapshot!(lines_with(&two, "asked at"), @"
    asked at https://api.openai.com/v1: a
    asked at http://127.0.0.1:9/v1: b
    ");
    // A file that is not there is not looked for, either.
    bench.complete(&[&args[..], &["--api-key-file", "nowhere"]].concat());
}

/// Retries take a minute by default, so the first failure is said at once, and once.
#[test]
fn unreachable_address_is_reported_at_once() {
    let bench = Bench::with_questions(3);
    let line = "--data set.jsonl --model m --base-url http://127.0.0.1:9/v1 --levels L0 --retries 1 --out run";
    let called = bench.call(&words(line));
    assert_eq!(called.code, Some(1), "{called:?}");
    let said = "WARN http://127.0.0.1:9/v1: ";
    let warned = called.stderr.lines().filter(|line| {
        line.contains(said) && line.ends_with("Is a server running there? --base-url names the address")
    });
    assert_eq!(warned.count(), 1, "{called:?}");
}

/// A server that turns requests away is waited for, half an hour by default: the user learns why nothing happens.
#[test]
fn refusing_server_is_reported_while_waiting() {
    // The second refusal comes after half of the patience of 8 s, with seconds to spare before its end.
    let mock = MockEndpoint::start([
        Answer::error(429, "x", "slow down").header("retry-after", "4.5"),
        Answer::error(429, "x", "slow down").header("retry-after", "0.1"),
        Answer::text("A"),
    ]);
    let bench = Bench::with_questions(1);
    let line = "--data set.jsonl --levels L0 --out run --retries patience=";
    let waited = |patience: &str| {
        let called = bench.call(&model_args(&mock.base_url(), &format!("{line}{patience}")));
        let lines = called.stderr.lines().filter(|line| line.contains("waiting: "));
        (called.code, lines.map(str::to_owned).collect::<Vec<_>>())
    };
    let (code, told) = waited("8");
    assert_eq!((code, told.len()), (Some(0), 1), "{told:?}");
    insta::assert_snapshot!(redacted(&told[0]), @"
    WARN http://127.0.0.1:[PORT]/v1 answered 429: slow down; waiting: no request was accepted for [TIME], and the
       run stops after [TIME] (--retries patience)
    ");
    // Without a refusal nothing is told.
    fs::remove_dir_all(bench.path("run")).unwrap();
    assert_eq!(waited("8"), (Some(0), Vec::new()));
}

#[test]
fn second_names_are_the_same_flags() {
    let bench = Bench::new();
    let dry = |flags: &str| {
        let line = format!("--model random --levels L0,L3 --dry-run {flags}");
        bench.complete(&words(&line))
    };
    let first = dry("--llie lift --llie-on noise");
    assert_eq!(first, dry("--enhancer lift --enhancer-on noise"));
    assert_ne!(first, dry("--enhancer lift --enhancer-on both"));
}

#[test]
fn what_changes_nothing_is_said() {
    let bench = Bench::with_questions(3);
    let args = words("--data set.jsonl --model random --blind");
    let quiet = bench.call(&args);
    assert_eq!((quiet.code, &*quiet.stderr), (Some(0), ""));
    let run = bench.call(&[&args[..], &["--levels", "L3", "--llie", "no.onnx"]].concat());
    assert_eq!(run.stderr.trim(), "WARN --levels, --llie: no effect: no model is shown an image");
}

#[test]
fn a_remote_endpoint_needs_a_key() {
    let bench = Bench::new();
    insta::assert_snapshot!(refused(&bench, "--model gpt-4o"), @"
    error: OPENAI_API_KEY: no key for https://api.openai.com/v1: set this variable, or name another with
        --api-key-env NAME or a file with --api-key-file FILE; name your own server with --base-url URL;
        --api-key-env none sends no key
    ");
    insta::assert_snapshot!(refused(&bench, "--model m --api-key-file nowhere"), @"error: nowhere: cannot read: [OS ERROR]");
    bench.file("key", "sk-secret-42\n");
    let line = "--model m --base-url http://example.org/v1 --api-key-file key";
    insta::assert_snapshot!(refused(&bench, line), @"
    error: --base-url: the key would be sent unencrypted to http://example.org/v1; use https://, or --allow http
        on a network that you trust
    ");
    assert!(!bench.call(&words(line)).stderr.contains("sk-secret-42"));
}

/// A call with the frames and the question of [`data`].
const FRAMES: &str = "--data frames --model random --out run";

#[test]
fn wrong_questions_name_their_line() {
    let bench = Bench::new();
    data(&bench, |question| question["answer"] = "maybe".into());
    insta::assert_snapshot!(refused(&bench, FRAMES), @r#"
    error: frames/questions.jsonl: line 1: the answer "maybe" (column "answer") is not one of the options ["yes",
        "no"], neither by letter nor by text nor by number
    "#);
    data(&bench, |question| question["choices"] = json!(["yes"]));
    insta::assert_snapshot!(refused(&bench, FRAMES), @r#"
    error: frames/questions.jsonl: line 1: the answer "no" (column "answer") is not one of the options ["yes"],
        neither by letter nor by text nor by number
    "#);
    data(&bench, |question| question["frame"] = "z.png".into());
    insta::assert_snapshot!(refused(&bench, FRAMES), @r#"
    error: frames/questions.jsonl: question "q" is about the frame "z.png", which frames does not have (its frames
        are named like "a.png"): --skip bad leaves such questions out
    "#);
}

#[test]
fn file_without_image_is_named() {
    let bench = Bench::new();
    data(&bench, |_| ());
    bench.file("frames/a.png", "not an image");
    insta::assert_snapshot!(refused(&bench, FRAMES), @r#"
    error: question "q": frames/a.png: not an image: PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected; --skip bad
        leaves such questions out
    "#);
}

#[test]
fn folder_without_questions_is_refused() {
    let bench = Bench::new();
    data(&bench, |_| ());
    std::fs::remove_file(bench.path("frames/questions.jsonl")).unwrap();
    insta::assert_snapshot!(refused(&bench, FRAMES), @"
    error: frames: no questions.jsonl or questions.csv in this folder, and no frames.jsonl with classes.json to
        make questions of; --questions FILE names some, and --ask home asks about photographs without any
    ");
    bench.file("empty/readme.txt", "");
    insta::assert_snapshot!(refused(&bench, "--data empty --model random"), @"
    error: empty: no questions.jsonl or questions.csv in this folder, and no frames.jsonl with classes.json to
        make questions of; --questions FILE names some, and --ask home asks about photographs without any
    ");
}

#[test]
fn table_without_question_is_refused() {
    let bench = Bench::new();
    bench.file("table.tsv", "a\tb\n1\t2\n");
    let called = bench.call(&words("--data table.tsv --model random"));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: table.tsv: no question among its columns:
       a  text     "1"
       b  text     "2"
     say which is which, e.g. --map question=b; --map question='' if it stands in the image
    "#);
}

#[test]
fn wrong_enhancers_name_their_file() {
    let bench = Bench::new();
    // Where ONNX Runtime is not there yet, its first use installs it and says so.
    onnx::identity().write(&bench.path(""), "fine.onnx");
    bench.complete(&words("--model random --limit 1 --levels L1 --out first --llie-anyway --llie fine.onnx"));
    let line = |file: &str| format!("--model random --out run --llie {file}");
    insta::assert_snapshot!(refused(&bench, &line("nowhere.onnx")), @"error: --llie: nowhere.onnx: no such file");
    bench.file("text.onnx", "this is no model, whatever its name says");
    insta::assert_snapshot!(refused(&bench, &line("text.onnx")), @"
    error: text.onnx: is not a complete ONNX model; download it again, or export it to ONNX if it is a PyTorch or
        TensorFlow model
    ");
    onnx::no_image().write(&bench.path(""), "blind.onnx");
    insta::assert_snapshot!(refused(&bench, &line("blind.onnx")), @r#"
    error: blind.onnx: gives "curves" (float32 [1, 24, height, width]), 24 channels, but an image has 3; if they
        are the curves of Zero-DCE, add to blind.onnx.toml next to it: `image = "curves(input, curves[0:3],
        curves[3:6], curves[6:9], curves[9:12], curves[12:15], curves[15:18], curves[18:21], curves[21:24])"`
    "#);
    onnx::no_image().write(&bench.path(""), "rank.onnx");
    insta::assert_snapshot!(refused(&bench, &line("rank.onnx")), @r#"
    error: rank.onnx: gives "curves" (float32 [1, 24, height, width]), 24 channels, but an image has 3; if they
        are the curves of Zero-DCE, add to rank.onnx.toml next to it: `image = "curves(input, curves[0:3],
        curves[3:6], curves[6:9], curves[9:12], curves[12:15], curves[15:18], curves[18:21], curves[21:24])"`
    "#);
    let missing = "--model random --out run --llie fine.onnx --ort-lib no-such.so";
    insta::assert_snapshot!(refused(&bench, missing), @"
    error: ONNX Runtime: [TMP]/no-such.so cannot be read: [OS ERROR]; name a library of 1.17 or later with
        --llie-options ort-lib=FILE or ORT_DYLIB_PATH, or leave both out to search for one
    ");
    let twice = "--model random --out run --llie fine.onnx --llie fine.onnx";
    insta::assert_snapshot!(refused(&bench, twice), @"error: --llie: two models are named fine; rename one of the files");
}

/// A short run that needs no network.
const SHORT: &str = "--model random --limit 2 --out run --json";

/// The different values that the rows of a summary have under a name, as JSON.
fn values(summary: &str, name: &str) -> BTreeSet<String> {
    let summary: serde_json::Value = serde_json::from_str(summary).unwrap();
    summary["rows"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|row| row["model"] == "random")
        .map(|row| row[name].to_string())
        .collect()
}

#[test]
fn higher_layer_overrides_switch() {
    let rows = [
        ("--config c.toml", "false", "\"image\""),
        ("--config c.toml", "", "\"blind\""),
        ("--blind", "false", "\"blind\""),
        ("", "yes", "\"blind\""),
        ("", "0", "\"image\""),
    ];
    check_rows(rows, |(line, variable, view)| {
        let bench = Bench::new();
        bench.file("c.toml", "blind = true\nlevels = \"L0\"\n");
        let mut command = bench.command(&words(SHORT));
        command.args(words(line)).args(["--levels", "L0"]);
        let run = called(command.env("DARKQA_BLIND", variable));
        assert_eq!(run.code, Some(0), "{run:?}");
        let views = values(&run.stdout, "view");
        assert_eq!(views, [view.into()].into(), "{line:?} {variable:?}");
    });
}

#[test]
fn foreign_variables_rank_below_file() {
    let bench = Bench::new();
    bench.file("c.toml", "base-url = \"http://of-the-file.test/v1\"\n");
    let error = |line: &str, ours: &str| {
        let mut command = bench.command(&["--model", "m"]);
        command.env("OPENAI_BASE_URL", "http://of-openai.test/v1");
        called(command.env("DARKQA_BASE_URL", ours).args(words(line))).stderr
    };
    let rows = [
        ("", "", "of-openai.test"),
        ("--config c.toml", "", "of-the-file.test"),
        ("--config c.toml", "http://ours.test", "ours.test"),
    ];
    check_rows(rows, |(line, ours, host)| {
        let error = error(line, ours);
        assert!(error.contains(host), "{line:?} {ours:?}: {error}");
    });
}

#[test]
fn flag_file_has_lists_and_errors() {
    let bench = Bench::new();
    bench.file("lists.toml", "levels = [\"L0\", \"L3\"]\nvariant = \"ev\"\nfamilies = [\"closest\", \"presence\"]\n");
    let listed = bench.complete(&words(&format!("{SHORT} --config lists.toml")));
    assert_eq!(values(&listed, "level"), ["\"L0\"".into(), "\"L3\"".into()].into());
    let bench = Bench::new();
    let files = [
        "seed = 1\nblind = = 2\n",
        "seed = 1\n\nmodel = [\"a\",\n",
        "config = \"other.toml\"",
        "seed = [1, 2]",
        "blind = 3",
    ];
    let errors = each(files, |text| {
        bench.file("c.toml", text);
        refused(&bench, "--model random --config c.toml")
    });
    insta::assert_snapshot!(errors, @r#"
    seed = 1 \n blind = = 2
      error: c.toml, line 2: not valid TOML: extra `=`, expected nothing
    seed = 1 \n  \n model = ["a",
      error: c.toml, line 3: not valid TOML: unclosed array, expected `]`
    config = "other.toml"
      error: c.toml, config: a file of flags cannot name another; --config takes one file
    seed = [1, 2]
      error: c.toml, seed: invalid value '1,2' for '--seed <N>': invalid digit found in string
    blind = 3
      error: c.toml, blind: true or false expected
    "#);
}

#[test]
fn variable_that_sets_nothing_is_refused() {
    let bench = Bench::new();
    let run = called(bench.command(&words(SHORT)).env("DARKQA_LEVEL", "L0"));
    assert_eq!(run.code, Some(2), "{run:?}");
    assert_eq!(run.stderr, "error: DARKQA_LEVEL: no flag of this name; did you mean DARKQA_LEVELS?\n");
    // A variable that another command knows is none of this one's business.
    let run = called(bench.command(&words(SHORT)).env("DARKQA_BALANCE", "none"));
    assert_eq!(run.code, Some(0), "{run:?}");
}

#[test]
fn a_cause_is_said_once() {
    let bench = Bench::new();
    let error = bench.call(&["--model", "random", "--config", "nowhere.toml"]).stderr;
    assert_eq!(error.matches("os error").count(), 1, "{error}");
}

#[test]
fn quiet_prints_only_output_paths() {
    let bench = Bench::with_questions(12);
    let line = "--model random --data set.jsonl --levels L0,L5 --out run --quiet";
    assert_eq!(bench.complete(&words(line)), "run\n");
    assert!(bench.complete(&words(&line.replace(" --quiet", ""))).contains("accuracy"));
    for (line, said) in [
        ("report run", "run\n"),
        ("report run run --out both", "both\n"),
        ("synthesize run/nowhere --out no", ""),
        ("figures run --out figures", "figures\n"),
        ("bundle run --out run.zip", "run.zip\n"),
        ("site run --out site", "site/index.html\n"),
        ("man pages", "pages\n"),
    ] {
        let called = bench.call(&[&words(line)[..], &["--quiet"]].concat());
        assert_eq!(called.stdout, said, "{line}: {called:?}");
        // An error is said, whatever is quiet.
        assert_eq!(called.code == Some(0), called.stderr.is_empty(), "{line}");
    }
    // What is asked for by a flag of its own is printed, and so is what is written nowhere.
    for more in ["--json", "--findings", "--full", "--markdown"] {
        let said = bench.complete(&["report", "run", more, "--quiet"]);
        assert!(said.lines().count() > 2, "{more}: {said}");
    }
    // A report on shared items alone is written nowhere without --out.
    let common = bench.complete(&words("report run --common --quiet"));
    insta::assert_snapshot!(lines_with(&common, "report:"), @"report: not written; --out DIR writes one");
    bench.complete(&words("--model random --seed 1 --data set.jsonl --levels L0 --out two"));
    assert!(bench.complete(&words("report run two --quiet")).lines().count() > 2);
}
