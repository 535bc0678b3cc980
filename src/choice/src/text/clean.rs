//! Removal of hidden reasoning, invisible characters and leaked template tokens from a reply.

use std::sync::LazyLock;

use regex::Regex;
use serde::Deserialize;
use unicode_normalization::UnicodeNormalization;

use darkqa_ground::types::questions::UnreadReason;

/// Regular expressions for the begin and end of reasoning in one model family, a table of `reasoning.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ReasoningMark {
    #[expect(dead_code, reason = "documents the table")]
    family: String,
    #[expect(dead_code, reason = "documents the table")]
    source: String,
    begin: String,
    end: String,
}

#[derive(Debug, Default, Deserialize)]
struct ReasoningMarks {
    mark: Vec<ReasoningMark>,
}

static MARKS: LazyLock<Vec<ReasoningMark>> = LazyLock::new(|| {
    let marks: ReasoningMarks =
        toml::from_str(include_str!("../reasoning.toml")).unwrap_or_default();
    marks.mark
});

/// Marks that end a reasoning block.
static END: LazyLock<Regex> = LazyLock::new(|| {
    let ends: Vec<String> = MARKS
        .iter()
        .map(|mark| format!("(?:{})", mark.end))
        .collect();
    compiled(&format!("(?i){}", ends.join("|")))
});

/// Marks that begin a reasoning block.
static BEGIN: LazyLock<Regex> = LazyLock::new(|| {
    let begins: Vec<String> = MARKS
        .iter()
        .map(|mark| format!("(?:{})", mark.begin))
        .collect();
    compiled(&format!("(?i){}", begins.join("|")))
});

/// The name of Gemma's reasoning channel alone on the first line. A server that drops special tokens leaves only this name.
static CHANNEL_NAME: LazyLock<Regex> = LazyLock::new(|| compiled(r"\A\s*thought[ \t]*\r?\n"));

/// The end of the harmony format's final channel.
static HARMONY_CLOSE: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)<\|(?:return|end)\|>\s*\z"));

/// Tokens that end a model's turn.
static TURN_END: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)<\|\s*(?:im_end|eot_id|eot|eom_id|end|endoftext|end[_▁]of[_▁](?:text|turn|sentence|message)|return|eos",
        r"|end_response|end_of_turn_token|assistant_end|call)\s*\|>",
        r"|</s>|<eos>|<end_of_turn>|<end_of_utterance>|<turn\|>|\[eos\]|\[end\]"
    ))
});

/// Other tokens of chat templates, with the name of the role that follows them.
static TOKEN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)<\|(?:im_start|start_header_id|start|role)\|>\s*(?:assistant|model|system)?(?:\s*<\|end_header_id\|>)?",
        r"|<start_of_turn>\s*(?:model|assistant)?",
        r"|<\|[^|<>\s]{1,40}\|>|<s>|<bos>|<pad>|<unk>|<image>|\[/?inst\]|<</?sys>>"
    ))
});

/// The start of a next question in the reply of a model that does not stop but continues the dialogue.
static NEXT_TURN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)\n[#*>\s]*(?:(?:next |new )?question|q|user|human|instruction|frage|pregunta|pergunta|domanda|vraag",
        r"|вопрос|问题|問題|質問|질문)\s*\d*\s*\**\s*:"
    ))
});

/// The text after the last reasoning block, trimmed.
///
/// # Errors
/// The reason why no answer can be read, if the reasoning does not end or no text follows.
pub(crate) fn without_reasoning(reply: &str) -> Result<&str, UnreadReason> {
    let (mut text, marker) = match END.find_iter(reply).last() {
        Some(marker) => (&reply[marker.end()..], marker.as_str()),
        None => (reply, ""),
    };
    if BEGIN.is_match(text) {
        return Err(UnreadReason::Truncated);
    }
    if marker.ends_with("<|message|>")
        && let Some(close) = HARMONY_CLOSE.find(text)
    {
        text = &text[..close.start()];
    }
    match text.trim_matches(is_blank) {
        "" => Err(UnreadReason::Empty),
        text => Ok(text),
    }
}

/// The text after the name of a reasoning channel whose marks a server dropped; `None` without such a name. The end of the reasoning is
/// unknown.
pub(crate) fn after_channel_name(text: &str) -> Option<&str> {
    let name = CHANNEL_NAME.find(text)?;
    Some(text[name.end()..].trim_matches(is_blank))
}

/// Normalizes a text to NFKC, removes invisible characters and template tokens, and cuts it at the end of the first turn that contains
/// text.
pub(crate) fn tidy(text: &str) -> String {
    let mut text: String = if text.is_ascii() {
        text.to_owned()
    } else {
        text.nfkc().filter(|&c| !is_invisible(c)).collect()
    };
    if text.contains(['\r', '\u{2028}', '\u{2029}']) {
        text = text
            .replace("\r\n", "\n")
            .replace(['\r', '\u{2028}', '\u{2029}'], "\n");
    }
    // Every token has one of these.
    if !text.contains(['<', '[']) {
        return text.trim().to_owned();
    }
    let text = text
        .replace("<|begin_of_box|>", "<answer>")
        .replace("<|end_of_box|>", "</answer>");
    let end = TURN_END
        .find_iter(&text)
        .map(|marker| marker.start())
        .find(|&start| !text[..start].trim().is_empty());
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

fn is_blank(c: char) -> bool {
    c.is_whitespace() || is_invisible(c)
}

/// Compiles a literal pattern; the tests compile all of them.
#[expect(clippy::expect_used, reason = "a literal that the tests compile")]
pub(crate) fn compiled(pattern: &str) -> Regex {
    Regex::new(pattern).expect("a literal pattern")
}
