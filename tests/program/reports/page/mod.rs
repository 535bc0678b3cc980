//! The HTML report in a real browser.
//!
//! Needs Chromium or Chrome (`CHROME`, or on the path); where there is none, the test says so and does nothing. With
//! `SHOTS=DIR` it leaves pictures of the page for people to look at.

mod access;
mod open;
mod people;
mod trial;

use crate::support::browser::{Browser, chromium};
use crate::support::run::{Bench, words};
use crate::support::tools::skip;
use serde_json::{Value, json};

/// The model that says what it is told.
const SAID: &str = "script:said.jsonl";
const WIDEST_CHART: &str = "Math.max(...[...document.querySelectorAll('.panel svg')].map((s) => s.clientWidth))";

/// Replies that would break a page which trusted them.
fn hostile() -> String {
    let markup = "</script><script>document.title='owned'</script><img src=x onerror=alert(1)>";
    let turned = "A\u{202e}evitcele\u{202c}\u{200b}";
    let lines = [
        json!({"question": "q0", "reply": markup}),
        json!({"question": "q1", "reply": turned}),
        json!({"question": "q2", "reply": "x".repeat(1_000_000)}),
        json!({"question": "q3", "condition": "L5-noise", "reply": "A"}),
        json!({"default": "C"}),
    ];
    lines.map(|line| format!("{line}\n")).concat()
}

/// A browser, where there is one.
fn browser() -> Option<Browser> {
    let program = chromium();
    if program.is_none() {
        skip("there is no Chromium; CHROME names one that is not on PATH");
    }
    Some(Browser::open(&program?))
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(mut browser) = browser() else {
        return;
    };
    let bench = Bench::with_questions(40);
    bench.file("said.jsonl", hostile());
    let line = format!("--data set.jsonl --model {SAID} --model random --blind-model random --out run");
    let called = bench.call(&words(&line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let url = format!("file://{}", bench.path("run/report.html").display());

    browser.window(1400, 900, "light");
    browser.go(&url);
    browser.wait("document.documentElement?.dataset.ready === 'true'");
    // Without a link the page opens at its top.
    assert_eq!(browser.evaluate("window.scrollY"), 0);
    // Nothing is written to the address before a person acts.
    assert_eq!(browser.evaluate("location.hash"), "");
    first_screen(&mut browser);
    charts(&mut browser, &bench);
    browser.shot("light.png", true);
    filters(&mut browser);
    slider(&mut browser);
    keyboard(&mut browser);
    hostile_replies(&mut browser);
    points(&mut browser);
    deep_link(&mut browser, &url);
    themes(&mut browser);
    narrow(&mut browser, &url);
    paper(&mut browser);
    assert!(browser.print("page.pdf") > 10_000);
    assert_eq!(browser.complaints(&url), Vec::<String>::new());
}

/// The first screen has the finding about darkness, a chart, and a frame with the answers of the model on it; the one
/// wrong answer is marked where it was given.
fn first_screen(browser: &mut Browser) {
    assert_eq!(browser.evaluate("document.querySelector('h1').textContent"), format!("{SAID} in the dark"));
    let texts = |selector: &str| format!("[...document.querySelectorAll('{selector}')].map(e => e.textContent)");
    let groups = browser.evaluate(&texts(".first-findings th"));
    assert_eq!(groups, json!(["Threshold", "Darkness", "Noise", "Without images", "Sample"]));
    assert_eq!(browser.evaluate("document.querySelectorAll('#figure-head .panel svg').length"), 1);
    let levels = browser.evaluate(&texts(".strip thead th"));
    assert_eq!(levels, json!(["treatment", "L0", "L1", "L2", "L3", "L4", "L5"]));
    let wrong = browser.evaluate(&texts(".strip .answer.wrong"));
    assert_eq!(wrong, json!(["✗ red"]));
    let facts = browser.evaluate("document.querySelector('#facts').textContent");
    let facts = facts.as_str().unwrap();
    for part in ["noise profile paper", "--noise camera", "--stop failures"] {
        assert!(facts.contains(part), "{part}: {facts}");
    }
}

fn count(browser: &mut Browser) -> Value {
    browser.evaluate("document.querySelector('#f-count').textContent")
}

/// Level and light of the items are those that some model was asked at: the one that was not chosen follows.
fn level_follows_light(browser: &mut Browser) {
    let shown = |browser: &mut Browser| {
        browser.evaluate("['level', 'light'].map(name => document.querySelector('#f-' + name).value)")
    };
    assert_eq!(shown(browser), json!(["L0", "untouched"]));
    browser.choose("#f-light", "with noise");
    assert_eq!(shown(browser), json!(["L5", "with noise"]));
    browser.choose("#f-level", "L4");
    assert_eq!(shown(browser), json!(["L4", "with noise"]));
    // Nothing is asked at L0 with noise.
    browser.choose("#f-level", "L0");
    assert_eq!(shown(browser), json!(["L0", "untouched"]));
    browser.choose("#f-light", "blind");
    assert_eq!(shown(browser), json!(["–", "blind"]));
    browser.choose("#f-light", "untouched");
}

fn filters(browser: &mut Browser) {
    let model = browser.evaluate("document.querySelector('#f-model').options[1].value");
    assert_eq!(model, SAID);
    // The items open at a model that is no reference, raw images of the darkest level, and what it got wrong there.
    let opened = "['model', 'light', 'level', 'state'].map(name => document.querySelector('#f-' + name).value)";
    assert_eq!(browser.evaluate(opened), json!([SAID, "with noise", "L5", "wrong"]));
    assert_eq!(count(browser), "1 of 40 items");
    // They follow the findings, before all tables.
    let order =
        browser.evaluate("[...document.querySelectorAll('main > section')].slice(0, 2).map(section => section.id)");
    assert_eq!(order, json!(["findings", "items"]));
    browser.choose("#f-state", "all");
    browser.choose("#f-model", "random");
    browser.choose("#f-light", "untouched");
    level_follows_light(browser);
    browser.choose("#f-model", SAID);
    assert_eq!(count(browser), "40 of 40 items");
    // The markup, the turned letters and the long reply cannot be read; everything else is right.
    browser.choose("#f-state", "not read");
    assert_eq!(count(browser), "3 of 40 items");
    browser.choose("#f-state", "wrong");
    assert_eq!(count(browser), "0 of 40 items");
    // A combination without items cannot be chosen: only one reply is wrong, at the darkest level with noise.
    let possible = |browser: &mut Browser, filter: &str| {
        browser.evaluate(&format!(
            "[...document.querySelector('#f-{filter}').options].filter(o => !o.disabled).map(o => o.textContent)"
        ))
    };
    assert_eq!(possible(browser, "level"), json!(["L0 (0)", "L5"]));
    assert_eq!(possible(browser, "light"), json!(["untouched (0)", "with noise"]));
    assert_eq!(possible(browser, "state"), json!(["all", "right", "wrong (0)", "not read", "models differ"]));
    assert_eq!(possible(browser, "family"), json!(["all (0)"]));
    browser.choose("#f-light", "with noise");
    browser.choose("#f-level", "L5");
    assert_eq!(count(browser), "1 of 40 items");
    browser.choose("#f-state", "lost since L0");
    assert_eq!(count(browser), "1 of 40 items");
    assert_eq!(browser.evaluate("document.querySelector('#i-id').textContent.split(' ')[0]"), "q3");
    // Held against another subject, item by item.
    browser.choose("#f-against", &format!("{SAID} L4-ev"));
    browser.choose("#f-state", "wrong here, right there");
    assert_eq!(count(browser), "1 of 40 items");
    browser.choose("#f-state", "right here, wrong there");
    assert_eq!(count(browser), "0 of 40 items");
    browser.choose("#f-state", "another answer there");
    assert_eq!(count(browser), "1 of 40 items");
    browser.choose("#f-against", "–");
    browser.choose("#f-state", "all");
    browser.choose("#f-family", "color");
    assert_eq!(count(browser), "40 of 40 items");
    browser.evaluate(
        "(() => { const w = document.querySelector('#f-words'); w.value = 'is it, 17?'; w.dispatchEvent(new Event('input')); })()",
    );
    assert_eq!(count(browser), "1 of 40 items");
    browser.shot("filtered.png", false);
    browser.evaluate(
        "(() => { const w = document.querySelector('#f-words'); w.value = ''; w.dispatchEvent(new Event('input')); })()",
    );
    assert_eq!(count(browser), "40 of 40 items");
}

/// Charts are in the page without its script, which shows and hides their lines; the values at their cursor are those of
/// the tables.
fn charts(browser: &mut Browser, bench: &Bench) {
    let first = "document.querySelector('#figure-accuracy')";
    let written = std::fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(written.matches("<svg viewBox=").count() > 10 && written.contains("<title>92.5 ["));
    // The built-in model is off at first, as there is another.
    let pressed =
        "[...document.querySelectorAll('#models button')].map(b => [b.title, b.getAttribute('aria-pressed')])";
    assert_eq!(browser.evaluate(pressed), json!([["random", "false"], [SAID, "true"]]));
    let rows = format!("[...{first}.querySelectorAll('.values tbody tr')].map(r => r.firstChild.title)");
    assert_eq!(browser.evaluate(&rows), json!([SAID, "chance"]));
    let curves = format!(
        "[...{first}.querySelectorAll('.panel:first-child .curve')].filter(c => getComputedStyle(c).display !== 'none').map(c => c.dataset.line)"
    );
    assert_eq!(browser.evaluate(&curves), json!([SAID]));
    browser.evaluate("document.querySelector('#models button[title=random]').click()");
    assert_eq!(browser.evaluate(&rows), json!([SAID, "random (reference)", "random without images", "chance"]));
    assert_eq!(browser.evaluate(&curves), json!([SAID, "random (reference)"]));
    let csv = std::fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    let csv: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| csv[0].iter().position(|head| *head == name).unwrap();
    for (place, level) in ["L0", "L1", "L2", "L3", "L4", "L5"].into_iter().enumerate() {
        browser.evaluate(&format!(
            "(() => {{ const s = {first}.querySelector('.cursor input'); s.value = {place}; s.dispatchEvent(new Event('input')); }})()"
        ));
        let cursors = format!(
            "[...{first}.querySelectorAll('.cursor-line')].filter(c => getComputedStyle(c).visibility === 'visible').map(c => c.dataset.level)"
        );
        assert_eq!(browser.evaluate(&cursors), json!([level, level]));
        let cell = format!("{first}.querySelector('.values tbody tr[data-line^=random] td:last-child').textContent");
        let shown = browser.evaluate(&cell);
        let kind = if level == "L0" { "none" } else { "noise" };
        let row = csv.iter().find(|row| {
            row[column("model")] == "random"
                && row[column("level")] == level
                && row[column("variant")] == kind
                && row[column("family")] == "all"
                && row[column("enhancer")].is_empty()
        });
        let row = row.unwrap_or_else(|| panic!("{level}: {csv:?}"));
        let percent = |name: &str| format!("{:.1}", 100.0 * row[column(name)].parse::<f64>().unwrap());
        let expected = format!("{} [{}, {}]", percent("value"), percent("low"), percent("high"));
        assert_eq!(shown, expected, "{level}");
    }
    pointer(browser);
    browser.evaluate("document.querySelector('#models button[title=random]').click()");
    browser.shot("charts.png", true);
}

/// The pointer moves the cursor to the nearest level, and the legend hides a line in all panels.
fn pointer(browser: &mut Browser) {
    let level = "document.querySelector('#figure-accuracy .cursor output').textContent";
    assert_eq!(browser.evaluate(level), "L5 (9 EV)");
    browser.evaluate(
        "(() => { const s = document.querySelector('#figure-accuracy .panel svg'), r = s.getBoundingClientRect(); \
         s.dispatchEvent(new PointerEvent('pointermove', { clientX: r.left + r.width * 0.5, clientY: r.top + 20 })); })()",
    );
    assert_eq!(browser.evaluate(level), "L2 (4 EV)");
    let hidden = "document.querySelectorAll('#figure-accuracy [data-line=chance].off').length";
    assert_eq!(browser.evaluate(hidden), 0);
    browser.click("#figure-accuracy .swatch[data-line=chance]");
    assert_eq!(browser.evaluate(hidden), 2, "one in each panel");
    browser.click("#figure-accuracy .swatch[data-line=chance]");
    assert_eq!(browser.evaluate(hidden), 0);
}

/// A point of a chart leads to the items behind it, and the address names them.
fn points(browser: &mut Browser) {
    let link = "document.querySelector('#figure-accuracy [data-light=\"with noise\"] .to-items[data-level=L5]')";
    browser.choose("#f-level", "L0");
    browser.choose("#f-state", "wrong");
    browser.evaluate(&format!("{link}.dispatchEvent(new MouseEvent('click', {{ bubbles: true, cancelable: true }}))"));
    browser.wait("document.querySelector('#f-level').value === 'L5'");
    let chosen = |of: &str| format!("document.querySelector('#f-{of}').value");
    assert_eq!(browser.evaluate(&chosen("model")), SAID);
    assert_eq!(browser.evaluate(&chosen("light")), "with noise");
    assert_eq!(browser.evaluate(&chosen("state")), "all");
    assert_eq!(count(browser), "40 of 40 items");
    let hash = browser.evaluate("location.hash");
    assert!(hash.as_str().unwrap().contains("level=L5"), "{hash}");
}

fn slider(browser: &mut Browser) {
    let shown = "[...document.querySelectorAll('#i-images figcaption')].map(c => c.textContent.split(';')[0])";
    browser.press("[");
    let images = browser.evaluate(shown);
    assert_eq!(images, json!(["L0", "L4-ev", "L4-noise"]));
    assert_eq!(browser.evaluate("document.querySelector('#f-level').value"), "L4");
    let crop = browser.evaluate("document.querySelector('#i-images figure:nth-child(2) figcaption').textContent");
    assert_eq!(crop, "L4-ev; below, its middle, light × 181 (7.5 EV)");
    let loaded = "[...document.querySelectorAll('#i-images img')].every(i => i.complete && i.naturalWidth > 0)";
    browser.wait(loaded);
    browser.evaluate(
        "(() => { const s = document.querySelector('#i-level'); s.value = 0; s.dispatchEvent(new Event('input')); })()",
    );
    assert_eq!(browser.evaluate(shown), json!(["L0"]));
    // All images zoom together, by button and by key; never farther than the whole.
    let zoom = "document.querySelector('#i-zoom').textContent";
    assert_eq!(browser.evaluate(zoom), "1 ×");
    browser.click("#i-in");
    assert_eq!(browser.evaluate(zoom), "1.6 ×");
    browser.click("#i-out");
    browser.click("#i-out");
    assert_eq!(browser.evaluate(zoom), "1 ×");
}

fn keyboard(browser: &mut Browser) {
    let item = "document.querySelector('#i-id').textContent.split(' ')[0]";
    browser.evaluate("document.querySelector('#list button').click()");
    let first = browser.evaluate(item);
    browser.press("j");
    let second = browser.evaluate(item);
    assert_ne!(first, second);
    browser.press("k");
    assert_eq!(browser.evaluate(item), first);
    browser.press("k");
    assert_eq!(browser.evaluate(item), first, "there is none before the first");
    browser.click("#next");
    assert_eq!(browser.evaluate(item), second);
}

fn hostile_replies(browser: &mut Browser) {
    let open = |browser: &mut Browser, id: &str| {
        browser.evaluate(&format!("location.hash = 'item={id}&model={SAID}&light=untouched&level=L0'"));
        browser.wait(&format!("document.querySelector('#i-id').textContent.startsWith('{id} ')"));
        browser.evaluate("document.querySelector('#r-text').textContent")
    };
    let markup = open(browser, "q0");
    assert!(markup.as_str().unwrap().starts_with("</script><script>"), "{markup}");
    browser.shot("hostile.png", false);
    let turned = open(browser, "q1");
    assert_eq!(turned, "A⟨U+202E⟩evitcele⟨U+202C⟩⟨U+200B⟩");
    let long = open(browser, "q2");
    let long = long.as_str().unwrap();
    assert!(long.contains("cut here after 20000 of 1000000 characters"));
    assert!(long.len() < 21_000);
    assert_ne!(browser.evaluate("document.title"), "owned");
    assert_eq!(browser.evaluate("document.querySelectorAll('script:not([type])').length"), 1);
}

fn deep_link(browser: &mut Browser, url: &str) {
    browser.go("about:blank");
    browser.go(&format!("{url}#item=q3&model={SAID}&light=with%20noise&level=L5&show=wrong"));
    browser.wait("document.documentElement?.dataset.ready === 'true'");
    assert_eq!(count(browser), "1 of 40 items");
    assert_eq!(browser.evaluate("window.scrollY > 0"), true);
    let title = browser.evaluate("document.querySelector('#r-title').textContent");
    assert_eq!(title, format!("Reply of {SAID} at L5-noise"));
    let reading = browser.evaluate("document.querySelector('#r-reading').textContent");
    assert_eq!(reading, "strict parsing: A · lenient: A");
    let mark = browser.evaluate("document.querySelector('#r-mark').textContent");
    assert_eq!(mark, "✗ A, wrong");
    // A link to nowhere shows the page all the same.
    browser.go("about:blank");
    browser.go(&format!("{url}#item=%zz&model=nobody"));
    browser.wait("document.documentElement?.dataset.ready === 'true'");
    assert_eq!(count(browser), "40 of 40 items");
}

fn themes(browser: &mut Browser) {
    let ground = "getComputedStyle(document.body).backgroundColor";
    let light = browser.evaluate(ground);
    assert_eq!(light, "rgb(255, 255, 255)");
    browser.press("t");
    let dark = browser.evaluate(ground);
    assert_eq!(dark, "rgb(20, 23, 27)");
    let words = "getComputedStyle(document.querySelector('.panel text')).fill";
    assert_eq!(browser.evaluate(words), "rgb(230, 233, 237)", "figures have the theme's ink");
    browser.shot("dark.png", true);
    browser.click("#theme");
    assert_eq!(browser.evaluate(ground), light);
    browser.window(1400, 900, "dark");
    browser.evaluate("delete document.documentElement.dataset.theme");
    assert_eq!(browser.evaluate(ground), dark, "the system's theme is the first one");
    browser.call("Emulation.setEmulatedMedia", &json!({"media": "print"}));
    assert_eq!(browser.evaluate(ground), light, "paper is white");
    browser.call("Emulation.setEmulatedMedia", &json!({"media": ""}));
}

fn narrow(browser: &mut Browser, url: &str) {
    browser.window(390, 844, "light");
    browser.go("about:blank");
    browser.go(url);
    browser.wait("document.documentElement?.dataset.ready === 'true'");
    let wide = "document.documentElement.scrollWidth";
    let wide = browser.evaluate(wide);
    assert!(wide.as_u64().unwrap() <= 390, "nothing sticks out: {wide}");
    browser.shot("narrow.png", true);
    browser.window(1400, 900, "light");
    assert!(browser.evaluate(WIDEST_CHART).as_u64().unwrap() > 390);
}

/// On paper charts have its width, and what is not drawn is said.
fn paper(browser: &mut Browser) {
    let noted = "document.querySelector('#figure-accuracy .paper-note').textContent";
    let before = browser.evaluate(WIDEST_CHART);
    browser.evaluate("dispatchEvent(new Event('beforeprint'))");
    let note = browser.evaluate(noted);
    assert_eq!(note, "Not drawn, as they are switched off: random.");
    browser.call("Emulation.setEmulatedMedia", &json!({"media": "print"}));
    let printed = browser.evaluate(WIDEST_CHART).as_f64().unwrap();
    // A4 has 718 pixels between margins of 10 mm.
    assert!(printed > 300.0 && printed <= 718.0, "{printed} {before}");
    let is_shown = |browser: &mut Browser, of: &str| {
        browser.evaluate(&format!("document.querySelector('{of}').checkVisibility()"))
    };
    for (of, expected) in [("header .paper-only", true), (".panels", true), ("nav", false), ("#items", false)] {
        assert_eq!(is_shown(browser, of), expected, "{of}");
    }
    browser.call("Emulation.setEmulatedMedia", &json!({"media": ""}));
    assert_eq!(is_shown(browser, "header .paper-only"), false);
}

#[test]
fn unlabelled_page_works_in_browser() {
    let Some(mut browser) = browser() else {
        return;
    };
    let bench = Bench::with_questions(1);
    let line = "--data a.png --ask home --ask-per-image 9 --model random --levels L0,L5 --variant ev --out run";
    let called = bench.call(&words(line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let url = format!("file://{}", bench.path("run/report.html").display());
    browser.window(1400, 900, "light");
    browser.go(&url);
    browser.wait("document.documentElement?.dataset.ready === 'true'");
    let states = browser.evaluate("[...document.querySelector('#f-state').options].map((o) => o.value).join(', ')");
    let states = states.as_str().unwrap().to_owned();
    assert!(states.contains("as at L0, not as at L0") && !states.contains("right"), "{states}");
    browser.choose("#f-light", "exposure drop");
    browser.choose("#f-level", "L5");
    let mut counts = [0, 0];
    for (count_of, state) in counts.iter_mut().zip(["as at L0", "not as at L0"]) {
        browser.choose("#f-state", state);
        let text = count(&mut browser);
        *count_of = text.as_str().unwrap().split(' ').next().unwrap().parse().unwrap();
    }
    // Nine questions at L5, and random answers some of them as before and some not.
    assert!(counts[0] > 0 && counts[1] > 0 && counts[0] + counts[1] == 9, "{counts:?}");
    let title = browser.evaluate("document.querySelector('#i-choices .before').title");
    assert_eq!(title, "its answer at L0");
    let reading = browser.evaluate("document.querySelector('#r-mark').textContent");
    assert!(reading.as_str().unwrap().ends_with("not as at L0"), "{reading}");
    let head = browser.evaluate("document.querySelector('#c-table th').textContent");
    assert_eq!(head, "at L0 ↓ given →");
    browser.shot("without-truths.png", true);
    assert_eq!(browser.complaints(&url), Vec::<String>::new());
}
