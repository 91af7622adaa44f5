// The room in headless Chromium, with the real simulator behind it: the tube, the table, and the reference picture.
// usage: node tests/viewer/room_page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { BrowserSession, holdKey, until } from "./browser_session.mjs";

const [root, programs] = process.argv.slice(2);
let session, page;

const text = (selector) => page.locator(selector).textContent();
const pixels = (selector) => page.evaluate((canvas) => document.querySelector(canvas).toDataURL(), selector);
const hold = (key, what, condition) => holdKey(page, key, what, condition);

before(async () => {
  session = await BrowserSession.start(root, programs, "neuro_angio.toml");
  page = await session.browser.newPage({ viewport: { width: 1024, height: 600 } });
  await page.goto(session.url);
  await until("it runs", async () => (await text("#state")).includes("Running"));
});

after(() => session?.stop());

test("the tube's figures and the rate of the dose are those of the pulses", async () => {
  const tube = async () => (await text("#dose")).match(/Tube(\d+) kV ([\d.–]+) mA/)?.slice(1);
  await until("the figures", async () => (await tube()) !== undefined);
  assert.deepEqual(await tube(), ["80", "–"]);
  assert.equal(await text("#source-distance"), "SID 105 cm");
  const currents = [];
  for (const mode of ["as scene", "plain"]) {
    await until(mode, async () => (await text("#system-M span")) === mode);
    const before = (await tube())[1];
    let rate;
    await hold("Space", "a pulse of this mode", async () => {
      rate = (await text("#hold")).match(/^([\d.]+) mGy\/min$/)?.[1];
      const now = (await tube())[1];
      // 15 pulses a second of 8 ms, with 0.06 mGy/(mA s) at 1 m, 0.6 m from the tube. Both are shown with three digits.
      return now !== before && rate !== undefined && Math.abs(rate / now / (15 * 60 * 8e-3 * 0.06 / 0.36) - 1) < 0.01;
    });
    currents.push(Number((await tube())[1]));
    await page.keyboard.press("KeyM");
  }
  assert.ok(Math.abs(currents[0] / currents[1] - 10) < 0.1, `a subtracted picture has ten times the dose: ${currents}`);
  for (let k = 0; k < 3; ++k) await page.keyboard.press("KeyM");
  await until("the scene's display", async () => (await text("#system-M span")) === "as scene");
});

test("an acquisition has its own pedal, display and pulses, and fluoroscopy follows with its own", async () => {
  const mode = () => page.evaluate(() => window.torquer.readings().values.picture_mode);
  // Pulses a second, by the rate of the dose and the current of a pulse.
  const pulses = async () => {
    const rate = (await text("#hold")).match(/^([\d.]+) mGy\/min$/)?.[1];
    const current = (await text("#dose")).match(/kV ([\d.]+) mA/)?.[1];
    return rate / current / (60 * 8e-3 * 0.06 / 0.36);
  };
  const near = (rate) => async () => Math.abs((await pulses()) / rate - 1) < 0.01;
  await page.keyboard.press("KeyM");
  const shows = (kind) => until(kind, async () =>
    (await text("#pad-kind")) === kind && (await text("#system-acquisition span")) === `acquires ${kind}`);
  await shows("cine 15/s");
  await hold("Enter", "cine", async () => (await mode()) === 3 && near(15)());
  for (let k = 0; k < 3; ++k) await page.keyboard.press("Minus");
  await shows("subtraction 3/s");
  await until("the hint", async () => (await text("#hint")).includes("Enter subtraction 3/s"));
  await hold("Enter", "a subtraction", async () => (await mode()) === 1 && near(3)());
  assert.equal(await text("#system-M span"), "plain");
  await hold("Space", "fluoroscopy", async () => (await mode()) === 0 && near(15)());
  await page.keyboard.press("KeyP");
  await page.locator("#pad-kind").click();
  await shows("subtraction 6/s");
  await page.locator("#pad-acquisition").hover();
  await page.mouse.down();
  await until("a subtraction by the pad", async () => (await mode()) === 1 && near(6)());
  await page.mouse.up();
  await until("the end of X-rays", async () => (await text("#hold")) === "Last image hold");
  await page.keyboard.press("KeyP");
  for (let k = 0; k < 4; ++k) await page.keyboard.press("KeyM");
  await until("the scene's display", async () => (await text("#system-M span")) === "as scene");
});

test("the table follows its keys, and the margin tells its position", async () => {
  const table = () => page.evaluate(() => {
    const values = window.torquer.readings().values;
    return [values.table_left_mm, values.table_head_mm, values.table_height_mm];
  });
  await until("readings", () => page.evaluate(() => window.torquer.readings() !== null));
  assert.deepEqual(await table(), [0, 0, 0]);
  assert.equal(await text("#table-place"), "table L 0 H 0 height 0 mm");
  await hold("KeyJ", "20 mm to the left", async () => (await table())[0] > 20);
  await hold("KeyH", "15 mm to the feet", async () => (await table())[1] < -15);
  await hold("PageUp", "10 mm up", async () => (await table())[2] > 10);
  let last = null;
  const [left, head, up] = await until("the table rests", async () => {
    await page.waitForTimeout(300);
    const now = await table();
    const rests = JSON.stringify(now) === JSON.stringify(last);
    last = now;
    return rests && now;
  });
  assert.equal(await text("#table-place"), `table L ${left.toFixed(0)} F ${(-head).toFixed(0)} height +${up.toFixed(0)} mm`);
  await hold("KeyG", "back from the left", async () => (await table())[0] < 1);
  await hold("KeyY", "back from the feet", async () => (await table())[1] > -1);
  await hold("PageDown", "down", async () => (await table())[2] < 1);
});

test("a table that moves takes the road map, and the margin tells it", async () => {
  await until("no mask was lost lately", async () => (await text("#picture-warning")) === "");
  for (let k = 0; k < 3; ++k) await page.keyboard.press("KeyM");
  await until("the road map", async () => (await text("#system-M span")) === "road map");
  const shown = await page.evaluate(() => window.torquer.pictures());
  await hold("Space", "pictures", () => page.evaluate((from) => window.torquer.pictures() > from + 2, shown));
  await page.keyboard.press("KeyJ", { delay: 200 });
  await until("it tells", async () => (await text("#picture-warning")) === "View moved: mask lost");
  for (let k = 0; k < 2; ++k) await page.keyboard.press("KeyM");
  await until("the scene's display", async () => (await text("#system-M span")) === "as scene");
});

test("a stored picture stays beside the live one as the reference", async () => {
  await until("the last picture is held", async () => (await text("#hold")).includes("Last image hold"));
  assert.equal(await page.locator("#reference").isVisible(), false);
  const held = await pixels("#xray-picture");
  await page.locator("#store").click();
  await until("the reference is the held picture", async () => (await pixels("#reference-picture")) === held);
  assert.equal(await page.locator("#teaching").isVisible(), false, "the 3D view has its place");
  assert.match(await text("#reference-text"), /(LAO|RAO) \d+°  (CRA|CAU) \d+°  at \d+:\d\d min/);
  const said = await text("#reference-text");
  await hold("KeyA", "another angle", async () => (await text("#lao")) !== said.split("  ")[0]);
  await hold("Space", "a new live picture", async () => (await pixels("#xray-picture")) !== held);
  assert.equal(await pixels("#reference-picture"), held);
  assert.equal(await text("#reference-text"), said);
  // It is a whole square, apart from the live picture, in every window and in an examination.
  for (const [width, height] of [[1600, 900], [1024, 768], [420, 860], [860, 420]]) {
    await page.setViewportSize({ width, height });
    for (const key of ["KeyE", "KeyE"]) {
      await page.keyboard.press(key);
      await page.waitForTimeout(200);
      const [live, stored] = await page.evaluate(() => ["#xray-picture", "#reference-picture"].map((selector) => {
        const { left, right, top, bottom, width, height } = document.querySelector(selector).getBoundingClientRect();
        return { left, right, top, bottom, width, height };
      }));
      assert.ok(stored.width > 120 && Math.abs(stored.width - stored.height) < 1, JSON.stringify(stored));
      assert.ok(stored.left >= live.right || stored.right <= live.left || stored.top >= live.bottom || stored.bottom <= live.top,
        `${width} x ${height}: ${JSON.stringify([live, stored])}`);
    }
  }
  await page.setViewportSize({ width: 1024, height: 600 });
  await page.locator("#reference-close").click();
  assert.equal(await page.locator("#teaching").isVisible(), true);
});
