// Generator of the pictures in the list of cases, host/scenes/pictures/NAME.jpg. Each shows the 3D
// view of a case after its first instrument was pushed for a while.
// usage: node tests/viewer/case_pictures.mjs ROOT PROGRAMS FOLDER [NAME...]
import { join } from "node:path";

import { BrowserSession, until } from "./browser_session.mjs";

const [root, programs, folder, ...names] = process.argv.slice(2);
if (folder === undefined) {
  console.error("usage: node tests/viewer/case_pictures.mjs ROOT PROGRAMS FOLDER [NAME...]");
  process.exit(2);
}
const PUSH_MS = 1500;
const session = await BrowserSession.start(root, programs, "");
try {
  const page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(session.url);
  const cases = await until("the cases are there", () => page.evaluate(() => window.torquer.cases()?.cases));
  const phase = (wanted) => until(wanted, () => page.evaluate((p) => window.torquer.cases().phase === p, wanted));
  for (const { name, title } of cases) {
    if (names.length > 0 && !names.includes(name)) continue;
    await page.getByRole("button", { name: `Practice: ${title}` }).click();
    await phase("running");
    await until("the vessel is drawn", () => page.evaluate(() => window.torquer.space.showsVessel));
    await page.keyboard.down("ArrowUp");
    await page.waitForTimeout(PUSH_MS);
    await page.keyboard.up("ArrowUp");
    // Shows the 3D view alone, at the size of the card.
    await page.evaluate((style) => {
      const view = document.querySelector("#teaching");
      view.style.cssText = style;
      for (const corner of view.querySelectorAll(".corner")) corner.style.display = "none";
    }, "position: fixed; inset: 0; z-index: 9; width: 480px; height: 300px; border: 0");
    await page.keyboard.press("KeyV");
    await page.waitForTimeout(700);
    await page.screenshot({ path: join(folder, `${name}.jpg`), type: "jpeg", quality: 82, clip: { x: 0, y: 0, width: 480, height: 300 } });
    await page.evaluate(() => (document.querySelector("#teaching").style.cssText = ""));
    await page.locator("#case-end").click();
    await phase("ended");
    await page.locator("#case-close").click();
    await phase("choose");
    console.log(name);
  }
} finally {
  await session.stop();
}
