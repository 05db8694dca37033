// Times ticks in WebAssembly: node web_ticks.mjs PROGRAM FOLDER PATH OUT PLAYS TICKS W X Y Z. FOLDER holds the files of a packed scene,
// PATH positions of all tools tick by tick, m; OUT gets the times of each play, us, and then the forces of the last one, N. All
// numbers are float64.

import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const [programFile, folder, pathFile, out, plays, count, ...orientation] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(readFileSync(programFile), { palpate: { now_ms: () => performance.now() } });
const run = instance.exports;

/** Puts bytes into the program's memory. */
function put(bytes) {
  const at = run.palpate_alloc(bytes.length);
  new Uint8Array(run.memory.buffer).set(bytes, at);
  return [at, bytes.length];
}

function check(status) {
  if (status < 0) throw new Error(Buffer.from(run.memory.buffer, run.palpate_text(), run.palpate_text_length()).toString());
}

for (const name of readdirSync(folder)) {
  const [name_, bytes] = [put(Buffer.from(name)), put(readFileSync(join(folder, name)))];
  run.palpate_provide(...name_, ...bytes);
  run.palpate_free(...name_);
  run.palpate_free(...bytes);
}
check(run.palpate_open());
const file = readFileSync(pathFile);
const [path] = put(file);
const [turned] = put(Buffer.from(Float64Array.from(orientation, Number).buffer));
const found = [];
let forces = null;
const ticks = Number(count);
for (let k = 0; k < Number(plays); k++) {
  check(run.palpate_times(path, file.length / 8, turned));
  const numbers = new Float64Array(run.memory.buffer, run.palpate_numbers(), run.palpate_numbers_length());
  found.push(Buffer.from(numbers.slice(0, ticks).buffer));
  forces = Buffer.from(numbers.slice(ticks).buffer);
}
writeFileSync(out, Buffer.concat([...found, forces]));
