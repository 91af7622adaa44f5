// Browser session for tests of the page: a simulator, a viewer that steers and a headless Chromium.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const BROWSER = "/usr/bin/chromium";
const PATIENCE_MS = 60000; // for a busy machine; nothing is measured by it

/** Polls `condition` and returns its first true value. Throws an error that names `what` on timeout. */
export async function until(what, condition) {
  const end = Date.now() + PATIENCE_MS;
  while (Date.now() < end) {
    const value = await condition();
    if (value) return value;
    await new Promise((done) => setTimeout(done, 50));
  }
  throw new Error(`not within ${PATIENCE_MS} ms: ${what}`);
}

/** Holds a key of a page until `condition` is true, and returns its value. */
export async function holdKey(page, key, what, condition) {
  await page.keyboard.down(key);
  try {
    return await until(what, condition);
  } finally {
    await page.keyboard.up(key);
  }
}

export function startBrowser(root) {
  if (!existsSync(BROWSER)) throw new Error("no Chromium; install it with: host/install_packages test");
  const { chromium } = createRequire(resolve(root, "host/viewer/web/package.json"))("playwright-core");
  return chromium.launch({
    executablePath: BROWSER,
    args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
      "--disable-component-update", "--disable-sync"],
  });
}

export class BrowserSession {
  /** Starts a session with a scene of host/scenes, or with that of an absolute path. `programs`: program folder of a build. `more`: "device", as in tests/viewer/session. */
  static async start(root, programs, scene, ...more) {
    const session = new BrowserSession();
    session.folder = mkdtempSync(join(tmpdir(), "torquer-page-"));
    session.processes = spawn(
      "bash",
      [join(root, "host/viewer/with_socket"), "0", "sh", join(root, "host/bus/private_network"), "bash",
        join(root, "tests/viewer/session"), programs, resolve(root, "host/scenes", scene), session.folder, ...more],
      { detached: true, stdio: ["pipe", "inherit", "inherit"] },
    );
    try {
      session.url = await until("the viewer prints its link", () => session.read("viewer.log").match(/^http:\S+\n/m)?.[0].trim());
      session.browser = await startBrowser(root);
    } catch (error) {
      await session.stop();
      throw error;
    }
    return session;
  }

  /** Output of a process of the session; "" before it has printed. */
  read(name) {
    const path = join(this.folder, name);
    return existsSync(path) ? readFileSync(path, "utf8") : "";
  }

  async stop() {
    await this.browser?.close();
    try {
      if (this.processes?.pid) process.kill(-this.processes.pid, "SIGKILL");
    } catch {
      // The processes have already ended.
    }
    rmSync(this.folder, { recursive: true, force: true });
  }
}

// Longest texts of the margin, by selector; those of the dose by term. A long session has all of them at once.
const LONGEST = {
  "#hold": "Last image hold", "#picture-warning": "View moved: mask lost", "#lao": "RAO 120°", "#cra": "CAU 45°",
  "#system-M span": "subtraction", "#system-R span": "7.5 pulses/s", "#system-K span": "shutters 30 %",
  "#system-acquisition span": "acquires subtraction 6/s", "#system-U span": "wedge right", "#system-9 span": "50 %", "#system-T span": "-60°",
  "#field :first-child": "field 48 cm", "#source-distance": "SID 120 cm", "#loop-number": "loop 10 of 10, 123.45 s",
  "#table-place :first-child": "table R 120 H 150", "#table-place :last-child": "height −120 mm",
};
const LONGEST_DOSE = {
  "Procedure": "123:45 min", "X-ray": "100:00 min", "Tube": "150 kV 1000 mA", "Air kerma": "9999 mGy", "Kerma × area": "999 Gy cm²",
  "Air kerma A+B": "9999 mGy", "Kerma × area A+B": "999 Gy cm²", "Injector": "aborted 150 mL", "Contrast": "291 > 290 mL",
};

/**
 * Checks windows of some sizes: the margin's text covers no picture and is not cut off; a picture has at least that part
 * of the width. The margin is measured with the longest texts that it can show.
 */
export async function checkMargins(page, pictures, sizes, leastPart) {
  const usual = page.viewportSize();
  for (const [width, height] of sizes) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(300);
    const found = await page.evaluate(({ selectors, longest, longestDose }) => {
      // The page writes its own texts again after this function.
      for (const [selector, text] of Object.entries(longest)) document.querySelector(selector).textContent = text;
      for (const { textContent: term, nextElementSibling: value } of document.querySelectorAll("#dose dt")) {
        if (longestDose[term] === undefined) throw new Error(`add the longest text of ${term}`);
        value.textContent = longestDose[term];
      }
      const at = (shown) => shown.getBoundingClientRect();
      const shown = selectors.map((selector) => at(document.querySelector(selector)));
      const room = at(document.querySelector("#xray"));
      const apart = (a, b) => a.left >= b.right - 1 || a.right <= b.left + 1 || a.top >= b.bottom - 1 || a.bottom <= b.top + 1;
      const inside = (a) => a.left >= room.left - 1 && a.right <= room.right + 1 && a.top >= room.top - 1 && a.bottom <= room.bottom + 1;
      const bad = [...document.querySelectorAll("#xray-margin *")].filter((one) => {
        const box = at(one);
        return box.width > 0 && box.height > 0 && !(shown.every((picture) => apart(box, picture)) && inside(box));
      });
      const part = Math.min(...shown.map((picture) => picture.width / Math.min(room.width, innerHeight)));
      return { bad: bad.map((one) => `${one.tagName} ${one.id} ${one.textContent.trim().slice(0, 20)}`), part };
    }, { selectors: pictures, longest: LONGEST, longestDose: LONGEST_DOSE });
    assert.deepEqual(found.bad, [], `${width} x ${height}`);
    assert.ok(found.part > leastPart, `a picture has ${found.part} of the width in ${width} x ${height}`);
  }
  await page.setViewportSize(usual);
}
