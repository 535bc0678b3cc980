//! The Huffman code of an image ([`Code`]), and its bits ([`BitWriter`]).
//!
//! One dynamic block of deflate (RFC 1951, 3.2.7), whose only distance is 1.

use super::tokens::Tokens;

/// Symbols of literals, the end of the block, and lengths of runs.
const SYMBOLS: usize = 286;

/// The symbol that ends the block.
const END: usize = 256;

/// Longest code in bits: two literals fit in 24 bits of a table's cell, and a run with its extra bits too.
const LONGEST: u8 = 12;

/// Longest code in bits of the code lengths themselves (RFC 1951, 3.2.7).
const LONGEST_OF_LENGTHS: u8 = 7;

/// Order in which the code lengths of the code lengths are sent (RFC 1951, 3.2.7).
const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];

/// Shortest run of each length symbol from 257 on (RFC 1951, 3.2.5).
const RUNS: [u16; 29] =
    [3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258];

/// Extra bits of each length symbol from 257 on (RFC 1951, 3.2.5).
const EXTRA: [u8; 29] = [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0];

/// Bits of the only distance.
const DISTANCE: u8 = 1;

/// Weight of an occurrence in the sample, relative to that of a symbol that may occur elsewhere.
const SAMPLED: u32 = 8;

/// Index into [`RUNS`] and [`EXTRA`] of a run of 3 to 258 zeros.
const fn run_index(length: usize) -> usize {
    let mut index = 0;
    while index + 1 < RUNS.len() && RUNS[index + 1] as usize <= length {
        index += 1;
    }
    index
}

/// [`run_index`] of each length.
const RUN_INDEX: [u8; 259] = {
    let mut table = [0; 259];
    let mut length = 3;
    while length < table.len() {
        table[length] = run_index(length) as u8;
        length += 1;
    }
    table
};

/// How often each symbol occurs. Eight literals are counted in four tables, because a processor waits if it adds to the
/// same number twice in a row.
pub(super) struct SymbolCounts {
    literals: [[u32; 256]; 4],
    runs: [u32; RUNS.len()],
    /// Zeros that `literals` counts, but that are part of a run.
    surplus_zeros: u32,
}

impl Default for SymbolCounts {
    fn default() -> Self {
        Self { literals: [[0; 256]; 4], runs: [0; RUNS.len()], surplus_zeros: 0 }
    }
}

impl SymbolCounts {
    /// The count of each symbol; the end of the block occurs once.
    fn totals(&self) -> [u32; SYMBOLS] {
        std::array::from_fn(|symbol| match symbol {
            END => 1,
            0 => self.literals.iter().map(|table| table[0]).sum::<u32>() - self.surplus_zeros,
            1..END => self.literals.iter().map(|table| table[symbol]).sum(),
            _ => self.runs[symbol - END - 1],
        })
    }
}

impl Tokens for SymbolCounts {
    #[inline(always)]
    fn eight(&mut self, literals: u64, zeros: usize) {
        for (i, literal) in literals.to_le_bytes().into_iter().enumerate() {
            self.literals[i % 4][usize::from(literal)] += 1;
        }
        self.surplus_zeros += zeros as u32;
    }

    #[inline(always)]
    fn literal(&mut self, byte: u8) {
        self.literals[0][usize::from(byte)] += 1;
    }

    #[inline(always)]
    fn zeros(&mut self, length: usize) {
        self.runs[usize::from(RUN_INDEX[length])] += 1;
    }
}

/// A Huffman code: the bits of each symbol.
pub(super) struct Code {
    lengths: [u8; SYMBOLS],
    words: [u16; SYMBOLS],
}

impl Code {
    /// The code for symbols as frequent as these. Every symbol has one, because a sample does not contain all.
    pub(super) fn new(counts: &SymbolCounts) -> Self {
        let weights = counts.totals().map(|count| SAMPLED * count + 1);
        let lengths = code_lengths(weights, LONGEST);
        Self { lengths, words: code_words(lengths) }
    }

    /// Bits that symbols as frequent as these take.
    pub(super) fn cost(&self, counts: &SymbolCounts) -> u64 {
        let totals = counts.totals();
        let symbols = totals.iter().zip(self.lengths).map(|(count, bits)| u64::from(*count) * u64::from(bits));
        let extra = counts.runs.iter().zip(EXTRA).map(|(count, bits)| u64::from(*count) * u64::from(bits + DISTANCE));
        symbols.chain(extra).sum()
    }

    /// Writes the start of the block: the code lengths, in a code of their own.
    pub(super) fn write_header(&self, out: &mut BitWriter) {
        let lengths = || self.lengths.into_iter().chain([DISTANCE]);
        let mut weights = [0; ORDER.len()];
        lengths().for_each(|length| weights[usize::from(length)] += 1);
        let own = code_lengths(weights, LONGEST_OF_LENGTHS);
        let words = code_words(own);
        // The last block, of dynamic codes; then the numbers of symbols, distances and code lengths.
        for (number, bits) in [(0b101, 3), (SYMBOLS - 257, 5), (0, 5), (ORDER.len() - 4, 4)] {
            out.put(number as u64, bits);
        }
        for symbol in ORDER {
            out.put(u64::from(own[symbol]), 3);
        }
        for length in lengths().map(usize::from) {
            out.put(u64::from(words[length]), own[length]);
        }
    }

    /// Writes the end of the block.
    pub(super) fn write_end(&self, out: &mut BitWriter) {
        out.put(u64::from(self.words[END]), self.lengths[END]);
    }
}

/// Lengths of the best prefix code with words of at most `longest` bits; 0 for symbols without weight (Larmore and
/// Hirschberg 1990, package-merge).
///
/// A word of n bits costs its weight n times. So each symbol is a coin for every length, of value 2^−length, and the
/// lightest coins of the right total value are chosen: from the longest length up, the lightest pairs of coins become
/// coins of the next length.
fn code_lengths<const N: usize>(weights: [u32; N], longest: u8) -> [u8; N] {
    let mut symbols: Vec<usize> = (0..N).filter(|symbol| weights[*symbol] > 0).collect();
    symbols.sort_by_key(|symbol| weights[*symbol]);
    let mut lengths = [0; N];
    if let [only] = symbols[..] {
        lengths[only] = 1;
        return lengths;
    }
    // For each length, the sorted list of coins and pairs: true for a coin.
    let mut lists: Vec<Vec<bool>> = Vec::new();
    let mut pairs: Vec<u64> = Vec::new();
    for _ in 0..longest {
        let mut coins = symbols.iter().map(|symbol| u64::from(weights[*symbol])).peekable();
        let mut joined = pairs.iter().copied().peekable();
        let mut list = Vec::new();
        let mut sorted = Vec::new();
        loop {
            let is_coin = match (coins.peek(), joined.peek()) {
                (Some(coin), Some(pair)) => coin <= pair,
                (coin, pair) if coin.is_none() && pair.is_none() => break,
                (coin, _) => coin.is_some(),
            };
            list.push(is_coin);
            sorted.extend(if is_coin { coins.next() } else { joined.next() });
        }
        pairs = sorted.as_chunks::<2>().0.iter().map(|[one, other]| one + other).collect();
        lists.push(list);
    }
    let mut chosen = 2 * symbols.len() - 2;
    for list in lists.iter().rev() {
        let coins = list[..chosen].iter().filter(|is_coin| **is_coin).count();
        symbols[..coins].iter().for_each(|symbol| lengths[*symbol] += 1);
        chosen = 2 * (chosen - coins);
    }
    lengths
}

/// The words of a code, in the order of the symbols (RFC 1951, 3.2.2). The first bit of a word is the lowest one.
fn code_words<const N: usize>(lengths: [u8; N]) -> [u16; N] {
    let mut next = [0_u32; 17];
    for length in lengths.into_iter().filter(|length| *length > 0) {
        next[usize::from(length) + 1] += 1;
    }
    for length in 1..next.len() {
        next[length] = (next[length] + next[length - 1]) << 1;
    }
    lengths.map(|length| {
        if length == 0 {
            return 0;
        }
        let word = &mut next[usize::from(length)];
        *word += 1;
        ((*word - 1) as u16).reverse_bits() >> (16 - u32::from(length))
    })
}

/// Bits of one or more symbols: the lower 24 are the bits, the upper 8 their number.
#[derive(Debug, Clone, Copy, Default)]
struct Word(u32);

impl Word {
    fn new(bits: u32, number: u8) -> Self {
        Self(bits | u32::from(number) << 24)
    }

    /// This word, then another one.
    fn then(self, next: Self) -> Self {
        Self((self.bits() | next.bits() << self.number()) as u32 | (self.number() + next.number()) << 24)
    }

    #[inline(always)]
    fn bits(self) -> u64 {
        u64::from(self.0 & 0xff_ffff)
    }

    #[inline(always)]
    fn number(self) -> u32 {
        self.0 >> 24
    }
}

/// A code in tables.
pub(super) struct RowCode {
    /// The word of two literals, the first one in the lower byte of the index.
    pairs: Vec<Word>,
    literals: [Word; 256],
    /// The word of a run of each length, with its extra bits and its distance.
    runs: [Word; 259],
}

impl RowCode {
    pub(super) fn new(code: &Code) -> Self {
        let word = |symbol: usize| Word::new(u32::from(code.words[symbol]), code.lengths[symbol]);
        let literals: [Word; 256] = std::array::from_fn(word);
        let pairs = literals.iter().flat_map(|second| literals.iter().map(|first| first.then(*second))).collect();
        let runs = std::array::from_fn(|length| {
            if length < 3 {
                return Word::default();
            }
            let index = usize::from(RUN_INDEX[length]);
            let extra = Word::new(length as u32 - u32::from(RUNS[index]), EXTRA[index]);
            // The only distance has the word 0.
            word(END + 1 + index).then(extra).then(Word::new(0, DISTANCE))
        });
        Self { pairs, literals, runs }
    }
}

/// Bytes that may be written behind the last whole one.
const ROOM: usize = 8;

/// Writes bits, the lowest one first.
pub(super) struct BitWriter {
    /// All bytes up to `state.at`, and room for more.
    bytes: Vec<u8>,
    state: BitState,
}

/// How far bits are written.
#[derive(Debug, Clone, Copy)]
pub(super) struct BitState {
    /// Number of whole bytes.
    at: usize,
    /// The bits after them, fewer than eight.
    bits: u64,
    number: u32,
}

impl BitWriter {
    /// Writes after these bytes, with room for as many as `expected`.
    pub(super) fn new(start: &[u8], expected: usize) -> Self {
        let at = start.len();
        let mut bytes = vec![0; at + expected + ROOM];
        bytes[..at].copy_from_slice(start);
        Self { bytes, state: BitState { at, bits: 0, number: 0 } }
    }

    /// Makes room for the symbols of a row of this many bytes.
    pub(super) fn reserve(&mut self, row: usize) {
        // A byte has at most 12 bits.
        let needed = self.state.at + 2 * row + ROOM;
        if self.bytes.len() < needed {
            self.bytes.resize(needed.max(self.bytes.len() / 8 * 9), 0);
        }
    }

    /// Writes up to 56 bits.
    fn put(&mut self, bits: u64, number: u8) {
        self.reserve(ROOM);
        self.state.put(&mut self.bytes, bits, u32::from(number));
    }

    /// Writes the symbols of a row, for which there must be room.
    #[inline(always)]
    pub(super) fn row_writer<'a>(&'a mut self, code: &'a RowCode) -> RowWriter<'a> {
        RowWriter { bytes: &mut self.bytes, state: self.state, code }
    }

    /// Continues after a row.
    #[inline(always)]
    pub(super) fn resume(&mut self, state: BitState) {
        self.state = state;
    }

    /// All bytes; the last one is filled with zeros.
    pub(super) fn into_bytes(self) -> Vec<u8> {
        let Self { mut bytes, state } = self;
        bytes.truncate(state.at + state.number.div_ceil(8) as usize);
        bytes
    }
}

impl BitState {
    /// Writes up to 56 bits into bytes with room for [`ROOM`] more.
    #[inline(always)]
    fn put(&mut self, bytes: &mut [u8], bits: u64, number: u32) {
        self.bits |= bits << self.number;
        self.number += number;
        bytes[self.at..self.at + ROOM].copy_from_slice(&self.bits.to_le_bytes());
        self.at += (self.number / 8) as usize;
        self.bits >>= self.number & !7;
        self.number &= 7;
    }
}

/// Writes the symbols of a row. Its state is a copy, which stays in registers.
pub(super) struct RowWriter<'a> {
    bytes: &'a mut [u8],
    state: BitState,
    code: &'a RowCode,
}

impl RowWriter<'_> {
    #[inline(always)]
    pub(super) fn state(&self) -> BitState {
        self.state
    }

    #[inline(always)]
    fn put(&mut self, word: Word) {
        self.state.put(self.bytes, word.bits(), word.number());
    }
}

impl Tokens for RowWriter<'_> {
    #[inline(always)]
    fn eight(&mut self, literals: u64, zeros: usize) {
        let pair = |index: u64| self.code.pairs[usize::from((literals >> (16 * index)) as u16)];
        let [first, second, third, fourth] = [pair(0), pair(1), pair(2), pair(3)];
        let (low, low_number) = (first.bits() | second.bits() << first.number(), first.number() + second.number());
        let (high, high_number) = (third.bits() | fourth.bits() << third.number(), third.number() + fourth.number());
        let surplus = zeros as u32 * self.code.literals[0].number();
        let number = low_number + high_number - surplus;
        if low_number + high_number <= 56 {
            // Bits of surplus zeros are cleared.
            let bits = (low | high << low_number) & ((1 << number) - 1);
            self.state.put(self.bytes, bits, number);
        } else if number <= low_number {
            self.state.put(self.bytes, low & ((1 << number) - 1), number);
        } else {
            self.state.put(self.bytes, low, low_number);
            self.state.put(self.bytes, high & ((1 << (number - low_number)) - 1), number - low_number);
        }
    }

    #[inline(always)]
    fn literal(&mut self, byte: u8) {
        self.put(self.code.literals[usize::from(byte)]);
    }

    #[inline(always)]
    fn zeros(&mut self, length: usize) {
        self.put(self.code.runs[length]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum of 2^−length, which is 1 for a code that wastes nothing (Kraft 1949).
    fn kraft(lengths: &[u8]) -> f64 {
        lengths.iter().filter(|length| **length > 0).map(|length| 0.5_f64.powi(i32::from(*length))).sum()
    }

    #[test]
    fn frequent_symbols_have_short_codes() {
        assert_eq!(code_lengths([5, 9, 12, 13, 16, 45, 0], 15), [4, 4, 3, 3, 3, 1, 0]);
        assert_eq!(code_lengths([0, 7, 0], 7), [0, 1, 0]);
        assert_eq!(code_lengths([3, 1], 7), [1, 1]);
    }

    #[test]
    fn no_code_is_longer_than_allowed() {
        // Fibonacci's numbers have the deepest tree.
        let mut weights = [1_u32; 30];
        for i in 2..30 {
            weights[i] = weights[i - 1] + weights[i - 2];
        }
        assert!(code_lengths(weights, 30).contains(&29));
        assert!(code_lengths(weights, 5).iter().all(|length| matches!(length, 4 | 5)));
        let short = code_lengths(weights, LONGEST);
        assert!(short.iter().all(|length| (1..=LONGEST).contains(length)));
        assert!((kraft(&short) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn words_are_those_of_the_specification() {
        // The example of RFC 1951, 3.2.2: lengths of A to H, and their words.
        let words = code_words([3, 3, 3, 3, 3, 2, 4, 4]);
        let expected = [0b010, 0b011, 0b100, 0b101, 0b110, 0b00, 0b1110, 0b1111];
        let lengths = [3, 3, 3, 3, 3, 2, 4, 4];
        for ((word, expected), length) in words.into_iter().zip(expected).zip(lengths) {
            assert_eq!(word.reverse_bits() >> (16 - length), expected);
        }
    }

    #[test]
    fn runs_have_the_symbols_of_the_specification() {
        let found =
            [3, 10, 11, 12, 13, 34, 35, 130, 131, 226, 227, 257, 258].map(|length| 257 + RUN_INDEX[length] as u32);
        assert_eq!(found, [257, 264, 265, 265, 266, 272, 273, 280, 281, 283, 284, 284, 285]);
    }
}
