// Motion from a BVH file for emulated sensors.

/** A BVH file's joints, in order: name, and degrees per frame of each of its rotation channels. */
export function parseBvh(text) {
  const [hierarchy, motion] = text.split(/^\s*MOTION\s*$/m);
  if (motion === undefined) throw new Error("the file has no MOTION");
  const joints = [];
  let channels = 0;
  let name = null;
  for (const line of hierarchy.split("\n").map((line) => line.trim())) {
    name = line.match(/^(?:ROOT|JOINT)\s+(\S+)/)?.[1] ?? name;
    const [, count, kinds] = line.match(/^CHANNELS\s+(\d+)\s+(.*)$/) ?? [];
    if (count === undefined) continue;
    const rotations = kinds.split(/\s+/).flatMap((kind, i) => (/rotation$/.test(kind) ? [channels + i] : []));
    joints.push({ name, rotations });
    channels += Number(count);
  }
  const seconds = Number(motion.match(/^\s*Frame Time:\s*(\S+)/m)?.[1]);
  const numbers = motion.slice(motion.indexOf("Frame Time:")).split("\n").slice(1).join(" ").split(/\s+/).filter(Boolean).map(Number);
  const frames = Array.from({ length: Math.floor(numbers.length / channels) }, (_, i) => numbers.slice(i * channels, (i + 1) * channels));
  if (!(seconds > 0) || frames.length < 2 || numbers.some(Number.isNaN)) throw new Error("the file's motion cannot be read");
  return { joints, seconds, frames };
}

/**
 * How sensors turn that follow a motion file: those of part `i` follow the rotation channels of the file's joint `i`, over and
 * over, straight from frame to frame.
 */
export function bvhMotion(text) {
  const { joints, seconds, frames } = parseBvh(text);
  return (part) => {
    const { rotations } = joints[part % joints.length];
    return (sensor, at) => {
      const frame = (at / seconds) % (frames.length - 1);
      const [before, share] = [Math.floor(frame), frame % 1];
      const channel = rotations[sensor % rotations.length];
      // The short way round.
      const step = ((((frames[before + 1][channel] - frames[before][channel] + 180) % 360) + 360) % 360) - 180;
      return ((frames[before][channel] + share * step) * Math.PI) / 180;
    };
  };
}
