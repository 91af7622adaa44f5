// Device page: a page that only watches while a device steers, its device status, and X-ray system.
// usage: node tests/viewer/device_page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { BrowserSession, until } from "./browser_session.mjs";

const [root, programs] = process.argv.slice(2);
let session;
let page;

before(async () => {
  session = await BrowserSession.start(root, programs, "neuro_angio.toml", "device");
  page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(session.url);
});
after(() => session?.stop());

const text = (selector) => page.locator(selector).textContent();
const insertion = () => page.evaluate(() => window.torquer.state()?.instruments[0].insertionMm ?? NaN);

test("an uncalibrated device is named", async () => {
  await until("the header says so", async () => (await text("#state")) === "Guidewire: the device is not calibrated");
  assert.equal(await page.locator("#pad-button").isVisible(), false);
});

test("the device moves the instrument, and the page's keys do not", async () => {
  const before = await insertion();
  await page.keyboard.down("ArrowDown");
  await until("the hand pushes", async () => (await insertion()) > before + 0.2);
  await page.keyboard.up("ArrowDown");
});

test("a page that looks on chooses how the X-ray system works", async () => {
  await page.keyboard.press("KeyZ");
  await until("a narrower field is chosen", async () => (await text("#system-Z span")) === "field ×1.5");
  const field = () => page.evaluate(() => window.torquer.readings()?.values.xray_field_mm ?? 0);
  // 380 mm at the detector, scaled by 750 of 1050 mm from the source.
  await until("the simulator takes it", async () => Math.abs((await field()) - (380 * 750) / 1050 / 1.5) < 0.01);
});

test("an unplugged device is reported as missing", async () => {
  const { execFileSync } = await import("node:child_process");
  execFileSync("pkill", ["-KILL", "-f", `torquer-emulator.*${session.folder}`]);
  await until("the header says so", async () => /^Guidewire: /.test(await text("#state")) && !(await text("#state")).includes("calibrated"));
});
