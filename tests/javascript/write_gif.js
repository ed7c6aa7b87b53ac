// Write a GIF of frames, see tests/cockpit/test_gif.py: node write_gif.js FOLDER. FOLDER/frames.json holds { width, height,
// delay, count }, FOLDER/N.rgba the pixels of each frame; the GIF is FOLDER/out.gif.

import { readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";

import { Gif } from "../../cinegen/cockpit/static/film/gif.js";

const folder = process.argv[2];
const { count, delay, ...options } = JSON.parse(await readFile(join(folder, "frames.json"), "utf8"));
const gif = new Gif(options);
for (let i = 0; i < count; i += 1) gif.add(new Uint8ClampedArray((await readFile(join(folder, `${i}.rgba`))).buffer.slice(0)), delay);
await writeFile(join(folder, "out.gif"), gif.end());
