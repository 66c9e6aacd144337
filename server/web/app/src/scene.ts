// Through a scene: pictures from wherever one goes, drawn by the server or in the browser.

import {get, type ApiError, type Cameras, type Job} from "./api.js";
import {add, frameOf, OrbitCamera, type V3} from "./camera.js";
import {hasWebGl} from "./contract.js";
import {control} from "./controls.js";
import {el, labelled, notice, select, svg} from "./dom.js";
import {Drawing} from "./drawing.js";
import {titleOf} from "./format.js";
import {Here} from "./here.js";
import {measuring} from "./measure.js";
import {touring} from "./tour.js";
import type {View} from "./view.js";

const kChannels: [string, string][] = [
  ["CHANNEL_LIGHT", "Colour"], ["CHANNEL_ORIGINAL", "Original light"], ["CHANNEL_DEPTH", "Depth"],
  ["CHANNEL_STRUCTURE", "Structure"], ["CHANNEL_ILLUMINATION", "Illumination"],
  ["CHANNEL_ALPHA", "Coverage"],
];
const kFrustum = 0.08;  // depth of a camera's outline, of the scene's radius

// A slider that says its value.
function slider(text: string, min: number, max: number, step: number, unit: string,
                moved: () => void): {element: HTMLElement; input: HTMLInputElement} {
  // Sighted people's; the slider says it to others.
  const shown = el("span", {class: "time", "aria-hidden": "true"}, `0${unit}`);
  const input: HTMLInputElement = el("input", {
    type: "range", min, max, step, value: 0,
    input: () => { shown.textContent = `${input.value}${unit}`; moved(); },
  });
  return {element: el("label", {class: "field"}, el("span", {}, text, " ", shown), input), input};
}

// The outlines of the photos' cameras over the picture; a click goes there.
function outlines(cameras: Cameras, camera: OrbitCamera, go: (name: string) => void): {
  element: SVGElement; draw: (width: number, height: number) => void;
} {
  const element = svg("svg", {class: "outlines", "aria-hidden": "true"});
  const draw = (width: number, height: number): void => {
    element.setAttribute("viewBox", `0 0 ${width} ${height}`);
    element.replaceChildren();
    for (const {name, camera: photo} of cameras.cameras ?? []) {
      const frame = frameOf(photo), depth = kFrustum * camera.radius;
      const x = depth * photo.width / 2 / photo.intrinsics.fx;
      const y = depth * photo.height / 2 / photo.intrinsics.fy;
      const corner = (sx: number, sy: number): V3 =>
          add(add(add(frame.eye, frame.forward, depth), frame.right, sx * x), frame.down, sy * y);
      const eye = camera.project(frame.eye, width, height);
      const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)]
          .map((p) => camera.project(p, width, height));
      if (!eye || corners.some((c) => !c)) continue;
      const rays = corners.map((c) => `M${eye}L${c}`).join("");
      element.append(svg("path", {d: `${rays}M${corners.join("L")}Z`, click: () => go(name)},
                         svg("title", {}, name)));
    }
  };
  return {element, draw};
}

function stage(job: Job, cameras: Cameras): {element: HTMLElement; leave: () => void} {
  const camera = new OrbitCamera(cameras);
  const canvas = el("canvas", {
    tabindex: 0, role: "application", class: "stage",
    "aria-label": "The scene. W A S D Q E move, arrow keys turn around what is in front, plus and " +
        "minus go nearer and away; drag, pinch or scroll do the same.",
  });
  const status = el("p", {class: "status"});
  const channel = select(kChannels, "CHANNEL_LIGHT", {change: () => changed()});
  const light = slider("Light: 0 normal, 1 as photographed", -0.5, 1.5, 0.05, "", () => changed());
  const exposure = slider("Exposure", -4, 4, 0.25, " stops", () => changed());
  const shown = el("input", {type: "checkbox", change: () => changed()});
  const names = (cameras.cameras ?? []).map((c) => c.name);
  const jumps = select([["", "somewhere else"], ...names.map((n): [string, string] => [n, n])],
                       names[0] ?? "", {change: () => jumps.value && go(jumps.value)});
  const save = el("a", {class: "button", hidden: true}, "Save picture");

  const count = (full: boolean): void => {
    canvas.dataset.full = String(full);
    canvas.dataset.drawn = String(Number(canvas.dataset.drawn ?? 0) + 1);
  };
  const go = (name: string): void => {
    const photo = cameras.cameras?.find((c) => c.name === name);
    if (!photo) return;
    camera.jump(photo.camera);
    jumps.value = name;
    changed();
  };
  const beside = (step: number): void => {
    const at = names.indexOf(jumps.value);
    go(names[(at + step + names.length) % names.length]!);
  };
  const over = outlines(cameras, camera, go);
  const measure = measuring(job.name, canvas, camera);
  const look = (): Record<string, unknown> => {
    const colour = channel.value === "CHANNEL_LIGHT" || channel.value === "CHANNEL_ORIGINAL";
    return {
      channel: channel.value, verticalFovDeg: camera.fovDeg,
      ...(channel.value === "CHANNEL_LIGHT" && {light: Number(light.input.value)}),
      ...(colour && {exposureStops: Number(exposure.input.value)}),
    };
  };
  const pose = (): unknown => ({viewmat: {values: camera.viewmat()}});
  const tour = touring(job.name, titleOf(job), pose, look);
  const drawing = new Drawing(job.name, canvas, () => ({pose: pose(), settings: look()}),
                              ({blob, about}, ms, full) => {
    if (here.on) return;
    count(full);
    status.textContent = `${about.width} x ${about.height}, ${Math.round(ms)} ms, ` +
        `iteration ${about.iteration ?? 0}`;
    if (!full) return;
    URL.revokeObjectURL(save.href);
    save.href = URL.createObjectURL(blob);
    save.download = `${titleOf(job)}.jpg`;
    save.hidden = false;
    notice("");
  }, (error) => notice(error.message));
  const here = new Here(job, camera, (size, final) => {
    if (final) canvas.dataset.full = "true";
    else count(false);
    status.textContent = `${size}, drawn here`;
  }, (error) => { by.value = "server"; switched(); notice(error.message); });
  const by = select([["server", "by the server"], ["here", "here, by WebGL"]], "server",
                    {change: () => { notice(""); switched(); }});
  if (!hasWebGl()) {
    by.disabled = true;
    by.title = "This browser has no WebGL 2";
  }
  const switched = (): void => {
    canvas.classList.toggle("clear", by.value === "here");
    canvas.dataset.full = "false";
    save.hidden = true;
    status.textContent = "Loading";
    here.show(by.value === "here");
    changed();
  };
  const changed = (): void => {
    channel.disabled = here.on;
    light.input.disabled = here.on || channel.value !== "CHANNEL_LIGHT";
    exposure.input.disabled = here.on || !/LIGHT|ORIGINAL/.test(channel.value);
    over.element.toggleAttribute("hidden", !shown.checked);
    if (shown.checked) over.draw(canvas.clientWidth, canvas.clientHeight);
    measure.draw();
    if (here.on) {
      canvas.dataset.full = "false";
      here.draw();
    } else {
      drawing.ask();
    }
  };
  const uncontrol = control(canvas, camera, () => { jumps.value = ""; changed(); });
  const resized = new ResizeObserver(changed);
  resized.observe(canvas);
  const element = el(
      "div", {class: "scene"}, el("div", {class: "frame"}, canvas, here.canvas, over.element, measure.overlay), status,
      el("div", {class: "controls"},
         labelled("Drawn", by), labelled("Show", channel), light.element, exposure.element,
         el("div", {class: "field"}, labelled("Photo's place", jumps),
            el("div", {class: "row"},
               el("button", {type: "button", click: () => beside(-1)}, "Previous photo"),
               el("button", {type: "button", click: () => beside(1)}, "Next photo"))),
         el("label", {class: "check"}, shown, "Show where photos were taken"), measure.controls,
         save), tour.element);
  return {element, leave: () => {
    drawing.stop();
    here.leave();
    measure.leave();
    tour.leave();
    uncontrol();
    resized.disconnect();
  }};
}

export function sceneView(id: string): View {
  const heading = el("h1", {}, "Scene");
  const place = el("div", {});
  const element = el("div", {}, el("div", {class: "heading"}, heading,
                                   el("a", {class: "button", href: `#/jobs/${id}`}, "Job")), place);
  let leave: (() => void) | undefined, left = false;
  const load = async (): Promise<void> => {
    try {
      const job = await get<Job>(`/v1/jobs/${id}`);
      heading.textContent = titleOf(job);
      const cameras = await get<Cameras>(`/v1/jobs/${id}/cameras`);
      if (left) return;
      const made = stage(job, cameras);
      leave = made.leave;
      place.replaceChildren(made.element);
      notice("");
    } catch (error) {
      notice((error as ApiError).message);
      if ((error as ApiError).code === 0 && !left) window.setTimeout(load, 2000);
    }
  };
  void load();
  return {title: "Scene", element, leave: () => { left = true; leave?.(); }};
}
