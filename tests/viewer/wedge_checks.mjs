// The page's wedge filters: keys, buttons, and the live picture behind them.
import assert from "node:assert/strict";
import { checkMargins, holdKey } from "./browser_session.mjs";

// Mean gray of a tenth of the picture, whose middle is there.
const gray = (page, x, y) => page.evaluate(([column, row]) => {
  const canvas = document.querySelector("#xray-picture");
  const [width, height] = [canvas.width, canvas.height];
  const { data } = canvas.getContext("2d").getImageData((column - 0.05) * width, (row - 0.05) * height, 0.1 * width, 0.1 * height);
  return data.filter((_, k) => k % 4 === 0).reduce((sum, value) => sum + value, 0) / (data.length / 4);
}, [x, y]);

/** Moves and turns the wedges over a shown plain picture of half the field, and takes them out again. */
export async function checkWedges(page) {
  const press = async (...keys) => {
    for (const key of keys) await page.keyboard.press(key);
  };
  const said = () => Promise.all(["U", "9", "T"].map((key) => page.locator(`#system-${key} span`).textContent()));
  const [left, right, low] = [await gray(page, 0.16, 0.6), await gray(page, 0.84, 0.6), await gray(page, 0.5, 0.84)];
  await press("KeyT", "Digit9", "KeyU", "Digit9", "Digit9"); // the first two have no effect without a wedge
  assert.deepEqual(await said(), ["wedge left", "50 %", "0°"]);
  await holdKey(page, "Space", "the left wedge", async () => (await gray(page, 0.16, 0.6)) < left - 20);
  assert.ok((await gray(page, 0.84, 0.6)) > right - 5, "the right side is as before");
  await checkMargins(page, ["#xray-picture"], [[1280, 720], [1024, 768], [420, 860], [860, 420]], 0.6);
  await press("KeyU", "KeyT", "KeyT", "KeyT");
  assert.deepEqual(await said(), ["wedge right", "50 %", "90°"]);
  await holdKey(page, "Space", "the right wedge, from below", async () => (await gray(page, 0.5, 0.84)) < low - 20);
  await page.locator("#system-T").click();
  await page.locator("#system-9").click();
  assert.deepEqual(await said(), ["wedge right", "10 %", "-60°"]);
  await press("KeyT", "KeyT", "KeyU", "KeyU");
  assert.equal((await said())[0], "wedges out");
  await press("KeyU"); // it comes in as far as the last one
  assert.deepEqual(await said(), ["wedge left", "10 %", "0°"]);
  await press("KeyU", "KeyU", "KeyU");
  assert.equal(await page.locator("#system-9").isVisible(), false);
}
