// The chips on the modular bus, as their data sheets describe them: register maps, what they acknowledge, how long
// they take. Times are emulated microseconds, given by `now()`.
import { Chip, Segment } from "./i2c.mjs";

/** TCA9548A, eight-channel switch (TI SCPS207). One control register: a bit for each channel, all closed after power-up
 * and after RESET. Channels switch at the stop condition. */
export class Tca9548a extends Chip {
  channels = Array.from({ length: 8 }, () => new Segment());
  control = 0;
  next = null;

  openSegments() {
    return this.channels.filter((_, channel) => this.control & (1 << channel));
  }

  writeFirst(byte) {
    this.next = byte;
    return true;
  }

  writeNext(byte) {
    return this.writeFirst(byte);
  }

  read() {
    return this.control;
  }

  stopped() {
    if (this.next !== null) this.control = this.next;
    this.next = null;
  }

  reset() {
    this.control = 0;
    this.next = null;
  }
}

/** PCA9848 (NXP), for this bus the same, up to 1 MHz. */
export class Pca9848 extends Tca9548a {
  hertz = 1_000_000;
}

/** AS5600, 12-bit rotation sensor (ams v1-06). It samples every 150 us. The address pointer increments, but if it was set to
 * the high byte of an angle it returns there. The data sheet does not say that the high and low byte of one transfer
 * match; this model takes both at the transfer's start, as the chip does by all accounts. */
export class As5600 extends Chip {
  hertz = 1_000_000;
  static SAMPLE_MICROS = 150;
  /** The fault "magnet": detected, too weak, too strong; the gain that the control loop settled on. */
  magnet = { detected: true, weak: false, strong: false };
  counts = 4096;
  pointer = 0;
  hold = false;
  /** When it was last read. */
  readAt = 0;

  constructor(now, radians, gain) {
    super(0x36);
    this.now = now;
    this.radians = radians;
    this.magnet.gain = gain;
  }

  /** The count at a given time. */
  countAt(micros) {
    const sampled = Math.floor(micros / As5600.SAMPLE_MICROS) * As5600.SAMPLE_MICROS;
    return Math.round((this.radians(sampled * 1e-6) / (2 * Math.PI)) * 4096) & 0xfff;
  }

  acknowledges(reading) {
    if (reading) {
      this.readAt = this.now();
      this.raw = this.countAt(this.readAt);
    }
    return true;
  }

  register(address) {
    const { detected, weak, strong, gain } = this.magnet;
    switch (address) {
      case 0x0b:
        return (detected ? 0x20 : 0) | (weak ? 0x10 : 0) | (strong ? 0x08 : 0);
      case 0x0c:
      case 0x0e:
        return this.raw >> 8;
      case 0x0d:
      case 0x0f:
        return this.raw & 0xff;
      case 0x1a:
        return gain;
      default:
        return 0;
    }
  }

  writeFirst(byte) {
    this.pointer = byte;
    this.hold = [0x0c, 0x0e, 0x1b].includes(byte);
    return byte <= 0x08 || (byte >= 0x0b && byte <= 0x0f) || (byte >= 0x1a && byte <= 0x1c) || byte === 0xff;
  }

  /** Writes are ignored: the configuration never changes. */
  writeNext() {
    return false;
  }

  read() {
    const byte = this.register(this.pointer);
    this.pointer = this.hold && this.pointer % 2 === 1 ? this.pointer - 1 : (this.pointer + 1) & 0xff;
    return byte;
  }
}

/** 24AA02E64, 2-kbit memory with an EUI-64 (Microchip DS20002124). The upper half, with the number at 0xF8, cannot be written;
 * pages are 8 bytes; writing takes up to 5 ms, during which it does not answer. It answers to 0x50 to 0x57. */
export class Memory24aa02e64 extends Chip {
  static WRITE_MICROS = 5000;
  bytes = new Uint8Array(256).fill(0xff);
  pointer = 0;
  page = [];
  busyUntil = 0;

  constructor(now, number) {
    super(0x50, 0x51, 0x52, 0x53, 0x54, 0x55, 0x56, 0x57);
    this.now = now;
    this.bytes.set(number, 0xf8);
  }

  acknowledges() {
    return this.now() >= this.busyUntil;
  }

  writeFirst(byte) {
    this.pointer = byte;
    this.page = [];
    return true;
  }

  writeNext(byte) {
    if (this.pointer >= 0x80) return false;
    this.page.push(byte);
    return true;
  }

  read() {
    const byte = this.bytes[this.pointer];
    this.pointer = (this.pointer + 1) & 0xff;
    return byte;
  }

  stopped() {
    if (this.page.length === 0) return;
    const page = this.pointer & 0xf8;
    this.page.forEach((byte, i) => (this.bytes[page | ((this.pointer + i) & 7)] = byte));
    this.page = [];
    this.busyUntil = this.now() + Memory24aa02e64.WRITE_MICROS;
  }
}

/** PCA9536, four pins (TI SCPS125): 0 input, 1 output, 2 polarity, 3 direction (1 is input). */
export class Pca9536 extends Chip {
  registers = [0xff, 0xff, 0x00, 0xff];
  pointer = 0;

  constructor() {
    super(0x41);
  }

  writeFirst(byte) {
    this.pointer = byte & 3;
    return byte <= 3;
  }

  writeNext(byte) {
    if (this.pointer !== 0) this.registers[this.pointer] = byte;
    return true;
  }

  read() {
    return this.registers[this.pointer];
  }

  /** The light is between the supply and pin 0. */
  get lit() {
    return (this.registers[3] & 1) === 0 && (this.registers[1] & 1) === 0;
  }
}
