// Fixed puppets: sensors on SPI and a potentiometer, on both boards.
import assert from "node:assert/strict";
import { test } from "node:test";

import { boardOf } from "./boards.mjs";
import { fixedPuppet } from "./spi.mjs";
import { assertGuideSays, assertKeepsItsRate, lost, streaming } from "./suite.mjs";

const FOLDER = process.env.ARMATURE_FIRMWARES;
const board = (name) => boardOf(`${FOLDER}/${name}${name.startsWith("nano") ? ".hex" : ".uf2"}`);

/** Every reading of every sample matches its sensor's position. */
function assertAllTrue(bench, samples) {
  for (const sample of samples) {
    for (const reading of bench.readings(sample)) {
      const { part, sensor, count, state } = reading;
      assert.ok(bench.isTrue(reading, sample), `${part.name} ${sensor}: ${count}, state ${state}, in sample ${sample.sequence}`);
    }
  }
}

for (const name of ["nano-mixed", "pico-mixed"]) {
  test(`${name}: AS5047P, MT6701, AS5048A and a potentiometer give the angles of the sensors, to one count`, () => {
    const bench = streaming(board(name), fixedPuppet("mixed"), 100);
    const samples = bench.samples(500);
    assert.ok(samples.length >= 49 && samples[0].counts.length === 6, `${samples.length} samples`);
    assertAllTrue(bench, samples);
  });

  const wrong = { gone: 1, shorted: 1 };
  for (const fault of Object.keys(wrong)) {
    test(`${name}: a sensor that is ${fault} has no data, and nothing else is affected`, () => {
      for (const [victim, device, sensors] of [["a", 1, [1]], ["b", 0, [0]], ["c", 0, [0]]]) {
        const bench = streaming(board(name), fixedPuppet("mixed"), 100);
        bench.part(victim).devices[device][fault] = true;
        const during = bench.samples(200);
        for (const sample of during.slice(1)) {
          for (const reading of bench.readings(sample)) {
            const hit = reading.part.name === victim && sensors.includes(reading.sensor);
            assert.ok(hit ? reading.state === 1 : bench.isTrue(reading, sample), `${reading.part.name} ${reading.sensor}: state ${reading.state}`);
          }
        }
        bench.part(victim).devices[device][fault] = false;
        bench.samples(50);
        assertAllTrue(bench, bench.samples(100));
      }
    });
  }

  test(`${name}: a flipped bit costs one reading`, () => {
    for (const [victim, device] of [["a", 0], ["b", 0], ["c", 0]]) {
      const bench = streaming(board(name), fixedPuppet("mixed"), 100);
      bench.samples(55);
      bench.part(victim).devices[device].flips = 2;
      const bad = bench.samples(300).flatMap((sample) => bench.readings(sample).filter((reading) => !bench.isTrue(reading, sample)));
      assert.ok(bad.length >= 1 && bad.length <= 2, `${victim}: ${bad.length} readings`);
      assert.ok(bad.every((reading) => reading.part.name === victim && reading.state === 1), "and it reports that it has no data");
    }
  });

  test(`${name}: a weak magnet and a sensor that is not ready are reported in the states`, () => {
    const bench = streaming(board(name), fixedPuppet("mixed"), 100);
    for (const victim of ["a", "b", "c"]) Object.assign(bench.part(victim).sensors[0].magnet, { weak: true });
    bench.samples(100);
    const states = () => bench.readings(bench.samples(50).at(-1)).map(({ part, sensor, state }) => `${part.name}${sensor}:${state}`).join(" ");
    assert.equal(states(), "a0:2 a1:0 a2:0 b0:2 c0:2 d0:0");
    for (const victim of ["a", "b", "c"]) Object.assign(bench.part(victim).sensors[0].magnet, { weak: false, ready: false });
    bench.samples(100);
    assert.equal(states(), "a0:1 a1:0 a2:0 b0:1 c0:1 d0:0");
    bench.part("d").sensors[0].broken = true;
    bench.samples(50);
    assert.match(states(), /d0:1/);
  });
}

test("Nano: a potentiometer, the first evening's puppet", () => {
  const bench = streaming(board("nano-one"), fixedPuppet("one"), 100);
  const samples = bench.samples(500);
  assert.equal(lost(samples), 0);
  assertAllTrue(bench, samples);
});

test("Nano: 21 AS5048A on SPI at 200 Hz and more, without a gap", () => {
  const hertz = assertKeepsItsRate(board("nano-seven"), fixedPuppet("seven"));
  assert.ok(hertz >= 200, `${hertz} Hz`);
  assertGuideSays(/\| Nano, 21 AS5048A on SPI .* \| ([\d,]+) Hz \|/, hertz);
});

test("Pico: 57 AS5048A on SPI at 1 kHz, without a gap", () => {
  const hertz = assertKeepsItsRate(board("pico-human"), fixedPuppet("human"), 300);
  assert.ok(hertz >= 1000, `${hertz} Hz`);
  assertGuideSays(/\| Pico, 57 AS5048A on SPI .* \| ([\d,]+) Hz \|/, hertz);
});
