// The firmware of a Raspberry Pi Pico, in the file that is copied to the board, on an emulated RP2040 with emulated
// chips on both buses. Emulating one second takes about eight: the faults run shorter here than on the Nano, and only
// those that involve the board's own bus code.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { Bench } from "./bench.mjs";
import { Pca9848 } from "./chips.mjs";
import { FAULTS } from "./faults.mjs";
import { parseUf2, Pico } from "./pico.mjs";
import { requests } from "./protocol.mjs";
import { assertGuideSays, assertKeepsItsRate, streaming, testBoard } from "./suite.mjs";

const FIRMWARE = process.env.ARMATURE_PICO;
const OF_THE_BUS = /pulled out|lost contact|holds SDA|SDA of a sensor|SCL of a sensor|crushed|floods|stretches|hangs/;

const faults = process.env.ARMATURE_LONG ? FAULTS : FAULTS.filter((fault) => OF_THE_BUS.test(fault.name));
testBoard("Pico", () => new Pico(FIRMWARE), { faults, millis: process.env.ARMATURE_LONG ? 1000 : 700 });

test("Pico: 57 sensors of a human at 150 Hz and more, without a gap", () => {
  const hertz = assertKeepsItsRate(new Pico(FIRMWARE), "human", 300);
  assert.ok(hertz >= 150, `${hertz} Hz`);
  assertGuideSays(/\| Pico, human: .* \| ([\d,]+) Hz \|/, hertz);
});

const FAST = `${process.env.ARMATURE_FIRMWARES}/pico-fast.uf2`;

test("Pico: the same at 250 Hz and more with multiplexers for 1 MHz", () => {
  const hertz = assertKeepsItsRate(new Pico(FAST, { Multiplexer: Pca9848 }), "human", 300);
  assert.ok(hertz >= 250, `${hertz} Hz`);
  assertGuideSays(/\| the same with PCA9848 .* \| ([\d,]+) Hz \|/, hertz);
});

test("Pico: multiplexers that are too slow for that do not answer, and ours are labelled and lit at 400 kHz", () => {
  const slow = new Bench(new Pico(FAST), "seven");
  slow.run(300);
  slow.hello = slow.ask(requests.hello(), "hello");
  assert.equal(slow.topology().parts?.length ?? 0, 0);
  const bench = streaming(new Pico(FAST, { Multiplexer: Pca9848 }), "seven", 100);
  const { light, uid } = bench.part("left_elbow");
  assert.equal(bench.ask(requests.blink(Buffer.from(uid).toString("hex"), 100), "acknowledge").request, 7);
  assert.ok(light.lit);
  const [sample] = bench.samples(50).slice(-1);
  assert.ok(bench.readings(sample).every((reading) => bench.isTrue(reading, sample)));
});

test("Pico: a host on USB gets the same puppet", () => {
  const bench = streaming(new Pico(FIRMWARE, { line: "usb" }), "seven", 200);
  const samples = bench.samples(200);
  assert.ok(samples.length >= 39, `${samples.length} samples`);
  assert.equal(bench.decoder.damaged, 0);
  for (const reading of bench.readings(samples.at(-1))) assert.ok(bench.isTrue(reading, samples.at(-1)));
});

test("Pico: a file with a damaged boot stage or for another chip is refused", () => {
  const file = readFileSync(FIRMWARE);
  parseUf2(file);
  const damaged = Buffer.from(file);
  damaged[40] ^= 1;
  assert.throws(() => parseUf2(damaged), /second boot stage/);
  const foreign = Buffer.from(file);
  foreign.writeUInt32LE(0xada52840, 28);
  assert.throws(() => parseUf2(foreign), /another chip/);
});
