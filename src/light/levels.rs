//! The value of `--levels`: [`Levels`].
//!
//! Levels of a run by kind of degradation: the named levels, or the ladder of each kind.

use std::fmt::Display;
use std::str::FromStr;

use super::noise_profile::NoiseProfiles;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, KindSet, PairDark, Severity};

/// Levels in ascending order of degradation, without duplicates.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Levels(pub Vec<AxisLevel>);

/// Maximum number of levels of a run; chosen.
const MAX_LEVELS: usize = 200;

/// Level that is as dark as each frame's own photograph.
const MATCH: &str = "match";

/// Kind that gives the light levels their labels (L1 to L5).
pub(super) const LIGHT: Kind = Kind::ALL[0];

impl FromStr for Levels {
    type Err = String;

    /// Parses items separated by commas, in any order: `L3`, `L0-L5`, a number of EV, `0..10:0.5`, exposure times such
    /// as `T33.33`, or `match` (as dark as each frame's own photograph). Sorts the levels and removes duplicates.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut levels = Vec::new();
        for item in text.split(',').map(str::trim) {
            if item.is_empty() {
                return Err(
                    "a level is missing; write levels as L3, L0-L5, 3.3 (EV), 0..10:0.5 or T33.33 (ms), between commas"
                        .to_owned(),
                );
            } else if item.eq_ignore_ascii_case(MATCH) {
                levels.push(AxisLevel::PAIR);
            } else if let Some((from, rest)) = item.split_once("..") {
                levels.extend(stepped_range(item, from.trim(), rest.trim())?);
            } else if let Some((first, last)) = item.split_once('-') {
                levels.extend(named_range(item, first.trim(), last.trim())?);
            } else {
                levels.push(parse_level(item)?);
            }
        }
        levels.sort_unstable();
        levels.dedup();
        if levels.len() > MAX_LEVELS {
            return Err(format!("{} levels; at most {MAX_LEVELS} are possible", levels.len()));
        }
        Ok(Self(levels))
    }
}

/// Splits the axis letter from a text: returns a kind on that axis and the rest of the text.
fn split_axis(text: &str) -> (Kind, &str) {
    match text.strip_prefix(['T', 't']).filter(|rest| is_number(rest)) {
        Some(number) => (Kind::Motion, number),
        None => (LIGHT, text),
    }
}

/// A number on the axis of a kind, in the form used in ranges.
fn range_number(kind: Kind, number: impl Display) -> String {
    match kind {
        Kind::Motion => format!("T{number}"),
        _ => number.to_string(),
    }
}

/// Example of a range with a step on the axis of a kind.
fn example_range(kind: Kind) -> &'static str {
    match kind {
        Kind::Motion => "T10..T100:10",
        _ => "0..10:0.5",
    }
}

/// L0 and the levels of a kind's ladder.
pub(super) fn ladder(kind: Kind) -> Vec<AxisLevel> {
    let ladder = kind.ladder().iter().map(|severity| AxisLevel::new(kind, *severity));
    std::iter::once(AxisLevel::L0).chain(ladder).collect()
}

/// Parses a range of named levels, such as `L1-L4` or `T8.33-T133.33`. `item` is the text of the range.
fn named_range(item: &str, first: &str, last: &str) -> Result<Vec<AxisLevel>, String> {
    if first.is_empty() {
        return Err(format!(
            "{item:?} is below 0; an exposure drop is a number of EV from 0 to {}",
            LIGHT.max_severity()
        ));
    }
    if is_number(first) && is_number(last) {
        return Err(format!(
            "{item:?} is not a range; write L0-L5 for the paper's levels, or {first}..{last}:0.5 for exposure drops in EV with a step of 0.5"
        ));
    }
    let (kind, _) = split_axis(last);
    let (from, to) = (parse_level(first)?, parse_level(last)?);
    let ladder = ladder(kind);
    let are_named = !is_number(first) && !is_number(last) && ladder.contains(&from) && ladder.contains(&to);
    if !are_named {
        let names: Vec<String> = ladder.iter().map(ToString::to_string).collect();
        return Err(format!(
            "{item:?}: the ends of a range with a dash are two of {}; write {}..{}:{} for {}s in {} with a step of {}",
            names.join(", "),
            range_number(kind, from.value()),
            range_number(kind, to.value()),
            example_step(kind),
            kind.axis().title,
            kind.axis().unit,
            example_step(kind)
        ));
    }
    if from > to {
        return Err(format!("{item:?} runs backwards; write {to}-{from}"));
    }
    let range = from..=to;
    Ok(ladder.into_iter().filter(|level| range.contains(level)).collect())
}

/// Step of an example range on the axis of a kind.
fn example_step(kind: Kind) -> &'static str {
    match kind {
        Kind::Motion => "10",
        _ => "0.5",
    }
}

/// Parses a range with a step, such as `0..10:0.5`. The end is included if a step meets it. `item` is the text of the
/// range.
fn stepped_range(item: &str, from: &str, rest: &str) -> Result<Vec<AxisLevel>, String> {
    let (kind, number) = split_axis(from);
    let unit = kind.axis().unit;
    let Some((to, by)) = rest.split_once(':') else {
        return Err(format!(
            "{item:?} has no step; write FROM..TO:STEP in {unit}, as {from}..{rest}:{}",
            example_step(kind)
        ));
    };
    let to = match split_axis(to.trim()) {
        (same, number) if same == kind => number,
        _ => to,
    };
    let (from, to) = (hundredths(item, kind, number)?, hundredths(item, kind, to)?);
    let step = hundredths(item, kind, by)?;
    if step == 0 {
        return Err(format!("{item:?} has a step of 0; the step is at least 0.01 {unit}"));
    }
    if from > to {
        return Err(format!(
            "{item:?} runs backwards; write {}..{}:{}",
            range_number(kind, f64::from(to) / 100.0),
            range_number(kind, f64::from(from) / 100.0),
            f64::from(step) / 100.0
        ));
    }
    Ok((from..=to)
        .step_by(usize::from(step))
        .map(|severity| match severity {
            0 => AxisLevel::L0,
            severity => AxisLevel::new(kind, Severity::from_hundredths(severity)),
        })
        .collect())
}

/// Parses a number of a range on the axis of a kind, in hundredths of the unit of the axis.
fn hundredths(item: &str, kind: Kind, number: &str) -> Result<u16, String> {
    let number = number.trim();
    if !is_number(number) {
        return Err(format!(
            "{item:?}: {number:?} is not a number; write FROM..TO:STEP in {}, as {}",
            kind.axis().unit,
            example_range(kind)
        ));
    }
    let level = parse_number(kind, number).map_err(|problem| format!("{item:?}: {problem}"))?;
    Ok(level.severity().map_or(0, Severity::hundredths))
}

/// Parses one level: a name, a number of EV, or an exposure time as T33.33.
fn parse_level(text: &str) -> Result<AxisLevel, String> {
    let (kind, number) = split_axis(text);
    if text.eq_ignore_ascii_case("L0") {
        return Ok(AxisLevel::L0);
    }
    if text.to_ascii_lowercase().ends_with("lux") {
        return Err(format!(
            "{text:?}: a level is an exposure drop in EV, not lux. Measure the lux where the images were taken; each EV halves it: from \
             200 lux, 2 lux are log2(200 / 2) = 6.6"
        ));
    }
    if is_number(number) {
        return parse_number(kind, number);
    }
    let severity = kind.severity(text).map_err(|e| e.to_string())?;
    Ok(AxisLevel::new(kind, severity))
}

fn is_number(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit())
}

/// Parses a number on the axis of a kind as a level.
fn parse_number(kind: Kind, number: &str) -> Result<AxisLevel, String> {
    if number.parse::<f64>() == Ok(0.0) {
        return Ok(AxisLevel::L0);
    }
    if number.parse().is_ok_and(|value: f64| value > kind.max_severity().value()) {
        return Err(format!("{number:?} is above {} {}, the maximum", kind.max_severity(), kind.axis().unit));
    }
    let severity = number.parse::<Severity>().map_err(|e| e.to_string())?;
    Ok(AxisLevel::new(kind, severity))
}

impl Levels {
    /// The levels of a run with these kinds. If the light levels are L0 to L5 (the default), kinds on an axis without a
    /// named level get their own ladder.
    ///
    /// # Errors
    /// If a kind has no level, or a level has no kind.
    pub(super) fn for_kinds(&self, kinds: KindSet) -> Result<Vec<AxisLevel>> {
        let mut levels = self.0.clone();
        levels.retain(|level| *level != AxisLevel::PAIR);
        let is_clean = levels.iter().all(|level| level.severity().is_none());
        let has_ladders = levels.iter().filter(|level| level.axis() != Some(Axis::MOTION)).eq(&ladder(LIGHT));
        for axis in Axis::ALL.into_iter().filter(|_| !is_clean) {
            let kind = kinds.kinds().find(|kind| kind.axis() == axis);
            let level = self.0.iter().find(|level| level.axis() == Some(axis));
            match (kind, level) {
                (Some(kind), None) if has_ladders => levels.extend(ladder(kind)),
                (Some(kind), None) => {
                    let [first, last] = ladder_ends(kind);
                    let problem = format_args!(
                        "no level of {kind} is named; add {first}-{last}, or leave out {kind} in --variant"
                    );
                    return Err(Error::usage("--levels", problem));
                }
                (None, Some(_)) if axis == Axis::LIGHT && has_ladders => {
                    levels.retain(|level| level.axis() != Some(axis));
                }
                (None, Some(level)) => {
                    let words: Vec<&str> =
                        Kind::ALL.into_iter().filter(|kind| kind.axis() == axis).map(Kind::word).collect();
                    let problem = format_args!(
                        "{level} is a level of {}, but --variant {kinds} selects none of them",
                        words.join(", ")
                    );
                    return Err(Error::usage("--levels", problem));
                }
                (Some(_), Some(_)) | (None, None) => {}
            }
        }
        levels.sort_unstable();
        levels.dedup();
        Ok(levels)
    }

    /// The kinds and profiles for synthetic images that are as dark as each frame's own photograph; empty unless the
    /// levels include `match`.
    ///
    /// # Errors
    /// If the levels include `match`, but no kind reduces the light.
    pub(super) fn matches(&self, kinds: KindSet, readings: &NoiseProfiles) -> Result<Vec<PairDark>> {
        if !self.0.contains(&AxisLevel::PAIR) {
            return Ok(Vec::new());
        }
        let mut all = Vec::new();
        for kind in kinds.kinds().filter(|kind| kind.can_match()) {
            if kind.has_profiles() {
                let readings = readings.iter().map(|(name, _)| Some(name.clone()));
                all.extend(readings.map(|reading| PairDark::Match(kind, reading)));
            } else {
                all.push(PairDark::Match(kind, None));
            }
        }
        if all.is_empty() {
            let problem =
                format_args!("match reduces the light, which --variant {kinds} does not; add ev or noise to it");
            return Err(Error::usage("--levels", problem));
        }
        Ok(all)
    }
}

/// Labels of the first and the last level of a kind's ladder.
fn ladder_ends(kind: Kind) -> [String; 2] {
    let ladder = kind.ladder();
    [ladder.first(), ladder.last()].map(|severity| severity.map_or(String::new(), |severity| kind.label(*severity)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        let Levels(levels) = text.parse().unwrap();
        levels.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn levels_are_parsed_in_any_form() {
        assert_eq!(names("L0-L5"), ["L0", "L1", "L2", "L3", "L4", "L5"]);
        assert_eq!(names("l3, L0,L3"), ["L0", "L3"]);
        assert_eq!(names("L4-L5,3.30,6,0,E11"), ["L0", "E3.3", "L3", "L4", "L5", "E11"]);
    }

    #[test]
    fn ranges_use_the_names_of_the_papers_levels() {
        assert_eq!(names("0..10:2.5"), ["L0", "E2.5", "E5", "L4", "E10"], "both ends");
        assert_eq!(names("2 .. 7 : 2"), ["L1", "L2", "L3"], "no step ends at 7");
        assert_eq!(names("9..9:1,L5,9.0"), ["L5"], "once");
        assert_eq!(names("0..16:0.1").len(), 161);
        assert_eq!(names("14.01..16:0.01").len(), 200);
        assert_eq!(names("L0,3..4:0.25,L1-L2").len(), 7);
    }

    #[test]
    fn match_is_a_level() {
        assert_eq!(names("match,L0"), ["L0", "dark"]);
        assert_eq!("match".parse(), Ok(Levels(vec![AxisLevel::PAIR])));
        assert!("match-L3".parse::<Levels>().is_err());
    }

    #[test]
    fn exposure_times_have_a_letter() {
        assert_eq!(names("T33.33, t5,T0,L1"), ["L0", "L1", "T5", "T33.33"]);
        assert_eq!(names("T8.33-T33.33"), ["T8.33", "T16.67", "T33.33"]);
        assert_eq!(names("L0-T133.33").len(), 6, "L0 and the ladder of exposure times");
        assert_eq!(names("T10..T30:10"), ["T10", "T20", "T30"]);
        assert_eq!(names("T0..30:15,T5.50"), ["L0", "T5.5", "T15", "T30"]);
        for (wrong, part) in [
            ("T600", "\"600\" is above 500 ms, the maximum"),
            ("T3.333", "has more than two decimals"),
            ("T10..T50", "\"T10..T50\" has no step; write FROM..TO:STEP in ms, as T10..T50:10"),
            ("T50..T10:5", "runs backwards; write T10..T50:5"),
            ("10..T50:5", "\"T50\" is not a number; write FROM..TO:STEP in EV"),
            (
                "T10-T20",
                "are two of L0, T8.33, T16.67, T33.33, T66.67, T133.33; write T10..T20:10 for exposure times in ms",
            ),
            ("T33.33-T8.33", "runs backwards; write T8.33-T33.33"),
            ("L1-T33.33", "are two of L0, T8.33"),
            ("typo", "\"typo\" is not one of L0, L1"),
        ] {
            let error = wrong.parse::<Levels>().unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }

    #[test]
    fn errors_name_the_wrong_level_and_the_right_form() {
        for (wrong, part) in [
            ("L6", "\"L6\" is not one of L0, L1"),
            ("", "a level is missing; write levels as"),
            ("L0,,L3", "a level is missing"),
            ("L3-L1", "\"L3-L1\" runs backwards; write L1-L3"),
            ("0-5", "write L0-L5 for the paper's levels, or 0..5:0.5"),
            ("L0,L1-E5", "\"L1-E5\": the ends of a range with a dash are two of L0"),
            ("L1-5", "write 2..5:0.5"),
            ("3.333", "\"3.333\" has more than two decimals"),
            ("16.5", "\"16.5\" is above 16 EV"),
            ("700", "\"700\" is above 16 EV"),
            ("99999", "\"99999\" is above 16 EV"),
            ("-2", "\"-2\" is below 0"),
            ("E2", "is written L1"),
            ("0..10", "\"0..10\" has no step; write FROM..TO:STEP in EV, as 0..10:0.5"),
            ("10..0:2", "\"10..0:2\" runs backwards; write 0..10:2"),
            ("0..10:0", "a step of 0; the step is at least 0.01 EV"),
            ("0..10:0.001", "\"0..10:0.001\": level: \"0.001\" has more than two decimals"),
            ("0..20:1", "\"0..20:1\": \"20\" is above 16 EV"),
            ("L0..L5:1", "\"L0..L5:1\": \"L0\" is not a number; write FROM..TO:STEP in EV"),
            ("0..10:", "\"\" is not a number"),
            ("..10:1", "\"\" is not a number"),
            ("0..10:1:2", "is not a decimal number"),
            ("0..16:0.01", "1601 levels; at most 200 are possible"),
        ] {
            let error = wrong.parse::<Levels>().unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }

    fn resolve(levels: &str, kinds: &str) -> std::result::Result<String, String> {
        let levels: Levels = levels.parse().unwrap();
        let levels = levels.for_kinds(kinds.parse().unwrap()).map_err(|e| e.to_string())?;
        let names: Vec<String> = levels.iter().map(ToString::to_string).collect();
        Ok(names.join(" "))
    }

    #[test]
    fn each_kind_has_its_levels() {
        let light = "L0 L1 L2 L3 L4 L5";
        let times = "T8.33 T16.67 T33.33 T66.67 T133.33";
        for (levels, kinds, expected) in [
            ("L0-L5", "both", light.to_owned()),
            ("L0-L5", "auto", light.to_owned()),
            ("L0-L5", "motion", format!("L0 {times}")),
            ("L0-L5", "all", format!("{light} {times}")),
            ("L0-L5,T5", "ev,motion", format!("{light} T5")),
            ("L0,T5", "motion", "L0 T5".to_owned()),
            ("L3,T5", "noise,motion", "L3 T5".to_owned()),
            ("L0,3.3", "auto", "L0 E3.3".to_owned()),
            ("L0", "all", "L0".to_owned()),
        ] {
            assert_eq!(resolve(levels, kinds), Ok(expected), "{levels} {kinds}");
        }
        for (levels, kinds, part) in [
            (
                "L0,L3",
                "noise,motion",
                "--levels: no level of motion is named; add T8.33-T133.33, or leave out motion in --variant",
            ),
            ("T5", "both,motion", "no level of ev is named; add L1-L5"),
            ("L0,L3", "motion", "L3 is a level of ev, noise, auto, but --variant motion selects none of them"),
            ("L0-L5,2.5", "motion", "L1 is a level of ev, noise, auto"),
            ("L0-L5,T5", "both", "T5 is a level of motion, but --variant both selects none of them"),
        ] {
            let error = resolve(levels, kinds).unwrap_err();
            assert!(error.contains(part), "{levels} {kinds}: {error}");
        }
    }
}
