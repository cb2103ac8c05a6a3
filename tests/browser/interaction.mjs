// What people do with a page, and what it does where something is missing.
import assert from "node:assert/strict";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { test } from "node:test";
import { decodePng } from "./files.mjs";
import { folder, path } from "./fixtures.mjs";
import { open, openReady } from "./pages.mjs";

const sub = (a, b) => a.map((v, i) => v - b[i]), length = (v) => Math.hypot(...v), degrees = (r) => (180 * r) / Math.PI;
const near = (a, b, tolerance, what) => assert.ok(Math.abs(a - b) <= tolerance, `${what}: ${a}, not ${b}`);
/** Where the camera stands, as seen from what it looks at; the scans' up is +Y. */
const place = ({ position, focalPoint }) => {
  const [x, y, z] = sub(position, focalPoint);
  return { azimuth: degrees(Math.atan2(x, z)), elevation: degrees(Math.atan2(y, Math.hypot(x, z))), distance: Math.hypot(x, y, z) };
};
const camera = (page) => page.evaluate("rbvh.getCamera()");
const message = (page) => page.evaluate('document.getElementById("message").textContent');
/** The picture's part of the page: its middle, and its height. */
const stage = (page) => page.evaluate(`(() => {
  const box = document.getElementById("stage").getBoundingClientRect();
  return { x: Math.round(box.x + box.width / 2), y: Math.round(box.y + box.height / 2), height: box.height };
})()`);
const isWritten = async (name) => {
  for (const end = Date.now() + 20000; !existsSync(path(name)); await new Promise((next) => setTimeout(next, 50)))
    assert.ok(Date.now() < end, `${name} is not written`);
};
const atStart = (source) => (page) => page.send("Page.addScriptToEvaluateOnNewDocument", { source });
const turn = (a, b) => ((b - a + 540) % 360) - 180;

test("drags, wheel and keys move the camera by the right amounts", async () => {
  const page = await openReady("color", "", 400, 400), { x, y, height } = await stage(page);
  let was = place(await camera(page));
  await page.drag([x, y], [x + 40, y + 20]);
  let is = place(await camera(page));
  near(turn(was.azimuth, is.azimuth), (-40 / height) * 180, 0.1, "azimuth");
  near(is.elevation - was.elevation, (20 / height) * 180, 0.1, "elevation");
  near(is.distance, was.distance, 1e-6 * was.distance, "distance");

  const pixel = (2 * Math.tan(Math.PI / 12) * is.distance) / height;
  const moves = { shift: { modifiers: 8 }, ctrl: { modifiers: 2 }, "the middle button": { button: "middle", buttons: 4 }, "the right button": { button: "right", buttons: 2 } };
  for (const [what, how] of Object.entries(moves)) {
    const before = await camera(page);
    await page.drag([x, y], [x + 30, y], how);
    const after = await camera(page);
    near(length(sub(after.position, before.position)), 30 * pixel, 0.3 * pixel, `a drag with ${what}`);
    near(length(sub(sub(after.position, before.position), sub(after.focalPoint, before.focalPoint))), 0, 1e-6, "the focal point goes along");
  }

  await page.mouse("mouseWheel", x, y, { deltaX: 0, deltaY: 120, buttons: 0 });
  await page.until(`Math.abs(${is.distance} - Math.hypot(...rbvh.getCamera().position.map((v, i) => v - rbvh.getCamera().focalPoint[i]))) > 1e-3`);
  near(place(await camera(page)).distance / is.distance, Math.exp(0.12), 1e-3, "wheel");

  await page.evaluate('document.getElementById("stage").focus()');
  for (const [key, azimuth, elevation, nearer] of [["ArrowRight", 5, 0, 1], ["ArrowLeft", -5, 0, 1], ["ArrowUp", 0, 5, 1], ["ArrowDown", 0, -5, 1],
                                                   ["+", 0, 0, 0.85], ["-", 0, 0, 1 / 0.85], ["+", 0, 0, 0.85]]) {
    was = place(await camera(page));
    await page.key(key);
    is = place(await camera(page));
    near(turn(was.azimuth, is.azimuth), azimuth, 0.01, `azimuth after ${key}`);
    near(is.elevation - was.elevation, elevation, 0.01, `elevation after ${key}`);
    near(is.distance / was.distance, nearer, 1e-3, `distance after ${key}`);
  }
  was = place(await camera(page));
  const stays = await camera(page);
  await page.key("ArrowLeft", { modifiers: 8 });
  near(length(sub((await camera(page)).focalPoint, stays.focalPoint)), (40 * 2 * Math.tan(Math.PI / 12) * was.distance) / height, 1e-3, "shift and an arrow key");
  near(place(await camera(page)).azimuth, was.azimuth, 1e-6, "which does not turn");
  for (const [key, id] of [["p", "probe"], ["d", "measure"]]) {
    await page.key(key);
    assert.equal(await page.evaluate(`document.getElementById("${id}").ariaPressed`), "true", key);
  }
  await page.key("Escape");
  assert.equal(await page.evaluate("document.querySelectorAll('#probe[aria-pressed=true], #measure[aria-pressed=true]').length"), 0);
  for (const [i, [azimuth, elevation]] of [[0, 0], [180, 0], [-90, 0], [90, 0], [0, 89.9], [0, -89.9]].entries()) {
    await page.key(String(i + 1));
    is = place(await camera(page));
    near(turn(azimuth, is.azimuth), 0, 0.5, `azimuth of view ${i + 1}`);
    near(is.elevation, elevation, 0.01, `elevation of view ${i + 1}`);
  }
  await page.browser.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder });
  await page.key("s");
  await page.until('document.getElementById("message").textContent === "The picture is saved"');
  await isWritten("color.png");
  await page.key("r");
  is = place(await camera(page));
  near(is.azimuth, 30, 0.01, "azimuth after a reset");
  near(is.elevation, 20, 0.01, "elevation after a reset");
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("two fingers come nearer and move, one turns", async () => {
  const page = await openReady("color", "", 400, 400), { x, y, height } = await stage(page);
  const was = place(await camera(page));
  await page.touch("touchStart", [[x - 30, y], [x + 30, y]]);
  await page.touch("touchMove", [[x - 60, y], [x + 60, y]]);
  await page.touch("touchEnd", []);
  const pinched = place(await camera(page));
  near(pinched.distance / was.distance, 0.5, 0.02, "a pinch");
  await page.touch("touchStart", [[x, y]]);
  await page.touch("touchMove", [[x + 40, y]]);
  await page.touch("touchEnd", []);
  near(turn(pinched.azimuth, place(await camera(page)).azimuth), (-40 / height) * 180, 0.1, "one finger");
  // Two fingers side by side come no nearer; what they hold follows.
  const before = await camera(page), pixel = (2 * Math.tan(Math.PI / 12) * pinched.distance) / height;
  await page.touch("touchStart", [[x - 30, y], [x + 30, y]]);
  await page.touch("touchMove", [[x - 30, y + 24], [x + 30, y + 24]]);
  await page.touch("touchEnd", []);
  const moved = await camera(page), by = sub(moved.focalPoint, before.focalPoint);
  near(length(by), 24 * pixel, 1.5 * pixel, "two fingers down"); // one moves before the other: nearer, and back
  near(place(moved).distance, pinched.distance, 1e-3 * pinched.distance, "no nearer");
  near(length(sub(by, sub(moved.position, before.position))), 0, 1e-6, "the camera goes along");
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("probe, distance, pivot and link give the scan's numbers", async () => {
  const page = await openReady("painted", "", 400, 400), { x, y } = await stage(page);
  await page.evaluate('rbvh.setLayer("wear")');
  assert.equal(await page.evaluate('document.getElementById("bar").hidden'), false);
  assert.equal(await page.evaluate('document.getElementById("bar-name").textContent'), "wear");
  await page.evaluate('document.getElementById("probe").click()');
  await page.click(x, y);
  await page.until("rbvh.ui.probed", 60);
  const { position, normal, values } = await page.evaluate("rbvh.ui.probed");
  assert.ok(length(position) > 0.85 && length(position) < 1.45, `at ${position}`);
  near(length(normal), 1, 1e-5, "the normal's length");
  // The layer is 10 + 5 y / 1.3 within the radius of its dabs.
  near(values[0], 10 + (5 * position[1]) / 1.3, 1, "the layer's value");
  assert.match(await message(page), /^Position .* normal .* wear /);

  await page.evaluate('document.getElementById("measure").click()');
  await page.click(x, y);
  await page.until('document.getElementById("message").textContent === "Click the second point"', 60);
  const first = await page.evaluate("rbvh.ui.probed.position");
  await page.click(x + 30, y - 40);
  await page.until("rbvh.ui.distance !== null", 60);
  const second = await page.evaluate("rbvh.ui.probed.position");
  near(await page.evaluate("rbvh.ui.distance"), length(sub(second, first)), 1e-6, "the distance");
  assert.match(await message(page), /^Distance /);
  assert.equal(await page.evaluate('document.querySelectorAll("#marks i").length'), 2);

  await page.evaluate('document.getElementById("measure").click()');
  const was = await camera(page);
  await page.click(x + 30, y - 40, 2);
  await page.until(`Math.hypot(...rbvh.viewer.pivot.map((v, i) => v - ${JSON.stringify(second)}[i])) < 1e-3`, 60);
  const is = await camera(page);
  near(length(sub(is.position, was.position)), 0, 1e-9, "the camera stays");

  const link = await page.evaluate("rbvh.link()");
  await page.evaluate("rbvh.ui.reset()");
  await page.evaluate(`(location.hash = ${JSON.stringify(link)}, 0)`);
  await page.until(`Math.hypot(...rbvh.getCamera().position.map((v, i) => v - ${JSON.stringify(is.position)}[i])) < 1e-6`);
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("a lost device comes back", async () => {
  const page = await openReady("tiles");
  await page.until("rbvh.viewer.firstPicture > 0", 60);
  await page.evaluate(`(window.lost = rbvh.viewer.canvas.getContext("webgl2").getExtension("WEBGL_lose_context"), lost.loseContext(), 0)`);
  await page.until("rbvh.viewer.renderer === null");
  assert.match(await message(page), /lost/);
  await page.evaluate("(lost.restoreContext(), 0)");
  await page.until("rbvh.viewer.renderer !== null", 60);
  const lit = await page.evaluate("rbvh.render(64, 64).then(({ data }) => data.filter((v, i) => i % 4 === 3 && v > 0).length)");
  assert.ok(lit > 400, `${lit} pixels`);
  await page.close();
});

test("without WebGL2 and WebGPU there is the thumbnail, and a sentence", async () => {
  const page = await open("tiles", "", 360, 480, (page) => page.send("Page.addScriptToEvaluateOnNewDocument",
    { source: "HTMLCanvasElement.prototype.getContext = () => null;" }));
  await page.until('document.getElementById("message")?.textContent', 60);
  assert.match(await message(page), /cannot draw the scan.*still/);
  assert.equal(await page.evaluate('document.getElementById("still").naturalWidth'), 512);
  await page.close();
});

test("a renderer whose shaders fail gives way to the next, and at last to the thumbnail", async () => {
  const source = `window.broken = true; const set = WebGL2RenderingContext.prototype.shaderSource;
    WebGL2RenderingContext.prototype.shaderSource = function (shader, text) { set.call(this, shader, text + (broken && text.includes("#define TRAVERSAL") ? "!" : "")); };
    const make = window.GPUDevice?.prototype.createShaderModule;
    if (make) GPUDevice.prototype.createShaderModule = function (words) { return make.call(this, { code: words.code + (window.brokenToo ? "!" : "") }); };`;
  const drawn = (page) => page.evaluate(`rbvh.render(64, 64).then(({ data }) => data.filter((v, i) => i % 4 === 3 && v > 0).length)`);
  const first = await open("tiles", "", 320, 320, atStart(source), "webgpu");
  await first.until("window.rbvh?.viewer.firstPicture > 0", 120);
  assert.match(await message(first), /^webgl2 failed: shaders do not link.*; webgpu draws instead$/);
  assert.equal(await first.evaluate('document.getElementById("renderer").value'), "webgpu");
  assert.ok((await drawn(first)) > 400);
  await first.close();

  const second = await open("tiles", "?renderer=webgpu", 320, 320, atStart(source.replace("broken = true", "brokenToo = true, window.broken = false")));
  await second.until("window.rbvh?.viewer.firstPicture > 0", 120);
  assert.match(await message(second), /^webgpu failed: .*; webgl2 draws instead$/);
  assert.ok((await drawn(second)) > 400);
  await second.close();

  // Later, and with no other renderer.
  const third = await open("tiles", "", 320, 320, atStart(`${source} broken = false; Object.defineProperty(navigator, "gpu", { value: undefined });`));
  await third.until('window.rbvh?.viewer.firstPicture > 0 && !document.getElementById("still")', 60);
  await third.evaluate("(broken = true, rbvh.viewer.renderer.programs.clear(), rbvh.viewer.changed(), 0)");
  await third.until('document.getElementById("still")?.checkVisibility() && !document.querySelector("canvas").checkVisibility()', 60);
  assert.match(await message(third), /^This browser cannot draw the scan: hybrid failed: shaders do not link.*[^.]\. The picture is a still\.$/);
  await third.close();
});

test("without WebGL2, WebGPU draws", async () => {
  const page = await open("color", "", 320, 320, (page) => page.send("Page.addScriptToEvaluateOnNewDocument",
    { source: "const get = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext = function (name) { return name === 'webgl2' ? null : get.call(this, name); };" }), "webgpu");
  await page.until("window.rbvh?.viewer.firstPicture > 0", 120);
  assert.equal(await page.evaluate("rbvh.stats().renderer"), "webgpu");
  await page.close();
});

test("the thumbnail stays until the first picture, and levels are decoded where none is drawn; the time is noted", async (t) => {
  const source = "window.frames_ = []; window.draw_ = requestAnimationFrame; requestAnimationFrame = (frame) => (frames_.push(frame), 1);";
  const page = await open("tiles", "", 360, 480, (page) => page.send("Page.addScriptToEvaluateOnNewDocument", { source }));
  await page.until("window.rbvh", 60);
  await page.evaluate("rbvh.loaded.then(() => 0)");
  const isShown = (id) => page.evaluate(`!!document.${id}?.checkVisibility()`);
  assert.deepEqual([await isShown('getElementById("still")'), await isShown('querySelector("canvas")')], [true, false]);
  await page.evaluate("(requestAnimationFrame = draw_, frames_.forEach((frame) => frame(0)), 0)");
  await page.until("rbvh.stats().firstPicture > 0", 60);
  await page.until('!document.getElementById("still")');
  assert.ok(await isShown('querySelector("canvas")'));
  await page.close();
  for (const renderer of ["webgl2", "hybrid", "webgpu"]) {
    const timed = await open("color", `?renderer=${renderer}`, 640, 440);
    t.diagnostic(`${renderer}: first picture after ${Math.round(await timed.until("window.rbvh?.stats().firstPicture", 60))} ms`);
    await timed.close();
  }
});

test("no texture is larger than the device's or 8192 texels; what needs more is refused, and the next coarser level shown", async () => {
  const source = `window.largest = 0; const make = WebGL2RenderingContext.prototype.texImage2D;
    WebGL2RenderingContext.prototype.texImage2D = function (...words) { largest = Math.max(largest, words[3], words[4]); return make.apply(this, words); };`;
  const page = await open("painted", "?renderer=webgl2", 320, 320, (page) => page.send("Page.addScriptToEvaluateOnNewDocument", { source }));
  await page.until("window.rbvh", 60);
  await page.evaluate('rbvh.loaded.then(() => rbvh.setLevel("Q3"))');
  await page.evaluate('rbvh.setLayer("wear")');
  const most = await page.evaluate('rbvh.viewer.canvas.getContext("webgl2").getParameter(WebGL2RenderingContext.MAX_TEXTURE_SIZE)');
  assert.equal(await page.evaluate("rbvh.viewer.renderer.mostRows"), Math.min(most, 8192));
  // As many rows as Q3 takes: too few for Q1.
  const rows = await page.evaluate(`rbvh.viewer.levels.map(({ nodes, prims, vertices, tiles, heights, normals, colors, layers: [{ leaves, values }] }) =>
    Math.max(...[nodes, prims, vertices, tiles, leaves].map((a) => a.length / 16384), ...[heights, normals, colors, values].map((a) => a.length / 4096)))`);
  assert.ok(rows[0] < rows[1], rows.join());
  await page.evaluate(`rbvh.viewer.exclusive(async () => (rbvh.viewer.renderer.mostRows = ${rows[0]}, 0)).then(() => rbvh.setLevel("Q1"))`);
  await page.until('document.getElementById("message").textContent.startsWith("Q1 cannot be shown")');
  assert.match(await message(page), /^Q1 cannot be shown: its \w+ take \d+ rows of a texture, which has at most \d+$/);
  await page.until('document.getElementById("state").textContent.startsWith("Q3")');
  assert.ok(await page.evaluate("rbvh.render(64, 64).then(({ data }) => data.some((v) => v > 0))"));
  const largest = await page.evaluate("largest");
  assert.ok(largest >= 4096 && largest <= Math.min(most, 8192), `${largest} texels`);
  assert.deepEqual(page.errors, []);
  await page.close();

  const limited = (texels) => atStart(`const get = WebGL2RenderingContext.prototype.getParameter;
    WebGL2RenderingContext.prototype.getParameter = function (name) { return name === 0x0d33 ? ${texels} : get.call(this, name); };`);
  const large = await open("tiles", "?renderer=webgl2", 320, 320, limited(65536));
  await large.until("window.rbvh?.viewer.renderer", 60);
  assert.equal(await large.evaluate("rbvh.viewer.renderer.mostRows"), 8192);
  await large.close();
  const old = await open("tiles", "?renderer=webgl2", 320, 320, limited(2048));
  await old.until('document.getElementById("message")?.textContent', 60);
  assert.match(await message(old), /cannot draw the scan: its textures have 2048 texels a side/);
  await old.close();
});

test("the thumbnail is there where scripts are off", async () => {
  const page = await open("tiles", "", 360, 480, (page) => page.send("Emulation.setScriptExecutionDisabled", { value: true }));
  let colors = 0;
  for (const end = Date.now() + 60000; colors < 100 && Date.now() < end; await new Promise((next) => setTimeout(next, 100))) {
    const picture = await page.screenshot().catch(() => null); // the page may not be there yet
    if (!picture) continue;
    const { pixels, channels, width } = decodePng(picture), seen = new Set();
    for (let y = 150; y < 350; ++y)
      for (let x = 80; x < 280; ++x) seen.add(pixels.subarray(channels * (y * width + x), channels * (y * width + x) + 3).join());
    colors = seen.size;
  }
  assert.ok(colors >= 100, `${colors} colours`);
  await page.close();
});

test("a moving picture is as coarse as its time asks for; a still one gathers shadows", async () => {
  const page = await openReady("color", "", 400, 300);
  const scaleAfter = (work) => page.evaluate(`(async () => {
    const viewer = rbvh.viewer, renderer = viewer.renderer, was = renderer.work;
    renderer.work = ${work};
    for (let first = viewer.frames; viewer.frames < first + 12;) {
      viewer.changed();
      await new Promise(requestAnimationFrame);
    }
    renderer.work = was;
    return rbvh.stats().scale;
  })()`);
  const slow = await scaleAfter("() => new Promise((done) => setTimeout(() => done(true), 130))");
  near(slow, 0.1, 0.01, "the scale where pictures take four times as long");
  const [darker, frames] = await page.evaluate(`(async () => {
    const viewer = rbvh.viewer, was = viewer.onChange, seen = {};
    const look = () => {
      const copy = document.createElement("canvas"), { canvas } = viewer;
      [copy.width, copy.height] = [canvas.width, canvas.height];
      const on = copy.getContext("2d");
      on.drawImage(canvas, 0, 0);
      return on.getImageData(0, 0, copy.width, copy.height).data;
    };
    viewer.onChange = () => (was(), [1, 48].includes(viewer.done) && (seen[viewer.done] ??= look()));
    viewer.changed();
    while (!seen[48]) await new Promise((next) => setTimeout(next, 50));
    const { frames } = viewer;
    await new Promise((next) => setTimeout(next, 300));
    const back = seen[1][0], [quick, still] = [seen[1], seen[48]];
    return [quick.filter((v, i) => i % 4 === 0 && Math.abs(v - back) > 20 && still[i] < v - 10).length, viewer.frames - frames];
  })()`);
  assert.ok(darker > 20, `${darker} pixels are darker in shadow`);
  assert.equal(frames, 0, "then nothing is drawn");
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("menus and buttons do what they say", async () => {
  const page = await openReady("painted", "", 400, 400);
  const choose = (id, value) => page.evaluate(`(() => {
    const select = document.getElementById("${id}");
    select.value = ${JSON.stringify(value)};
    select.dispatchEvent(new Event("change"));
  })()`);
  await choose("level", "1");
  await page.until('document.getElementById("state").textContent.startsWith("Q1")');
  await choose("view", "2");
  near(place(await camera(page)).azimuth, -90, 0.01, "the view from the left");
  await choose("layer", "0");
  assert.equal(await page.evaluate("rbvh.viewer.layer.meta.name"), "wear");
  const ramp = await page.evaluate('getComputedStyle(document.getElementById("bar-ramp")).backgroundImage');
  assert.match(ramp, /rgb\(71, 1, 85\).*rgb\(31, 144, 139\).*rgb\(252, 231, 33\)/, "viridis");
  await page.evaluate('(document.getElementById("layer-lo").value = "9", 0)');
  await choose("layer-hi", "12");
  assert.deepEqual(await page.evaluate("[rbvh.viewer.layer.lo, rbvh.viewer.layer.hi]"), [9, 12]);
  await choose("layer-hi", "8");
  assert.match(await message(page), /lower end/);

  await choose("renderer", "hybrid");
  await page.until('rbvh.viewer.renderer?.name === "hybrid" && rbvh.stats().samples > 0', 120);
  const was = await page.evaluate("document.documentElement.dataset.theme");
  await page.evaluate('document.getElementById("theme").click()');
  assert.notEqual(await page.evaluate("document.documentElement.dataset.theme"), was);
  assert.equal(await page.evaluate("document.getAnimations().length"), 0);

  await page.evaluate('document.getElementById("link").click()');
  const hash = await page.evaluate("location.hash"), wanted = await camera(page);
  assert.match(hash, /^#camera=/);
  await page.browser.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder });
  await page.evaluate('document.getElementById("picture").click()');
  await page.until('document.getElementById("message").textContent === "The picture is saved"');
  await isWritten("painted.png");
  const { width, height } = decodePng(readFileSync(path("painted.png")));
  assert.deepEqual([width, height], await page.evaluate("[rbvh.viewer.canvas.width, rbvh.viewer.canvas.height]"));
  assert.deepEqual(page.errors, []);
  await page.close();

  const linked = await open("painted", hash, 400, 400, (page) =>
    page.send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: "dark" }] }));
  await linked.until("window.rbvh", 120);
  near(length(sub((await camera(linked)).position, wanted.position)), 0, 1e-6, "the linked view");
  assert.equal(await linked.evaluate("document.documentElement.dataset.theme"), "dark");
  await linked.close();
});

test("nothing moves by itself where less motion is wanted", async () => {
  for (const [value, seconds] of [["reduce", "0s"], ["no-preference", "1s"]]) {
    const page = await open("color", "", 320, 320, (page) => page.send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-reduced-motion", value }] }));
    await page.until("window.rbvh?.viewer.firstPicture > 0", 60);
    assert.equal(await page.evaluate("document.getAnimations().length"), 0);
    const found = await page.evaluate('(document.querySelector("header").style.transition = "opacity 1s", getComputedStyle(document.querySelector("header")).transitionDuration)');
    assert.equal(found, seconds, value);
    await page.close();
  }
});

test("a damaged page says so", async () => {
  const html = readFileSync(path("color.html"), "utf8"), at = html.indexOf('id="rbvh-level-0">') + 2000;
  writeFileSync(path("damaged.html"), html.slice(0, at) + (html[at] === "A" ? "B" : "A") + html.slice(at + 1));
  const page = await open("damaged");
  await page.until('document.getElementById("message")?.textContent', 60);
  assert.match(await message(page), /^This page is broken: the data of level Q3 are damaged/);
  await page.close();
  writeFileSync(path("cut.html"), html.slice(0, html.indexOf('id="rbvh-level-1">') + 2000));
  const cut = await open("cut");
  await cut.until('document.getElementById("message")?.textContent', 60);
  assert.match(await message(cut), /^This page is broken/);
  await cut.close();
});

test("scripts and styles that are not the page's own do not run", async () => {
  const html = readFileSync(path("color.html"), "utf8");
  assert.match(html, /Content-Security-Policy" content="default-src 'none';/);
  const foreign = "<script>window.stolen = 1</script><style>header { display: none }</style></body>";
  writeFileSync(path("foreign.html"), html.replace("</body>", () => foreign));
  const page = await openReady("foreign");
  assert.equal(await page.evaluate("window.stolen"), undefined);
  assert.ok(await page.evaluate('document.querySelector("header").offsetHeight > 20'));
  assert.equal(await page.evaluate('fetch("data:,x").then(() => "fetched", () => "refused")'), "refused");
  await page.close();
});

test("names from scans are text; a narrow page needs no scrolling; all controls have names and are reached by tab", async () => {
  const html = readFileSync(path("color.html"), "utf8");
  const name = '"name":"color"', evil = '"name":"\\u003cscript>window.stolen = 1\\u003c/script>\\u003cimg src=x onerror=\\"stolen = 1\\">"';
  assert.ok(html.includes(name));
  writeFileSync(path("evil.html"), html.replace(name, () => evil));
  const page = await openReady("evil", "", 360, 640);
  assert.match(await page.evaluate('document.getElementById("name").textContent'), /^<script>/);
  assert.equal(await page.evaluate("window.stolen"), undefined);
  assert.ok((await page.evaluate("document.documentElement.scrollWidth")) <= 360);
  const outside = await page.evaluate(`[...document.querySelectorAll("h1, button, select, #stage, footer span")].filter((e) => {
    const { left, right, top, bottom, height } = e.getBoundingClientRect();
    return left < 0 || right > 360 || top < 0 || bottom > 640 || (e.matches("button, select") && height < 24);
  }).map((e) => e.id)`);
  assert.deepEqual(outside, []);
  assert.ok((await stage(page)).height > 320);
  const names = await page.evaluate(`[...document.querySelectorAll("button, select, input, #stage")].map((e) => e.ariaLabel ?? e.textContent)`);
  assert.ok(names.every((text) => text.length > 0), names.join());
  const seen = new Set();
  for (let i = 0; i < 12; ++i) {
    await page.send("Input.dispatchKeyEvent", { type: "keyDown", key: "Tab", code: "Tab", windowsVirtualKeyCode: 9 });
    seen.add(await page.evaluate("document.activeElement.id"));
  }
  for (const id of ["level", "view", "reset", "probe", "measure", "picture", "link", "theme", "renderer", "stage"])
    assert.ok(seen.has(id), `${id} is not reached: ${[...seen]}`);
  assert.deepEqual(page.errors, []);
  await page.close();
});
