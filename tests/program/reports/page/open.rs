//! The page of open questions.

use serde_json::json;

use super::{SAID, browser, count};
use crate::support::browser::Browser;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::snapshot::redacted;

#[test]
fn open_page_works_in_browser() {
    let Some(mut browser) = browser() else {
        return;
    };
    let house = House::new();
    let markup = "</script><img src=x onerror=alert(1)>\u{202e}dna.\u{0}";
    let replies = [
        json!({"question": "q1", "reply": markup}),
        json!({"question": "q2", "condition": "L4-noise", "reply": "in the dark"}),
        json!({"default": "a sofa"}),
    ];
    house.0.file("said.jsonl", replies.map(|line| format!("{line}\n")).concat());
    let mark = |prompt: &str| {
        if prompt.ends_with("in the dark") { "1" } else { "5" }
    };
    let judge = MockEndpoint::answering(move |request| {
        let prompt = request["messages"][0]["content"].as_str().unwrap_or_default();
        Answer::text(mark(prompt))
    });
    let base = judge.base_url();
    let called =
        house.call(&["--model", SAID, "--judge", "j", "--judge-base-url", &base, "--levels", "L0,L4", "--out", "run"]);
    assert_eq!(called.code, Some(0), "{called:?}");
    let url = format!("file://{}", house.0.path("run/report.html").display());
    browser.window(1200, 900, "light");
    browser.go(&url);
    browser.wait("document.documentElement?.dataset.ready === 'true'");
    // At first, what the model got wrong at the darkest level.
    assert_eq!(count(&mut browser), "1 of 3 items");
    assert_eq!(browser.evaluate("location.hash"), "");
    browser.choose("#f-state", "all");
    assert_eq!(count(&mut browser), "3 of 3 items");
    browser.shot("open.png", true);
    open_item(&mut browser, &url);
    // One question has a lower mark in the dark.
    browser.choose("#f-state", "lower than at L0 for any model");
    assert_eq!(count(&mut browser), "1 of 3 items");
    let item = "document.querySelector('#i-id').textContent.split(' ')[0]";
    assert_eq!(browser.evaluate(item), "q2");
    browser.choose("#f-light", "with noise");
    browser.choose("#f-level", "L4");
    for (state, items) in [("lower than at L0", 1), ("mark below 5", 1), ("mark 5", 2), ("higher than at L0", 0)] {
        browser.choose("#f-state", state);
        assert_eq!(count(&mut browser), format!("{items} of 3 items"), "{state}");
    }
    browser.choose("#f-state", "all");
    browser.choose("#f-family", "world knowledge");
    assert_eq!(count(&mut browser), "1 of 3 items");
    assert_eq!(browser.evaluate(item), "q3");
    assert_eq!(browser.complaints(&url), Vec::<String>::new());
}

/// The address names an item: its right answers, the answers of all models, and what the judge said are there, and
/// nothing in an answer is taken for markup.
fn open_item(browser: &mut Browser, url: &str) {
    browser.go("about:blank");
    browser.go(&format!("{url}#item=q1&model={SAID}&light=untouched&level=L0"));
    browser.wait("document.documentElement?.dataset.ready === 'true'");
    let revealed = "</script><img src=x onerror=alert(1)>⟨U+202E⟩dna.⟨U+0000⟩";
    let text = |browser: &mut Browser, of: &str| {
        let text = browser.evaluate(&format!("document.querySelector('{of}').textContent"));
        text.as_str().unwrap().to_owned()
    };
    assert_eq!(text(browser, "#r-text"), revealed);
    insta::assert_snapshot!(redacted(&text(browser, "#i-answers")), @"
    All answersmodelshownmarkanswersaidL0✓ 5/5</script><img src=x
        onerror=alert(1)>⟨U+202E⟩dna.⟨U+0000⟩saidL4-noise✓ 5/5</script><img src=x
        onerror=alert(1)>⟨U+202E⟩dna.⟨U+0000⟩
    ");
    assert_eq!(text(browser, "#r-mark"), "✓ 5/5, mark 5 of 5");
    assert_eq!(text(browser, "#r-judge"), "5");
    assert_eq!(text(browser, "#i-choices"), "right: brown ✓");
    let rows = "[...document.querySelectorAll('#i-answers tbody tr')].map((r) => r.children[1].textContent)";
    assert_eq!(browser.evaluate(rows), json!(["L0", "L4-noise"]));
    let images = "document.querySelectorAll('#i-images .whole').length";
    assert_eq!(browser.evaluate(images), 1);
    browser.press("]");
    assert_eq!(browser.evaluate(images), 2);
    browser.evaluate("location.hash = 'item=q2'");
    browser.wait("document.querySelector('#i-id').textContent.startsWith('q2 ')");
    assert!(text(browser, "#i-choices").starts_with("right: Near the café's door ✓also right: By the stairs ✓"));
    browser.evaluate("location.hash = ''");
}
