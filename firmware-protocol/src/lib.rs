#![no_std]
#![forbid(unsafe_code)]
//! The wire contract between a puppet and its host, version 1.0: byte stream → frames → messages.
//!
//! This page is all that is needed to implement either side, in any language: the frames are described here, the
//! messages in one table in [`messages`], what carries the bytes (serial, TCP, USB bulk, HID) in [`carriers`], and
//! `golden.txt` beside this crate holds the bytes of each message. The Rust code needs no operating system and no heap.
//!
//! # Frames
//!
//! A frame on the wire:
//!
//! ```text
//! length    2 bytes   n, the bytes of the stuffed part: 0x80 | (n & 0x7F), then 0x80 | (n >> 7)
//! stuffed   n bytes   type u8 and payload (0 to 1024 bytes), stuffed so that no byte is zero
//! length    2 bytes   the same two bytes again
//! checksum  5 bytes   c over all bytes above, as they stand on the wire: 0x80 | (c & 0x7F), 0x80 | (c >> 7 & 0x7F),
//!                     0x80 | (c >> 14 & 0x7F), 0x80 | (c >> 21 & 0x7F), 0x80 | (c >> 28)
//! delimiter 1 byte    0x00, which occurs nowhere else
//! ```
//!
//! * **Stuffing** is COBS. Type and payload are cut into runs of non-zero bytes. Each run is written as one code byte,
//!   its length plus one, followed by its bytes; the zero behind it is left out, since the code byte implies it. A run
//!   has at most 254 bytes: code 0xFF then stands for 254 bytes *without* a zero behind them. The zero that the last
//!   run would imply does not exist. Behind a last run of 254 bytes no further code byte is written (a receiver
//!   accepts one all the same).
//! * **Checksum**: CRC-32/ISO-HDLC as in Ethernet and zlib (reflected polynomial 0xEDB88320, start and final
//!   exclusive-or 0xFFFFFFFF; `123456789` gives 0xCBF43926).
//! * A **sender** begins with one 0x00, so that whatever the line held before is cut off. It may send further 0x00
//!   bytes between frames at any time; they mean nothing.
//! * A **receiver** collects bytes up to the next 0x00, drops the piece if it is shorter than 11 bytes, if either length
//!   is not its own length less 9, if the checksum does not hold or if the stuffing is broken, and goes on behind
//!   the 0x00. So it finds back within one frame after any noise, whatever the noise was. A receiver that
//!   understands only short frames may drop longer ones unseen.
//!
//! The least and the most a frame takes: [`MIN_FRAME`] = 12 and [`MAX_FRAME`] = 1040 bytes.
//!
//! This is the sending half in C, tested against the golden bytes:
//!
//! ```c
#![doc = include_str!("../c/frame.c")]
//! ```
//!
//! ## What the frame guarantees
//!
//! For certain:
//! * No error burst of up to 32 bits on the wire goes unnoticed (first and last wrong bit at most 31 apart, in the order
//!   a UART sends them, lowest bit first), *wherever* it falls. If it makes or destroys no 0x00 the frame keeps its
//!   bounds, and a CRC of 32 bits catches every such burst; it covers the bytes as they are on the wire, so that
//!   unstuffing cannot spread the error first, and its own bits follow in the order the burst argument needs. If it
//!   makes a 0x00, the front piece still begins with the true length and the rear piece still ends with it, and
//!   neither has it: that is why the length stands at both ends (the burst is too short to reach both, and pieces that
//!   short are no frames). If it destroys a 0x00, the frames before and behind it become one piece that is longer
//!   than its lengths say.
//! * No run of bytes lost from the inside of one frame, doubled in it or put into it (without a 0x00) goes unnoticed:
//!   one of the two lengths survives and does not fit.
//!
//! Only very probably:
//! * Anything longer: several bursts in one frame, lost bytes that take a delimiter with them, plain noise. A damaged
//!   piece that still has both lengths right is taken wrongly once in 2³² times (4·10⁹). Random bytes would have to
//!   hit four bytes of length and five of checksum exactly, once in 2⁷² pieces.
//!
//! Nothing here keeps frames from being lost; samples carry a number so that the host can count what it missed.
//!
//! # What fits the line
//!
//! A sample of 32 three-axis joints has 96 sensors: 16 + 2·96 + 96/4 = 232 bytes of payload. With the type (1), one code
//! byte, two lengths (4), checksum (5) and delimiter (1) that is **244 bytes** on the wire. A UART sends 10 bits a byte
//! (8N1), so 1,000 samples a second take 2,440,000 bit/s: **81.3 %** of a line at 3 Mbaud. The other 18 % are 56 kB/s for
//! pongs and topologies (a part's record is 22 bytes: 32 joints and some splitters are about 1 kB, 3 ms).
//!
//! # The conversation
//!
//! The **host speaks first**; a device sends nothing before the first hello request except one hello after power-up,
//! which tells a host that was already listening that the device has restarted. Times are what the other side may rely
//! on.
//!
//! 1. *Hello.* The host sends 0x00 and a hello request, and again every 0.25 s until a hello comes. The device stops
//!    streaming, and answers every hello request within 0.1 s, always, in every state. The version fields of request
//!    and answer stay where they are in every version of the protocol, and so does the frame; if the major numbers
//!    differ, the two do not go on. With equal major numbers both sides go by the lower minor number.
//! 2. *Topology.* The host sends a topology request; the device answers within 0.5 s with one or more topology messages
//!    of one epoch, in order of `first_index`, until `part_count` records are out (one message without records if there
//!    are no parts). Parents come before their children; exactly one part, the first, is the root. If the tree changes
//!    meanwhile, the device begins again with the new epoch, and the host drops what it had. The device answers
//!    at any time, also while it streams.
//! 3. *Rate.* The host sends set rate. The device answers with the rate it grants, the nearest it can do: at least
//!    1 mHz, at most the `max_rate` of its hello, which is what its sensors *and the line* allow (the frame lengths above
//!    are exact). It may be changed while streaming.
//! 4. *Start.* The device acknowledges, sets its sequence number to 0 and sends samples at equal intervals until
//!    *stop*, another hello request or its end. Start while streaming and stop while stopped are acknowledged and
//!    change nothing (so both can be repeated safely). The acknowledgement of stop follows the last sample.
//! 5. *Ping* is answered at once, in every state. The host takes the four times as NTP does; the shortest round trip
//!    of several tells the clock offset best.
//! 6. *Blink* is acknowledged, or refused if there is no such part.
//!
//! Every request is repeated by the host if its answer has not come within 0.25 s (topology 0.5 s); all requests may be
//! repeated without harm. A request that is unknown or malformed is answered with *refuse*. A device that cannot keep
//! up leaves samples out, but counts them in `sequence`: a gap is how the host knows.
//!
//! **Epochs.** `epoch` numbers the states of the tree. Whenever a part comes or goes, it grows by one (65,535 is followed
//! by 0), the device sends *topology changed*, and all later samples are laid out by the new tree and carry the
//! new number. A host that sees an epoch in a sample for which it has no topology asks for it, and keeps such samples
//! apart until it has it; so a lost *topology changed* does no harm. Streaming does not stop for any of this. A part that
//! does not answer but is still plugged in stays in the tree with state *no data*.
//!
//! **Clock.** `device_micros` never runs backwards and never jumps while the device runs. A `device_micros` or `sequence`
//! far below the last one, or a hello nobody asked for, means the device has restarted: the host begins at 1.
//!
//! **Newer and older peers.** Unknown message types are skipped, bytes behind the known fields are ignored, records of
//! the topology state their length, unknown part kinds state their sensors and outlets, reserved bits are sent as 0 and
//! ignored. A minor version only adds in these places. Anything else is a new major version.
//!
//! # Use from Rust
//!
//! ```
//! use firmware_protocol::{Decoder, DeviceMessage, FrameBuffer, SampleMessage, SensorState};
//!
//! // The device's side.
//! let mut wire = FrameBuffer::new();
//! let mut bytes = wire.encode(&SampleMessage {
//!     device_micros: 1_000,
//!     sequence: 1,
//!     epoch: 0,
//!     counts: &[512, 1023],
//!     states: &[SensorState::Ok, SensorState::MagnetWeak],
//! })?;
//!
//! // The host's side.
//! let mut decoder = Decoder::new();
//! while let Some(frame) = decoder.next_frame(&mut bytes) {
//!     if let Ok(DeviceMessage::Sample(sample)) = DeviceMessage::parse(frame) {
//!         assert_eq!(sample.count(1), Some(1023));
//!         assert_eq!(sample.state(1), Some(SensorState::MagnetWeak));
//!     }
//! }
//! # Ok::<(), firmware_protocol::EncodeError>(())
//! ```
//!
//! On a microcontroller take the crate with `default-features = false`: the checksum then uses 64 bytes of table in
//! place of 16 KiB.

pub mod carriers;
mod checksum;
mod decoder;
mod diagnosis;
mod fields;
mod frame;
pub mod messages;
mod sample;
mod topology;

pub use decoder::{Decoder, DecoderCounters, Frame};
pub use diagnosis::{FrameEnd, FrameFault, diagnose};
pub use frame::{EncodeError, FrameBuffer, FrameWriter, MAX_FRAME, MAX_PAYLOAD, MIN_FRAME, encode_into, frame_length};
pub use messages::{
    Acknowledge, DeviceMessage, Encode, Hello, HostMessage, MAX_NAME, PROTOCOL_MAJOR, PROTOCOL_MINOR, ParseError,
    PartUid, Pong, RateSet, RefusalReason, Refuse, TopologyChanged, features, message_type,
};
pub use sample::{MAX_SENSORS, Sample, SampleMessage, SensorState, sample_payload_length};
pub use topology::{
    MAX_RECORDS, PartKind, PartRecord, RECORD_LENGTH, TopologyChunk, TopologyMessage, topology_messages,
};
