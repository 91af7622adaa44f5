// Page of torquer-replay in headless Chromium, with a session that host/demo recorded.
// usage: node tests/viewer/replay_page_test.mjs ROOT PROGRAMS [PICTURES]
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { startBrowser, until } from "./browser_session.mjs";

const [root, programs, pictures] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "torquer-replay-"));
const problems = [];
let replay, printed = "", browser, page;

const text = (selector) => page.locator(selector).textContent();
const tick = () => page.evaluate(() => window.torquer.state()?.tick ?? -1);
// Displayed tick, once it has been constant for a while.
const restingTick = () => until("a state that rests", async () => {
  const shown = await tick();
  await page.waitForTimeout(300);
  return shown > 0 && (await tick()) === shown && shown;
});
const at = async () => {
  const [, minutes, seconds] = (await text("#replay-time")).match(/^(\d+):([\d.]+)/) ?? [];
  return 60 * Number(minutes) + Number(seconds);
};
const place = (seconds) => page.locator("#replay-place").evaluate((slider, value) => {
  slider.value = String(value);
  slider.dispatchEvent(new Event("input"));
  slider.dispatchEvent(new Event("change"));
}, seconds);

before(async () => {
  const demo = spawnSync(
    "bash", [join(root, "host/demo"), "--scene", "neuro_angio", "--duration", "5", "--files", folder, "--no-install", "--programs", programs],
    { encoding: "utf8" });
  assert.equal(demo.status, 0, demo.stdout + demo.stderr);
  replay = spawn(join(programs, "torquer-replay"), [join(folder, "latest/session.lcmlog")], { stdio: ["ignore", "pipe", "inherit"] });
  replay.stdout.on("data", (data) => (printed += data));
  const url = await until("the link is printed", () => printed.match(/^http:\S+\n/m)?.[0].trim());
  browser = await startBrowser(root);
  page = await browser.newPage({ viewport: { width: 1024, height: 600 } });
  page.on("pageerror", (error) => problems.push(error.message));
  await page.goto(url);
});

after(async () => {
  await browser?.close();
  replay?.kill("SIGKILL");
  rmSync(folder, { recursive: true, force: true });
});

test("a recording plays, with its X-ray pictures and readings", async () => {
  await until("it plays", async () => (await text("#state")) === "Replay");
  await until("pictures", () => page.evaluate(() => window.torquer.pictures() > 3));
  assert.equal(await text("#scene-name"), "neuro angio");
  assert.match(await text("#dose"), /Contrast/);
  assert.ok(await page.evaluate(() => window.torquer.space.guidesShown().lines > 20), "no centerlines");
});

test("every state is repeated to the bit meanwhile", async () => {
  await until("the comparison is done", async () => /^all \d+ states repeated bit for bit$/.test(await text("#replay-check")));
});

test("it pauses, steps by single shapes, and goes to a place", async () => {
  await place(2);
  await page.locator("body").press("Space");
  await until("it pauses", async () => (await text("#state")) === "Replay, paused");
  await place(2);
  await until("2 s", async () => (await at()) === 2);
  const start = await restingTick();
  assert.ok(start > 1000 && start < 2100, `tick ${start} at 2 s`);
  // The log has 60 shapes per second of 1000 ticks, or fewer on a busy machine.
  await page.keyboard.press("ArrowRight");
  await until("the next shape", async () => (await tick()) > start);
  const next = await restingTick();
  assert.ok(next < start + 200, `${next} follows ${start}`);
  await page.keyboard.press("ArrowLeft");
  await until("the shape that was left", async () => (await tick()) === start);
  await page.keyboard.press("ArrowLeft");
  await until("the shape before", async () => (await tick()) < start);
  const before = await restingTick();
  assert.ok(before > start - 200, `${before} is before ${start}`);
  await page.keyboard.press("Shift+ArrowLeft");
  await until("the beginning", async () => (await at()) === 0);
  assert.equal(await text("#state"), "Replay, paused");
});

test("the patient's curves come again, the same at the same time", async () => {
  const vitals = () => page.evaluate(() => window.torquer.patient());
  const curves = async (seconds) => {
    await place(seconds);
    await until(`${seconds} s`, async () => (await at()) === seconds);
    return until("the curves rest", async () => {
      const before = JSON.stringify(await vitals());
      await page.waitForTimeout(400);
      return JSON.stringify(await vitals()) === before && (await vitals());
    });
  };
  const late = await curves(4);
  const early = await curves(2);
  assert.equal(late.patient.heart_rate_per_min, 70);
  assert.ok(late.patient.time_s > early.patient.time_s + 1.5 && late.patient.time_s < early.patient.time_s + 2.5);
  assert.equal(late.patient.ecg.length, 250);
  assert.ok(late.patient.systolic_mmHg > late.patient.diastolic_mmHg + 20, JSON.stringify(late.patient));
  assert.match(await text("#patient-pressure b"), /^\d+\/\d+$/);
  // Backwards the page starts again, so that no sample of the future is left.
  assert.ok(early.samples.every(({ number }) => number * early.patient.sample_s <= early.patient.time_s));
  assert.deepEqual((await curves(4)).patient, late.patient);
  assert.deepEqual((await curves(2)).patient, early.patient);
});

test("it plays at other speeds, and again from the end", async () => {
  // Progress in the recording during one second of real time, from 1 s on.
  const second = async (speed) => {
    await page.locator("#replay-speed").selectOption(speed);
    await place(1);
    await until("1 s", async () => Math.abs((await at()) - 1) < 0.01);
    await page.locator("#replay-play").click();
    await page.waitForTimeout(1000);
    const reached = await at();
    await page.locator("#replay-play").click();
    await until("it pauses", async () => (await text("#replay-play")) === "Play");
    // The click on the button took the focus, so the list shows the speed that torquer-replay reports.
    assert.equal(await page.locator("#replay-speed").inputValue(), speed);
    return reached - 1;
  };
  const slow = await second("0.1");
  const fast = await second("2");
  // A busy page shows less progress. playback_test compares each speed with a clock.
  assert.ok(slow > 0 && slow < 0.4 && fast > 3 * slow, `${slow} s at a tenth of the speed, ${fast} s at twice the speed`);
  await page.locator("#replay-speed").selectOption("10");
  await page.locator("#replay-play").click();
  const endS = Number(await page.locator("#replay-place").getAttribute("max"));
  await until("the end", async () => (await at()) > endS - 0.01 && (await text("#replay-play")) === "Play");
  await page.locator("#replay-play").click();
  await until("it plays again", async () => (await text("#state")) === "Replay");
});

test("no text is cut off at any width of the window", async () => {
  for (const width of [420, 1024, 1600]) {
    await page.setViewportSize({ width, height: 800 });
    await page.waitForTimeout(200); // layout and plots follow the new size
    const cut = await page.evaluate(() => {
      const shown = "header *, #replay *, main > section, #figures *, #legend *, footer *";
      return [...document.querySelectorAll(shown)]
        .filter((one) => one.checkVisibility({ visibilityProperty: true }) && one.getBoundingClientRect().right > innerWidth + 0.5)
        .map((one) => `${one.tagName} ${one.id || one.className || one.textContent}`);
    });
    assert.deepEqual(cut, [], `cut off in a window of ${width} px`);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${width} px scrolls sideways`);
    if (pictures) await page.screenshot({ path: join(pictures, `replay-${width}.png`), fullPage: true });
  }
  await page.setViewportSize({ width: 1024, height: 600 });
});

test("the keys move no instrument, and the program reports its result at the end", async () => {
  assert.equal(await page.locator("#pad-button").isVisible(), false);
  replay.kill("SIGTERM");
  const status = await new Promise((done) => replay.on("exit", done));
  assert.equal(status, 0);
  assert.match(printed, /\d+ states repeated, 0 differ\n$/);
  await until("the page says so", async () => (await text("#state")) === "No connection");
  assert.deepEqual(problems, []);
});
