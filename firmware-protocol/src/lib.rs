#![no_std]
#![forbid(unsafe_code)]
//! The wire contract between a puppet and its host, version 1.0: bytes to frames to messages, and back. It needs no
//! operating system and no heap.
//!
//! Both sides of a conversation: a sample sent, and the same sample read:
//!
//! ```
//! use firmware_protocol::{Decoder, DeviceMessage, FrameBuffer, SampleMessage, SensorState};
//!
//! let (counts, states) = ([512, 1023], [SensorState::Ok, SensorState::MagnetWeak]);
//! let mut wire = FrameBuffer::new();
//! let sample = SampleMessage { device_micros: 1_000, sequence: 1, epoch: 0, counts: &counts, states: &states };
//! let mut bytes = wire.encode(&sample)?;
//!
//! let mut decoder = Decoder::new();
//! while let Some(frame) = decoder.next_frame(&mut bytes) {
//!     let Ok(DeviceMessage::Sample(sample)) = DeviceMessage::parse(frame) else { continue };
//!     assert_eq!((sample.count(1), sample.state(1)), (Some(1023), Some(SensorState::MagnetWeak)));
//! }
//! # Ok::<(), firmware_protocol::EncodeError>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`framing`] | [`FrameBuffer::encode`] and [`encode_into`] write a message as a frame; [`Decoder::next_frame`] finds the frames in a stream; [`diagnose`] says which rule a damaged piece breaks |
//! | [`messages`] | the one table of messages; [`HostMessage::parse`] and [`DeviceMessage::parse`] read them; [`topology_messages`] describes a tree of parts |
//! | [`carriers`] | what carries the bytes: serial, TCP, USB bulk, HID; [`carriers::write_report`] and [`carriers::read_report`] for HID |
//!
//! The rest of this page, the table in [`messages`] and [`carriers`] are all you need to implement either side in any
//! language; `golden.txt` in this crate's folder holds the bytes of each message.
//!
//! # Frames
//!
//! A frame on the wire:
//!
//! ```text
//! length    2 bytes   n, the bytes of the stuffed part: 0x80 | (n & 0x7F), then 0x80 | (n >> 7)
//! stuffed   n bytes   type u8 and payload (0 to 1024 bytes), stuffed so that no byte is zero
//! length    2 bytes   the same two bytes again
//! checksum  5 bytes   c over all bytes above, as sent on the wire: 0x80 | (c & 0x7F), 0x80 | (c >> 7 & 0x7F),
//!                     0x80 | (c >> 14 & 0x7F), 0x80 | (c >> 21 & 0x7F), 0x80 | (c >> 28)
//! delimiter 1 byte    0x00, which occurs nowhere else
//! ```
//!
//! * **Stuffing** is COBS. Type and payload are cut into runs of non-zero bytes. Each run is written as one code byte,
//!   its length plus one, followed by its bytes; the zero after it is omitted, since the code byte implies it. A run
//!   has at most 254 bytes: code 0xFF then stands for 254 bytes *without* a zero after them. The zero that the last run
//!   would imply does not exist. After a last run of 254 bytes no further code byte is written (but a receiver accepts
//!   one).
//! * **Checksum**: CRC-32/ISO-HDLC as in Ethernet and zlib (reflected polynomial 0xEDB88320, start and final
//!   exclusive-or 0xFFFFFFFF; `123456789` gives 0xCBF43926).
//! * A **sender** begins with one 0x00, to cut off whatever was on the line before. It may send further 0x00 bytes
//!   between frames at any time; they mean nothing.
//! * A **receiver** collects bytes up to the next 0x00, drops the piece if it is shorter than 11 bytes, if either
//!   length is not the piece's own length less 9, if the checksum does not match or if the stuffing is broken, and
//!   continues after the 0x00. So it resynchronises within one frame after any noise. A receiver that only understands
//!   short frames may drop longer ones unread.
//!
//! The shortest and the longest frame: [`MIN_FRAME`] = 12 and [`MAX_FRAME`] = 1040 bytes.
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
//! * No error burst of up to 32 bits on the wire goes unnoticed (first and last wrong bit at most 31 apart, in the
//!   order a UART sends them, lowest bit first), *wherever* it falls. If it neither creates nor destroys a 0x00, the
//!   frame keeps its boundaries, and a 32-bit CRC catches every such burst; the CRC covers the bytes as they are on the
//!   wire, so that unstuffing cannot spread the error first, and its own bits follow in the order the burst argument
//!   needs. If it creates a 0x00, the front piece still begins with the true length and the rear piece still ends with
//!   it, but neither piece has that length: this is why the length is sent at both ends (the burst is too short to
//!   reach both, and pieces that short are not frames). If it destroys a 0x00, the frames before and after it become
//!   one piece that is longer than its lengths say.
//! * No run of bytes lost from, repeated in or inserted into one frame (without a 0x00) goes unnoticed: one of the two
//!   lengths survives and does not match.
//!
//! Only very probably:
//! * Anything longer: several bursts in one frame, lost bytes that take a delimiter with them, plain noise. A damaged
//!   piece that still has both lengths right is wrongly accepted once in 2³² times (4·10⁹). Random bytes would have to
//!   match four bytes of length and five of checksum exactly: once in 2⁷² pieces.
//!
//! Nothing here prevents frames from being lost; samples are numbered so that the host can count the ones it missed.
//!
//! # What fits the line
//!
//! A sample of 32 three-axis joints has 96 sensors: 16 + 2·96 + 96/4 = 232 bytes of payload. With the type (1), one
//! code byte, two lengths (4), checksum (5) and delimiter (1), that is **244 bytes** on the wire. A UART sends 10 bits
//! per byte (8N1), so 1,000 samples a second take 2,440,000 bit/s: **81.3 %** of a 3 Mbaud line. The other 18 % are 56
//! kB/s for pongs and topologies (a part's record is 22 bytes: 32 joints and some splitters take about 1 kB, 3 ms).
//!
//! # The conversation
//!
//! The **host speaks first**; before the first hello request a device sends nothing except one hello after power-up,
//! which tells a host that was already listening that the device has restarted. Times are what the other side may rely
//! on.
//!
//! 1. *Hello.* The host sends 0x00 and a hello request, and repeats it every 0.25 s until a hello arrives. The device
//!    stops streaming, and answers every hello request within 0.1 s, in every state. The version fields of request and
//!    answer stay where they are in every version of the protocol, and so does the frame layout; if the major numbers
//!    differ, the two sides do not continue. With equal major numbers, both sides use the lower minor number.
//! 2. *Topology.* The host sends a topology request; the device answers within 0.5 s with one or more topology messages
//!    of one epoch, in order of `first_index`, until `part_count` records are sent (one message without records if
//!    there are no parts). Parents come before their children; exactly one part, the first, is the root. If the tree
//!    changes meanwhile, the device starts over with the new epoch, and the host drops what it had. The device answers
//!    at any time, even while streaming.
//! 3. *Rate.* The host sends set rate. The device answers with the rate it grants, the nearest it can do: at least 1
//!    mHz, at most the `max_rate` of its hello, which is what its sensors *and the line* allow (the frame lengths above
//!    are exact). The rate may be changed while streaming.
//! 4. *Start.* The device acknowledges, sets its sequence number to 0 and sends samples at equal intervals until
//!    *stop*, another hello request or power-off. Start while streaming and stop while stopped are acknowledged and
//!    change nothing (so both can be repeated safely). The acknowledgement of stop follows the last sample.
//! 5. *Ping* is answered immediately, in every state. The host uses the four times as NTP does; of several round trips,
//!    the shortest gives the best clock offset.
//! 6. *Blink* is acknowledged, or refused if there is no such part.
//! 7. *Label*, for devices with that feature, writes into a part's own memory what it is. It is acknowledged once it has
//!    been read back, and a *topology changed* follows. A part that has no label yet is of kind 0; its sensors are those
//!    that answer.
//!
//! The host repeats every request whose answer has not arrived within 0.25 s (topology 0.5 s); all requests may be
//! repeated without harm. A request that is unknown or malformed is answered with *refuse*. A device that cannot keep
//! up skips samples, but counts them in `sequence`: the host knows by the gap.
//!
//! **Clock.** `device_micros` counts microseconds since power-up in 64 bits and is the same clock in samples and pongs.
//! While the device runs it never goes back, never stands still from one sample to the next and never leaps: a device
//! reads its 64 bits as one value. Going back to near 0 with `sequence` starting over is a restart; a clock that goes back
//! while `sequence` goes on is a fault, and so is one that leaps ahead of the time that has passed. A host rejects or
//! mends such samples and reports them.
//!
//! **Epochs.** `epoch` numbers the states of the tree. Whenever a part comes or goes, it grows by one (65,535 is
//! followed by 0), the device sends *topology changed*, and all later samples are laid out by the new tree and carry
//! the new number. A host that sees an epoch in a sample for which it has no topology requests it, and sets such
//! samples aside until it has it; so a lost *topology changed* does no harm. Streaming does not stop for any of this. A
//! part that does not answer but is still plugged in stays in the tree with state *no data*.
//!
//! **Clock.** `device_micros` never runs backwards and never jumps while the device runs. A `device_micros` or
//! `sequence` far below the last one, or an unrequested hello, means the device has restarted: the host goes back to
//! step 1.
//!
//! **Newer and older peers.** Unknown message types are skipped, bytes after the known fields are ignored, topology
//! records state their length, unknown part kinds state their sensors and outlets, reserved bits are sent as 0 and
//! ignored. A minor version only adds in these places. Anything else is a new major version.
//!
//! # On a microcontroller
//!
//! Use the crate with `default-features = false`: the checksum then uses a 64-byte table instead of 16 KiB.

pub mod carriers;
pub mod framing;
pub mod messages;

pub use framing::{
    Decoder, DecoderCounters, Encode, EncodeError, Frame, FrameBuffer, FrameEnd, FrameFault, FrameWriter, MAX_FRAME,
    MAX_PAYLOAD, MIN_FRAME, diagnose, encode_into, frame_length,
};
pub use messages::{
    Acknowledge, DeviceMessage, Hello, HostMessage, MAX_NAME, MAX_RECORDS, MAX_SENSORS, PROTOCOL_MAJOR, PROTOCOL_MINOR,
    ParseError, PartKind, PartRecord, PartUid, Pong, RECORD_LENGTH, RateSet, RefusalReason, Refuse, Sample,
    SampleMessage, SensorState, TopologyChanged, TopologyChunk, TopologyMessage, features, message_type,
    sample_payload_length, topology_messages,
};
