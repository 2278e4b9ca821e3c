// What can go wrong on a bus whose parts anyone can plug together, and what it does to a streaming puppet: each fault
// is injected while a seven-joint puppet streams at 100 Hz, and then removed.
import { requests } from "./protocol.mjs";

/** `put` and `heal` receive the bench. `hit` names the affected parts, including everything that hangs on them; `pulled`: plugged
 * in again, it must be there at once; `slowly`: a sensor's gain is read once per so many samples, so it takes a while until it is
 * known to be well again. */
export const FAULTS = [
  {
    name: "a magnet is missing",
    hit: ["left_elbow"],
    put: (b) => (b.part("left_elbow").sensors[0].magnet.detected = false),
    heal: (b) => (b.part("left_elbow").sensors[0].magnet.detected = true),
  },
  {
    name: "a magnet is too far away",
    slowly: true,
    hit: ["left_elbow"],
    put: (b) => Object.assign(b.part("left_elbow").sensors[0].magnet, { weak: true, gain: b.board.fullGain }),
    heal: (b) => Object.assign(b.part("left_elbow").sensors[0].magnet, { weak: false, gain: b.board.fullGain / 2 }),
  },
  {
    name: "a magnet is nearly too far away",
    slowly: true,
    hit: ["left_elbow"],
    put: (b) => (b.part("left_elbow").sensors[0].magnet.gain = b.board.fullGain - 4),
    heal: (b) => (b.part("left_elbow").sensors[0].magnet.gain = b.board.fullGain / 2),
  },
  {
    name: "a sensor stops answering",
    hit: ["right_shoulder"],
    only: [1],
    put: (b) => b.part("right_shoulder").multiplexer.channels[1].chips.clear(),
    heal: (b) => b.part("right_shoulder").multiplexer.channels[1].chips.add(b.part("right_shoulder").sensors[1]),
  },
  {
    name: "a part is pulled out and plugged in again",
    hit: ["left_elbow", "left_wrist"],
    leaves: true,
    pulled: true,
    put: (b) => (b.pulled = b.part("left_shoulder").unplug(0)),
    heal: (b) => b.part("left_shoulder").plug(0, b.pulled),
  },
  {
    name: "a part is pulled out in the middle of a byte",
    hit: ["neck"],
    leaves: true,
    pulled: true,
    put: (b) => {
      b.whenAddressed(b.part("neck").sensors[1], () => (b.pulled = b.root.unplug(1)));
    },
    heal: (b) => b.root.plug(1, b.pulled),
  },
  {
    name: "a plug has lost contact for a moment",
    hit: ["right_elbow", "right_wrist"],
    put: (b) => {
      const part = b.part("right_shoulder").unplug(0);
      b.run(20);
      b.part("right_shoulder").plug(0, part);
    },
    heal: () => {},
  },
  {
    name: "a chip was interrupted in a byte and holds SDA until it is clocked",
    hit: ["left_wrist"],
    put: (b) => (b.part("left_wrist").sensors[0].clocksToRelease = 5),
    heal: () => {},
  },
  {
    name: "a chip stretches the clock by 50 µs a byte",
    hit: [],
    put: (b) => (b.part("neck").sensors[1].stretchMicros = 50),
    heal: (b) => (b.part("neck").sensors[1].stretchMicros = 0),
  },
  {
    name: "a chip hangs in a byte and holds SCL",
    hit: ["neck"],
    only: [1],
    put: (b) => (b.part("neck").sensors[1].stretchMicros = Infinity),
    heal: (b) => Object.assign(b.part("neck").sensors[1], { stretchMicros: 0, hangs: false }),
  },
  {
    name: "SDA of a sensor is shorted",
    hit: ["neck"],
    only: [2],
    put: (b) => (b.part("neck").multiplexer.channels[2].held.sda = true),
    heal: (b) => (b.part("neck").multiplexer.channels[2].held.sda = false),
  },
  {
    name: "SCL of a sensor is shorted",
    hit: ["neck"],
    only: [0],
    put: (b) => (b.part("neck").multiplexer.channels[0].held.scl = true),
    heal: (b) => (b.part("neck").multiplexer.channels[0].held.scl = false),
  },
  {
    name: "a cable is crushed: SDA of an outlet is shorted",
    hit: ["left_elbow", "left_wrist"],
    leaves: true,
    put: (b) => (b.part("left_shoulder").outletSegment(0).held.sda = true),
    heal: (b) => (b.part("left_shoulder").outletSegment(0).held.sda = false),
  },
  {
    name: "a part's supply dips: its multiplexer forgets its open channels",
    hit: ["right_shoulder", "right_elbow", "right_wrist"],
    put: (b) => b.part("right_shoulder").powerUp(),
    heal: () => {},
  },
  {
    name: "the host floods the line with noise",
    hit: [],
    put: (b) => b.board.send(noise(2000)),
    heal: () => {},
  },
  {
    name: "the host asks for what does not exist",
    hit: [],
    put: (b) => {
      b.board.send(requests.blink("ff".repeat(12), 100));
      b.board.send(requests.label("ff".repeat(12), 1, 1, 1, 4096));
      b.board.send(requests.rate(1e6));
      b.board.send(requests.rate(100));
    },
    heal: () => {},
  },
];

/** Long enough to read the gain of every sensor of a seven-joint puppet at 100 Hz: 13 of them, each 16 samples. */
const GAIN_MILLIS = 2300;

/** Bytes that are not frames. */
function noise(count) {
  let state = 1;
  return Uint8Array.from({ length: count }, () => {
    state = (Math.imul(state, 1103515245) + 12345) >>> 0;
    return state >>> 24;
  });
}

/** Injects a fault, removes it, and returns what the samples showed. */
export function observe(bench, fault, { millis = 1000 } = {}) {
  bench.run(100);
  const from = bench.messages.length;
  const began = bench.board.now();
  fault.put(bench);
  bench.run(millis);
  const healed = bench.board.now();
  fault.heal(bench);
  bench.run(fault.slowly ? Math.max(millis, GAIN_MILLIS) : millis);
  const messages = bench.messages.slice(from);
  const samples = messages.filter((message) => message.type === "sample");
  const seen = { began, healed, samples, messages, states: new Set(), others: [], disturbed: 0, left: null, back: null };
  const about = ({ part, sensor }) => fault.hit.includes(part.name) && (!fault.only || fault.only.includes(sensor));
  for (const sample of samples) {
    const readings = bench.readings(sample);
    const own = readings.filter(about);
    own.forEach((reading) => seen.states.add(reading.state));
    const whole = own.every((reading) => bench.isTrue(reading, sample)) && own.length === sensorsHit(bench, fault);
    if (!whole) seen.disturbed += 1;
    if (own.length < sensorsHit(bench, fault)) seen.left ??= sample.micros - began;
    if (sample.micros > healed && whole) seen.back ??= sample.micros - healed;
    for (const reading of readings.filter((reading) => !about(reading))) {
      if (!bench.isTrue(reading, sample)) {
        const { part, sensor, count, state } = reading;
        seen.others.push({ sample: sample.sequence, part: part.name, sensor, count, state });
      }
    }
    const expected = [...bench.known].filter((part) => !fault.hit.includes(part.name)).flatMap((part) => part.sensors).length;
    const rest = readings.filter((reading) => !fault.hit.includes(reading.part.name)).length;
    if (rest !== expected) seen.others.push({ sample: sample.sequence, missing: expected - rest });
  }
  seen.lost = samples.at(-1).sequence - samples[0].sequence - (samples.length - 1);
  seen.epochs = messages.filter((message) => message.type === "topologyChanged").length;
  return seen;
}

function sensorsHit(bench, fault) {
  const parts = [...bench.known].filter((part) => fault.hit.includes(part.name));
  return parts.reduce((sum, part) => sum + (fault.only ? fault.only.length : part.sensors.length), 0);
}
