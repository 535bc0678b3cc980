//! The commands in lines of a shell: [`commands`].

/// The simple commands in the lines of a block, each with the number of its line (from 0) and its words.
///
/// Quotes, escapes, comments, continued lines, lists, pipes and redirections are understood as far as the documentation
/// uses them. Variables stay as they are.
pub(crate) fn commands(lines: &[String]) -> Vec<(usize, Vec<String>)> {
    let mut found = Vec::new();
    let (mut logical, mut first) = (String::new(), 0);
    for (number, line) in lines.iter().enumerate() {
        if logical.is_empty() {
            first = number;
        }
        if let Some(begin) = line.strip_suffix('\\') {
            logical += begin;
            continue;
        }
        logical += line;
        let simple = simple_commands(&logical).into_iter();
        found.extend(simple.map(|words| (first, words)));
        logical.clear();
    }
    found
}

fn simple_commands(line: &str) -> Vec<Vec<String>> {
    let mut reader = Reader { commands: vec![Vec::new()], ..Reader::default() };
    let mut quote = None;
    let mut chars = line.chars();
    while let Some(c) = chars.next() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None | Some('"'), '\\') => reader.push(chars.next().unwrap_or('\\')),
            (None, '\'' | '"') => {
                quote = Some(c);
                reader.word.get_or_insert_default();
            }
            (None, '#') if reader.word.is_none() => break,
            (None, '|' | ';' | '&') => {
                reader.end_word();
                reader.commands.push(Vec::new());
            }
            (None, '>' | '<') => {
                reader.end_word();
                reader.names_a_file = true;
            }
            (None, c) if c.is_whitespace() => reader.end_word(),
            (_, c) => reader.push(c),
        }
    }
    reader.end_word();
    reader.commands.retain(|words| !words.is_empty());
    reader.commands
}

#[derive(Default)]
struct Reader {
    commands: Vec<Vec<String>>,
    /// The word that is being read; an empty one was opened by a quote.
    word: Option<String>,
    /// The next word is the file of a redirection, and not a word of the command.
    names_a_file: bool,
}

impl Reader {
    fn push(&mut self, c: char) {
        self.word.get_or_insert_default().push(c);
    }

    fn end_word(&mut self) {
        let Some(word) = self.word.take() else {
            return;
        };
        if std::mem::take(&mut self.names_a_file) {
            return;
        }
        if let Some(command) = self.commands.last_mut() {
            command.push(word);
        }
    }
}

#[test]
fn command_splitting_follows_shell() {
    let lines = ["A=1 b 'c d' \"e $F\" g\\ h # i", "j \\", "  --k 'l|m' > n | o && p; q", "# r"];
    let found = commands(&lines.map(str::to_owned));
    let expected = [
        (0, vec!["A=1", "b", "c d", "e $F", "g h"]),
        (1, vec!["j", "--k", "l|m"]),
        (1, vec!["o"]),
        (1, vec!["p"]),
        (1, vec!["q"]),
    ];
    let expected = expected.map(|(line, words)| (line, words.into_iter().map(str::to_owned).collect()));
    assert_eq!(found, expected);
}
