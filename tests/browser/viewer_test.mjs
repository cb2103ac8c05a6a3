// Pages of `rbvh view` in headless Chromium: node --test viewer_test.mjs
// RBVH_TOOL: the tool. RBVH_RENDERERS: those whose hits are compared, as in hits.mjs.
import { after, before } from "node:test";
import { makePages, removeFolder } from "./fixtures.mjs";
import { closeBrowsers } from "./pages.mjs";

before(makePages);
after(async () => {
  await closeBrowsers();
  removeFolder();
});
await import("./interaction.mjs");
await import("./hits.mjs");
