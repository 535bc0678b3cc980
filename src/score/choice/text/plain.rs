//! Removal of markup from a reply: Markdown, HTML, LaTeX, quotes, pictographs.
//!
//! Removal of invisible characters and leaked template tokens from a reply.

use std::sync::LazyLock;

use regex::Regex;
use unicode_normalization::UnicodeNormalization;

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

static LATEX_SIGN: LazyLock<Regex> = LazyLock::new(|| compiled(r"\\(?:[()\[\],;:! ]|quad\b|qquad\b|bf\b|rm\b)"));

static LETTER_TAG: LazyLock<Regex> = LazyLock::new(|| compiled(r"\A<([A-Za-z])>\z"));

static BREAK_TAG: LazyLock<Regex> = LazyLock::new(|| compiled(r"(?i)</?(?:br|p|div|li|tr|td|th|h[1-6])\s*/?>"));

static TAG: LazyLock<Regex> =
    LazyLock::new(|| compiled(r#"</?[A-Za-z][A-Za-z0-9_-]{0,30}(?:\s+[a-z-]+="[^"<>]*")*\s*/?>"#));

static LINE_START: LazyLock<Regex> = LazyLock::new(|| compiled(r"(?m)^[ \t]*(?:(?:#{1,6}|>|[-+•·▪◦‣●○■–—])[ \t]+)+"));

/// The check box of a task list item, at the start of a line.
static TASK: LazyLock<Regex> = LazyLock::new(|| compiled(r"(?m)^[ \t]*(?:(?:[-+*•]|\d+[.)])[ \t]+)?\[[ xX]\][ \t]+"));

/// A check box anywhere. Removed only if the text contains an empty one.
static BOX: LazyLock<Regex> = LazyLock::new(|| compiled(r"\[[ xX]\]"));

/// Maximum depth of LaTeX groups that are unwrapped.
const LATEX_DEPTH: usize = 4;

/// Removes markup, repeated spaces, empty lines and outer spaces.
pub(crate) fn plain(text: &str) -> String {
    let text = LETTER_TAG.replace(text.trim(), "($1)");
    let mut text = if text.contains("```") { FENCE.replace_all(&text, "\n").into_owned() } else { text.into_owned() };
    if text.contains('\\') {
        text = without_latex(text);
    }
    if text.contains('<') {
        text = BREAK_TAG.replace_all(&text, "\n").into_owned();
        text = TAG.replace_all(&text, "").into_owned();
    }
    if text.contains("[ ]") {
        text = BOX.replace_all(&text, " ").into_owned();
    } else if text.contains('[') {
        text = TASK.replace_all(&text, "").into_owned();
    }
    let text = without_signs(&text);
    let text = LINE_START.replace_all(&text, "");
    with_single_spaces(&text)
}

/// Replaces LaTeX groups by their content and removes other LaTeX commands.
fn without_latex(mut text: String) -> String {
    for _ in 0..LATEX_DEPTH {
        match LATEX_GROUP.replace_all(&text, "$1") {
            std::borrow::Cow::Borrowed(_) => break,
            std::borrow::Cow::Owned(unwrapped) => text = unwrapped,
        }
    }
    LATEX_SIGN.replace_all(&text, " ").into_owned()
}

/// Trims a text and replaces each run of white space by one line break if the run contains one, otherwise by a space.
fn with_single_spaces(text: &str) -> String {
    let mut single = String::with_capacity(text.len());
    let mut gap = None;
    for c in text.trim().chars() {
        if c.is_whitespace() {
            gap = Some(if c == '\n' || gap == Some('\n') { '\n' } else { ' ' });
            continue;
        }
        single.extend(gap.take());
        single.push(c);
    }
    single
}

/// Stands for an en dash between two letters. It takes one byte, as a hyphen does: "living–room" is one name,
/// "kitchen–bathroom" two.
pub(crate) const RANGE: char = '\u{1e}';

/// Removes emphasis, quotes and pictographs. A cross mark becomes "not", and every hyphen between letters becomes "-".
fn without_signs(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut previous = None;
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let next = rest.peek().copied();
        let is_inside_word = previous.is_some_and(char::is_alphanumeric) && next.is_some_and(char::is_alphanumeric);
        let is_compound = previous.is_some_and(char::is_alphabetic) && next.is_some_and(char::is_alphabetic);
        match c {
            '‐' | '‑' | '‒' | '−' if is_compound => plain.push('-'),
            '–' if is_compound => plain.push(RANGE),
            RANGE => plain.push(' '),
            '\'' | '’' | '‘' | 'ʼ' if is_inside_word => plain.push('\''),
            '_' if is_inside_word => plain.push('_'),
            '*' | '`' | '$' | '_' | '\'' | '’' | '‘' | '‚' | '"' | '“' | '”' | '„' | '‟' | '«' | '»' | '‹' | '›'
            | '「' | '」' | '『' | '』' | '《' | '》' | '〈' | '〉' | '″' => {}
            '【' | '〔' | '〖' => plain.push('['),
            '】' | '〕' | '〗' => plain.push(']'),
            '|' => plain.push('\n'),
            '❌' | '✗' | '✘' | '❎' | '✖' | '👎' | '☐' => plain.push_str(" not "),
            '~' | '\u{20e3}' | '\u{2600}'..='\u{27bf}' | '\u{2b00}'..='\u{2bff}' | '\u{1f000}'..='\u{1faff}' => {
                plain.push(' ');
            }
            c => plain.push(c),
        }
        previous = Some(c);
    }
    plain
}

/// Converts a text to lower case without moving byte positions: a character whose lower case has another length is
/// kept. A hyphen between two letters becomes a space, and "grey" becomes "gray".
pub(crate) fn fold(text: &str) -> String {
    let mut folded = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    let mut follows_letter = false;
    while let Some(c) = rest.next() {
        let is_compound = matches!(c, '-' | RANGE) && follows_letter && rest.peek().is_some_and(|c| c.is_alphabetic());
        folded.push(if is_compound { ' ' } else { lower(c) });
        follows_letter = c.is_alphabetic();
    }
    if folded.contains("grey") {
        folded = folded.replace("grey", "gray");
    }
    folded
}

/// The lower case of a character if it has the same number of bytes; otherwise the character itself.
fn lower(c: char) -> char {
    if c.is_ascii() {
        return c.to_ascii_lowercase();
    }
    let mut lower = c.to_lowercase();
    match (lower.next(), lower.next()) {
        (Some(l), None) if l.len_utf8() == c.len_utf8() => l,
        _ => c,
    }
}

/// Tokens that end a model's turn.
static TURN_END: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)<\|\s*(?:im_end|eot_id|eot|eom_id|end|endoftext|end[_▁]of[_▁](?:text|turn|sentence|message)|return|eos",
        r"|end_response|end_of_turn_token|assistant_end|call)\s*\|>|\[\|\s*end[_▁ ]?of[_▁ ]?\w+\s*\|\]",
        r"|</s>|<eos>|<end_of_turn>|<end_of_utterance>|<turn\|>|\[eos\]|\[end\]"
    ))
});

/// Other tokens of chat templates, with the name of the role that follows them.
static TOKEN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)<\|(?:im_start|start_header_id|start|role)\|>\s*(?:assistant|model|system)?(?:\s*<\|end_header_id\|>)?",
        r"|<start_of_turn>\s*(?:model|assistant)?",
        r"|<\|[^|<>\n]{1,40}\|?>|<[^|<>\s]{1,40}\|>|\[\|[^|\[\]\n]{1,40}\|\]|<s>|<bos>|<pad>|<unk>|<image>|\[/?inst\]|<</?sys>>"
    ))
});

/// The start of a next question in the reply of a model that does not stop but continues the dialogue.
static NEXT_TURN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)\n[#*>\s]*(?:(?:next |new )?question|q|user|human|instruction|frage|pregunta|pergunta|domanda|vraag",
        r"|вопрос|问题|問題|質問|질문)\s*\d*\s*\**\s*:"
    ))
});

/// Normalizes a text to NFKC, removes invisible characters and template tokens, and cuts it at the end of the first
/// turn that contains text.
pub(crate) fn tidy(text: &str) -> String {
    let mut text: String =
        if text.is_ascii() { text.to_owned() } else { text.nfkc().filter(|&c| !is_invisible(c)).collect() };
    if text.contains(['\r', '\u{2028}', '\u{2029}']) {
        text = text.replace("\r\n", "\n").replace(['\r', '\u{2028}', '\u{2029}'], "\n");
    }
    // Every token has one of these.
    if !text.contains(['<', '[']) {
        return text.trim().to_owned();
    }
    let text = text.replace("<|begin_of_box|>", "<answer>").replace("<|end_of_box|>", "</answer>");
    let end = TURN_END.find_iter(&text).map(|marker| marker.start()).find(|&start| !text[..start].trim().is_empty());
    let turn = &text[..end.unwrap_or(text.len())];
    let turn = TURN_END.replace_all(turn, " ");
    TOKEN.replace_all(&turn, " ").trim().to_owned()
}

/// The text before a next question that a model asks itself; `None` without such a question, or without text before it.
pub(crate) fn before_next_turn(text: &str) -> Option<&str> {
    let next = NEXT_TURN.find(text)?;
    Some(text[..next.start()].trim()).filter(|text| !text.is_empty())
}

/// True for a character without width: joiners, direction and byte order marks, variation selectors.
fn is_invisible(c: char) -> bool {
    matches!(c, '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{e0000}'..='\u{e01ef}')
}

pub(super) fn is_blank(c: char) -> bool {
    c.is_whitespace() || is_invisible(c)
}

/// Compiles a literal pattern; the tests compile all of them.
#[expect(clippy::expect_used, reason = "a literal that the tests compile")]
pub(crate) fn compiled(pattern: &str) -> Regex {
    Regex::new(pattern).expect("a literal pattern")
}
