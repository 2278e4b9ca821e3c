//! How the byte stream travels: serial, TCP, USB bulk and HID.
//!
//! The stream is the same everywhere: frames with 0x00 after each, and 0x00 bytes between them that mean nothing. No
//! carrier preserves frame boundaries, and none needs to. A USB device offers one or more of these interfaces, each
//! with its own stream; an interface that no host talks to is silent, as the conversation requires.
//!
//! ```text
//! carrier     how to know it (USB descriptors)               what travels
//! ----------  ---------------------------------------------  -----------------------------------------------------
//! serial,     CDC-ACM: class 02/02, or a chip with a driver  the bytes of the stream. The line speed means nothing to
//! USB serial  of its own                                     CDC-ACM. DTR is set while a host listens.
//! TCP         host and port; the device listens, the host    the bytes of the stream; one host at a time. The device
//!             connects                                       is silent until it is asked for its hello.
//! USB bulk    interface of class FF, subclass 41,            the bytes of the stream. Neither packets nor transfers
//!             protocol 01; one bulk IN and one bulk OUT      mark any boundary; packets of length zero mean
//!             endpoint (the first of each is used)           nothing. After a full-size packet the device sends
//!                                                            the next one, or one of length zero: a host that reads
//!                                                            many packets at once waits for a short one.
//! HID         HID interface whose report descriptor is       reports of 64 bytes, see below: input reports from the
//!             REPORT_DESCRIPTOR: usage page FF41, usage 01,  device on the interrupt IN endpoint, output reports to it
//!             one input and one output report of 64 bytes,   on the interrupt OUT endpoint or, where there is none, as
//!             no report numbers                              Set_Report on the control endpoint
//! ```
//!
//! The name of a USB interface (`iInterface`) is `Armature puppet`: the Linux device manager rules recognise a HID
//! interface by it. A USB device has its own serial number (`iSerial`), by which the host finds it again wherever it is
//! plugged in; without one it is known only by its IDs and its port. Windows lets programs use a bulk interface if the
//! device names `WINUSB` in its Microsoft OS 2.0 descriptors; HID needs no driver anywhere.
//!
//! # A report
//!
//! ```text
//! offset  field        meaning
//! 0       count u8     n, the number of stream bytes in this report: 0 to 63
//! 1       stream       n bytes of the stream
//! 1 + n   padding      0x00 to the end; ignored by the receiver
//! ```
//!
//! * A report with n = 0 carries nothing and may be sent at any time.
//! * A report with n > 63, or of a length other than 64 bytes, is dropped. The missing bytes then show up as a damaged
//!   frame.
//! * A sender fills a report before it starts the next one, except when it has nothing more to send: reports go out
//!   immediately rather than wait until they are full.
//!
//! `golden_reports.txt` in this crate's folder has the bytes of some reports.
//!
//! # What fits
//!
//! A sample of 32 three-axis joints is 244 bytes: four full-speed packets, or four reports.
//!
//! ```text
//! carrier                                 bytes a second      samples of 32 three-axis joints a second
//! serial line at 3 Mbaud                         300,000      1,000 and 18 % to spare
//! USB full speed, bulk                 about   1,000,000      1,000 and more
//! USB full speed, HID, every 1 ms                 63,000        250
//! USB high speed, HID, every 125 µs              504,000      1,000 and half to spare
//! ```
//!
//! The device's `max_rate` states what its line carries.

/// Interface class of a puppet on USB bulk: vendor-specific.
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
/// Most stream bytes in one report.
pub const REPORT_CAPACITY: usize = REPORT_LENGTH - 1;

/// The report descriptor of a puppet on HID.
pub const REPORT_DESCRIPTOR: [u8; 25] = [
    0x06, 0x41, 0xFF, // usage page FF41
    0x09, 0x01, // usage 01
    0xA1, 0x01, // collection: application
    0x09, 0x02, //   usage 02
    0x15, 0x00, //   minimum 0
    0x26, 0xFF, 0x00, // maximum 255
    0x75, 0x08, //   8 bits
    0x95, 0x40, //   64 of these
    0x81, 0x02, //   input
    0x09, 0x03, //   usage 03
    0x91, 0x02, //   output
    0xC0, // end of the collection
];

/// A report with the next bytes of a stream, and how many it took: up to [`REPORT_CAPACITY`].
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

/// The stream bytes in a report; `None` if it is not a valid report.
pub fn read_report(report: &[u8]) -> Option<&[u8]> {
    let (&count, stream) = report.split_first()?;
    let count = usize::from(count);
    (report.len() == REPORT_LENGTH && count <= REPORT_CAPACITY).then(|| &stream[..count])
}
