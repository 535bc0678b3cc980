//! Patterns of paths in `info.json`, such as `data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet`: [`fill`].

use std::fmt::Write as _;

/// Maximum width of a number (chosen); LeRobot uses 3 and 6.
const MAX_WIDTH: usize = 20;

/// Value of a field of a pattern.
#[derive(Debug, Clone, Copy)]
pub(super) enum FieldValue<'a> {
    Text(&'a str),
    Number(u64),
}

/// Replaces the fields of a pattern, in the syntax of Python's `str.format`: `{name}`, or `{name:06d}` for a number
/// with six digits.
///
/// # Errors
/// If the pattern has another field or another syntax.
pub(super) fn fill(pattern: &str, fields: &[(&str, FieldValue<'_>)]) -> Result<String, String> {
    let mut path = String::new();
    let mut rest = pattern;
    while let Some((before, after)) = rest.split_once('{') {
        let (field, after) = after.split_once('}').ok_or_else(|| format!("{pattern:?} has a {{ without a }}"))?;
        let (name, format) = field.split_once(':').unwrap_or((field, ""));
        let value = fields
            .iter()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| {
                let known: Vec<&str> = fields.iter().map(|(known, _)| *known).collect();
                format!("{pattern:?} has the field {name:?}; one of {} expected", known.join(", "))
            })?
            .1;
        path.push_str(before);
        match value {
            FieldValue::Text(text) if format.is_empty() => path.push_str(text),
            FieldValue::Number(number) => {
                let width = width(format)
                    .ok_or_else(|| format!("{pattern:?} has the format {format:?}; one such as 03d expected"))?;
                let _ = write!(path, "{number:0width$}");
            }
            FieldValue::Text(_) => return Err(format!("{pattern:?} has a format for {name}")),
        }
        rest = after;
    }
    path.push_str(rest);
    Ok(path)
}

/// Width in a format such as `03d`, or 0 for an empty one; `None` for other formats.
fn width(format: &str) -> Option<usize> {
    let digits = format.strip_suffix('d').unwrap_or(format);
    if digits.is_empty() {
        return Some(0);
    }
    let digits = digits.strip_prefix('0')?;
    digits.parse().ok().filter(|width| *width <= MAX_WIDTH)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIELDS: [(&str, FieldValue<'_>); 3] = [
        ("video_key", FieldValue::Text("observation.images.top")),
        ("chunk_index", FieldValue::Number(2)),
        ("episode_index", FieldValue::Number(1_234_567)),
    ];

    #[test]
    fn fields_are_replaced() {
        for (pattern, expected) in [
            ("videos/{video_key}/chunk-{chunk_index:03d}/x.mp4", "videos/observation.images.top/chunk-002/x.mp4"),
            ("{chunk_index}/{chunk_index:d}/{episode_index:06d}", "2/2/1234567"),
            ("plain", "plain"),
        ] {
            assert_eq!(fill(pattern, &FIELDS).unwrap(), expected);
        }
    }

    #[test]
    fn other_patterns_are_refused() {
        for (pattern, problem) in [
            ("{chunk_index", "without a }"),
            ("{other:03d}", "the field \"other\""),
            ("{chunk_index:>3}", "the format \">3\""),
            ("{chunk_index:0999999999d}", "the format \"0999999999d\""),
            ("{video_key:03d}", "a format for video_key"),
            ("{chunk_index.__class__}", "the field"),
        ] {
            let error = fill(pattern, &FIELDS).unwrap_err();
            assert!(error.contains(problem), "{pattern}: {error}");
        }
    }
}
