// What every board's firmware must do, in tests that are the same for all. `make(options)` gives a board at power-up.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { Bench } from "./bench.mjs";
import { FAULTS, observe } from "./faults.mjs";
import { KINDS } from "./parts.mjs";
import { requests } from "./protocol.mjs";

export function streaming(board, tree, hertz) {
  const bench = new Bench(board, tree);
  bench.run(200);
  bench.stream(hertz);
  return bench;
}

export function lost(samples) {
  return samples.at(-1).sequence - samples[0].sequence - (samples.length - 1);
}

/** Streams as fast as the board grants, and checks that it keeps that rate. Returns the rate. */
export function assertKeepsItsRate(board, tree, millis = 1000) {
  const bench = streaming(board, tree, 1000);
  const samples = bench.samples(millis);
  const seconds = (samples.at(-1).micros - samples[0].micros) * 1e-6;
  const hertz = (samples.length - 1) / seconds;
  assert.equal(lost(samples), 0, "the granted rate must be kept");
  assert.ok(Math.abs(hertz - bench.rate) < 0.02 * bench.rate, `${hertz} Hz, but ${bench.rate} were granted`);
  const waits = Math.max(...samples.map((sample) => sample.firstAt - sample.readAt));
  assert.ok(waits > 0 && waits <= 1e6 / bench.rate, `the first byte comes ${waits} us after the last reading`);
  const sensors = samples.at(-1).counts.length;
  const latest = Math.max(...samples.map((sample) => sample.at - sample.micros));
  console.log(`${sensors} sensors: ${bench.rate.toFixed(1)} Hz; first byte of a sample ${(waits / 1000).toFixed(1)} ms after its last reading, last byte ${(latest / 1000).toFixed(1)} ms after its time`);
  return bench.rate;
}

const GUIDE = readFileSync(new URL("../BUILD_YOUR_OWN_PUPPET.md", import.meta.url), "utf8");

/** The guide states this rate, rounded down. */
export function assertGuideSays(pattern, hertz) {
  const [, stated] = GUIDE.match(pattern) ?? [];
  assert.equal(stated?.replace(",", ""), String(Math.floor(hertz)), `the guide's rate in ${pattern}`);
}

const pick = ({ request, reason }) => ({ request, reason });

export function testBoard(name, make, { faults = FAULTS, millis = 1000, shortSeconds = 10 } = {}) {
  test(`${name}: the tree is found and described as plugged in`, () => {
    const bench = new Bench(make(), "seven");
    bench.run(100);
    const { parts } = bench.topology();
    const plugged = [...bench.root.all()];
    assert.equal(parts.length, 8);
    parts.forEach((record, i) => {
      const part = plugged[i];
      assert.equal(record.uid, Buffer.from(part.uid).toString("hex"));
      assert.deepEqual([record.kind, record.sensors], [KINDS[part.kind].code, KINDS[part.kind].sensors], part.name);
      assert.equal(record.parent, part.parent ? plugged.indexOf(part.parent) : 0xffff, part.name);
      assert.ok(!part.parent || part.parent.children.get(record.outlet) === part, part.name);
    });
  });

  test(`${name}: angles are those of the sensors, to one count`, () => {
    const bench = streaming(make(), "seven", 100);
    const samples = bench.samples(1000);
    assert.ok(samples.length >= 99, `${samples.length} samples`);
    for (const sample of samples) {
      const readings = bench.readings(sample);
      assert.equal(readings.length, 13);
      for (const reading of readings) {
        assert.ok(bench.isTrue(reading, sample), `${reading.part.name} ${reading.sensor}: ${reading.count} in sample ${sample.sequence}`);
      }
    }
  });

  test(`${name}: a pong says when the ping arrived, not when the firmware got round to it`, () => {
    const bench = streaming(make(), "seven", 100);
    const offsets = [];
    for (let i = 0; i < 20; i++) {
      const frame = requests.ping();
      const arrives = bench.board.now() + frame.length * 10;
      offsets.push(bench.ask(frame, "pong").received - arrives);
      bench.run(7.3);
    }
    const spread = Math.max(...offsets) - Math.min(...offsets);
    assert.ok(spread <= 30, `the times for one moment are ${spread} us apart`);
  });

  test(`${name}: a part can show itself, and a part that does not exist is refused`, () => {
    const bench = streaming(make(), "seven", 100);
    const { light, uid } = bench.part("left_elbow");
    const number = Buffer.from(uid).toString("hex");
    assert.equal(bench.ask(requests.blink(number, 100), "acknowledge").request, 0x07);
    assert.ok(light.lit);
    bench.run(150);
    assert.ok(!light.lit, "it must end by itself");
    assert.deepEqual(pick(bench.ask(requests.blink("00".repeat(12), 100), "refuse")), { request: 7, reason: 4 });
  });

  test(`${name}: a blank part is found and labelled, and keeps its label`, () => {
    const tree = {
      name: "base", kind: "splitter",
      children: { 0: { name: "new", kind: "twist-bend-twist", labelled: false, children: { 0: { name: "behind", kind: "bend" } } } },
    };
    const bench = new Bench(make(), tree);
    bench.run(200);
    const blank = bench.topology().parts[1];
    assert.deepEqual([blank.kind, blank.sensors, blank.outlets], [0, 3, 1], "its sensors are counted, its kind is unknown");
    assert.deepEqual(pick(bench.ask(requests.label(blank.uid, 3, 4, 1, 4096), "refuse")), { request: 8, reason: 2 });
    assert.equal(bench.ask(requests.label(blank.uid, 3, 3, 1, 4096), "acknowledge").request, 0x08);
    assert.deepEqual(bench.topology().parts.map((part) => part.kind), [4, 3, 1]);
    bench.board.powerUp();
    bench.run(200);
    assert.deepEqual(bench.topology().parts.map((part) => part.kind), [4, 3, 1], "after power was lost");
    noteRow(name, "a part's memory is blank, or its label damaged", "a part of kind 0, with the sensors that answer", [
      "it works, but nobody knows which way it turns: `armature puppet label`",
      "—",
    ]);
  });

  for (const fault of faults) {
    test(`${name}: fault: ${fault.name}`, () => {
      const bench = streaming(make(), "seven", 100);
      const seen = observe(bench, fault, { millis });
      assert.deepEqual(seen.others.slice(0, 3), [], "all other sensors' samples must be complete");
      assert.equal(seen.lost, 0, "no sample may be skipped");
      assert.ok(fault.hit.length === 0 || seen.back !== null, "it must come back by itself");
      noteFault(name, fault, seen);
      if (fault.leaves) {
        assert.ok(seen.left !== null && seen.left <= 200e3, `gone after ${seen.left} us`);
        const soon = fault.pulled ? 200e3 : 700e3;
        assert.ok(seen.back <= soon, `back after ${seen.back} us`);
      } else {
        assert.equal(seen.left, null, "it must stay in the tree");
      }
    });
  }

  test(`${name}: the controller loses its power and comes back while it streams`, () => {
    const bench = streaming(make(), "seven", 100);
    bench.run(50);
    bench.board.powerUp();
    const began = bench.board.now();
    const hello = bench.runUntil("hello");
    assert.equal(hello.uid, bench.hello.uid);
    bench.stream(100);
    const samples = bench.samples(100);
    assert.ok(samples[0].micros < 300e3 && samples[0].sequence < 5, "clock and numbers must start over");
    const [last] = samples.slice(-1);
    const onTheOldClock = { ...last, micros: last.micros + began };
    assert.ok(bench.readings(last).every((reading) => bench.isTrue(reading, onTheOldClock)));
    noteRow(name, "the controller loses its power for a moment", "a hello that nobody asked for; clock and numbers begin again", [
      "`armature run` counts a restart and goes on; the take has a gap",
      `hello within ${roundUp(hello.at - began)} ms`,
    ]);
  });

  test(`${name}: a host that vanishes in the middle of a request does not matter to the next one`, () => {
    const bench = streaming(make(), "seven", 100);
    bench.board.send(requests.rate(20).slice(0, 7));
    const alone = bench.samples(300);
    assert.ok(alone.length >= 29 && lost(alone) === 0, "it streams on");
    // As every session does, the next one begins with a delimiter, which ends whatever came before.
    bench.board.send(Uint8Array.of(0));
    bench.stream(50);
    assert.equal(bench.rate, 50);
    const samples = bench.samples(200);
    assert.ok(samples.length >= 9 && lost(samples) === 0, `${samples.length} samples`);
    noteRow(name, "the host vanishes in the middle of a request", "nothing", [
      "the next program that connects gets the puppet at once",
      "—",
    ]);
  });

  test(`${name}: two parts with one number are distinguished, and nothing else is affected`, () => {
    const number = [0, 4, 0xa3, 0xff, 0xfe, 9, 9, 9];
    const tree = {
      name: "base", kind: "splitter",
      children: { 0: { name: "one", kind: "bend", number }, 1: { name: "other", kind: "twist", number }, 2: { name: "third", kind: "bend" } },
    };
    const bench = streaming(make(), tree, 100);
    const numbers = bench.topology().parts.map((part) => part.uid);
    assert.equal(new Set(numbers).size, 4, "no number may occur twice");
    assert.deepEqual([numbers[1], numbers[2]], ["455549000004a3fffe090909", "455549010004a3fffe090909"]);
    const [sample] = bench.samples(30).slice(-1);
    ["one", "other", "third"].forEach((part, i) => {
      const reading = { part: bench.part(part), sensor: 0, count: sample.counts[i], state: sample.states[i] };
      assert.ok(bench.isTrue(reading, sample), part);
    });
    noteRow(name, "two parts have one number (a copied memory)", "the second one goes by `45554901…` in place of `45554900…`", [
      "both work; which of them has which calibration depends on where they are plugged in",
      "—",
    ]);
  });

  test(`${name}: damaged bytes on the line cost the frames they hit`, () => {
    const bench = streaming(make(), "seven", 100);
    const { onByte } = bench.board;
    let sent = 0;
    bench.board.onByte = (byte, micros) => onByte(++sent % 997 === 0 ? byte ^ 4 : byte, micros);
    const samples = bench.samples(1000);
    assert.ok(bench.decoder.damaged >= 3, `${bench.decoder.damaged} damaged pieces`);
    const missing = lost(samples);
    assert.ok(missing > 0 && missing <= 2 * bench.decoder.damaged, `${missing} samples lost`);
    for (const sample of samples) assert.ok(bench.readings(sample).every((reading) => bench.isTrue(reading, sample)));
    noteRow(name, "bytes are damaged on the way to the host", "the samples they hit are missing, and counted", [
      "the character waits for the next sample; `armature run` counts losses and checksums",
      "with the next frame",
    ]);
  });

  const seconds = process.env.ARMATURE_LONG ? 600 : shortSeconds;
  test(`${name}: ${seconds} s of faults at random times`, () => {
    const bench = streaming(make(), "seven", 100);
    const random = randomNumbers(7);
    const end = bench.board.now() + seconds * 1e6;
    let rounds = 0;
    while (bench.board.now() < end) {
      const fault = FAULTS[Math.floor(random() * FAULTS.length)];
      bench.run(random() * 20);
      const seen = observe(bench, fault, { millis: 700 });
      rounds += 1;
      const where = `round ${rounds}: ${fault.name}`;
      assert.deepEqual(seen.others.slice(0, 3), [], where);
      assert.equal(seen.lost, 0, where);
      assert.ok(fault.hit.length === 0 || seen.back !== null, where);
      bench.messages.length = 0;
    }
    console.log(`${name}: ${rounds} faults in ${seconds} s, every other sensor's samples complete`);
  });
}

/** What each board showed for each fault, in words; the guide has this as a table. */
export const faultRows = new Map();

const roundUp = (micros) => Math.ceil(micros / 50_000) * 50;

function noteRow(board, fault, stream, [user, back]) {
  if (!faultRows.has(board)) faultRows.set(board, []);
  faultRows.get(board).push(`| ${fault} | ${stream} | ${user} | ${back} |`);
}

function noteFault(board, fault, seen) {
  const lasts = seen.disturbed > 10;
  const state = seen.states.has(2) ? "magnet weak" : lasts ? "no data" : `no data for ${seen.disturbed > 1 ? "a few samples" : "one sample"}`;
  const held = "the joint holds its last angle, grey in the window";
  const words = seen.left
    ? [`no data, then gone from the tree within ${roundUp(seen.left)} ms`, `${held}; then its bones have no joint until it is back, and go on without a jump`]
    : seen.disturbed === 0
      ? ["nothing", "nothing"]
      : [state, seen.states.has(2) ? "the joint works on, amber in the window" : held];
  const back = fault.hit.length === 0 || seen.disturbed === 0 ? "—" : lasts ? `within ${roundUp(seen.back)} ms` : "at once";
  noteRow(board, fault.name, words[0], [words[1], back]);
}

/** The same numbers for the same seed, from 0 to 1 (mulberry32). */
function randomNumbers(state) {
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let mixed = Math.imul(state ^ (state >>> 15), 1 | state);
    mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), 61 | mixed)) ^ mixed;
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32;
  };
}
