// Which board a firmware file is for.
import { Nano } from "./nano.mjs";
import { Pico } from "./pico.mjs";

export function boardOf(file, options) {
  if (file.endsWith(".hex")) return new Nano(file);
  if (file.endsWith(".uf2")) return new Pico(file, options);
  throw new Error(`${file} is not a known kind of firmware file (.hex, .uf2)`);
}
