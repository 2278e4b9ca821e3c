// The host's program on emulated boards, like on any puppet, and each command of the guide, in the order of the page.
// `ARMATURE_PROGRAM` names the program; without it this is skipped, unless `ARMATURE_REQUIRE_BOARDS` is set.
import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";

import { boardOf } from "./boards.mjs";
import { buildTree, Part, swing, TREES } from "./parts.mjs";
import { serveBoard } from "./server.mjs";
import { fixedPuppet } from "./spi.mjs";

const PROGRAM = process.env.ARMATURE_PROGRAM;
const skip = PROGRAM ? false : "ARMATURE_PROGRAM names no program";
if (skip && process.env.ARMATURE_REQUIRE_BOARDS) throw new Error(skip);

const ROOT = fileURLToPath(new URL("../..", import.meta.url));
const GUIDE = readFileSync(new URL("../BUILD_YOUR_OWN_PUPPET.md", import.meta.url), "utf8");
/** How long an older Arduino's boot loader has the line after the port was opened. */
const BOOT_MILLIS = 2200;

async function run(program, args, folder = ROOT) {
  const { stdout, stderr } = await promisify(execFile)(program, args, { timeout: 240_000, cwd: folder });
  return stdout + stderr;
}

const newFolder = () => mkdtempSync(join(tmpdir(), "armature-board-"));

for (const [name, firmware] of [["Nano", process.env.ARMATURE_NANO], ["Pico", process.env.ARMATURE_PICO]]) {
  test(`armature runs, records and replays a seven-joint puppet on a ${name}`, { skip }, async () => {
    const board = boardOf(firmware);
    board.attach(buildTree(board, TREES.seven));
    const puppet = await serveBoard(board);
    try {
      const decoded = await run(PROGRAM, ["devices", "--decode", puppet.address, "--listen", "2"]);
      assert.match(decoded, /twist-bend-twist joint, in outlet 0 of part 0, 3 sensors/);
      assert.match(decoded, / 0 unreadable pieces, 0 contradictions/);
      const take = join(newFolder(), "board.take");
      const ran = await run(PROGRAM, ["run", "--device", puppet.address, "--seconds", "4", "--rate", "60", "--zero", "--record", take]);
      assert.match(ran, /7 joints drive 7 of/);
      assert.match(ran, / 0 frames with a wrong checksum, 0 unreadable pieces, 0 bytes discarded, 0 restarts/);
      const replay = await run(PROGRAM, ["replay", take]);
      const [, poses] = replay.match(/(\d+) poses solved again, all the same to the last bit/) ?? assert.fail(replay);
      assert.ok(Number(poses) > 20, replay);
    } finally {
      puppet.stop();
    }
  });
}

/** The lines of the guide's `console` blocks. */
function commands() {
  return GUIDE.split("```console\n").slice(1).flatMap((block) => block.split("\n```")[0].split("\n"));
}

/** Somebody who follows the guide: flashes, plugs parts in that nobody has labelled, and types what it says. */
class Reader {
  folder = newFolder();
  said = [];
  built = 0;

  async stop() {
    this.puppet?.stop();
  }

  /** A file is on the board: it starts with nothing plugged in but a new root. */
  async flash(file) {
    await this.stop();
    this.board = boardOf(join(this.folder, basename(file)));
    this.root = this.newPart("root", "splitter");
    this.board.attach(this.root);
    this.puppet = await serveBoard(this.board, { bootMillis: file.endsWith(".hex") ? BOOT_MILLIS : 0 });
  }

  newPart(name, kind) {
    const number = [0, 4, 0xa3, 0xff, 0xfe, 1, 0, ++this.built];
    return new Part(this.board.now, { name, kind, number, labelled: false, radians: swing(this.built), fullGain: this.board.fullGain });
  }

  async follow(line) {
    let found;
    if ((found = line.match(/^(?:NUMBER=(\d+) )?(\S+\/build) (\S+)$/))) {
      const [, number, program, name] = found;
      // In a folder of its own: other tests read the usual one at the same time.
      await run("env", [`OUT=${this.folder}`, ...(number ? [`NUMBER=${number}`] : []), program, name]);
      return;
    }
    if (/^\S+\/printable\/run$/.test(line)) {
      const printed = await run(line, []);
      assert.match(printed, /every part is of one piece/);
      return;
    }
    if ((found = line.match(/^avrdude -p atmega328p -c arduino .* -D -U flash:w:(\S+):i$/))) return this.flash(found[1]);
    if ((found = line.match(/^cp (\S+\.uf2) \/media\/\S+\/RPI-RP2\/$/))) {
      boardOf(join(this.folder, basename(found[1]))); // taken by the chip's checks; the page goes on with the Nano
      return;
    }
    if ((found = line.match(/^# plug a new (.*) joint into outlet (\d)$/))) {
      const kind = found[1] === "three-axis" ? "twist-bend-twist" : found[1];
      this.root.plug(Number(found[2]), this.newPart(found[1], kind));
      return;
    }
    if ((found = line.match(/^armature (.*)$/))) {
      const args = found[1].split(" ").map((word) => (word.startsWith("serial:") ? this.puppet.address : word));
      this.said.push(await run(PROGRAM, args, this.folder));
      return;
    }
    throw new Error(`the guide says what nobody here can do: ${line}`);
  }
}

test("a simulated puppet has no parts to label, and a fixed puppet none with a memory", { skip }, async () => {
  const refused = (args) => run(PROGRAM, args).then(() => assert.fail(args.join(" ")), ({ code, stderr }) => ({ code, stderr }));
  const simulated = await refused(["puppet", "parts", "--device", "sim:human"]);
  assert.equal(simulated.code, 2);
  assert.match(simulated.stderr, /simulated puppets and arms of servos have no parts to label/);
  const board = boardOf(join(process.env.ARMATURE_FIRMWARES, "nano-one.hex"));
  fixedPuppet("one").build(board);
  const puppet = await serveBoard(board);
  try {
    const fixed = await refused(["puppet", "label", "--device", puppet.address, "--kind", "bend"]);
    assert.match(fixed.stderr, /the parts of "Puppet on a Nano" have no memory to write to/);
  } finally {
    puppet.stop();
  }
});

test("each command of the guide, in the order of the page", { skip }, async () => {
  const reader = new Reader();
  try {
    for (const line of commands()) await reader.follow(line);
    const [listed, before, root, bend, threeAxis, parts, decoded, ran, replayed, ...more] = reader.said;
    assert.deepEqual(more, []);
    assert.match(listed, /sim:human/); // no board is plugged in here
    assert.match(before, /no answer yet: opening the port resets many boards/);
    assert.match(before, /1 part\n[^]*no label yet, root, 0 sensors, 5 outlets/);
    assert.match(root, /written: .* splitter, root, 0 sensors, 3 outlets/);
    assert.match(bend, /written: .* bend, outlet 0 of part 0, 1 sensor, 1 outlet/);
    assert.match(threeAxis, /written: .* twist-bend-twist, outlet 1 of part 0, 3 sensors, 1 outlet/);
    assert.match(parts, /3 parts/);
    assert.match(decoded, /4 sensors: .*all ok/);
    assert.match(ran, /2 joints drive 2 of/);
    assert.match(replayed, /all the same to the last bit/);
  } finally {
    await reader.stop();
  }
});
