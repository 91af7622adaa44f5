// Case page as a trainee uses it: a case is chosen, steered, ended and graded, then started again.
// It ends early if its simulator dies.
// usage: node tests/viewer/cases_page_test.mjs ROOT PROGRAMS [PICTURES]
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";

import { BrowserSession, until } from "./browser_session.mjs";

const [root, programs, pictures] = process.argv.slice(2);
const session = await BrowserSession.start(root, programs, "");
try {
  const page = await session.browser.newPage({ viewport: { width: 1280, height: 720 } });
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  const outside = [];
  page.on("request", (request) => {
    if (!request.url().startsWith(session.url)) outside.push(request.url());
  });
  await page.goto(session.url);
  const cases = () => page.evaluate(() => window.torquer.cases());
  const phase = (wanted) => until(wanted, async () => (await cases()).phase === wanted);
  const look = async (name) => pictures && page.screenshot({ path: join(pictures, `${name}.png`) });
  const start = (kind, title) => page.getByRole("button", { name: `${kind}: ${title}` }).click();
  const insertion = () => page.evaluate(() => window.torquer.state()?.instruments[0].insertionMm ?? NaN);

  // The list has every scene with a [case], the easiest first, each with its picture.
  const { cases: list } = await until("the cases", cases);
  const described = readdirSync(join(root, "host/scenes")).filter(
    (name) => name.endsWith(".toml") && /^\[case\]$/m.test(readFileSync(join(root, "host/scenes", name), "utf8")));
  assert.deepEqual(list.map(({ name }) => `${name}.toml`).sort(), described.sort());
  assert.deepEqual(list.map(({ difficulty }) => difficulty), list.map(({ difficulty }) => difficulty).sort());
  await until("the pictures are loaded", () => page.evaluate(() =>
    [...document.querySelectorAll("#case-list img")].every((image) => image.complete && image.naturalWidth === 480)));
  assert.equal(await page.locator("#case-list img").count(), list.length);
  await look("choose");
  // Keys have no effect on the list.
  await page.keyboard.press("ArrowUp");
  assert.equal(await page.evaluate(() => window.torquer.controls().pushMmS), 0);

  // Practice: the scene runs, and keys steer.
  await start("Practice", "Cerebral angiogram");
  await phase("starting");
  await look("starting");
  await phase("running");
  await until("the vessel is drawn", () => page.evaluate(() => window.torquer.space.showsVessel));
  assert.equal((await page.evaluate(() => window.torquer.scene().name)), "neuro_angio");
  await until("it runs", async () => (await page.locator("#state").textContent()) === "Running");
  const [{ title, task }] = list.filter(({ name }) => name === "neuro_angio");
  const header = () => page.locator("header").innerText();
  await until("the header has title and task", async () => (await header()).includes(title) && (await header()).includes(task));
  // The scene asks for a subtraction, whose first picture is blank.
  const mode = () => page.evaluate(() => window.torquer.readings()?.values.picture_mode);
  await until("plain fluoroscopy", async () => (await page.locator("#system-M span").textContent()) === "plain");
  const before = await insertion();
  await page.keyboard.down("ArrowUp");
  await page.keyboard.down("Space");
  await until("the wire is pushed", async () => (await insertion()) > before + 20);
  await until("a picture is taken", () => page.evaluate(() => window.torquer.pictures() > 3));
  assert.equal(await mode(), 0);
  await page.keyboard.up("Space");
  await page.keyboard.up("ArrowUp");
  assert.equal(await page.locator("body.exam").count(), 0);
  await look("running");
  const pushed = await insertion();

  // End of the case: the page shows the report.
  await page.locator("#case-end").click();
  await phase("ended");
  assert.equal((await cases()).problem, "");
  const report = page.frameLocator("#case-report");
  await report.locator("h1").waitFor();
  assert.match(await report.locator("body").innerText(), /neuro[_ ]angio/i);
  const folder = (await cases()).folder;
  assert.ok(folder.startsWith(join(session.folder, "sessions", "neuro_angio")));
  for (const name of ["session.lcmlog", "record.json", "report.html", "report.session.json"]) {
    assert.ok(existsSync(join(folder, name)), name);
  }
  await look("ended");
  // A replay by the simulator itself reproduces the recording.
  execFileSync(join(programs, "torquer-simulator"),
    ["--scene", join(root, "host/scenes/neuro_angio.toml"), "--replay", join(folder, "session.lcmlog")], { stdio: "ignore" });
  // The report's policy denies it any access to this page.
  const fetchReport = () => fetch(new URL("report.html", session.url));
  assert.match((await fetchReport()).headers.get("content-security-policy"), /default-src 'none'.*sandbox/);

  // Second run as an examination: from the start, without the teaching view.
  await page.locator("#case-close").click();
  await phase("choose");
  assert.equal((await fetchReport()).status, 404);
  await start("Examination", "Cerebral angiogram");
  await phase("running");
  await until("the examination is on", () => page.locator("body.exam").count());
  assert.ok(!(await page.locator("#teaching").isVisible()));
  await until("it runs", async () => (await page.locator("#state").textContent()) === "Running");
  assert.ok(Math.abs((await insertion()) - before) < 1, `starts at ${before}, not where it was left, ${pushed}`);
  assert.equal(await page.evaluate(() => window.torquer.readings()?.values.xray_pulses ?? 0), 0);
  // It is locked: neither a key nor a reload brings the teaching view back.
  assert.ok(!(await page.locator("#exam").isVisible()));
  await page.keyboard.press("KeyE");
  assert.equal(await page.locator("body.exam").count(), 1);
  const procedure = () => page.evaluate(() => window.torquer.readings()?.values.procedure_s ?? NaN);
  await until("some time has passed", async () => (await procedure()) > 4);
  const clock = async () => {
    const [, minutes, seconds] = (await page.locator("#clock").textContent()).match(/^(\d+):(\d\d) min$/);
    return 60 * minutes + Number(seconds);
  };
  await page.reload();
  await until("the examination is on after a reload", () => page.locator("body.exam").count());
  assert.ok(!(await page.locator("#teaching").isVisible()));
  await until("it runs again", async () => (await page.locator("#state").textContent()) === "Running");
  await until("the clock has the time since the start", async () => Math.abs((await clock()) - (await procedure())) < 1.5);
  await look("examination");

  // Record and report say that it was an examination.
  await page.locator("#case-end").click();
  await phase("ended");
  await page.frameLocator("#case-report").getByRole("heading", { name: "Examination: neuro_angio" }).waitFor();
  const examined = (await cases()).folder;
  for (const name of ["record.json", "report.session.json"]) {
    assert.equal(JSON.parse(readFileSync(join(examined, name), "utf8")).examination, true, name);
  }

  // A moving vessel is drawn in motion: the path of its fastest vertex matches the scene.
  await page.locator("#case-close").click();
  await phase("choose");
  await start("Practice", "Arteries that move");
  await phase("running");
  await until("the vessel is drawn", () => page.evaluate(() => window.torquer.space.showsVessel));
  const ways = await page.evaluate(async () => {
    const { space, state } = window.torquer;
    const places = new Map();
    for (const end = performance.now() + 3000; performance.now() < end;) {
      await new Promise(requestAnimationFrame);
      for (let vertex = 0; vertex < space.vertices; vertex += 97) {
        const at = space.vertexMm(vertex);
        const box = places.get(vertex) ?? { least: [...at], most: [...at] };
        for (const k of [0, 1, 2]) {
          box.least[k] = Math.min(box.least[k], at[k]);
          box.most[k] = Math.max(box.most[k], at[k]);
        }
        places.set(vertex, box);
      }
    }
    return [...places.values()].map(({ least, most }) => Math.hypot(...most.map((value, k) => value - least[k])));
  });
  // A heartbeat of 5 mm every 0.88 s, and part of a breath of 8 mm.
  assert.ok(Math.max(...ways) > 4 && Math.max(...ways) < 13, `the largest way is ${Math.max(...ways)} mm`);
  assert.ok(Math.min(...ways) < 0.1, `where the vessel rests it goes ${Math.min(...ways)} mm`);
  await page.locator("#case-end").click();
  await phase("ended");
  await page.locator("#case-close").click();
  await phase("choose");
  await start("Examination", "Cerebral angiogram");
  await phase("running");

  // The simulator dies: the page reports it, and the recording so far is graded.
  const simulator = execFileSync("pgrep", ["-f", `torquer-simulator.*${session.folder}`]).toString().trim().split("\n");
  assert.equal(simulator.length, 1);
  process.kill(Number(simulator[0]), "SIGKILL");
  await phase("ended");
  assert.match(await page.locator("#case-problem").textContent(), /torquer-simulator has ended too early/);
  await look("died");
  await page.locator("#case-again").click();
  await phase("running");
  await until("the examination is on again", () => page.locator("body.exam").count());

  // The viewer's programs end with it.
  process.kill(Number(session.read("viewer.pid")), "SIGKILL");
  await until("no program is left", () => {
    try {
      execFileSync("pgrep", ["-f", `torquer-(simulator|recorder).*${session.folder}`]);
      return false;
    } catch {
      return true;
    }
  });

  // On SIGTERM the viewer writes the report before it ends.
  await phase("choose");
  await start("Examination", "Cerebral angiogram");
  await phase("running");
  process.kill(Number(session.read("viewer.pid")), "SIGTERM");
  const last = join(session.folder, "sessions", "neuro_angio");
  await until("the report of the last session", () => {
    const newest = readdirSync(last).filter((name) => name !== "latest").sort().at(-1);
    return existsSync(join(last, newest, "report.html"));
  });
  assert.deepEqual(problems, []);
  assert.deepEqual(outside, []);
} finally {
  await session.stop();
}
console.log("1 passed, 0 failed");
