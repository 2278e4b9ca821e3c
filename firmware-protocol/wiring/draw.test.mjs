// The diagrams in this folder are those of their descriptions, and the descriptions say what firmware and guide say.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { descriptions, draw, netlist, parseWires } from "./draw.mjs";

const GUIDE = readFileSync(new URL("../BUILD_YOUR_OWN_PUPPET.md", import.meta.url), "utf8");
const described = (name) => descriptions().find((description) => description.name === `${name}.wires`).text;
const nets = (name) => netlist(parseWires(described(name)));

test("each diagram is the one of its description, and the guide shows it", () => {
  for (const { name, text, drawing } of descriptions()) {
    assert.equal(readFileSync(drawing, "utf8"), draw(text), `${name}: node firmware-protocol/wiring/draw.mjs draws it again`);
    assert.ok(GUIDE.includes(`(wiring/${name.replace(/wires$/, "svg")})`), `the guide does not show ${name}`);
  }
});

test("no line of one net lies on a line of another", () => {
  for (const { name, text } of descriptions()) {
    const across = [];
    for (const [, path, colour] of draw(text).matchAll(/<path d="([^"]*)" stroke="(#\w+)" stroke-width="2" fill="none"/g)) {
      for (const [, x, y, to] of path.matchAll(/M([\d.]+) ([\d.]+)H([\d.]+)/g)) {
        across.push({ path, colour, y, from: Math.min(x, to), to: Math.max(x, to) });
      }
    }
    for (const one of across) {
      for (const other of across) {
        const meet = one.path !== other.path && one.y === other.y && one.from < other.to && other.from < one.to;
        assert.ok(!meet, `${name}: ${one.colour} lies on ${other.colour} at a height of ${one.y}`);
      }
    }
  }
});

test("along any way outwards the seven levels have seven addresses", () => {
  const net = nets("part");
  const inlet = { L0: net("inlet.3"), L1: net("inlet.5"), L2: net("inlet.7") };
  assert.deepEqual([net("mux.A0"), net("mux.A1"), net("mux.A2")], [inlet.L0, inlet.L1, inlet.L2]);
  const outlets = (levels) => {
    const driven = new Map([[inlet.L0, levels & 1], [inlet.L1, (levels >> 1) & 1], [inlet.L2, levels >> 2]]);
    driven.set(net("gate.Y"), driven.get(net("gate.A")) ^ driven.get(net("gate.B")));
    return driven.get(net("next.3")) | (driven.get(net("next.5")) << 1) | (driven.get(net("next.7")) << 2);
  };
  const way = [1];
  while (way.length < 7) way.push(outlets(way.at(-1)));
  assert.deepEqual(way, [1, 2, 4, 3, 6, 7, 5], "as reference-firmware/tree_bus.c counts");
});

test("a plug has the same lines at an inlet and at an outlet", () => {
  const { parts } = parseWires(described("part"));
  const pins = (name) => [...parts.get(name).left, ...parts.get(name).right].map(({ words }) => words).sort();
  assert.deepEqual(pins("inlet"), pins("next"));
  assert.equal(pins("inlet").length, 8);
  const table = GUIDE.match(/\| pin \|(.*)\|\n\|[-|]*\n\| line \|(.*)\|/);
  const [numbers, lines] = [table[1], table[2]].map((row) => row.split("|").map((cell) => cell.trim()));
  assert.deepEqual(numbers.map((number, i) => `${number} ${lines[i]}`).sort(), pins("inlet"));
});

test("the root is wired to the pins that guide and firmware name", () => {
  const rows = Object.fromEntries([...GUIDE.matchAll(/^\| (SDA, SCL|RESET) \| (.*) \| (.*) \|$/gm)].map(([, what, nano, pico]) => [what, { nano, pico }]));
  const nano = nets("nano-root");
  const [sda, scl] = rows["SDA, SCL"].nano.split(", ");
  assert.deepEqual([nano(`nano.${sda}`), nano(`nano.${scl}`), nano(`nano.${rows.RESET.nano}`)], [nano("root.2"), nano("root.4"), nano("root.6")]);
  assert.ok(nano("root.3") === nano("root.1") && nano("root.5") === nano("root.8") && nano("root.7") === nano("root.8"), "level 1");
  const pico = nets("pico-root");
  const buses = rows["SDA, SCL"].pico.match(/GP\d+/g);
  const resets = rows.RESET.pico.match(/GP\d+/g);
  ["one", "two"].forEach((multiplexer, bus) => {
    assert.deepEqual(
      [pico(`pico.${buses[2 * bus]}`), pico(`pico.${buses[2 * bus + 1]}`), pico(`pico.${resets[bus]}`)],
      [pico(`${multiplexer}.SDA`), pico(`${multiplexer}.SCL`), pico(`${multiplexer}.RESET`)],
    );
    assert.ok(pico(`${multiplexer}.A0`) === pico("pico.3V3") && pico(`${multiplexer}.A1`) === pico("pico.GND"), "level 1");
  });
  ["zero", "first", "second", "third", "fourth"].forEach((outlet, i) => {
    const multiplexer = i < 3 ? "one" : "two";
    assert.deepEqual([pico(`${outlet}.2`), pico(`${outlet}.4`)], [pico(`${multiplexer}.SD${3 + i}`), pico(`${multiplexer}.SC${3 + i}`)]);
  });
});

test("a description that is wrong is named by its line", () => {
  const wrong = {
    "colum": /line 1: this word is not known/,
    "part a: A": /line 1: a part stands in a column/,
    "column\npart a: A\nright x\nwire blue: a.x b.y": /line 4: there is no pin b\.y/,
    "column\npart a: A\nleft x\nright y\nwire blue: a.x a.y": /line 5: these pins do not face the same gap/,
    "column\npart a: A\nright x\ncolumn\npart b: B\nleft y\nwire golden: a.x b.y": /line 7: one of these colours/,
  };
  for (const [text, what] of Object.entries(wrong)) assert.throws(() => draw(text), what);
});
