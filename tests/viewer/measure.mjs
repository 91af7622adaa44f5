// Benchmark of the page's speed on this machine, with software rendering; not a test.
// usage: node tests/viewer/measure.mjs ROOT PROGRAMS [--json]
//
// pedal    from the key that presses the pedal to the canvas that has the first new picture
// hand     from an arrow key to the 3D view that has been drawn with a wire that has moved
// state    from a state's arrival in the page to the 3D view that has been drawn with it or a newer one
// frames   of the 3D view, 800 x 600 pixels, in a second in which each frame is drawn
import { BrowserSession, until } from "./browser_session.mjs";

const [root, programs, option] = process.argv.slice(2);
if (programs === undefined || (option !== undefined && option !== "--json")) {
  console.error("usage: node tests/viewer/measure.mjs ROOT PROGRAMS [--json]");
  process.exit(2);
}
const XRAY_SCENE = "neuro_angio";
const SCENES = [XRAY_SCENE, "everything", "beating_heart"]; // the largest surface; the largest that moves
const PRESSES = 60;
const FRAMES_S = 5;

// Runs in the page before its own scripts: records arrival and display times.
function watch() {
  const seen = { pictureNumber: -1, fresh: false, pictureMs: [], keyMs: 0, arrivedMs: [], shownMs: [] };
  window.seen = seen;
  const Socket = window.WebSocket;
  window.WebSocket = class extends Socket {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", ({ data }) => {
        if (typeof data === "string") return;
        const view = new DataView(data);
        if (view.getUint8(0) === 1) seen.arrivedMs.push(performance.now());
        if (view.getUint8(0) !== 2 || view.getUint16(2, true) !== 0) return;
        const number = view.getFloat64(8, true);
        if (number !== seen.pictureNumber) seen.fresh = true;
        seen.pictureNumber = number;
      });
    }
  };
  const draw = CanvasRenderingContext2D.prototype.drawImage;
  CanvasRenderingContext2D.prototype.drawImage = function (...given) {
    draw.apply(this, given);
    if (this.canvas.id !== "xray-picture" || !seen.fresh) return;
    seen.fresh = false;
    seen.pictureMs.push(performance.now());
  };
  addEventListener("keydown", (event) => {
    if (!event.repeat) seen.keyMs = event.timeStamp;
  }, true);
  addEventListener("load", () => {
    let frames = 0;
    const after = () => {
      requestAnimationFrame(after);
      const { space } = window.torquer ?? {};
      if (space === undefined || space.frames === frames) return;
      frames = space.frames;
      seen.insertionMm = space.drawn()?.instruments[0].insertionMm;
      seen.drawnMs = performance.now();
      for (const arrivedMs of seen.arrivedMs.splice(0)) seen.shownMs.push(seen.drawnMs - arrivedMs);
    };
    requestAnimationFrame(after);
  });
}

const figures = (values) => {
  const sorted = [...values].sort((a, b) => a - b);
  const at = (share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
  return { count: sorted.length, median_ms: at(0.5), p99_ms: at(0.99), max_ms: sorted.at(-1) };
};
const rest = (page, ms) => page.waitForTimeout(ms);

async function open(session) {
  const page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.addInitScript(watch);
  await page.goto(session.url);
  await until("states come", () => page.evaluate(() => window.torquer?.state() != null));
  await until("the vessel is drawn", () => page.evaluate(() => window.torquer.space.showsVessel));
  await rest(page, 1000);
  return page;
}

async function pedal(page) {
  const taken = [];
  for (let k = 0; k < PRESSES; ++k) {
    // Each press has another phase relative to the pulses.
    await rest(page, 500 + 37 * (k % 9));
    await page.evaluate(() => (window.seen.pictureMs.length = 0));
    await page.keyboard.down("Space");
    await until("a picture", () => page.evaluate(() => window.seen.pictureMs.length > 0));
    await page.keyboard.up("Space");
    taken.push(await page.evaluate(() => window.seen.pictureMs[0] - window.seen.keyMs));
  }
  return figures(taken);
}

async function hand(page) {
  const taken = [];
  for (let k = 0; k < PRESSES; ++k) {
    await rest(page, 400 + 37 * (k % 9));
    await page.evaluate(() => {
      const { seen } = window;
      const start = seen.insertionMm;
      seen.moved = new Promise((done) => {
        const look = () => (seen.insertionMm !== start ? done(seen.drawnMs - seen.keyMs) : requestAnimationFrame(look));
        requestAnimationFrame(look);
      });
    });
    const key = k % 2 === 0 ? "ArrowUp" : "ArrowDown";
    await page.keyboard.down(key);
    taken.push(await page.evaluate(() => window.seen.moved));
    await page.keyboard.up(key);
  }
  return figures(taken);
}

async function frames(page) {
  return page.evaluate(async (seconds) => {
    const { space } = window.torquer;
    const view = document.querySelector("#teaching");
    Object.assign(view.style, { position: "fixed", left: 0, top: 0, width: "800px", height: "600px", zIndex: 10, border: 0 });
    const canvas = document.querySelector("#space");
    await new Promise((done) => setTimeout(done, 1000));
    const before = space.frames;
    const startMs = performance.now();
    while (performance.now() - startMs < 1000 * seconds) {
      space.changed = true;
      await new Promise((done) => requestAnimationFrame(done));
    }
    const perS = (1000 * (space.frames - before)) / (performance.now() - startMs);
    return { per_s: perS, width: canvas.clientWidth, height: canvas.clientHeight };
  }, FRAMES_S);
}

function print({ scene, frames: shown, ...times }) {
  console.log(scene);
  for (const [name, { count, median_ms, p99_ms, max_ms }] of Object.entries(times)) {
    console.log(`  ${name.padEnd(7)} p50 ${median_ms.toFixed(1)} ms, p99 ${p99_ms.toFixed(1)} ms, max ${max_ms.toFixed(1)} ms of ${count}`);
  }
  console.log(`  frames  ${shown.per_s.toFixed(1)} a second, ${shown.width} x ${shown.height}`);
}

const measured = [];
for (const scene of SCENES) {
  const session = await BrowserSession.start(root, programs, `${scene}.toml`);
  try {
    const page = await open(session);
    const found = { scene };
    if (scene === XRAY_SCENE) found.pedal = await pedal(page);
    found.hand = await hand(page);
    await page.evaluate(() => (window.seen.shownMs.length = 0));
    await rest(page, 3000);
    found.state = figures(await page.evaluate(() => window.seen.shownMs));
    found.frames = await frames(page);
    measured.push(found);
    if (option !== "--json") print(found);
  } finally {
    await session.stop();
  }
}
if (option === "--json") console.log(JSON.stringify(measured));
