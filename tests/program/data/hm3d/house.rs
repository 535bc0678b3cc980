//! A stand-in for HM3D on disk, and the calls of the script and of the program over it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::support::run::PROGRAM;

/// Configurations of a data set: one with annotations, one without.
pub(super) const ANNOTATED: &str = "annotated.scene_dataset_config.json";
pub(super) const PLAIN: &str = "plain.scene_dataset_config.json";

/// The instances of a scene, as HM3D-Sem names them.
const ANNOTATION: &str = "HM3D Semantic Annotations\n1,A1,\"wall\",0\n2,A2,\"floor\",0\n3,A3,\"bed\",0\n4,A4,\"chair\",0\n\
    5,A5,\"table\",0\n6,A6,\"cabinet\",0\n7,A7,\"couch\",0\n8,A8,\"tv\",0\n";

/// The size of renders.
const SIZE: &str = "64x48";

/// A folder with `HM3D`, `states` and what is made of them.
pub(super) struct House(TempDir);

impl House {
    pub(super) fn new() -> Self {
        let house = Self(tempfile::tempdir().unwrap());
        fs::create_dir_all(house.path("HM3D/val")).unwrap();
        fs::create_dir_all(house.path("modules")).unwrap();
        fs::write(house.path("modules/habitat_sim.py"), include_str!("habitat_sim.py")).unwrap();
        fs::write(house.path("write_states.py"), include_str!("write_states.py")).unwrap();
        for (name, annotated) in [(ANNOTATED, true), (PLAIN, false)] {
            let stages = json!({
                "paths": {".glb": ["val/*/*.basis.glb"]},
                "default_attributes": {"has_semantic_textures": annotated},
            });
            let config = json!({"stages": stages}).to_string();
            fs::write(house.path("HM3D").join(name), config).unwrap();
        }
        house
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A room of 6 m by 5 m with six pieces of furniture. One can walk between them, on a small island apart, and
    /// upstairs, where nothing is seen.
    pub(super) fn scene(&self, name: &str) {
        let (_, hash) = name.split_once('-').unwrap();
        let folder = self.path("HM3D/val").join(name);
        fs::create_dir(&folder).unwrap();
        let scene = json!({
            "room": [0, 0, 0, 6, 2.6, 5],
            "boxes": [
                [3, [0.2, 0, 0.2], [1.8, 0.6, 2.0]],
                [4, [4.2, 0, 0.6], [4.8, 1.0, 1.2]],
                [5, [2.2, 0, 0.3], [3.2, 0.8, 1.0]],
                [6, [5.2, 0, 2.0], [5.9, 1.8, 3.2]],
                [7, [0.2, 0, 3.9], [2.2, 0.9, 4.8]],
                [8, [3.4, 0.9, 4.85], [4.6, 1.7, 4.95]],
            ],
            "islands": [[[0, 0, 0.5, 0.5, 0]], [[1.9, 1.2, 3.5, 3.8, 0], [3.5, 1.2, 5, 3.8, 0], [2, 2, 4, 4, 3]]],
        });
        fs::write(folder.join(format!("{hash}.basis.glb")), scene.to_string()).unwrap();
        fs::write(folder.join(format!("{hash}.semantic.txt")), ANNOTATION).unwrap();
    }

    /// Writes the states of a walk into `states`; `form` is one of `write_states.py`.
    pub(super) fn walk(&self, name: &str, count: usize, form: &str) {
        let (_, hash) = name.rsplit_once('-').unwrap();
        let script = self.path("write_states.py");
        let scene = format!("data/scene_datasets/hm3d/val/00000-{hash}/{hash}.basis.glb");
        let count = count.to_string();
        let folder = format!("states/hm3d-v0/{name}");
        let output = self.python(&script, &[&folder, &scene, &count, form]);
        assert!(output.status.success(), "{}", text(&output));
    }

    /// Runs the script as the program prints it, and returns what it says.
    pub(super) fn render(&self, config: &str, out: &str, flags: &[&str], code: i32) -> String {
        let script = self.print_script();
        let config = format!("HM3D/{config}");
        let fixed = ["--hm3d", "HM3D/val", "--config", &config, "--out", out];
        let size: &[&str] = if flags.contains(&"--size") { &[] } else { &["--size", SIZE] };
        let output = self.python(&script, &[&fixed, size, flags].concat());
        let said = text(&output);
        assert_eq!(output.status.code(), Some(code), "{said}");
        said
    }

    fn print_script(&self) -> PathBuf {
        let script = self.path("hm3d_frames.py");
        let printed = self.call(&["import", "habitat", "--script"]).stdout;
        fs::write(&script, printed).unwrap();
        script
    }

    /// Runs checks in Python, which import the script.
    pub(super) fn check(&self, checks: &str) {
        self.print_script();
        let script = self.path("checks.py");
        fs::write(&script, checks).unwrap();
        let output = self.python(&script, &[]);
        assert!(output.status.success(), "{}", text(&output));
    }

    /// Packs `states/hm3d-v0` with one member more.
    pub(super) fn archive(&self, name: &str, member: &str) {
        let script = self.path("archive.py");
        let pack = "import sys, tarfile\nwith tarfile.open(sys.argv[1], 'w:gz') as archive:\n    \
            archive.add('states/hm3d-v0', 'hm3d-v0')\n    archive.addfile(tarfile.TarInfo(sys.argv[2]))\n";
        fs::write(&script, pack).unwrap();
        let output = self.python(&script, &[name, member]);
        assert!(output.status.success(), "{}", text(&output));
    }

    /// Reads a pickle as Python does.
    pub(super) fn unpickle(&self, name: &str) {
        let script = self.path("unpickle.py");
        fs::write(&script, "import pickle, sys\npickle.load(open(sys.argv[1], 'rb'))\n").unwrap();
        self.python(&script, &[name]);
    }

    fn python(&self, script: &Path, words: &[&str]) -> Output {
        let mut command = Command::new("python3");
        command.arg(script).args(words).current_dir(self.path(""));
        command
            .env("PYTHONPATH", self.path("modules"))
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("STAND_IN_LOG", self.path("opened.log"));
        command.output().expect("python3, which these tests need")
    }

    /// The scenes that were opened, in order.
    pub(super) fn opened(&self) -> Vec<String> {
        let log = fs::read_to_string(self.path("opened.log")).unwrap();
        log.lines().map(str::to_owned).collect()
    }

    pub(super) fn import(&self, renders: &str, frames: &str) {
        self.program(&["import", "habitat", "--src", renders, "--out", frames], 0);
    }

    /// Makes questions about a folder of frames, and returns how many.
    pub(super) fn questions(&self, frames: &str) -> usize {
        let out = format!("{frames}/questions.jsonl");
        self.program(&["questions", frames, "--out", &out], 0);
        self.lines(&out).len()
    }

    /// Calls the program, and returns what it says on standard error.
    pub(super) fn program(&self, words: &[&str], code: i32) -> String {
        let output = self.call(words);
        let said = text(&output);
        assert_eq!(output.status.code(), Some(code), "{said}");
        said
    }

    fn call(&self, words: &[&str]) -> Output {
        let mut command = Command::new(PROGRAM);
        command.args(words).current_dir(self.path("")).env_clear();
        command.output().unwrap()
    }

    pub(super) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(name)).unwrap()).unwrap()
    }

    pub(super) fn lines(&self, name: &str) -> Vec<Value> {
        let text = fs::read_to_string(self.path(name)).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The files of a folder and of those in it, by path, with their bytes.
    pub(super) fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let (top, mut files) = (self.path(folder), BTreeMap::new());
        let mut folders = vec![top.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    let name = path.strip_prefix(&top).unwrap().to_str().unwrap();
                    files.insert(name.to_owned(), fs::read(&path).unwrap());
                }
            }
        }
        files
    }
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
