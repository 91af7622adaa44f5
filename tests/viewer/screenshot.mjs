// Generator of the README's picture of the page. Arteries of the neck fill under X-ray, with the
// instrument on its way.
// usage: node tests/viewer/screenshot.mjs ROOT PROGRAMS OUTPUT.jpg
import { BrowserSession, until } from "./browser_session.mjs";

const [root, programs, output] = process.argv.slice(2);
if (output === undefined) {
  console.error("usage: node tests/viewer/screenshot.mjs ROOT PROGRAMS OUTPUT.jpg");
  process.exit(2);
}
const session = await BrowserSession.start(root, programs, "neuro_angio.toml");
try {
  const page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } }); // size of a laptop's screen
  await page.goto(session.url);
  await until("the session runs", async () => (await page.locator("#state").textContent()).includes("Running"));
  const readings = (name) => page.evaluate((wanted) => window.torquer.readings()?.values[wanted] ?? 0, name);
  const hold = async (key, what, condition) => {
    await page.keyboard.down(key);
    await until(what, condition);
    await page.keyboard.up(key);
  };
  await page.keyboard.press("KeyF");
  await hold("KeyD", "LAO 30 and more", async () => Number((await page.locator("#lao").textContent()).match(/\d+/)[0]) >= 30);
  await page.keyboard.down("Space");
  await until("the mask is taken", () => page.evaluate(() => window.torquer.pictures() >= 3));
  await hold("KeyC", "30 mL", async () => (await readings("contrast_injected_mL")) >= 30);
  await hold("ArrowUp", "a little further", async () => (await page.evaluate(() => window.torquer.state().instruments[0].insertionMm)) > 452);
  const filled_s = (await readings("procedure_s")) + 0.6;
  await until("the neck is filled", async () => (await readings("procedure_s")) > filled_s);
  await page.screenshot({ path: output, type: "jpeg", quality: 90 });
} finally {
  await session.stop();
}
