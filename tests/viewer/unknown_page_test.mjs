// Page that gets values which are not known, as after a tick that did not converge, and damaged pictures.
// usage: node tests/viewer/unknown_page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { BrowserSession, until } from "./browser_session.mjs";

const [root, programs] = process.argv.slice(2);
let session, page;
const problems = [];

// Runs in the page before its own program: each message passes window.change, which returns what the page gets.
function changeMessages() {
  const own = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage");
  Object.defineProperty(WebSocket.prototype, "onmessage", {
    set(take) {
      own.set.call(this, (event) => {
        const data = window.change?.(event.data) ?? event.data;
        if (data !== "") take({ data });
      });
    },
  });
}

before(async () => {
  session = await BrowserSession.start(root, programs, "neuro_angio.toml");
  page = await session.browser.newPage({ viewport: { width: 1024, height: 600 } });
  page.on("pageerror", (error) => problems.push(error.message));
  await page.addInitScript(changeMessages);
  await page.goto(session.url);
  await until("the page shows readings", () => page.evaluate(() => window.torquer?.readings() != null));
});

after(() => session?.stop());

const allText = () => page.evaluate(() => document.body.textContent);
const figure = (title) => page.evaluate((name) =>
  [...document.querySelectorAll(".history")].find((one) => one.ariaLabel === name)?.querySelector("b").textContent, title);
async function showsNoNumberOfUnknown() {
  assert.deepEqual((await allText()).match(/.*(NaN|null|undefined|Infinity).*/g), null);
  assert.deepEqual(problems, []);
}

test("contrast above the patient's limit is a warning", async () => {
  const shows = async (injected, limit, text, over) => {
    await page.evaluate((values) => {
      window.change = (data) => {
        const message = typeof data === "string" ? JSON.parse(data) : {};
        if (message.kind !== "readings") return data;
        Object.assign(message.values, values);
        return JSON.stringify(message);
      };
    }, { contrast_injected_mL: injected, contrast_limit_mL: limit });
    const row = page.locator("#dose dd[data-over]");
    await until(text, async () => (await row.textContent()) === text);
    assert.equal(await row.getAttribute("data-over"), String(over));
  };
  await shows(290, 290, "290 of 290 mL", false);
  await shows(290.6, 290, "291 > 290 mL", true);
  await shows(12.5, undefined, "12.5 mL", false);
});

test("unknown readings are shown as unknown", async () => {
  await page.evaluate(() => {
    window.change = (data) => {
      const message = typeof data === "string" ? JSON.parse(data) : {};
      if (message.kind !== "readings") return data;
      for (const name of ["target_reached_s", "safe_success", "wall_force_max_mN", "wall_force_largest_mN", "procedure_s", "air_kerma_mGy"]) {
        message.values[name] = null;
      }
      message.values.target_reached = 1;
      return JSON.stringify(message);
    };
  });
  const task = await until("the target counts as reached", async () => {
    const shown = await page.locator("#task").textContent();
    return shown.includes("reached") && shown;
  });
  assert.match(task, /reached at an unknown time; its safety is not known/);
  await until("the dose is not known", async () => (await allText()).includes("not known"));
  assert.equal(await until("the force is shown", () => figure("Wall force")), "–");
  await showsNoNumberOfUnknown();
});

test("a state with invalid figures shows none", async () => {
  await page.evaluate(() => {
    window.change = (data) => {
      if (typeof data === "string" || new DataView(data).getUint8(0) !== 1) return data;
      const view = new DataView(data);
      for (const offset of [24, 32, 48, 64, 72, 80, 88]) view.setFloat64(offset, NaN, true);
      const first = 64 + 64 * view.getUint16(2, true);
      const nodes = view.getUint32(4, true);
      for (let at = first + 12 * nodes; at < first + 20 * nodes; at += 4) view.setFloat32(at, NaN, true);
      return data;
    };
  });
  for (const title of ["Residual", "Penetration of the wall"]) {
    await until(`${title} is unknown`, async () => (await figure(title)) === "–");
  }
  await until("the insertion is unknown", async () => (await page.locator("#instruments").textContent()).includes("–"));
  await showsNoNumberOfUnknown();
});

test("figures between two slow states are unknown, not 0", async () => {
  const seen = await page.evaluate(async () => {
    let last = 0;
    window.change = (data) => {
      if (typeof data === "string" || new DataView(data).getUint8(0) !== 1) return data;
      if (performance.now() - last < 600) return "";
      last = performance.now();
      const view = new DataView(data);
      view.setFloat64(24, 1e-5, true);
      view.setFloat64(32, 7, true);
      return data;
    };
    const shown = new Set();
    const end = performance.now() + 4000;
    while (performance.now() < end) {
      for (const one of document.querySelectorAll(".history")) {
        if (one.ariaLabel === "Penetration of the wall") shown.add(one.querySelector("b").textContent);
      }
      await new Promise((done) => setTimeout(done, 20));
    }
    return [...shown];
  });
  assert.ok(seen.includes("7.00 µm"), seen.join(" | "));
  assert.ok(!seen.includes("0 µm"), seen.join(" | "));
});

test("a damaged picture is named for seconds, also while others arrive", async () => {
  const shownMs = await page.evaluate(async () => {
    window.change = undefined;
    const shown = () => document.querySelector("#xray-margin").textContent.includes("Picture lost: damaged");
    // Times at which the text appears and goes, however late this function looks.
    const changesMs = [];
    new MutationObserver(() => {
      if (shown() === (changesMs.length === 0)) changesMs.push(performance.now());
    }).observe(document.querySelector("#xray-margin"), { subtree: true, childList: true, characterData: true });
    const jpeg = new Uint8Array([255, 216, 255, 0]);
    window.torquer.take({ kind: "picture", held: false, lateral: false, number: 1, timeS: 1, laoRad: 0, craRad: 0, width: 8, height: 8, jpeg });
    const endMs = performance.now() + 60000;
    while (changesMs.length < 2 && performance.now() < endMs) await new Promise((done) => setTimeout(done, 20));
    return changesMs[1] - changesMs[0];
  });
  assert.ok(shownMs > 4900, `shown for ${shownMs} ms`);
  assert.deepEqual(problems, []);
});
