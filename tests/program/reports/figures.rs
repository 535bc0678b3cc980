//! `figures`: the numbers are those of the tables, the same command writes the same bytes, and what cannot be drawn is
//! said.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::process::Command;

use crate::reports::compared::Scene;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::{files, model_args, words};
use crate::support::snapshot::{lines_with, redacted};
use crate::support::tools::{skip, succeeds};

const LONG: &str = "a-model-with-a-name-of-30-characters";

/// Two runs of models, one with a long name, that answer by a script: one in light and dark, one only in the light.
fn runs() -> Scene {
    let scene = Scene::new();
    let mut lines = String::new();
    for question in 0..40 {
        for (condition, right) in [("L0", 9), ("L3-ev", 7), ("L3-noise", 5), ("L3-noise+one", 6)] {
            let answer = ["red", "brown"][question % 2];
            let reply = if question % 10 < right { answer } else { "blue" };
            let _ = writeln!(
                lines,
                "{{\"question\": \"q{question}\", \"condition\": \"{condition}\", \"reply\": \"{reply}\"}}"
            );
        }
    }
    scene.bench.file("m.jsonl", &lines);
    scene.bench.file(&format!("{LONG}.jsonl"), "{\"default\": \"red\"}");
    let line = format!(
        "--model script:m.jsonl --model script:{LONG}.jsonl --blind-model random --data frames --levels L0,L3 --llie one.onnx --llie-anyway --out run"
    );
    scene.bench.complete(&words(&line));
    scene
}

/// The rows of a `.dat` file by level, with the names of its columns.
fn data(scene: &Scene, name: &str) -> (BTreeMap<String, String>, Vec<BTreeMap<String, String>>) {
    let text = fs::read_to_string(scene.bench.path(name)).unwrap();
    let (comments, rows): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with('#'));
    let names = comments.iter().map(|line| {
        let (columns, name) = line[2..].split_once(": ").unwrap();
        let column = columns.split(',').next().unwrap().to_owned();
        (column, name.strip_suffix(", in percent").unwrap().to_owned())
    });
    let heads: Vec<&str> = rows[0].split(' ').collect();
    let rows = rows[1..].iter().map(|row| {
        heads.iter().zip(row.split(' ')).map(|(head, cell)| ((*head).to_owned(), cell.to_owned())).collect()
    });
    (names.collect(), rows.collect())
}

#[test]
fn figures_match_tables_reproducibly() {
    let scene = runs();
    for out in ["first", "second"] {
        let line = format!("figures run --out {out} --format pdf,svg,tex --columns 2");
        scene.bench.complete(&words(&line));
    }
    let made = files(&scene.bench.path("first"));
    assert!(made.len() > 15, "{made:?}");
    for file in &made {
        let [first, second] = ["first", "second"].map(|out| fs::read(scene.bench.path(out).join(file)).unwrap());
        assert_eq!(first, second, "{}", file.display());
    }
    let captions = fs::read_to_string(scene.bench.path("first/captions.txt")).unwrap();
    let long = format!("script:{LONG}.jsonl");
    let said = format!("Short names: {LONG} is {long}, m is script:m.jsonl.");
    assert!(captions.contains(&said), "{captions}");
    let summary = fs::read_to_string(scene.bench.path("run/summary.csv")).unwrap();
    let mut checked = 0;
    for (panel, variant) in [("accuracy-1", "ev"), ("accuracy-2", "noise")] {
        let (names, rows) = data(&scene, &format!("first/{panel}.dat"));
        assert_eq!(names.len(), 2);
        for row in &rows {
            for (column, model) in &names {
                let level = &*row["level"];
                let variant = if level == "L0" { "none" } else { variant };
                let start = format!("script:{model}.jsonl,image,{level},{variant},,all,strict,");
                let cells = summary.lines().find_map(|line| line.strip_prefix(&start));
                let cells: Vec<&str> = cells.unwrap().split(',').collect();
                for (place, column) in
                    [(4, column.clone()), (5, column.replace('y', "low")), (6, column.replace('y', "high"))]
                {
                    let table: f64 = cells[place].parse().unwrap();
                    let drawn: f64 = row[&column].parse().unwrap();
                    assert!((100.0 * table - drawn).abs() < 1e-9, "{start} {column}");
                    checked += 1;
                }
            }
        }
    }
    assert_eq!(checked, 24);
    let pdf = fs::read(scene.bench.path("first/paper.pdf")).unwrap();
    let has = |words: &str| pdf.windows(words.len()).any(|at| at == words.as_bytes());
    assert!(has("/FontFile2") && has("/Image") && !has("/Type3"));
    let svg = fs::read_to_string(scene.bench.path("first/paper.svg")).unwrap();
    assert!(svg.contains("(d) samples") && svg.contains("<image "), "{svg}");
    assert!(!svg.contains("95 % intervals"));
    assert!(captions.contains("(d) The frame 0.png") && captions.contains("95 % intervals"));
}

#[test]
fn names_and_widths_are_the_readers() {
    let scene = runs();
    let line = format!(
        "figures run --out out --format svg --width 85 --palette grey --only accuracy,enhancers --label script:{LONG}.jsonl=Short \
         --label one=Brighter --order script:{LONG}.jsonl --reference script:m.jsonl"
    );
    let said = scene.bench.complete(&words(&line));
    assert!(!said.contains("paper"), "{said}");
    let svg = fs::read_to_string(scene.bench.path("out/accuracy.svg")).unwrap();
    assert!(svg.contains(">Short</text>") && !svg.contains(LONG), "{svg}");
    assert!(svg.contains("width=\"240.94pt\"") && svg.contains("stroke=\"#000000\""));
    assert!(svg.find(">Short<") < svg.find(">m<"));
    let enhancers = fs::read_to_string(scene.bench.path("out/enhancers.svg")).unwrap();
    assert!(enhancers.contains(">Brighter</text>") && !enhancers.contains(">one<"));
    // The sheet of a paper has its means over the other models.
    let line = "figures run --out sheet --format svg --only paper";
    scene.bench.complete(&words(line));
    let mean = fs::read_to_string(scene.bench.path("sheet/paper.svg")).unwrap();
    assert!(mean.contains("(b) mean of 2 models"), "{mean}");
    let line = "figures run --out beside --format svg --only paper --reference script:m.jsonl";
    scene.bench.complete(&words(line));
    let beside = fs::read_to_string(scene.bench.path("beside/paper.svg")).unwrap();
    assert!(beside.contains(&format!("(b) {LONG}, raw")), "{beside}");
    // Words of others' files are text in an SVG, never marks.
    let line = "figures run --out odd --format svg --only accuracy --label";
    let label = "script:m.jsonl=<b>&\"";
    let called = scene.bench.call(&[&words(line)[..], &[label]].concat());
    assert_eq!(called.code, Some(0), "{called:?}");
    let svg = fs::read_to_string(scene.bench.path("odd/accuracy.svg")).unwrap();
    assert!(svg.contains("&lt;b&gt;&amp;") && !svg.contains("<b>"));
}

#[test]
fn unknown_names_list_the_known() {
    let scene = runs();
    let wrong = [
        ("--label nobody=A", "script:m.jsonl"),
        ("--order nobody", "script:m.jsonl"),
        ("--reference one", "script:m.jsonl"),
        ("--only accuracies", "accuracy"),
        ("--label one", "OLD=NEW"),
        ("--label one=A --label one=B", "two names"),
        ("--label script:m.jsonl=A --label random=A", "both be called"),
        ("--label script:m.jsonl=模型", "Latin and Greek"),
        ("--width nature", "millimetres"),
        ("--width neurips --columns 2", "one column"),
        ("--font-size 3", "from 4 to 24"),
    ];
    for (flags, said) in wrong {
        let called = scene.bench.call(&words(&format!("figures run --out no {flags}")));
        assert_eq!(called.code, Some(2), "{flags}: {called:?}");
        assert!(called.stderr.contains(said), "{flags}: {}", called.stderr);
    }
    assert!(!scene.bench.path("no").exists());
}

#[test]
fn single_bright_model_has_figures() {
    let scene = Scene::new();
    scene.bench.file("m.jsonl", "{\"default\": \"red\"}");
    let line = "--model script:m.jsonl --data frames --levels L0 --out run";
    scene.bench.complete(&words(line));
    let said = scene.bench.complete(&words("figures run --out out"));
    insta::assert_snapshot!(lines_with(&said, "left out"), @"
    paper, the panel models: left out, no dark image was asked
    paper, the panel variants: left out, only one variant of the light was asked
    paper, the panel enhancers: left out, no enhancer was asked
    paper, the panel samples: left out, no dark image was asked
    paper: left out, it has no panel
    accuracy: left out, the runs have no records for it
    variants: left out, the runs have no records for it
    enhancers: left out, the runs have no records for it
    families: left out, the runs have no records for it
    hallucination: left out, the runs have no records for it
    collapse: left out, the runs have no records for it
    confidence: left out, the runs have no records for it
    photographed: left out, the runs have no records for it
    thresholds: left out, the runs have no records for it
    blur_thresholds: left out, the runs have no records for it
    ");
    let captions = fs::read_to_string(scene.bench.path("out/captions.txt")).unwrap();
    assert!(captions.contains("enhancers: left out"), "{captions}");
    // With a dark level there are records, and too few of them.
    let line = "--model script:m.jsonl --data frames --levels L0,L3 --limit 2 --out few";
    scene.bench.complete(&words(line));
    let said = scene.bench.complete(&words("figures few --out out2"));
    insta::assert_snapshot!(lines_with(&said, "left out"), @"
    paper, the panel enhancers: left out, no enhancer was asked
    enhancers: left out, the runs have no records for it
    hallucination: left out, the runs have no records for it
    confidence: left out, the runs have no records for it
    photographed: left out, the runs have no records for it
    thresholds: left out, no curve has a threshold: L0 has 2 replies in 2 clusters
    blur_thresholds: left out, the runs have no records for it
    ");
    assert!(said.contains("blur_thresholds: left out, the runs have no records"), "{said}");
}

#[test]
fn sheet_names_models_not_asked() {
    let scene = Scene::new();
    for (name, more) in [("a", "--seed 0"), ("b", "--seed 1")] {
        scene.bench.file(&format!("{name}.jsonl"), "{\"default\": \"red\"}");
        let line = format!("--model script:{name}.jsonl --data frames --levels L0,L3 {more} --out {name}-run");
        scene.bench.complete(&words(&line));
    }
    let said = scene.bench.complete(&words("figures a-run b-run --only paper --out out"));
    insta::assert_snapshot!(redacted(&said), @"
    note: script:a.jsonl answers A whatever the image and the question: 20 of 20 replies to untouched images with
        another true answer. Its accuracy measures no sight.
    note: script:b.jsonl answers A whatever the image and the question: 20 of 20 replies to untouched images with
        another true answer. Its accuracy measures no sight.
    note: One answer to everything scores well: “brown” is true of 20 of 20 questions about object recognition,
        “red” is true of 20 of 20 questions about object colour. Ask without images too (--blind), and read the
        balanced accuracy.
    note: The light differs: --seed is 0 in a-run and 1 in b-run. noise stands apart as @a-run and @b-run: 10 of
        10 shared images differ.
    note: Short names: a is script:a.jsonl, b is script:b.jsonl.
    out/paper.pdf
    out/paper.svg
    out/captions.txt
    paper, the panel variants: left out, the same models were not asked in two variants
    paper, the panel enhancers: left out, no enhancer was asked
    ");
    let captions = fs::read_to_string(scene.bench.path("out/captions.txt")).unwrap();
    assert!(captions.contains("with noise @a-run") && captions.contains(" Not asked in this light: b."), "{captions}");
}

#[test]
fn open_run_figures_name_remedy() {
    let house = House::new();
    let model = MockEndpoint::start([Answer::text("one")]);
    let base = model.base_url();
    let called = house.call(&model_args(&base, "--levels L0 --out run"));
    assert_eq!(called.code, Some(0), "{called:?}");
    let called = house.0.call(&words("figures run --out out"));
    assert_eq!(called.code, Some(2), "{called:?}");
    let said = &called.stderr;
    insta::assert_snapshot!(redacted(said), @"
    error: run: the run asked open questions: figures draws runs of questions with choices; `report` draws the
        figures of these
    ");
}

/// A document of the width of a column with all sources of a folder.
fn document(width: f64) -> String {
    format!(
        "\\documentclass[10pt]{{article}}\n\\usepackage{{mathptmx,booktabs,graphicx,pgfplots}}\n\
         \\usepgfplotslibrary{{groupplots,fillbetween}}\\pgfplotsset{{compat=1.17}}\n\
         \\setlength{{\\textwidth}}{{{width}pt}}\\setlength{{\\columnwidth}}{{{width}pt}}\\hsize={width}pt\n\
         \\begin{{document}}\n\\noindent\\includegraphics{{accuracy.pdf}}\\clearpage\n\\input{{tables.tex}}\\clearpage\n\
         \\noindent\\input{{accuracy.tex}}\n\\end{{document}}\n"
    )
}

#[test]
fn tex_fits_its_columns() {
    // Packages that `document` loads, and the metrics of its font.
    let files = ["mathptmx.sty", "booktabs.sty", "graphicx.sty", "pgfplots.sty", "ptmr8t.tfm"];
    if !succeeds("pdflatex", &["--version"]) || !succeeds("kpsewhich", &files) {
        skip("there is no pdflatex with mathptmx, booktabs, graphicx and pgfplots");
        return;
    }
    let scene = runs();
    for (venue, columns, width) in
        [("acl", 1, 219.1), ("cvpr", 1, 237.1), ("ieee", 1, 252.0), ("neurips", 1, 397.5), ("ieee", 2, 516.0)]
    {
        let out = format!("{venue}{columns}");
        let line = format!("figures run --out {out} --format pdf,tex --width {venue} --columns {columns}");
        scene.bench.complete(&words(&line));
        scene.bench.file(&format!("{out}/paper.tex"), document(width));
        let mut log = String::new();
        // The legend is placed in the second pass.
        for _ in 0..2 {
            let mut tex = Command::new("pdflatex");
            tex.args(["-interaction=nonstopmode", "paper.tex"]).current_dir(scene.bench.path(&out));
            let said = tex.output().unwrap();
            assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stdout));
            log = String::from_utf8_lossy(&said.stdout).into_owned();
        }
        for wrong in ["Overfull \\hbox", "Float too large", "PDF inclusion"] {
            assert!(!log.contains(wrong), "{out}: {wrong}\n{log}");
        }
    }
}
