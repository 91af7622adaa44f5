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

test("a choice stays until torquer-viewer answers it, however late the report", async () => {
  const slow = await session.browser.newPage({ viewport: { width: 1024, height: 600 } });
  await slow.addInitScript(() => {
    const real = performance.now.bind(performance);
    Object.assign(window, { lateMs: 1200, reports: 0, deaf: false, aheadMs: 0 });
    // A quarter of the speed: a busy machine answers within the page's limit of 10 s.
    performance.now = () => real() / 4 + window.aheadMs;
    window.WebSocket = class extends WebSocket {
      set onmessage(take) {
        super.onmessage = (event) => {
          const late = typeof event.data === "string" && event.data.includes('"kind":"viewer"');
          if (!late) return take(event);
          setTimeout(() => {
            take(event);
            ++window.reports;
          }, window.lateMs);
        };
      }
      send(data) {
        if (!window.deaf || new Uint8Array(data)[0] !== 18) super.send(data);
      }
    };
  });
  await slow.goto(session.url);
  const said = (key) => slow.locator(`#system-${key} span`).textContent();
  await until("the settings", () => slow.locator("#system-M").isVisible());
  await slow.evaluate(() => {
    window.words = [];
    const shown = document.querySelector("#system-M span");
    new MutationObserver(() => window.words.push(shown.textContent)).observe(shown, { childList: true, characterData: true, subtree: true });
  });
  const words = () => slow.evaluate(() => window.words);
  await slow.keyboard.press("KeyM");
  await slow.keyboard.press("KeyM");
  const taken = await slow.evaluate(() => window.reports);
  assert.deepEqual(await words(), ["plain", "subtraction"], "at once");
  await until("the other page knows", async () => (await text("#system-M span")) === "subtraction");
  await until("older reports have come", () => slow.evaluate((before) => window.reports >= before + 8, taken));
  assert.deepEqual(await words(), ["plain", "subtraction"], "no older report shows");
  await page.keyboard.press("KeyM");
  await until("the other page's newer choice", async () => (await said("M")) === "road map");
  assert.deepEqual(await words(), ["plain", "subtraction", "road map"]);
  for (let k = 0; k < 2; ++k) await page.keyboard.press("KeyM");

  await slow.evaluate(() => { window.lateMs = 0; window.deaf = true; });
  await slow.keyboard.press("KeyK");
  await slow.waitForTimeout(300);
  assert.equal(await said("K"), "shutters 10 %");
  await slow.evaluate(() => { window.aheadMs = 10001; });
  await until("it is lost", async () => (await said("K")) === "shutters open");
  const state = () => slow.locator("#state").textContent();
  await until("the header says so", async () => (await state()) === "X-ray setting not taken: no answer");
  await slow.evaluate(() => { window.deaf = false; });
  await slow.keyboard.press("KeyK");
  await until("it is taken", async () => (await text("#system-K span")) === "shutters 10 %");
  await until("all is well", async () => (await state()).includes("not calibrated"));
  await slow.close();
});

test("an unplugged device is reported as missing", async () => {
  const { execFileSync } = await import("node:child_process");
  execFileSync("pkill", ["-KILL", "-f", `torquer-emulator.*${session.folder}`]);
  await until("the header says so", async () => /^Guidewire: /.test(await text("#state")) && !(await text("#state")).includes("calibrated"));
});
