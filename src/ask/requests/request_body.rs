//! Body of a request: [`RequestBody`], text around image data that many requests share.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use bytes::Bytes;
use hyper::body::{Body, Frame, SizeHint};

/// A body of known length that is sent in chunks; cloning it copies no bytes.
#[derive(Debug, Clone)]
pub(crate) struct RequestBody {
    chunks: Arc<[Bytes]>,
    /// Index of the next chunk to send.
    next: usize,
}

impl RequestBody {
    /// Creates a body from its chunks. Empty chunks are not sent.
    pub(crate) fn new(chunks: impl IntoIterator<Item = Bytes>) -> Self {
        let chunks = chunks.into_iter().collect();
        Self { chunks, next: 0 }
    }

    /// The whole body.
    pub(crate) fn concat(&self) -> Vec<u8> {
        self.chunks.concat()
    }

    /// Chunks that are not yet sent.
    fn rest(&self) -> &[Bytes] {
        self.chunks.get(self.next..).unwrap_or_default()
    }
}

impl Body for RequestBody {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let skipped = self.rest().iter().take_while(|chunk| chunk.is_empty()).count();
        let chunk = self.rest().get(skipped).cloned();
        self.next += skipped + 1;
        Poll::Ready(chunk.map(|chunk| Ok(Frame::data(chunk))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest().iter().all(Bytes::is_empty)
    }

    /// The exact size, so that the request has a `Content-Length`: some servers reject chunked bodies.
    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.rest().iter().map(|chunk| chunk.len() as u64).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_sent_in_order() {
        let chunk = Bytes::from_static;
        let mut body = RequestBody::new([chunk(b"ab"), chunk(b""), chunk(b"cde")]);
        let mut context = Context::from_waker(std::task::Waker::noop());
        let mut seen = Vec::new();
        let mut remaining = vec![body.size_hint().exact()];
        while let Poll::Ready(Some(Ok(frame))) = Pin::new(&mut body).poll_frame(&mut context) {
            seen.extend_from_slice(frame.data_ref().unwrap());
            remaining.push(body.size_hint().exact());
        }
        assert_eq!(seen, b"abcde");
        assert_eq!(remaining, [Some(5), Some(3), Some(0)]);
        assert!(body.is_end_stream());
        assert!(RequestBody::new([chunk(b""), chunk(b""), chunk(b"")]).is_end_stream());
    }
}
