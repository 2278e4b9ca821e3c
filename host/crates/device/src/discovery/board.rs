//! Which board, or which USB chip of a board or adapter, has these numbers.

use crate::arm::ServoProtocol;

/// A board, or the USB chip of boards and adapters, by the numbers that it reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// What it is called, and where it is commonly found.
    pub name: &'static str,
    /// The speed at which the reference firmware's boards with this chip speak; `None` where the speed has no effect.
    pub baud: Option<u32>,
    /// The servos whose adapters have this chip.
    pub servos: Option<ServoProtocol>,
    /// Whether it is found in puppets, as far as is known.
    pub in_puppets: bool,
}

/// An `ATmega328P` at 16 MHz makes this speed exactly.
const NANO: Option<u32> = Some(1_000_000);

const fn serial(name: &'static str) -> Board {
    Board { name, baud: NANO, servos: None, in_puppets: true }
}

const fn native(name: &'static str) -> Board {
    Board { name, baud: None, servos: None, in_puppets: true }
}

const fn servos(name: &'static str, protocol: ServoProtocol) -> Board {
    Board { name, baud: None, servos: Some(protocol), in_puppets: false }
}

/// Numbers as their vendors publish them, and as usb.ids and the boards' own packages list them.
const BOARDS: &[(u16, u16, Board)] = &[
    (0x2341, 0x0043, serial("Arduino Uno")),
    (0x2341, 0x0001, serial("Arduino Uno")),
    (0x2A03, 0x0043, serial("Arduino Uno")),
    (0x2341, 0x0010, serial("Arduino Mega 2560")),
    (0x2341, 0x0042, serial("Arduino Mega 2560")),
    (0x2341, 0x0058, serial("Arduino Nano Every")),
    (0x2341, 0x8036, native("Arduino Leonardo")),
    (0x2341, 0x8037, native("Arduino Micro")),
    (0x2341, 0x805A, native("Arduino Nano 33 BLE")),
    (0x2341, 0x005E, native("Arduino Nano RP2040 Connect")),
    (
        0x1A86,
        0x7523,
        Board { servos: Some(ServoProtocol::Feetech), ..serial("CH340: Arduino Nano or Uno, servo adapter") },
    ),
    (0x1A86, 0x7522, servos("CH340K", ServoProtocol::Feetech)),
    (0x1A86, 0x5523, serial("CH341: serial adapter")),
    (0x1A86, 0x55D3, servos("CH343: servo adapter", ServoProtocol::Feetech)),
    (0x1A86, 0x55D4, serial("CH9102: ESP32 board, serial adapter")),
    (0x0403, 0x6001, serial("FT232R: Arduino Nano, serial adapter")),
    (0x0403, 0x6015, serial("FT231X: serial adapter")),
    (0x0403, 0x6010, serial("FT2232: serial adapter")),
    (0x0403, 0x6014, servos("FT232H: U2D2", ServoProtocol::Dynamixel)),
    (0x10C4, 0xEA60, serial("CP210x: ESP32 board, serial adapter")),
    (0x067B, 0x2303, serial("PL2303: serial adapter")),
    (0x2E8A, 0x000A, native("Raspberry Pi Pico")),
    (0x2E8A, 0x0005, native("Raspberry Pi Pico with MicroPython")),
    (0x2E8A, 0x000C, serial("Raspberry Pi Debug Probe")),
    (0x16C0, 0x0483, native("Teensy")),
    (0x303A, 0x1001, native("ESP32 with USB")),
    (0x0483, 0x5740, native("STM32 board")),
    (0x1209, 0x0001, native("Raspberry Pi Pico with the reference firmware")),
];

/// What is known of a vendor's other products.
const VENDORS: &[(u16, Board)] = &[
    (0x2341, serial("Arduino board")),
    (0x2A03, serial("Arduino board")),
    (0x2E8A, native("Raspberry Pi board")),
    (0x239A, native("Adafruit board")),
    (0x303A, native("Espressif board")),
    (0x0403, serial("FTDI adapter")),
    (0x2F5D, servos("OpenRB or OpenCM", ServoProtocol::Dynamixel)),
];

/// The board with these numbers, if they are known. Chips are built into many things, so this says what is likely.
pub(super) fn board(vendor_id: u16, product_id: u16) -> Option<Board> {
    let exactly = BOARDS.iter().find(|(vendor, product, _)| (*vendor, *product) == (vendor_id, product_id));
    let maker = || VENDORS.iter().find(|(vendor, _)| *vendor == vendor_id).map(|(_, board)| *board);
    exactly.map(|(_, _, board)| *board).or_else(maker)
}
