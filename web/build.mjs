// Makes viewer.html, the page that `rbvh view` fills: node build.mjs [OUTPUT]. Equal sources give equal bytes.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const here = (name) => new URL(name, import.meta.url).pathname;

/** A shader without comments, most spaces and zeros after points; what begins with # keeps its line. */
const shrink = (text) => text.replace(/\/\/.*$/gm, "").split("\n").map((line) =>
  line.trim().startsWith("#") ? `\n${line.trim()}\n` : `${line.trim().replace(/\s*([=<>(){},;:&|?!*/])\s*/g, "$1")}\n`)
  .join("").replace(/(?<![+-]) ([+-]) (?![+-])/g, "$1").replace(/(\d\.)0\b(?!\.)/g, "$1").replace(/\n+/g, "\n").replace(/([;{},])\n(?!#)/g, "$1");

const read = (name) => readFileSync(here(`src/${name}`), "utf8");
const files = readdirSync(here("src")).sort(), isShader = /\.(glsl|wgsl)$/;
/** The template strings of the files that put shaders together. */
const TEMPLATES = /`[^`]*`/g, hasTemplates = /(passes|hybrid)\.ts$/;
/** What is declared in shaders, of four letters or more, gets a shorter name, the same in all; but what scripts and # lines name keeps its own. */
const shorten = (() => {
  const text = files.flatMap((name) => isShader.test(name) ? [read(name)] : hasTemplates.test(name) ? read(name).match(TEMPLATES) : [])
    .join("\n").replace(/\/\/.*$/gm, "");
  const words = (text) => text.match(/[A-Za-z_]\w*/g) ?? [];
  const kept = new Set([...words(text.match(/^#.*$|\$\{[^}]*\}|@builtin\(\w+\)|\bmain\b|\bgl_\w+/gm).join(" ")),
    ...files.filter((name) => name.endsWith(".ts")).flatMap((name) => words(read(name).match(/"[^"\n]*"/g)?.join(" ") ?? ""))]);
  const declared = [...text.matchAll(new RegExp([
    /\b(?:const )?(?:float|u?int|bool|void|[iub]?vec[234]|mat[234x]+|[A-Z][A-Za-z]+) (\w{4,})/, // GLSL
    /\b(?:let|var(?:<\w+>)?|fn|const|struct) (\w{4,})/, /\b([a-zA-Z]\w{3,}): [a-z]/, // WGSL
    /, (\w{4,}) =/].map(({ source }) => source).join("|"), "g"))].map(([, ...names]) => names.find(Boolean)).filter((name) => !kept.has(name) && !/^([iub]?vec\d|float|uint)$/.test(name));
  const taken = new Set(words(text)), letters = "abcdefghijklmnopqrstuvwxyz", short = new Map();
  const names = [...letters].flatMap((a) => [...letters].map((b) => a + b.toUpperCase())).filter((name) => !taken.has(name));
  for (const name of [...new Set(declared)].sort()) short.set(name, names.shift());
  return (text) => text.replace(/\$\{[^}]*\}|^#.*$|[A-Za-z_]\w*/gm, (word) => short.get(word) ?? word);
})();

/** Those in files of their own, and those in template strings. */
const shaders = {
  name: "shaders",
  setup(builder) {
    const small = (text) => shorten(shrink(text));
    builder.onLoad({ filter: isShader }, ({ path }) => ({ contents: small(readFileSync(path, "utf8")), loader: "text" }));
    builder.onLoad({ filter: hasTemplates }, ({ path }) => ({
      contents: readFileSync(path, "utf8").replace(/^ ?\*.*$|^\/\*\*.*$/gm, "").replace(TEMPLATES, small), loader: "ts" }));
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
