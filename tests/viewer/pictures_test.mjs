// Pixel test of the page: comparison with golden pictures that were looked at (golden/). It also tests last image hold,
// subtraction and road map.
// usage: node tests/viewer/pictures_test.mjs ROOT PROGRAMS [--make]
// --make writes the golden pictures again; look at each before you commit it.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { blockMeans, difference } from "./block_means.mjs";
import { BrowserSession, holdKey, until } from "./browser_session.mjs";

const [root, programs, option] = process.argv.slice(2);
const make = option === "--make";
// In gray levels of 255. Noise and JPEG cause up to 3.5; another window 12, another wire position
// 33.
const PICTURE_TOLERANCE = 6;
const PAGE_TOLERANCE = 8;
let session, page, eye; // eye: an empty page that may load pictures

const text = (selector) => page.locator(selector).textContent();
const pictures = () => page.evaluate(() => window.torquer.pictures());
const insertion = () => page.evaluate(() => window.torquer.state().instruments[0].insertionMm);
const drawn = () => page.evaluate(() => window.torquer.drawn());
const canvas = () => page.evaluate(() => document.querySelector("#xray-picture").toDataURL());
const jpeg = (bytes) => `data:image/jpeg;base64,${bytes.toString("base64")}`;
// Covers numbers and plots that differ between runs.
const wholePage = async () => jpeg(await page.screenshot({
  type: "jpeg", quality: 85, mask: ["#figures", "#dose", "#loops", "#hint"].map((selector) => page.locator(selector)),
}));
const hold = (key, what, condition) => holdKey(page, key, what, condition);
async function pulses(count) {
  const [start, before] = [await pictures(), (await drawn()).picture ?? 0];
  await hold("Space", `${count} pictures`, async () => (await pictures()) >= start + count);
  await until("the lamp is off", async () => (await text("#lamp")).includes("OFF"));
  // The simulator ends the X-ray later than the page, and the page draws later still. The held image is the last one.
  await until("the last image is held", async () => {
    const { picture, held } = await drawn();
    return held && picture > before;
  });
}
async function mode(wanted) {
  for (let k = 0; k < 5 && (await text("#system-M span")) !== wanted; ++k) {
    await page.keyboard.press("KeyM");
    await page.waitForTimeout(100);
  }
  assert.equal(await text("#system-M span"), wanted);
}
// Compares the display with the golden picture; --make stores it instead.
async function compare(name, url, tolerance) {
  const path = join(root, "tests/viewer/golden", `${name}.jpg`);
  if (make) {
    const bytes = url.startsWith("data:image/jpeg")
      ? url : await page.evaluate(() => document.querySelector("#xray-picture").toDataURL("image/jpeg", 0.9));
    writeFileSync(path, Buffer.from(bytes.split(",")[1], "base64"));
  }
  return difference(await blockMeans(eye, jpeg(readFileSync(path))), await blockMeans(eye, url), tolerance);
}
const same = async (name, url, tolerance) => {
  const { blocks, largest } = await compare(name, url, tolerance);
  assert.equal(blocks, 0, `${name}: ${blocks} blocks are not as kept, by up to ${largest.toFixed(1)} of 255`);
};
// Checks that the golden picture differs from this display.
const differs = async (name, url, tolerance) => {
  if (make) return;
  const { blocks } = await compare(name, url, tolerance);
  assert.ok(blocks > 0, `${name} does not tell`);
};

before(async () => {
  session = await BrowserSession.start(root, programs, "neuro_angio.toml");
  page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(session.url);
  eye = await session.browser.newPage();
  await page.bringToFront();
  await until("it runs", async () => (await text("#state")).includes("Running"));
  await until("the vessel is drawn", () => page.evaluate(() => window.torquer.space.showsVessel && window.torquer.space.guidesShown().target));
  await page.waitForTimeout(500);
});

after(() => session?.stop());

test("the page before the first X-ray", async () => {
  await same("start-page", await wholePage(), PAGE_TOLERANCE);
});

test("a plain picture, and the page with it", async () => {
  await mode("plain");
  await pulses(5);
  await same("plain", await canvas(), PICTURE_TOLERANCE);
  await same("plain-page", await wholePage(), PAGE_TOLERANCE);
});

test("another window is another picture", async () => {
  const at = await page.locator("#xray-picture").boundingBox();
  const [x, y] = [at.x + at.width / 2, at.y + at.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x, y + 12, { steps: 3 });
  await page.mouse.up();
  await until("the level is shown", async () => !(await text("#window")).includes("level 128"));
  await differs("plain", await canvas(), PICTURE_TOLERANCE);
  await differs("plain-page", await wholePage(), PAGE_TOLERANCE);
  await page.mouse.dblclick(x, y);
  await page.mouse.move(0, 0);
  await until("the level is reset", async () => (await text("#window")).includes("level 128"));
  await same("plain", await canvas(), PICTURE_TOLERANCE);
});

test("a narrower field with shutters", async () => {
  await page.keyboard.press("KeyZ");
  await page.keyboard.press("KeyK");
  await until("they are chosen", async () => (await text("#system-K span")) === "shutters 10 %");
  await until("so is the field", async () => (await text("#system-Z span")) !== "field ×1");
  await pulses(5);
  const [picture, whole] = [await canvas(), await wholePage()];
  for (let k = 0; k < 4 && (await text("#system-K span")) !== "shutters open"; ++k) {
    await page.keyboard.press("KeyK");
    await page.waitForTimeout(100);
  }
  for (let k = 0; k < 4 && (await text("#system-Z span")) !== "field ×1"; ++k) {
    await page.keyboard.press("KeyZ");
    await page.waitForTimeout(100);
  }
  await same("field", picture, PICTURE_TOLERANCE);
  await same("field-page", whole, PAGE_TOLERANCE);
});

test("subtraction makes resting parts even", async () => {
  await mode("subtraction");
  await pulses(5);
  await same("subtracted", await canvas(), PICTURE_TOLERANCE);
  await differs("plain", await canvas(), PICTURE_TOLERANCE);
});

test("the last image is held to the bit while the wire moves", async () => {
  await mode("plain");
  await pulses(3);
  const [held, start] = [await canvas(), await insertion()];
  const around = await page.evaluate(() => document.querySelector("#space").toDataURL());
  await hold("ArrowDown", "15 mm out", async () => (await insertion()) < start - 15);
  await page.waitForTimeout(1500); // the held image arrives once a second
  assert.equal(await canvas(), held);
  assert.match(await text("#hold"), /Last image hold/);
  assert.notEqual(await page.evaluate(() => document.querySelector("#space").toDataURL()), around);
});

test("a wire that is elsewhere is another picture", async () => {
  await pulses(5);
  await differs("plain", await canvas(), PICTURE_TOLERANCE);
  await differs("plain-page", await wholePage(), PAGE_TOLERANCE);
});

// Blocks that are darker or brighter than the median gray of the picture.
async function marked() {
  const { means } = await blockMeans(eye, await canvas());
  const grays = means.filter((_, k) => k % 3 === 0);
  const middle = [...grays].sort((a, b) => a - b)[Math.floor(grays.length / 2)];
  const those = (is) => new Set([...grays.keys()].filter((k) => is(grays[k] - middle)));
  return { dark: those((gray) => gray < -12), touched: those((gray) => gray < -5), bright: those((gray) => gray > 12) };
}
const value = (name) => page.evaluate((reading) => window.torquer.readings().values[reading], name);
const phase = (what, wanted) => until(what, async () => (await value("injector_phase")) === wanted);
// Presses the pedal, injects contrast agent with the power injector, and lets `seen` look at the flow. A page that is busy
// for 300 ms lifts its pedal. Then a road map lacks dye, and a new mask has some. So this is repeated. Returns the result
// of `seen`, and the simulated time from the injection's end to the last look.
async function inject(mL, seen) {
  const MOST_GAP_S = 0.02;
  for (let tries = 0; tries < 5; ++tries) {
    await until("the contrast agent has flowed away", await later(6));
    await page.keyboard.press("Digit7");
    for (const [key, set] of [["volume_mL", mL], ["rate_mL_s", 20], ["delay_s", 0], ["rise_s", 0]]) {
      await page.locator(`#injector-${key}`).fill(String(set));
      await page.locator(`#injector-${key}`).press("Enter");
    }
    await page.keyboard.press("Digit1");
    await phase("it is armed", 1);
    await page.keyboard.press("Digit7");
    const taken = await pictures();
    await page.keyboard.down("Space");
    await until("the mask is taken", async () => (await pictures()) >= taken + 3);
    const withoutXray = () => page.evaluate(() => {
      const { procedure_s: all, fluoroscopy_s: xray } = window.torquer.readings().values;
      return all - xray;
    });
    const before = await withoutXray();
    await page.keyboard.press("Digit3");
    await phase("it is injected", 3);
    const endS = await simulatedS();
    const found = await seen();
    const flowS = (await simulatedS()) - endS;
    const gapS = (await withoutXray()) - before;
    await page.keyboard.up("Space");
    if (gapS < MOST_GAP_S) return { found, flowS };
  }
  return assert.fail("the pedal went up during each of five injections");
}

const simulatedS = () => page.evaluate(() => window.torquer.state().timeS);
const later = async (seconds) => {
  const end = (await simulatedS()) + seconds;
  return async () => (await simulatedS()) >= end;
};
// Simulated time in which the dye reaches its farthest extent.
const DYE_S = 7;
// A busy page sees few pictures of the dye, which moves by about a block between two of them.
const isNear = (blocks, block) =>
  [-33, -32, -31, -1, 0, 1, 31, 32, 33].some((step) => blocks.has(block + step));

test("in subtraction dye is dark and the rest even; a road map keeps past dye bright", async () => {
  await mode("road map");
  const { found: map, flowS } = await inject(20, async () => {
    await until("the dye has spread", await later(DYE_S));
    return marked();
  });

  // A busy page looks late. So this run gets a fifth more dye than the map, for a second longer.
  const [filled, touched] = [new Set(), new Set()];
  await mode("subtraction");
  await inject(24, async () => {
    for (const blocks of [filled, touched]) blocks.clear();
    for (const ended = await later(flowS + 1); ;) {
      const seen = await marked();
      if (await ended()) return;
      for (const block of seen.dark) filled.add(block);
      for (const block of seen.touched) touched.add(block);
    }
  });
  assert.ok(filled.size > 15, `${filled.size} blocks were filled`);
  assert.ok(touched.size < 0.5 * 32 * 32, `${touched.size} blocks were touched`);

  const within = [...map.bright].filter((block) => filled.has(block)).length;
  assert.ok(within > 0.6 * filled.size, `of ${filled.size} blocks that were filled ${within} are bright in the map`);
  const strange = [...map.bright].filter((block) => !isNear(touched, block)).length;
  assert.ok(strange < 0.05 * map.bright.size, `${strange} of ${map.bright.size} blocks of the map had no dye`);
  assert.ok(map.dark.size < 0.1 * filled.size, `${map.dark.size} blocks of the map are dark`);
});
