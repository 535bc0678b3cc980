//! Body of an upload: [`FileForm`], a multipart form with a file that is read while it is sent.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;
use std::pin::Pin;
use std::task::{Context, Poll};

use bytes::Bytes;
use hyper::body::{Body, Frame, SizeHint};

use crate::files::reading;

/// Number of bytes to read at once; chosen.
const CHUNK: usize = 256 * 1024;

/// A `multipart/form-data` body (RFC 7578) with one text field and one file, which is never in memory as a whole.
pub(super) struct FileForm {
    head: Bytes,
    file: File,
    /// Number of bytes of the file that are not yet sent.
    left: u64,
    tail: Bytes,
}

impl FileForm {
    /// Creates a form with the field `purpose` and the file `file` under this name.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub(super) fn open(path: &Path, name: &str, purpose: &str, boundary: &str) -> io::Result<Self> {
        let file = reading::open(path)?;
        let field = |name: &str| format!("--{boundary}\r\nContent-Disposition: form-data; name=\"{name}\"");
        let head = format!(
            "{}\r\n\r\n{purpose}\r\n{}; filename=\"{name}\"\r\nContent-Type: application/jsonl\r\n\r\n",
            field("purpose"),
            field("file")
        );
        Ok(Self {
            head: head.into(),
            left: file.metadata()?.len(),
            file,
            tail: format!("\r\n--{boundary}--\r\n").into(),
        })
    }

    /// Reads the next chunk; `None` at the end.
    fn next_chunk(&mut self) -> io::Result<Option<Bytes>> {
        if !self.head.is_empty() {
            return Ok(Some(std::mem::take(&mut self.head)));
        }
        if self.left > 0 {
            let mut chunk = vec![0; CHUNK.min(usize::try_from(self.left).unwrap_or(CHUNK))];
            self.file.read_exact(&mut chunk)?;
            self.left -= chunk.len() as u64;
            return Ok(Some(chunk.into()));
        }
        let tail = std::mem::take(&mut self.tail);
        Ok((!tail.is_empty()).then_some(tail))
    }
}

impl Body for FileForm {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        Poll::Ready(self.next_chunk().map(|chunk| chunk.map(Frame::data)).transpose())
    }

    fn is_end_stream(&self) -> bool {
        self.tail.is_empty()
    }

    /// The exact size, so that the request has a `Content-Length`.
    fn size_hint(&self) -> SizeHint {
        let head_and_tail = self.head.len() + self.tail.len();
        SizeHint::with_exact(head_and_tail as u64 + self.left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_has_an_exact_size() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let content = b"{\"custom_id\":1}\n".repeat(40_000);
        std::fs::write(file.path(), &content).unwrap();
        let mut form = FileForm::open(file.path(), "a.jsonl", "batch", "XX").unwrap();
        let size = form.size_hint().exact().unwrap();
        let (mut sent, mut chunks) = (Vec::new(), 0);
        while let Some(chunk) = form.next_chunk().unwrap() {
            assert!(chunk.len() <= CHUNK);
            sent.extend_from_slice(&chunk);
            chunks += 1;
        }
        assert!(form.is_end_stream());
        assert_eq!(sent.len() as u64, size);
        assert!(chunks > 3, "{chunks}");
        let text = String::from_utf8(sent).unwrap();
        let start = "--XX\r\nContent-Disposition: form-data; name=\"purpose\"\r\n\r\nbatch\r\n--XX\r\n";
        assert!(text.starts_with(start), "{}", &text[..200]);
        assert!(text.ends_with("\n\r\n--XX--\r\n"));
        assert!(text.contains("filename=\"a.jsonl\""));
    }
}
