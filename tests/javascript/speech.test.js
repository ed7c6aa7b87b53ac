import assert from "node:assert/strict";
import test from "node:test";
import { spoken } from "../../cinegen/cockpit/static/base/speech.js";

test("units and signs are read as words", () => {
  const texts = {
    "-12.5°": "minus 12.5 degrees",
    "0.250 rad": "0.250 radians",
    "out of reach by 12.3 mm": "out of reach by 12.3 millimetres",
    "−0.4000 m": "minus 0.4000 metres",
    "29 °/s": "29 degrees per second",
    "1000 mm/s": "1000 millimetres per second",
    "100 /s": "100 per second",
    "642 N m · 81 %": "642 newton metres, 81 percent",
    "12.3 kN": "12.3 kilonewtons",
    "3 kg": "3 kilograms",
    "× 2.5": "times 2.5",
    "–": "no value",
    "joint-1 at its limit": "joint-1 at its limit",
    "link3 m2": "link3 m2",
  };
  for (const [text, words] of Object.entries(texts)) assert.equal(spoken(text), words);
});
