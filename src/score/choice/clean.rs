//! What a model said aloud: hidden reasoning, invisible characters and leaked tokens taken away.

use std::sync::LazyLock;

use regex::Regex;
use unicode_normalization::UnicodeNormalization;

use crate::types::question::UnreadReason;

/// Marks that end a stretch of reasoning: those of DeepSeek, Qwen and many others, Magistral, Kimi, Cohere, Seed,
/// and the final channel of the harmony format (also as it reads where a server drops its special tokens).
static END: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)</(?:seed:)?(?:think|thinking|thought|thoughts|reasoning|reflection|analysis|scratchpad)>",
        r"|\[/(?:think|thinking|reasoning)\]|◁/think▷",
        r"|<\|(?:/think|end_of_thought|end_thinking)\|>",
        r"|<\|channel\|>\s*final\b[^<]{0,80}<\|message\|>|assistantfinal"
    ))
});

/// Marks that begin a stretch of reasoning.
static BEGIN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)<(?:seed:)?(?:think|thinking|thought|thoughts|reasoning|reflection|analysis|scratchpad)>",
        r"|\[(?:think|thinking|reasoning)\]|◁think▷",
        r"|<\|(?:think|begin_of_thought|start_thinking)\|>",
        r"|<\|channel\|>\s*(?:analysis|commentary)\b"
    ))
});

/// The end of the harmony format's final channel.
static HARMONY_CLOSE: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)<\|(?:return|end)\|>\s*\z"));

/// Tokens after which a model's turn is over.
static TURN_END: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)<\|\s*(?:im_end|eot_id|eot|eom_id|end|endoftext|end[_▁]of[_▁](?:text|turn|sentence|message)|return|eos",
        r"|end_response|end_of_turn_token|assistant_end|call)\s*\|>",
        r"|</s>|<eos>|<end_of_turn>|<end_of_utterance>|<turn\|>|\[eos\]|\[end\]"
    ))
});

/// Other tokens of chat templates, with the speaker's name that belongs to them.
static TOKEN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)<\|(?:im_start|start_header_id|start|role)\|>\s*(?:assistant|model|system)?(?:\s*<\|end_header_id\|>)?",
        r"|<start_of_turn>\s*(?:model|assistant)?",
        r"|<\|[^|<>\s]{1,40}\|>|<s>|<bos>|<pad>|<unk>|<image>|\[/?inst\]|<</?sys>>"
    ))
});

/// Where a model that does not stop begins to ask itself the next question.
static NEXT_TURN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)\n[#*>\s]*(?:(?:next |new )?question|q|user|human|instruction|frage|pregunta|pergunta|domanda|vraag",
        r"|вопрос|问题|問題|質問|질문)\s*\d*\s*\**\s*:"
    ))
});

/// What follows the last mark that ends reasoning, trimmed.
///
/// # Errors
/// Why nothing is left to read.
pub(super) fn spoken(reply: &str) -> Result<&str, UnreadReason> {
    let (mut text, mark) = match END.find_iter(reply).last() {
        Some(mark) => (&reply[mark.end()..], mark.as_str()),
        None => (reply, ""),
    };
    if BEGIN.is_match(text) {
        return Err(UnreadReason::Truncated);
    }
    if mark.ends_with("<|message|>")
        && let Some(close) = HARMONY_CLOSE.find(text)
    {
        text = &text[..close.start()];
    }
    match text.trim_matches(is_blank) {
        "" => Err(UnreadReason::Empty),
        text => Ok(text),
    }
}

/// The text in compatibility form (NFKC) without invisible characters and template tokens; what a token ends is the
/// end.
pub(super) fn tidy(text: &str) -> String {
    let text: String = text
        .nfkc()
        .filter(|&c| !is_invisible(c))
        .collect::<String>()
        .replace("\r\n", "\n")
        .replace(['\r', '\u{2028}', '\u{2029}'], "\n")
        .replace("<|begin_of_box|>", "<answer>")
        .replace("<|end_of_box|>", "</answer>");
    let end = TURN_END
        .find_iter(&text)
        .map(|mark| mark.start())
        .find(|&start| !text[..start].trim().is_empty());
    let turn = &text[..end.unwrap_or(text.len())];
    let turn = TURN_END.replace_all(turn, " ");
    TOKEN.replace_all(&turn, " ").trim().to_owned()
}

/// What stands before the question that a model asks itself next, where anything does.
pub(super) fn before_next_turn(text: &str) -> Option<&str> {
    let next = NEXT_TURN.find(text)?;
    Some(text[..next.start()].trim()).filter(|text| !text.is_empty())
}

/// Whether a character takes no space: joiners, direction and byte order marks, variation selectors.
fn is_invisible(c: char) -> bool {
    matches!(c, '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{e0000}'..='\u{e01ef}')
}

fn is_blank(c: char) -> bool {
    c.is_whitespace() || is_invisible(c)
}

/// Compiles a literal pattern; the tests compile every one.
#[expect(clippy::expect_used, reason = "a literal that the tests compile")]
pub(super) fn compiled(pattern: &str) -> Regex {
    Regex::new(pattern).expect("a literal pattern")
}
