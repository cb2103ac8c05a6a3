// Headless Chromium, driven through its pipe by the DevTools protocol. No network.
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

export const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";
export const hasChromium = () => existsSync(CHROMIUM);
const WEBGL = ["--enable-unsafe-swiftshader"];
/** WebGPU on the same software rasteriser. */
export const WEBGPU = ["--enable-unsafe-webgpu", "--enable-unsafe-swiftshader", "--use-angle=swiftshader",
                       "--ignore-gpu-blocklist", "--enable-features=Vulkan", "--use-vulkan=swiftshader"];

export class Browser {
  #waiting = new Map();
  #sessions = new Map();
  #last = 0;

  constructor(flags = WEBGL) {
    this.folder = mkdtempSync(join(tmpdir(), "rbvh_browser_"));
    this.process = spawn(CHROMIUM, ["--headless", "--no-sandbox", "--remote-debugging-pipe", "--disable-extensions",
      "--force-prefers-reduced-motion", `--user-data-dir=${this.folder}`, ...flags],
      { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
    let text = "";
    this.process.stdio[4].setEncoding("utf8").on("data", (data) => {
      text += data;
      for (let end; (end = text.indexOf("\0")) >= 0; text = text.slice(end + 1)) this.#receive(JSON.parse(text.slice(0, end)));
    });
  }

  #receive(message) {
    if (message.id) {
      const { resolve, reject } = this.#waiting.get(message.id);
      this.#waiting.delete(message.id);
      message.error ? reject(new Error(message.error.message)) : resolve(message.result);
    } else {
      this.#sessions.get(message.sessionId)?.(message.method, message.params);
    }
  }

  send(method, params = {}, sessionId = undefined) {
    return new Promise((resolve, reject) => {
      const id = ++this.#last;
      this.#waiting.set(id, { resolve, reject });
      this.process.stdio[3].write(JSON.stringify({ id, method, params, sessionId }) + "\0");
    });
  }

  async open(url, width = 400, height = 300, emulate = async () => {}) {
    const { targetId } = await this.send("Target.createTarget", { url: "about:blank" });
    const { sessionId } = await this.send("Target.attachToTarget", { targetId, flatten: true });
    const page = new Page(this, sessionId, targetId);
    this.#sessions.set(sessionId, (method, params) => page.event(method, params));
    for (const domain of ["Page", "Runtime", "Log", "Network"]) await page.send(`${domain}.enable`);
    await page.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false });
    await emulate(page);
    await page.send("Page.navigate", { url });
    return page;
  }

  async close() {
    const ended = new Promise((resolve) => this.process.once("exit", resolve));
    await this.send("Browser.close").catch(() => {});
    await ended;
    rmSync(this.folder, { recursive: true, force: true, maxRetries: 5, retryDelay: 200 });
  }
}

class Page {
  errors = []; // what went wrong in it, and what it asked the network for
  constructor(browser, session, target) {
    Object.assign(this, { browser, session, target });
  }
  event(method, params) {
    if (method === "Runtime.exceptionThrown") this.errors.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    if (method === "Runtime.consoleAPICalled" && ["error", "warning", "assert"].includes(params.type))
      this.errors.push(params.args.map((a) => a.value ?? a.description).join(" "));
    if (method === "Log.entryAdded" && ["error"].includes(params.entry.level)) this.errors.push(params.entry.text);
    if (method === "Network.requestWillBeSent" && !/^(file|data|blob):/.test(params.request.url)) this.errors.push(`asked for ${params.request.url}`);
  }
  send(method, params) {
    return this.browser.send(method, params, this.session);
  }
  /** The value of an expression; of a promise, what it resolves to. */
  async evaluate(expression) {
    const { result, exceptionDetails } = await this.send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }
  /** Until the expression is true. */
  async until(expression, seconds = 30) {
    for (const end = Date.now() + 1000 * seconds; Date.now() < end;) {
      const value = await this.evaluate(expression);
      if (value) return value;
      await new Promise((next) => setTimeout(next, 50));
    }
    throw new Error(`not true in ${seconds} s: ${expression}\n${this.errors.join("\n")}`);
  }
  async screenshot() {
    return Buffer.from((await this.send("Page.captureScreenshot", { format: "png" })).data, "base64");
  }
  mouse(type, x, y, more = {}) {
    return this.send("Input.dispatchMouseEvent", { type, x, y, button: "left", buttons: type === "mouseReleased" ? 0 : 1, clickCount: 1, ...more });
  }
  async drag(from, to, more = {}) {
    await this.mouse("mousePressed", ...from, more);
    await this.mouse("mouseMoved", ...to, more);
    await this.mouse("mouseReleased", ...to, { ...more, buttons: 0 });
  }
  async click(x, y, clickCount = 1) {
    for (let n = 1; n <= clickCount; ++n) {
      await this.mouse("mousePressed", x, y, { clickCount: n });
      await this.mouse("mouseReleased", x, y, { clickCount: n });
    }
  }
  touch(type, points) {
    return this.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  }
  async key(key, more = {}) {
    const text = key.length === 1 ? key : undefined;
    await this.send("Input.dispatchKeyEvent", { type: "keyDown", key, text, ...more });
    await this.send("Input.dispatchKeyEvent", { type: "keyUp", key, ...more });
  }
  /** Errors and warnings that the page made. */
  async problems() {
    return this.errors;
  }
  close() {
    return this.browser.send("Target.closeTarget", { targetId: this.target });
  }
}
