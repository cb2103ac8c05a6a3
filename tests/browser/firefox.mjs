// Firefox, driven through Marionette. It has no WebGL without a display, so it gets one by Xvfb.
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { connect } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";

const FIREFOX = process.env.FIREFOX ?? "/usr/bin/firefox-esr", XVFB = "/usr/bin/Xvfb";
/** What is missing; empty: nothing. */
export const missingForFirefox = () => [FIREFOX, XVFB].filter((path) => !existsSync(path)).join(" and ");
const PREFERENCES = { "marionette.port": 0, "webgl.force-enabled": true, "network.proxy.type": 0 };

const ended = (process) => new Promise((resolve) => process.once("exit", resolve));

async function waitFor(what, find, seconds = 60) {
  for (const end = Date.now() + 1000 * seconds; Date.now() < end; await new Promise((next) => setTimeout(next, 50))) {
    const found = find();
    if (found) return found;
  }
  throw new Error(`${what} is not there after ${seconds} s`);
}

export class Firefox {
  #waiting = new Map();
  #last = 0;

  async #start() {
    this.folder = mkdtempSync(join(tmpdir(), "rbvh_firefox_"));
    this.display = spawn(XVFB, ["-displayfd", "3", "-screen", "0", "1024x768x24", "-nolisten", "tcp"], { stdio: ["ignore", "ignore", "ignore", "pipe"] });
    const number = await new Promise((resolve) => this.display.stdio[3].once("data", (data) => resolve(String(data).trim())));
    writeFileSync(join(this.folder, "user.js"), Object.entries(PREFERENCES).map(([name, value]) => `user_pref("${name}", ${value});\n`).join(""));
    // With access to the system: the console's messages are read.
    this.process = spawn(FIREFOX, ["--no-remote", "--profile", this.folder, "--marionette", "--remote-allow-system-access"],
      { stdio: "ignore", env: { ...process.env, DISPLAY: `:${number}` } });
    const file = join(this.folder, "MarionetteActivePort");
    const port = await waitFor("Marionette's port", () => existsSync(file) && Number(readFileSync(file, "utf8")));
    this.socket = connect(port, "127.0.0.1").setEncoding("latin1");
    let text = "";
    this.socket.on("data", (data) => {
      text += data; // messages are their length, a colon and JSON
      for (let colon; (colon = text.indexOf(":")) > 0;) {
        const end = colon + 1 + Number(text.slice(0, colon));
        if (text.length < end) return;
        this.#receive(JSON.parse(Buffer.from(text.slice(colon + 1, end), "latin1").toString()));
        text = text.slice(end);
      }
    });
    await this.send("WebDriver:NewSession", { capabilities: { alwaysMatch: { timeouts: { script: 120000, pageLoad: 120000 } } } });
  }

  #receive(message) {
    if (!Array.isArray(message)) return; // a greeting
    const [, id, error, result] = message, { resolve, reject } = this.#waiting.get(id);
    this.#waiting.delete(id);
    error ? reject(new Error(error.message)) : resolve(result);
  }

  send(name, params = {}) {
    return new Promise((resolve, reject) => {
      const id = ++this.#last, text = JSON.stringify([0, id, name, params]);
      this.#waiting.set(id, { resolve, reject });
      this.socket.write(`${Buffer.byteLength(text)}:${text}`);
    });
  }

  /** In its one tab. */
  async open(url, width = 400, height = 300) {
    await (this.started ??= this.#start());
    await this.send("WebDriver:SetWindowRect", { width, height: height + 100 });
    await this.send("WebDriver:Navigate", { url });
    return new FirefoxPage(this, url);
  }

  async close() {
    const ends = [ended(this.process), ended(this.display)];
    await this.send("Marionette:Quit", { flags: ["eForceQuit"] });
    await ends[0];
    this.display.kill();
    await ends[1];
    rmSync(this.folder, { recursive: true, force: true, maxRetries: 5, retryDelay: 200 });
  }
}

class FirefoxPage {
  constructor(browser, url) {
    Object.assign(this, { browser, url });
  }
  /** The value of an expression; of a promise, what it resolves to. */
  async evaluate(expression) {
    const { value } = await this.browser.send("WebDriver:ExecuteAsyncScript", { args: [],
      script: `const done = arguments[0]; (async () => (${expression}))().then((value) => done({ value }), (error) => done({ error: String(error) }));` });
    if (value.error) throw new Error(value.error);
    return value.value;
  }
  until(expression, seconds = 30) {
    return this.evaluate(`(async () => {
      for (const end = Date.now() + 1000 * ${seconds}; Date.now() < end; await new Promise((next) => setTimeout(next, 50)))
        if (${expression}) return true;
      throw new Error(${JSON.stringify(`not true in ${seconds} s: ${expression}`)});
    })()`);
  }
  /** Errors and warnings that the page made. */
  async problems() {
    await this.browser.send("Marionette:SetContext", { value: "chrome" });
    const { value } = await this.browser.send("WebDriver:ExecuteScript", { args: [this.url],
      script: "return Services.console.getMessageArray().filter((m) => m.sourceName?.startsWith(arguments[0])).map((m) => m.errorMessage)" });
    await this.browser.send("Marionette:SetContext", { value: "content" });
    return value;
  }
  async screenshot() {
    return Buffer.from((await this.browser.send("WebDriver:TakeScreenshot", { full: false })).value, "base64");
  }
  close() {}
}
