// Biplane page: two planes side by side, each measured, in a scene with all effects. The cost of each effect.
// usage: node tests/viewer/biplane_page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { BrowserSession, checkMargins, until } from "./browser_session.mjs";

const [root, programs] = process.argv.slice(2);
let session;
let page;

before(async () => {
  session = await BrowserSession.start(root, programs, "everything.toml");
  page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(session.url);
  await until("the scene is there", () => page.evaluate(() =>
    window.torquer.scene() !== null && window.torquer.state() !== null && window.torquer.viewer()?.steer));
});
after(() => session?.stop());

// Mean gray of a canvas, and of its left and right half.
const grays = (selector) => page.evaluate((canvas) => {
  const shown = document.querySelector(canvas);
  const { width, height } = shown;
  const pixels = shown.getContext("2d").getImageData(0, 0, width, height).data;
  const sums = [0, 0];
  for (let i = 0; i < width * height; ++i) sums[i % width < width / 2 ? 0 : 1] += pixels[4 * i];
  return sums.map((sum) => (2 * sum) / (width * height));
}, selector);

test("both planes take pictures with the pedal, each from its side", async () => {
  assert.deepEqual(await grays("#lateral-picture"), [0, 0]);
  await page.keyboard.down("Space");
  await until("both planes have a picture", async () =>
    (await grays("#xray-picture"))[0] > 0 && (await grays("#lateral-picture"))[0] > 0);
  assert.equal(await page.locator("#lateral-angles").textContent(), "LAO 90°  CRA 0°");
  assert.equal(await page.locator("#lao").textContent(), "LAO 0°");
  assert.deepEqual(await page.locator("#sides span").allTextContents(), ["R", "L", "H", "F"]);
  assert.deepEqual(await page.locator("#lateral-sides span").allTextContents(), ["A", "P", "H", "F"]);
  // From the front the left lung is bright in the right half. From the side the lungs cover both halves.
  const [front, side] = [await grays("#xray-picture"), await grays("#lateral-picture")];
  assert.ok(front[1] - front[0] > side[1] - side[0] + 15, `${front} from the front, ${side} from the side`);
  const [a, b] = await Promise.all(["#xray-picture", "#lateral-picture"].map((canvas) => page.locator(canvas).boundingBox()));
  assert.ok(a.x + a.width <= b.x && Math.abs(a.y - b.y) < 1 && Math.abs(a.width - b.width) < 1, "side by side, as large");
});

test("no text covers a plane, and none is cut off, in any window", async () => {
  await checkMargins(page, ["#xray-picture", "#lateral-picture"], [[1280, 720], [1600, 900], [1920, 1080], [1024, 768], [420, 860], [860, 420]], 0.25);
});

test("window and level are those of both, the C-arm's angle is not", async () => {
  const before = await grays("#lateral-picture");
  const box = await page.locator("#xray-picture").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2 + 60, { steps: 5 });
  await page.mouse.up();
  await until("both are darker", async () => (await grays("#lateral-picture"))[1] < before[1] - 30);
  await page.keyboard.down("KeyD");
  await until("the C-arm has turned", async () => Number((await page.locator("#lao").textContent()).match(/\d+/)[0]) >= 10);
  await page.keyboard.up("KeyD");
  assert.equal(await page.locator("#lateral-angles").textContent(), "LAO 90°  CRA 0°");
  await page.keyboard.up("Space");
});

test("every effect of the scene has its price, and effects that are not simulated are named", async () => {
  await page.keyboard.down("ArrowUp");
  await page.locator("#prices summary").click();
  const { effects, off } = await page.evaluate(() => window.torquer.scene());
  const rows = () => page.evaluate(() => {
    const [terms, values] = ["dt", "dd"].map((tag) => [...document.querySelectorAll(`#prices ${tag}`)].map((shown) => shown.textContent));
    return Object.fromEntries(terms.map((term, k) => [term, values[k]]));
  });
  const priced = await until("the prices are there", async () => {
    const shown = await rows();
    return Object.keys(shown).length > effects.length && parseFloat(shown.friction) > 0 ? shown : null;
  });
  await page.keyboard.up("ArrowUp");
  for (const effect of effects) assert.match(priced[effect.replaceAll("_", " ")] ?? "", /^([\d.e−]+ µs|part of wire and wall)$/, effect);
  for (const effect of ["torsion", "clearance", "self contact", "heartbeat"]) assert.equal(priced[effect], "part of wire and wall", effect);
  assert.match(priced["wire and wall"], /^\d.* µs$/);
  assert.match(priced["X-ray picture, beside the ticks"], /^\d.* ms$/);
  assert.ok(off.includes("point_load") && !off.some((name) => effects.includes(name)));
  assert.ok((await page.locator("#prices-off").textContent()).startsWith("Not simulated: "));
});

test("the second plane is measured with its own field, and keeps its measurement beside new pictures of the first", async () => {
  const [FIELD_MM, RADIUS_PX] = [120, 14];
  process.kill(Number(session.read("simulator.pid")), "SIGSTOP");
  // A picture on its way would replace those of this test.
  await until("the last message has arrived", async () => {
    const shown = () => page.evaluate(() => JSON.stringify([window.torquer.state().tick, window.torquer.drawn()]));
    const before = await shown();
    await page.waitForTimeout(1000);
    return (await shown()) === before;
  });
  // An upright cylinder: the mean chord over each pixel, blurred by 1/4 1/2 1/4.
  const show = (number, lateral) => page.evaluate(async ([number, lateral, fieldMm, radius]) => {
    const chord = (x) => 2 * Math.sqrt(Math.max(radius ** 2 - x ** 2, 0));
    const over = (x) => Array.from({ length: 16 }, (_, k) => chord(x + (k - 7.5) / 16)).reduce((sum, one) => sum + one / 16, 0);
    const canvas = new OffscreenCanvas(512, 512);
    const screen = canvas.getContext("2d");
    for (let column = 0; column < 512; ++column) {
      const x = column - 255.5;
      const gray = Math.round(160 - 2 * (over(x - 1) / 4 + over(x) / 2 + over(x + 1) / 4));
      screen.fillStyle = `rgb(${gray} ${gray} ${gray})`;
      screen.fillRect(column, 0, 1, 512);
    }
    const jpeg = new Uint8Array(await (await canvas.convertToBlob({ type: "image/png" })).arrayBuffer());
    const timeS = number;
    window.torquer.take({ kind: "picture", held: false, lateral, number, timeS, laoRad: 1.5, craRad: 0, width: 512, height: 512, jpeg });
    for (const time_s of [timeS - 0.1, timeS + 0.1]) {
      window.torquer.take({ kind: "readings", time_s, values: { xray_field_mm: 77, lateral_xray_field_mm: fieldMm } });
    }
  }, [number, lateral, FIELD_MM, RADIUS_PX]);
  const drawn = (plane) => page.evaluate((plane) => window.torquer.drawn()[plane], plane);
  const measured = () => page.evaluate(() => window.torquer.measured());
  await show(1001, true);
  await until("the cylinder is drawn", async () => (await drawn("lateral")) === 1001);
  for (let k = 0; k < 3 && (await page.locator("#measure span").textContent()) !== "Vessel"; ++k) await page.keyboard.press("KeyQ");
  const box = await page.locator("#lateral-picture").boundingBox();
  for (const share of [0.3, 0.6]) await page.mouse.click(box.x + box.width / 2, box.y + share * box.height);
  const { reference, reason } = await measured();
  assert.equal(reason, "");
  const expectedMm = (2 * RADIUS_PX * FIELD_MM) / 512;
  assert.ok(Math.abs(reference.mm - expectedMm) < (0.15 * FIELD_MM) / 512, `${reference.mm} mm is not ${expectedMm}`);
  assert.equal(await page.locator("#lateral .measured polyline").count(), 7);
  await show(1002, false);
  await until("the first plane has it too", async () => (await drawn("picture")) === 1002);
  assert.ok((await measured()) !== null);
  await show(1003, true);
  await until("a new picture takes it", async () => (await measured()) === null);
  assert.equal(await page.locator("#lateral .measured polyline").count(), 0);
});

test("the margin has the sum of both planes' doses", async () => {
  const dose = (values) => page.evaluate((values) => {
    window.torquer.take({ kind: "readings", time_s: 2000, values });
    return [...document.querySelectorAll("#dose dt")].map((term) => `${term.textContent}: ${term.nextElementSibling.textContent}`);
  }, values);
  const known = { air_kerma_mGy: 1.25, lateral_air_kerma_mGy: 2.5, kerma_area_Gy_cm2: 0.5, lateral_kerma_area_Gy_cm2: 0.25 };
  for (const line of ["Air kerma A+B: 3.75 mGy", "Kerma × area A+B: 0.750 Gy cm²"]) assert.ok((await dose(known)).includes(line), line);
  assert.ok((await dose({ ...known, lateral_air_kerma_mGy: null })).includes("Air kerma A+B: not known"));
});
