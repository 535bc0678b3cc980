//! Tests of thoughts and template tokens in replies: of listed families, and with made-up names in every form.

use proptest::prelude::*;

use super::choices_of;
use crate::choice::{ParsingMode, open_answer, read};
use darkqa_base::types::questions::{Answer, Choices, UnreadReason};

fn rooms() -> Choices {
    choices_of(&["kitchen", "bedroom", "bathroom"])
}

fn both(reply: &str) -> [Answer; 2] {
    ParsingMode::ALL.map(|mode| read(reply, &rooms(), mode))
}

/// Text inside reasoning marks is ignored; text after them is parsed strictly.
#[test]
fn reasoning_blocks_are_ignored() {
    let rooms = rooms();
    for (begin, end) in [
        ("<think>", "</think>"),
        ("<|channel>thought\n", "<channel|>"),
        ("[THINK]", "[/THINK]"),
        ("◁think▷", "◁/think▷"),
        ("<|START_THINKING|>", "<|END_THINKING|>"),
        ("<|channel|>analysis<|message|>", "<|channel|>final<|message|>"),
    ] {
        let thought = "It could be A. The answer is C at first sight.\n";
        for (reply, expected) in [
            (format!("{begin}{thought}{end}B"), Answer::Chosen(1)),
            (format!("{begin}{end}\n(B) bedroom"), Answer::Chosen(1)),
            (format!("{thought}{end}B"), Answer::Chosen(1)),
            (format!("{begin}{thought}"), Answer::Unparsed(UnreadReason::Truncated)),
        ] {
            for mode in ParsingMode::ALL {
                assert_eq!(read(&reply, &rooms, mode), expected, "{reply:?}");
            }
        }
    }
}

/// A server that drops special tokens leaves the name of Gemma's reasoning channel. The end of the reasoning is then
/// unknown.
#[test]
fn reasoning_without_marks_is_not_parsed() {
    let rooms = rooms();
    let reply = "thought\nThe image is dark. The answer is C at first sight, hmm.\nB";
    for mode in ParsingMode::ALL {
        let unread = Answer::Unparsed(UnreadReason::Truncated);
        assert_eq!(read(reply, &rooms, mode), unread);
        assert_eq!(read("thought\n\nB", &rooms, mode), Answer::Chosen(1));
    }
}

/// Marks with a made-up name: of the thoughts, and of their end.
fn pairs(name: &str, other: &str) -> Vec<(String, String)> {
    let [upper, other_upper] = [name, other].map(str::to_uppercase);
    vec![
        (format!("<{name}>"), format!("</{name}>")),
        (format!("<{name} kind=\"x\">"), format!("</{name}>")),
        (format!("<seed:{name}>"), format!("</seed:{name}>")),
        (format!("<{name}_start>"), format!("<{name}_end>")),
        (format!("<|{name}_start|>"), format!("<|{name}_end|>")),
        (format!("<|START_{upper}|>"), format!("<|END_{upper}|>")),
        (format!("<|begin_of_{name}|>"), format!("<|end_of_{name}|>")),
        (format!("<｜begin▁of▁{name}｜>"), format!("<｜end▁of▁{name}｜>")),
        (format!("<|{name}>"), format!("<{name}|>")),
        (format!("[BEGIN {upper}]"), format!("[END {upper}]")),
        (format!("◁{name}▷"), format!("◁/{name}▷")),
        // From here on, the opening mark alone says nothing.
        (format!("<|{name}|>"), format!("<|/{name}|>")),
        (format!("[{upper}]"), format!("[/{upper}]")),
        // From here on, neither does the closing mark.
        (format!("<|{name}|>"), format!("<|{other}|>")),
        (format!("### {name}\n"), format!("\n### {other}\n")),
        (format!("## {upper}:\n"), format!("\n## {other_upper}\n")),
        (format!("[{upper}]\n"), format!("\n[{other_upper}]\n")),
    ]
}

/// Number of [`pairs`] whose opening, and whose closing mark says what it is.
const OPENING: usize = 11;
const CLOSING: usize = 13;

const THOUGHTS: [&str; 5] = [
    "It could be A.",
    "The answer is C at first sight.",
    "Maybe (A) kitchen?\nNo, a bathroom.",
    "The image is dark.\n\nAnswer: C",
    "**C** or not",
];

/// Names that mean nothing: of letters that no word of the table begins with.
fn name() -> impl Strategy<Value = String> {
    "[zkvw][aeiou][zkvw][a-z]{1,6}x"
}

proptest! {
    #[test]
    fn thoughts_between_made_up_marks_are_not_read(
        name in name(),
        other in name(),
        pair in 0..17usize,
        thought in prop::sample::select(&THOUGHTS[..]),
        answer in prop::sample::select(&["B", "(B) bedroom", "bedroom", "b."][..]),
        tail in prop::sample::select(&["", "\n", "<|im_end|>", "<zorx|>"][..]),
    ) {
        prop_assume!(name != other);
        let (begin, end) = pairs(&name, &other).swap_remove(pair);
        let reply = format!("{begin}{thought}{end}{answer}{tail}");
        prop_assert_eq!(both(&reply), [Answer::Chosen(1); 2], "{}", reply);
        let is_heading = pair > CLOSING;
        if !is_heading {
            let stated = format!("{begin}{thought}{end}\nI think that it is a bedroom.");
            prop_assert_eq!(both(&stated)[1], Answer::Chosen(1), "{}", stated);
            prop_assert_eq!(open_answer(&reply), Ok(answer.into()), "{}", reply);
            let nothing = format!("{begin}{thought}\nIt is still too dark.{end}");
            // A token at the end alone may be of the template.
            let unread = both(&nothing).map(|answer| matches!(answer, Answer::Unparsed(_)));
            prop_assert_eq!(unread, [true; 2], "{}", nothing);
        }
        if pair < OPENING {
            let cut = format!("{begin}{thought}");
            prop_assert_eq!(both(&cut), [Answer::Unparsed(UnreadReason::Truncated); 2], "{}", cut);
            prop_assert!(open_answer(&cut).is_err(), "{}", cut);
        }
        if pair < CLOSING {
            let begun_in_prompt = format!("{thought}{end}\n{answer}");
            prop_assert_eq!(both(&begun_in_prompt), [Answer::Chosen(1); 2], "{}", begun_in_prompt);
        }
    }

    #[test]
    fn thoughts_between_reserved_tokens_are_not_read(number in 0..90u32, thought in prop::sample::select(&THOUGHTS[..])) {
        let next = number + 1;
        for reply in [
            format!("<unused{number}>thought\n{thought}<unused{next}>B"),
            format!("<|reserved_token_{number}|>{thought}<|reserved_token_{next}|>\nB<|reserved_token_0|>"),
        ] {
            prop_assert_eq!(both(&reply), [Answer::Chosen(1); 2], "{}", reply);
        }
        let cut = format!("<unused{number}>{thought}");
        prop_assert!(both(&cut).iter().all(|answer| matches!(answer, Answer::Unparsed(_))), "{}", cut);
    }

    #[test]
    fn template_tokens_around_an_answer_are_removed(name in name(), other in name()) {
        for token in [
            format!("<|{name}|>"),
            format!("<|{name}>"),
            format!("<{name}|>"),
            format!("<|{name}_{other}|>"),
            format!("<|end_of_{name}|>"),
            format!("<｜end▁of▁{name}｜>"),
            format!("<end_of_{name}>"),
            format!("<{name}_{other}>"),
            format!("[|{name}|]"),
            format!("<{name}7>"),
        ] {
            for reply in [format!("B{token}"), format!("B\n{token}<|im_end|>\n"), format!("(B) bedroom {token}")] {
                prop_assert_eq!(both(&reply), [Answer::Chosen(1); 2], "{}", reply);
            }
            let reply = format!("It is brown.{token}");
            prop_assert_eq!(open_answer(&reply), Ok("It is brown.".into()), "{}", reply);
        }
    }
}

/// Sections of a reply: the answer is under its heading, whatever the thoughts name.
#[test]
fn thoughts_in_sections_are_not_read() {
    for reply in [
        "### Reasoning\nIt might be C, or A.\n### Final answer\nB",
        "## Thought process:\nThe answer is C.\n\n## Answer: B",
        "**Reasoning:** The answer is C.\n\n**Answer:** B",
        "[THOUGHTS]\nThe answer is C.\n[FINAL ANSWER]\nB",
        "# Reasoning\nThe answer is C.\n# Answer\n(B) bedroom\n# Confidence\n90 %",
    ] {
        assert_eq!(both(reply), [Answer::Chosen(1); 2], "{reply}");
    }
    let cut = "### Reasoning\nThe answer is C.\n### Final answer\n";
    assert_eq!(both(cut), [Answer::Unparsed(UnreadReason::Truncated); 2]);
}

/// Replies of other forms and families.
#[test]
fn marks_of_other_families_are_recognized() {
    for reply in [
        "Here are my reasoning steps:\nIt might be C.\n[BEGIN FINAL RESPONSE]\nB\n[END FINAL RESPONSE]\n<|end|>",
        "<unused94>thought\nIt might be C.<unused95>B",
        "<|im_start|>think\nIt might be C.<|im_end|>\n<|im_start|>answer\nB<|im_end|>",
        "<|begin_of_thought|>C<|end_of_thought|>\n\n<|begin_of_solution|>B<|end_of_solution|>",
        "<|START_THINKING|>C<|END_THINKING|><|START_RESPONSE|>B<|END_RESPONSE|>",
        "<reasoning_start>It is C.<reasoning_end>B",
        "<details type=\"reasoning\" done=\"true\">\nIt is C.\n</details>\nB",
        "<|thinking|>It is C.<|thinking|>B",
        "<plan>Look at C.</plan>\n<ponder>It is C.</ponder>\nB",
        "[THOUGHTS]It is C.[/THOUGHTS]\nB",
        "<思考>C</思考>B",
        "<think>C</think><|begin_of_box|>B<|end_of_box|>",
        "<|assistant|>\n<ponder>C</ponder>\nB<|user|>",
    ] {
        assert_eq!(both(reply), [Answer::Chosen(1); 2], "{reply}");
    }
    for reply in
        ["<ponder>C</ponder>\n<answer>B</answer>", "<think>C</think><answer>\nB\n</answer>", "B <ponder>or C?</ponder>"]
    {
        assert_eq!(both(reply)[1], Answer::Chosen(1), "{reply}");
    }
    for reply in [
        "Here are my reasoning steps:\nThe answer might be C.",
        "<|begin_of_thought|>The answer is C",
        "<|thinking|>The answer is C",
        "<ponder>The answer might be C.</ponder>",
        "[BEGIN FINAL RESPONSE]",
        "analysisThe answer is C",
        "<|channel>thought\nThe answer is C",
        "thinking\nThe answer is C.\nHm.",
    ] {
        let unread = both(reply).map(|answer| matches!(answer, Answer::Unparsed(_)));
        assert_eq!(unread, [true; 2], "{reply}");
    }
}

/// Brackets, tags and headings of plain answers are no marks of thoughts.
#[test]
fn plain_answers_in_brackets_are_read() {
    const NONE: Option<usize> = None;
    for (reply, strict, lenient) in [
        ("[B]", Some(1), Some(1)),
        ("<B>", NONE, Some(1)),
        ("B [END]", NONE, Some(1)),
        ("[bedroom]", NONE, Some(1)),
        ("<bedroom>", NONE, NONE),
        ("<b>B</b>", NONE, Some(1)),
        ("<b>B</b>, because of the <i>bed</i>", NONE, Some(1)),
        ("<p>B</p><p>The bed is on the left.</p>", NONE, Some(1)),
        ("(B) <table>", NONE, Some(1)),
        ("### Answer: B", NONE, Some(1)),
        ("### Answer\nB\n\n### Explanation\nThere is a bed.", NONE, Some(1)),
        ("**Answer:** B\n**Explanation:** There is a bed.", NONE, Some(1)),
        ("<answer>B</answer>", NONE, Some(1)),
        ("<answer>B</answer> as there is a bed", NONE, Some(1)),
        ("<room>B</room>", NONE, Some(1)),
        ("<room>B</room> as there is a bed", NONE, Some(1)),
        ("B <note>It is dark.</note>", NONE, Some(1)),
        ("[note] It is dark. The answer is B.", NONE, Some(1)),
        ("The answer is <|begin_of_box|>B<|end_of_box|>.", NONE, Some(1)),
        ("- [x] bedroom", NONE, Some(1)),
        ("- [x] B\n- [ ] A", NONE, Some(1)),
        ("B</zorx>", NONE, Some(1)),
    ] {
        let found = both(reply).map(|answer| match answer {
            Answer::Chosen(index) => Some(index),
            Answer::Unparsed(_) => None,
        });
        assert_eq!(found, [strict, lenient], "{reply}");
    }
}

#[test]
fn open_answers_are_without_thoughts_and_tokens() {
    for (reply, answer) in [
        ("brown", "brown"),
        (" It is brown. Or\n", " It is brown. Or\n"),
        ("It is <b>brown</b>.", "It is <b>brown</b>."),
        ("[brown]", "[brown]"),
        ("<brown>", "<brown>"),
        ("<color>brown</color>", "<color>brown</color>"),
        ("<think>Black?</think>\nbrown", "brown"),
        ("<ponder>It could be black.</ponder> brown", "brown"),
        ("<|channel>thought\nBlack.<channel|>brown", "brown"),
        ("<|begin_of_box|>brown<|end_of_box|>", "brown"),
        ("It is <|begin_of_box|>brown<|end_of_box|>.", "It is brown."),
        ("<think>Black?</think><answer>brown</answer>", "brown"),
        ("It is dark. <answer>brown</answer>", "brown"),
        ("brown<|im_end|>\n<|im_start|>user\nAnd now?", "brown"),
        ("brown<|eot_id|><|start_header_id|>user<|end_header_id|>\n\nAnd now?", "brown"),
        ("brown<end_of_turn>\n<start_of_turn>user\nAnd now?", "brown"),
        ("### Reasoning\nIt could be black.\n### Final answer\nbrown", "brown"),
    ] {
        assert_eq!(open_answer(reply).as_deref(), Ok(answer), "{reply}");
    }
    for reply in [
        "",
        " \n",
        "<think>black",
        "<think>black</think>",
        "<ponder>It is dark. The chair could be black",
        "thought\nIt could be black.",
        "<|im_end|>",
    ] {
        assert!(open_answer(reply).is_err(), "{reply}");
    }
}
