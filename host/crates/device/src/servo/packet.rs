//! What both kinds of servo bus have in common.

/// A servo's answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Status {
    /// Which servo.
    pub id: u8,
    /// Its error, as its bus defines it; 0 for none.
    pub error: u8,
    /// The registers that were read.
    pub data: Vec<u8>,
}

impl Status {
    /// Two bytes of data as a little-endian number.
    pub fn word(&self) -> Option<u16> {
        <[u8; 2]>::try_from(&self.data[..]).ok().map(u16::from_le_bytes)
    }

    /// Four bytes of data as a little-endian number in two's complement.
    pub fn double_word(&self) -> Option<i32> {
        <[u8; 4]>::try_from(&self.data[..]).ok().map(i32::from_le_bytes)
    }
}

/// A decoder's counters since it was created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PacketCounters {
    /// Statuses that passed every check.
    pub packets: u64,
    /// Packets with a wrong checksum.
    pub checksum_errors: u64,
    /// Bytes that belonged to no packet.
    pub discarded_bytes: u64,
}
