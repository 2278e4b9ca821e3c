// A Raspberry Pi Pico on rp2040js, with a modular bus on each of its I2C controllers.
import { readFileSync } from "node:fs";

import { Tca9548a } from "./chips.mjs";
import { emulator } from "./emulators.mjs";
import { Bus } from "./i2c.mjs";
import { SpiPort } from "./spi.mjs";

const { ConsoleLogger, LogLevel, Simulator, USBCDC } = emulator("rp2040js");
const FLASH = 0x10000000;
const RESETS = 0x4000c;
const UART_TRANSMIT_FULL = 1 << 5;
const INTERRUPT_MASK = 0x30;
const UART_FIFO = 32;
const SELECTS = [10, 11, 12, 13, 14, 15, 20, 21, 22, 2, 3, 17, 4, 5, 6, 7, 8, 9, 28, 27, 26];
const pinsOf = (bus) => ({ sda: 4 + 2 * bus, scl: 5 + 2 * bus, reset: 8 + bus });

/** The flash image in a UF2 file, checked as the chip's boot code checks it. */
export function parseUf2(file) {
  const flash = new Uint8Array(2 << 20).fill(0xff);
  const blocks = file.length / 512;
  for (let i = 0; i < blocks; i++) {
    const block = file.subarray(i * 512, (i + 1) * 512);
    const [magic0, magic1, flags, target, length, number, count, family] = Array.from({ length: 8 }, (_, word) => block.readUInt32LE(4 * word));
    const magics = [magic0, magic1, block.readUInt32LE(508)];
    if (magics.join() !== [0x0a324655, 0x9e5d5157, 0x0ab16f30].join()) throw new Error(`block ${i} is not a UF2 block`);
    if (!(flags & 0x2000) || family !== 0xe48bff56) throw new Error("the file is for another chip");
    if (number !== i || count !== blocks || length !== 256) throw new Error(`block ${i} of ${blocks} says that it is ${number} of ${count}`);
    flash.set(block.subarray(32, 32 + length), target - FLASH);
  }
  let crc = 0xffffffff;
  for (const byte of flash.subarray(0, 252)) {
    crc ^= byte << 24;
    for (let bit = 0; bit < 8; bit++) crc = (crc << 1) ^ (crc & 0x80000000 ? 0x04c11db7 : 0);
  }
  const checksum = new DataView(flash.buffer).getUint32(252, true);
  if (crc >>> 0 !== checksum) throw new Error("the checksum after the second boot stage is wrong: the chip would not start");
  return flash;
}

export class Pico {
  buses = [new Bus(), new Bus()];
  /** A puppet whose parts are fixed: its sensors on SPI, and what is on the analogue inputs. */
  spi = new SpiPort();
  analogue = [];
  /** The limit of an AS5600's gain: 255 at 5 V, 128 at 3.3 V. */
  fullGain = 128;
  /** Called with each byte that the board sends on its UART or USB and the emulated time in microseconds. */
  onByte = () => {};
  /** Where the host sends its bytes: "uart" or "usb". */
  line;
  /** The multiplexers in the parts. */
  Multiplexer;

  constructor(uf2File, { line = "uart", Multiplexer = Tca9548a } = {}) {
    this.Multiplexer = Multiplexer;
    this.flash = parseUf2(readFileSync(uf2File));
    this.line = line;
    this.powerUp();
  }

  /** Emulated microseconds before the last power-up: the chip's own clock starts over with it. */
  before = 0;

  now = () => this.before + this.clock.nanos / 1000;

  /** The part that contains the controller. It has a multiplexer on each bus: the second one opens outlets 3 and 4. */
  attach(root) {
    this.root = root;
    root.attachSecondBus(this.buses[1].root);
    root.setLevelLines(1);
    this.buses[0].root.chips.add(root.multiplexer);
    this.showLines();
  }

  powerUp() {
    if (this.clock) this.before = this.now();
    const { rp2040, clock } = new Simulator();
    this.clock = clock;
    this.chip = rp2040;
    this.chip.logger = new ConsoleLogger(LogLevel.Error, false);
    this.chip.flash.set(this.flash);
    this.attachUart();
    this.attachUsb();
    [0, 1].forEach((bus) => this.attachI2c(bus));
    this.attachPins();
    this.attachSpi();
    this.start();
    this.root?.powerUp();
  }

  /** What the chip's boot code does, which the emulator lacks: it runs the second stage from the end of RAM. */
  start() {
    const { core, sram } = this.chip;
    const stage = 0x20041f00;
    sram.set(this.flash.subarray(0, 256), stage - 0x20000000);
    core.SP = stage;
    core.PC = stage;
  }

  send(bytes) {
    if (this.line === "usb") {
      this.usbWaiting.push(...bytes);
      this.feedUsb();
      return;
    }
    const idle = this.waiting.length === 0;
    this.waiting.push(...bytes);
    if (idle) this.arrival.schedule(this.byteNanos());
  }

  byteNanos() {
    return 1e10 / this.chip.uart[0].baudRate;
  }

  /** The emulator's UART takes no time for a byte; here bytes travel at the line's speed, both ways. */
  attachUart() {
    const uart = this.chip.uart[0];
    this.waiting = [];
    this.overruns = 0;
    this.arrival = this.clock.createAlarm(() => {
      const byte = this.waiting.shift();
      if (uart.rxFIFO.full) this.overruns += 1;
      else uart.feedByte(byte);
      if (this.waiting.length > 0) this.arrival.schedule(this.byteNanos());
    });
    const sending = [];
    const departure = this.clock.createAlarm(() => {
      if (this.line === "uart") this.onByte(sending[0], this.now());
      sending.shift();
      if (sending.length > 0) departure.schedule(this.byteNanos());
    });
    uart.onByte = (byte) => {
      sending.push(byte);
      if (sending.length === 1) departure.schedule(this.byteNanos());
    };
    const flags = Object.getOwnPropertyDescriptor(Object.getPrototypeOf(uart), "flags").get;
    Object.defineProperty(uart, "flags", {
      get: () => flags.call(uart) | (sending.length > UART_FIFO ? UART_TRANSMIT_FULL : 0),
    });
  }

  /** The emulator's USB host delivers empty packets when it has nothing to send; a real one waits until it does. */
  attachUsb() {
    this.usbWaiting = [];
    this.usbConnected = false;
    this.usbRead = null;
    const controller = this.chip.usbCtrl;
    this.usb = new USBCDC(controller);
    this.usb.onDeviceConnected = () => {
      this.usbConnected = true;
      this.feedUsb();
    };
    this.usb.onSerialData = (bytes) => {
      if (this.line === "usb") for (const byte of bytes) this.onByte(byte, this.now());
    };
    controller.onEndpointRead = (endpoint, size) => {
      if (endpoint !== this.usb.outEndpoint) return;
      this.usbRead = { endpoint, size };
      this.feedUsb();
    };
  }

  feedUsb() {
    if (!this.usbConnected || !this.usbRead || this.usbWaiting.length === 0) return;
    const { endpoint, size } = this.usbRead;
    this.usbRead = null;
    this.chip.usbCtrl.endpointReadDone(endpoint, Uint8Array.from(this.usbWaiting.splice(0, size)));
  }

  attachI2c(index) {
    const bus = this.buses[index];
    const i2c = this.chip.i2c[index];
    let pending = null;
    const alarm = this.clock.createAlarm(() => {
      const complete = pending;
      pending = null;
      complete?.();
      this.showLines();
    });
    const hertz = () => this.chip.clkSys / (i2c.fsClockHighPeriod + i2c.spikelen + 7 + i2c.fsClockLowPeriod + 1);
    const clocks = (count, complete) => {
      pending = complete;
      alarm.schedule((count * 1e9) / hertz());
    };
    const release = this.clock.createAlarm(() => {
      bus.stretched = false;
      const complete = pending === stretchedByte ? pending : null;
      if (complete) pending = null;
      complete?.();
      this.showLines();
    });
    let stretchedByte = null;
    /** A byte with its acknowledgement, and however long a chip stretches the clock behind it. */
    const byte = (complete) =>
      clocks(9, () => {
        const micros = bus.lines().scl ? bus.stretch() : 0;
        if (micros === 0) return complete();
        if (micros === Infinity) return;
        pending = stretchedByte = complete;
        bus.stretched = true;
        release.schedule(micros * 1000);
      });
    const withLines = (complete) => () => {
      const { sda, scl } = bus.lines();
      if (!scl) return; // the clock never rises, the byte never ends
      if (!sda) i2c.arbitrationLost();
      else complete();
    };
    i2c.onStart = () => clocks(1, withLines(() => i2c.completeStart()));
    i2c.onConnect = (address, mode) => byte(withLines(() => i2c.completeConnect(bus.start(address, mode === 1, hertz()))));
    i2c.onWriteByte = (value) => byte(withLines(() => i2c.completeWrite(bus.write(value))));
    i2c.onReadByte = (more) => byte(() => {
      if (bus.lines().scl) i2c.completeRead(bus.lines().sda ? bus.read(more) : 0);
    });
    i2c.onStop = () => clocks(1, () => {
      bus.stop();
      i2c.completeStop();
    });
    // The emulator knows which interrupts are pending, but does not let the firmware query them.
    const write = i2c.writeUint32.bind(i2c);
    i2c.writeUint32 = (offset, value) => {
      if (offset !== INTERRUPT_MASK) return write(offset, value);
      i2c.intEnable = value & 0x1fff;
      i2c.checkInterrupts();
    };
    // Nor does it reset peripherals.
    this.resetI2c ??= [];
    this.resetI2c[index] = () => {
      pending = null;
      alarm.cancel();
      Object.assign(i2c, { busy: false, stop: false, state: 0, pendingRestart: false, enable: 0, intEnable: 0, intRaw: 0, abortSource: 0 });
      i2c.txFIFO.reset();
      i2c.rxFIFO.reset();
    };
  }

  attachPins() {
    const resets = this.chip.peripherals[RESETS];
    const write = resets.writeUint32Atomic.bind(resets);
    resets.writeUint32Atomic = (offset, value, kind) => {
      if (offset === 0 && kind === 2) [0, 1].forEach((bus) => value & (1 << (3 + bus)) && this.resetI2c[bus]());
      write(offset, value, kind);
    };
    [0, 1].forEach((bus) => {
      const { sda, scl, reset } = pinsOf(bus);
      const low = (pin) => this.chip.gpio[pin].value === 0;
      const drive = () => {
        this.buses[bus].drive({ sda: low(sda), scl: low(scl) });
        this.showLines();
      };
      this.chip.gpio[sda].addListener(drive);
      this.chip.gpio[scl].addListener(drive);
      this.chip.gpio[reset].addListener(() => {
        if (low(reset)) this.root?.resetMultiplexers(bus);
        this.showLines();
      });
    });
    this.showLines();
  }

  attachSpi() {
    const { spi } = this;
    const [port] = this.chip.spi;
    let answer = 0;
    const done = this.clock.createAlarm(() => port.completeTransmit(answer));
    port.onTransmit = (byte) => {
      answer = spi.exchange(byte);
      done.schedule((8 * 1e9) / port.clockFrequency);
    };
    SELECTS.forEach((pin, line) => {
      this.chip.gpio[pin].addListener(() => spi.select(line, this.chip.gpio[pin].value === 0));
    });
    const { adc } = this.chip;
    adc.onADCRead = (channel) => {
      const count = this.analogue[channel]?.countAt(this.now()) ?? 0;
      adc.sampleAlarm.schedule(2000);
      adc.channelValues[channel] = count * 4;
    };
  }

  /** The levels the pins read. */
  showLines() {
    this.buses.forEach((bus, i) => {
      const { sda, scl } = bus.lines();
      this.chip.gpio[pinsOf(i).sda].setInputValue(sda);
      this.chip.gpio[pinsOf(i).scl].setInputValue(scl);
    });
  }

  /** Runs for this many emulated microseconds. */
  run(micros) {
    const { clock, chip } = this;
    const { core } = chip;
    const end = clock.nanos + micros * 1000;
    const cycle = 1e9 / 125e6;
    while (clock.nanos < end) {
      if (core.waiting) clock.tick(Math.min(clock.nextAlarm ? clock.nanosToNextAlarm : Infinity, end - clock.nanos));
      else clock.tick(core.executeInstruction() * cycle);
    }
  }
}
