//! Removal of invisible characters and leaked template tokens from a reply.

use std::sync::LazyLock;

use regex::Regex;
use unicode_normalization::UnicodeNormalization;

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
