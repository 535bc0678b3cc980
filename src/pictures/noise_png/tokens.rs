//! Division of a row into literals and runs of zeros: [`divide`].

/// What a row is divided into: literal bytes, and runs of zeros that repeat a zero before them.
pub(super) trait Tokens {
    /// Takes eight literals, the first in the lowest bits, but for this many zeros at their end.
    fn eight(&mut self, literals: u64, zeros: usize);
    fn literal(&mut self, byte: u8);
    /// Takes a run of 3 to 258 zeros.
    fn zeros(&mut self, length: usize);
}

/// Length of the longest run in one token (RFC 1951, 3.2.5).
const LONGEST_RUN: usize = 258;

/// Divides a row. Only runs of at least eight zeros become tokens, because a zero is the shortest code of dark rows.
#[inline(always)]
pub(super) fn divide(row: &[u8], tokens: &mut impl Tokens) {
    let mut at = 0;
    while let Some(eight) = row[at..].first_chunk::<8>() {
        let literals = u64::from_le_bytes(*eight);
        let last_zeros = literals.leading_zeros() as usize / 8;
        let start = at + 8 - last_zeros;
        if row[start..].first_chunk::<8>() != Some(&[0; 8]) {
            tokens.eight(literals, 0);
            at += 8;
            continue;
        }
        // The first zero is what the run repeats.
        match last_zeros {
            0 => {
                tokens.eight(literals, 0);
                tokens.literal(0);
            }
            _ => tokens.eight(literals, last_zeros - 1),
        }
        at = end_of_zeros(row, start + 8);
        let mut length = at - start - 1;
        while length > LONGEST_RUN {
            // The rest must be at least three bytes.
            let run = if length - LONGEST_RUN < 3 { LONGEST_RUN - 3 } else { LONGEST_RUN };
            tokens.zeros(run);
            length -= run;
        }
        tokens.zeros(length);
    }
    row[at..].iter().for_each(|byte| tokens.literal(*byte));
}

/// The index after the zeros that begin at `at`.
#[inline(always)]
fn end_of_zeros(row: &[u8], mut at: usize) -> usize {
    while let Some(eight) = row[at..].first_chunk::<8>() {
        match u64::from_le_bytes(*eight) {
            0 => at += 8,
            other => return at + other.trailing_zeros() as usize / 8,
        }
    }
    at + row[at..].iter().take_while(|byte| **byte == 0).count()
}
