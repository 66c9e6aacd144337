// Through a scene: pictures from wherever one goes, drawn by the server or in the browser.

import {camerasOf, get, saidOfRetried, type ApiError, type Cameras, type Job, type Picture} from "./api.js";
import {add, frameOf, OrbitCamera, type V3} from "./camera.js";
import {hasWebGl} from "./contract.js";
import {control} from "./controls.js";
import {el, labelled, notice, select, svg, voice} from "./dom.js";
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

// The picture with its controls. `leave()` ends what it began.
class Stage {
  private readonly camera: OrbitCamera;
  private readonly names: string[];
  private readonly canvas = el("canvas", {
    tabindex: 0, role: "application", class: "stage",
    "aria-label": "The scene. W A S D Q E move, arrow keys turn around what is in front, plus and " +
        "minus go nearer and away; drag, pinch or scroll do the same.",
  });
  private readonly say = voice();
  private readonly status = el("p", {class: "status"});
  private readonly by = select([["server", "by the server"], ["here", "here, by WebGL"]], "server",
                               {change: () => { notice(""); this.switched(); }});
  private readonly channel = select(kChannels, "CHANNEL_LIGHT", {change: () => this.changed()});
  private readonly light =
      slider("Light: 0 normal, 1 as photographed", -0.5, 1.5, 0.05, "", () => this.changed());
  private readonly exposure = slider("Exposure", -4, 4, 0.25, " stops", () => this.changed());
  private readonly outlined = el("input", {type: "checkbox", change: () => this.changed()});
  private readonly jumps: HTMLSelectElement;
  private readonly save = el("a", {class: "button", hidden: true}, "Save picture");
  private readonly outlines: ReturnType<typeof outlines>;
  private readonly measure: ReturnType<typeof measuring>;
  private readonly tour: ReturnType<typeof touring>;
  private readonly drawing: Drawing;
  private readonly here: Here;
  private readonly uncontrol: () => void;
  private readonly resized = new ResizeObserver(() => this.changed());
  readonly element: HTMLElement;

  constructor(private readonly job: Job, private readonly cameras: Cameras) {
    const camera = this.camera = new OrbitCamera(cameras);
    this.names = (cameras.cameras ?? []).map((c) => c.name);
    this.jumps = select([["", "somewhere else"], ...this.names.map((n): [string, string] => [n, n])],
                        this.names[0] ?? "", {change: () => this.go(this.jumps.value)});
    this.outlines = outlines(cameras, camera, (name) => this.go(name));
    this.measure = measuring(job.name, this.canvas, camera);
    this.tour = touring(job.name, titleOf(job), () => this.pose(), () => this.look());
    this.drawing = new Drawing(job.name, this.canvas, () => ({pose: this.pose(), settings: this.look()}),
                               (picture, ms, full) => this.show(picture, ms, full),
                               (error) => this.say(error.message));
    this.here = new Here(job, camera, (size, final) => this.showHere(size, final), (error) => {
      this.by.value = "server";
      this.switched();
      notice(error.message);
    });
    if (!hasWebGl()) {
      this.by.disabled = true;
      this.by.title = "This browser has no WebGL 2";
    }
    this.uncontrol = control(this.canvas, camera, () => { this.jumps.value = ""; this.changed(); });
    this.resized.observe(this.canvas);
    this.element = this.page();
  }

  leave(): void {
    this.drawing.stop();
    this.here.leave();
    this.measure.leave();
    this.tour.leave();
    this.uncontrol();
    this.resized.disconnect();
    URL.revokeObjectURL(this.save.href);
  }

  private page(): HTMLElement {
    const button = (text: string, step: number): HTMLElement =>
        el("button", {type: "button", click: () => this.beside(step)}, text);
    const controls = el(
        "div", {class: "controls"}, labelled("Drawn", this.by), labelled("Show", this.channel),
        this.light.element, this.exposure.element,
        el("div", {class: "field"}, labelled("Photo's place", this.jumps),
           el("div", {class: "row"}, button("Previous photo", -1), button("Next photo", 1))),
        el("label", {class: "check"}, this.outlined, "Show where photos were taken"),
        this.measure.controls, this.save);
    return el("div", {class: "scene"},
              el("div", {class: "frame"}, this.canvas, this.here.canvas, this.outlines.element, this.measure.overlay),
              this.status, controls, this.tour.element);
  }

  // To the place of a photo.
  private go(name: string): void {
    const photo = this.cameras.cameras?.find((c) => c.name === name);
    if (!photo) return;
    this.camera.jump(photo.camera);
    this.jumps.value = name;
    this.changed();
  }

  // To the photo after (1) or before (-1) this one; from somewhere else, to the first or the last.
  private beside(step: number): void {
    const count = this.names.length, at = this.names.indexOf(this.jumps.value);
    const next = at < 0 && step < 0 ? count - 1 : (at + step + count) % count;
    if (count > 0) this.go(this.names[next]!);
  }

  private pose(): unknown {
    return {viewmat: {values: this.camera.viewmat()}};
  }

  // Channel, light, exposure and lens, as the controls say.
  private look(): Record<string, unknown> {
    const channel = this.channel.value;
    return {
      channel, verticalFovDeg: this.camera.fovDeg,
      ...(channel === "CHANNEL_LIGHT" && {light: Number(this.light.input.value)}),
      ...(/LIGHT|ORIGINAL/.test(channel) && {exposureStops: Number(this.exposure.input.value)}),
    };
  }

  // Who draws has changed.
  private switched(): void {
    const here = this.by.value === "here";
    this.canvas.classList.toggle("clear", here);
    this.canvas.dataset.full = "false";
    this.save.hidden = true;
    this.status.textContent = "Loading";
    this.here.show(here);
    this.changed();
  }

  // The camera or a control has changed.
  private changed(): void {
    const here = this.here.on, channel = this.channel.value;
    this.channel.disabled = here;
    this.light.input.disabled = here || channel !== "CHANNEL_LIGHT";
    this.exposure.input.disabled = here || !/LIGHT|ORIGINAL/.test(channel);
    this.outlines.element.toggleAttribute("hidden", !this.outlined.checked);
    if (this.outlined.checked) this.outlines.draw(this.canvas.clientWidth, this.canvas.clientHeight);
    this.measure.draw();
    if (here) {
      this.canvas.dataset.full = "false";
      this.here.draw();
    } else {
      this.drawing.ask();
    }
  }

  // A picture by the server is on the canvas.
  private show({blob, about}: Picture, ms: number, full: boolean): void {
    if (this.here.on) return;
    this.count(full);
    this.status.textContent = `${about.width} x ${about.height}, ${Math.round(ms)} ms, ` +
        `iteration ${about.iteration ?? 0}`;
    if (!full) return;
    URL.revokeObjectURL(this.save.href);
    this.save.href = URL.createObjectURL(blob);
    this.save.download = `${titleOf(this.job)}.jpg`;
    this.save.hidden = false;
    this.say("");
  }

  // A picture is drawn here; `final`: none better follows.
  private showHere(size: string, final: boolean): void {
    if (final) this.canvas.dataset.full = "true";
    else this.count(false);
    this.status.textContent = `${size}, drawn here`;
  }

  // For tests: how many pictures there were, and whether the newest is the full one.
  private count(full: boolean): void {
    this.canvas.dataset.full = String(full);
    this.canvas.dataset.drawn = String(Number(this.canvas.dataset.drawn ?? 0) + 1);
  }
}

export function sceneView(id: string): View {
  const heading = el("h1", {}, "Scene");
  const place = el("div", {});
  const element = el("div", {}, el("div", {class: "heading"}, heading,
                                   el("a", {class: "button", href: `#/jobs/${id}`}, "Job")), place);
  const say = voice();
  let stage: Stage | undefined, left = false;
  const load = async (): Promise<void> => {
    if (left) return;
    try {
      const job = await get<Job>(`/v1/jobs/${id}`);
      heading.textContent = titleOf(job);
      const cameras = await camerasOf(`jobs/${id}`);
      if (left) return;
      stage = new Stage(job, cameras);
      place.replaceChildren(stage.element);
      say("");
    } catch (error) {
      if (left) return;
      say(saidOfRetried(error));
      if ((error as ApiError).mayComeAgain) window.setTimeout(load, 2000);
    }
  };
  void load();
  return {title: "Scene", element, leave: () => { left = true; stage?.leave(); }};
}
