//! A run in a ZIP file, such as `bundle` writes: [`open_zip`]. Its files are unpacked into a temporary folder, which
//! exists as long as the texts of the run.

use std::path::Path;
use std::sync::Arc;

use tempfile::TempDir;

use crate::run_texts::RunTexts;
use crate::stored::{AnyRun, RunLayout, StoredRun, unpack_command};
use darkqa_base::error::{Error, Result};
use darkqa_data::ready_made::Archive;
use darkqa_score::answers::record::Detail;
use darkqa_store::{MANIFEST, RUN_FILES};

/// Opens the run in a ZIP file. Only the files that reports read are unpacked, whatever else is in it.
///
/// # Errors
/// If it is no ZIP file, an entry leads out of it, its files are too long, or it holds no run or several.
pub(crate) fn open_zip(path: &Path) -> Result<AnyRun> {
    let archive = Archive::open(path)?;
    let run = run_in(&archive)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let unpacked = tempfile::Builder::new().prefix(&format!("{name}.")).tempdir();
    let unpacked = unpacked.map_err(|e| Error::file(std::env::temp_dir(), "write", e))?;
    let files = RUN_FILES.map(|file| (format!("{run}{file}"), unpacked.path().join(file)));
    archive.unpack(files.into_iter().filter(|(name, _)| archive.has(name)))?;
    Ok(match AnyRun::open(unpacked.path())? {
        AnyRun::Choice(opened) => AnyRun::Choice(zipped(opened, path, unpacked)),
        AnyRun::Open(opened) => AnyRun::Open(zipped(opened, path, unpacked)),
    })
}

/// The folder of the run in a ZIP file, with its last `/`; empty for the top level.
fn run_in(archive: &Archive) -> Result<String> {
    let runs = archive.folders_with(MANIFEST);
    match &*runs {
        [run] => Ok(run.clone()),
        [] => {
            let problem = format!("no run in this ZIP file: it has no {MANIFEST}");
            Err(Error::Run { path: archive.path().to_owned(), problem })
        }
        several => {
            let problem = format!(
                "{} runs are in this ZIP file; unpack it and name their folders: {}",
                several.len(),
                unpack_command(archive.path())
            );
            Err(Error::Run { path: archive.path().to_owned(), problem })
        }
    }
}

/// A run named by its ZIP file, which keeps its unpacked files.
fn zipped<D: Detail>(run: StoredRun<D>, path: &Path, unpacked: TempDir) -> StoredRun<D> {
    let texts = RunTexts::Unpacked { texts: Box::new(run.texts), _folder: Arc::new(unpacked) };
    StoredRun { folder: path.to_owned(), layout: RunLayout::Zip, texts, ..run }
}
