//! Damage to the footer of Parquet files, which says where everything in them is.

use crate::robustness::hostile::random::Random;

/// Damages the footer, its length, or a page header; false if the file has no footer.
pub(super) fn mutate(file: &mut Vec<u8>, random: &mut Random) -> bool {
    let Some(end) = file.len().checked_sub(8).filter(|end| *end > 4) else {
        return false;
    };
    let mut length = [0; 4];
    length.copy_from_slice(&file[end..end + 4]);
    let length = u32::from_le_bytes(length) as usize;
    let start = end.saturating_sub(length);
    match random.below(6) {
        0 => {
            let lie: u32 = *random.pick(&[0, 1, 7, (length as u32).wrapping_add(1), 0x7FFF_FFFF, u32::MAX]);
            file[end..end + 4].copy_from_slice(&lie.to_le_bytes());
        }
        // The numbers of the footer are varints: a set high bit joins two.
        1 => set(file, start, end, random, |byte, _| byte | 0x80),
        2 => set(file, start, end, random, |_, random| random.next() as u8),
        3 => set(file, start, end, random, |_, _| 0xFF),
        4 => set(file, 4, start, random, |_, random| random.next() as u8),
        _ => {
            let at = start + random.below(end - start);
            let bytes = *random.pick(&[&[0xFF; 9][..], &[0x80; 4], &[0; 8]]);
            file.splice(at..at, bytes.iter().copied());
            let longer = (length + bytes.len()) as u32;
            let end = file.len() - 8;
            file[end..end + 4].copy_from_slice(&longer.to_le_bytes());
        }
    }
    true
}

/// Changes one byte of a part of a file.
fn set(file: &mut [u8], start: usize, end: usize, random: &mut Random, change: impl Fn(u8, &mut Random) -> u8) {
    let at = start + random.below(end.saturating_sub(start));
    if let Some(byte) = file.get_mut(at) {
        *byte = change(*byte, random);
    }
}
