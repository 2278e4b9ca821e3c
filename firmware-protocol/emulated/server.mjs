// A board on a TCP port, instead of its serial or USB port.
import { createServer } from "node:net";

const SLICE_MICROS = 2000;

/**
 * Runs the board and connects hosts to it, one at a time. The emulated clock runs no faster than real time; if the machine
 * is too slow for that it runs slower, and nothing else changes: all times are the board's.
 *
 * `bootMillis`: opening the port resets the board, as DTR does on an Arduino, and its boot loader then has the line for
 * this long: anything the host sends meanwhile is lost.
 */
export async function serveBoard(board, { port = 0, bootMillis = 0 } = {}) {
  let host = null;
  let outgoing = [];
  let booting = 0;
  board.onByte = (byte) => outgoing.push(byte);
  const server = createServer((socket) => {
    host?.destroy();
    host = socket;
    if (bootMillis > 0) {
      board.powerUp();
      outgoing = [];
      booting = performance.now() + bootMillis;
    }
    socket.setNoDelay(true);
    socket.on("data", (bytes) => {
      if (performance.now() >= booting) board.send(bytes);
    });
    socket.on("error", () => {});
    socket.on("close", () => {
      if (host === socket) host = null;
    });
  });
  await new Promise((listening) => server.listen(port, "127.0.0.1", listening));

  const began = performance.now();
  const from = board.now();
  let behind = 0; // real milliseconds that the emulator has fallen behind
  let stopped = false;
  const slice = () => {
    if (stopped) return;
    if (performance.now() < booting) {
      behind = performance.now() - began - (board.now() - from) / 1000;
      setTimeout(slice, 5);
      return;
    }
    board.run(SLICE_MICROS);
    if (outgoing.length > 0) host?.write(Uint8Array.from(outgoing));
    outgoing = [];
    const early = (board.now() - from) / 1000 + behind - (performance.now() - began);
    if (early < 0) behind -= early;
    if (early > 1) setTimeout(slice, early);
    else setImmediate(slice);
  };
  slice();
  return {
    address: `tcp:127.0.0.1:${server.address().port}`,
    stop() {
      stopped = true;
      host?.destroy();
      server.close();
    },
  };
}
