//! Lists and objects written in a text: [`parse_list`], [`parse_object`].
//!
//! Parser for lists and dictionaries in Python's notation: [`python_list`], [`python_dict`].

use serde_json::Value;

/// Parses a list in JSON, or else in the notation of Python or NumPy; `None` if the text is not a list of scalars.
pub(crate) fn parse_list(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    if !text.starts_with(['[', '(']) || !has_few_values(text) {
        return None;
    }
    serde_json::from_str::<Vec<Value>>(text)
        .ok()
        .and_then(|items| items.iter().map(scalar_text).collect())
        .or_else(|| python_list(text))
}

/// Parses an object in JSON, or else a dictionary in Python's notation, to names and values; `None` if the text is not
/// an object of scalars. A value is `None` if it is null.
pub(crate) fn parse_object(text: &str) -> Option<Vec<(String, Option<String>)>> {
    let text = text.trim();
    if !text.starts_with('{') || !has_few_values(text) {
        return None;
    }
    serde_json::from_str::<serde_json::Map<String, Value>>(text)
        .ok()
        .and_then(|fields| {
            fields
                .iter()
                .map(|(name, value)| match value {
                    Value::Null => Some((name.clone(), None)),
                    value => Some((name.clone(), Some(scalar_text(value)?))),
                })
                .collect()
        })
        .or_else(|| python_dict(text))
}

/// True if a text has at most about a million values, which limits the memory to parse it.
fn has_few_values(text: &str) -> bool {
    text.bytes().filter(|byte| matches!(byte, b',' | b'[' | b'{')).count() <= 1 << 20
}

/// Text of a string, number or truth value.
fn scalar_text(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(_) | Value::Bool(_) => Some(value.to_string()),
        _ => None,
    }
}

/// Parses a list such as `['it\'s', "b", 3]`, a tuple of strings, or an array of strings as NumPy prints it (`['a'
/// 'b']`) to texts; `None` if the text is anything else. Nothing is evaluated.
///
/// Items are strings in single or double quotes with the escapes of Python's `repr` (The Python Language Reference,
/// 2.4.1), numbers, and the words `True`, `False` and `None`.
pub(super) fn python_list(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    let is_tuple = text.starts_with('(');
    let close = if is_tuple { ')' } else { ']' };
    let mut rest = text.strip_prefix(['[', '('])?.trim_start();
    let mut items = Vec::new();
    // NumPy has no commas between items; the first separator decides.
    let mut has_commas = None;
    loop {
        if let Some(end) = rest.strip_prefix(close) {
            let is_list = !is_tuple || has_commas == Some(true);
            return (is_list && end.trim().is_empty()).then_some(items);
        }
        let (item, after) = match rest.chars().next()? {
            quote @ ('\'' | '"') => parse_quoted(&rest[1..], quote)?,
            _ if is_tuple => return None,
            _ => parse_bare(rest)?,
        };
        items.push(item);
        let after_space = after.trim_start();
        let after_comma = after_space.strip_prefix(',');
        let is_end = after_space.starts_with(close);
        if !is_end && *has_commas.get_or_insert(after_comma.is_some()) != after_comma.is_some() {
            return None;
        }
        rest = after_comma.unwrap_or(after_space).trim_start();
    }
}

/// Parses a dictionary such as `{'A': 'red', "B": 2}` to names and values, where Python's `None` has no value; `None`
/// if the text is anything else. Nothing is evaluated.
fn python_dict(text: &str) -> Option<Vec<(String, Option<String>)>> {
    let mut rest = text.trim().strip_prefix('{')?.trim_start();
    let mut fields = Vec::new();
    loop {
        if let Some(end) = rest.strip_prefix('}') {
            return end.trim().is_empty().then_some(fields);
        }
        let quote = rest.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
        let (name, after) = parse_quoted(&rest[1..], quote)?;
        let after = after.trim_start().strip_prefix(':')?.trim_start();
        let (value, after) = match after.chars().next()? {
            quote @ ('\'' | '"') => parse_quoted(&after[1..], quote).map(|(value, end)| (Some(value), end))?,
            _ => parse_bare(after).map(|(value, end)| ((value != "None").then_some(value), end))?,
        };
        fields.push((name, value));
        rest = after.trim_start();
        match rest.strip_prefix(',') {
            Some(more) => rest = more.trim_start(),
            None if rest.starts_with('}') => {}
            None => return None,
        }
    }
}

/// Parses a string up to its closing quote. Returns it with the remaining text.
fn parse_quoted(text: &str, quote: char) -> Option<(String, &str)> {
    let mut item = String::new();
    let mut chars = text.char_indices();
    while let Some((at, c)) = chars.next() {
        match c {
            '\\' => item.push(parse_escape(&mut chars)?),
            c if c == quote => return Some((item, &text[at + 1..])),
            c => item.push(c),
        }
    }
    None
}

/// Parses an escape sequence after its backslash.
fn parse_escape(chars: &mut std::str::CharIndices<'_>) -> Option<char> {
    let digits = match chars.next()?.1 {
        'n' => return Some('\n'),
        'r' => return Some('\r'),
        't' => return Some('\t'),
        c @ ('\\' | '\'' | '"') => return Some(c),
        'x' => 2,
        'u' => 4,
        'U' => 8,
        _ => return None,
    };
    let code: String = chars.by_ref().take(digits).map(|(_, c)| c).collect();
    (code.len() == digits).then(|| u32::from_str_radix(&code, 16).ok()).flatten().and_then(char::from_u32)
}

/// Parses a number, `True`, `False` or `None`. Returns it with the remaining text.
fn parse_bare(text: &str) -> Option<(String, &str)> {
    let (item, rest) = text.split_at(text.find([',', ']', '}'])?);
    let item = item.trim();
    let is_known = matches!(item, "True" | "False" | "None") || item.parse::<f64>().is_ok();
    is_known.then(|| (item.to_owned(), rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(name: &str, text: Option<&str>) -> (String, Option<String>) {
        (name.to_owned(), text.map(str::to_owned))
    }

    #[test]
    fn python_literals_are_parsed_and_code_is_not() {
        for (text, items) in [
            (r#"['a', "b"]"#, vec!["a", "b"]),
            (r#"['it\'s', "it's", "say \"x\""]"#, vec!["it's", "it's", "say \"x\""]),
            (r"['\xe9', '\u00e9', 'a\nb']", vec!["é", "é", "a\nb"]),
            ("[1, 2.5, None, ]", vec!["1", "2.5", "None"]),
            ("[]", vec![]),
            ("('a', \"b\")", vec!["a", "b"]),
            ("('a',)", vec!["a"]),
            ("['a' \"it's\"\n 'c']", vec!["a", "it's", "c"]),
        ] {
            assert_eq!(python_list(text).unwrap(), items, "{text}");
        }
        assert_eq!(
            python_dict(r#"{'A': 'it\'s', "B": 2, 'C': None}"#).unwrap(),
            [pair("A", Some("it's")), pair("B", Some("2")), pair("C", None)]
        );
        for text in ["{'a'}", "{'a': }", "{a: 'b'}", "{'a': open('x')}", "{'a': 'b'"] {
            assert_eq!(python_dict(text), None, "{text}");
        }
        for text in [
            "['a'",
            "['a' 'b', 'c']",
            "['a', 'b' 'c']",
            "['a'] + x",
            "[open('x')]",
            "('a')",
            "('a' 'b')",
            "(1, 2)",
            "('a', 'b']",
            "['\\x4']",
            "a, b",
            "[,]",
        ] {
            assert_eq!(python_list(text), None, "{text}");
        }
    }
}
