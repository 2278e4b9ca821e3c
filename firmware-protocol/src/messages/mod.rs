//! The messages: one table, and a type for each.
//!
//! All numbers are unsigned and little-endian. Offsets are bytes from the start of the payload. `R` marks who sends:
//! `>` host to device, `<` device to host.
//!
//! ```text
//! type R  message            offset  field                 meaning
//! 0x01 >  hello request           0  host_major u8         protocol the host speaks
//!                                 1  host_minor u8
//!                                 2  host_features u32     features the host can use, see `features`
//! 0x02 >  topology request                                 (no fields)
//! 0x03 >  set rate                0  rate_millihertz u32   samples per 1,000 seconds: 120 Hz is 120,000
//! 0x04 >  start                                            (no fields)
//! 0x05 >  stop                                             (no fields)
//! 0x06 >  ping                    0  token u64             anything; comes back unchanged
//! 0x07 >  blink                   0  uid 12 bytes          the part that is to show itself
//!                                12  duration_millis u16   for how long; 0 stops it
//! 0x08 >  label                   0  uid 12 bytes          the part into whose memory this is written:
//!                                12  kind u8               as in a topology's record; 0 and 255 are refused
//!                                13  sensor_count u8       at most 3
//!                                14  outlet_count u8       at most 5
//!                                15  counts_per_turn u32   2 to 65,536; ignored without sensors
//!
//! 0x81 <  hello                   0  protocol_major u8     these two fields stay here in every version
//!                                 1  protocol_minor u8
//!                                 2  features u32          features the device has, see `features`
//!                                 6  firmware_major u8
//!                                 7  firmware_minor u8
//!                                 8  firmware_patch u8
//!                                 9  uid 12 bytes          of the part that holds the microcontroller
//!                                21  max_rate_millihertz u32  fastest sampling it can sustain on this line
//!                                25  name_length u8        0 to 32
//!                                26  name                  product name, UTF-8, name_length bytes
//! 0x82 <  topology                0  epoch u16             the tree these records belong to
//!                                 2  part_count u16        parts of the whole tree, at most 65,534; a host may take
//!                                                          fewer (this project's takes 4,096)
//!                                 4  first_index u16       index of the first part in this message
//!                                 6  record_count u8       parts in this message, at most 46
//!                                 7  record_length u8      bytes of each record: 22, more in later versions
//!                                 8  records               record_count of them:
//!           in each record        0  kind u8               1 bend, 2 twist, 3 twist-bend-twist, 4 splitter
//!                                 1  sensor_count u8       sensors it adds to a sample: 1, 1, 3, 0
//!                                 2  outlet u8             the parent's outlet it sits in, from 0; root 0
//!                                 3  outlet_count u8       outlets it has: joints 1, splitters 1 to 5
//!                                 4  parent u16            index of the part it is plugged into; root 0xFFFF
//!                                 6  uid 12 bytes          its own number, wherever it is plugged in
//!                                18  counts_per_turn u32   resolution of its sensors, 2 to 65,536; 0 if none
//! 0x83 <  topology changed        0  epoch u16             the new tree's
//! 0x84 <  sample                  0  device_micros u64     when the sensors were read, since power-up
//!                                 8  sequence u32          0 after start; one more for each sample taken
//!                                12  epoch u16             the tree the sensors are numbered by
//!                                14  sensor_count u16      n, at most 448
//!                                16  counts u16 x n        part by part as the records, inlet to outlet
//!                              16+2n states 2 bits x n     sensor i: bits 2(i mod 4) and up of byte i div 4
//!                                                          0 ok, 1 no data, 2 magnet weak, 3 outlier
//!                                                          unused bits of the last byte are 0
//! 0x85 <  rate set                0  rate_millihertz u32   granted: the nearest to the one asked for
//! 0x86 <  acknowledge             0  request u8            type of the request done: start, stop, blink, label
//! 0x87 <  pong                    0  token u64             as in the ping
//!                                 8  received_micros u64   device clock when the ping's last byte had come
//!                                16  sent_micros u64       device clock when this frame's first byte goes out
//! 0x88 <  refuse                  0  request u8            type of the request that will not be done
//!                                 1  reason u8             1 unknown request, 2 malformed, 3 busy,
//!                                                          4 no such part, 5 sensor bus failed
//! ```
//!
//! A receiver ignores bytes after the fields it knows (later minor versions add some there) and skips types it does not
//! know. A known message that is too short is an error ([`ParseError::TooShort`]) and is ignored.

mod device;
mod fields;
mod host;
mod numbers;
mod part;
mod sample;
mod topology;

pub use device::{Acknowledge, DeviceMessage, Hello, Pong, RateSet, RefusalReason, Refuse, TopologyChanged};
pub use fields::ParseError;
pub use host::HostMessage;
pub use numbers::{MAX_NAME, PROTOCOL_MAJOR, PROTOCOL_MINOR, features, message_type};
pub use part::{PartKind, PartUid};
pub use sample::{MAX_SENSORS, Sample, SampleMessage, SensorState, sample_payload_length};
pub use topology::{MAX_RECORDS, PartRecord, RECORD_LENGTH, TopologyChunk, TopologyMessage, topology_messages};
