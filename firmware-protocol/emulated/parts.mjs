// Parts of the modular bus, wired as reference-firmware/tree_bus.h describes, and trees of them.
import { As5600, Memory24aa02e64, Pca9536, Tca9548a } from "./chips.mjs";

const SECOND_BUS_OUTLET = 3;

export const KINDS = {
  bend: { code: 1, sensors: 1, outlets: 1 },
  twist: { code: 2, sensors: 1, outlets: 1 },
  "twist-bend-twist": { code: 3, sensors: 3, outlets: 1 },
  splitter: { code: 4, sensors: 0, outlets: 5 },
};

export function crc8(bytes) {
  let crc = 0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = crc & 0x80 ? ((crc << 1) ^ 0x07) & 0xff : (crc << 1) & 0xff;
  }
  return crc;
}

/** The label that the firmware reads; 4,096 counts per turn. */
export function label(kind, outlets) {
  const { code, sensors } = KINDS[kind];
  const counts = sensors > 0 ? 4095 : 0xffff;
  const bytes = [0x41, 1, code, sensors, outlets, counts & 0xff, counts >> 8];
  return [...bytes, crc8(bytes)];
}

/** One part. `radians(sensor, seconds)` gives the angles of its sensors. */
export class Part {
  children = new Map();
  parent = null;
  levelLines = 0;

  /** Only in a part with a two-bus controller: its second multiplexer, for outlets 3 and 4. */
  second = null;

  constructor(now, { name, kind, number, outlets = KINDS[kind].outlets, labelled = true, radians, fullGain = 255, Multiplexer = Tca9548a }) {
    Object.assign(this, { name, kind, outlets, fullGain, Multiplexer });
    this.multiplexer = new Multiplexer();
    this.memory = new Memory24aa02e64(now, number);
    this.light = new Pca9536();
    this.sensors = Array.from(
      { length: KINDS[kind].sensors },
      (_, sensor) => new As5600(now, (seconds) => radians(sensor, seconds), fullGain / 2),
    );
    if (labelled) this.memory.bytes.set(label(kind, outlets), 0);
    const { channels } = this.multiplexer;
    channels[0].chips.add(this.memory).add(this.light);
    this.sensors.forEach((sensor, i) => channels[i].chips.add(sensor));
  }

  /** The protocol's twelve bytes. */
  get uid() {
    return Uint8Array.from([0x45, 0x55, 0x49, 0, ...this.memory.bytes.slice(0xf8)]);
  }

  /** The inlet's lines reach the multiplexer; the XOR gate produces those of the outlets. */
  setLevelLines(lines) {
    this.levelLines = lines;
    this.multiplexer.addresses = [0x70 | lines];
    if (this.second) this.second.addresses = [0x70 | lines];
    for (const child of this.children.values()) child.setLevelLines(this.outletLines());
  }

  outletLines() {
    const [l0, l1, l2] = [0, 1, 2].map((bit) => (this.levelLines >> bit) & 1);
    return l2 | ((l0 ^ l2) << 1) | (l1 << 2);
  }

  attachSecondBus(segment) {
    this.second = new this.Multiplexer();
    segment.chips.add(this.second);
    for (const [outlet, child] of this.children) {
      if (outlet < SECOND_BUS_OUTLET) continue;
      this.multiplexer.channels[3 + outlet].chips.delete(child.multiplexer);
      this.second.channels[3 + outlet].chips.add(child.multiplexer);
    }
  }

  /** The wires of an outlet. */
  outletSegment(outlet) {
    const multiplexer = this.second && outlet >= SECOND_BUS_OUTLET ? this.second : this.multiplexer;
    return multiplexer.channels[3 + outlet];
  }

  /** Plugs in a part while the power is on: it starts with all channels closed. */
  plug(outlet, child) {
    if (this.children.has(outlet)) throw new Error(`outlet ${outlet} of ${this.name} is taken`);
    this.children.set(outlet, child);
    child.parent = this;
    child.powerUp();
    child.setLevelLines(this.outletLines());
    this.outletSegment(outlet).chips.add(child.multiplexer);
  }

  unplug(outlet) {
    const child = this.children.get(outlet);
    this.children.delete(outlet);
    child.parent = null;
    this.outletSegment(outlet).chips.delete(child.multiplexer);
    return child;
  }

  powerUp() {
    this.multiplexer.reset();
    this.second?.reset();
    this.light.registers = [0xff, 0xff, 0x00, 0xff];
    for (const child of this.children.values()) child.powerUp();
  }

  /** The RESET line; a controller with two buses has one for each. */
  resetMultiplexers(bus = 0) {
    (bus === 0 ? this.multiplexer : this.second).reset();
    for (const [outlet, child] of this.children) {
      if (!this.second || (outlet >= SECOND_BUS_OUTLET) === (bus === 1)) child.resetMultiplexers();
    }
  }

  /** This part and everything that hangs on it, in the firmware's order. */
  *all() {
    yield this;
    for (const outlet of [...this.children.keys()].sort((a, b) => a - b)) yield* this.children.get(outlet).all();
  }
}

/** How sensors turn by default: each swings by 60 degrees with its own period. */
export function swing(part) {
  return (sensor, seconds) => {
    const period = 4 + ((part * 3 + sensor) % 5);
    return 2 + part * 0.37 + sensor + 1.05 * Math.sin((2 * Math.PI * seconds) / period);
  };
}

/** Builds a tree for a board from its description: { name, kind, outlets?, labelled?, number?, children: { outlet: {...} } }. */
export function buildTree({ now, fullGain, Multiplexer }, description, motion = swing) {
  let built = 0;
  const build = (entry) => {
    const index = built++;
    const part = new Part(now, {
      ...entry,
      fullGain,
      Multiplexer,
      name: entry.name ?? `part${index}`,
      number: entry.number ?? [0x00, 0x04, 0xa3, 0xff, 0xfe, 0x00, index >> 8, index & 0xff],
      radians: motion(index),
    });
    for (const [outlet, child] of Object.entries(entry.children ?? {})) part.plug(Number(outlet), build(child));
    return part;
  };
  return build(description);
}

const threeAxis = (name, children) => ({ name, kind: "twist-bend-twist", children });
const bend = (name, children) => ({ name, kind: "bend", children });

/** Trees that tests and the guide use. The controller sits in the root. */
export const TREES = {
  /** One joint: the evening's puppet. */
  one: { name: "base", kind: "splitter", outlets: 1, children: { 0: bend("knee") } },
  /** Seven joints of an upper body, the weekend's puppet. */
  seven: {
    name: "chest",
    kind: "splitter",
    children: {
      0: threeAxis("left_shoulder", { 0: bend("left_elbow", { 0: bend("left_wrist") }) }),
      1: threeAxis("neck"),
      2: threeAxis("right_shoulder", { 0: bend("right_elbow", { 0: bend("right_wrist") }) }),
    },
  },
  /** Seven three-axis joints: 21 sensors. */
  "seven-three-axis": {
    name: "chest",
    kind: "splitter",
    children: {
      0: threeAxis("left_shoulder", { 0: threeAxis("left_elbow", { 0: threeAxis("left_wrist") }) }),
      1: threeAxis("neck"),
      2: threeAxis("right_shoulder", { 0: threeAxis("right_elbow", { 0: threeAxis("right_wrist") }) }),
    },
  },
  /** Sixteen three-axis joints, the most a Nano supports. */
  sixteen: {
    name: "chest",
    kind: "splitter",
    children: Object.fromEntries([0, 1, 2, 3].map((i) => [i, arm(`arm${i}`)])),
  },
  /** A human of 19 joints: 57 sensors. Arms and head are on the first bus, spine and legs on the second. */
  human: {
    name: "chest",
    kind: "splitter",
    children: {
      0: arm("left"),
      1: threeAxis("neck", { 0: threeAxis("head") }),
      2: arm("right"),
      3: threeAxis("spine", {
        0: { name: "pelvis", kind: "splitter", outlets: 2, children: { 0: leg("left"), 1: leg("right") } },
      }),
    },
  },
};

function arm(side) {
  const wrist = threeAxis(`${side}_wrist`);
  return threeAxis(`${side}_collar`, {
    0: threeAxis(`${side}_shoulder`, { 0: threeAxis(`${side}_elbow`, { 0: wrist }) }),
  });
}

function leg(side) {
  const ankle = threeAxis(`${side}_ankle`, { 0: threeAxis(`${side}_toes`) });
  return threeAxis(`${side}_hip`, { 0: threeAxis(`${side}_knee`, { 0: ankle }) });
}
