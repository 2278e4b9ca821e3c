//! CRC-32/ISO-HDLC (as in Ethernet, zlib and PNG): polynomial 0x04C11DB7 reflected to 0xEDB88320, initial value and
//! final exclusive-or 0xFFFFFFFF, check value of `123456789` 0xCBF43926.

#[cfg(feature = "fast-crc")]
static CRC: crc::Crc<u32, crc::Table<16>> = crc::Crc::<u32, crc::Table<16>>::new(&crc::CRC_32_ISO_HDLC);

/// The checksum of these bytes.
#[cfg(feature = "fast-crc")]
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// The checksum of these bytes.
#[cfg(not(feature = "fast-crc"))]
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    checksum_by_nibbles(bytes)
}

/// Half a byte at a time: a 64-byte table, for machines with little flash.
#[cfg(any(test, not(feature = "fast-crc")))]
fn checksum_by_nibbles(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 16] = nibble_table();
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        crc = (crc >> 4) ^ TABLE[(crc & 15) as usize];
        crc = (crc >> 4) ^ TABLE[(crc & 15) as usize];
    }
    !crc
}

#[cfg(any(test, not(feature = "fast-crc")))]
const fn nibble_table() -> [u32; 16] {
    let mut table = [0; 16];
    let mut index = 0;
    while index < 16 {
        let mut value = index as u32;
        let mut bit = 0;
        while bit < 4 {
            value = if value & 1 == 1 { (value >> 1) ^ 0xEDB8_8320 } else { value >> 1 };
            bit += 1;
        }
        table[index] = value;
        index += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_implementations_give_the_published_check_value() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
        assert_eq!(checksum_by_nibbles(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn both_implementations_agree_on_every_length() {
        let mut bytes = [0u8; 300];
        let mut state = 1u32;
        for byte in &mut bytes {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *byte = (state >> 24) as u8;
        }
        for length in 0..bytes.len() {
            assert_eq!(checksum(&bytes[..length]), checksum_by_nibbles(&bytes[..length]), "{length} bytes");
        }
    }
}
