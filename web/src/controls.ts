// Mouse, fingers and keys.
import type { Viewer } from "./viewer";

const KEY_TURN = Math.PI / 36, KEY_PAN = 40, KEY_ZOOM = 0.85, CLICK_PIXELS = 4;

export interface Actions {
  click(x: number, y: number): void; // in the canvas's pixels
  key(key: string): boolean;
}

export function addControls(viewer: Viewer, view: HTMLElement, actions: Actions): void {
  const fingers = new Map<number, { x: number; y: number }>();
  let moved = 0;
  const ratio = (): number => viewer.canvas.width / Math.max(1, view.clientWidth);
  const place = (event: MouseEvent): [number, number] => {
    const box = view.getBoundingClientRect();
    return [(event.clientX - box.left) * ratio(), (event.clientY - box.top) * ratio()];
  };

  view.addEventListener("pointerdown", (event) => {
    view.focus({ preventScroll: true });
    view.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size === 1) moved = 0;
  });
  view.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before.x, dy = event.clientY - before.y;
    moved += Math.abs(dx) + Math.abs(dy);
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)![1];
      const apart = Math.hypot(event.clientX - other.x, event.clientY - other.y),
            were = Math.hypot(before.x - other.x, before.y - other.y);
      if (apart > 0 && were > 0) viewer.zoom(were / apart);
      viewer.pan((dx / 2) * ratio(), (dy / 2) * ratio());
    } else if (fingers.size === 1) {
      if (event.buttons & 6 || event.shiftKey || event.ctrlKey) viewer.pan(dx * ratio(), dy * ratio());
      else viewer.orbit((-dx / view.clientHeight) * Math.PI, (dy / view.clientHeight) * Math.PI);
    }
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  const lift = (event: PointerEvent): void => {
    const was = fingers.delete(event.pointerId);
    if (was && event.type === "pointerup" && fingers.size === 0 && moved < CLICK_PIXELS && event.button === 0)
      actions.click(...place(event));
  };
  view.addEventListener("pointerup", lift);
  view.addEventListener("pointercancel", lift);
  view.addEventListener("contextmenu", (event) => event.preventDefault());
  view.addEventListener("dblclick", (event) => void viewer.setPivot(...place(event)));
  view.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 30 : event.deltaMode === 2 ? 300 : 1;
    viewer.zoom(Math.exp(event.deltaY * lines * 0.001));
  }, { passive: false });

  view.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const steps: Record<string, [number, number]> = {
      ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[event.key];
    if (step) {
      if (event.shiftKey) viewer.pan(-step[0] * KEY_PAN * ratio(), -step[1] * KEY_PAN * ratio());
      else viewer.orbit(step[0] * KEY_TURN, -step[1] * KEY_TURN);
    } else if (event.key === "+" || event.key === "=") {
      viewer.zoom(KEY_ZOOM);
    } else if (event.key === "-" || event.key === "_") {
      viewer.zoom(1 / KEY_ZOOM);
    } else if (!actions.key(event.key)) {
      return;
    }
    event.preventDefault();
  });
}
