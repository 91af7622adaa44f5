// The page's tray: an instrument is exchanged for another device in the running session.
// usage: node tests/viewer/tray_page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { BrowserSession, checkMargins, holdKey, until } from "./browser_session.mjs";

const SCENE = `name = "tray"
[vessel]
kind = "ty_phantom"
wall_stiffness_N_mm2 = 0.01
[entry]
centerline = "main"
at_mm = 1
[[instrument]]
name = "guidewire"
max_length_mm = 200
radius_mm = 0.18
rigidity_N_mm2 = 6.35e-3
inserted_at_start_mm = 60
[[instrument]]
name = "catheter"
device = "microcatheter_1_8f"
max_length_mm = 200
[effects.fluoroscopy]
width_px = 128
[effects.segment_error]
`;

const [root, programs] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "torquer-tray-"));
let session, page;
const text = (selector) => page.locator(selector).textContent();
const devices = () => page.locator(".instrument button").allTextContents();
const says = (what, words) => until(what, async () => (await text("#tray-warning")).includes(words));

before(async () => {
  const scene = join(folder, "tray.toml");
  writeFileSync(scene, SCENE);
  session = await BrowserSession.start(root, programs, scene);
  page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(session.url);
  await until("the devices", async () => (await devices()).length === 2);
});

after(async () => {
  await session?.stop();
  rmSync(folder, { recursive: true, force: true });
});

test("the figures name the device of each instrument", async () => {
  await until("the product", async () => (await devices())[1].startsWith("Microcatheter, 1.8 F"));
  assert.equal((await devices())[0], "Exchange …");
  assert.equal(await page.locator("#tray").isVisible(), false);
});

test("the tray of a wire has wires, and asks for its withdrawal", async () => {
  await page.locator(".instrument button").nth(0).click();
  const offered = await page.locator("#tray option").evaluateAll((options) => options.map(({ value }) => value));
  assert.ok(offered.includes("sion") && !offered.includes("guiding_6f"), offered.join());
  await says("why not", "Withdraw it to 0 mm first; it is 60 mm inside");
  assert.equal(await page.locator("#tray-exchange").isDisabled(), true);
  await checkMargins(page, ["#xray-picture"], [[1280, 720], [420, 860]], 0.6);
  await page.setViewportSize({ width: 1280, height: 720 });
});

test("a withdrawn catheter becomes the chosen device, and moves on", async () => {
  const radius = () => page.evaluate(() => window.torquer.scene().instruments[1].radius_mm);
  const before = await radius();
  await page.locator(".instrument button").nth(1).click();
  await page.locator("#tray-device").selectOption("microcatheter_2_7f");
  await page.locator("#tray-exchange").click();
  await until("the new device", async () => (await text("#tray-state")).startsWith("now: Microcatheter, 2.7 F"));
  await until("its radius", async () => (await radius()) > before);
  assert.equal(await text("#tray-warning"), "");
  await until("the figures name it", async () => (await devices())[1].startsWith("Microcatheter, 2.7 F"));
  await page.locator("#tray-close").click();
  assert.equal(await page.locator("#tray").isVisible(), false);
  await page.keyboard.press("Tab");
  await holdKey(page, "ArrowUp", "it is pushed", () => page.evaluate(() => window.torquer.state().instruments[1].insertionMm > 5));
  assert.equal(Math.round(await page.evaluate(() => window.torquer.state().instruments[0].insertionMm)), 60);
});

test("the figures have the estimated error, also after the exchange", async () => {
  const reading = () => page.evaluate(() => {
    const { time_s, values } = window.torquer.readings();
    return { timeS: time_s, errorMm: values["segment_error_mm"] };
  });
  const before = await reading();
  await until("a newer value", async () => {
    const { timeS, errorMm } = await reading();
    return timeS > before.timeS && Number.isFinite(errorMm);
  });
  await until("it is plotted", () => page.evaluate(() => window.torquer.plotted().error > 0));
});

test("the simulator's refusal is shown", async () => {
  await holdKey(page, "ArrowDown", "it is withdrawn", () => page.evaluate(() => window.torquer.state().instruments[1].insertionMm <= 0));
  await page.locator(".instrument button").nth(1).click();
  // A device that the library no longer has.
  await page.evaluate(() => { document.querySelector("#tray-device").options[0].value = "no_such_device"; });
  await page.locator("#tray-device").selectOption("no_such_device");
  await page.locator("#tray-exchange").click();
  await says("the reason", "catheter cannot be exchanged for the device no_such_device");
});
