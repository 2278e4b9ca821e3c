"""Opens a take that was exported as data with other people's libraries and compares it with what we have.

    pip install numpy mcap mcap-protobuf-support
    python tests/data_check.py EXPECTED.json FILE.npz FILE.csv FILE.mcap

EXPECTED.json: "bones", "joints", "joint_bones"; "rows", one for each sample: "seconds", "sequence", "micros", "counts" and
"states" (null while a joint is not plugged in), "angles" (null where there is none), "pose" ([[translation, rotation]] for
each bone, or null); "frames", the poses of the motion alike, and "frames_per_second"; "start_nanos".

Exits with 0 if everything agrees, 1 if not, 2 if it could not be run.
"""

import csv
import json
import math
import sys

FAULTS = []


def same(what, ours, theirs):
    if ours != theirs:
        FAULTS.append(f"{what}: {theirs!r} instead of {ours!r}")


def check_npz(expected, path):
    import numpy as np

    arrays = np.load(path, allow_pickle=False)
    rows, frames = expected["rows"], expected["frames"]
    same("bones", expected["bones"], arrays["bones"].tolist())
    same("parents", expected["parents"], arrays["parents"].tolist())
    same("joints", expected["joints"], arrays["joints"].tolist())
    same("joint_bones", expected["joint_bones"], arrays["joint_bones"].tolist())
    same("rate", expected["frames_per_second"], float(arrays["frames_per_second"]))
    same("shape of rotation", (len(frames), len(expected["bones"]), 4), arrays["rotation"].shape)
    f32 = lambda values: np.asarray(values, dtype=np.float32)  # noqa: E731
    same("rotation", True, bool((arrays["rotation"] == f32([[b[1] for b in f] for f in frames])).all()))
    same("translation", True, bool((arrays["translation"] == f32([[b[0] for b in f] for f in frames])).all()))
    same("time", [k / expected["frames_per_second"] for k in range(len(frames))], arrays["time"].tolist())
    same("sample_time", [r["seconds"] for r in rows], arrays["sample_time"].tolist())
    same("sample_sequence", [r["sequence"] for r in rows], arrays["sample_sequence"].tolist())
    same("sample_device_micros", [r["micros"] for r in rows], arrays["sample_device_micros"].tolist())
    counts = [[-1 if c is None else c for c in r["counts"]] for r in rows]
    same("counts", counts, arrays["counts"].tolist())
    same("states", [[255 if c is None else c for c in r["states"]] for r in rows], arrays["states"].tolist())
    angles = np.array([[math.nan if c is None else c for c in r["angles"]] for r in rows])
    same("angles", True, bool(np.array_equal(angles, arrays["angles"], equal_nan=True)))
    print(f"npz: {len(arrays.files)} arrays, {len(frames)} frames, {len(rows)} samples")


def check_csv(expected, path):
    with open(path, newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    same("rows", len(expected["rows"]), len(table))
    number = lambda text: None if text == "" else float(text)  # noqa: E731
    for row, theirs in zip(expected["rows"], table):
        same("time", row["seconds"], float(theirs["time"]))
        same("sequence", row["sequence"], int(theirs["sequence"]))
        for joint, count, angle in zip(expected["joints"], row["counts"], row["angles"]):
            same(f"count:{joint}", count, number(theirs[f"count:{joint}"]))
            same(f"angle:{joint}", angle, number(theirs[f"angle:{joint}"]))
        for bone, parent, own in zip(expected["bones"], expected["parents"], row["pose"] or [None] * 99):
            for k, axis in enumerate(("qx", "qy", "qz", "qw")):
                text = theirs[f"{bone}.{axis}"]
                close(f"{bone}.{axis}", None if own is None else own[1][k], number(text))
            for k, axis in enumerate(("x", "y", "z") if parent < 0 else ()):
                close(f"{bone}.{axis}", None if own is None else own[0][k], number(theirs[f"{bone}.{axis}"]))
    print(f"csv: {len(table)} rows of {len(table[0])} columns")


def close(what, ours, theirs):
    if (ours is None) != (theirs is None) or (ours is not None and abs(ours - theirs) > 1e-7 * max(1, abs(ours))):
        FAULTS.append(f"{what}: {theirs!r} instead of {ours!r}")


def check_mcap(expected, path):
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    rows = expected["rows"]
    start = expected["start_nanos"]
    by_topic = {"/raw": [], "/joints": [], "/tf": []}
    last = 0
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            same("order of times", True, message.log_time >= last)
            last = message.log_time
            by_topic[channel.topic].append((schema, channel, message, decoded))
    for topic, name in (("/raw", "armature.RawSample"), ("/joints", "foxglove.JointStates"), ("/tf", "foxglove.FrameTransforms")):
        same("schema of " + topic, {name}, {schema.name for schema, *_ in by_topic[topic]})
    same("raw samples", len(rows), len(by_topic["/raw"]))
    same("names of joints", ",".join(expected["joints"]), by_topic["/raw"][0][1].metadata["joints"])
    for row, (_, _, message, raw), (_, _, _, states) in zip(rows, by_topic["/raw"], by_topic["/joints"]):
        nanos = start + round(row["seconds"] * 1e6) * 1000
        same("log time", nanos, message.log_time)
        same("timestamp", nanos, raw.timestamp.seconds * 10**9 + raw.timestamp.nanos)
        same("sequence", row["sequence"], raw.sequence)
        same("micros", row["micros"], raw.device_micros)
        same("counts", [c or 0 for c in row["counts"]], list(raw.counts))
        same("states", [255 if c is None else c for c in row["states"]], list(raw.states))
        angles = {j: a for j, a in zip(expected["joints"], row["angles"]) if a is not None}
        same("joint states", angles, {j.name: j.position for j in states.joints})
    poses = [row["pose"] for row in rows if row["pose"]]
    same("poses", len(poses), len(by_topic["/tf"]))
    for pose, (_, _, _, frames) in zip(poses, by_topic["/tf"]):
        same("world", ("world", "model"), (frames.transforms[0].parent_frame_id, frames.transforms[0].child_frame_id))
        same("bones", expected["bones"], [t.child_frame_id for t in frames.transforms[1:]])
        for index, (own, t) in enumerate(zip(pose, frames.transforms[1:])):
            parent = expected["parents"][index]
            same("parent", "model" if parent < 0 else expected["bones"][parent], t.parent_frame_id)
            for k, (p, q) in enumerate(zip(own[0], (t.translation.x, t.translation.y, t.translation.z))):
                close(f"translation {k}", p, q)
            for k, (p, q) in enumerate(zip(own[1], (t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w))):
                close(f"rotation {k}", p, q)
    print(f"mcap: {', '.join(f'{topic} {len(found)}' for topic, found in by_topic.items())}")


def main():
    if len(sys.argv) != 5:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        import mcap  # noqa: F401
        import mcap_protobuf  # noqa: F401
        import numpy  # noqa: F401
    except ImportError as error:
        print(f"{error}; run pip install numpy mcap mcap-protobuf-support", file=sys.stderr)
        return 2
    with open(sys.argv[1], encoding="utf-8") as file:
        expected = json.load(file)
    check_npz(expected, sys.argv[2])
    check_csv(expected, sys.argv[3])
    check_mcap(expected, sys.argv[4])
    for fault in FAULTS[:20]:
        print(f"FAULT: {fault}")
    print("FAILED" if FAULTS else "all agrees")
    return 1 if FAULTS else 0


if __name__ == "__main__":
    sys.exit(main())
