//! Comparison of the name of a model that was asked with the name in its replies: [`is_other_model`], [`is_same_name`].

use std::collections::BTreeSet;

/// Words of small versions of a model. A name that has one and a name that has none are of two models.
const SMALL: [&str; 6] = ["mini", "nano", "lite", "tiny", "small", "micro"];

/// Words of many models, which do not show that two names are related.
const COMMON: [&str; 14] = [
    "instruct", "chat", "vision", "vl", "it", "preview", "latest", "model", "base", "turbo", "fp", "awq", "gguf", "exp",
];

/// True if the name in the replies is evidently that of another model than the one asked: they have no word in common,
/// or they name different sizes. Servers complete names (`gpt-4o` becomes `gpt-4o-2024-11-20`, `llava` becomes a path),
/// so that other differences mean nothing; and names without a digit, such as `default`, are not judged.
#[must_use]
pub fn is_other_model(asked: &str, served: &str) -> bool {
    let (asked, served) = (words(asked), words(served));
    let has_version = |words: &BTreeSet<String>| words.iter().any(|word| has_digit(word));
    if !has_version(&asked) || !has_version(&served) {
        return false;
    }
    let (asked_families, served_families) = (families(&asked), families(&served));
    if asked_families.is_empty() || served_families.is_empty() {
        return false;
    }
    let (asked_sizes, served_sizes) = (sizes(&asked), sizes(&served));
    let is_other_size = !asked_sizes.is_empty() && !served_sizes.is_empty() && asked_sizes.is_disjoint(&served_sizes);
    asked_families.is_disjoint(&served_families) || is_other_size || is_small(&asked) != is_small(&served)
}

/// True if two names in replies differ only in case or in the path before them.
#[must_use]
pub fn is_same_name(one: &str, other: &str) -> bool {
    last_segment(one).eq_ignore_ascii_case(last_segment(other))
}

/// The name without the folders, the organization or the address before it.
fn last_segment(name: &str) -> &str {
    name.trim().trim_end_matches(['/', '\\']).rsplit(['/', '\\']).next().unwrap_or(name)
}

/// The words of a name in lower case, without its path.
fn words(name: &str) -> BTreeSet<String> {
    last_segment(name)
        .to_lowercase()
        .split(|c: char| !c.is_alphanumeric() && c != '.')
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

fn has_digit(word: &str) -> bool {
    word.contains(|c: char| c.is_ascii_digit())
}

/// The letters of each word, without common words and single letters: `qwen` of `qwen2.5-vl-7b`.
fn families(words: &BTreeSet<String>) -> BTreeSet<&str> {
    words
        .iter()
        .flat_map(|word| word.split(|c: char| !c.is_alphabetic()))
        .filter(|part| part.chars().count() > 1 && !COMMON.contains(part))
        .collect()
}

/// The sizes in a name, such as `7b`.
fn sizes(words: &BTreeSet<String>) -> BTreeSet<&str> {
    words
        .iter()
        .filter(|word| word.strip_suffix(['b', 'm']).is_some_and(|number| number.parse::<f64>().is_ok()))
        .map(String::as_str)
        .collect()
}

fn is_small(words: &BTreeSet<String>) -> bool {
    SMALL.iter().any(|small| words.contains(*small))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_models_are_recognized() {
        for (asked, served) in [
            ("gpt-4o", "qwen2-vl-2b-instruct"),
            ("gpt-4o", "gpt-4o-mini-2024-07-18"),
            ("qwen2-vl-72b", "Qwen/Qwen2-VL-7B-Instruct"),
            ("llava-1.6", "phi-3.5-vision-instruct"),
            ("org/gemma-3-27b-it", "gemma-3-4b-it"),
            ("claude-sonnet-4-5", "gpt-4.1"),
        ] {
            assert!(is_other_model(asked, served), "{asked} {served}");
        }
    }

    #[test]
    fn completed_names_are_no_other_models() {
        for (asked, served) in [
            ("gpt-4o", "gpt-4o-2024-11-20"),
            ("gpt-4o-mini", "gpt-4o-mini-2024-07-18"),
            ("claude-3-5-sonnet-latest", "claude-3-5-sonnet-20241022"),
            ("gemini-flash-latest", "gemini-2.5-flash"),
            ("qwen2.5vl:7b", "Qwen/Qwen2.5-VL-7B-Instruct"),
            ("qwen2.5-vl-7b", "/models/Qwen2.5-VL-7B-Instruct-Q4_K_M.gguf"),
            ("Qwen2.5-VL-7B", "C:\\models\\qwen2.5-vl-7b-q8_0.gguf"),
            ("meta-llama/Llama-3.2-11B-Vision-Instruct", "llama-3.2-11b-vision"),
            ("google/gemini-2.5-flash", "gemini-2.5-flash"),
            ("openai/gpt-4o:free", "openai/gpt-4o"),
            ("my-deployment", "gpt-4o-2024-08-06"),
            ("gpt-4o", "default"),
            ("tiny", "tiny-text.gguf"),
            ("m", "mock-1"),
            ("", ""),
        ] {
            assert!(!is_other_model(asked, served), "{asked} {served}");
        }
    }

    #[test]
    fn path_and_case_are_ignored() {
        assert!(is_same_name("Qwen/Qwen2-VL", "qwen2-vl"));
        assert!(!is_same_name("gpt-4o-2024-08-06", "gpt-4o-2024-11-20"));
    }
}
