// Makes viewer.html, the page that `rbvh view` fills: node build.mjs [OUTPUT]. Equal sources give equal bytes.
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const here = (name) => new URL(name, import.meta.url).pathname;

/** A shader without comments, most spaces and zeros after points; what begins with # keeps its line. */
const shrink = (text) => text.replace(/\/\/.*$/gm, "").split("\n").map((line) =>
  line.trim().startsWith("#") ? `\n${line.trim()}\n` : `${line.trim().replace(/\s*([=<>(){},;:&|?!*/])\s*/g, "$1")}\n`)
  .join("").replace(/(?<![+-]) ([+-]) (?![+-])/g, "$1").replace(/(\d\.)0\b(?!\.)/g, "$1").replace(/\n+/g, "\n").replace(/([;{},])\n(?!#)/g, "$1");

/** Those in files of their own, and those in the template strings of the files that put them together. */
const shaders = {
  name: "shaders",
  setup(builder) {
    builder.onLoad({ filter: /\.(glsl|wgsl)$/ }, ({ path }) =>
      ({ contents: shrink(readFileSync(path, "utf8")), loader: "text" }));
    builder.onLoad({ filter: /(passes|hybrid)\.ts$/ }, ({ path }) => ({
      contents: readFileSync(path, "utf8").replace(/^ ?\*.*$|^\/\*\*.*$/gm, "").replace(/`[^`]*`/g, shrink), loader: "ts" }));
  },
};

const bundle = async (entry, loader) =>
  (await build({ entryPoints: [here(entry)], bundle: true, minify: true, write: false, format: "iife",
                 target: "es2022", charset: "ascii", legalComments: "none", plugins: [shaders], ...loader }))
    .outputFiles[0].text.trim();

const script = (await bundle("src/main.ts")).replaceAll("</script", "<\\/script"), style = await bundle("src/page.css");
const hash = (text) => createHash("sha256").update(text).digest("base64");
const page = readFileSync(here("src/page.html"), "utf8")
  .replace("@SCRIPT_HASH@", () => hash(script)).replace("@STYLE_HASH@", () => hash(style))
  .replace("@SCRIPT@", () => script).replace("@STYLE@", () => style);
writeFileSync(process.argv[2] ?? here("viewer.html"), page);
