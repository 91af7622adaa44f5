// The page's power injector: set-up, arming, an injection, an abort, and the patient's limit.
import assert from "node:assert/strict";
import { checkMargins, until } from "./browser_session.mjs";

/** Injects 3 mL, and a part of 100 mL, which would take 20 s. */
export async function checkInjector(page) {
  const text = (selector) => page.locator(selector).textContent();
  const value = (name) => page.evaluate((reading) => window.torquer.readings().values[reading], name);
  const phase = (what, wanted) => until(what, async () => (await value("injector_phase")) === wanted);
  const setUp = async (key, mL) => {
    await page.locator(`#injector-${key}`).fill(String(mL));
    await page.locator(`#injector-${key}`).press("Enter");
  };
  assert.equal(await page.locator("#injector").isVisible(), false);
  await page.keyboard.press("Digit7");
  // The set-up of the scene.
  const shown = () => page.locator("#injector input").evaluateAll((inputs) => inputs.map((input) => input.value));
  assert.deepEqual(await shown(), ["30", "15", "1", "0.3"]);
  await checkMargins(page, ["#xray-picture"], [[1280, 720], [420, 860]], 0.6);
  await page.setViewportSize({ width: 1024, height: 600 });

  await setUp("rate_mL_s", 46);
  assert.equal(await text("#injector-warning"), "Rate: give 0.1 to 45 mL/s");
  await page.keyboard.press("Digit1");
  await setUp("volume_mL", 150);
  await setUp("rate_mL_s", 30);
  await setUp("delay_s", 0);
  assert.equal(await value("injector_phase"), 0, "a bad set-up was armed");
  await page.keyboard.press("Digit3");
  // It was not armed. Beyond the limit of 290 mL, the page warns before it is.
  const before = await value("contrast_injected_mL");
  assert.equal(await text("#injector-warning"), "");
  const warning = await page.evaluate(() => {
    const readings = window.torquer.readings();
    window.torquer.take({ ...readings, values: { ...readings.values, contrast_injected_mL: 141 } });
    return document.querySelector("#injector-warning").textContent;
  });
  assert.equal(warning, "above the patient's limit: 291 of 290 mL");

  await setUp("volume_mL", 3);
  await page.keyboard.press("Digit1");
  await phase("armed", 1);
  await until("it says so", async () => (await text("#dose")).includes("Injectorarmed 3.0 mL"));
  await page.locator("#injector-fire").click();
  await phase("complete", 3);
  await until("the figures", async () => (await text("#injector-state")) === "3.0 mL done");
  assert.ok(Math.abs((await value("contrast_injected_mL")) - before - 3) < 1e-6);

  await setUp("volume_mL", 100);
  await setUp("rate_mL_s", 5);
  await page.locator("#injector-arm").click();
  await phase("armed again", 1);
  await page.keyboard.press("Digit3");
  await phase("injecting", 2);
  await until("it says so", async () => (await text("#injector-state")).endsWith(" mL left"));
  await page.keyboard.press("Digit3");
  await phase("aborted", 4);
  const part = (await value("contrast_injected_mL")) - before - 3;
  assert.ok(part > 0 && part < 100, `${part} mL`);
  assert.equal(await value("injection_aborted"), 1);
  await page.keyboard.press("Digit7");
  assert.equal(await page.locator("#injector").isVisible(), false);
}
