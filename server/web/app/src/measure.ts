// Distances in a scene, between points of its surfaces.

import {renderView, type ApiError} from "./api.js";
import {add, length, viewmatOf, type OrbitCamera, type V3} from "./camera.js";
import {el, labelled, notice, svg} from "./dom.js";

const kSpot = 8;          // px, side of the picture whose middle is the point
const kSpotDeg = 0.2;     // its field of view
const kClickPixels = 4;   // farther is a drag
const kDigits = 4;

// The point of a surface along a ray of unit length from the camera; null: nothing is there.
async function surface(job: string, camera: OrbitCamera, ray: V3): Promise<V3 | null> {
  const eye = camera.eye;  // it may move before the answer comes
  const {blob} = await renderView(job, {
    pose: {viewmat: {values: viewmatOf(camera.frame(ray))}},
    settings: {channel: "CHANNEL_DEPTH", format: "PICTURE_FORMAT_RAW_FLOAT", width: kSpot, height: kSpot,
               verticalFovDeg: kSpotDeg},
  });
  const depths = [...new Float32Array(await blob.arrayBuffer())].filter((z) => z > 0).sort((a, b) => a - b);
  const middle = depths[depths.length >> 1];
  return middle === undefined ? null : add(eye, ray, middle);
}

// `overlay` lies over the picture and is drawn anew by draw() when the camera has moved.
export function measuring(job: string, canvas: HTMLCanvasElement, camera: OrbitCamera): {
  overlay: SVGElement; controls: HTMLElement; draw: () => void; leave: () => void;
} {
  const overlay = svg("svg", {class: "measure", "aria-hidden": "true", hidden: true});
  const on = el("input", {type: "checkbox", change: () => draw()});
  const result = el("output", {"aria-live": "polite"});
  const known = el("input", {type: "number", min: 0, step: "any", change: () => {
    if (points.length === 2 && Number(known.value) > 0) metres = Number(known.value) / distance();
    draw();
  }});
  const knownField = labelled("Its length, m, if known", known,
                              "Distances are in units of the scene until one length is known.");
  let points: V3[] = [];
  let metres = 0;  // of one unit of the scene; 0: not known

  const distance = (): number => length(add(points[1]!, points[0]!, -1));
  const said = (): string => {
    if (points.length < 2) {
      return `Click the ${points.length === 0 ? "first" : "second"} point, ` +
          "or press M for the middle of the picture.";
    }
    return metres > 0 ? `${(metres * distance()).toPrecision(kDigits)} m`
                      : `${distance().toPrecision(kDigits)} units of the scene`;
  };
  const draw = (): void => {
    const width = canvas.clientWidth, height = canvas.clientHeight;
    overlay.toggleAttribute("hidden", !on.checked);
    result.hidden = !on.checked;
    knownField.hidden = !on.checked || points.length < 2;
    if (!on.checked) return;
    result.textContent = said();
    overlay.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const seen = points.map((p) => camera.project(p, width, height));
    const cross = `M${width / 2 - 8} ${height / 2}h16M${width / 2} ${height / 2 - 8}v16`;
    overlay.replaceChildren(svg("path", {d: cross, class: "middle"}));
    if (seen[0] && seen[1]) overlay.append(svg("path", {d: `M${seen[0]}L${seen[1]}`}));
    for (const p of seen) if (p) overlay.append(svg("circle", {cx: p[0], cy: p[1], r: 4}));
  };
  const mark = async (x: number, y: number): Promise<void> => {
    const ray = camera.ray(x, y, canvas.clientWidth, canvas.clientHeight);
    try {
      const point = await surface(job, camera, ray);
      if (point) points = points.length === 2 ? [point] : [...points, point];
      if (!controls.isConnected) return;
      notice(point ? "" : "Nothing is there to measure to.");
      known.value = "";
      draw();
    } catch (error) {
      if (controls.isConnected) notice((error as ApiError).message);
    }
  };

  let pressed: [number, number] | undefined;
  const down = (event: PointerEvent): void => {
    pressed = event.isPrimary && event.button === 0 ? [event.offsetX, event.offsetY] : undefined;
  };
  const up = (event: PointerEvent): void => {
    if (!on.checked || !pressed) return;
    const moved = Math.hypot(event.offsetX - pressed[0], event.offsetY - pressed[1]);
    if (moved < kClickPixels) void mark(event.offsetX, event.offsetY);
  };
  const key = (event: KeyboardEvent): void => {
    if (!on.checked || event.repeat || event.key.toLowerCase() !== "m") return;
    void mark(canvas.clientWidth / 2, canvas.clientHeight / 2);
  };
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("keydown", key);
  const controls = el("div", {class: "field"}, el("label", {class: "check"}, on, "Measure a distance"),
                      result, knownField);
  draw();
  return {overlay, controls, draw, leave: () => {
    canvas.removeEventListener("pointerdown", down);
    canvas.removeEventListener("pointerup", up);
    canvas.removeEventListener("keydown", key);
  }};
}
