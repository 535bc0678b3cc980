//! Command-line flags: parsers of their values, and their effect on a run.
//!
//! Flags that take several settings as `KEY=VALUE[,…]`: [`KeyedFlag`], and the table of them, [`KEYED_FLAGS`].
//!
//! Each setting also has a flag of its own, which is hidden: `--gain 3` is `--noise gain=3`.
//!
//! Flags whose value is a list of settings, as `speed=30,angle=0`: [`pairs`] and [`number`].
//!
//! Errors name the fault and the expected value; the command line adds the name of the flag.

#[cfg(feature = "program")]
mod flag;

use std::ops::RangeInclusive;

use super::text::{is_nearly, suggestion};

#[cfg(feature = "program")]
pub use flag::Decides;

#[cfg(feature = "program")]
pub use flag::{flag_words, milliseconds, positive, read_word, seconds, threads, write_word};

/// A flag that takes several settings, such as `--noise gain=3,fixed`.
#[derive(Debug)]
pub struct KeyedFlag {
    /// The name of the flag.
    pub name: &'static str,
    /// The heading of the flag in the help.
    pub heading: &'static str,
    /// The help text; empty if the flag has a value without a key, whose own help text is used.
    pub about: &'static str,
    /// The value of a key that is written without a value; `None` if such a key is a switch or has only one possible
    /// value.
    pub alone: Option<&'static str>,
    /// Each key with the name of the hidden flag for the same setting. The empty key is for a value without a key.
    pub keys: &'static [(&'static str, &'static str)],
}

/// A setting in the value of a keyed flag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyedSetting {
    /// The name of the hidden flag.
    pub flag: &'static str,
    /// The value; `None` for a key without a value.
    pub value: Option<String>,
}

/// All keyed flags. A command has a keyed flag if it has hidden flags for any of the keys.
pub const KEYED_FLAGS: [KeyedFlag; 15] = [
    KeyedFlag {
        name: "noise",
        heading: "Light",
        about: "Sensor, and overrides of --profile; default: as --profile says, of sony-a7s2",
        alone: None,
        keys: &[
            ("camera", "camera"),
            ("gain", "gain"),
            ("ratio", "ratio"),
            ("fixed", "fixed"),
            ("amplify", "amplify"),
            ("tone", "tone"),
            ("draws", "draws"),
            ("coupling", "coupling"),
            ("seeds", "noise-seeds"),
        ],
    },
    KeyedFlag {
        name: "read",
        heading: "Ready-made sets",
        about: "Options for reading a ready-made set; default: as its card and its files say",
        alone: None,
        keys: &[
            ("config", "config-name"),
            ("split", "split"),
            ("rows", "rows"),
            ("keep-instructions", "keep-instructions"),
        ],
    },
    KeyedFlag {
        name: "skip",
        heading: "Ready-made sets",
        about: "Rows of a ready-made set to leave out, with a count, instead of stopping; default: none",
        alone: Some("skip"),
        keys: &[("no-image", "no-image"), ("open", "open"), ("several", "several"), ("bad", "bad")],
    },
    KeyedFlag {
        name: "decode",
        heading: "Data",
        about: "How image files are decoded; default: to sRGB, without scaling",
        alone: None,
        keys: &[("colour", "colour"), ("transfer", "transfer"), ("exposure", "exposure"), ("max-pixels", "max-pixels")],
    },
    KeyedFlag {
        name: "choice-order",
        heading: "Data",
        about: "Order of the choices; default: as in the data",
        alone: Some("1"),
        keys: &[("shuffle", "shuffle-options"), ("circular", "circular")],
    },
    KeyedFlag {
        name: "repeats",
        heading: "Data",
        about: "",
        alone: None,
        keys: &[("", "repeats"), ("design", "design")],
    },
    KeyedFlag {
        name: "ask",
        heading: "Data",
        about: "",
        alone: None,
        keys: &[("", "ask"), ("per-image", "ask-per-image")],
    },
    KeyedFlag {
        name: "llie-options",
        heading: "Enhancement",
        about: "Options for running enhancers; default: in tiles where that is exact, with the ONNX Runtime that is found",
        alone: None,
        keys: &[
            ("tile", "tile"),
            ("max-side", "llie-max-side"),
            ("resize", "llie-resize"),
            ("timeout", "llie-timeout"),
            ("budget", "llie-budget"),
            ("max-memory", "llie-max-memory"),
            ("ort-lib", "ort-lib"),
            ("offline", "offline"),
        ],
    },
    KeyedFlag {
        name: "request",
        heading: "Model",
        about: "Further settings of requests; default: what every server takes",
        alone: None,
        keys: &[
            ("token-field", "token-field"),
            ("wire", "wire"),
            ("omit-field", "omit-field"),
            ("constrain", "constrain"),
            ("probabilities", "probabilities"),
        ],
    },
    KeyedFlag {
        name: "allow",
        heading: "Model",
        about: "Allow actions that are refused by default; default: none",
        alone: None,
        keys: &[
            ("http", "allow-http"),
            ("key-mismatch", "key-anyway"),
            ("models-file", "trust-models"),
            ("bad-enhancer", "llie-anyway"),
        ],
    },
    KeyedFlag {
        name: "retries",
        heading: "Sending",
        about: "",
        alone: None,
        keys: &[("", "retries"), ("paid", "paid-retries"), ("max-wait", "max-wait"), ("patience", "patience")],
    },
    KeyedFlag {
        name: "stop",
        heading: "Sending",
        about: "Early stop of a run; default: when no model can be asked any more",
        alone: None,
        keys: &[("failures", "max-failures"), ("first-model", "fail-fast"), ("grace", "grace")],
    },
    KeyedFlag {
        name: "image",
        heading: "Sending",
        about: "",
        alone: None,
        keys: &[
            ("", "image"),
            ("max-side", "max-side"),
            ("max-mb", "max-image"),
            ("detail", "detail"),
            ("first", "image-first"),
        ],
    },
    KeyedFlag {
        name: "images-cache",
        heading: "Scale",
        about: "",
        alone: None,
        keys: &[("", "images-cache"), ("what", "images-cache-what"), ("size", "images-cache-size")],
    },
    KeyedFlag {
        name: "shard",
        heading: "Scale",
        about: "",
        alone: None,
        keys: &[("", "shard"), ("workers", "workers")],
    },
];

/// The keyed flag and the key that replace a hidden flag: `noise` and `gain` for `gain`.
#[must_use]
pub fn keyed_form(flag: &str) -> Option<(&'static KeyedFlag, &'static str)> {
    KEYED_FLAGS.iter().find_map(|keyed| {
        let (key, _) = keyed.keys.iter().find(|(key, own)| *own == flag && !key.is_empty())?;
        Some((keyed, *key))
    })
}

/// The spelling of a flag in messages: `--noise gain` for `gain`, `--model` for `model`.
#[must_use]
pub fn flag_spelling(flag: &str) -> String {
    match keyed_form(flag) {
        Some((keyed, key)) => format!("--{} {key}", keyed.name),
        None => format!("--{flag}"),
    }
}

/// Rewrites the hidden flags in a manifest's name of a setting as keys, for messages: `--camera or --fixed` becomes
/// `--noise camera or fixed`.
#[must_use]
pub fn setting_spelling(setting: &str) -> String {
    let (mut spelling, mut last) = (String::new(), "");
    for word in setting.split_inclusive(' ') {
        let name = word.strip_prefix("--").unwrap_or_default();
        let end = name.find(|c: char| c != '-' && !c.is_ascii_alphanumeric()).unwrap_or(name.len());
        let (flag, rest) = name.split_at(end);
        match keyed_form(flag) {
            Some((keyed, key)) if keyed.name == last => spelling.extend([key, rest]),
            Some((keyed, key)) => {
                spelling.extend(["--", keyed.name, " ", key, rest]);
                last = keyed.name;
            }
            None => spelling.push_str(word),
        }
    }
    spelling
}

impl KeyedFlag {
    /// The keyed flag with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<&'static Self> {
        KEYED_FLAGS.iter().find(|keyed| keyed.name == name)
    }

    /// True if the flag has a value without a key.
    #[must_use]
    pub fn has_plain_value(&self) -> bool {
        self.keys.iter().any(|(key, _)| key.is_empty())
    }

    /// Parses a text such as `gain=3,fixed`; `has` returns true for the hidden flags of the command.
    ///
    /// A text that contains none of the keys is the value without a key, even if it contains commas.
    ///
    /// # Errors
    /// If a key does not exist or a part is empty.
    pub fn settings(&self, text: &str, has: impl Fn(&str) -> bool) -> Result<Vec<KeyedSetting>, String> {
        let (plain, known): (Vec<_>, Vec<_>) =
            self.keys.iter().filter(|(_, flag)| has(flag)).partition(|(key, _)| key.is_empty());
        let parts: Vec<&str> = text.split(',').collect();
        let names: Vec<&str> = known.iter().map(|(key, _)| *key).collect();
        // A part after the first that is nearly a key is a mistyped key.
        let is_mistyped = parts.iter().skip(1).any(|part| names.iter().any(|key| is_nearly(key_of(part), key)));
        if let [(_, flag)] = plain[..]
            && !is_mistyped
            && parts.iter().all(|part| !names.contains(&key_of(part)))
        {
            let value = Some(text.to_owned());
            return Ok(vec![KeyedSetting { flag, value }]);
        }
        parts
            .iter()
            .enumerate()
            .map(|(place, part)| {
                let key = key_of(part);
                if let Some((_, flag)) = known.iter().find(|(own, _)| *own == key) {
                    let value = part.split_once('=');
                    let value = value.map(|(_, value)| value.trim().to_owned());
                    return Ok(KeyedSetting { flag, value });
                }
                if let (0, [(_, flag)]) = (place, &plain[..]) {
                    let value = Some((*part).to_owned());
                    return Ok(KeyedSetting { flag, value });
                }
                let near = match suggestion(key, &names) {
                    near if near.is_empty() => format!("; keys: {}", names.join(", ")),
                    near => near,
                };
                Err(format!("unknown key {key:?}{near}"))
            })
            .collect()
    }
}

/// The key of a part such as `gain=3` or `fixed`.
fn key_of(part: &str) -> &str {
    part.split_once('=').map_or(part, |(key, _)| key).trim()
}

/// The settings in a text, each with its value.
///
/// # Errors
/// If a key is not one of `keys` (the error suggests the most similar one), has no value, or occurs twice.
pub fn pairs<'a>(text: &'a str, keys: &[&'static str]) -> Result<Vec<(&'static str, &'a str)>, String> {
    let mut pairs: Vec<(&'static str, &str)> = Vec::new();
    for item in text.split(',') {
        let (name, value) = item.split_once('=').unwrap_or((item, ""));
        let (name, value) = (name.trim(), value.trim());
        let Some(key) = keys.iter().find(|key| **key == name) else {
            return Err(unknown_key(name, keys));
        };
        if value.is_empty() {
            return Err(format!("{key} has no value; write {key}=VALUE"));
        }
        if pairs.iter().any(|(named, _)| named == key) {
            return Err(format!("{key} is named twice"));
        }
        pairs.push((*key, value));
    }
    Ok(pairs)
}

fn unknown_key(name: &str, keys: &[&str]) -> String {
    format!("there is no setting {name:?}; the settings are {}{}", keys.join(", "), suggestion(name, keys))
}

/// Parses the value of a setting as a number; `unit` is named in the error.
///
/// # Errors
/// If the value is not a number within the limits.
pub fn number(key: &str, value: &str, unit: &str, limits: RangeInclusive<f64>) -> Result<f64, String> {
    value.parse().ok().filter(|number| limits.contains(number)).ok_or_else(|| {
        let (low, high) = limits.into_inner();
        format!("{key}={value}: a number from {low} to {high} expected ({unit})")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(flag: &str, text: &str) -> Result<Vec<(&'static str, Option<String>)>, String> {
        let keyed = KeyedFlag::from_name(flag).unwrap();
        Ok(keyed.settings(text, |_| true)?.into_iter().map(|one| (one.flag, one.value)).collect())
    }

    fn with(flag: &'static str, value: &str) -> (&'static str, Option<String>) {
        (flag, Some(value.to_owned()))
    }

    #[test]
    fn keys_may_have_no_value() {
        assert_eq!(
            settings("noise", "gain=3, fixed,camera=a=b.toml"),
            Ok(vec![with("gain", "3"), ("fixed", None), with("camera", "a=b.toml")])
        );
    }

    #[test]
    fn plain_value_may_come_first() {
        assert_eq!(
            settings("image", "jpeg:90,max-side=512,first"),
            Ok(vec![with("image", "jpeg:90"), with("max-side", "512"), ("image-first", None)])
        );
        assert_eq!(settings("image", "max-side=512"), Ok(vec![with("max-side", "512")]));
    }

    #[test]
    fn a_plain_value_without_keys_may_have_commas() {
        assert_eq!(settings("images-cache", "a,b=c"), Ok(vec![with("images-cache", "a,b=c")]));
    }

    #[test]
    fn an_unknown_key_is_refused_with_the_nearest_or_all() {
        let problem = settings("noise", "gian=3").unwrap_err();
        assert_eq!(problem, "unknown key \"gian\"; did you mean gain?");
        let problem = settings("stop", "").unwrap_err();
        assert_eq!(problem, "unknown key \"\"; keys: failures, first-model, grace");
        let problem = settings("image", "png,maxside=9").unwrap_err();
        assert_eq!(problem, "unknown key \"maxside\"; did you mean max-side?");
        let problem = settings("image", "png,max-side=9,zoom").unwrap_err();
        assert!(problem.starts_with("unknown key \"zoom\""), "{problem}");
    }

    #[test]
    fn a_key_of_another_command_is_unknown() {
        let keyed = KeyedFlag::from_name("request").unwrap();
        let problem = keyed.settings("constrain=json", |flag| flag != "constrain");
        assert!(problem.unwrap_err().starts_with("unknown key \"constrain\""));
    }

    #[test]
    fn hidden_flags_are_spelled_as_keys() {
        assert_eq!(flag_spelling("gain"), "--noise gain");
        assert_eq!(flag_spelling("image"), "--image");
        assert_eq!(flag_spelling("model"), "--model");
    }

    #[test]
    fn settings_of_manifests_are_spelled_as_keys() {
        for (setting, spelling) in [
            ("--camera, --gain or --fixed", "--noise camera, gain or fixed"),
            ("--camera (name) of paper", "--noise camera (name) of paper"),
            ("--model", "--model"),
            ("--levels of the run --", "--levels of the run --"),
            ("the version", "the version"),
        ] {
            assert_eq!(setting_spelling(setting), spelling);
        }
    }

    #[test]
    fn settings_are_read_in_any_order() {
        let keys = ["speed", "angle"];
        assert_eq!(pairs("angle = 0 , speed=30", &keys).unwrap(), [("angle", "0"), ("speed", "30")]);
        assert_eq!(pairs("speed=a=b", &keys).unwrap(), [("speed", "a=b")]);
        for (wrong, part) in [
            ("sped=3", "there is no setting \"sped\"; the settings are speed, angle; did you mean speed?"),
            ("zoom=3", "the settings are speed, angle"),
            ("", "there is no setting \"\""),
            ("speed", "speed has no value; write speed=VALUE"),
            ("speed=", "speed has no value"),
            ("speed=1,speed=2", "speed is named twice"),
            ("speed=1,", "there is no setting \"\""),
        ] {
            let error = pairs(wrong, &keys).unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
        assert!(!pairs("zoom=3", &keys).unwrap_err().contains("did you mean"));
    }

    #[test]
    fn numbers_outside_the_limits_are_refused() {
        assert_eq!(number("speed", "0.5", "degrees per second", 0.0..=9.0), Ok(0.5));
        for wrong in ["-1", "9.1", "NaN", "inf", "x", "1/2"] {
            let error = number("speed", wrong, "degrees per second", 0.0..=9.0).unwrap_err();
            let expected = format!("speed={wrong}: a number from 0 to 9 expected (degrees per second)");
            assert_eq!(error, expected);
        }
    }
}
