// Accessibility test: axe-core checks the page in each of its states. There must be no violation of
// WCAG 2.0 to 2.2, levels A and AA. usage: node tests/viewer/accessibility_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, afterEach, test } from "node:test";
import { BrowserSession, startBrowser, until } from "./browser_session.mjs";

const [root, programs] = process.argv.slice(2);
const axe = readFileSync(createRequire(join(root, "host/viewer/web/package.json")).resolve("axe-core/axe.min.js"), "utf8");
const folder = mkdtempSync(join(tmpdir(), "torquer-access-"));
const opened = [];
const found = []; // violations of all states

// Reports all violations of a test together, so that each state is checked whatever the earlier
// result.
afterEach(() => assert.deepEqual(found.splice(0), []));

after(async () => {
  for (const close of opened.reverse()) await close();
  rmSync(folder, { recursive: true, force: true });
});

async function session(scene) {
  const started = await BrowserSession.start(root, programs, scene);
  opened.push(() => started.stop());
  return started;
}
async function open(browser, url) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(url);
  return page;
}
const stateWord = (page, word) => until(`the page says ${word}`, async () => (await page.locator("#state").textContent()).includes(word));

// Evaluates axe in the page: the Content-Security-Policy forbids to add it as a script.
async function judge(page, what) {
  await page.evaluate(axe);
  const { violations, passes } = await page.evaluate(() =>
    window.axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"], resultTypes: ["violations"] }));
  assert.ok(passes.length > 10, `${what}: axe has looked at ${passes.length} rules only`);
  found.push(...violations.flatMap(({ id, help, nodes }) =>
    nodes.map(({ target, failureSummary }) => `${what}: ${id}, ${help}: ${target.join(" ")}\n${failureSummary}`)));
}

test("a session with X-ray: running, steered, pad, keys, examination, silent, waiting", async () => {
  const live = await session("neuro_angio.toml");
  const page = await open(live.browser, live.url);
  await stateWord(page, "Running");
  await judge(page, "running");

  await page.keyboard.down("ArrowUp");
  await page.keyboard.down("Space");
  await until("pictures", () => page.evaluate(() => window.torquer.pictures() >= 5));
  await judge(page, "steered under X-ray");
  await page.keyboard.up("Space");
  await page.keyboard.up("ArrowUp");
  await until("the lamp is off", async () => (await page.locator("#lamp").textContent()).includes("OFF"));
  await until("a loop", () => page.locator("#loops").isVisible());
  await judge(page, "last image hold");
  await page.keyboard.press("KeyL");
  await judge(page, "recorded loop");
  await page.keyboard.press("KeyL");

  const other = await open(live.browser, live.url);
  await until("the other page sees who steers", () => other.evaluate(() => window.torquer.viewer()?.steered));
  await judge(other, "another page steers");
  await other.close();

  await page.keyboard.press("KeyP");
  await judge(page, "pad");
  await page.keyboard.press("KeyP");
  await page.keyboard.press("Shift+?");
  await until("the keys", () => page.locator("#keys").isVisible());
  await judge(page, "keys");
  await page.keyboard.press("Escape");
  await page.keyboard.press("KeyE");
  await until("the clock", () => page.locator("#clock").isVisible());
  await judge(page, "examination");
  await page.keyboard.press("KeyE");

  process.kill(Number(live.read("simulator.pid")), "SIGKILL");
  await stateWord(page, "silent");
  await judge(page, "silent");
  process.kill(Number(live.read("viewer.pid")), "SIGKILL");
  await stateWord(page, "No connection");
  await judge(page, "no connection");
  await page.reload().catch(() => {});
  await until("the viewer is back", async () => {
    await page.goto(live.url).catch(() => {});
    return (await page.locator("#state").count()) === 1;
  });
  await stateWord(page, "Waiting");
  await judge(page, "waiting");
});

test("a session without X-ray", async () => {
  const live = await session("neuro_arch.toml");
  const page = await open(live.browser, live.url);
  await stateWord(page, "Running");
  assert.equal(await page.locator("#xray").isVisible(), false);
  await judge(page, "without X-ray");
});

test("a session with a second plane, and what its effects take", async () => {
  const live = await session("everything.toml");
  const page = await open(live.browser, live.url);
  await until("the vessel is drawn", () => page.evaluate(() => window.torquer.space.showsVessel));
  await page.keyboard.down("Space");
  await until("pictures", () => page.evaluate(() => window.torquer.pictures() >= 3));
  await page.keyboard.up("Space");
  await judge(page, "two planes");
  await page.locator("#prices summary").click();
  await until("the effects", () => page.locator("#prices").evaluate((details) => details.open));
  await judge(page, "what its effects take");
});

test("cases", async () => {
  const live = await session("");
  const page = await open(live.browser, live.url);
  await until("the cases", () => page.locator("#case-list").isVisible());
  await judge(page, "cases");
});

test("a recording", async () => {
  const demo = spawnSync(
    "bash", [join(root, "host/demo"), "--scene", "neuro_angio", "--duration", "4", "--files", folder, "--no-install", "--programs", programs],
    { encoding: "utf8" });
  assert.equal(demo.status, 0, demo.stdout + demo.stderr);
  const replay = spawn(join(programs, "torquer-replay"), [join(folder, "latest/session.lcmlog")], { stdio: ["ignore", "pipe", "inherit"] });
  opened.push(() => replay.kill("SIGKILL"));
  let printed = "";
  replay.stdout.on("data", (data) => (printed += data));
  const url = await until("the link is printed", () => printed.match(/^http:\S+\n/m)?.[0].trim());
  const browser = await startBrowser(root);
  opened.push(() => browser.close());
  const page = await open(browser, url);
  await stateWord(page, "Replay");
  await until("a picture", () => page.evaluate(() => window.torquer.pictures() > 0));
  await judge(page, "replay");
});
