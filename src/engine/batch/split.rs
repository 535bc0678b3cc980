//! Splits a part that exceeds a limit: [`Driver::split`].

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};

use sha2::{Digest as _, Sha256};

use super::driver::{Driver, Step};
use super::event::{Event, PartFacts, Piece};
use super::file::hexadecimal;
use super::import::for_each_line;
use crate::error::{Error, Result};
use crate::files::create_new;
use darkqa_score::answers::record::Detail;

/// Extension of a piece's file until the journal has recorded it.
pub(super) const PIECE: &str = "split";

impl<D: Detail> Driver<'_, D> {
    /// Splits a part into `pieces` new parts.
    ///
    /// The files of the pieces are written first, then one event records all of them, then they get their final names.
    /// So a killed process leaves either the part or its pieces.
    ///
    /// # Errors
    /// If the part has only one request, or a file cannot be written.
    pub(super) async fn split(&mut self, part: usize, pieces: usize) -> Result<Step> {
        let whole = self.part(part).clone();
        let pieces = pieces.clamp(2, whole.facts.requests.max(2));
        if whole.facts.requests < 2 {
            let problem = format!(
                "{}: one request has about {:.0} tokens, more than may wait for batches of {}; send smaller images with --image max-side=N",
                whole.name, whole.facts.tokens, whole.facts.model
            );
            return Err(Error::Endpoint { endpoint: whole.facts.base, problem });
        }
        for id in &self.files_at_server(part).await? {
            // A remaining file is harmless, because only the pieces are used.
            if let Err(failure) = self.delete_file(part, id).await? {
                tracing::warn!("the file {id} could not be deleted at the server: {failure}");
            }
        }
        let into = self.write_pieces(part, pieces)?;
        self.say(part, &format!("divided into {} parts", into.len()));
        let names: Vec<String> = into.iter().map(|piece| piece.file.clone()).collect();
        self.journal.record(part, Event::Split { into })?;
        for name in names {
            let path = self.journal.folder().join(name);
            fs::rename(path.with_extension(PIECE), &path).map_err(|e| Error::file(&path, "write", e))?;
        }
        let path = self.journal.file(part);
        fs::remove_file(&path).map_err(|e| Error::file(&path, "delete", e))?;
        Ok(Step::Moved)
    }

    /// Writes the files of the pieces, with the extension [`PIECE`].
    fn write_pieces(&self, part: usize, pieces: usize) -> Result<Vec<Piece>> {
        let whole = self.part(part);
        let stem = whole.stem().rsplit_once('-').map_or(whole.stem(), |(stem, _)| stem);
        let first = self.journal.free_number(stem) as usize;
        let max_requests = whole.facts.requests.div_ceil(pieces);
        let name = |index: usize| format!("{stem}-{:03}.jsonl", first + index);
        let path = |index: usize| {
            let path = self.journal.folder().join(name(index));
            path.with_extension(PIECE)
        };
        let mut writer = PieceWriter::default();
        let mut into = Vec::new();
        let finish = |writer: PieceWriter, into: &mut Vec<Piece>| {
            let index = into.len();
            let facts = writer.finish(&whole.facts).map_err(|e| Error::file(path(index), "write", e))?;
            into.push(Piece { file: name(index), facts });
            Ok(())
        };
        for_each_line(&self.journal.file(part), |line| {
            if writer.requests == max_requests {
                finish(std::mem::take(&mut writer), &mut into)?;
            }
            let path = path(into.len());
            writer.add(line, || create_new(&path)).map_err(|e| Error::file(&path, "write", e))
        })?;
        finish(writer, &mut into)?;
        Ok(into)
    }
}

/// Writer of the file of a piece.
#[derive(Default)]
struct PieceWriter {
    file: Option<BufWriter<File>>,
    hash: Sha256,
    bytes: u64,
    requests: usize,
}

impl PieceWriter {
    fn add(&mut self, line: &str, create: impl FnOnce() -> std::io::Result<File>) -> std::io::Result<()> {
        let file = match self.file.take() {
            Some(file) => file,
            None => BufWriter::new(create()?),
        };
        self.file.insert(file).write_all(line.as_bytes())?;
        self.hash.update(line);
        self.bytes += line.len() as u64;
        self.requests += 1;
        Ok(())
    }

    /// Syncs the file to disk; returns the facts about the piece of a part.
    fn finish(self, whole: &PartFacts) -> std::io::Result<PartFacts> {
        if let Some(file) = self.file {
            file.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        }
        let share = self.requests as f64 / whole.requests as f64;
        Ok(PartFacts {
            sha256: hexadecimal(&self.hash.finalize()),
            bytes: self.bytes,
            requests: self.requests,
            tokens: (whole.tokens * share).round(),
            dollars: whole.dollars.map(|dollars| dollars * share),
            // The piece may contain the most expensive requests.
            most_dollars: whole.most_dollars_each.map(|each| each * self.requests as f64),
            ..whole.clone()
        })
    }
}
