// An Arduino Nano on avr8js, with a modular bus on its pins.
import { readFileSync } from "node:fs";
import { emulator } from "./emulators.mjs";
import { Bus } from "./i2c.mjs";
import { SpiPort } from "./spi.mjs";

const avr = emulator("avr8js");
const CLOCK = 16e6;
const [TWCR, TWEN, TWINT] = [0xbc, 0x04, 0x80];
const [SDA, SCL, RESET] = [0x10, 0x20, 0x04];
const [SEI, SLEEP, SMCR] = [0x9478, 0x9588, 0x53];
const [UCSR0A, UDR0, RXC] = [0xc0, 0xc6, 0x80];
const LOST_ARBITRATION = 0x38;
const IDLE = 0xf8;

/** The bytes of an Intel HEX file. */
export function parseHex(text, size) {
  const memory = new Uint8Array(size).fill(0xff);
  for (const line of text.split("\n").filter((line) => line.startsWith(":"))) {
    const bytes = Buffer.from(line.slice(1).trim(), "hex");
    if (bytes.reduce((sum, byte) => sum + byte, 0) % 256 !== 0) throw new Error(`damaged line in the file: ${line}`);
    if (bytes[3] === 0) memory.set(bytes.subarray(4, 4 + bytes[0]), bytes.readUInt16BE(1));
  }
  return memory;
}

export class Nano {
  bus = new Bus();
  /** A puppet whose parts are fixed: its sensors on SPI, and what is on the analogue inputs. */
  spi = new SpiPort();
  analogue = [];
  /** The limit of an AS5600's gain: 255 at 5 V, 128 at 3.3 V. */
  fullGain = 255;
  /** Called with each byte that the board sends and the emulated time in microseconds. */
  onByte = () => {};
  /** Bytes from the host that were lost because the firmware did not take them in time. */
  overruns = 0;

  constructor(hexFile) {
    this.program = new Uint16Array(parseHex(readFileSync(hexFile, "utf8"), 0x8000).buffer);
    this.powerUp();
  }

  now = () => (this.cpu.cycles / CLOCK) * 1e6;

  /** The part that contains the controller. */
  attach(root) {
    this.root = root;
    root.setLevelLines(1);
    this.bus.root.chips.add(root.multiplexer);
  }

  powerUp() {
    const cycles = this.cpu?.cycles ?? 0;
    this.cpu = new avr.CPU(this.program, 2048);
    this.cpu.cycles = cycles;
    this.timer = new avr.AVRTimer(this.cpu, avr.timer1Config);
    this.portC = new avr.AVRIOPort(this.cpu, avr.portCConfig);
    this.portD = new avr.AVRIOPort(this.cpu, avr.portDConfig);
    this.usart = new avr.AVRUSART(this.cpu, avr.usart0Config, CLOCK);
    this.usart.onByteTransmit = (byte) => this.onByte(byte, this.now());
    this.waiting = [];
    this.held = [];
    const readUdr = this.cpu.readHooks[UDR0];
    this.cpu.readHooks[UDR0] = (address) => {
      const byte = readUdr(address);
      this.offer();
      return byte;
    };
    this.attachTwi();
    this.attachPins();
    this.attachSpi();
    // What is left of this pattern shows the stack's deepest point.
    this.cpu.data.fill(0xa5, 0x100);
    this.lowestStack = this.cpu.data.length;
    this.root?.powerUp();
  }

  /** Bytes from the host, one by one at the line's speed. */
  send(bytes) {
    const idle = this.waiting.length === 0;
    this.waiting.push(...bytes);
    if (idle) this.cpu.addClockEvent(this.arrive, this.usart.cyclesPerChar);
  }

  /** The receiver holds two bytes besides the one arriving; bytes that arrive while all are full are lost. */
  arrive = () => {
    const byte = this.waiting.shift();
    if (this.held.length < 2) this.held.push(byte);
    else this.overruns += 1;
    this.offer();
    if (this.waiting.length > 0) this.cpu.addClockEvent(this.arrive, this.usart.cyclesPerChar);
  };

  offer() {
    const unread = this.cpu.data[UCSR0A] & RXC;
    if (!unread && this.held.length > 0) this.usart.writeByte(this.held.shift(), true);
  }

  attachTwi() {
    const { cpu, bus } = this;
    const twi = new avr.AVRTWI(cpu, avr.twiConfig, CLOCK);
    let generation = 0;
    const clocks = (count, complete) => {
      const mine = ++generation;
      cpu.addClockEvent(
        () => {
          if (mine === generation) complete();
        },
        Math.round((count * CLOCK) / twi.sclFrequency),
      );
    };
    /** A byte with its acknowledgement, and however long a chip stretches the clock behind it. */
    const byte = (complete) =>
      clocks(9, () => {
        const micros = bus.lines().scl ? bus.stretch() : 0;
        if (micros === 0 || micros === Infinity) {
          this.showLines();
          if (micros === 0) complete();
          return;
        }
        const mine = generation;
        bus.stretched = true;
        this.showLines();
        cpu.addClockEvent(() => {
          bus.stretched = false;
          this.showLines();
          if (mine === generation) complete();
        }, Math.round((micros * CLOCK) / 1e6));
      });
    const withLines = (complete) => {
      const { sda, scl } = bus.lines();
      if (!scl) return; // the clock never rises, the byte never ends
      if (!sda) {
        generation++;
        twi.busy = false;
        twi.updateStatus(LOST_ARBITRATION);
        return;
      }
      complete();
      this.showLines();
    };
    twi.eventHandler = {
      start: () => clocks(1, () => withLines(() => twi.completeStart())),
      stop: () => clocks(1, () => {
        bus.stop();
        twi.completeStop();
        this.showLines();
      }),
      connectToSlave: (address, write) =>
        byte(() => withLines(() => twi.completeConnect(bus.start(address, !write, twi.sclFrequency)))),
      writeByte: (value) => byte(() => withLines(() => twi.completeWrite(bus.write(value)))),
      readByte: (more) => byte(() => {
        if (!bus.lines().scl) return;
        twi.completeRead(bus.lines().sda ? bus.read(more) : 0);
        this.showLines();
      }),
    };
    // The flag stays until the firmware writes a one to it; neither an interrupt nor a zero clears it. avr8js differs.
    twi.TWI.constant = true;
    const written = cpu.writeHooks[TWCR];
    cpu.writeHooks[TWCR] = (value, ...rest) => {
      if (!(value & TWEN)) {
        generation++;
        twi.busy = false;
        cpu.data[avr.twiConfig.TWSR] = IDLE;
        cpu.data[TWCR] = value & 0x7f;
        cpu.updateInterruptEnable(twi.TWI, value);
        this.driveLines();
        return true;
      }
      if (!(value & TWINT)) {
        cpu.data[TWCR] = value | (cpu.data[TWCR] & TWINT);
        cpu.updateInterruptEnable(twi.TWI, value);
        return true;
      }
      return written(value, ...rest);
    };
    // After power-up nothing has happened yet.
    cpu.data[TWCR] = 0;
  }

  attachPins() {
    this.portC.addListener(() => this.driveLines());
    this.portD.addListener(() => {
      if (this.pulls(avr.portDConfig, RESET)) this.root?.resetMultiplexers();
      this.showLines();
    });
    this.portD.setPin(2, true);
    this.showLines();
  }

  /** Select lines 0 to 7 are D3 to D10. */
  attachSpi() {
    const { cpu, spi } = this;
    const port = new avr.AVRSPI(cpu, avr.spiConfig, CLOCK);
    port.onByte = (byte) => {
      const answer = spi.exchange(byte);
      cpu.addClockEvent(() => port.completeTransfer(answer), port.transferCycles);
    };
    const portB = new avr.AVRIOPort(cpu, avr.portBConfig);
    const low = (config, bit) => this.pulls(config, 1 << bit);
    this.portD.addListener(() => [3, 4, 5, 6, 7].forEach((bit) => spi.select(bit - 3, low(avr.portDConfig, bit))));
    portB.addListener(() => [0, 1, 2].forEach((bit) => spi.select(bit + 5, low(avr.portBConfig, bit))));
    const adc = new avr.AVRADC(cpu, avr.adcConfig);
    adc.onADCRead = ({ channel }) => {
      const count = this.analogue[channel]?.countAt(this.now()) ?? 0;
      cpu.addClockEvent(() => adc.completeADCRead(count), adc.sampleCycles);
    };
  }

  pulls(port, mask) {
    return (this.cpu.data[port.DDR] & mask) !== 0 && (this.cpu.data[port.PORT] & mask) === 0;
  }

  /** Driven by hand while the bus controller is off. */
  driveLines() {
    if (this.cpu.data[TWCR] & TWEN) return;
    this.bus.drive({ sda: this.pulls(avr.portCConfig, SDA), scl: this.pulls(avr.portCConfig, SCL) });
    this.showLines();
  }

  /** The levels the pins read. */
  showLines() {
    const { sda, scl } = this.bus.lines();
    this.portC.setPin(4, sda);
    this.portC.setPin(5, scl);
  }

  /** Runs for this many emulated microseconds. */
  run(micros) {
    const { cpu } = this;
    const end = cpu.cycles + (micros * CLOCK) / 1e6;
    while (cpu.cycles < end) {
      // avr8js ignores sleep. Nothing happens until the next event, so the clock may jump to it. And between
      // enabling interrupts and taking one the processor executes one more instruction, often that very sleep.
      const opcode = cpu.progMem[cpu.pc];
      avr.avrInstruction(cpu);
      if (opcode === SEI) continue;
      const behind = cpu.pc;
      while (opcode === SLEEP && cpu.data[SMCR] & 1 && cpu.pc === behind && cpu.cycles < end) {
        if (cpu.nextInterrupt < 0) cpu.cycles = Math.max(cpu.cycles, cpu.nextClockEvent?.cycles ?? end);
        cpu.tick();
      }
      cpu.tick();
    }
  }

  /** The most memory ever in use, in bytes: variables and the deepest stack. */
  memoryUsed(variables) {
    let lowest = 0x100 + variables;
    while (lowest < this.cpu.data.length && this.cpu.data[lowest] === 0xa5) lowest++;
    return variables + this.cpu.data.length - lowest;
  }
}
