// The renderers' hits and pictures, against the tool's own tracer.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { decodePng, readNpy, writeNpy } from "./files.mjs";
import { missingForFirefox } from "./firefox.mjs";
import { SHOWN, path, tool } from "./fixtures.mjs";
import { LEVEL, openReady } from "./pages.mjs";

/** Renderers, in Chromium or with "@firefox" in Firefox. */
const RENDERERS = (process.env.RBVH_RENDERERS ?? "webgl2,hybrid,webgpu,webgl2@firefox").split(",");
const PIXELS = 256, RAYS = 1000;
/**
 * Of pixels that may differ by more than two steps: where rays graze a cloud's tiles at the line between two cells
 * (the tool's own pictures and traced rays differ there as well), and for the hybrid renderer at triangles' edges,
 * where rasterisers round.
 */
const mostDifferent = (renderer, name) => (name === "cloud" ? 0.006 : renderer === "hybrid" ? 0.003 : 0.0002);
/** Of rays on a line between two cells of a tile, which has either one's normal. */
const MOST_ON_LINES = 10;
const CAMERA = { position: [2.6, 1.9, 4.2], focalPoint: [0, 0, 0], viewUp: [0, 1, 0], viewAngle: 30 };

/** The same for each run: towards the ball from all sides, and some past it. */
function fixedRays() {
  const rays = new Float32Array(6 * RAYS);
  let seed = 7;
  const random = () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  const onSphere = () => {
    const z = 2 * random() - 1, turn = 2 * Math.PI * random(), r = Math.sqrt(1 - z * z);
    return [r * Math.cos(turn), r * Math.sin(turn), z];
  };
  for (let i = 0; i < RAYS; ++i) {
    const origin = onSphere().map((v) => 3.5 * v), target = onSphere().map((v) => 1.1 * v), d = target.map((v, k) => v - origin[k]);
    rays.set([...origin, ...d.map((v) => v / Math.hypot(...d))], 6 * i);
  }
  return rays;
}

for (const which of RENDERERS)
  for (const { name, layer } of SHOWN) {
    const [renderer, browser] = which.split("@"), missing = browser === "firefox" ? missingForFirefox() : "";
    const skip = missing ? `${missing} is missing` : false, openIt = () => openReady(name, `?renderer=${renderer}`, 320, 320, browser);
    test(`${which} finds the tracer's hits: ${name}`, { skip }, async () => {
      const rays = fixedRays();
      writeNpy(path("rays.npy"), rays, 6);
      tool("trace", path(`${name}.rbvh`), "--level", LEVEL, "--rays", path("rays.npy"), "-f", "-o", path("hits.npy"));
      const wanted = readNpy(path("hits.npy")), page = await openIt();
      const found = await page.evaluate(`rbvh.castRays(new Float32Array([${Array.from(rays)}])).then((hits) =>
        Array.from(hits, (v) => (Number.isFinite(v) ? v : 1e30)))`);
      let hits = 0, onLines = 0;
      for (let i = 0; i < RAYS; ++i) {
        const t = wanted[8 * i], mine = found[8 * i];
        assert.equal(mine < 1e30, Number.isFinite(t), `ray ${i}: ${t} or ${mine}`);
        if (mine >= 1e30) continue;
        ++hits;
        assert.ok(Math.abs(t - mine) <= 1e-4 * t, `ray ${i}: t ${t} is ${mine}`);
        // At an edge either of two leaves may be hit.
        if (wanted[8 * i + 6] !== found[8 * i + 6]) assert.ok(Math.abs(t - mine) <= 1e-6 * t, `ray ${i}: leaf`);
        else onLines += found[8 * i + 7] !== wanted[8 * i + 7];
      }
      assert.ok(onLines <= MOST_ON_LINES, `the flags of ${onLines} rays`);
      assert.ok(hits > RAYS / 2 && hits < RAYS, `${hits} hits`);
      assert.deepEqual(await page.problems(), []);
      await page.close();
    });

    test(`${which} draws what render draws: ${name}`, { skip }, async (t) => {
      const triple = (v) => v.join(",");
      tool("render", path(`${name}.rbvh`), "--quick", "--level", LEVEL, "--resolution", `${PIXELS},${PIXELS}`, "--up", "+Y",
           "--camera-position", triple(CAMERA.position), "--camera-focal-point", triple(CAMERA.focalPoint),
           ...(layer ? ["--color-layer", layer] : []), "-f", "-o", path("wanted.png"));
      const wanted = decodePng(readFileSync(path("wanted.png"))), page = await openIt();
      assert.equal(await page.evaluate("rbvh.meta.levels[0].layers.some(({ name }) => name === 'texture')"), name === "textured");
      await page.evaluate(`rbvh.setLayer(${JSON.stringify(layer)})`);
      const text = await page.evaluate(`(async () => {
        rbvh.meta.up.splice(0, 3, 0, 1, 0);
        rbvh.setCamera(${JSON.stringify(CAMERA)});
        const { data } = await rbvh.render(${PIXELS}, ${PIXELS});
        return btoa(Array.from(data, (v) => String.fromCharCode(v)).join(""));
      })()`);
      const mine = Buffer.from(text, "base64");
      let different = 0, lit = 0, bright = 0;
      for (let i = 0; i < PIXELS * PIXELS; ++i) {
        const alpha = wanted.pixels[4 * i + 3];
        let most = Math.abs(alpha - mine[4 * i + 3]);
        for (let c = 0; c < 3 && alpha > 0 && mine[4 * i + 3] > 0; ++c)
          most = Math.max(most, Math.abs(wanted.pixels[4 * i + c] - mine[4 * i + c]));
        different += most > 2;
        lit += mine[4 * i + 3] > 0;
        bright += mine[4 * i] + mine[4 * i + 1] + mine[4 * i + 2] > 60;
      }
      t.diagnostic(`${different} pixels differ`);
      assert.ok(lit > 0.1 * PIXELS * PIXELS && bright > 0.9 * lit, `${lit} pixels, ${bright} of them bright`);
      assert.ok(different <= mostDifferent(renderer, name) * PIXELS * PIXELS, `${different} pixels differ`);
      assert.deepEqual(await page.problems(), []);
      await page.close();
    });
  }
