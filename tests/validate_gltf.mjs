// Runs the Khronos glTF validator on files and fails on any error or warning.
//
//   npm install gltf-validator
//   node tests/validate_gltf.mjs FILE.glb [MORE.glb ...]
//
// The package is searched for in the current folder and its parents, or in the folder that NODE_MODULES names.

import { createRequire } from 'node:module';
import { readFileSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error('usage: node validate_gltf.mjs FILE.glb [MORE.glb ...]');
  process.exit(2);
}

function loadValidator() {
  const folders = [process.env.NODE_MODULES && dirname(resolve(process.env.NODE_MODULES)), process.cwd()];
  for (const folder of folders.filter(Boolean)) {
    try {
      return createRequire(join(folder, 'here.js'))('gltf-validator');
    } catch (error) {
      if (error.code !== 'MODULE_NOT_FOUND') throw error;
    }
  }
  console.error('gltf-validator is not installed here: run "npm install gltf-validator" first');
  process.exit(2);
}

const validator = loadValidator();
const severities = ['error', 'warning', 'information', 'hint'];
let failed = false;
for (const file of files) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), {
    uri: file,
    maxIssues: 1000,
    externalResourceFunction: (uri) =>
      Promise.resolve(new Uint8Array(readFileSync(join(dirname(file), decodeURIComponent(uri))))),
  });
  const { numErrors, numWarnings, numInfos, messages } = report.issues;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} remarks`);
  for (const { severity, code, message, pointer } of messages) {
    console.log(`  ${severities[severity]} ${code} ${pointer ?? ''}: ${message}`);
  }
  failed ||= numErrors > 0 || numWarnings > 0;
}
process.exit(failed ? 1 : 0);
