// The page around the picture: menus, probe, distance, scalar bar, what is said to whom.
import type { Camera, Vec } from "./camera";
import { length, sub } from "./camera";
import { addControls } from "./controls";
import { isTexture } from "./page";
import type { LayerMeta } from "./page";
import type { Probe, Viewer } from "./viewer";

const VIEWS: [string, number, number][] = [["Front", 0, 0], ["Back", 180, 0], ["Left", -90, 0],
  ["Right", 90, 0], ["Top", 0, 89.9], ["Bottom", 0, -89.9]];

const element = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

export const say = (text: string): void => {
  element("message").textContent = text;
};

const digits = (value: number): string =>
  Number.isFinite(value) ? Number(value.toPrecision(7)).toString() : "none";
const triple = (v: Vec): string => v.map(digits).join(", ");

/** `#camera=` position, focal point, view up, view angle, in the scan's coordinates. */
export function cameraLink(viewer: Viewer): string {
  const { position, focalPoint, up, viewAngle } = viewer.camera;
  const numbers = [...viewer.toScan(position), ...viewer.toScan(focalPoint), ...up, viewAngle];
  return `#camera=${numbers.map((n) => Number(n.toPrecision(10))).join(",")}`;
}

export function cameraOfLink(viewer: Viewer, hash: string): Camera | null {
  const numbers = /^#camera=(.*)$/.exec(hash)?.[1]?.split(",").map(Number) ?? [];
  if (numbers.length !== 10 || !numbers.every(Number.isFinite)) return null;
  const at = (i: number): Vec => [numbers[i]!, numbers[i + 1]!, numbers[i + 2]!];
  const camera = { position: viewer.toStored(at(0)), focalPoint: viewer.toStored(at(3)), up: at(6),
                   viewAngle: numbers[9]! };
  const sees = length(sub(camera.position, camera.focalPoint)) > 0 && length(camera.up) > 0;
  return sees && camera.viewAngle > 0 && camera.viewAngle < 180 ? camera : null;
}

function fillSelect(select: HTMLSelectElement, options: [string, string][], value: string): void {
  select.replaceChildren(...options.map(([key, label]) => {
    const option = document.createElement("option");
    option.value = key;
    option.textContent = label;
    return option;
  }));
  select.value = value;
}

export interface Page {
  renderers: string[]; // to choose from
  chooseRenderer(name: string): Promise<void>;
}

export class Ui {
  probed: Probe | null = null;
  distance: number | null = null;
  private tool: "probe" | "distance" | null = null;
  private readonly marks: Vec[] = [];
  private readonly stage = element("stage");

  constructor(private readonly viewer: Viewer, private readonly page: Page) {
    const { meta } = viewer;
    document.title = meta.name;
    element("name").textContent = meta.name;
    fillSelect(element("level"), [["-1", "Finest"], ...meta.levels.map((level, i): [string, string] => [
      String(i), level.error > 0 ? `${level.name} (error ${digits(level.error * 100)}%)` : level.name])], "-1");
    fillSelect(element("view"), [["", "View"], ...VIEWS.map(([name], i): [string, string] => [String(i), name])], "");
    fillSelect(element("renderer"), page.renderers.map((name): [string, string] => [name, name]), "");
    this.listen();
    addControls(viewer, this.stage, { click: (x, y) => void this.click(x, y), key: (key) => this.key(key) });
    viewer.onChange = () => this.refresh();
    viewer.onRefused = (what, error) => {
      say(`${what} cannot be shown: ${error instanceof Error ? error.message : String(error)}`);
      this.refresh();
    };
    this.setDark(matchMedia("(prefers-color-scheme: dark)").matches);
    this.fillLayers();
    new ResizeObserver(() => this.resize()).observe(this.stage);
    this.resize();
  }

  private listen(): void {
    const on = (id: string, work: () => void): void => element(id).addEventListener("click", work);
    on("reset", () => this.reset());
    on("probe", () => this.choose("probe"));
    on("measure", () => this.choose("distance"));
    on("picture", () => this.savePicture());
    on("link", () => this.copyLink());
    on("theme", () => this.setDark(document.documentElement.dataset.theme !== "dark"));
    const level = element<HTMLSelectElement>("level"), view = element<HTMLSelectElement>("view"),
          layer = element<HTMLSelectElement>("layer"), renderer = element<HTMLSelectElement>("renderer");
    level.addEventListener("change", () => this.setLevel(Number(level.value)));
    view.addEventListener("change", () => {
      if (view.value !== "") this.setView(Number(view.value));
      view.value = "";
    });
    layer.addEventListener("change", () => this.setLayer(Number(layer.value)));
    renderer.addEventListener("change", () => this.page.chooseRenderer(renderer.value).catch((error: unknown) => {
      say(`${renderer.value} cannot draw: ${(error as Error).message}`);
      this.refresh();
    }));
    addEventListener("hashchange", () => {
      const camera = cameraOfLink(this.viewer, location.hash);
      if (camera) this.viewer.setCamera(camera);
    });
    for (const id of ["layer-lo", "layer-hi"])
      element<HTMLInputElement>(id).addEventListener("change", () => this.setRange());
  }

  private resize(): void {
    const { stage, viewer: { canvas } } = this, ratio = Math.min(devicePixelRatio, 2);
    const width = Math.round(stage.clientWidth * ratio), height = Math.round(stage.clientHeight * ratio);
    if (width === 0 || (width === canvas.width && height === canvas.height)) return;
    canvas.width = width;
    canvas.height = height;
    this.viewer.changed();
  }

  private setDark(dark: boolean): void {
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    this.viewer.background = dark ? [0.09, 0.1, 0.11] : [0.95, 0.95, 0.94];
    element("theme").setAttribute("aria-pressed", String(dark));
    this.viewer.changed();
  }

  reset(): void {
    this.viewer.setCamera(this.viewer.standardView(30, 20));
  }
  setView(index: number): void {
    const [, azimuth, elevation] = VIEWS[index]!;
    this.viewer.setCamera(this.viewer.standardView(azimuth, elevation));
  }

  setLevel(index: number): void {
    const viewer = this.viewer;
    viewer.wanted = index;
    let shown = index;
    if (index < 0) for (let i = 0; i < viewer.levels.length; ++i) if (viewer.levels[i]) shown = i;
    if (viewer.levels[shown]) viewer.show(shown);
    else say(`${viewer.meta.levels[index]!.name} is still being decoded`);
    element<HTMLSelectElement>("level").value = String(index);
    this.fillLayers();
  }

  /** Of the level that is shown. */
  private layers(): LayerMeta[] {
    return this.viewer.meta.levels[Math.max(0, this.viewer.level)]!.layers;
  }
  private fillLayers(): void {
    const select = element<HTMLSelectElement>("layer"), layers = this.layers();
    const choices = layers.map((layer, i): [string, string] => [String(i), isTexture(layer) ? "" : layer.name]).filter(([, name]) => name);
    if (select.options.length !== choices.length + 1)
      fillSelect(select, [["-1", "Surface"], ...choices], String(this.viewer.layer?.index ?? -1));
    select.disabled = choices.length === 0;
  }
  setLayer(index: number): void {
    const meta = this.layers()[index];
    const coded = meta && meta.hi > meta.lo;
    this.viewer.setLayer(meta ? { index, meta, lo: coded ? meta.lo : 0, hi: coded ? meta.hi : 65535 } : null);
    element<HTMLSelectElement>("layer").value = String(meta ? index : -1);
    if (meta) {
      element<HTMLInputElement>("layer-lo").value = digits(coded ? meta.lo : 0);
      element<HTMLInputElement>("layer-hi").value = digits(coded ? meta.hi : 65535);
    }
    this.refresh();
  }
  private setRange(): void {
    const layer = this.viewer.layer, lo = Number(element<HTMLInputElement>("layer-lo").value),
          hi = Number(element<HTMLInputElement>("layer-hi").value);
    if (layer && lo < hi) this.viewer.setLayer({ ...layer, lo, hi });
    else say("The range's lower end has to be below its upper one");
  }

  private key(key: string): boolean {
    const lower = key.toLowerCase();
    if (lower >= "1" && lower <= "6") this.setView(Number(lower) - 1);
    else if (lower === "r" || lower === "home") this.reset();
    else if (lower === "p") this.choose("probe");
    else if (lower === "d") this.choose("distance");
    else if (lower === "s") this.savePicture();
    else if (lower === "escape") this.choose(null);
    else return false;
    return true;
  }

  choose(tool: "probe" | "distance" | null): void {
    this.tool = tool === this.tool ? null : tool;
    this.marks.length = 0;
    this.distance = null;
    element("probe").setAttribute("aria-pressed", String(this.tool === "probe"));
    element("measure").setAttribute("aria-pressed", String(this.tool === "distance"));
    say(this.tool === "probe" ? "Click the surface to probe it"
      : this.tool === "distance" ? "Click two points of the surface" : "");
    this.refresh();
  }

  async click(x: number, y: number): Promise<void> {
    if (!this.tool) return;
    const found = await this.viewer.probe(x, y), units = this.viewer.meta.units;
    this.probed = found;
    if (!found) return say("There is no surface here");
    if (this.tool === "probe" || this.marks.length >= 2) this.marks.length = 0;
    this.marks.push(found.position);
    if (this.tool === "probe") {
      const layer = this.viewer.layer;
      say(`Position ${triple(found.position)}${units ? ` ${units}` : ""} · normal ${found.normal.map((v) => v.toFixed(3)).join(", ")}` +
          (layer ? ` · ${layer.meta.name} ${found.values.map(digits).join(", ")}` : ""));
    } else if (this.marks.length === 2) {
      this.distance = length(sub(this.marks[0]!, this.marks[1]!));
      say(`Distance ${digits(this.distance)} ${units || "units"}`);
    } else {
      say("Click the second point");
    }
    this.refresh();
  }

  private savePicture(): void {
    this.viewer.canvas.toBlob((blob) => {
      if (!blob) return;
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      link.download = `${this.viewer.meta.name}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
      say("The picture is saved");
    });
  }

  private copyLink(): void {
    history.replaceState(null, "", cameraLink(this.viewer));
    const copied = navigator.clipboard?.writeText(location.href);
    const there = "The address bar has the link to this view";
    if (copied) copied.then(() => say("The link to this view is copied"), () => say(there));
    else say(there);
  }

  refresh(): void {
    const { viewer } = this, layer = viewer.layer;
    const level = viewer.level >= 0 ? viewer.meta.levels[viewer.level]! : null;
    this.fillLayers();
    const state = [level?.name ?? "…", viewer.renderer?.name ?? "",
                   viewer.rate > 0 ? `${viewer.rate.toPrecision(2)} Mrays/s` : ""];
    element("state").textContent = state.filter((part) => part !== "").join(" · ");
    if (viewer.renderer) element<HTMLSelectElement>("renderer").value = viewer.renderer.name;
    element("bar").hidden = !layer || layer.meta.channels > 2;
    element("bar-name").textContent = layer?.meta.name ?? "";
    const ratio = viewer.canvas.width / Math.max(1, this.stage.clientWidth);
    const marks = this.marks.map((point) => {
      const mark = document.createElement("i"), place = viewer.project(point);
      mark.hidden = !place;
      if (place) mark.style.translate = `${place[0] / ratio}px ${place[1] / ratio}px`;
      return mark;
    });
    element("marks").replaceChildren(...marks);
  }
}
