//! Frames: from a message to the bytes on the wire ([`FrameBuffer`]) and back ([`Decoder`]), and why a piece of the
//! stream is not a frame ([`diagnose`]). The layout is in the [crate documentation](crate#frames).

mod checksum;
mod decoder;
mod diagnosis;
mod frame;

pub use decoder::{Decoder, DecoderCounters, Frame};
pub use diagnosis::{FrameEnd, FrameFault, diagnose};
pub use frame::{
    Encode, EncodeError, FrameBuffer, FrameWriter, MAX_FRAME, MAX_PAYLOAD, MIN_FRAME, encode_into, frame_length,
};
