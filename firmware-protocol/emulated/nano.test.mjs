// The firmware of an Arduino Nano, in the file that is flashed, on an emulated ATmega328P with emulated chips on its
// bus. `firmware-protocol/emulated/run` builds the firmware and runs this.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { test } from "node:test";

import { Nano } from "./nano.mjs";
import { buildTree, TREES } from "./parts.mjs";
import { requests } from "./protocol.mjs";
import { assertGuideSays, assertKeepsItsRate, faultRows, streaming, testBoard } from "./suite.mjs";

const FIRMWARE = process.env.ARMATURE_NANO;
const FLASH_LIMIT = 24 * 1024;
const MEMORY_LIMIT = 1638;

function sections() {
  const said = execFileSync("avr-size", ["-A", FIRMWARE.replace(/hex$/, "elf")], { encoding: "utf8" });
  const size = (name) => Number(said.match(new RegExp(`^\\${name}\\s+(\\d+)`, "m"))?.[1] ?? 0);
  return { flash: size(".text") + size(".data"), variables: size(".data") + size(".bss") };
}

testBoard("Nano", () => new Nano(FIRMWARE));

test("Nano: 21 sensors at 100 Hz and more, without a gap", () => {
  const hertz = assertKeepsItsRate(new Nano(FIRMWARE), "seven-three-axis");
  assert.ok(hertz >= 100, `${hertz} Hz`);
  assertGuideSays(/\| Nano, 7 three-axis joints: 21 sensors .* \| (\d+) Hz: /, hertz);
});

test("Nano: the weekend's puppet of 13 sensors", () => {
  assertGuideSays(/7 joints, 13 sensors, (\d+) Hz on a Nano/, assertKeepsItsRate(new Nano(FIRMWARE), "seven"));
});

test("the guide's arithmetic is right", () => {
  const guide = readFileSync(GUIDE, "utf8");
  const evaluate = (text) => text.split("+").map((term) => term.split("·").reduce((product, factor) => product * Number.parseFloat(factor), 1)).reduce((sum, term) => sum + term, 0);
  const rows = [...guide.matchAll(/\| ([^|]*) \| ([\d· +]+) = (\d+) \| ([\d.]+) ms, (\d+) Hz \|/g)];
  assert.equal(rows.length, 3);
  const parts = (name) => [...buildTree({ now: () => 0, fullGain: 255 }, TREES[name]).all()];
  const sensors = (list) => list.reduce((sum, part) => sum + part.sensors.length, 0);
  for (const [, name, sum, clocks, millis, hertz] of rows) {
    const kilohertz = name.includes("1 MHz") ? 1000 : 400;
    assert.equal(evaluate(sum), Number(clocks), name);
    assert.equal((clocks / kilohertz).toFixed(1), millis, name);
    assert.equal(Math.round((1000 * kilohertz) / clocks), Number(hertz), name);
  }
  // What is counted there: sensors, and joints to which the way has to be opened.
  const seven = parts("seven-three-axis");
  assert.ok(rows[0][2].startsWith(`${sensors(seven)} · 77 + ${seven.length - 1} · 20`), rows[0][2]);
  const [, current, milliamperes] = guide.match(/The human[^:]*: ([^=]*) mA for\s+the Pico = (\d+) mA/);
  assert.equal(Math.round(evaluate(current.replace(/mA/g, ""))), Number(milliamperes));
  const human = parts("human");
  assert.ok(current.startsWith(`${sensors(human)} · 6.5 + ${human.length} · 4`), current);
});

test("Nano: sixteen three-axis joints fit in memory", () => {
  const { flash, variables } = sections();
  assert.ok(flash <= FLASH_LIMIT, `${flash} bytes of flash`);
  const bench = streaming(new Nano(FIRMWARE), "sixteen", 50);
  const samples = bench.samples(500);
  assert.equal(samples.at(-1).counts.length, 48);
  assert.ok(samples.at(-1).states.every((state) => state === 0));
  bench.board.send(requests.blink(bench.hello.uid, 100));
  bench.run(50);
  const used = bench.board.memoryUsed(variables);
  assert.ok(used <= MEMORY_LIMIT, `${used} bytes of memory with the deepest stack`);
  console.log(`${flash} bytes of flash, ${used} of memory with the deepest stack; 48 sensors at ${bench.rate} Hz`);
});

const GUIDE = new URL("../BUILD_YOUR_OWN_PUPPET.md", import.meta.url);
const BEGIN = "<!-- faults: written by emulated/nano.test.mjs -->\n";
const END = "\n<!-- end of faults -->";

/** `ARMATURE_WRITE_GUIDE=1 firmware-protocol/emulated/run` writes it. */
test("the guide's table of faults matches what happened here", () => {
  const table = [
    "| fault | in the stream, and so in the take | what you see | good again after the fault ends |",
    "|---|---|---|---|",
    ...faultRows.get("Nano"),
  ].join("\n");
  const guide = readFileSync(GUIDE, "utf8");
  const [before, rest] = guide.split(BEGIN);
  const [shown, behind] = rest.split(END);
  if (process.env.ARMATURE_WRITE_GUIDE) writeFileSync(GUIDE, before + BEGIN + table + END + behind);
  else assert.equal(shown, table);
});
