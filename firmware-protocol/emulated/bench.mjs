// A board on its emulator, its puppet and a host that speaks the protocol with it, all on emulated time.
import { buildTree, TREES } from "./parts.mjs";
import { Decoder, requests } from "./protocol.mjs";

const ASK_AGAIN_MICROS = 25_000;

export class Bench {
  messages = [];
  askedAt = -Infinity;
  decoder = new Decoder();
  /** The trees described so far, by epoch: records in order. */
  trees = new Map();

  constructor(board, tree, motion) {
    this.board = board;
    if (tree.build) {
      this.root = tree.build(board);
    } else {
      this.root = buildTree(board, typeof tree === "string" ? TREES[tree] : tree, motion);
      board.attach(this.root);
    }
    this.known = new Set(this.root.all());
    let begun = {};
    board.onByte = (byte, micros) => {
      if (this.decoder.piece.length === 0) begun = { firstAt: micros, readAt: this.lastRead() };
      const message = this.decoder.take(byte);
      if (message) this.take({ at: micros, ...begun, ...message });
    };
  }

  /** A host asks for the tree whenever it changes, and again while samples come that it cannot lay out: noise may have cost
   * the request. */
  take(message) {
    this.messages.push(message);
    const isUnknown = message.type === "sample" && !this.trees.has(message.epoch) && message.at > this.askedAt + ASK_AGAIN_MICROS;
    if (message.type === "topologyChanged" || isUnknown) {
      this.askedAt = message.at;
      this.board.send(requests.topology());
    }
    if (message.type !== "topology") return;
    const tree = message.first === 0 ? [] : (this.trees.get(message.epoch) ?? []);
    this.trees.set(message.epoch, [...tree.slice(0, message.first), ...message.records]);
  }

  /** When a sensor was last read. */
  lastRead() {
    return Math.max(0, ...[...this.known].flatMap((part) => part.sensors.map((sensor) => sensor.readAt)));
  }

  part(name) {
    const found = [...this.root.all()].find((part) => part.name === name);
    if (!found) throw new Error(`no part ${name} is plugged in`);
    return found;
  }

  of(type) {
    return this.messages.filter((message) => message.type === type);
  }

  run(millis) {
    this.board.run(millis * 1000);
  }

  /** Runs until a message of this type arrives, and returns it. */
  runUntil(type, millis = 1000) {
    const from = this.messages.length;
    for (let waited = 0; waited < millis; waited++) {
      this.run(1);
      const found = this.messages.slice(from).find((message) => message.type === type);
      if (found) return found;
    }
    throw new Error(`no ${type} within ${millis} ms`);
  }

  ask(request, type, millis) {
    this.board.send(request);
    return this.runUntil(type, millis);
  }

  /** The whole tree, as the board describes it. */
  topology() {
    this.board.send(requests.topology());
    let last = this.runUntil("topology");
    while (last.first + last.records.length < last.parts) {
      const behind = this.of("topology").find((m) => m.at > last.at);
      last = behind ?? this.runUntil("topology");
    }
    return { epoch: last.epoch, parts: this.trees.get(last.epoch) };
  }

  /** What a host sends first. */
  stream(hertz) {
    this.hello = this.ask(requests.hello(), "hello");
    this.topology();
    this.rate = this.ask(requests.rate(hertz), "rateSet").rate / 1000;
    this.ask(requests.start(), "acknowledge");
  }

  /** The samples that arrive within this many milliseconds. */
  samples(millis) {
    const from = this.messages.length;
    this.run(millis);
    return this.messages.slice(from).filter((message) => message.type === "sample");
  }

  /** Does something once, when the next byte is read from a chip. */
  whenAddressed(chip, act) {
    const read = chip.read;
    chip.read = (...more) => {
      chip.read = read;
      act();
      return 0xff; // whatever was unplugged leaves the line high
    };
  }

  /** Every sensor of a sample: the part it belongs to, its count and its state. */
  readings(sample) {
    const parts = new Map([...this.known].map((part) => [Buffer.from(part.uid).toString("hex"), part]));
    let at = 0;
    return (this.trees.get(sample.epoch) ?? []).flatMap(({ uid, sensors }) =>
      Array.from({ length: sensors }, (_, sensor) => {
        const [count, state] = [sample.counts[at], sample.states[at]];
        at += 1;
        return { part: parts.get(uid), uid, sensor, count, state };
      }),
    );
  }

  /** Whether a reading matches its sensor's position while the sample was taken, to one count. */
  isTrue({ part, sensor, count, state }, sample, micros = 15_000) {
    if (state !== 0) return false;
    for (let later = 0; later <= micros; later += 150) {
      const { counts } = part.sensors[sensor];
      const apart = Math.abs(part.sensors[sensor].countAt(sample.micros + later) - count);
      if (Math.min(apart, counts - apart) <= 1) return true;
    }
    return false;
  }
}
