//! The body of a request: [`Parts`], text around images that many requests share.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use bytes::Bytes;
use hyper::body::{Body, Frame, SizeHint};

/// A body of known length that is sent in pieces; cloning it copies no bytes.
#[derive(Debug, Clone)]
pub(in crate::ask) struct Parts {
    pieces: Arc<[Bytes]>,
    next: usize,
}

impl Parts {
    /// The body of these pieces, in order; empty pieces are skipped.
    pub(in crate::ask) fn new(pieces: impl IntoIterator<Item = Bytes>) -> Self {
        let pieces = pieces.into_iter().collect();
        Self { pieces, next: 0 }
    }

    /// The whole body in one piece.
    pub(in crate::ask) fn joined(&self) -> Vec<u8> {
        self.pieces.concat()
    }

    fn rest(&self) -> &[Bytes] {
        self.pieces.get(self.next..).unwrap_or_default()
    }
}

impl Body for Parts {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let skipped = self
            .rest()
            .iter()
            .take_while(|piece| piece.is_empty())
            .count();
        let piece = self.rest().get(skipped).cloned();
        self.next += skipped + 1;
        Poll::Ready(piece.map(|piece| Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest().iter().all(Bytes::is_empty)
    }

    /// The exact size, so that the request has a `Content-Length`: some servers accept no chunked bodies.
    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.rest().iter().map(|piece| piece.len() as u64).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_come_in_order_and_the_remaining_size_falls() {
        let piece = Bytes::from_static;
        let mut body = Parts::new([piece(b"ab"), piece(b""), piece(b"cde")]);
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
        assert!(Parts::new([piece(b""), piece(b""), piece(b"")]).is_end_stream());
    }
}
