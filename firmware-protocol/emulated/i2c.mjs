// An I2C bus: who hears what, and which lines are low. Works byte by byte; the boards add the time that bytes take.

/** A stretch of wire with the chips on it. */
export class Segment {
  chips = new Set();
  /** Lines that a fault holds low: a short, or a chip that is stuck. */
  held = { sda: false, scl: false };

  /** This segment and all segments behind open multiplexer channels. */
  *connected() {
    yield this;
    for (const chip of this.chips) {
      for (const segment of chip.openSegments?.() ?? []) yield* segment.connected();
    }
  }
}

/** The controller's wire: what it does reaches every chip connected at that moment. */
export class Bus {
  root = new Segment();
  addressed = [];
  reading = false;
  pulledBySda = false;
  pulledByScl = false;
  /** A chip holds SCL low between two bytes, for now. */
  stretched = false;

  chips() {
    const chips = [];
    for (const segment of this.root.connected()) chips.push(...segment.chips);
    return chips;
  }

  /** Which lines are high. */
  lines() {
    let [sda, scl] = [!this.pulledBySda, !this.pulledByScl && !this.stretched];
    for (const segment of this.root.connected()) {
      sda &&= !segment.held.sda;
      scl &&= !segment.held.scl;
      for (const chip of segment.chips) {
        sda &&= !(chip.clocksToRelease > 0);
        scl &&= !chip.hangs;
      }
    }
    return { sda, scl };
  }

  /** A byte is over: for how many microseconds the chips that hear it hold SCL low; Infinity if they never let go. */
  stretch() {
    const micros = Math.max(0, ...this.addressed.map((chip) => chip.stretchMicros));
    if (micros === Infinity) for (const chip of this.addressed) chip.hangs ||= chip.stretchMicros === Infinity;
    return micros;
  }

  /** A start (or repeated start) and the address byte. Returns whether any chip acknowledges. */
  start(address, reading, hertz) {
    this.reading = reading;
    this.addressed = this.chips().filter((chip) => chip.start(address, reading, hertz));
    return this.addressed.length > 0;
  }

  /** When several chips answer at once, a zero from any of them pulls the line low. */
  write(byte) {
    const answers = this.addressed.map((chip) => chip.write(byte));
    return answers.some((acknowledged) => acknowledged);
  }

  read(more) {
    return this.addressed.reduce((byte, chip) => byte & chip.read(more), 0xff);
  }

  /** Multiplexers switch at the stop, so who hears it is decided before. */
  stop() {
    for (const chip of this.chips()) chip.stop();
    this.addressed = [];
  }

  /** The controller drives the lines by hand (true: pulls low). A chip left in the middle of a byte releases the line after
   * the remaining clocks; a rise of SDA while SCL is high is a stop. */
  drive({ sda, scl }) {
    const clockRises = this.pulledByScl && !scl;
    const stops = this.pulledBySda && !sda && !scl && !this.pulledByScl;
    this.pulledBySda = sda;
    this.pulledByScl = scl;
    if (clockRises && this.lines().scl) for (const chip of this.chips()) chip.clock();
    if (stops) this.stop();
  }
}

/** What all chips share. */
export class Chip {
  addresses;
  /** The fastest clock by its data sheet. */
  hertz = 400_000;
  /** Clocks after which it stops pulling SDA low; set by faults. */
  clocksToRelease = 0;
  /** How long it holds SCL low after each byte; a chip that hangs in one never lets go. Set by faults. */
  stretchMicros = 0;
  hangs = false;
  first = false;
  selected = false;

  constructor(...addresses) {
    this.addresses = addresses;
  }

  /** A chip that is addressed faster than it is rated for does not answer. */
  start(address, reading, hertz) {
    this.selected = this.addresses.includes(address) && hertz <= 1.01 * this.hertz && this.acknowledges(reading);
    this.first = true;
    return this.selected;
  }

  acknowledges() {
    return true;
  }

  write(byte) {
    const acknowledged = this.first ? this.writeFirst(byte) : this.writeNext(byte);
    this.first = false;
    return acknowledged;
  }

  stop() {
    if (this.selected) this.stopped();
    this.selected = false;
  }

  stopped() {}

  clock() {
    if (this.clocksToRelease > 0) this.clocksToRelease -= 1;
  }
}
