// Sensors on SPI, as their data sheets describe them, and fixed puppets: those of reference-firmware/table_*.c.
// Words are latched when the select line rises; times are emulated microseconds, given by `now()`.
import { KINDS, swing } from "./parts.mjs";

/** The port: a byte goes to the devices whose select line is low; if none drives the data line, its pull-up does. */
export class SpiPort {
  lines = [];
  selected = new Set();

  /** A select pin has changed. */
  select(line, low) {
    const device = this.lines[line];
    if (!device || low === this.selected.has(device)) return;
    if (low) this.selected.add(device);
    else this.selected.delete(device);
    device.select(low);
  }

  exchange(byte) {
    return [...this.selected].reduce((answer, device) => answer & device.exchange(byte), 0xff);
  }
}

const isOdd = (word) => [8, 4, 2, 1].reduce((folded, shift) => folded ^ (folded >> shift), word) & 1;
const withParity = (word) => word | (isOdd(word) << 15);

/** One rotation sensor: its position and its faults. */
class Rotation {
  counts = 16384;
  magnet = { weak: false, strong: false, ready: true };

  constructor(now, radians) {
    this.now = now;
    this.radians = radians;
  }

  countAt(micros) {
    const count = Math.round((this.radians(micros * 1e-6) / (2 * Math.PI)) * this.counts);
    return ((count % this.counts) + this.counts) % this.counts;
  }

  readAt = 0;

  count() {
    this.readAt = this.now();
    return this.countAt(this.readAt);
  }
}

/** AS5047P and AS5048A, alone or as a chain: 16-bit words with even parity; the answer to a command comes
 * with the next word, whose bit 14 says that the last command was damaged. */
export class As504xChain {
  static AGC = 0x80;
  /** Faults: no sensor on the line; the line held low; bits to flip in the next answers. */
  gone = false;
  shorted = false;
  flips = 0;

  constructor(sensors, diagnosis) {
    this.devices = sensors.map((sensor) => ({ sensor, answer: 0, errors: 0 }));
    this.diagnosis = diagnosis;
  }

  select(low) {
    if (low) {
      this.received = [];
      // The last device of the chain is heard first.
      const words = this.devices.map(({ answer }) => answer).reverse();
      this.sending = words.flatMap((word) => [word >> 8, word & 0xff]);
      if (this.flips > 0) {
        this.flips -= 1;
        this.sending[0] ^= 0x10;
      }
      return;
    }
    if (this.received.length !== 2 * this.devices.length) return;
    this.devices.toReversed().forEach((device, i) => this.take(device, (this.received[2 * i] << 8) | this.received[2 * i + 1]));
  }

  take(device, command) {
    if (isOdd(command)) {
      device.errors |= 4;
      device.answer = withParity(0x4000);
      return;
    }
    device.answer = withParity((command & 0x4000 ? this.register(device, command & 0x3fff) : 0) | (device.errors ? 0x4000 : 0));
  }

  register(device, address) {
    const { sensor } = device;
    const { weak, strong, ready } = sensor.magnet;
    switch (address) {
      case 0x0001: {
        const { errors } = device;
        device.errors = 0;
        return errors;
      }
      case 0x3fff:
        return sensor.count();
      case this.diagnosis:
        return As504xChain.AGC | (ready ? 0x100 : 0) | (strong ? 0x400 : 0) | (weak ? 0x800 : 0);
      default:
        return 0;
    }
  }

  exchange(byte) {
    this.received.push(byte);
    const out = this.sending[this.received.length - 1] ?? 0;
    return this.gone ? 0xff : this.shorted ? 0 : out;
  }
}

/** MT6701 on SSI: 14 bits of angle, 4 of state, CRC-6 over both. */
export class Mt6701 {
  gone = false;
  shorted = false;
  flips = 0;

  constructor(sensor) {
    this.sensor = sensor;
  }

  select(low) {
    if (!low) return;
    const { weak, strong, ready } = this.sensor.magnet;
    const state = (strong ? 1 : 0) | (weak ? 2 : 0) | (ready ? 0 : 8);
    const bits = (this.sensor.count() << 4) | state;
    let crc = 0;
    for (let bit = 17; bit >= 0; bit--) {
      const carry = ((crc >> 5) ^ (bits >> bit)) & 1;
      crc = ((crc << 1) & 0x3f) ^ (carry ? 3 : 0);
    }
    let word = (bits << 6) | crc;
    if (this.flips > 0) {
      this.flips -= 1;
      word ^= 1 << 15;
    }
    this.sending = [(word >> 16) & 0xff, (word >> 8) & 0xff, word & 0xff];
  }

  exchange() {
    const out = this.sending.shift() ?? 0xff;
    return this.gone ? 0xff : this.shorted ? 0 : out;
  }
}

/** A potentiometer of 270 degrees; its voltage as a fraction of the supply. */
class Potentiometer {
  counts = 1365;
  magnet = {};
  broken = false;
  readAt = 0;

  constructor(now, radians) {
    this.now = now;
    this.radians = radians;
  }

  share(micros) {
    return this.broken ? 0 : this.radians(micros * 1e-6) / ((270 / 180) * Math.PI);
  }

  countAt(micros) {
    return Math.min(1023, Math.floor(this.share(micros) * 1024));
  }
}

const CHAIN = 0x3ffd;
const SINGLE = 0x3ffc;
const joint = (name, parent, outlet, line) => ({ name, parent, outlet, kind: "twist-bend-twist", chip: "AS5048A", lines: [line] });
const splitter = (name, parent = null, outlet = 0) => ({ name, parent, outlet, kind: "splitter", lines: [] });

/** The tables of reference-firmware/table_*.c. */
export const TABLES = {
  one: [splitter("base"), { name: "knee", parent: "base", outlet: 0, kind: "bend", chip: "potentiometer", lines: [0] }],
  mixed: [
    splitter("base"),
    { name: "a", parent: "base", outlet: 0, kind: "twist-bend-twist", chip: "AS5047P", lines: [0, 1, 2] },
    { name: "b", parent: "base", outlet: 1, kind: "bend", chip: "MT6701", lines: [3] },
    { name: "c", parent: "base", outlet: 2, kind: "twist", chip: "AS5048A", lines: [4] },
    { name: "d", parent: "base", outlet: 3, kind: "bend", chip: "potentiometer", lines: [0] },
  ],
  seven: [
    splitter("chest"),
    joint("left_shoulder", "chest", 0, 0), joint("left_elbow", "left_shoulder", 0, 1), joint("left_wrist", "left_elbow", 0, 2),
    joint("neck", "chest", 1, 3),
    joint("right_shoulder", "chest", 2, 4), joint("right_elbow", "right_shoulder", 0, 5), joint("right_wrist", "right_elbow", 0, 6),
  ],
  human: [
    splitter("chest"),
    ...limb("left", ["collar", "shoulder", "elbow", "wrist"], "chest", 0, 0),
    joint("neck", "chest", 1, 4), joint("head", "neck", 0, 5),
    ...limb("right", ["collar", "shoulder", "elbow", "wrist"], "chest", 2, 6),
    joint("spine", "chest", 3, 10),
    splitter("pelvis", "spine"),
    ...limb("left", ["hip", "knee", "ankle", "toes"], "pelvis", 0, 11),
    ...limb("right", ["hip", "knee", "ankle", "toes"], "pelvis", 1, 15),
  ],
};

function limb(side, joints, parent, outlet, line) {
  return joints.map((name, i) =>
    joint(`${side}_${name}`, i === 0 ? parent : `${side}_${joints[i - 1]}`, i === 0 ? outlet : 0, line + i));
}

/** A fixed puppet on a board's SPI port and analogue inputs, for a bench. */
export function fixedPuppet(name) {
  return {
    build(board) {
      const { now } = board;
      board.spi.lines = [];
      const parts = TABLES[name].map((entry, index) => {
        const motion = entry.chip === "potentiometer" ? (_, seconds) => 2.3 + Math.sin(seconds) : swing(index);
        const Sensor = entry.chip === "potentiometer" ? Potentiometer : Rotation;
        const sensors = Array.from(
          { length: KINDS[entry.kind].sensors },
          (_, sensor) => new Sensor(now, (seconds) => motion(sensor, seconds)),
        );
        const device = (i) => {
          if (entry.chip === "MT6701") return new Mt6701(sensors[i]);
          return new As504xChain(entry.chip === "AS5048A" ? sensors : [sensors[i]], entry.chip === "AS5048A" ? CHAIN : SINGLE);
        };
        const devices = entry.chip === "potentiometer" ? [] : entry.lines.map((_, i) => device(i));
        devices.forEach((made, i) => (board.spi.lines[entry.lines[i]] = made));
        if (entry.chip === "potentiometer") board.analogue[entry.lines[0]] = sensors[0];
        return { name: entry.name, kind: entry.kind, uid: numberOf(index), sensors, devices };
      });
      return { all: () => parts.values() };
    },
  };
}

/** FIX, the board's number, the part's index. */
function numberOf(index) {
  return Uint8Array.from([0x46, 0x49, 0x58, 0, 1, 0, 0, 0, 0, 0, 0, index]);
}
