// Serves a board on its emulator, with a puppet on its bus, on a TCP port: `armature run --device tcp:127.0.0.1:PORT`.
//
//   node firmware-protocol/emulated/serve.mjs FIRMWARE [--tree seven] [--motion FILE.bvh] [--port 0] [--seconds 60]
//
// FIRMWARE is the file that is flashed. Without a motion file the joints swing.
import { readFileSync } from "node:fs";
import { parseArgs } from "node:util";

import { boardOf } from "./boards.mjs";
import { bvhMotion } from "./bvh.mjs";
import { buildTree, TREES } from "./parts.mjs";
import { serveBoard } from "./server.mjs";

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { tree: { type: "string", default: "seven" }, motion: { type: "string" }, port: { type: "string", default: "0" }, seconds: { type: "string" } },
});
if (positionals.length !== 1 || !(values.tree in TREES)) {
  console.error(`usage: serve.mjs FIRMWARE [--tree ${Object.keys(TREES).join("|")}] [--motion FILE.bvh] [--port N] [--seconds N]`);
  process.exit(2);
}
const board = boardOf(positionals[0]);
const motion = values.motion && bvhMotion(readFileSync(values.motion, "utf8"));
board.attach(buildTree(board, TREES[values.tree], motion || undefined));
const { address } = await serveBoard(board, { port: Number(values.port) });
console.log(address);
if (values.seconds) setTimeout(() => process.exit(0), Number(values.seconds) * 1000);
