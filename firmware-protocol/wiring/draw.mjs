// Draws a wiring diagram from its description.
//
//   node firmware-protocol/wiring/draw.mjs            draws every *.wires in this folder as an .svg beside it
//
// A description, line by line:
//
//   title TEXT
//   column                            the parts after this line stand below each other, right of the column before
//   part NAME: TITLE                  a box
//   left PIN …     right PIN …        its pins, from above; `_` leaves a row free, and a pin's text may follow it in brackets:
//                                     A0[clock]
//   wire COLOUR: PART.PIN …           joined by a line; each pin on a side that faces the same gap between two columns
//   tag NAME COLOUR: PART.PIN …       joined by name, as power is
//   note TEXT                         a line below the drawing
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const ROW = 20;
const LANE = 12;
const CHARACTER = 7.3;
const STUB = 16;
const COLOURS = {
  red: "#c62828", black: "#37474f", blue: "#1565c0", green: "#2e7d32", orange: "#e65100", purple: "#6a1b9a", teal: "#00838f",
  brown: "#795548", pink: "#ad1457", olive: "#827717", gray: "#78909c",
};

/** Text to parts, nets and notes; an Error names the line that is wrong. */
export function parseWires(text) {
  const drawing = { title: "", columns: [], parts: new Map(), nets: [], notes: [] };
  let part = null;
  text.split("\n").forEach((line, index) => {
    const wrong = (what) => new Error(`line ${index + 1}: ${what}: ${line}`);
    const [, word, rest] = line.match(/^(\S+)\s*(.*)$/) ?? [];
    if (word === undefined || word.startsWith("#")) return;
    if (word === "title") drawing.title = rest;
    else if (word === "note") drawing.notes.push(rest);
    else if (word === "column") drawing.columns.push([]);
    else if (word === "part") {
      const [, name, title] = rest.match(/^(\w+): (.+)$/) ?? [];
      if (name === undefined || drawing.parts.has(name)) throw wrong("a part has a name of its own and a title");
      part = { name, title, left: [], right: [], column: drawing.columns.length - 1 };
      if (part.column < 0) throw wrong("a part stands in a column");
      drawing.parts.set(name, part);
      drawing.columns.at(-1).push(part);
    } else if (word === "left" || word === "right") {
      if (!part) throw wrong("pins belong to a part");
      for (const pin of rest.match(/[^\s[\]]+(\[[^\]]*\])?/g) ?? []) {
        const [, name, words] = pin.match(/^([^[]+)(?:\[(.*)\])?$/);
        part[word].push(name === "_" ? null : { name, words: words ? `${name} ${words}` : name });
      }
    } else if (word === "wire" || word === "tag") {
      const [, head, ends] = rest.match(/^([^:]+): (.+)$/) ?? [];
      const words = head?.split(" ") ?? [];
      const colour = COLOURS[words.at(-1)];
      if (!colour || words.length !== (word === "tag" ? 2 : 1)) throw wrong(`one of these colours, then a colon: ${Object.keys(COLOURS).join(" ")}`);
      const pins = ends.split(/\s+/).map((end) => {
        const [name, pin] = end.split(".");
        const owner = drawing.parts.get(name);
        const side = ["left", "right"].find((side) => owner?.[side].some((known) => known?.name === pin));
        if (!side) throw wrong(`there is no pin ${end}`);
        return { part: owner, pin, side, gap: owner.column + (side === "right" ? 1 : 0) };
      });
      if (word === "wire" && new Set(pins.map(({ gap }) => gap)).size > 1) throw wrong("these pins do not face the same gap");
      drawing.nets.push({ name: word === "tag" ? words[0] : null, colour, pins });
    } else throw wrong("this word is not known");
  });
  return drawing;
}

/** Which pins are joined: a function from PART.PIN to a number, the same for all pins of one net. */
export function netlist({ nets }) {
  const joined = new Map();
  const find = (key) => (joined.get(key) === undefined || joined.get(key) === key ? key : find(joined.get(key)));
  for (const { name, pins } of nets) {
    const keys = pins.map(({ part, pin }) => `${part.name}.${pin}`);
    if (name) keys.push(`net ${name}`);
    keys.forEach((key) => {
      if (!joined.has(key)) joined.set(key, key);
    });
    keys.slice(1).forEach((key) => joined.set(find(key), find(keys[0])));
  }
  return (key) => (joined.has(key) ? find(key) : undefined);
}

const escape = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const widest = (pins) => Math.max(0, ...pins.map((pin) => (pin ? pin.words.length : 0))) * CHARACTER;

/** The drawing as SVG. */
export function draw(text) {
  const { title, columns, nets, notes } = parseWires(text);
  const pinAt = ({ part, pin, side }) => ({
    x: side === "left" ? part.x : part.x + part.width,
    y: part.y + ROW * (1.5 + part[side].findIndex((known) => known?.name === pin)),
  });
  const tagWidth = (gap) =>
    Math.max(0, ...nets.filter(({ name }) => name).flatMap(({ name, pins }) => pins.filter((pin) => pin.gap === gap).map(() => name.length * CHARACTER + STUB)));
  const inGap = (gap) => nets.filter(({ name, pins }) => !name && pins[0].gap === gap);

  // Columns are placed from left to right, each other one half a row lower, so that lines from both sides of a gap never lie on
  // each other.
  const top = 48;
  let [x, height] = [16 + tagWidth(0), 0];
  columns.forEach((parts, column) => {
    const width = Math.max(...parts.map((part) => Math.max(widest(part.left) + widest(part.right) + 36, part.title.length * CHARACTER + 20)));
    let y = top + (column % 2) * (ROW / 2);
    for (const part of parts) {
      part.rows = Math.max(part.left.length, part.right.length);
      Object.assign(part, { x, y, width, height: ROW * (part.rows + 1.5) });
      y += Math.ceil(part.height / ROW + 1) * ROW;
    }
    height = Math.max(height, y);
    const lanes = inGap(column + 1).length;
    x += width + (column + 1 < columns.length ? 2 * tagWidth(column + 1) + (lanes + 1) * LANE + 12 : tagWidth(column + 1) + 16);
  });

  const shapes = [];
  for (let gap = 1; gap < columns.length; gap++) {
    const [left] = columns[gap - 1];
    const middle = (pins) => pins.reduce((sum, pin) => sum + pinAt(pin).y, 0) / pins.length;
    const ordered = inGap(gap).sort((one, other) => middle(other.pins) - middle(one.pins));
    ordered.forEach(({ colour, pins }, lane) => {
      const at = left.x + left.width + tagWidth(gap) + 6 + (lane + 1) * LANE;
      const ends = pins.map(pinAt).sort((one, other) => one.y - other.y);
      const path = ends.map(({ x, y }) => `M${x} ${y}H${at}`).join("") + `M${at} ${ends[0].y}V${ends.at(-1).y}`;
      shapes.push(`<path d="${path}" stroke="${colour}" stroke-width="2" fill="none"/>`);
      ends.slice(1, -1).forEach(({ y }) => shapes.push(`<circle cx="${at}" cy="${y}" r="3.5" fill="${colour}"/>`));
    });
  }
  for (const { name, colour, pins } of nets.filter(({ name }) => name)) {
    for (const pin of pins) {
      const { x, y } = pinAt(pin);
      const out = pin.side === "left" ? -1 : 1;
      shapes.push(`<path d="M${x} ${y}h${out * (STUB - 5)}" stroke="${colour}" stroke-width="2"/>`);
      const anchor = out < 0 ? "end" : "start";
      shapes.push(`<text x="${x + out * STUB}" y="${y + 4}" text-anchor="${anchor}" fill="${colour}" font-weight="bold">${escape(name)}</text>`);
    }
  }
  for (const part of columns.flat()) {
    const { x, y, width, height } = part;
    shapes.push(`<rect x="${x}" y="${y}" width="${width}" height="${height}" rx="4" fill="#fafafa" stroke="#455a64" stroke-width="1.5"/>`);
    shapes.push(`<path d="M${x} ${y + ROW}h${width}" stroke="#b0bec5"/>`);
    shapes.push(`<text x="${x + width / 2}" y="${y + 15}" text-anchor="middle" font-weight="bold">${escape(part.title)}</text>`);
    for (const side of ["left", "right"]) {
      part[side].forEach((pin, row) => {
        if (!pin) return;
        const [at, anchor] = side === "left" ? [x + 8, "start"] : [x + width - 8, "end"];
        shapes.push(`<text x="${at}" y="${y + ROW * (1.5 + row) + 4}" text-anchor="${anchor}">${escape(pin.words)}</text>`);
      });
    }
  }
  const width = Math.max(x, title.length * 9 + 32, ...notes.map((note) => note.length * CHARACTER + 32));
  notes.forEach((note, i) => shapes.push(`<text x="16" y="${height + 8 + 18 * i}" fill="#455a64">${escape(note)}</text>`));
  const below = height + 18 * notes.length;
  return [
    `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${Math.ceil(width)} ${Math.ceil(below)}" width="${Math.ceil(width)}" height="${Math.ceil(below)}" font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="12" fill="#263238">`,
    `<rect width="100%" height="100%" fill="#ffffff"/>`,
    `<text x="16" y="28" font-size="15" font-weight="bold">${escape(title)}</text>`,
    ...shapes,
    "</svg>",
    "",
  ].join("\n");
}

/** The descriptions in this folder: name, text, and the drawing beside it. */
export function descriptions() {
  const folder = new URL("./", import.meta.url);
  const names = readdirSync(folder).filter((name) => name.endsWith(".wires")).sort();
  return names.map((name) => ({
    name,
    text: readFileSync(new URL(name, folder), "utf8"),
    drawing: new URL(name.replace(/wires$/, "svg"), folder),
  }));
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  for (const { text, drawing } of descriptions()) writeFileSync(drawing, draw(text));
}
