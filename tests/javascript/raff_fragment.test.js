import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { deflateRawSync } from "node:zlib";

import { decode, encode, FragmentError, LARGEST } from "../../cinegen/page/static/raff/fragment.js";

const robots = new URL("../../robots/", import.meta.url);
const packed = (/** @type {string | Uint8Array} */ data) => deflateRawSync(data).toString("base64url");

test("text returns from an address as it was, and is a quarter as long there", async () => {
  const texts = readdirSync(robots).filter((name) => name.endsWith(".raff")).map((name) => readFileSync(new URL(name, robots), "utf8"));
  assert.ok(texts.length > 15);
  let before = 0;
  let after = 0;
  for (const text of ["", "\ufeffRAFF é 🦾 \0\r\n", ...texts]) {
    const fragment = await encode(text);
    assert.match(fragment, /^[\w-]*$/);
    assert.equal(await decode(fragment), text);
    before += text.length;
    after += fragment.length;
  }
  assert.ok(after < 0.6 * before, `${after} of ${before}`);
});

test("the address is that of any deflate", async () => {
  assert.equal(await decode(packed("RAFF t")), "RAFF t");
});

test("what decompresses to more than the limit is refused, and not decompressed", async () => {
  const bomb = packed(new Uint8Array(2e8)); // 0.2 GB of zeros in 0.26 MB
  assert.ok(bomb.length < 2 * LARGEST);
  const began = process.memoryUsage().arrayBuffers;
  await assert.rejects(decode(bomb), { constructor: FragmentError, message: /more than 1000000 bytes/ });
  assert.ok(process.memoryUsage().arrayBuffers - began < 5e7);
  await assert.rejects(decode(packed(new Uint8Array(LARGEST + 1))), FragmentError);
  assert.equal((await decode(packed("x".repeat(LARGEST)))).length, LARGEST);
  await assert.rejects(encode("x".repeat(LARGEST + 1)), FragmentError);
  await assert.rejects(decode("A".repeat(2 * LARGEST + 1)), { message: /too long/ });
});

test("a text that can't be compressed is in no address", async () => {
  let state = 1;
  const noise = Array.from({ length: 300_000 }, () => String.fromCharCode(32 + ((state = (state * 48271) % 2147483647) % 95))).join("");
  assert.ok(packed(noise).length > 140_000);
  await assert.rejects(encode(noise), { constructor: FragmentError, message: /keep it in a file/ });
});

test("a damaged address is an error that says so", async () => {
  const fragment = await encode("RAFF t\nrobot r { link 1 { type 2 pred 0 } }");
  const damaged = [
    fragment.slice(0, -3), `x${fragment}`, "A", "____", "%3Cscript%3E", "é", "a b", "a=",
    packed(Uint8Array.of(0xff, 0xfe)),
  ];
  for (const one of damaged) await assert.rejects(decode(one), FragmentError, one);
});
