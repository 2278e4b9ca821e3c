//! Lengths and checksums made right, so that readers look at what was damaged under them.

const CHARACTER_HEADER: usize = 52;
const TAKE_PREAMBLE: usize = 16;
const RECORD_HEAD: usize = 6;

/// Makes the checksums of a file right, if its format has some; whether it has.
pub(crate) fn seal(name: &str, bytes: &mut [u8]) -> bool {
    match name.rsplit('.').next() {
        Some("armature") => seal_character(bytes),
        Some("take") => seal_take(bytes),
        _ => return false,
    }
    true
}

/// Magic, version, length of the body, BLAKE3 of the body, body.
fn seal_character(bytes: &mut [u8]) {
    let Some((header, body)) = bytes.split_at_mut_checked(CHARACTER_HEADER) else { return };
    header[12..20].copy_from_slice(&(body.len() as u64).to_le_bytes());
    header[20..].copy_from_slice(blake3::hash(body).as_bytes());
}

/// A preamble, then records of type, length, payload and CRC-32, as far as their lengths are right.
fn seal_take(bytes: &mut [u8]) {
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let seal = |content: &mut [u8]| {
        if let Some((content, sum)) = content.split_last_chunk_mut::<4>() {
            *sum = crc.checksum(content).to_le_bytes();
        }
    };
    let Some((preamble, mut records)) = bytes.split_at_mut_checked(TAKE_PREAMBLE) else { return };
    seal(preamble);
    while let Some(length) = records.get(2..RECORD_HEAD).and_then(|bytes| bytes.first_chunk()) {
        let length = RECORD_HEAD + u32::from_le_bytes(*length) as usize + 4;
        let Some((record, rest)) = std::mem::take(&mut records).split_at_mut_checked(length) else { return };
        seal(record);
        records = rest;
    }
}
