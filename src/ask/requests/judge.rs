//! Messages about the judge of open answers, whose settings have flags of their own: [`for_judge`].

/// Flags of models, and the judge's flags for the same settings.
const FLAGS: [(&str, &str); 6] = [
    ("--temperature", "--judge-temperature"),
    ("--max-tokens", "--judge-max-tokens"),
    ("--model", "--judge"),
    ("--base-url", "--judge-base-url"),
    ("--api-key-env", "--judge-api-key-env"),
    ("--api-key-file", "--judge-api-key-file"),
];

/// Replaces the flags of models in a message by those of the judge.
pub(crate) fn for_judge(message: &str) -> String {
    FLAGS.iter().fold(message.to_owned(), |text, (flag, of_judge)| text.replace(flag, of_judge))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_replaced() {
        assert_eq!(
            for_judge("--temperature default, or another --model with --max-tokens N"),
            "--judge-temperature default, or another --judge with --judge-max-tokens N"
        );
    }
}
