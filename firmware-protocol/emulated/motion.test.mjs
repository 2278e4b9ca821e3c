// Both boards with sensors that move as a person did: real motion capture from the shared data, which is not in the repository.
import assert from "node:assert/strict";
import { existsSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

import { Bench } from "./bench.mjs";
import { boardOf } from "./boards.mjs";
import { bvhMotion, parseBvh } from "./bvh.mjs";
import { lost } from "./suite.mjs";

/** The shared data lies beside one of the folders above this one. */
function shared(name) {
  for (let folder = dirname(fileURLToPath(import.meta.url)); ; folder = dirname(folder)) {
    const file = join(folder, "shared", "data", name);
    if (existsSync(file)) return file;
    if (folder === dirname(folder)) return null;
  }
}

const FILE = shared("mocap/mocapbank.bvh");
/** From here on, in seconds, most joints move. */
const LIVELY = 5;
const skip = FILE ? false : "there is no shared data";
if (skip && process.env.ARMATURE_REQUIRE_SHARED_DATA) throw new Error(skip);

for (const [name, firmware, millis] of [["Nano", process.env.ARMATURE_NANO, 3000], ["Pico", process.env.ARMATURE_PICO, 400]]) {
  test(`${name}: sensors that move as in a motion file are read to one count`, { skip }, () => {
    const motion = bvhMotion(readFileSync(FILE, "utf8"));
    const bench = new Bench(boardOf(firmware), "seven", (part) => (sensor, seconds) => motion(part)(sensor, seconds + LIVELY));
    bench.run(200);
    bench.stream(100);
    const samples = bench.samples(millis);
    assert.ok(samples.length >= millis / 10 - 1 && lost(samples) === 0, `${samples.length} samples`);
    for (const sample of samples) {
      for (const reading of bench.readings(sample)) {
        assert.ok(bench.isTrue(reading, sample), `${reading.part.name} ${reading.sensor}: ${reading.count} in sample ${sample.sequence}`);
      }
    }
    const moved = samples[0].counts.filter((count, sensor) => samples.some((sample) => Math.abs(sample.counts[sensor] - count) > 20));
    assert.ok(moved.length >= 6, `${moved.length} of ${samples[0].counts.length} sensors moved`);
  });
}

test("a motion file is read to its frames, and one that is damaged is refused", () => {
  const file = `HIERARCHY
ROOT hips
{
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    CHANNELS 1 Xrotation
    End Site
    {
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.5
0 0 0 10 20 350 0
0 0 0 20 30 10 90
`;
  const motion = bvhMotion(file);
  const degrees = (part, sensor, seconds) => Math.round((motion(part)(sensor, seconds) * 180) / Math.PI);
  assert.deepEqual([degrees(0, 0, 0), degrees(0, 1, 0.25), degrees(0, 2, 0.25), degrees(1, 0, 0.25)], [10, 25, 360, 45]);
  for (const damaged of [file.replace("MOTION", ""), file.replace("0.5", "0"), file.replace("20 350", "20 x")]) {
    assert.throws(() => parseBvh(damaged), /the file/);
  }
});
