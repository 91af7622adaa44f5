// Browser session for tests of the page: a simulator, a viewer that steers and a headless Chromium.
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
      { detached: true, stdio: "inherit" },
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
