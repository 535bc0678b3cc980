//! Removal of markup from a reply: Markdown, HTML, LaTeX, quotes, pictographs.

use std::sync::LazyLock;

use regex::Regex;

use super::clean::compiled;

static FENCE: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)```(?:json|jsonc|text|txt|markdown|md|python|plaintext|plain|latex|tex|xml|html|yaml)?[ \t]*(?:\n|\b)",
    )
});
static LATEX_GROUP: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\\(?:text|textbf|textit|textrm|texttt|textsf|mathrm|mathbf|mathit|mathsf|mathtt|mathbb|rm|bf|emph",
        r"|boldsymbol|bm|boxed|fbox|framebox|operatorname|underline|mbox|displaystyle)\s*\{([^{}]*)\}"
    ))
});
static LATEX_SIGN: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"\\(?:[()\[\],;:! ]|quad\b|qquad\b|bf\b|rm\b)"));
static LETTER_TAG: LazyLock<Regex> = LazyLock::new(|| compiled(r"\A<([A-Za-z])>\z"));
static BREAK_TAG: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)</?(?:br|p|div|li|tr|td|th|h[1-6])\s*/?>"));
static TAG: LazyLock<Regex> =
    LazyLock::new(|| compiled(r#"</?[A-Za-z][A-Za-z0-9_-]{0,30}(?:\s+[a-z-]+="[^"<>]*")*\s*/?>"#));
static LINE_START: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?m)^[ \t]*(?:(?:#{1,6}|>|[-+•·▪◦‣●○■–—])[ \t]+)+"));
static SPACES: LazyLock<Regex> = LazyLock::new(|| compiled(r"[^\S\n]+"));
static LINES: LazyLock<Regex> = LazyLock::new(|| compiled(r" ?\n[\s]*"));

/// Maximum depth of LaTeX groups that are unwrapped.
const LATEX_DEPTH: usize = 4;

/// The text without markup, one space between words, no empty lines, trimmed.
pub(super) fn plain(text: &str) -> String {
    let text = LETTER_TAG.replace(text.trim(), "($1)");
    let mut text = FENCE.replace_all(&text, "\n").into_owned();
    for _ in 0..LATEX_DEPTH {
        match LATEX_GROUP.replace_all(&text, "$1") {
            std::borrow::Cow::Borrowed(_) => break,
            std::borrow::Cow::Owned(unwrapped) => text = unwrapped,
        }
    }
    let text = LATEX_SIGN.replace_all(&text, " ");
    let text = BREAK_TAG.replace_all(&text, "\n");
    let text = TAG.replace_all(&text, "");
    let text = without_signs(&text);
    let text = LINE_START.replace_all(&text, "");
    let text = SPACES.replace_all(&text, " ");
    LINES.replace_all(text.trim(), "\n").into_owned()
}

/// The text without emphasis, quotes and pictographs; a cross mark becomes "not".
fn without_signs(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut previous = None;
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let next = rest.peek().copied();
        let inside =
            previous.is_some_and(char::is_alphanumeric) && next.is_some_and(char::is_alphanumeric);
        match c {
            '\'' | '’' | '‘' | 'ʼ' if inside => plain.push('\''),
            '_' if inside => plain.push('_'),
            '*' | '`' | '$' | '_' | '\'' | '’' | '‘' | '‚' | '"' | '“' | '”' | '„' | '‟' | '«'
            | '»' | '‹' | '›' | '「' | '」' | '『' | '』' | '《' | '》' | '〈' | '〉' | '″' =>
                {}
            '【' | '〔' | '〖' => plain.push('['),
            '】' | '〕' | '〗' => plain.push(']'),
            '|' => plain.push('\n'),
            '❌' | '✗' | '✘' | '❎' | '✖' => plain.push_str(" not "),
            '~'
            | '\u{20e3}'
            | '\u{2600}'..='\u{27bf}'
            | '\u{2b00}'..='\u{2bff}'
            | '\u{1f000}'..='\u{1faff}' => plain.push(' '),
            c => plain.push(c),
        }
        previous = Some(c);
    }
    plain
}

/// The text in lower case with the same byte positions: a character whose lower case has another length stays as it is.
pub(super) fn fold(text: &str) -> String {
    let lower = |c: char| {
        let mut lower = c.to_lowercase();
        match (lower.next(), lower.next()) {
            (Some(l), None) if l.len_utf8() == c.len_utf8() => l,
            _ => c,
        }
    };
    text.chars().map(lower).collect()
}
