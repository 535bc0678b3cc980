//! Range of an output's channels, written `x[4:7]` in a sidecar: [`ChannelSlice`].

/// Range of channels, counted from 0; `end` is excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChannelSlice {
    pub(crate) first: usize,
    pub(crate) end: usize,
}

impl ChannelSlice {
    /// Splits `x[4:7]` into the output's name and the slice; `None` if the text does not end with a slice.
    pub(crate) fn split(text: &str) -> Option<(&str, Self)> {
        let (name, slice) = text.trim_end().strip_suffix(']')?.rsplit_once('[')?;
        let (first, end) = slice.split_once(':')?;
        let (first, end) = (first.trim().parse().ok()?, end.trim().parse().ok()?);
        (first < end).then_some((name, Self { first, end }))
    }

    /// Number of channels.
    pub(crate) fn count(self) -> usize {
        self.end - self.first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slice_follows_the_name_in_brackets() {
        let slice = ChannelSlice { first: 4, end: 7 };
        assert_eq!(slice.count(), 3);
        assert_eq!(ChannelSlice::split("x[4:7]"), Some(("x", slice)));
        let spaced = ChannelSlice { first: 1, end: 2 };
        assert_eq!(ChannelSlice::split("a[0][ 1 : 2 ]"), Some(("a[0]", spaced)));
        for text in ["x", "x[4]", "x[7:4]", "x[-1:2]"] {
            assert_eq!(ChannelSlice::split(text), None, "{text}");
        }
    }
}
