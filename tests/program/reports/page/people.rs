//! The pages on which people answer.

use serde_json::{Value, json};

use super::browser;
use crate::support::house::House;
use crate::support::run::{Bench, words};

#[test]
fn people_can_answer() {
    let Some(mut browser) = browser() else {
        return;
    };
    let bench = Bench::with_questions(6);
    bench.complete(&words("--model random --data set.jsonl --levels L0,L3 --out run"));
    bench.complete(&["study", "pack", "run", "--out", "pack"]);
    let url = format!("file://{}", bench.path("pack/study.html").display());
    browser.window(1200, 800, "light");
    browser.go(&url);
    browser.wait("document.querySelector('#image')?.naturalWidth > 0");
    let place = "document.querySelector('#count').textContent";
    assert_eq!(browser.evaluate(place), "0 of 6");
    browser.press("c");
    browser.press("0");
    browser.click("#choices button:nth-child(2)");
    assert_eq!(browser.evaluate(place), "3 of 6");
    browser.shot("study.png", false);
    let answers = browser.evaluate("Object.values(answers).map(a => a.answer)");
    let mut answers: Vec<Value> = answers.as_array().unwrap().clone();
    answers.sort_by_key(ToString::to_string);
    assert_eq!(answers, [json!("B"), json!("C"), Value::Null]);
    // One frame: a person sees it in one condition alone, the next person in the next.
    let seen = "[...new Set(Object.values(answers).map(a => a.condition))]";
    assert_eq!(browser.evaluate(seen), json!(["L0"]));
    browser.evaluate(
        "(() => { const p = document.querySelector('#person'); p.value = 2; p.dispatchEvent(new Event('change')); })()",
    );
    assert_eq!(browser.evaluate(place), "0 of 6");
    browser.press("A");
    assert_eq!(browser.evaluate(seen), json!(["L3-ev"]));
    // What was answered is there after the page was left. It is left for another first: a browser that is busy may load
    // a page again before it has stored what the old one wrote.
    browser.go("about:blank");
    browser.wait("location.href === 'about:blank'");
    browser.go(&url);
    browser.wait("document.querySelector('#count')?.textContent === '3 of 6'");
    let images = format!("{}/images/", bench.path("pack").display());
    let strange: Vec<String> = browser.complaints(&url).into_iter().filter(|url| !url.contains(&images)).collect();
    assert_eq!(strange, Vec::<String>::new());
}

#[test]
fn people_may_answer_freely() {
    let Some(mut browser) = browser() else {
        return;
    };
    let house = House::new();
    let called = house.call(&["--study", "study", "--levels", "L0,L4"]);
    assert_eq!(called.code, Some(0), "{called:?}");
    let url = format!("file://{}", house.0.path("study/study.html").display());
    browser.window(1200, 800, "light");
    browser.go(&url);
    browser.wait("document.querySelector('#image')?.naturalWidth > 0");
    let frame = "document.querySelector('#place').textContent";
    assert!(browser.evaluate(frame).as_str().unwrap().starts_with("1 / "));
    browser.click("#play");
    browser.wait("document.querySelector('#place').textContent.startsWith('2 / ')");
    browser.click("#play");
    browser.evaluate("document.querySelector('#answer').value = ' by the door '");
    browser.click("#say");
    browser.shot("open-study.png", false);
    browser.click("#none");
    let place = "document.querySelector('#count').textContent";
    assert_eq!(browser.evaluate(place), "2 of 3");
    let saved = browser
        .evaluate("JSON.stringify(order.filter((i) => items[i].id in answers).map((i) => answers[items[i].id]))");
    // What the page saves is what the program takes.
    house.0.file("answers.json", saved.as_str().unwrap());
    house.0.file("j.jsonl", "{\"default\": \"5\"}");
    let called = house.call(&words("--answers human=answers.json --judge script:j.jsonl --out run"));
    insta::assert_snapshot!(called.lines_with("answer"), @r#"
    exit code: 0
    2 of 2 answers scored
    1 without an answer (none in a file, only thoughts, no "A:" of a blind model):
    "#);
    let images = format!("{}/images/", house.0.path("study").display());
    let strange: Vec<String> = browser.complaints(&url).into_iter().filter(|url| !url.contains(&images)).collect();
    assert_eq!(strange, Vec::<String>::new());
}
