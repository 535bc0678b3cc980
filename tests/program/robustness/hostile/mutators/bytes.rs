//! Damage to bytes, whatever they mean.

use super::words;
use crate::robustness::hostile::random::Random;

/// The most bytes of a damaged file.
const MOST_BYTES: usize = 1 << 20;

/// Damages a file in one place.
pub(super) fn mutate(file: &mut Vec<u8>, random: &mut Random) {
    if file.is_empty() {
        file.extend_from_slice(words::magic(random));
        return;
    }
    let at = random.below(file.len());
    match random.below(13) {
        0 => file[at] ^= 1 << random.below(8),
        1 => file[at] = random.next() as u8,
        2 => file[at] = *random.pick(&[0, 1, 0x7F, 0x80, 0xFF]),
        3 => drop(file.drain(random.part(file.len(), 64))),
        4 => insert(file, at, words::magic(random)),
        5 => insert(file, at, words::odd_character(random)),
        6 => overwrite(file, at, words::magic(random)),
        7 => repeat(file, random),
        8 => file.truncate(at),
        9 => splice(file, random),
        10 => {
            change_number(file, random);
        }
        // Sizes and versions lie near the beginning.
        11 => {
            let at = at % 40;
            file[at] = random.next() as u8;
        }
        _ => overwrite(file, at, &random.next().to_le_bytes()[..4]),
    }
}

fn insert(file: &mut Vec<u8>, at: usize, bytes: &[u8]) {
    file.splice(at..at, bytes.iter().copied());
}

fn overwrite(file: &mut [u8], at: usize, bytes: &[u8]) {
    for (old, new) in file[at..].iter_mut().zip(bytes) {
        *old = *new;
    }
}

/// Writes a part of a file many times.
fn repeat(file: &mut Vec<u8>, random: &mut Random) {
    let part = random.part(file.len(), 200);
    let times = *random.pick(&[2, 3, 20, 2000]);
    let copies = file[part.clone()].repeat(times);
    if file.len() + copies.len() <= MOST_BYTES {
        file.splice(part.end..part.end, copies);
    }
}

/// Copies a part of a file to another place.
fn splice(file: &mut Vec<u8>, random: &mut Random) {
    let part = file[random.part(file.len(), 200)].to_vec();
    let to = random.below(file.len());
    file.splice(to..to, part);
}

/// Exchanges a number that is written in digits; false if there is none.
pub(super) fn change_number(file: &mut Vec<u8>, random: &mut Random) -> bool {
    let is_start = |at: &usize| file[*at].is_ascii_digit() && (*at == 0 || !file[at - 1].is_ascii_alphanumeric());
    let starts: Vec<usize> = (0..file.len()).filter(is_start).collect();
    if starts.is_empty() {
        return false;
    }
    let start = *random.pick(&starts);
    let digits = file[start..].iter().take_while(|byte| byte.is_ascii_digit());
    let end = start + digits.count();
    file.splice(start..end, words::number(random).bytes());
    true
}
