// A page with nothing but a scene, which is in it.

import {OrbitCamera, type Cameras} from "./camera.js";
import {control} from "./controls.js";
import {openSplats} from "./splats.js";

const textOf = (id: string): string => document.getElementById(id)!.textContent!;

// Decoded by the browser, which is far faster than a loop over the characters of atob().
async function bytesOf(base64: string): Promise<Uint8Array<ArrayBuffer>> {
  const native = (Uint8Array as unknown as {fromBase64?: (text: string) => Uint8Array<ArrayBuffer>}).fromBase64;
  if (native) return native.call(Uint8Array, base64);
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

export async function standalone(scene: HTMLElement): Promise<void> {
  const canvas = document.querySelector("canvas")!;
  const status = document.querySelector("p")!;
  try {
    const cameras = JSON.parse(textOf("cameras")) as Cameras;
    const bytes = await bytesOf(scene.textContent!);
    scene.remove();
    const camera = new OrbitCamera(cameras);
    const view = await openSplats(canvas, bytes, (final) => {
      canvas.dataset.full = String(final);
      status.hidden = true;
    });
    view.onFailure((error) => { status.textContent = error.message; status.hidden = false; });
    const draw = (): void => { canvas.dataset.full = "false"; view.draw(camera); };
    const names = (cameras.cameras ?? []).map(({name}) => name);
    const jumps = document.createElement("select");
    jumps.setAttribute("aria-label", "Photo's place");
    for (const name of ["somewhere else", ...names]) jumps.add(new Option(name));
    jumps.selectedIndex = Math.min(1, names.length);
    jumps.addEventListener("change", () => {
      const photo = cameras.cameras?.[jumps.selectedIndex - 1];
      if (!photo) return;
      camera.jump(photo.camera);
      draw();
    });
    document.body.append(jumps);
    control(canvas, camera, () => { jumps.selectedIndex = 0; draw(); });
    new ResizeObserver(draw).observe(canvas);
    draw();
    canvas.focus();
  } catch (error) {
    status.textContent = (error as Error).message;
  }
}
