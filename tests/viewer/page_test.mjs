// The viewer's page in headless Chromium, with the real simulator behind it.
// usage: node tests/viewer/page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";

const [root, programs] = process.argv.slice(2);
const { chromium } = createRequire(join(root, "host/viewer/web/package.json"))("playwright-core");
const BROWSER = "/usr/bin/chromium";
const PATIENCE_MS = 20000; // for a busy machine; nothing is measured by it

const folder = mkdtempSync(join(tmpdir(), "torquer-page-"));
const read = (name) => (existsSync(join(folder, name)) ? readFileSync(join(folder, name), "utf8") : "");
let session, browser, page, url;
const problems = [];
const requests = [];

async function until(what, condition) {
  const end = Date.now() + PATIENCE_MS;
  while (Date.now() < end) {
    const value = await condition();
    if (value) return value;
    await new Promise((done) => setTimeout(done, 50));
  }
  assert.fail(`not within ${PATIENCE_MS} ms: ${what}`);
}
const text = (selector, where = page) => where.locator(selector).textContent();
const state = () => page.evaluate(() => {
  const now = window.torquer.state();
  return now && { insertion: now.instruments[0].insertionMm, rotation: now.instruments[0].rotationRad, status: now.status };
});
const stateWord = (word, where = page) => until(`the page says ${word}`, async () => (await text("#state", where)).includes(word));
// A hand that holds a key until something has happened.
async function hold(key, what, condition) {
  await page.keyboard.down(key);
  try {
    await until(what, condition);
  } finally {
    await page.keyboard.up(key);
  }
}
async function open() {
  const opened = await browser.newPage({ viewport: { width: 1024, height: 600 } });
  opened.on("pageerror", (error) => problems.push(error.message));
  opened.on("request", (request) => requests.push(request.url()));
  await opened.goto(url);
  return opened;
}
// Grays of the X-ray picture: how many differ, and their mean.
const grays = () => page.evaluate(() => {
  const canvas = document.querySelector("#xray-picture");
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const seen = new Set();
  let sum = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    seen.add(pixels[i]);
    sum += pixels[i];
  }
  return { kinds: seen.size, mean: (4 * sum) / pixels.length };
});

before(async () => {
  assert.ok(existsSync(BROWSER), "no Chromium; install it with: host/install_packages test");
  session = spawn(
    "bash",
    [join(root, "host/viewer/with_socket"), "0", "sh", join(root, "host/bus/private_network"), "bash",
      join(root, "tests/viewer/session"), programs, join(root, "host/scenes/neuro_angio.toml"), folder],
    { detached: true, stdio: "inherit" },
  );
  url = await until("the viewer prints its link", () => read("viewer.log").match(/^http:\S+\n/m)?.[0].trim());
  browser = await chromium.launch({
    executablePath: BROWSER,
    args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
      "--disable-component-update", "--disable-sync"],
  });
  page = await open();
});

after(async () => {
  await browser?.close();
  if (session?.pid) process.kill(-session.pid, "SIGKILL");
  rmSync(folder, { recursive: true, force: true });
});

test("the page finds the session", async () => {
  await stateWord("Running");
  assert.equal(await text("#scene-name"), "neuro angio");
  assert.match(await text("#xray-notice"), /space bar/);
});

test("the space bar is the pedal, and the last picture stays", async () => {
  await hold("Space", "five pictures", () => page.evaluate(() => window.torquer.pictures() >= 5));
  assert.ok((await grays()).kinds > 20, "the picture is even");
  await until("the lamp goes out", async () => (await text("#lamp")).includes("OFF"));
  assert.match(await text("#hold"), /Last image hold/);
  assert.ok((await grays()).kinds > 20, "the picture is gone");
});

test("window and level are set by the mouse", async () => {
  const before = await grays();
  await page.mouse.move(300, 300);
  await page.mouse.down();
  await page.mouse.move(300, 340, { steps: 4 });
  await page.mouse.up();
  // A higher level shows everything darker.
  await until("the picture is darker", async () => (await grays()).mean < before.mean - 20);
  await page.mouse.dblclick(300, 300);
  await until("the picture is as before", async () => Math.abs((await grays()).mean - before.mean) < 1);
});

test("arrows push and turn the wire, and a key that is up moves nothing", async () => {
  const start = await state();
  await hold("ArrowUp", "10 mm further in", async () => (await state()).insertion > start.insertion + 10);
  await hold("ArrowRight", "turned by 1 rad", async () => (await state()).rotation > start.rotation + 1);
  await hold("ArrowLeft", "turned back", async () => (await state()).rotation < start.rotation + 0.5);
  const pushed = await state();
  await hold("ArrowDown", "pulled back", async () => (await state()).insertion < pushed.insertion - 5);
  await until("it rests", async () => {
    const first = await state();
    await page.waitForTimeout(400);
    const second = await state();
    return first.insertion === second.insertion && first.rotation === second.rotation;
  });
});

test("the C-arm follows its keys, and the picture shows it", async () => {
  await hold("KeyD", "LAO 10", async () => Number((await text("#lao")).match(/LAO (\d+)/)?.[1]) >= 10);
  await hold("KeyS", "CAU 5", async () => Number((await text("#cra")).match(/CAU (\d+)/)?.[1]) >= 5);
});

test("contrast is injected while C is held", async () => {
  const injected = async () => Number((await text("#dose")).match(/([\d.]+) mL/)?.[1] ?? 0);
  const start = await injected();
  await hold("KeyC", "more contrast", async () => (await injected()) > start + 2);
});

test("nodes are drawn where an independent projection has them", async () => {
  await until("the wire rests", async () => (await page.evaluate(() => window.torquer.state().status & 1)) === 1);
  await page.waitForTimeout(300);
  const seen = await page.evaluate(() => {
    const { space } = window.torquer;
    const drawn = space.drawn();
    const nodes = Array.from({ length: drawn.nodesMm.length / 3 }, (_, i) => [...drawn.nodesMm.slice(3 * i, 3 * i + 3)]);
    const canvas = document.querySelector("#space");
    return {
      nodes, tip: drawn.instruments[0].tipMm, projected: nodes.map((node) => space.project(node)),
      camera: space.cameraOf(), width: canvas.width, height: canvas.height, scene: window.torquer.scene(),
    };
  });
  // neuro_angio: left is +y, posterior -z, superior -x; the page turns about the middle of the box.
  const middle = [0, 1, 2].map((axis) => (seen.scene.min_mm[axis] + seen.scene.max_mm[axis]) / 2);
  const focal = seen.height / 2 / Math.tan((seen.camera.fovDeg * Math.PI) / 360);
  const [cx, cy, cz] = seen.camera.position;
  assert.ok(Math.abs(cx) < 1e-9 && Math.abs(cy) < 1e-9, "seen from the front");
  const project = ([x, y, z]) => {
    const [right, up, near] = [y - middle[1], -(x - middle[0]), z - middle[2]];
    return [seen.width / 2 + (focal * right) / (cz - near), seen.height / 2 - (focal * up) / (cz - near)];
  };
  for (const [i, node] of seen.nodes.entries()) {
    const [x, y] = project(node);
    assert.ok(Math.hypot(x - seen.projected[i][0], y - seen.projected[i][1]) < 1, `node ${i}`);
  }
  // The tip's yellow ball, by its pixels.
  const [tipX, tipY] = project(seen.tip);
  const near = { left: Math.round(tipX) - 15, top: Math.round(tipY) - 15, side: 31 };
  const pixels = await page.evaluate(({ left, top, side }) => {
    const copy = new OffscreenCanvas(side, side).getContext("2d");
    copy.drawImage(document.querySelector("#space"), -left, -top);
    return [...copy.getImageData(0, 0, side, side).data];
  }, near);
  let [count, sumX, sumY] = [0, 0, 0];
  for (let i = 0; i < pixels.length / 4; ++i) {
    const [r, g, b] = pixels.slice(4 * i, 4 * i + 3);
    if (r < 190 || g < 130 || g - b < 40) continue;
    ++count;
    sumX += near.left + (i % near.side) + 0.5;
    sumY += near.top + Math.floor(i / near.side) + 0.5;
  }
  assert.ok(count >= 4, `the tip is not drawn at ${tipX}, ${tipY}`);
  assert.ok(Math.hypot(sumX / count - tipX, sumY / count - tipY) < 1, `the tip is drawn at ${sumX / count}, ${sumY / count}, not ${tipX}, ${tipY}`);
});

test("the pedal goes up with the page that held it", async () => {
  const other = await open();
  await until("the other page sees who steers", () => other.evaluate(() => window.torquer.viewer()?.steered));
  await page.bringToFront();
  await page.keyboard.down("Space");
  await until("the other page sees the X-ray", () => other.evaluate(() => window.torquer.viewer().xray));
  await page.close();
  await until("it goes out", () => other.evaluate(() => !window.torquer.viewer().xray));
  page = other;
  await page.bringToFront();
  // The other one steers from now on.
  const start = await state();
  await hold("ArrowUp", "3 mm further in", async () => (await state()).insertion > start.insertion + 3);
});

test("a viewer that was killed is found again, and steers on from there", async () => {
  await stateWord("Running");
  const start = await state();
  process.kill(Number(read("viewer.pid")), "SIGKILL");
  await stateWord("No connection");
  await stateWord("Running");
  await page.waitForTimeout(300);
  assert.ok(Math.abs((await state()).insertion - start.insertion) < 0.01, "the wire has jumped");
  await hold("ArrowUp", "3 mm further in", async () => (await state()).insertion > start.insertion + 3);
});

test("a simulator that is gone is named", async () => {
  process.kill(Number(read("simulator.pid")), "SIGKILL");
  await stateWord("silent");
  assert.match(await text("#xray-notice"), /does not answer/);
  assert.match(await text("#lamp"), /OFF/);
});

test("no script failed, and no request left the server", () => {
  assert.deepEqual(problems, []);
  const origin = new URL(url).origin;
  assert.ok(requests.length > 0);
  for (const request of requests) assert.ok(request.startsWith(origin) || request.startsWith("blob:"), request);
});
