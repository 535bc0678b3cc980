//! Remedies of `src/data`.

use super::{Bench, ROW, Remedy, Unfollowed, Why, photograph};
use crate::support::image_files::png;
use crate::support::lerobot;
use crate::support::parquet_file::{Column, table};

const QUESTION: &str = r#"{"question": "Is it red?", "choices": ["yes", "no"], "answer": 0, "image": "1.png"}"#;

fn photographs(bench: &Bench) {
    for (number, shade) in [(1, 100), (2, 40)] {
        photograph(bench, &format!("photos/{number}.png"), shade);
    }
    bench.file("q.jsonl", QUESTION);
    bench.file("bank.jsonl", r#"{"id": "red", "question": "Is it red?", "choices": ["yes", "no"]}"#);
}

fn pairs(bench: &Bench) {
    for (name, shade) in [("1.png", 100), ("2.png", 130)] {
        photograph(bench, &format!("set/target/{name}"), shade);
        photograph(bench, &format!("set/input/{name}"), shade / 8);
    }
    bench.file("q.jsonl", QUESTION);
}

/// Folders with an image each, one for each class.
fn classes(bench: &Bench, count: u8) {
    for class in 0..count {
        photograph(bench, &format!("set/class-{class}/a.png"), class);
    }
}

/// Photographs, and questions about them without options and answers.
fn unanswered(bench: &Bench) {
    photographs(bench);
    let rows = ["question,image", "Is it red?,1.png", "Is it blue?,2.png"];
    set(bench, "q.csv", &rows);
}

/// A set of the lines of a file, with its images.
fn set(bench: &Bench, name: &str, lines: &[&str]) {
    for (number, shade) in [(1, 100), (2, 40)] {
        photograph(bench, &format!("set/{number}.png"), shade);
    }
    bench.file(&format!("set/{name}"), lines.join("\n"));
}

/// A Parquet file of two rows with images, questions, options and answers.
fn parquet(bench: &Bench, path: &str) {
    let images = [100, 40]
        .map(|shade| png(&image::RgbImage::from_fn(48, 32, |x, y| image::Rgb([x as u8 + shade, y as u8, shade]))));
    let texts = |texts: [&str; 2]| Column::Texts(texts.map(str::to_owned).to_vec());
    let columns = [
        ("image", Column::Images(images.to_vec())),
        ("question", texts(["Is it red?", "Is it blue?"])),
        ("options", texts([r#"["yes", "no"]"#, r#"["yes", "no"]"#])),
        ("answer", texts(["yes", "no"])),
    ];
    bench.file(path, table(columns));
}

/// A Parquet file of two rows with images in a column whose name says nothing.
fn images_alone(bench: &Bench, path: &str) {
    let images = [100, 40].map(|shade| png(&image::RgbImage::from_pixel(48, 32, image::Rgb([shade, 9, 9]))));
    bench.file(path, table([("observation.front", Column::Images(images.to_vec()))]));
}

fn saved_to_disk(bench: &Bench) {
    for name in ["state.json", "dataset_info.json"] {
        bench.file(&format!("saved/{name}"), "{}");
    }
    bench.file("saved/data-00000-of-00001.arrow", "");
}

fn saved_splits(bench: &Bench) {
    bench.file("saved/dataset_dict.json", r#"{"splits": ["train", "test"]}"#);
    bench.file("saved/train/data-00000-of-00001.arrow", "");
}

/// A set whose card names two configurations.
fn configurations(bench: &Bench) {
    let card = "---\nconfigs:\n- config_name: a\n  data_files: a.jsonl\n- config_name: b\n  data_files: b.jsonl\n---\n";
    set(bench, "README.md", &[card]);
    bench.file("set/a.jsonl", QUESTION);
    bench.file("set/b.jsonl", QUESTION);
}

fn splits(bench: &Bench) {
    for split in ["train", "dev"] {
        parquet(bench, &format!("set/{split}-00000-of-00001.parquet"));
    }
}

/// Two questions, one with two images.
fn two_images(bench: &Bench) {
    let both =
        r#"{"question": "Are they equal?", "choices": ["yes", "no"], "answer": 1, "images": ["1.png", "2.png"]}"#;
    set(bench, "q.jsonl", &[both, &QUESTION.replace("\"image\": \"1.png\"", "\"images\": [\"1.png\"]")]);
}

/// A folder of photographs, and questions of which one names no photograph.
fn one_unmatched(bench: &Bench) {
    photographs(bench);
    bench.file("q.jsonl", [QUESTION, &QUESTION.replace("1.png", "9.png")].join("\n"));
}

fn families(bench: &Bench) {
    let rows = (0..100).map(|family| format!("Is it {family}?,1.png,yes,no,A,f{family},k"));
    let lines: Vec<String> =
        std::iter::once("question,image,A,B,answer,category,kind".to_owned()).chain(rows).collect();
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    set(bench, "q.csv", &lines);
}

const CHECK: &str = "check --model random --levels L0 --data set";

/// All remedies that are followed here.
pub(super) const ROWS: &[Remedy] = &[
    Remedy {
        says: "asks questions whose answers are known",
        state: |bench| {
            photographs(bench);
            bench.file("bank.jsonl", QUESTION);
        },
        command: "check --model random --levels L0 --data photos --ask bank.jsonl",
        printed: "--questions FILE asks",
        followed: "check --model random --levels L0 --data photos --questions bank.jsonl",
        ..ROW
    },
    Remedy {
        says: "each question is asked about every image of --data",
        state: |bench| {
            photographs(bench);
            bench.file("bank.jsonl", QUESTION.replace("\"answer\": 0, ", ""));
        },
        command: "check --model random --levels L0 --data photos --ask bank.jsonl",
        printed: "every image of --data",
        effect: photographs,
        followed: "check --model random --levels L0 --data photos --ask bank.jsonl",
    },
    Remedy {
        says: "a question of --ask has no",
        state: |bench| {
            photographs(bench);
            bench.file("bank.jsonl", QUESTION.replace("\"answer\": 0, ", ""));
        },
        command: "check --model random --levels L0 --data photos --ask bank.jsonl",
        printed: "a question of --ask has no \"image\": each question is asked about every image of --data",
        effect: photographs,
        followed: "check --model random --levels L0 --data photos --ask bank.jsonl",
    },
    Remedy {
        says: "to make questions of; --questions FILE names some",
        state: photographs,
        command: "check --model random --levels L0 --data photos",
        printed: "--questions FILE names some",
        followed: "check --model random --levels L0 --data photos --questions q.jsonl",
        ..ROW
    },
    Remedy {
        says: "to make questions of; --questions FILE names some",
        state: photographs,
        command: "check --model random --levels L0 --data photos",
        printed: "--ask home asks about photographs without any",
        followed: "check --model random --levels L0 --data photos --ask home",
        ..ROW
    },
    Remedy {
        says: "is in the same folder; --data",
        state: |bench| {
            photographs(bench);
            bench.file("photos/questions.jsonl", QUESTION);
            bench.file("photos/questions.json", format!("[{QUESTION}]"));
        },
        command: "check --model random --levels L0 --data photos",
        printed: "--data photos/questions.json reads it alone",
        followed: "check --model random --levels L0 --data photos/questions.json",
        ..ROW
    },
    Remedy {
        says: "it is a LeRobot data set; take frames of it",
        state: |bench| lerobot::Set::default().write(&bench.path("set")),
        command: CHECK,
        printed: "darkqa-eval import lerobot set",
        followed: "import lerobot set",
        ..ROW
    },
    Remedy {
        says: "rename one of them, or give each folder its own --out",
        state: |bench| {
            photograph(bench, "a/1.png", 1);
            photograph(bench, "b/1.png", 2);
        },
        command: "synthesize a b --levels L2 --out dark",
        printed: "give each folder its own --out",
        followed: "synthesize a --levels L2 --out dark-a",
        ..ROW
    },
    Remedy {
        says: "--label-folders needs one for each class, at least two",
        state: |bench| classes(bench, 1),
        command: "check --model random --levels L0 --data set --label-folders What?",
        printed: "--label-folders needs one for each class",
        effect: |bench| classes(bench, 2),
        followed: "check --model random --levels L0 --data set --label-folders What?",
    },
    Remedy {
        says: "asks with the own class and 3 others",
        state: |bench| classes(bench, 30),
        command: "check --model random --levels L0 --data set --label-folders What?",
        printed: "--choices 4",
        followed: "check --model random --levels L0 --data set --label-folders What? --choices 4",
        ..ROW
    },
    Remedy {
        says: "leave out --choices to offer them all",
        state: |bench| classes(bench, 3),
        command: "check --model random --levels L0 --data set --label-folders What? --choices 4",
        printed: "leave out --choices",
        followed: "check --model random --levels L0 --data set --label-folders What?",
        ..ROW
    },
    Remedy {
        says: "leaves such questions out",
        state: one_unmatched,
        command: "check --model random --levels L0 --data photos --questions q.jsonl",
        printed: "--skip bad",
        followed: "check --model random --levels L0 --data photos --questions q.jsonl --skip bad=50%",
        ..ROW
    },
    Remedy {
        says: "names the signs between them",
        state: |bench| {
            set(bench, "q.csv", &["question,image,options,answer", "Which?,1.png,red|blue,red"]);
        },
        command: CHECK,
        printed: "--map options='options:split(|)'",
        followed: "check --model random --levels L0 --data set --map options=options:split(|)",
        ..ROW
    },
    Remedy {
        says: "neither options nor answers among its columns",
        state: |bench| {
            set(bench, "q.csv", &["question,image,eins,zwei", "Which?,1.png,\"[\"\"red\"\", \"\"blue\"\"]\",red"]);
        },
        command: CHECK,
        printed: "--map options=COLUMN,answer=COLUMN names them",
        followed: "check --model random --levels L0 --data set --map options=eins,answer=zwei",
        ..ROW
    },
    Remedy {
        says: "neither options nor answers among its columns",
        state: |bench| {
            set(bench, "q.csv", &["question,image,eins", "Is it red?,1.png,yes", "Is it blue?,2.png,no"]);
        },
        command: CHECK,
        printed: "--map answer=COLUMN those of yes/no questions",
        followed: "check --model random --levels L0 --data set --map answer=eins",
        ..ROW
    },
    Remedy {
        says: "asks questions without answers about every image",
        state: unanswered,
        command: CHECK,
        printed: "--ask FILE asks",
        followed: "check --model random --levels L0 --data set --ask bank.jsonl",
        ..ROW
    },
    Remedy {
        says: "asks questions without answers about every image",
        state: unanswered,
        command: "check --model random --levels L0 --data set/q.csv",
        printed: "--ask FILE asks",
        followed: "check --model random --levels L0 --data set/q.csv --ask bank.jsonl",
        ..ROW
    },
    Remedy {
        says: "a test split without them? (--ask FILE",
        state: |bench| {
            photographs(bench);
            set(bench, "q.csv", &["question,image,A,B", "Which?,1.png,red,blue"]);
        },
        command: "check --model random --levels L0 --data set/q.csv",
        printed: "--ask FILE asks",
        followed: "check --model random --levels L0 --data set/q.csv --ask bank.jsonl",
        ..ROW
    },
    Remedy {
        says: "a test split without them? --read split names another",
        state: |bench| {
            for (split, answer) in [("dev", "red"), ("test", "")] {
                set(
                    bench,
                    &format!("{split}.csv"),
                    &["question,image,A,B,answer", &format!("Which?,1.png,red,blue,{answer}")],
                );
            }
        },
        command: CHECK,
        printed: "--read split names another",
        followed: "check --model random --levels L0 --data set --read split=dev",
        ..ROW
    },
    Remedy {
        says: "a test split without them? --read split names another",
        state: |bench| {
            photographs(bench);
            set(bench, "test.csv", &["question,image,A,B,answer", "Which?,1.png,red,blue,"]);
        },
        command: "check --model random --levels L0 --data set/test.csv",
        printed: "--ask FILE asks questions without answers",
        followed: "check --model random --levels L0 --data set/test.csv --ask bank.jsonl",
        ..ROW
    },
    Remedy {
        says: "if the question stands in the image",
        state: |bench| set(bench, "q.csv", &["image,A,B,answer", "1.png,red,blue,A"]),
        command: CHECK,
        printed: "--map question='' asks",
        followed: "check --model random --levels L0 --data set --map question=",
        ..ROW
    },
    Remedy {
        says: "--ask home asks questions of its own about the images",
        state: |bench| images_alone(bench, "set/images.parquet"),
        command: CHECK,
        printed: "--ask home asks questions of its own",
        followed: "check --model random --levels L0 --data set --ask home",
        ..ROW
    },
    Remedy {
        says: "--ask home asks questions of its own about the images",
        state: |bench| images_alone(bench, "images.parquet"),
        command: "check --model random --levels L0 --data images.parquet",
        printed: "--ask home asks questions of its own",
        followed: "check --model random --levels L0 --data images.parquet --ask home",
        ..ROW
    },
    Remedy {
        says: "which is not there",
        state: |bench| {
            set(bench, "q.csv", &["Frage_1,image,A,B,answer", "Which?,1.png,red,blue,A"]);
        },
        command: "check --model random --levels L0 --data set --map question=frage1",
        printed: "--map names the column \"frage1\", which is not there; did you mean \"Frage_1\"?",
        followed: "check --model random --levels L0 --data set --map question=Frage_1",
        ..ROW
    },
    Remedy {
        says: "a folder of Arrow files, as save_to_disk writes it",
        state: saved_to_disk,
        command: "check --model random --levels L0 --data saved",
        printed: "python -c \"import datasets; datasets.load_from_disk('.').to_parquet('set.parquet')\"",
        effect: |bench| parquet(bench, "saved/set.parquet"),
        followed: "check --model random --levels L0 --data saved",
    },
    Remedy {
        says: "a folder of Arrow files by split",
        state: saved_splits,
        command: "check --model random --levels L0 --data saved",
        printed: "python -c \"import datasets; [split.to_parquet(name + '.parquet') for name, split in datasets.load_from_disk('.').items()]\" in it, then name the split: --read split=NAME",
        effect: |bench| {
            parquet(bench, "saved/train.parquet");
            parquet(bench, "saved/test.parquet");
        },
        followed: "check --model random --levels L0 --data saved --read split=train",
    },
    Remedy {
        says: "an Arrow file, which is not read",
        state: |bench| {
            bench.file("set/data 1.arrow", "");
        },
        command: "check --model random --levels L0 --data set/*.arrow",
        printed: "python -c \"import sys, datasets; datasets.Dataset.from_file(sys.argv[1]).to_parquet('set.parquet')\" 'data 1.arrow' in its folder",
        effect: |bench| parquet(bench, "set/set.parquet"),
        followed: CHECK,
    },
    Remedy {
        says: "names one, --read config=all takes them together",
        state: configurations,
        command: CHECK,
        printed: "--read config=NAME names one",
        followed: "check --model random --levels L0 --data set --read config=a",
        ..ROW
    },
    Remedy {
        says: "names one, --read config=all takes them together",
        state: configurations,
        command: CHECK,
        printed: "--read config=all takes them together",
        followed: "check --model random --levels L0 --data set --read config=all",
        ..ROW
    },
    Remedy {
        says: "files of several kinds",
        state: |bench| {
            set(bench, "a.jsonl", &[QUESTION]);
            bench.file("set/b.csv", "x\n1");
        },
        command: CHECK,
        printed: "name the one that is meant: --data set/a.jsonl",
        followed: "check --model random --levels L0 --data set/a.jsonl",
        ..ROW
    },
    Remedy {
        says: "several --data name the files of one set",
        state: |bench| {
            set(bench, "a.jsonl", &[QUESTION]);
            bench.file("set/b.jsonl", QUESTION.replace("red", "blue"));
        },
        command: "check --model random --levels L0 --data set --data set/b.jsonl",
        printed: "several --data name the files of one set",
        followed: "check --model random --levels L0 --data set/a.jsonl --data set/b.jsonl",
        ..ROW
    },
    Remedy {
        says: "say where the rows are",
        state: |bench| {
            let items = r#"{"info": [{"a": 1}], "items": [{"frage": "Which?", "bild": "1.png", "wahl": ["red", "blue"], "wahr": "red"}]}"#;
            set(bench, "q.json", &[items]);
        },
        command: CHECK,
        printed: "--read rows=info, and which column is which if these are no common names: --map question=…,image=…,options=…,answer=…",
        followed: "check --model random --levels L0 --data set --read rows=items --map question=frage,image=bild,options=wahl,answer=wahr",
        ..ROW
    },
    Remedy {
        says: "names one, --read split=all takes them together",
        state: splits,
        command: CHECK,
        printed: "--read split=NAME names one",
        followed: "check --model random --levels L0 --data set --read split=dev",
        ..ROW
    },
    Remedy {
        says: "names one, --read split=all takes them together",
        state: splits,
        command: CHECK,
        printed: "--read split=all takes them together",
        followed: "check --model random --levels L0 --data set --read split=all",
        ..ROW
    },
    Remedy {
        says: ", --multi-image send shows all of them in one request",
        state: two_images,
        command: CHECK,
        printed: "--multi-image skip leaves it out, --multi-image send",
        followed: "check --model random --levels L0 --data set --multi-image send",
        ..ROW
    },
    Remedy {
        says: ", --multi-image send shows all of them in one request",
        state: two_images,
        command: CHECK,
        printed: "--multi-image skip leaves it out",
        followed: "check --model random --levels L0 --data set --multi-image skip",
        ..ROW
    },
    Remedy {
        says: "reads it by its rules",
        state: |bench| {
            photographs(bench);
            for number in [1, 2] {
                photograph(bench, &format!("set/MMVP Images/{number}.jpg"), 9);
            }
            set(
                bench,
                "q.csv",
                &[
                    "Index,Question,Options,Correct Answer",
                    "1,Which?,(a) red (b) blue,(a)",
                    "2,Which?,(a) red (b) blue,(b)",
                ],
            );
        },
        command: CHECK,
        printed: "it looks like MMVP: --data mmvp:FILE reads it by its rules",
        followed: "check --model random --levels L0 --data mmvp:set/q.csv",
        ..ROW
    },
    Remedy {
        says: "scores questions together by",
        state: |bench| {
            set(bench, "q.csv", &["question,image,A,B,answer", "Which?,1.png,red,blue,A"]);
        },
        command: "--model random --levels L0 --out run --data mmvp:set --map image=image",
        printed: "--map group=COLUMN names another",
        followed: "--model random --levels L0 --out other --data mmvp:set --map image=image,group=image",
        ..ROW
    },
    Remedy {
        says: "make tables that are hard to read",
        state: families,
        command: "--model random --levels L0 --out run --data set",
        printed: "--map family=COLUMN names another column",
        followed: "--model random --levels L0 --out other --data set --map family=kind",
        ..ROW
    },
    Remedy {
        says: "make tables that are hard to read",
        state: families,
        command: "--model random --levels L0 --out run --data set",
        printed: "--map family= none",
        followed: "--model random --levels L0 --out other --data set --map family=",
        ..ROW
    },
    Remedy {
        says: "allows the folder that it names",
        state: |bench| {
            photograph(bench, "other/1.png", 9);
            set(bench, "q.jsonl", &[&QUESTION.replace("1.png", "../other/1.png")]);
        },
        command: CHECK,
        printed: "--data-root ",
        followed: "check --model random --levels L0 --data set --data-root @/other",
        ..ROW
    },
    Remedy {
        says: "--pairs NORMAL,LOW names any two folders",
        state: pairs,
        command: "check --model random --questions q.jsonl --pairs set",
        printed: "--pairs NORMAL,LOW names any two folders",
        followed: "check --model random --questions q.jsonl --pairs set/target,set/input",
        ..ROW
    },
    Remedy {
        says: "--normal DIR and --low DIR name any two folders, instead of PAIRS",
        state: pairs,
        command: "realism set",
        printed: "--normal DIR and --low DIR name any two folders, instead of PAIRS",
        followed: "realism --normal set/target --low set/input",
        ..ROW
    },
    Remedy {
        says: "are the folders swapped? (--ev states a drop that is meant)",
        state: pairs,
        command: "realism --normal set/input --low set/target",
        printed: "are the folders swapped? (--ev states a drop that is meant)",
        followed: "realism --normal set/target --low set/input",
        ..ROW
    },
    Remedy {
        says: "pairs of photographs have no questions",
        state: pairs,
        command: "check --model random --pairs set/target,set/input",
        printed: "--questions FILE names some about the files in normal light",
        followed: "check --model random --pairs set/target,set/input --questions q.jsonl",
        ..ROW
    },
    Remedy {
        says: "the folders make the questions of --label-folders",
        state: |bench| {
            classes(bench, 3);
            bench.file("q.jsonl", QUESTION);
        },
        command: "check --model random --levels L0 --data set --label-folders What? --questions q.jsonl",
        printed: "cannot be used: the folders make the questions of --label-folders",
        followed: "check --model random --levels L0 --data set --label-folders What?",
        ..ROW
    },
    Remedy {
        says: "must name the folder with a folder for each class",
        state: |bench| classes(bench, 3),
        command: "check --model random --levels L0 --data rooms --label-folders What?",
        printed: "--data must name the folder",
        followed: "check --model random --levels L0 --data set --label-folders What?",
        ..ROW
    },
    Remedy {
        says: "other sets are read by the names of their columns",
        state: |bench| set(bench, "q.jsonl", &[QUESTION]),
        command: "check --model random --levels L0 --data ownset:set",
        printed: "other sets are read by the names of their columns: --data set",
        followed: CHECK,
        ..ROW
    },
];

/// Messages whose remedies are not followed here.
pub(super) const UNFOLLOWED: &[Unfollowed] = &[
    Unfollowed { says: "questions in it are ignored, and those of --ask are asked", why: Why::NoRemedy },
    Unfollowed { says: "EV both images have nearly the same light", why: Why::NoRemedy },
    Unfollowed { says: "is ignored: the questions are those of --ask", why: Why::NoRemedy },
    Unfollowed {
        says: "--map {}={}",
        why: Why::Test("src/data/ready_made/tests/user_shapes.rs", "error_for_conversations_suggests_a_map"),
    },
    Unfollowed {
        says: "--skip bad={}%",
        why: Why::Test(
            "src/data/ready_made/omissions/skip_bad.rs",
            "larger_share_is_refused_with_the_flag_that_allows_it",
        ),
    },
    Unfollowed {
        says: "allows the folder that it leads to",
        why: Why::Test("tests/program/data/ready_made.rs", "outside_links_are_named_and_skipped"),
    },
    Unfollowed {
        says: "archives such as WebDataset shards (.tar) are not read",
        why: Why::Test("tests/program/data/remedies/python.rs", "shards_are_unpacked"),
    },
    Unfollowed {
        says: "which is not read; write it again, as again.parquet",
        why: Why::Test("tests/program/data/remedies/python.rs", "parquet_is_compressed_again"),
    },
    Unfollowed {
        says: "only its pointer: git lfs pull in its folder brings the file",
        why: Why::Cannot("git lfs needs the server of the repository"),
    },
];
