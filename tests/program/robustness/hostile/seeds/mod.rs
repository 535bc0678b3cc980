//! Small files of every kind that the program reads, made once for a campaign.

mod images;
mod imports;
mod runs;
mod sets;
mod settings;

use std::path::{Path, PathBuf};

use crate::support::house::House;
use crate::support::run::{Bench, files};

/// A folder with all files.
pub(crate) struct Seeds(Bench);

impl Seeds {
    pub(crate) fn make() -> Self {
        // Walks through two houses, and questions about them.
        let House(bench) = House::new();
        images::make(&bench);
        sets::make(&bench);
        imports::make(&bench);
        settings::make(&bench);
        runs::make(&bench);
        Self(bench)
    }

    /// The files at these paths, each a file or a folder, by their paths in the folder.
    pub(crate) fn files(&self, paths: &[&str]) -> Vec<PathBuf> {
        let mut all = Vec::new();
        for path in paths {
            let path = self.0.path(path);
            if path.is_dir() {
                all.extend(files(&path));
            } else {
                all.push(path);
            }
        }
        all.sort();
        let top = self.0.path("");
        all.iter().map(|path| path.strip_prefix(&top).unwrap()).map(Path::to_owned).collect()
    }

    pub(crate) fn bench(&self) -> &Bench {
        &self.0
    }

    pub(crate) fn path(&self, name: &Path) -> PathBuf {
        self.0.path("").join(name)
    }
}
