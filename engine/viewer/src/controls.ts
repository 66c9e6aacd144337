// Mouse, touch and keys that move a camera.

import type {OrbitCamera} from "./camera.js";

const kTurn = 0.006;   // radians a pixel
const kFly = 0.9;      // of the distance to what is orbited, a second
const kTap = 0.016;    // seconds that the shortest touch of a key counts
const kKeys = new Set(["w", "a", "s", "d", "q", "e", "arrowleft", "arrowright", "arrowup", "arrowdown",
                       "+", "-"]);

// `moved` is called after each change. Returns what ends it.
export function control(element: HTMLElement, camera: OrbitCamera, moved: () => void): () => void {
  const pointers = new Map<number, {x: number; y: number}>();
  // By the key's place on the keyboard: "+" is let go as "=" if Shift was let go before it.
  const held = new Map<string, string>();
  let frame = 0, last = 0;

  const spread = (): number => {
    const [a, b] = [...pointers.values()];
    return a && b ? Math.hypot(a.x - b.x, a.y - b.y) : 0;
  };
  const drag = (event: PointerEvent): void => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before.x, dy = event.clientY - before.y;
    const wide = spread();
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
    const height = element.clientHeight || 1;
    if (pointers.size === 2) {  // pinch and pan; each finger moves half
      if (wide > 0 && spread() > 0) camera.dolly(wide / spread());
      camera.move(-dx / height / 2, -dy / height / 2, 0);
    } else if (event.buttons === 2 || event.shiftKey) {
      camera.move(-dx / height, -dy / height, 0);
    } else {
      camera.orbit(dx * kTurn, -dy * kTurn);
    }
    moved();
  };
  const down = (event: PointerEvent): void => {
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
  };
  const up = (event: PointerEvent): void => { pointers.delete(event.pointerId); };
  const wheel = (event: WheelEvent): void => {
    event.preventDefault();
    camera.dolly(Math.exp(Math.max(-50, Math.min(50, event.deltaY)) * 0.002));
    moved();
  };

  const fly = (seconds: number): void => {
    const step = kFly * seconds;
    const keys = new Set(held.values());
    const axis = (plus: string, minus: string): number =>
        step * (Number(keys.has(plus)) - Number(keys.has(minus)));
    camera.move(axis("d", "a"), axis("q", "e"), axis("w", "s"));
    camera.orbit(axis("arrowright", "arrowleft"), axis("arrowup", "arrowdown"));
    const nearer = axis("+", "-");
    if (nearer !== 0) camera.dolly(Math.exp(-nearer));
    moved();
  };
  const flyOn = (now: number): void => {
    frame = 0;
    if (held.size === 0) return;
    fly(Math.min(0.1, Math.max(0, now - last) / 1000));
    last = now;
    frame = requestAnimationFrame(flyOn);
  };
  const keyDown = (event: KeyboardEvent): void => {
    const key = event.key.toLowerCase();
    if (!kKeys.has(key) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const isNew = !held.has(event.code);
    held.set(event.code, key);
    if (isNew) fly(kTap);  // it may be let go before the next frame
    if (!frame) {
      last = performance.now();
      frame = requestAnimationFrame(flyOn);
    }
  };
  const keyUp = (event: KeyboardEvent): void => { held.delete(event.code); };
  const release = (): void => held.clear();
  const noMenu = (event: Event): void => event.preventDefault();

  const end = new AbortController(), {signal} = end;
  element.addEventListener("pointerdown", down, {signal});
  element.addEventListener("pointermove", drag, {signal});
  element.addEventListener("pointerup", up, {signal});
  element.addEventListener("pointercancel", up, {signal});
  element.addEventListener("wheel", wheel, {passive: false, signal});
  element.addEventListener("contextmenu", noMenu, {signal});
  element.addEventListener("keydown", keyDown, {signal});
  element.addEventListener("keyup", keyUp, {signal});
  element.addEventListener("blur", release, {signal});
  return () => { end.abort(); held.clear(); cancelAnimationFrame(frame); };
}
