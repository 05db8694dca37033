// Opens a scene of `palpate web` in Node and runs positions: node web_run.mjs PROGRAM SCENE POSITIONS FORCES [SHAPE].
// Positions and forces are files of numbers (float64); SHAPE is one that the page offers for the first tool.

import { readFileSync, writeFileSync } from "node:fs";
import { gunzipSync } from "node:zlib";

const [program, scene, positionsFile, forcesFile, shape] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(readFileSync(program), { palpate: { now_ms: () => performance.now() } });
const run = instance.exports;

function within(bytes, use) {
  const at = run.palpate_alloc(bytes.length);
  new Uint8Array(run.memory.buffer).set(bytes, at);
  const used = use(at, bytes.length);
  run.palpate_free(at, bytes.length);
  return used;
}

function check(status) {
  if (status >= 0) return;
  throw new Error(Buffer.from(run.memory.buffer, run.palpate_text(), run.palpate_text_length()).toString());
}

const began = performance.now();
const file = gunzipSync(readFileSync(scene));
const length = file.readUInt32LE(0);
let at = (4 + length + 7) & ~7;
let page = null;
for (const { name, size } of JSON.parse(file.subarray(4, 4 + length).toString())) {
  const bytes = file.subarray(at, at + size);
  if (!name.startsWith("page/")) {
    within(Buffer.from(name), (n, count) => within(bytes, (b, bytesLength) => run.palpate_provide(n, count, b, bytesLength)));
  }
  if (name === "page/page.bin") page = JSON.parse(bytes.subarray(4, 4 + bytes.readUInt32LE(0)).toString());
  at = (at + size + 7) & ~7;
}
check(run.palpate_open());
const opened = performance.now() - began;
const positions = readFileSync(positionsFile);
const numbers = positions.length / 8;
if (shape) {
  const command = { do: "tool", tool: 0, description: page.shapes[0][shape].description };
  within(Buffer.from(JSON.stringify(command)), (text, count) => check(run.palpate_command(text, count)));
}
within(positions, (p) => check(run.palpate_run(p, numbers)));
writeFileSync(forcesFile, new Uint8Array(run.memory.buffer, run.palpate_numbers(), 8 * run.palpate_numbers_length()));
console.log(JSON.stringify({ opened_ms: opened }));
