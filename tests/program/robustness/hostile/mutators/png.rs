//! Damage to the chunks of PNG files.

use crate::robustness::hostile::random::Random;
use crate::support::image_files::{checksum, chunk, exif, profile_chunk};

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

#[derive(Clone)]
struct Chunk {
    length: [u8; 4],
    /// The kind and the data.
    body: Vec<u8>,
    checksum: [u8; 4],
}

/// Damages one chunk, or the order of chunks; false if the file has none. Four in five checksums are mended.
pub(super) fn mutate(file: &mut Vec<u8>, random: &mut Random) -> bool {
    let mut chunks = chunks(file);
    if chunks.is_empty() {
        return false;
    }
    let (one, other) = (random.below(chunks.len()), random.below(chunks.len()));
    match random.below(9) {
        0 => chunks.swap(one, other),
        1 => drop(chunks.remove(one)),
        2 => chunks.insert(other, chunks[one].clone()),
        3 => {
            let length: u32 = *random.pick(&[0, 1, 12, 0x7FFF_FFFF, u32::MAX]);
            chunks[one].length = length.to_be_bytes();
        }
        4 | 5 => change_header(&mut chunks[0].body, random),
        6 => chunks.insert(1, further(random)),
        _ => {
            let at = random.below(chunks[one].body.len());
            if let Some(byte) = chunks[one].body.get_mut(at) {
                *byte = random.next() as u8;
            }
        }
    }
    let is_mended = random.percent(80);
    *file = SIGNATURE.to_vec();
    for chunk in chunks {
        let mended = checksum(&chunk.body);
        let checksum = if is_mended { mended } else { chunk.checksum };
        file.extend([&chunk.length[..], &chunk.body, &checksum].concat());
    }
    true
}

fn chunks(file: &[u8]) -> Vec<Chunk> {
    let mut rest = file.strip_prefix(SIGNATURE).unwrap_or_default();
    let mut chunks = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        let bytes = (u32::from_be_bytes(*length) as usize).saturating_add(4);
        let Some((body, after)) = after.split_at_checked(bytes) else {
            break;
        };
        let Some((checksum, after)) = after.split_first_chunk::<4>() else {
            break;
        };
        chunks.push(Chunk { length: *length, body: body.to_vec(), checksum: *checksum });
        rest = after;
    }
    chunks
}

/// Writes another width, height, depth, colour type or interlacing into the body of IHDR.
fn change_header(body: &mut [u8], random: &mut Random) {
    if body.len() < 17 {
        return;
    }
    let field = random.below(7);
    if field < 2 {
        let side: u32 = *random.pick(&[0, 1, 17, 65_535, 65_536, 400_000, 0x7FFF_FFFF, u32::MAX]);
        body[4 + 4 * field..8 + 4 * field].copy_from_slice(&side.to_be_bytes());
    } else {
        body[10 + field] = *random.pick(&[0, 1, 2, 3, 4, 6, 8, 16, 255]);
    }
}

/// A chunk that says something about the colours or the orientation, or that grows when it is read.
fn further(random: &mut Random) -> Chunk {
    let kinds: [[u8; 4]; 10] =
        [*b"gAMA", *b"cHRM", *b"sRGB", *b"cICP", *b"tRNS", *b"PLTE", *b"sBIT", *b"tEXt", *b"acTL", *b"IDAT"];
    let data: Vec<u8> = (0..random.below(40)).map(|_| random.next() as u8).collect();
    let bytes = match random.below(4) {
        0 => profile_chunk(&vec![0; 4 << 20]),
        1 => chunk(*b"eXIf", &exif(random.below(70_000) as u16)),
        _ => chunk(*random.pick(&kinds), &data),
    };
    let file = [SIGNATURE, &bytes].concat();
    chunks(&file).remove(0)
}
