// Measurements in pictures on the page: cylinders of known diameter in pinhole geometry, unknown scales, and their place.
// Masks by hand: patterns that move by parts of a pixel, in closed form.
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
  const cylinder = cylinders.find((one) => one.height_mm === 0 && one.magnification === 2 && one.diameter_mm === 8);
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

// A pattern of waves that is moved to the right and down, and a bar of contrast agent. Its grays are closed forms.
const BAR = { from: 300, to: 340, gray: 20 };
async function showPattern({ right = 0, down = 0, bar = false, lift = 0, laoRad = 0, stepS = 1, readings = {} }) {
  timeS += stepS;
  number += 1;
  await page.evaluate(async ({ right, down, bar, lift, laoRad, readings, timeS, number, BAR }) => {
    const canvas = new OffscreenCanvas(512, 512);
    const screen = canvas.getContext("2d");
    const image = screen.createImageData(512, 512);
    for (let row = 0; row < 512; ++row) {
      for (let column = 0; column < 512; ++column) {
        const [x, y] = [column - right, row - down];
        const waves = 25 * Math.sin((2 * Math.PI * x) / 9) + 25 * Math.sin((2 * Math.PI * (0.4 * x + y)) / 13);
        const dye = bar && column >= BAR.from && column < BAR.to ? BAR.gray : 0;
        const at = 4 * (512 * row + column);
        image.data.fill(Math.round(130 + lift + waves - dye), at, at + 3);
        image.data[at + 3] = 255;
      }
    }
    screen.putImageData(image, 0, 0);
    const jpeg = new Uint8Array(await (await canvas.convertToBlob({ type: "image/png" })).arrayBuffer()); // without loss
    const values = { xray_field_mm: 200, picture_mode: 0, picture_instrument: 0, picture_contrast: 0, table_left_mm: 0, ...readings };
    window.torquer.take({ kind: "picture", held: false, lateral: false, number, timeS, laoRad, craRad: 0, width: 512, height: 512, jpeg });
    for (const at of [0, 0.01]) window.torquer.take({ kind: "readings", time_s: timeS + at, values });
  }, { right, down, bar, lift, laoRad, readings, timeS, number, BAR });
  await until("the pattern is drawn", async () => (await drawn()).picture === number);
}
// Mean and deviation of the grays on a canvas between two columns, away from the edges.
const grays = (from, to, canvas = "#xray-picture") => page.evaluate(([from, to, canvas]) => {
  const { data } = document.querySelector(canvas).getContext("2d").getImageData(from, 40, to - from, 430);
  const values = Array.from({ length: data.length / 4 }, (_, k) => data[4 * k]);
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  return { mean, sd: Math.sqrt(values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length) };
}, [from, to, canvas]);
const press = async (...keys) => { for (const key of keys) await page.keyboard.press(key); };
const near = (value, expected, bound, what) => assert.ok(Math.abs(value - expected) < bound, `${what}: ${value} is not ${expected}`);
const EVEN = 0.78 * 255; // as the simulator's own subtraction
const ROUNDING = 1.5 * Math.sqrt(2 / 12); // of two pictures, at 1.5 times the gain

test("a mask that is moved like the patient leaves the contrast agent alone", async () => {
  await showPattern({});
  await press("KeyN");
  near((await grays(40, 470)).mean, EVEN, 1, "the mask itself");
  await showPattern({ right: 1.5, down: -0.75, bar: true });
  const before = await grays(40, 280);
  // A wave of 25 that moved by an angle leaves 2 * 25 * sin(angle / 2), at 1.5 times the gain.
  const left = [(2 * Math.PI * 1.5) / 9, (2 * Math.PI * (0.4 * 1.5 - 0.75)) / 13].map((angle) => 1.5 * 50 * Math.sin(Math.abs(angle) / 2));
  near(before.sd, Math.hypot(...left) / Math.SQRT2, 0.7, "the edges of what moved");
  await press(...Array(6).fill("Digit6"), ...Array(3).fill("Numpad8"));
  assert.deepEqual((await page.evaluate(() => window.torquer.mask())).shift, [1.5, -0.75]);
  assert.equal(await text("#mask-shift"), "→ 1.50 ↑ 0.75 px");
  const beside = await grays(40, 280);
  near(beside.mean, EVEN, 0.5, "the gray beside the agent");
  assert.ok(beside.sd < ROUNDING + 0.2, `${beside.sd} beside the agent`);
  const inside = await grays(BAR.from + 2, BAR.to - 2);
  near(beside.mean - inside.mean, 1.5 * BAR.gray, 0.5, "the agent");
  await page.locator("#mask-4").click();
  await page.locator("#mask-2").click();
  assert.equal(await text("#mask-shift"), "→ 1.25 ↑ 0.50 px");
  await press("Digit5");
  near((await grays(40, 280)).sd, before.sd, 0.01, "after a reset");
  await press("Digit0");
  near((await grays(40, 280)).mean, 130, 0.5, "without a mask");
  assert.equal(await page.evaluate(() => window.torquer.mask()), null);
});

test("a picture of a subtracted run becomes the mask, and cannot move", async () => {
  const readings = { picture_mode: 1 };
  await showPattern({ lift: 10, readings });
  await press("KeyN");
  await showPattern({ lift: -7, readings });
  const { mean: shown, sd } = await grays(40, 470);
  near(shown, EVEN - 17, 0.6, "the difference");
  assert.ok(sd < 0.6, `${sd}`);
  await press("Digit6");
  assert.equal(await text("#mask-text"), "Only the mask of a plain run moves");
  near((await grays(40, 470)).sd, sd, 0.01, "the picture");
  await press("Digit0");
});

test("a mask serves its own view and display, and says what it should not have", async () => {
  await showPattern({ readings: { picture_instrument: 1, picture_contrast: 1 } });
  await press("KeyN");
  assert.match(await text("#mask-text"), /^Mask at \d+:\d\d min, with instrument and contrast$/);
  for (const other of [{ laoRad: 0.1 }, { readings: { table_left_mm: 5 } }, { readings: { xray_field_mm: 100 } }, { readings: { picture_mode: 1 } }]) {
    await showPattern(other);
    await until("it is not subtracted", async () => Math.abs((await grays(40, 470)).mean - 130) < 1);
    assert.equal(await text("#mask-text"), "Mask of another view");
  }
  // Cine has the grays of a plain picture.
  await showPattern({ readings: { picture_mode: 3 } });
  await until("it is subtracted again", async () => Math.abs((await grays(40, 470)).mean - EVEN) < 1);
  await showPattern({ readings: { picture_mode: 2 } });
  await press("KeyN");
  assert.equal(await text("#mask-text"), "No mask from a road map");
  await press("Digit0");
  await showPattern({ stepS: 3, readings: { picture_mode: 1, picture_instrument: 1 } }); // a new run
  assert.equal(await text("#mask-text"), "Mask, with instrument", "the simulator's own mask");
});

test("a stopped loop gives the mask, and a stored picture stays as it was shown", async () => {
  await showPattern({ lift: 0, stepS: 3 });
  const first = number;
  for (const lift of [5, 10]) await showPattern({ lift, stepS: 0.1 });
  await press("Comma", "Comma");
  await until("the first picture is drawn", async () => (await drawn()).picture === first);
  assert.match(await text("#loop-number"), /, picture 1 of 3$/);
  await press("KeyN", "Period");
  await until("the second one is", async () => (await drawn()).picture === first + 1);
  near((await grays(40, 470)).mean, EVEN + 7.5, 0.6, "the second picture");
  await press("KeyO");
  await until("it is stored", async () => (await drawn()).reference === first + 1);
  await press("Digit0");
  near((await grays(40, 470)).mean, 135, 0.6, "the picture without a mask");
  near((await grays(40, 470, "#reference-picture")).mean, EVEN + 7.5, 0.6, "the stored picture");
  await press("KeyN");
  await checkMargins(page, ["#xray-picture"], [[1280, 720], [1024, 768], [420, 860], [860, 420]], 0.3);
  await press("Digit0", "KeyL");
  assert.deepEqual(problems, []);
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
