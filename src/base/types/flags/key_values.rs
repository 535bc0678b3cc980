//! Flags whose value is a list of settings, as `speed=30,angle=0`: [`pairs`] and [`number`].
//!
//! Errors name the fault and the expected value; the command line adds the name of the flag.

use std::ops::RangeInclusive;

use crate::types::text::near_name::suggestion;

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
