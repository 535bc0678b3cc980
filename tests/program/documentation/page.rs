//! A page of the documentation, and its fenced blocks: [`Page`], [`Block`].

use std::fs;
use std::path::{Path, PathBuf};

/// The list of the pages, in the order in which they are read.
const SUMMARY: &str = "src/docs/SUMMARY.md";

/// One Markdown file.
pub(crate) struct Page {
    /// Path from the root of the repository.
    pub(crate) name: String,
    pub(crate) text: String,
    pub(crate) blocks: Vec<Block>,
}

/// Lines of a page that belong together: those between two fences, or a comment with a line of the test.
pub(crate) struct Block {
    pub(crate) kind: BlockKind,
    /// Number of the line before the first of its lines.
    pub(crate) line: usize,
    pub(crate) lines: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BlockKind {
    /// `<!-- test: … -->`: a shell command that readers do not see and that prepares the next ones.
    SetUp,
    /// `sh`: commands that are run.
    Run,
    /// `sh no-run`: commands that are only parsed.
    ParseOnly,
    /// `text`: lines that commands of the page print.
    Output,
    /// `text first-command`: lines that the first command of the README prints, or the full report on its run.
    FirstCommand,
    Other,
}

/// The folder of the repository.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README and all pages, in the order of the summary.
pub(crate) fn pages() -> Vec<Page> {
    let summary = Page::read(SUMMARY);
    let listed = summary.links().into_iter().map(|(_, link)| link).map(|link| format!("src/docs/{link}"));
    std::iter::once("README.md".to_owned()).chain(listed).map(|name| Page::read(&name)).collect()
}

/// The Markdown files in the folder of the pages, the summary aside.
pub(crate) fn files() -> Vec<String> {
    let entries = fs::read_dir(root().join("src/docs")).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter_map(|name| Some(name.strip_suffix(".md")?.to_owned()))
        .filter(|page| page != "SUMMARY")
        .map(|page| format!("src/docs/{page}.md"))
        .collect()
}

impl Page {
    pub(crate) fn read(name: &str) -> Self {
        let text = fs::read_to_string(root().join(name));
        let text = text.unwrap_or_else(|e| panic!("{name}: {e}"));
        Self { name: name.to_owned(), blocks: blocks(&text), text }
    }

    /// The place of a line for messages.
    pub(crate) fn at(&self, line: usize) -> String {
        format!("{}:{line}", self.name)
    }

    /// The lines outside of fences, with their numbers.
    fn prose(&self) -> impl Iterator<Item = (usize, &str)> {
        let mut is_code = false;
        (1..).zip(self.text.lines()).filter(move |(_, line)| {
            let is_fence = line.starts_with("```");
            is_code ^= is_fence;
            !is_code && !is_fence
        })
    }

    /// The targets of all links and images, with the number of their lines.
    pub(crate) fn links(&self) -> Vec<(usize, &str)> {
        let mut links = Vec::new();
        for (number, line) in self.prose() {
            let targets = line.split("](").skip(1);
            links.extend(targets.filter_map(|rest| Some((number, rest.split_once(')')?.0))));
        }
        links
    }

    /// Whether a link to `#anchor` leads to a heading of the page.
    pub(crate) fn has_anchor(&self, anchor: &str) -> bool {
        self.prose()
            .filter(|(_, line)| line.starts_with('#'))
            .map(|(_, line)| line.trim_start_matches('#').trim())
            .any(|heading| slug(heading) == anchor)
    }

    /// The file that a link from this page leads to, and the anchor in it; `None` for a link to another site.
    pub(crate) fn target<'a>(&self, link: &'a str) -> Option<(PathBuf, &'a str)> {
        const OWN: [&str; 2] = [
            "https://github.com/darkqa-eval/darkqa-eval/blob/main/",
            "https://raw.githubusercontent.com/darkqa-eval/darkqa-eval/main/",
        ];
        let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
        if let Some(path) = OWN.iter().find_map(|own| path.strip_prefix(own)) {
            return Some((root().join(path), anchor));
        }
        if path.contains("://") {
            return None;
        }
        let own = root().join(&self.name);
        if path.is_empty() {
            return Some((own, anchor));
        }
        Some((own.parent()?.join(path), anchor))
    }
}

/// The anchor that GitHub and mdBook make of a heading.
fn slug(heading: &str) -> String {
    heading
        .chars()
        .filter_map(|c| match c {
            ' ' => Some('-'),
            '-' | '_' => Some(c),
            c if c.is_alphanumeric() => Some(c),
            _ => None,
        })
        .collect::<String>()
        .to_lowercase()
}

fn blocks(text: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in (1..).zip(text.lines()) {
        let fence = line.strip_prefix("```");
        match (open.take(), fence) {
            (Some(block), Some(_)) => blocks.push(block),
            (Some(mut block), None) => {
                block.lines.push(line.to_owned());
                open = Some(block);
            }
            (None, Some(kind)) => open = Some(Block::new(BlockKind::of(kind), number)),
            (None, None) => {
                let command = line.strip_prefix("<!-- test: ");
                let command = command.and_then(|rest| rest.strip_suffix(" -->"));
                if let Some(command) = command {
                    let mut block = Block::new(BlockKind::SetUp, number - 1);
                    block.lines.push(command.to_owned());
                    blocks.push(block);
                }
            }
        }
    }
    assert!(open.is_none(), "a fence is not closed: {text}");
    blocks
}

impl Block {
    fn new(kind: BlockKind, line: usize) -> Self {
        Self { kind, line, lines: Vec::new() }
    }
}

impl BlockKind {
    /// The kind of the words behind a fence.
    fn of(words: &str) -> Self {
        match words.trim() {
            "sh" => Self::Run,
            "sh no-run" => Self::ParseOnly,
            "text" => Self::Output,
            "text first-command" => Self::FirstCommand,
            _ => Self::Other,
        }
    }
}

#[test]
fn blocks_have_their_kinds_and_lines() {
    let text = "# T\n\n<!-- test: a -->\n```sh\nb\nc\n```\n```sh no-run\nd\n```\n```text\n```\n```json\n```\n";
    let found = blocks(text);
    let kinds: Vec<(BlockKind, usize, usize)> =
        found.iter().map(|block| (block.kind, block.line, block.lines.len())).collect();
    let expected = [
        (BlockKind::SetUp, 2, 1),
        (BlockKind::Run, 4, 2),
        (BlockKind::ParseOnly, 8, 1),
        (BlockKind::Output, 11, 0),
        (BlockKind::Other, 13, 0),
    ];
    assert_eq!(kinds, expected);
    assert_eq!(slug("What `a-b` is, by_c"), "what-a-b-is-by_c");
}
