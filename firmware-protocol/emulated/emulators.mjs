// The chip emulators from npm. `firmware-protocol/emulated/run` installs them under target/emulators, not here.
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";

const folder = process.env.ARMATURE_EMULATORS ?? fileURLToPath(new URL("../../target/emulators", import.meta.url));

/** avr8js or rp2040js. */
export const emulator = (name) => createRequire(`${folder}/`)(name);
