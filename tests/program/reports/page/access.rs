//! Whether everybody can use the pages: the rules of axe-core, room at every width, and colours that can be told from
//! the ground.
//!
//! Needs `axe.min.js` of axe-core, which `AXE` names and `.ci/axe` gets; where there is none, or no browser, the test
//! says so.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::{SAID, browser};
use crate::support::browser::Browser;
use crate::support::house::House;
use crate::support::run::{Bench, words};
use crate::support::tools::skip;

const WIDTHS: [u32; 4] = [390, 768, 1280, 1920];
const THEMES: [&str; 2] = ["light", "dark"];

/// Least contrast of a line or a mark against the ground: WCAG 2.2, success criterion 1.4.11.
const LEAST_CONTRAST: f64 = 3.0;

/// The rules as a script, where they are.
fn rules() -> Option<String> {
    let path = std::env::var_os("AXE").filter(|path| !path.is_empty());
    if path.is_none() {
        skip("AXE does not name axe-core's axe.min.js; .ci/axe prints where it is");
    }
    let path = PathBuf::from(path?);
    let script = std::fs::read_to_string(&path);
    Some(script.unwrap_or_else(|e| panic!("AXE, {}: {e}", path.display())))
}

/// A page with every section that the built-in rooms can fill.
fn choices() -> (Bench, String) {
    let bench = Bench::new();
    bench.rooms("frames", 8, "160x120");
    let line = "--data frames --model observer --model random --blind-model random --llie lift \
                --levels L0,L3,L5 --out run";
    let called = bench.call(&words(line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let url = format!("file://{}", bench.path("run/report.html").display());
    (bench, url)
}

/// A page of open questions, with answers of two models.
fn open_questions() -> (House, String) {
    let house = House::new();
    house.0.file("said.jsonl", "{\"default\": \"a sofa\"}\n");
    house.0.file("other.jsonl", "{\"default\": \"a bed\"}\n");
    house.0.file("j.jsonl", "{\"default\": \"4\"}\n");
    let mut line = vec!["--model", SAID, "--model", "script:other.jsonl"];
    line.extend(["--judge", "script:j.jsonl", "--levels", "L0,L4", "--out", "run"]);
    let called = house.call(&line);
    assert_eq!(called.code, Some(0), "{called:?}");
    let url = format!("file://{}", house.0.path("run/report.html").display());
    (house, url)
}

/// Opens a page at a width in a theme, and waits until all of it is there.
fn open(browser: &mut Browser, url: &str, width: u32, theme: &str) {
    browser.window(width, 900, theme);
    browser.go("about:blank");
    browser.go(url);
    browser.wait("document.readyState === 'complete' && document.body !== null && location.protocol === 'file:'");
    browser.wait("document.documentElement.dataset.ready === 'true'");
}

/// Violations of rules: rule, impact and first place of each.
fn broken(browser: &mut Browser, rules: &str) -> Value {
    browser.evaluate(&format!("{rules}; 0"));
    browser.evaluate(
        "axe.run(document).then((found) => found.violations.map((v) => [v.id, v.impact, v.nodes[0].html.slice(0, 200)]))",
    )
}

/// The innermost elements that stick out, for the message of a failure.
fn sticking_out(browser: &mut Browser) -> Value {
    browser.evaluate(
        "(() => { const room = document.documentElement.clientWidth;
            const wide = [...document.body.querySelectorAll('*')].filter((e) => e.getBoundingClientRect().right > room + 0.5);
            const free = wide.filter((e) => { for (let p = e.parentElement; p; p = p.parentElement) if (getComputedStyle(p).overflowX !== 'visible') return false; return true; });
            return free.slice(-5).map((e) => e.outerHTML.slice(0, 120)); })()",
    )
}

/// The width of the page beyond its window, in pixels.
fn overflow(browser: &mut Browser) -> Value {
    browser.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
}

/// Relative luminance of `rgb(r, g, b)`, as WCAG 2.2 defines it.
fn luminance(colour: &str) -> f64 {
    let numbers = colour.trim_start_matches("rgb(").trim_end_matches(')');
    let linear = numbers.split(',').map(|number| {
        let share = number.trim().parse::<f64>().unwrap_or_else(|e| panic!("{colour}: {e}")) / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    });
    linear.zip([0.2126, 0.7152, 0.0722]).map(|(share, weight)| share * weight).sum()
}

fn contrast(a: &str, b: &str) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// The colours of lines that cannot be told from the ground: those of the style sheet, and those of every line and mark
/// drawn.
fn faint(browser: &mut Browser) -> Vec<String> {
    let script = "(() => {
        const probe = document.body.appendChild(document.createElement('i'));
        const names = ['--ink', ...[0, 1, 2, 3, 4, 5].map((n) => '--line-' + n)];
        const named = names.map((name) => { probe.style.color = `var(${name})`; return [name, getComputedStyle(probe).color]; });
        probe.remove();
        const all = [...named];
        const parts = '.key *, .panel [data-line], .panel [data-line] *';
        for (const e of document.querySelectorAll(parts)) {
          if (!['polyline', 'polygon', 'circle'].includes(e.tagName) || e.matches('.band, .target')) continue;
          const { fill, stroke } = getComputedStyle(e);
          all.push([e.tagName, stroke === 'none' ? fill : stroke]);
        }
        return { ground: getComputedStyle(document.body).backgroundColor,
                 all };
    })()";
    let found = browser.evaluate(script);
    let ground = found["ground"].as_str().unwrap();
    let all = found["all"].as_array().unwrap();
    assert!(all.len() > 7, "lines are drawn: {found}");
    all.iter()
        .map(|entry| entry[1].as_str().unwrap())
        .filter(|colour| contrast(colour, ground) < LEAST_CONTRAST)
        .map(ToOwned::to_owned)
        .collect()
}

#[test]
fn everybody_can_use_the_pages() {
    let (Some(rules), Some(mut browser)) = (rules(), browser()) else {
        return;
    };
    let (bench, page) = choices();
    let (house, open_page) = open_questions();
    for url in [&page, &open_page] {
        for theme in THEMES {
            for width in WIDTHS {
                open(&mut browser, url, width, theme);
                let place = format!("{url}, {width} pixels, {theme}");
                assert_eq!(broken(&mut browser, &rules), json!([]), "{place}");
                let over = overflow(&mut browser);
                assert_eq!(over, 0, "{place}: {}", sticking_out(&mut browser));
                assert_eq!(faint(&mut browser), Vec::<String>::new(), "{place}");
            }
        }
    }
    the_check_finds_what_is_broken(&mut browser, &rules, &page);
    drop((bench, house));
}

/// A field without its label, a colour near that of the ground and a thing that sticks out are found.
fn the_check_finds_what_is_broken(browser: &mut Browser, rules: &str, page: &str) {
    open(browser, page, 1280, "light");
    browser.evaluate("(() => { const s = document.querySelector('#f-model'); s.closest('label').replaceWith(s); })()");
    let broken = broken(browser, rules);
    assert_eq!(broken[0][0], "select-name", "{broken}");
    assert_eq!(broken[0][1], "critical", "{broken}");
    browser.evaluate("document.documentElement.style.setProperty('--line-0', '#bfe6ff')");
    assert!(!faint(browser).is_empty());
    browser.evaluate("document.body.append(Object.assign(document.createElement('p'), { textContent: 'wide', style: 'width: 3000px; max-width: none' }))");
    assert!(overflow(browser).as_i64().unwrap() > 1000);
}

#[test]
fn contrast_is_that_of_wcag() {
    let near = |a: f64, b: f64| (a - b).abs() < 0.005;
    assert!(near(contrast("rgb(0, 0, 0)", "rgb(255, 255, 255)"), 21.0));
    // #777 on white is the known near miss of 4.5.
    assert!(near(contrast("rgb(119, 119, 119)", "rgb(255, 255, 255)"), 4.48));
}
