//! Flags that once turned a command into another one: [`in_current_form`].

use std::ffi::OsString;

/// A flag whose command is now a subcommand.
struct Mode {
    command: &'static str,
    /// The flag. It is also the name of the subcommand.
    flag: &'static str,
    /// True if the flag had a value. This value is now the first word after the subcommand.
    has_value: bool,
}

const MODES: [Mode; 5] = [
    Mode::new("synthesize", "check", true),
    Mode::new("synthesize", "from", true),
    Mode::new("enhance", "describe", false),
    Mode::new("enhance", "doctor", false),
    Mode::new("import", "script", false),
];

impl Mode {
    const fn new(command: &'static str, flag: &'static str, has_value: bool) -> Self {
        Self { command, flag, has_value }
    }

    /// The place of the flag in the words, and its value if it is joined to the flag.
    fn find(&self, words: &[OsString]) -> Option<(usize, Option<OsString>)> {
        words.iter().take_while(|word| *word != "--").enumerate().find_map(|(place, word)| {
            let rest = word.to_str()?.strip_prefix("--")?.strip_prefix(self.flag)?;
            match rest.strip_prefix('=') {
                Some(value) if self.has_value => Some((place, Some(value.into()))),
                None if rest.is_empty() => Some((place, None)),
                _ => None,
            }
        })
    }
}

/// The words of a call, with the flag of a mode replaced by its subcommand: `enhance m --describe` becomes `enhance
/// describe m`. `at` is the place of the command's name.
pub(super) fn in_current_form(mut words: Vec<OsString>, at: usize) -> Vec<OsString> {
    let found = MODES
        .iter()
        .filter(|mode| words.get(at).is_some_and(|word| word == mode.command))
        .filter_map(|mode| Some((mode, mode.find(&words)?)));
    let Some((mode, (place, value))) = found.min_by_key(|(_, (place, _))| *place) else {
        return words;
    };
    words.remove(place);
    let value = match value {
        None if mode.has_value && place < words.len() => Some(words.remove(place)),
        value => value,
    };
    let subcommand = std::iter::once(OsString::from(mode.flag));
    let rest = words.split_off(at + 1);
    words.extend(subcommand.chain(value).chain(rest));
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn current(line: &str) -> String {
        let words = line.split(' ').map(OsString::from).collect();
        let words: Vec<String> = in_current_form(words, 1).iter().map(|word| word.to_string_lossy().into()).collect();
        words.join(" ")
    }

    #[test]
    fn modes_become_subcommands() {
        for (earlier, now) in [
            ("d synthesize --check dir", "d synthesize check dir"),
            ("d synthesize a --out b --from=c", "d synthesize from c a --out b"),
            ("d synthesize a --from c --out b", "d synthesize from c a --out b"),
            ("d enhance m --describe", "d enhance describe m"),
            ("d enhance m a --doctor --write --out b", "d enhance doctor m a --write --out b"),
            ("d import habitat --script", "d import script habitat"),
        ] {
            assert_eq!(current(earlier), now);
        }
    }

    #[test]
    fn other_words_stay() {
        for line in [
            "d synthesize a --out b",
            "d enhance m -- --describe",
            "d enhance m a --out b --describe=1",
            "d check --check",
        ] {
            assert_eq!(current(line), line);
        }
    }
}
