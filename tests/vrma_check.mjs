// Opens a VRM animation with @pixiv/three-vrm-animation and checks where limbs point.
//
//     npm install three @pixiv/three-vrm @pixiv/three-vrm-animation
//     NODE_MODULES=node_modules node tests/vrma_check.mjs FILE.vrma EXPECTED.json
//
// EXPECTED.json: "frames", "frame_seconds", and "samples": for some frames, "hips" (place) and "limbs", the directions of
// limbs that rest in a T-pose: {"leftUpperArm": [x, y, z], ...}.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { resolve } from "node:path";

globalThis.self ??= globalThis;
const modules = resolve(process.env.NODE_MODULES ?? "node_modules");
const load = (path) => import(pathToFileURL(`${modules}/${path}`).href);
const THREE = await load("three/build/three.module.js");
const { GLTFLoader } = await load("three/examples/jsm/loaders/GLTFLoader.js");
const { VRMAnimationLoaderPlugin } = await load("@pixiv/three-vrm-animation/lib/three-vrm-animation.module.js");

const [, , file, expectedFile] = process.argv;
const expected = JSON.parse(readFileSync(expectedFile, "utf8"));
const faults = [];
const warnings = [];
console.warn = (...words) => warnings.push(words.join(" "));

const loader = new GLTFLoader();
loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
const bytes = readFileSync(file);
const gltf = await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), "");
const animations = gltf.userData.vrmAnimations ?? [];
if (animations.length !== 1) faults.push(`${animations.length} animations`);
const { duration, humanoidTracks, restHipsPosition } = animations[0];
const seconds = (expected.frames - 1) * expected.frame_seconds;
if (Math.abs(duration - seconds) > 1e-6 * Math.max(1, seconds)) faults.push(`it lasts ${duration} s instead of ${seconds} s`);
if (!(restHipsPosition.y > 0)) faults.push(`the hips rest at ${restHipsPosition.y}`);

// The bones above each in a humanoid; the loader gives each bone's turn relative to the nearest of them that is there.
const above = {
  UpperArm: ["Shoulder", "upperChest", "chest", "spine", "hips"],
  LowerArm: ["UpperArm"],
  UpperLeg: ["hips"],
  LowerLeg: ["UpperLeg"],
};
const chainAbove = { Shoulder: ["upperChest", "chest", "spine", "hips"], upperChest: ["chest", "spine", "hips"], chest: ["spine", "hips"], spine: ["hips"], hips: [] };
const turn = (bone, seconds) => {
  const [side, part] = /^(left|right)/.test(bone) ? [bone.match(/^(left|right)/)[1], bone.replace(/^(left|right)/, "")] : ["", bone];
  const parents = (above[part] ?? chainAbove[part]).map((p) => (/^[A-Z]/.test(p) ? side + p : p));
  const own = new THREE.Quaternion();
  const track = humanoidTracks.rotation.get(bone);
  if (track) own.fromArray(track.createInterpolant().evaluate(seconds)).normalize();
  // Bones without a track rest, but are there all the same.
  const parent = parents.find((name) => expected.bones.includes(name));
  return parent ? turn(parent, seconds).multiply(own) : own;
};
const rest = (bone) =>
  /Leg$/.test(bone) ? new THREE.Vector3(0, -1, 0) : new THREE.Vector3(bone.startsWith("left") ? 1 : -1, 0, 0);

let worst = 0;
for (const { frame, hips, limbs } of expected.samples) {
  const now = frame * expected.frame_seconds;
  const place = humanoidTracks.translation.get("hips")?.createInterpolant().evaluate(now) ?? restHipsPosition.toArray();
  const off = Math.hypot(...hips.map((c, k) => c - place[k]));
  if (!(off < 1e-3 * Math.max(1, restHipsPosition.y))) faults.push(`frame ${frame}: hips off by ${off}`);
  for (const [bone, direction] of Object.entries(limbs)) {
    const points = rest(bone).applyQuaternion(turn(bone, now));
    const angle = THREE.MathUtils.radToDeg(points.angleTo(new THREE.Vector3(...direction)));
    worst = Math.max(worst, angle);
    if (!(angle <= 0.05)) faults.push(`frame ${frame}: ${bone} is off by ${angle} degrees`);
  }
}
console.log(`${humanoidTracks.rotation.size} bones turn, ${duration} s; limbs off by ${worst} degrees at most`);
faults.push(...warnings);
for (const fault of faults.slice(0, 20)) console.log(`FAULT: ${fault}`);
console.log(faults.length ? "FAILED" : "all agrees");
process.exit(faults.length ? 1 : 0);
