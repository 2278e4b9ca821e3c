// The wire contract (../src/lib.rs) as far as these tests need it, written from its documentation.

export const TYPES = {
  helloRequest: 0x01, topologyRequest: 0x02, setRate: 0x03, start: 0x04, stop: 0x05, ping: 0x06, blink: 0x07, label: 0x08,
  hello: 0x81, topology: 0x82, topologyChanged: 0x83, sample: 0x84, rateSet: 0x85, acknowledge: 0x86, pong: 0x87,
  refuse: 0x88,
};
const NAMES = Object.fromEntries(Object.entries(TYPES).map(([name, code]) => [code, name]));

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  for (let bit = 0; bit < 8; bit++) byte = byte & 1 ? (byte >>> 1) ^ 0xedb88320 : byte >>> 1;
  return byte;
});

function crc32(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) crc = (crc >>> 8) ^ CRC_TABLE[(crc ^ byte) & 0xff];
  return ~crc >>> 0;
}

const sevenBits = (value, bytes) => Array.from({ length: bytes }, (_, i) => 0x80 | (Math.floor(value / 2 ** (7 * i)) & 0x7f));

/** A frame: type, and the payload's bytes. */
export function frame(type, payload = []) {
  const plain = [type, ...payload];
  const stuffed = [];
  let run = [];
  for (const byte of plain) {
    if (byte !== 0) run.push(byte);
    if (byte === 0 || run.length === 254) {
      stuffed.push(run.length + 1, ...run);
      run = byte === 0 ? [] : null;
    }
    run ??= [];
  }
  stuffed.push(run.length + 1, ...run);
  const head = [...sevenBits(stuffed.length, 2), ...stuffed, ...sevenBits(stuffed.length, 2)];
  return Uint8Array.from([...head, ...sevenBits(crc32(head), 5), 0]);
}

function unframe(piece) {
  const length = piece.length - 9;
  const bounds = sevenBits(length, 2);
  const sum = sevenBits(crc32(piece.slice(0, -5)), 5);
  const whole = length >= 2 && [0, 1].every((i) => piece[i] === bounds[i] && piece[2 + length + i] === bounds[i]);
  if (!whole || sum.some((byte, i) => byte !== piece[piece.length - 5 + i])) return null;
  const plain = [];
  for (let at = 2; at < 2 + length; ) {
    const run = piece[at];
    plain.push(...piece.slice(at + 1, at + run));
    at += run;
    if (run !== 255 && at < 2 + length) plain.push(0);
  }
  return Uint8Array.from(plain);
}

function parse(plain) {
  const view = new DataView(plain.buffer);
  const u16 = (at) => view.getUint16(1 + at, true);
  const u32 = (at) => view.getUint32(1 + at, true);
  const u64 = (at) => Number(view.getBigUint64(1 + at, true));
  const u8 = (at) => plain[1 + at];
  const uid = (at) => Buffer.from(plain.slice(1 + at, 13 + at)).toString("hex");
  const type = NAMES[plain[0]];
  switch (type) {
    case "hello":
      return { type, features: u32(2), uid: uid(9), maxRate: u32(21), name: Buffer.from(plain.slice(27)).toString() };
    case "topology": {
      const record = (i) => {
        const at = 8 + i * u8(7);
        return {
          kind: u8(at), sensors: u8(at + 1), outlet: u8(at + 2), outlets: u8(at + 3), parent: u16(at + 4), uid: uid(at + 6),
          counts: u32(at + 18),
        };
      };
      return { type, epoch: u16(0), parts: u16(2), first: u16(4), records: Array.from({ length: u8(6) }, (_, i) => record(i)) };
    }
    case "topologyChanged":
      return { type, epoch: u16(0) };
    case "sample": {
      const n = u16(14);
      const counts = Array.from({ length: n }, (_, i) => u16(16 + 2 * i));
      const states = Array.from({ length: n }, (_, i) => (u8(16 + 2 * n + (i >> 2)) >> (2 * (i & 3))) & 3);
      return { type, micros: u64(0), sequence: u32(8), epoch: u16(12), counts, states };
    }
    case "rateSet":
      return { type, rate: u32(0) };
    case "acknowledge":
      return { type, request: u8(0) };
    case "refuse":
      return { type, request: u8(0), reason: u8(1) };
    case "pong":
      return { type, received: u64(8), sent: u64(16) };
    default:
      return { type: "unknown", code: plain[0] };
  }
}

/** Collects bytes and returns messages. */
export class Decoder {
  piece = [];
  damaged = 0;

  /** The message that this byte completes, or null. */
  take(byte) {
    if (byte !== 0) {
      this.piece.push(byte);
      return null;
    }
    const piece = this.piece;
    this.piece = [];
    if (piece.length === 0) return null;
    const plain = unframe(piece);
    if (plain === null) this.damaged += 1;
    return plain && parse(plain);
  }
}

const u32 = (value) => [0, 8, 16, 24].map((shift) => (value >>> shift) & 0xff);
const hex = (uid) => [...Buffer.from(uid, "hex")];

export const requests = {
  hello: () => frame(TYPES.helloRequest, [1, 0, ...u32(3)]),
  topology: () => frame(TYPES.topologyRequest),
  rate: (hertz) => frame(TYPES.setRate, u32(Math.round(hertz * 1000))),
  start: () => frame(TYPES.start),
  stop: () => frame(TYPES.stop),
  ping: () => frame(TYPES.ping, [1, 2, 3, 4, 5, 6, 7, 8]),
  blink: (uid, millis) => frame(TYPES.blink, [...hex(uid), millis & 0xff, millis >> 8]),
  label: (uid, kind, sensors, outlets, counts) => frame(TYPES.label, [...hex(uid), kind, sensors, outlets, ...u32(counts)]),
};
