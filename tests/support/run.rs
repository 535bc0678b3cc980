//! A call of the program in an empty folder, and what it left there.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use boon::{Compiler, SchemaIndex, Schemas};
use serde_json::Value;
use tempfile::TempDir;

use super::rooms::rooms;

/// The path of the program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_darkqa-eval");

/// An empty folder in which the program is called.
pub struct Bench {
    folder: TempDir,
}

/// Exit code and output of a call.
#[derive(Debug)]
pub struct Called {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Called {
    /// The same call, which must have ended with this code.
    pub fn ended(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:?}");
        self
    }
}

impl Bench {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A folder with `set.jsonl`: `count` questions with three choices about one small brown picture; the third is
    /// true.
    pub fn with_questions(count: usize) -> Self {
        let bench = Self::new();
        let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([90, 60, 30]));
        picture.save(bench.path("a.png")).unwrap();
        let lines = (0..count).map(|i| {
            let question = serde_json::json!({
                "id": format!("q{i}"), "image": "a.png", "family": "color",
                "question": format!("What color is it, {i}?"),
                "choices": ["red", "blue", "brown"], "answer": "brown",
            });
            format!("{question}\n")
        });
        bench.file("set.jsonl", lines.collect::<String>());
        bench
    }

    /// Writes a file.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, content).unwrap();
        path
    }

    /// Writes a shell script as a program into the folder `bin`.
    #[cfg(unix)]
    pub fn program(&self, name: &str, script: &str) {
        use std::os::unix::fs::PermissionsExt as _;

        let path = self.file(&format!("bin/{name}"), format!("#!/bin/sh\n{script}\n"));
        fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Value of `PATH` by which the programs in `bin` are found before others.
    pub fn search_path(&self) -> OsString {
        let system = std::env::var_os("PATH").unwrap_or_default();
        let folders = std::iter::once(self.path("bin")).chain(std::env::split_paths(&system));
        std::env::join_paths(folders).unwrap()
    }

    /// The program without any setting of the surroundings, the network's proxies aside.
    pub fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(PROGRAM);
        for (name, _) in std::env::vars() {
            if ["OPENAI_", "DARKQA_", "RUST_LOG", "CLICOLOR", "NO_COLOR"].iter().any(|begin| name.starts_with(begin)) {
                command.env_remove(name);
            }
        }
        // Where no data are named: few rooms, and small ones.
        command.env("DARKQA_DATA", rooms(6, "120x90"));
        // A wide terminal, so that a line of a table is one line.
        command.env("COLUMNS", "400");
        command.current_dir(self.folder.path()).args(words);
        command
    }

    pub fn call(&self, words: &[&str]) -> Called {
        called(&mut self.command(words))
    }

    /// A call that finds the programs in `bin` before others.
    pub fn call_with_programs(&self, words: &[&str]) -> Called {
        called(self.command(words).env("PATH", self.search_path()))
    }

    /// A call that must end with everything scored.
    pub fn complete(&self, words: &[&str]) -> String {
        let called = self.call(words);
        assert_eq!(called.code, Some(0), "{words:?}: {called:?}");
        called.stdout
    }
}

/// The words of a line.
pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// The arguments for the model `m` of an endpoint, and more of them in one line.
pub fn model_args<'a>(base_url: &'a str, line: &'a str) -> Vec<&'a str> {
    let model = ["--model", "m", "--base-url", base_url];
    [&model[..], &words(line)].concat()
}

pub fn called(command: &mut Command) -> Called {
    let output = command.output().unwrap();
    Called {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Schemas of the lines of `records.jsonl`: for questions with choices, and for open ones.
static SCHEMAS: LazyLock<(Schemas, [SchemaIndex; 2])> = LazyLock::new(|| {
    let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
    let indices = [
        ("choice", include_str!("../data/record.schema.json")),
        ("open", include_str!("../data/open_record.schema.json")),
    ]
    .map(|(name, text)| {
        let place = format!("memory:///{name}");
        compiler.add_resource(&place, serde_json::from_str(text).unwrap()).unwrap();
        compiler.compile(&place, &mut schemas).unwrap()
    });
    (schemas, indices)
});

/// The records of a run, in the order of the file; each is held to the schema of its kind.
pub fn records(run: &Path) -> Vec<Value> {
    let text = fs::read_to_string(run.join("records.jsonl")).unwrap();
    let records: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for record in &records {
        let open = record.get("step").is_some();
        let (schemas, indices) = &*SCHEMAS;
        if let Err(breach) = schemas.validate(record, indices[usize::from(open)]) {
            panic!("{breach}: {record}");
        }
    }
    records
}

/// Every file below a folder.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] })
        .collect()
}

/// Asserts that all files of two runs are the same bytes, but for those that hold times or the name of the run. Returns
/// how many files were compared.
pub fn assert_same_products(run: &Path, other: &Path) -> usize {
    let timed = [
        "manifest.json",
        "records.jsonl",
        "records.parquet",
        "summary.json",
        "report.html",
        "thumbnails.jsonl",
        "fidelity.jsonl",
    ];
    let mut compared = 0;
    for path in files(run) {
        let name = path.strip_prefix(run).unwrap();
        if timed.iter().any(|timed| name.ends_with(timed)) {
            continue;
        }
        assert_eq!(fs::read(&path).unwrap(), fs::read(other.join(name)).unwrap(), "{}", name.display());
        compared += 1;
    }
    compared
}
