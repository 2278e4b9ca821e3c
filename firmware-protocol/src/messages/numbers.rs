//! The numbers of the protocol: its version, its messages, the features of either side.

/// Incompatible changes to the protocol raise this number.
pub const PROTOCOL_MAJOR: u8 = 1;
/// Additions that older peers can ignore raise this number.
pub const PROTOCOL_MINOR: u8 = 0;
/// The longest product name in a hello, bytes.
pub const MAX_NAME: usize = 32;

/// The numbers of the messages: the first field of every frame.
pub mod message_type {
    /// Host: who is there?
    pub const HELLO_REQUEST: u8 = 0x01;
    /// Host: describe the tree.
    pub const TOPOLOGY_REQUEST: u8 = 0x02;
    /// Host: sample this often.
    pub const SET_RATE: u8 = 0x03;
    /// Host: send samples.
    pub const START: u8 = 0x04;
    /// Host: send no more samples.
    pub const STOP: u8 = 0x05;
    /// Host: what time is it?
    pub const PING: u8 = 0x06;
    /// Host: show me this part.
    pub const BLINK: u8 = 0x07;
    /// Host: write into this part what it is.
    pub const LABEL: u8 = 0x08;
    /// Device: who it is.
    pub const HELLO: u8 = 0x81;
    /// Device: some parts of the tree.
    pub const TOPOLOGY: u8 = 0x82;
    /// Device: parts were plugged in or out.
    pub const TOPOLOGY_CHANGED: u8 = 0x83;
    /// Device: one reading of every sensor.
    pub const SAMPLE: u8 = 0x84;
    /// Device: the rate granted.
    pub const RATE_SET: u8 = 0x85;
    /// Device: the request is done.
    pub const ACKNOWLEDGE: u8 = 0x86;
    /// Device: its time.
    pub const PONG: u8 = 0x87;
    /// Device: the request will not be done.
    pub const REFUSE: u8 = 0x88;
}

/// Features that not every device or host has; bits not listed are 0 when sent and ignored when received.
pub mod features {
    /// The device can make a part show itself.
    pub const BLINK: u32 = 1 << 0;
    /// Parts may be plugged in and out while the device runs.
    pub const HOT_PLUG: u32 = 1 << 1;
    /// Parts have a memory of their own, and the device writes into it what a part is.
    pub const LABEL: u32 = 1 << 2;
}
