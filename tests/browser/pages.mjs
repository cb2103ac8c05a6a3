// Opens pages of the fixtures: in one Chromium for WebGL, one for WebGPU, and in Firefox.
import { Browser, WEBGPU } from "./browser.mjs";
import { Firefox } from "./firefox.mjs";
import { url } from "./fixtures.mjs";

export const LEVEL = "Q3";
const browsers = {};

export async function open(name, query = "", width = 320, height = 320, emulate = undefined, browser = undefined) {
  const kind = browser ?? (query.includes("webgpu") ? "webgpu" : "webgl2");
  browsers[kind] ??= kind === "firefox" ? new Firefox() : new Browser(kind === "webgpu" ? WEBGPU : undefined);
  return browsers[kind].open(`${url(name + ".html")}${query}`, width, height, emulate);
}

/** When all levels are decoded, with LEVEL shown. */
export async function openReady(name, query = "", width = 320, height = 320, browser = undefined) {
  const page = await open(name, query, width, height, undefined, browser);
  await page.until("window.rbvh", 120);
  await page.evaluate(`rbvh.loaded.then(() => rbvh.setLevel("${LEVEL}")).then(() => 0)`);
  return page;
}

export async function closeBrowsers() {
  for (const browser of Object.values(browsers)) await browser.close();
}
