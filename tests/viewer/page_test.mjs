// Viewer page in headless Chromium, with the real simulator behind it.
// usage: node tests/viewer/page_test.mjs ROOT PROGRAMS
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { BrowserSession, checkMargins, holdKey, until } from "./browser_session.mjs";
import { checkInjector } from "./injector_checks.mjs";
import { checkWedges } from "./wedge_checks.mjs";

const [root, programs] = process.argv.slice(2);
const MS_PER_DEGREE = 1000 / 30; // speed of the arm
let session, page;
const problems = [];
const requests = [];

const text = (selector, where = page) => where.locator(selector).textContent();
const state = () => page.evaluate(() => {
  const now = window.torquer.state();
  return now && { insertion: now.instruments[0].insertionMm, rotation: now.instruments[0].rotationRad, status: now.status };
});
const stateWord = (word, where = page) => until(`the page says ${word}`, async () => (await text("#state", where)).includes(word));
const hold = (key, what, condition) => holdKey(page, key, what, condition);
async function open() {
  const opened = await session.browser.newPage({ viewport: { width: 1024, height: 600 } });
  opened.on("pageerror", (error) => problems.push(error.message));
  opened.on("request", (request) => requests.push(request.url()));
  await opened.goto(session.url);
  return opened;
}
// Gray values of the X-ray picture: number of distinct values, and their mean.
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
  session = await BrowserSession.start(root, programs, "neuro_angio.toml");
  page = await open();
});

after(() => session?.stop());

test("the page finds the session", async () => {
  await stateWord("Running");
  assert.equal(await text("#scene-name"), "neuro angio");
  assert.match(await text("#xray-notice"), /space bar/);
});

test("the space bar is the pedal, and the last picture stays", async () => {
  await hold("Space", "five pictures", () => page.evaluate(() => window.torquer.pictures() >= 5));
  // A busy computer decodes the pictures with a delay.
  await until("a picture is drawn", async () => (await grays()).kinds > 20);
  await until("the lamp goes out", async () => (await text("#lamp")).includes("OFF"));
  await until("the held picture is named", async () => (await text("#hold")).includes("Last image hold"));
  assert.ok((await grays()).kinds > 20, "the picture is gone");
});

test("the key of a foot switch is the pedal too", async () => {
  const taken = await page.evaluate(() => window.torquer.pictures());
  await hold("KeyB", "two pictures", () => page.evaluate((from) => window.torquer.pictures() >= from + 2, taken));
  await until("the lamp goes out", async () => (await text("#lamp")).includes("OFF"));
});

test("window and level are set by the mouse", async () => {
  const before = await grays();
  await page.mouse.move(300, 300);
  await page.mouse.down();
  await page.mouse.move(300, 340, { steps: 4 });
  await page.mouse.up();
  // A higher level makes the picture darker.
  await until("the picture is darker", async () => (await grays()).mean < before.mean - 20);
  await page.mouse.dblclick(300, 300);
  await until("the picture is as before", async () => Math.abs((await grays()).mean - before.mean) < 1);
});

test("arrows push and turn the wire, and a released key stops it", async () => {
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

// Turns the arm to an angle within a range, by short presses: a busy page releases a key late.
async function turn(angle, [less, more], [least, most]) {
  const degrees = async () => {
    const [, side, size] = (await text(angle)).match(/([A-Z]+) (\d+)/);
    return side === "LAO" || side === "CRA" ? Number(size) : -Number(size);
  };
  const resting = () => until("the arm rests", async () => {
    const before = await degrees();
    await page.waitForTimeout(300);
    return (await degrees()) === before && { degrees: before };
  });
  for (let now = await resting(); now.degrees < least || now.degrees > most; now = await resting()) {
    const away = (least + most) / 2 - now.degrees;
    await page.keyboard.press(away > 0 ? more : less, { delay: MS_PER_DEGREE * Math.abs(away) });
  }
}

// Sides of the patient at the left, right, top and bottom edge.
const sides = () => page.locator("#sides span").allTextContents();

test("the picture names the patient's sides until the next picture", async () => {
  // The first pictures were taken from the front, with the patient's left on the right.
  assert.deepEqual(await sides(), ["R", "L", "H", "F"]);
  const turnLeft = async () => {
    await turn("#lao", ["KeyA", "KeyD"], [25, 42]);
    await turn("#cra", ["KeyS", "KeyW"], [-15, 15]);
  };
  await turnLeft();
  assert.deepEqual(await sides(), ["R", "L", "H", "F"]);
  // The detector is to the left of the front, by less than 45 degrees: right and left come first.
  await until("a picture from the left", async () => {
    const taken = await page.evaluate(() => window.torquer.pictures());
    await hold("Space", "two pictures", () => page.evaluate((from) => window.torquer.pictures() >= from + 2, taken));
    if ((await sides()).join() === "RA,LP,H,F") return true;
    await turnLeft(); // a page that stalled had shown an old angle
    return false;
  });
});

test("no text covers the picture, and none is cut off, in any window", async () => {
  await checkMargins(page, ["#xray-picture"], [[1280, 720], [1600, 900], [1024, 768], [800, 1180], [420, 860], [860, 420]], 0.6);
});

test("the power injector injects its volume, and stops when it is aborted", () => checkInjector(page));

test("contrast is injected while C is held", async () => {
  const injected = async () => Number((await text("#dose")).match(/Contrast([\d.]+)/)?.[1] ?? 0);
  const start = await injected();
  await hold("KeyC", "more contrast", async () => (await injected()) > start + 2);
});

test("the X-ray system is set by keys: mode, pulses, field, shutters, wedge filters", async () => {
  const said = (key) => text(`#system-${key} span`);
  const pixel = (x, y) => page.evaluate(([column, row]) => {
    const canvas = document.querySelector("#xray-picture");
    return canvas.getContext("2d").getImageData(column * canvas.width, row * canvas.height, 1, 1).data[0];
  }, [x, y]);
  const scale = await text("#scale");
  for (const key of ["KeyM", "KeyR", "KeyZ", "KeyZ", "KeyK"]) await page.keyboard.press(key);
  assert.deepEqual([await said("M"), await said("R"), await said("Z"), await said("K")],
    ["plain", "7.5 pulses/s", "field ×2", "shutters 10 %"]);
  await hold("Space", "the shutters", async () => (await pixel(0.05, 0.5)) === 0 && (await pixel(0.5, 0.95)) === 0);
  assert.ok((await pixel(0.5, 0.5)) > 30, "the middle is covered");
  assert.equal(await text("#mask-text"), "", "a plain run has no mask");
  await checkWedges(page);
  await until("another scale", async () => (await text("#scale")) !== scale);
  for (const key of ["KeyM", "KeyM", "KeyM", "KeyM", "KeyR", "KeyR", "KeyR", "KeyZ", "KeyZ", "KeyK", "KeyK", "KeyK"]) await page.keyboard.press(key);
  await until("all as the scene", async () =>
    (await said("M")) === "as scene" && (await said("Z")) === "field ×1" && (await said("K")) === "shutters open");
  await hold("Space", "open shutters", async () => (await pixel(0.05, 0.5)) > 30);
  await until("the scale is as before", async () => (await text("#scale")) === scale);
});

test("the recorded loop is played again, until the next X-ray", async () => {
  // The beam goes off while a page stalls, so a loop of a busy page can be one picture.
  for (let lengthS = 0; lengthS < 0.3; lengthS = Number((await text("#loop-number")).match(/^loop \d+ of \d+, ([\d.]+) s$/)[1])) {
    const [taken, before] = await page.evaluate(() => [window.torquer.pictures(), window.torquer.drawn().picture]);
    await hold("Space", "six more pictures", () => page.evaluate((before) => window.torquer.pictures() >= before + 6, taken));
    await until("the pictures end", async () => (await text("#lamp")).includes("OFF") && (await text("#hold")).includes("Last image hold"));
    // The simulator ends the X-ray later than the page: a picture would end the loop.
    await until("the last image is held", () => page.evaluate((before) => {
      const { picture, held } = window.torquer.drawn();
      return held && picture > before;
    }, before));
  }
  await page.keyboard.press("KeyL");
  await until("the loop is named", async () => (await text("#hold")).includes("Recorded loop"));
  const seen = new Set();
  await until("its pictures differ", async () => seen.add((await grays()).mean).size >= 3);
  await page.keyboard.press("KeyL");
  await until("the last picture is back", async () => (await text("#hold")).includes("Last image hold"));
  await page.keyboard.press("KeyL");
  await hold("Space", "new pictures end the loop", async () => (await text("#lamp")).includes("ON") && !(await text("#hold")).includes("Recorded"));
});

test("the wheel magnifies the picture about the mouse, and its scale with it", async () => {
  const bar = () => page.evaluate(() => {
    const scale = document.querySelector("#scale");
    return scale.querySelector("i").getBoundingClientRect().width / Number(scale.textContent.match(/(\d+) mm/)[1]);
  });
  const box = () => page.evaluate(() => {
    const { left, top, width } = document.querySelector("#xray-picture").getBoundingClientRect();
    return { left, top, width };
  });
  const [pxPerMm, before] = [await bar(), await box()];
  const [x, y] = [before.left + 0.3 * before.width, before.top + 0.6 * before.width];
  await page.mouse.move(x, y);
  await page.mouse.wheel(0, -400);
  await until("it is magnified", async () => (await box()).width > 1.5 * before.width);
  const after = await box();
  assert.ok(Math.abs((x - after.left) / after.width - 0.3) < 0.005, "the place under the mouse has moved");
  assert.ok(Math.abs((y - after.top) / after.width - 0.6) < 0.005, "the place under the mouse has moved");
  const shown = await bar();
  assert.ok(Math.abs(shown / pxPerMm - after.width / before.width) < 0.05 * shown / pxPerMm, `${shown} px/mm, before ${pxPerMm}`);
  await page.mouse.dblclick(x, y);
  await until("it is as before", async () => Math.abs((await box()).width - before.width) < 0.5);
});

test("the pad pushes, turns and is the pedal, while it is held", async () => {
  await page.keyboard.press("KeyP");
  const middle = await page.evaluate(() => {
    const { left, top, width } = document.querySelector("#stick").getBoundingClientRect();
    return [left + width / 2, top + width / 2, width / 2];
  });
  const start = await state();
  await page.mouse.move(middle[0], middle[1]);
  await page.mouse.down();
  await page.mouse.move(middle[0] + 0.8 * middle[2], middle[1] - 0.8 * middle[2], { steps: 3 });
  await until("pushed and turned", async () => {
    const now = await state();
    return now.insertion > start.insertion + 2 && now.rotation > start.rotation + 0.2;
  });
  await page.mouse.up();
  const controls = () => page.evaluate(() => window.torquer.controls());
  assert.equal((await controls()).pushMmS, 0);
  await page.locator("#pad-xray").hover();
  await page.mouse.down();
  await until("X-ray", () => page.evaluate(() => window.torquer.viewer().xray));
  await page.mouse.up();
  await until("no X-ray", () => page.evaluate(() => !window.torquer.viewer().xray));
  assert.equal(await page.locator("#pad-next").isVisible(), false, "there is one instrument alone");
  // The button gives the stick to the C-arm, then to the table.
  const drag = async () => {
    const at = await page.locator("#stick").boundingBox();
    await page.mouse.move(at.x + at.width / 2, at.y + at.height / 2);
    await page.mouse.down();
    await page.mouse.move(at.x + at.width, at.y, { steps: 3 });
    const now = await controls();
    await page.mouse.up();
    return now;
  };
  assert.equal(await page.locator("#pad-up").isVisible(), false);
  await page.locator("#pad-mode").click();
  const arm = await drag();
  assert.ok(arm.laoRadS > 0 && arm.craRadS > 0 && arm.pushMmS === 0 && arm.tableLeftMmS === 0);
  await page.locator("#pad-mode").click();
  const table = await drag();
  assert.ok(table.tableLeftMmS > 0 && table.tableHeadMmS > 0 && table.laoRadS === 0 && table.pushMmS === 0);
  await page.locator("#pad-down").hover();
  await page.mouse.down();
  assert.ok((await controls()).tableUpMmS < 0);
  await page.mouse.up();
  await page.locator("#pad-mode").click();
  await page.keyboard.press("KeyP");
});

test("a gamepad steers like the keys", async () => {
  const gamepad = (axes, pressed) => page.evaluate(({ axes, pressed }) => {
    const buttons = Array.from({ length: 17 }, (_, k) => ({ pressed: pressed.includes(k), value: pressed.includes(k) ? 1 : 0 }));
    navigator.getGamepads = () => [null, { mapping: "standard", axes, buttons }];
  }, { axes, pressed });
  const start = await state();
  await gamepad([1, 1, 0, 0], []);
  await until("pulled and turned", async () => {
    const now = await state();
    return now.insertion < start.insertion - 2 && now.rotation > start.rotation + 0.2;
  });
  const controls = () => page.evaluate(() => window.torquer.controls());
  await gamepad([0.1, -0.1, 0.1, 0], [0, 1]);
  await until("both buttons", async () => (await controls()).xray && (await controls()).contrast);
  const near = await controls();
  assert.deepEqual([near.pushMmS, near.turnRadS, near.laoRadS], [0, 0, 0], "the dead zone moves");
  await gamepad([0, 0, -1, 0], []);
  await until("the C-arm to RAO", async () => (await controls()).laoRadS < 0 && (await controls()).craRadS === 0);
  await gamepad([0, 0, 0, -1], []);
  await until("the C-arm to CRA", async () => (await controls()).laoRadS === 0 && (await controls()).craRadS > 0);
  await gamepad([0, 0, 0, 0], [7, 12, 15]);
  await until("the table to head and left, and up", async () => {
    const { tableLeftMmS, tableHeadMmS, tableUpMmS } = await controls();
    return tableLeftMmS > 0 && tableHeadMmS > 0 && tableUpMmS > 0;
  });
  await gamepad([0, 0, 0, 0], []);
  await until("nothing", async () => {
    const { xray, contrast, laoRadS, craRadS } = await controls();
    return !xray && !contrast && laoRadS === 0 && craRadS === 0;
  });
});

test("each figure's last minute is plotted", async () => {
  const plotted = await page.evaluate(() => window.torquer.plotted());
  assert.deepEqual(Object.keys(plotted).sort(), ["force", "latency", "penetration", "rate", "residual", "solve"]);
  for (const [name, count] of Object.entries(plotted)) assert.ok(count > 8 && count <= 240, `${name}: ${count}`);
  const drawn = await page.evaluate(() => [...document.querySelectorAll(".history canvas")].map((canvas) => {
    const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let blue = 0;
    for (let i = 0; i < pixels.length; i += 4) if (pixels[i + 3] > 200 && pixels[i + 2] > pixels[i] + 60) ++blue;
    return blue;
  }));
  assert.equal(drawn.length, 6);
  for (const [k, blue] of drawn.entries()) assert.ok(blue > 5, `plot ${k} has no line`);
});

test("centerlines and the target are drawn, and the distance to it is shown", async () => {
  const guides = await page.evaluate(() => window.torquer.space.guidesShown());
  assert.ok(guides.lines > 20, `${guides.lines} lines`);
  await until("the way from the tip to the target", async () => {
    const [tip, said] = await page.evaluate(() => [
      window.torquer.state().instruments[0].tipMm, document.querySelector("#task").textContent]);
    const left = Math.hypot(...guides.target.map((value, axis) => value - tip[axis]));
    const shown = Number(said.match(/^Target([\d.]+) mm from the tip$/)?.[1]);
    return Math.abs(shown - left) <= 1;
  });
});

test("from inside the lumen the wall is all around, and a section opens it", async () => {
  // Shares of the 3D view with the background's color.
  const background = () => page.evaluate(() => {
    const view = document.querySelector("#space");
    const copy = new OffscreenCanvas(60, 40).getContext("2d");
    copy.drawImage(view, 0, 0, 60, 40);
    const pixels = copy.getImageData(0, 0, 60, 40).data;
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) if (pixels[i] < 24 && pixels[i + 1] < 30) ++count;
    return count / (pixels.length / 4);
  });
  const outside = await background();
  assert.ok(outside > 0.6, `${outside} is background`);
  await page.keyboard.press("KeyI");
  await until("the wall fills the view", async () => (await background()) < 0.1);
  await page.keyboard.press("KeyI");
  await until("it is seen from outside", async () => Math.abs((await background()) - outside) < 0.02);
  await page.keyboard.press("KeyX");
  await until("what is in front of the tip is gone", async () => (await background()) > outside + 0.003);
  await page.keyboard.press("KeyX");
  await until("it is whole again", async () => Math.abs((await background()) - outside) < 0.002);
});

test("an examination shows the X-ray and a clock alone", async () => {
  await page.keyboard.press("KeyE");
  assert.equal(await page.locator("#teaching").isVisible(), false);
  assert.match(await text("#clock"), /^0:0\d min$/);
  await until("the clock goes", async () => (await text("#clock")) !== "0:00 min");
  await until("no distance is shown", async () => (await text("#task")) === "Targetnot reached");
  await page.keyboard.press("KeyE");
  assert.equal(await page.locator("#teaching").isVisible(), true);
  assert.equal(await page.locator("#clock").isVisible(), false);
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
  // The tip's yellow ball, found by its pixels.
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

test("closing the page that holds the pedal releases it", async () => {
  const other = await open();
  await until("the other page sees who steers", () => other.evaluate(() => window.torquer.viewer()?.steered));
  await page.bringToFront();
  await page.keyboard.down("Space");
  await until("the other page sees the X-ray", () => other.evaluate(() => window.torquer.viewer().xray));
  await page.close();
  await until("it goes out", () => other.evaluate(() => !window.torquer.viewer().xray));
  page = other;
  await page.bringToFront();
  // From now on the other page steers.
  const start = await state();
  await hold("ArrowUp", "3 mm further in", async () => (await state()).insertion > start.insertion + 3);
});

test("a viewer that was killed is found again, and steers on from there", async () => {
  await stateWord("Running");
  const start = await until("the wire rests where the hand is", async () => {
    const before = await state();
    await page.waitForTimeout(300);
    return Math.abs((await state()).insertion - before.insertion) < 1e-6 ? before : null;
  });
  process.kill(Number(session.read("viewer.pid")), "SIGKILL");
  await stateWord("No connection");
  await stateWord("Running");
  await page.waitForTimeout(300);
  assert.ok(Math.abs((await state()).insertion - start.insertion) < 0.01, "the wire has jumped");
  await hold("ArrowUp", "3 mm further in", async () => (await state()).insertion > start.insertion + 3);
});

test("a missing simulator is named", async () => {
  process.kill(Number(session.read("simulator.pid")), "SIGKILL");
  await stateWord("silent");
  assert.match(await text("#xray-notice"), /does not answer/);
  assert.match(await text("#lamp"), /OFF/);
});

test("no script failed, and no request left the server", () => {
  assert.deepEqual(problems, []);
  const origin = new URL(session.url).origin;
  assert.ok(requests.length > 0);
  for (const request of requests) assert.ok(request.startsWith(origin) || request.startsWith("blob:"), request);
});
