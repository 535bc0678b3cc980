//! Draws of the noise, and halves of the combinations.
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, records, words};
use crate::support::snapshot::on_one_line;
use serde_json::Value;

const NOISE: &str = "--data set.jsonl --levels L0,L2,L5 --variant ev,noise";

/// The digests of the images sent in each condition of a run.
fn images(bench: &Bench, run: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut images = BTreeMap::<String, BTreeSet<String>>::new();
    for record in records(&bench.path(run)) {
        let condition = record["condition"].as_str().unwrap().to_owned();
        images.entry(condition).or_default().insert(record["image"]["digest"].to_string());
    }
    images
}

#[test]
fn a_draw_has_the_images_of_the_next_seed() {
    let bench = Bench::with_questions(2);
    let run = |more: &str| bench.complete(&[words(NOISE), words("--model random"), words(more)].concat());
    run("--noise seeds=3 --seed 5 --out draws");
    run("--seed 5 --out five");
    run("--seed 7 --out seven");
    let [draws, five, seven] = ["draws", "five", "seven"].map(|name| images(&bench, name));
    let all = "L0 L2-ev L2-noise L2-noise~1 L2-noise~2 L5-ev L5-noise L5-noise~1 L5-noise~2";
    assert_eq!(draws.keys().map(String::as_str).collect::<Vec<_>>(), words(all));
    for (condition, image) in &five {
        assert_eq!(draws[condition], *image, "{condition}");
    }
    for level in ["L2", "L5"] {
        let other = &draws[&format!("{level}-noise~2")];
        assert_eq!(*other, seven[&format!("{level}-noise")]);
        assert!(other.is_disjoint(&draws[&format!("{level}-noise")]), "each draw is another image");
    }
}

#[test]
fn draws_are_added_to_a_run_and_nothing_is_asked_twice() {
    let bench = Bench::with_questions(6);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let model = format!("--model m --base-url {} --out run", mock.base_url());
    let run = |more: &str| bench.complete(&[words(NOISE), words(&model), words(more)].concat());
    run("");
    assert_eq!(mock.requests().len(), 6 * 5);
    let out = run("--noise seeds=3 --findings");
    assert_eq!(mock.requests().len(), 6 * (5 + 2 * 2), "two further draws of two levels");
    assert!(on_one_line(&out).contains("1 wording, 1 order, 3 draws"), "{out}");
    run("--noise seeds=3");
    assert_eq!(mock.requests().len(), 6 * 9);
    // The reply at L0 is compared with three draws, and counts once.
    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    let mut table = csv::Reader::from_reader(csv.as_bytes());
    let heads = table.headers().unwrap().clone();
    let at = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    let n = |level: &str, variant: &str| {
        let row = rows.iter().find(|row| {
            row[at("model")] == *"m"
                && row[at("level")] == *level
                && row[at("variant")] == *variant
                && row[at("family")] == *"all"
                && row[at("mode")] == *"strict"
        });
        row.unwrap()[at("n")].to_owned()
    };
    assert_eq!([n("L0", "none"), n("L5", "ev"), n("L5", "noise")], ["6", "6", "18"]);
    let differences = fs::read_to_string(bench.path("run/variation_differences.csv")).unwrap();
    assert!(differences.lines().any(|line| line.contains("L5-noise") && line.contains("L0") && line.contains(",18,")));
    let parquet = bench.path("run/records.parquet");
    assert!(parquet.exists());
}

#[test]
fn half_of_the_combinations_are_asked_and_the_rest_later() {
    let bench = Bench::with_questions(6);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let model = format!("--model m --base-url {} --out run", mock.base_url());
    let several = "--prompts paper --prompts terse --prompts letter --choice-order shuffle=2 --noise seeds=2";
    let run = |more: &str| {
        let args = [words("--data set.jsonl --levels L0,L5 --variant noise"), words(&model), words(several)];
        bench.complete(&[args.concat(), words(more)].concat())
    };
    run("--design half");
    let asked = |records: &[Value]| {
        let mut asked = BTreeMap::<(String, String), BTreeSet<(String, u64)>>::new();
        for record in records {
            let [question, condition, wording] =
                ["question", "condition", "wording"].map(|field| record[field].as_str().unwrap().to_owned());
            let order = record["order"].as_u64().unwrap_or(0);
            assert!(asked.entry((question, condition)).or_default().insert((wording, order)), "asked twice");
        }
        asked
    };
    let half = asked(&records(&bench.path("run")));
    let questions: BTreeSet<&String> = half.keys().map(|(question, _)| question).collect();
    for question in questions {
        let of = |condition: &str| &half[&(question.clone(), condition.to_owned())];
        let (first, second) = (of("L5-noise"), of("L5-noise~1"));
        assert_eq!(first.len() + second.len(), 6, "half of 3 × 2 × 2");
        assert_eq!((first.len(), second.len()), (3, 3));
        assert_eq!(*of("L0"), first | second, "L0 is asked as in the dark, once");
    }
    let before = mock.requests().len();
    run("");
    let all = asked(&records(&bench.path("run")));
    assert!(all.values().all(|combinations| combinations.len() == 6));
    assert_eq!(mock.requests().len(), 6 * 6 * 3);
    assert!(before < mock.requests().len());
}

/// Each command is refused with a remedy, and runs with it.
#[test]
fn remedies_of_refused_wordings_and_draws_work() {
    let bench = Bench::with_questions(2);
    for name in ["one", "two"] {
        fs::create_dir(bench.path(name)).unwrap();
        let text = format!(
            "{name}: {{{{ question }}}}\n{{% for c in choices %}}{{{{ c.letter }}}} {{{{ c.text }}}}\n{{% endfor %}}"
        );
        fs::write(bench.path(name).join("choice.txt"), text).unwrap();
    }
    let run = |more: &str| bench.call(&[words(NOISE), words("--model random --out run"), words(more)].concat());
    for (wrong, said, right) in [
        ("--prompts one --prompts two", "--prompts NAME=one", "--prompts NAME=one --prompts b=two"),
        ("--prompts a=one --prompts a=two", "name each differently", "--prompts a=one --prompts b=two"),
        ("--prompts paper --prompts x=one --prompts y=one", "leave one of them out", "--prompts paper --prompts x=one"),
        ("--prompts ters", "paper, terse, letter", "--prompts terse"),
    ] {
        let refused = run(wrong);
        assert!(refused.code == Some(2) && refused.stderr.contains(said), "{}", refused.stderr);
        assert_eq!(run(right).code, Some(0), "{right}");
        fs::remove_dir_all(bench.path("run")).unwrap();
    }
}

#[test]
fn draws_are_refused_where_they_cannot_be_made_or_compared() {
    let bench = Bench::with_questions(2);
    fs::create_dir(bench.path("photos")).unwrap();
    image::RgbImage::from_pixel(64, 48, image::Rgb([90, 120, 60])).save(bench.path("photos/a.png")).unwrap();
    let ask = "--data photos --ask home --model random --levels L0,L5 --variant noise --out a";
    let refused = bench.call(&words(&format!("{ask} --noise seeds=2")));
    assert_eq!(refused.code, Some(2), "{refused:?}");
    let said = refused.stderr;
    assert!(said.contains("--noise seeds") && said.contains("leave seeds out"), "{said}");
    assert_eq!(bench.call(&words(ask)).code, Some(0));
    let idle =
        bench.call(&words("--data set.jsonl --levels L0,L5 --variant ev --model random --noise seeds=2 --out b"));
    assert!(idle.stderr.contains("--noise seeds: no effect: no image has noise"), "{}", idle.stderr);
    let idle = bench.call(&words("--data set.jsonl --levels L0 --model random --design half --out c"));
    let expected = "--repeats design: no effect: every question is asked in one wording, order and draw";
    assert!(idle.stderr.contains(expected), "{}", idle.stderr);
}
