// Patient monitor of the page, with the real simulator behind it: curves, figures, alarms, and its place.
// usage: node tests/viewer/patient_page_test.mjs ROOT PROGRAMS [--make]
// --make writes the golden picture again; look at it before you commit it.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { blockMeans, difference } from "./block_means.mjs";
import { BrowserSession, until } from "./browser_session.mjs";

const [root, programs, option] = process.argv.slice(2);
const TOLERANCE = 8; // of 255: another browser draws glyphs and lines a little differently
const RATE_PER_MIN = 70; // of [effects.flow] in neuro_angio
const SIZES = [[1280, 720], [1600, 900], [1920, 1080], [1024, 768], [420, 860], [860, 420]];
const problems = [];
let session, page;

const text = (selector) => page.locator(selector).textContent();
const figures = async () => {
  const [rate, pressure, mean] = await Promise.all(["#patient-rate b", "#patient-pressure b", "#patient-pressure i"].map(text));
  return { rate: Number(rate), systolic: Number(pressure.split("/")[0]), diastolic: Number(pressure.split("/")[1]), mean: Number(mean) };
};
const shown = () => page.evaluate(() => window.torquer.patient());
/** Waits until the page has drawn what it has now. */
const drawn = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
const give = (more) => page.evaluate((changes) => {
  window.torquer.take(window.torquer.state()); // the page counts its state as new
  window.torquer.take({ ...window.torquer.patient().patient, ...changes });
}, more);

before(async () => {
  session = await BrowserSession.start(root, programs, "neuro_angio.toml");
  page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  page.on("pageerror", (error) => problems.push(error.message));
  await page.goto(session.url);
  await until("it runs", async () => (await text("#state")).includes("Running"));
});

after(() => session?.stop());

test("rate and pressure are those of the curves", async () => {
  await until("figures of a beat", async () => (await text("#patient-pressure b")).includes("/"));
  // The compliant vessels take some beats to fill: half of the difference is left after each. Then all beats are alike.
  await until("ten beats since the start", async () => (await shown()).patient.beat_s > (9.9 * 60) / RATE_PER_MIN);
  // All samples of the last seconds, without a gap: a page that stalls for a second may lack some.
  const { last, beat, patient } = await until("three beats without a gap", async () => {
    const { samples, patient } = await shown();
    const beat = Math.round(60 / RATE_PER_MIN / patient.sample_s);
    const last = samples.filter(({ number }) => number > samples.at(-1).number - 3 * beat);
    return last.length === 3 * beat && { last, beat, patient };
  });
  const { rate, systolic, diastolic, mean } = await figures();
  assert.equal(rate, RATE_PER_MIN);
  const pressures = last.map(({ pressure }) => pressure);
  assert.ok(Math.abs(Math.max(...pressures) - systolic) < 1.5, `systolic ${systolic}`);
  assert.ok(Math.abs(Math.min(...pressures) - diastolic) < 1.5, `diastolic ${diastolic}`);
  assert.ok(Math.abs(pressures.reduce((sum, one) => sum + one) / pressures.length - mean) < 1.5, `mean ${mean}`);
  // As in a patient at rest.
  assert.ok(systolic > 100 && systolic < 140 && diastolic > 60 && diastolic < 90, `${systolic}/${diastolic}`);
  // Each R wave is a beat after the one before, and the pressure rises from there.
  const waves = last.filter(({ ecg }, k) => ecg > 0.9 && ecg >= (last[k - 1]?.ecg ?? 1) && ecg > (last[k + 1]?.ecg ?? 1));
  assert.ok(waves.length >= 2);
  for (const [k, wave] of waves.entries()) {
    if (k > 0) assert.ok(Math.abs(wave.number - waves[k - 1].number - beat) <= 1);
    const after = last.find(({ number }) => number === wave.number + Math.round(0.15 / patient.sample_s));
    if (after !== undefined) assert.ok(after.pressure > wave.pressure + 10, `${wave.pressure} to ${after.pressure}`);
  }
  assert.equal(await text("#patient-alarms"), "");
});

test("the curves are drawn and move", async () => {
  const colors = () => page.evaluate(() => {
    const canvas = document.querySelector("#patient canvas");
    const { data, width } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const columns = { green: new Set(), red: new Set() };
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] < 128) continue;
      if (data[i + 1] > data[i] + 40) columns.green.add((i / 4) % width);
      if (data[i] > data[i + 1] + 40) columns.red.add((i / 4) % width);
    }
    return { green: columns.green.size / width, red: columns.red.size / width, url: canvas.toDataURL() };
  });
  await until("both curves fill the screen", async () => {
    const { green, red } = await colors();
    return green > 0.8 && red > 0.8;
  });
  const { url } = await colors();
  await until("the beam moves", async () => (await colors()).url !== url);
});

test("the monitor covers no picture and is not cut off, in six windows and in an examination", async () => {
  const faults = () => page.evaluate(() => {
    const box = (selector) => document.querySelector(selector).getBoundingClientRect();
    document.querySelector("#patient").scrollIntoView({ block: "nearest" });
    const [patient, picture, room] = [box("#patient"), box("#plane"), box("#figures")];
    const apart = (a, b) => a.left >= b.right || a.right <= b.left || a.top >= b.bottom || a.bottom <= b.top;
    const found = [];
    if (!(patient.width > 200 && patient.height > 100)) found.push(`${patient.width} x ${patient.height}`);
    if (!apart(patient, picture)) found.push("covers the picture");
    for (const part of document.querySelectorAll("#patient > *")) {
      const { left, right, top, bottom, width } = part.getBoundingClientRect();
      if (width === 0) continue; // no alarm
      if (left < patient.left || right > patient.right || top < patient.top - 1 || bottom > patient.bottom + 1) found.push(part.id);
      if (part.scrollWidth > part.clientWidth + 1) found.push(`${part.id} is cut off`);
    }
    if (patient.left < room.left || patient.right > room.right) found.push("outside of its column");
    if (document.querySelector("#patient canvas").clientWidth < 90) found.push("narrow curves");
    return found;
  });
  for (const [width, height] of SIZES) {
    await page.setViewportSize({ width, height });
    for (const exam of [true, false]) {
      await page.keyboard.press("KeyE");
      await until(`the examination is ${exam}`, () => page.evaluate((on) => document.body.classList.contains("exam") === on, exam));
      await drawn();
      assert.deepEqual(await faults(), [], `${width} x ${height}, examination: ${exam}`);
    }
  }
  await page.setViewportSize({ width: 1280, height: 720 });
});

test("alarms are texts with their limits, and what is not known is --", async () => {
  // From here on the test is the only source of the patient's curves.
  process.kill(Number(session.read("simulator.pid")), "SIGSTOP");
  const base = {
    heart_rate_per_min: 45, systolic_mmHg: 172, diastolic_mmHg: 95, mean_mmHg: 120, wedged: true, alarms: 1 + 8 + 16,
    rate_limits_per_min: [50, 120], systolic_limits_mmHg: [90, 160],
  };
  const said = (wanted) => until(wanted, async () => {
    await give(base);
    return (await text("#patient-alarms")) === wanted;
  });
  await said("Heart rate 45 < 50 /min · Systolic 172 > 160 mmHg · Pressure damped: the tip closes the vessel");
  Object.assign(base, { heart_rate_per_min: 130, systolic_mmHg: 70, alarms: 2 + 4, wedged: false });
  await said("Heart rate 130 > 120 /min · Systolic 70 < 90 mmHg");
  Object.assign(base, { heart_rate_per_min: null, systolic_mmHg: null, diastolic_mmHg: null, mean_mmHg: null, alarms: 0 });
  await said("");
  await until("unknown figures", async () => {
    await give(base);
    return (await text("#patient-rate b")) === "--" && (await text("#patient-pressure b")) === "--" && (await text("#patient-pressure i")) === "--";
  });
});

test("the monitor looks as kept", async () => {
  const rate = 75;
  const samples = Array.from({ length: 1000 }, (_, n) => {
    const fraction = (n * 0.004 * rate / 60) % 1;
    const bell = (at, height, width) => height * Math.exp(-(((fraction - at + 1.5) % 1 - 0.5) ** 2) / (2 * width * width));
    return {
      ecg: bell(0, 1, 0.015) + bell(0.83, 0.2, 0.03) + bell(0.25, 0.3, 0.05),
      pressure: 75 + 45 * (fraction < 0.35 ? Math.sin((Math.PI * fraction) / 0.35) ** 2 : 0),
    };
  });
  const message = {
    heart_rate_per_min: rate, beat_s: 3.2, systolic_mmHg: 120, diastolic_mmHg: 75, mean_mmHg: 90, wedged: true, alarms: 16,
    first_sample: 0, ecg: samples.map(({ ecg }) => ecg), pressure_mmHg: samples.map(({ pressure }) => pressure),
  };
  // The page's clock stops, so that no state gets old before a busy browser has taken the picture.
  await page.evaluate(() => {
    window.nowMs = performance.now();
    performance.now = () => window.nowMs;
  });
  await until("its texts are shown", async () => {
    await give(message);
    return (await text("#patient-alarms")).startsWith("Pressure damped") && (await text("#patient-pressure b")) === "120/75";
  });
  await page.evaluate(() => (window.nowMs += 500));
  await drawn();
  const url = `data:image/jpeg;base64,${(await page.locator("#patient").screenshot({ type: "jpeg", quality: 90 })).toString("base64")}`;
  const path = join(root, "tests/viewer/golden/patient.jpg");
  if (option === "--make") writeFileSync(path, Buffer.from(url.split(",")[1], "base64"));
  const eye = await session.browser.newPage();
  const kept = `data:image/jpeg;base64,${readFileSync(path).toString("base64")}`;
  const { blocks, largest } = difference(await blockMeans(eye, kept), await blockMeans(eye, url), TOLERANCE);
  assert.equal(blocks, 0, `${blocks} blocks are not as kept, by up to ${largest.toFixed(1)} of 255`);
});

test("a scene without a monitor shows none", async () => {
  const scene = await page.evaluate(() => window.torquer.scene());
  const without = { ...scene, effects: scene.effects.filter((name) => name !== "patient_monitor") };
  await page.evaluate((one) => window.torquer.take(one), without);
  assert.equal(await page.locator("#patient").isVisible(), false);
  assert.deepEqual(problems, []);
});
