// Measurements in pictures on the page: cylinders of known diameter in pinhole geometry, unknown scales, and their place.
// usage: node tests/viewer/measure_page_test.mjs ROOT PROGRAMS [SEEDS]
// It prints bias and spread of each diameter and field.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { BrowserSession, checkMargins, until } from "./browser_session.mjs";

const [root, programs, seeds = "1"] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "torquer-measure-"));
const problems = [];
let session, page, cylinders, number = 1000, timeS = 1000;

const text = (selector) => page.locator(selector).textContent();
const measured = () => page.evaluate(() => window.torquer.measured());
const drawn = () => page.evaluate(() => window.torquer.drawn());

// Shows a picture as of a new moment, with fields in the readings before and after it.
async function show(index, before, after) {
  timeS += 1;
  number += 1;
  const bytes = readFileSync(join(folder, `${index}.jpg`)).toString("base64");
  await page.evaluate(([base64, shown, at, fields]) => {
    const jpeg = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const reading = (mm, timeS) => window.torquer.take({ kind: "readings", time_s: timeS, values: { xray_field_mm: mm } });
    reading(fields[0], at - 0.1);
    window.torquer.take({
      kind: "picture", held: false, lateral: false, number: shown, timeS: at, laoRad: 0, craRad: 0, width: 512, height: 512, jpeg,
    });
    reading(fields[1], at + 0.1);
  }, [bytes, number, timeS, [before, after]]);
  await until("the picture is drawn", async () => (await drawn()).picture === number);
}
const showCylinder = (cylinder) => show(cylinders.indexOf(cylinder), cylinder.field_mm, cylinder.field_mm);

async function tool(wanted) {
  for (let k = 0; k < 3 && (await text("#measure span")) !== wanted; ++k) await page.keyboard.press("KeyQ");
  assert.equal(await text("#measure span"), wanted);
}
// Clicks on points of a picture of 512 pixels; returns the result.
async function pick(canvas, ...points) {
  const box = await page.locator(canvas).boundingBox();
  for (const [column, row] of points) {
    await page.mouse.click(box.x + ((column + 0.5) / 512) * box.width, box.y + ((row + 0.5) / 512) * box.height);
  }
  return measured();
}
// Size at the isocenter of what lies at the table's height: farther from the source it is smaller.
const seen = (mm, { sod_mm, height_mm }) => (mm * sod_mm) / (sod_mm + height_mm);
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

before(async () => {
  const made = spawnSync(join(programs, "helpers/cylinder_pictures"), [folder, seeds], { encoding: "utf8" });
  assert.equal(made.status, 0, made.stderr);
  cylinders = JSON.parse(readFileSync(join(folder, "index.json"), "utf8"));
  session = await BrowserSession.start(root, programs, "neuro_angio.toml");
  page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  page.on("pageerror", (error) => problems.push(error.message));
  await page.goto(session.url);
  await until("it runs", async () => (await text("#state")).includes("Running"));
  // From here on the test is the only source of pictures and readings.
  process.kill(Number(session.read("simulator.pid")), "SIGSTOP");
});

after(async () => {
  await session?.stop();
  rmSync(folder, { recursive: true, force: true });
});

test("a distance is that of the points in space, at each field and height of the table", async () => {
  for (const height of [-100, 0, 100]) {
    for (const magnification of [1, 3]) {
      const cylinder = cylinders.find((one) => one.height_mm === height && one.magnification === magnification);
      await showCylinder(cylinder);
      await tool("Distance");
      const { distance, reason } = await pick("#xray-picture", cylinder.from, cylinder.to);
      assert.equal(reason, "");
      const errorMm = distance.mm - seen(cylinder.picked_mm, cylinder);
      assert.ok(Math.abs(errorMm) < distance.errorMm, `${errorMm} mm of ± ${distance.errorMm}`);
      assert.ok(distance.errorMm < 0.006 * cylinder.field_mm, `${distance.errorMm}`);
      assert.match(await text("#measured"), new RegExp(`^${distance.mm.toFixed(1)} ± \\d\\.\\d mm$`));
    }
  }
});

test("diameters and narrowings of vessels are those of the cylinders, within the stated error", async () => {
  const groups = new Map();
  await tool("Vessel");
  for (const cylinder of cylinders.filter(({ narrowing }) => narrowing < 1)) {
    await showCylinder(cylinder);
    const result = await pick("#xray-picture", cylinder.from, cylinder.to);
    assert.equal(result.reason, "", JSON.stringify(cylinder));
    const { diameter_mm: diameterMm, narrowing, magnification } = cylinder;
    const name = `${diameterMm} mm, ${100 * narrowing} % narrowed, field / ${magnification}`;
    if (!groups.has(name)) groups.set(name, { diameterMm, narrowing, results: [] });
    const scale = seen(1, cylinder);
    groups.get(name).results.push({
      reference: result.reference.mm / scale - diameterMm, referenceError: result.reference.errorMm / scale,
      least: result.least.mm / scale - diameterMm * (1 - narrowing), leastError: result.least.errorMm / scale,
      percent: result.narrowing.percent - 100 * narrowing, percentError: result.narrowing.error,
      pixelMm: cylinder.field_mm / 512 / scale,
    });
  }
  for (const [name, { diameterMm, narrowing, results }] of groups) {
    const of = (key) => results.map((one) => one[key]);
    const spread = (key) => Math.sqrt(mean(of(key).map((one) => (one - mean(of(key))) ** 2)));
    const say = (key, digits) => `${mean(of(key)).toFixed(digits)} ± ${spread(key).toFixed(digits)}`;
    console.log(`${name}: reference ${say("reference", 3)} mm (stated ${mean(of("referenceError")).toFixed(3)}), least ${say("least", 3)} mm `
      + `(stated ${mean(of("leastError")).toFixed(3)}), narrowing ${say("percent", 1)} % (stated ${mean(of("percentError")).toFixed(1)})`);
    const held = (key) => results.filter((one) => Math.abs(one[key]) < one[`${key}Error`]).length / results.length;
    for (const key of ["reference", "least", "percent"]) {
      assert.ok(held(key) > (results.length > 9 ? 0.9 : 0.6), `${name}: ${held(key)} of the results are within the error of ${key}`);
    }
    // Bounds are a quarter of a pixel for the mean of a few references, and 0.8 for a least diameter.
    const pixelMm = mean(of("pixelMm"));
    for (const deviation of [mean(of("reference")), spread("reference")]) {
      assert.ok(Math.abs(deviation) < 0.25 * pixelMm, `${name}: reference ${say("reference", 3)}`);
    }
    assert.ok(Math.abs(mean(of("least"))) < 0.8 * pixelMm, `${name}: least ${say("least", 3)}`);
    assert.ok(mean(of("leastError")) < 1.6 * pixelMm, `${name}: least ${say("leastError", 3)}`);
  }
});

test("millimeters are null where the scale is not known, with the reason", async () => {
  const cylinder = cylinders.find(({ height_mm, magnification }) => height_mm === 0 && magnification === 2);
  const index = cylinders.indexOf(cylinder);
  await tool("Vessel");
  await show(index, cylinder.field_mm, cylinder.field_mm / 1.5);
  const between = await pick("#xray-picture", cylinder.from, cylinder.to);
  assert.equal(between.reason, "its field is not known");
  const px = (cylinder.diameter_mm / cylinder.field_mm) * 512;
  assert.ok(Math.abs(between.reference.px - px) < 0.02 * px, `${between.reference.px} of ${px}`);
  for (const { mm, errorMm } of [between.reference, between.least, between.distance]) assert.deepEqual([mm, errorMm], [null, null]);
  assert.ok(between.narrowing.percent < 10);
  assert.match(await text("#measured"), /least [\d.]+ px, reference [\d.]+ px, narrowing \d+ ± \d+ %; no mm: its field is not known$/);
});

test("places without a vessel, and points too close, are refused with the reason", async () => {
  const cylinder = cylinders.find(({ height_mm, magnification }) => height_mm === 0 && magnification === 2);
  await showCylinder(cylinder);
  const beside = await pick("#xray-picture", [40, 40], [140, 40]);
  assert.equal(beside.reason, "no dark vessel between the points");
  assert.deepEqual([beside.distance, beside.least, beside.reference, beside.narrowing], [null, null, null, null]);
  const close = await pick("#xray-picture", cylinder.from, [cylinder.from[0] + 6, cylinder.from[1]]);
  assert.equal(close.reason, "the points are too close to each other");
  assert.equal(await text("#measured"), "Not measured: the points are too close to each other");
  const closed = cylinders.find(({ narrowing }) => narrowing === 1);
  await showCylinder(closed);
  assert.equal((await pick("#xray-picture", closed.from, closed.to)).reason, "a part between the points is too faint");
});

test("the drawing lies on the picked points and on both edges, also if the picture is magnified", async () => {
  const cylinder = cylinders.find(({ diameter_mm, magnification, height_mm }) => diameter_mm === 8 && magnification === 1 && height_mm === 0);
  await showCylinder(cylinder);
  await tool("Vessel");
  const { from, to } = cylinder;
  await pick("#xray-picture", from, to);
  const lines = await page.locator("#plane .measured polyline").evaluateAll((all) =>
    all.map((line) => [...line.points].map(({ x, y }) => [x, y])));
  assert.equal(lines.length, 7, "two crosses, two edges, and the narrowest place");
  const [across, , edge, otherEdge] = [lines[0], lines[1], lines[4], lines[5]];
  const center = [mean(across.map(([x]) => x)), mean(across.map(([, y]) => y))];
  assert.ok(Math.hypot(center[0] - from[0], center[1] - from[1]) < 1, `${center} is not ${from}`);
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  const radiusPx = (256 * cylinder.diameter_mm) / cylinder.field_mm;
  for (const [line, side] of [[edge, -1], [otherEdge, 1]]) {
    const away = line.map(([x, y]) => ((y - from[1]) * (to[0] - from[0]) - (x - from[0]) * (to[1] - from[1])) / length);
    assert.ok(Math.abs(mean(away) - side * radiusPx) < 0.3, `${mean(away)} is not ${side * radiusPx}`);
    assert.ok(away.every((one) => Math.abs(one - side * radiusPx) < 1.5));
  }
  const box = await page.locator("#xray-picture").boundingBox();
  await page.mouse.move(box.x + box.width / 3, box.y + box.height / 3);
  await page.mouse.wheel(0, -400);
  await until("it is magnified", async () => (await text("#window")).startsWith("×"));
  const boxes = await page.evaluate(() => ["#xray-picture", "#plane .measured"].map((selector) => {
    const { x, y, width, height } = document.querySelector(selector).getBoundingClientRect();
    return [x, y, width, height].map(Math.round);
  }));
  assert.deepEqual(boxes[0], boxes[1]);
  await tool("Measure");
  await page.mouse.dblclick(box.x + box.width / 3, box.y + box.height / 3);
  await until("the usual size", async () => !(await text("#window")).startsWith("×"));
});

test("another picture takes the measurement; the stored one keeps it", async () => {
  const cylinder = cylinders.find(({ diameter_mm, magnification }) => diameter_mm === 4 && magnification === 2);
  await showCylinder(cylinder);
  await tool("Vessel");
  await pick("#xray-picture", cylinder.from, cylinder.to);
  assert.ok((await measured()) !== null);
  const stored = (await drawn()).picture;
  await page.keyboard.press("KeyO");
  await until("it is stored", async () => (await drawn()).reference === stored);
  await showCylinder(cylinders[0]);
  assert.equal(await measured(), null);
  assert.equal(await page.locator("#plane .measured polyline").count(), 0);
  const { reference } = await pick("#reference-picture", cylinder.from, cylinder.to);
  assert.ok(Math.abs(reference.mm - seen(4, cylinder)) < 0.08, `${reference.mm}`);
  await showCylinder(cylinders[1]);
  assert.ok((await measured()) !== null, "a live picture has taken the measurement of the stored one");
  await checkMargins(page, ["#xray-picture"], [[1280, 720], [1600, 900], [1920, 1080], [1024, 768], [420, 860], [860, 420]], 0.3);
  await tool("Measure");
  assert.equal(await measured(), null);
  assert.deepEqual(problems, []);
});
