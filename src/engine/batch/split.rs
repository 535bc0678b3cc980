//! Dividing a part that is larger than what the server lets wait: [`Driver::split`].

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};

use sha2::{Digest as _, Sha256};

use super::driver::{Driver, Step};
use super::event::{Event, PartFacts, Piece};
use super::file::hexadecimal;
use super::take_over::for_each_line;
use crate::error::{Error, Result};
use crate::files::create_new;
use darkqa_score::answers::record::Detail;

/// Extension of a piece until the journal has it.
pub(super) const PIECE: &str = "split";

impl<D: Detail> Driver<'_, D> {
    /// Divides a part into so many pieces, each a part of its own. A request alone cannot be divided.
    ///
    /// The pieces are written first, then one event names them all, then they get their names. So a killed process leaves either the
    /// part or its pieces.
    pub(super) async fn split(&mut self, part: usize, pieces: usize) -> Result<Step> {
        let of = self.part(part).clone();
        let pieces = pieces.clamp(2, of.facts.requests.max(2));
        if of.facts.requests < 2 {
            let problem = format!(
                "{}: one request has about {:.0} tokens, more than may wait for batches of {}; send smaller images with --image max-side=N",
                of.name, of.facts.tokens, of.facts.model
            );
            return Err(Error::Endpoint {
                endpoint: of.facts.base,
                problem,
            });
        }
        for id in &self.files_at_server(part).await? {
            // The pieces are uploaded; what stays of the whole costs nothing.
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
            fs::rename(path.with_extension(PIECE), &path)
                .map_err(|e| Error::file(&path, "write", e))?;
        }
        let path = self.journal.file(part);
        fs::remove_file(&path).map_err(|e| Error::file(&path, "delete", e))?;
        Ok(Step::Moved)
    }

    fn write_pieces(&self, part: usize, pieces: usize) -> Result<Vec<Piece>> {
        let of = self.part(part);
        let stem = of
            .stem()
            .rsplit_once('-')
            .map_or(of.stem(), |(stem, _)| stem);
        let first = self.journal.free_number(stem);
        let most = of.facts.requests.div_ceil(pieces);
        let mut writer = PieceWriter::default();
        let mut into = Vec::new();
        let name = |number: usize| format!("{stem}-{:03}.jsonl", first as usize + number);
        let finish = |writer: PieceWriter, into: &mut Vec<Piece>| {
            let share = writer.requests as f64 / of.facts.requests as f64;
            let facts = PartFacts {
                sha256: hexadecimal(&writer.hash.finalize()),
                bytes: writer.bytes,
                requests: writer.requests,
                tokens: (of.facts.tokens * share).round(),
                dollars: of.facts.dollars.map(|dollars| dollars * share),
                // Its requests may be those that can cost more than others.
                most_dollars: of
                    .facts
                    .most_dollars_each
                    .map(|each| each * writer.requests as f64),
                ..of.facts.clone()
            };
            let path = self
                .journal
                .folder()
                .join(name(into.len()))
                .with_extension(PIECE);
            let file = writer.file.map(BufWriter::into_inner).transpose();
            file.map_err(std::io::IntoInnerError::into_error)
                .and_then(|file| file.map_or(Ok(()), |file| file.sync_all()))
                .map_err(|e| Error::file(&path, "write", e))?;
            into.push(Piece {
                file: name(into.len()),
                facts,
            });
            Ok(())
        };
        for_each_line(&self.journal.file(part), |line| {
            if writer.requests == most {
                finish(std::mem::take(&mut writer), &mut into)?;
            }
            let path = self
                .journal
                .folder()
                .join(name(into.len()))
                .with_extension(PIECE);
            writer
                .add(line, || create_new(&path))
                .map_err(|e| Error::file(&path, "write", e))
        })?;
        finish(writer, &mut into)?;
        Ok(into)
    }
}

/// A piece that is being written.
#[derive(Default)]
struct PieceWriter {
    file: Option<BufWriter<File>>,
    hash: Sha256,
    bytes: u64,
    requests: usize,
}

impl PieceWriter {
    fn add(
        &mut self,
        line: &str,
        create: impl FnOnce() -> std::io::Result<File>,
    ) -> std::io::Result<()> {
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
}
