//! Files side by side in one, uncompressed: the ZIP archives that USD packages and `NumPy` archives are. Without
//! compression, times and encryption there is little to write, and equal files give equal bytes.

use crc::{CRC_32_ISO_HDLC, Crc};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
/// Bytes of a file's header before its name.
const LOCAL_BYTES: usize = 30;
/// The version that stores files, 1980-01-01, names in UTF-8.
const VERSION: u16 = 20;
const FIRST_DAY: u16 = 0x21;
const UTF8: u16 = 1 << 11;
/// A field of bytes that mean nothing, and its own length.
const PADDING: u16 = 0x1986;
const PADDING_BYTES: usize = 4;

/// Stores files, whose bytes begin at multiples of `alignment`. The error says why they do not fit.
pub(crate) fn store<'a>(
    files: impl IntoIterator<Item = (&'a str, &'a [u8])>,
    alignment: usize,
) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let mut central = Vec::new();
    let mut count = 0_u16;
    for (name, bytes) in files {
        let start = number(out.len())?;
        let unpadded = out.len() + LOCAL_BYTES + name.len() + PADDING_BYTES;
        let padding = unpadded.next_multiple_of(alignment.max(1)) - unpadded;
        let extra = short(PADDING_BYTES + padding)?;
        let mut about = Vec::new();
        put(&mut about, &[VERSION, UTF8, 0, 0, FIRST_DAY]);
        for value in [CRC.checksum(bytes), number(bytes.len())?, number(bytes.len())?] {
            about.extend(value.to_le_bytes());
        }
        put(&mut about, &[short(name.len())?]);
        out.extend(LOCAL.to_le_bytes());
        out.extend(&about);
        put(&mut out, &[extra]);
        out.extend(name.as_bytes());
        put(&mut out, &[PADDING, extra - PADDING_BYTES as u16]);
        out.resize(out.len() + padding, 0);
        out.extend(bytes);
        central.extend(CENTRAL.to_le_bytes());
        put(&mut central, &[VERSION]);
        central.extend(&about);
        // No extra field, comment, other disk, or attributes.
        put(&mut central, &[0, 0, 0, 0, 0, 0]);
        central.extend(start.to_le_bytes());
        central.extend(name.as_bytes());
        count = count.checked_add(1).ok_or("there are more than 65,535 files")?;
    }
    let start = number(out.len())?;
    out.extend(&central);
    out.extend(END.to_le_bytes());
    put(&mut out, &[0, 0, count, count]);
    out.extend(number(central.len())?.to_le_bytes());
    out.extend(start.to_le_bytes());
    put(&mut out, &[0]);
    Ok(out)
}

fn put(out: &mut Vec<u8>, values: &[u16]) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

fn number(length: usize) -> Result<u32, String> {
    // The largest number means that another record has the real one.
    u32::try_from(length).ok().filter(|&n| n < u32::MAX).ok_or_else(|| "the file would be longer than 4 GB".to_owned())
}

fn short(length: usize) -> Result<u16, String> {
    u16::try_from(length).map_err(|_| "a name is too long".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_lie_at_their_places() {
        let files = [("a.txt", &b"one"[..]), ("folder/b", &[7; 100])];
        let archive = store(files, 64).unwrap();
        for (name, bytes) in files {
            let at = archive.windows(bytes.len()).position(|window| window == bytes).unwrap();
            assert!(at.is_multiple_of(64), "{name} begins at {at}");
        }
        assert_eq!(archive, store(files, 64).unwrap());
        assert_eq!(store([], 64).unwrap().len(), 22);
    }
}
