//! Words that programs have stumbled over.

use crate::robustness::hostile::random::Random;

/// One of the words that are put into files as they are.
pub(super) fn magic(random: &mut Random) -> &'static [u8] {
    MAGIC[random.below(MAGIC.len())]
}

/// One of the characters that are no UTF-8, or that hide or turn a line.
pub(super) fn odd_character(random: &mut Random) -> &'static [u8] {
    ODD_CHARACTERS[random.below(ODD_CHARACTERS.len())]
}

/// One of the numbers at the ends of what a number may be.
pub(super) fn number(random: &mut Random) -> &'static str {
    NUMBERS[random.below(NUMBERS.len())]
}

const MAGIC: [&[u8]; 42] = [
    b"\0",
    b"\n",
    b"\r\n",
    b"\t",
    b"\"",
    b"\\",
    b"'",
    b",",
    b"{}",
    b"[",
    b"}",
    b"{{",
    b"{% for x in y %}",
    b"null",
    b"true",
    b"NaN",
    b"Infinity",
    b"-1",
    b"0",
    b"1e999",
    b"18446744073709551616",
    b"-9223372036854775809",
    b"4294967295",
    b"2147483648",
    b"../",
    b"../canary/private.txt",
    b"../canary/picture.png",
    b"/etc/passwd",
    b"/dev/zero",
    b"file:///etc/passwd",
    b"C:\\x",
    b"\\\\server\\x",
    b"=1+1",
    b"%s%n",
    b"\x1b[31m",
    b"\x1b]0;title\x07",
    b"\x7f",
    b"<script>alert(1)</script>",
    b"]]>",
    b"<image 4294967296>",
    b"\x89PNG\r\n\x1a\n",
    b"\xff\xd8\xff\xd9",
];

const ODD_CHARACTERS: [&[u8]; 12] = [
    b"\xc0\xaf",
    b"\xe0\x80\xaf",
    b"\xed\xa0\x80",
    b"\xed\xb0\x80",
    b"\xf4\x90\x80\x80",
    b"\xff\xfe",
    b"\x80",
    b"\xef\xbb\xbf",
    b"\xe2\x80\xae",
    b"\xc2\x9b2J",
    b"\xe2\x80\xa8",
    b"\xf3\xa0\x81\x81",
];

const NUMBERS: [&str; 22] = [
    "0",
    "-0",
    "-1",
    "1",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "1e308",
    "1e999",
    "-1e-320",
    "0.1",
    "20000",
];

/// Texts that name files elsewhere, or that no name should be.
pub(super) const TEXTS: [&str; 30] = [
    "",
    " ",
    ".",
    "..",
    "../canary/private.txt",
    "../canary/picture.png",
    "../canary",
    "../../etc/passwd",
    "/etc/passwd",
    "/proc/self/environ",
    "/dev/zero",
    "/dev/stdin",
    "C:\\x.png",
    "\\\\server\\share\\x.png",
    "a\0b",
    "a/b/../../../x",
    "~/.ssh/id_rsa",
    "http://127.0.0.1:1/x.png",
    "data:image/png;base64,AAAA",
    "=1+1",
    "@SUM(1)",
    "\u{1b}[31mred\u{1b}]0;title\u{7}",
    "a\rb\nc\td",
    "\u{202e}txt\u{2066}\u{feff}\u{200b}",
    "\u{9b}2J\u{85}\u{7f}\u{8}",
    "<script>alert(1)</script>",
    "{{ question }}{% for x in range(99999) %}x{% endfor %}",
    "\u{fdfa}\u{1f469}\u{200d}\u{1f469}\u{301}\u{301}",
    "NaN",
    "L99-noise@physical+none",
];
