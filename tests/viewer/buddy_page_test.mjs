// 3D view of a scene in which one wire lies beside another.
// usage: node tests/viewer/buddy_page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { BrowserSession, until } from "./browser_session.mjs";

const WIRE = "max_length_mm = 200\nradius_mm = 0.2\nrigidity_N_mm2 = 6.35e-3\ninserted_at_start_mm =";
const SCENE = `name = "buddy"
[vessel]
kind = "ty_phantom"
wall_stiffness_N_mm2 = 0.01
[entry]
centerline = "main"
at_mm = 1
[[instrument]]
name = "guidewire"
${WIRE} 60
[[instrument]]
name = "buddy"
${WIRE} 90
[instrument.entry]
centerline = "main"
at_mm = 1
offset_mm = [0.6, -0.8]
`;

const [root, programs] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "torquer-buddy-"));
let session, page;

before(async () => {
  const scene = join(folder, "buddy.toml");
  writeFileSync(scene, SCENE);
  session = await BrowserSession.start(root, programs, scene);
  page = await session.browser.newPage({ viewport: { width: 1024, height: 600 } });
  await page.goto(session.url);
});

after(async () => {
  await session?.stop();
  rmSync(folder, { recursive: true, force: true });
});

test("only the innermost curve has colors of contact, and another one is gray", async () => {
  const [inner, beside] = await until("both wires are drawn", () => page.evaluate(() => {
    const space = window.torquer?.space;
    return space?.drawn() != null && [0, 1].every((k) => space.tubeMm(k).length > 1) && [0, 1].map((k) => space.tubeColor(k));
  }));
  assert.equal(beside, "8a959d");
  assert.notEqual(inner, beside);
});

test("a wire beside another is drawn along its own nodes", async () => {
  const { state, tubes } = await until("both wires are drawn", () => page.evaluate(() => {
    const space = window.torquer?.space;
    const state = space?.drawn();
    if (state == null) return null;
    const tubes = [0, 1].map((k) => space.tubeMm(k));
    return tubes.every((tube) => tube.length > 1) && { state: { tips: state.instruments.map(({ tipMm }) => tipMm) }, tubes };
  }));
  const apart = (a, b) => Math.hypot(...a.map((value, axis) => value - b[axis]));
  assert.ok(Math.abs(apart(tubes[0][0], tubes[1][0]) - 1) < 1e-3, "1 mm apart at the entry");
  for (const [k, lengthMm] of [60, 90].entries()) {
    const tube = tubes[k];
    assert.ok(apart(tube.at(-1), state.tips[k]) < 1e-3, `tube ${k} ends at its tip`);
    const along = tube.slice(1).reduce((sum, middle, i) => sum + apart(middle, tube[i]), 0);
    assert.ok(Math.abs(along - lengthMm) < 0.01, `tube ${k} has ${along} mm`);
  }
});
