//! How the byte stream travels: serial, TCP, USB bulk and HID.
//!
//! The stream is the same everywhere: frames with 0x00 behind each, and 0x00 bytes between them that mean nothing. No
//! carrier keeps the bounds of frames, and none needs to. A USB device offers one or more of these interfaces, each with
//! a stream of its own; an interface that no host talks to is silent, as the conversation asks.
//!
//! ```text
//! carrier     how to know it (USB descriptors)               what travels
//! ----------  ---------------------------------------------  -----------------------------------------------------
//! serial,     CDC-ACM: class 02/02, or a chip with a driver  the bytes of the stream. The line speed means nothing to
//! USB serial  of its own                                     CDC-ACM. DTR is up while a host listens.
//! TCP         host and port                                  the bytes of the stream; one host at a time
//! USB bulk    interface of class FF, subclass 41,            the bytes of the stream. Neither packets nor transfers
//!             protocol 01; one bulk IN and one bulk OUT      are bounds of anything; packets of length zero mean
//!             endpoint (the first of each is taken)          nothing. After a packet of the full size the device sends
//!                                                            the next one, or one of length zero: a host that reads
//!                                                            many packets at once waits for a short one.
//! HID         HID interface whose report descriptor is       reports of 64 bytes, see below: input reports from the
//!             REPORT_DESCRIPTOR: usage page FF41, usage 01,  device on the interrupt IN endpoint, output reports to it
//!             one input and one output report of 64 bytes,   on the interrupt OUT endpoint or, where there is none, as
//!             no report numbers                              Set_Report on the control endpoint
//! ```
//!
//! The name of a USB interface (`iInterface`) is `Armature puppet`: the rules for the device manager on Linux know a
//! HID interface by it. A USB device has a serial number (`iSerial`) of its own, by which the host finds it again
//! wherever it is plugged in; without one it is only known by its numbers and its place. Windows lets programs use a bulk
//! interface if the device names `WINUSB` in its Microsoft OS 2.0 descriptors; HID needs nothing anywhere.
//!
//! # A report
//!
//! ```text
//! offset  field        what it says
//! 0       count u8     n, how many bytes of the stream are in this report: 0 to 63
//! 1       stream       n bytes of the stream
//! 1 + n   padding      0x00 to the end; the receiver does not look at it
//! ```
//!
//! * A report with n = 0 carries nothing and may be sent at any time.
//! * A report with n > 63, or of another length than 64 bytes, is dropped. What is missing then shows as a damaged frame.
//! * A sender fills a report before it begins the next one, except where it has nothing more to send: reports go out at once
//!   rather than wait to be full.
//!
//! `golden_reports.txt` beside this crate has the bytes of some reports.
//!
//! # What fits
//!
//! A sample of 32 three-axis joints is 244 bytes, which is four packets of full speed and four reports.
//!
//! ```text
//! carrier                                 bytes a second      samples of 32 three-axis joints a second
//! serial line at 3 Mbaud                         300,000      1,000 and 18 % to spare
//! USB full speed, bulk                 about   1,000,000      1,000 and more
//! USB full speed, HID, every 1 ms                 63,000        250
//! USB high speed, HID, every 125 µs              504,000      1,000 and half to spare
//! ```
//!
//! The device's `max_rate` says what its line carries.

/// Interface class of a puppet on USB bulk: the vendor's own.
pub const BULK_CLASS: u8 = 0xFF;
/// Interface subclass of a puppet on USB bulk.
pub const BULK_SUBCLASS: u8 = 0x41;
/// Interface protocol of a puppet on USB bulk.
pub const BULK_PROTOCOL: u8 = 0x01;
/// Usage page of a puppet on HID.
pub const HID_USAGE_PAGE: u16 = 0xFF41;
/// Usage of a puppet on HID.
pub const HID_USAGE: u16 = 0x01;
/// Bytes of a report.
pub const REPORT_LENGTH: usize = 64;
/// Bytes of the stream in a report at most.
pub const REPORT_CAPACITY: usize = REPORT_LENGTH - 1;

/// The report descriptor of a puppet on HID.
pub const REPORT_DESCRIPTOR: [u8; 25] = [
    0x06, 0x41, 0xFF, // usage page FF41
    0x09, 0x01, // usage 01
    0xA1, 0x01, // collection: application
    0x09, 0x02, //   usage 02
    0x15, 0x00, //   least value 0
    0x26, 0xFF, 0x00, // greatest value 255
    0x75, 0x08, //   8 bits
    0x95, 0x40, //   64 of them
    0x81, 0x02, //   input
    0x09, 0x03, //   usage 03
    0x91, 0x02, //   output
    0xC0, // end of the collection
];

/// A report with the next bytes of a stream, and how many those are: up to [`REPORT_CAPACITY`].
///
/// ```
/// use firmware_protocol::carriers::{read_report, write_report};
///
/// let (report, taken) = write_report(&[7; 100]);
/// assert_eq!(taken, 63);
/// assert_eq!(read_report(&report), Some(&[7; 63][..]));
/// ```
pub fn write_report(stream: &[u8]) -> ([u8; REPORT_LENGTH], usize) {
    let taken = stream.len().min(REPORT_CAPACITY);
    let mut report = [0; REPORT_LENGTH];
    report[0] = taken as u8;
    report[1..=taken].copy_from_slice(&stream[..taken]);
    (report, taken)
}

/// The bytes of the stream in a report; `None` if it is none.
pub fn read_report(report: &[u8]) -> Option<&[u8]> {
    let (&count, stream) = report.split_first()?;
    let count = usize::from(count);
    (report.len() == REPORT_LENGTH && count <= REPORT_CAPACITY).then(|| &stream[..count])
}
