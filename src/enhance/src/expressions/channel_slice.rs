//! Some channels of an output, as `x[4:7]` names them in a sidecar: [`ChannelSlice`].

/// Channels from `first` up to, but without, `end`, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChannelSlice {
    pub(crate) first: usize,
    pub(crate) end: usize,
}

impl ChannelSlice {
    /// Splits `x[4:7]` into the name of the output and its channels; `None` if the text does not end with a slice.
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
    fn a_slice_stands_in_brackets_behind_the_name() {
        let slice = |first, end| ChannelSlice { first, end };
        for (text, expected) in [
            ("x[4:7]", Some(("x", slice(4, 7)))),
            ("a[0][ 1 : 2 ]", Some(("a[0]", slice(1, 2)))),
            ("x", None),
            ("x[4]", None),
            ("x[7:4]", None),
            ("x[-1:2]", None),
        ] {
            assert_eq!(ChannelSlice::split(text), expected, "{text}");
        }
        assert_eq!(slice(4, 7).count(), 3);
    }
}
