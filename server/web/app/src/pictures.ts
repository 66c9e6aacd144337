// A job's pictures from its photos' places: before and after.

import {camerasOf, getBlob, type Job} from "./api.js";
import {compare} from "./compare.js";
import {el, labelled, select} from "./dom.js";
import {titleOf} from "./format.js";
import type {Part} from "./actions.js";

const kRefreshMs = 5000;

export function pictures(): Part {
  const slide = compare("As photographed", "Normally lit");
  const camera = select([], "", {change: () => void draw()});
  const about = el("p", {class: "hint"});
  const element = el("section", {"aria-label": "Pictures", hidden: true}, el("h2", {}, "Before and after"),
                     slide.element, labelled("From the place of photo", camera), about);
  let job: Job | undefined, drawn = -1, time = 0, busy = false, left = false;

  const url = async (name: string, channel: string): Promise<string> => {
    const query = new URLSearchParams({
      "pose.camera": name, "settings.channel": channel, "settings.format": "PICTURE_FORMAT_JPEG",
    });
    return URL.createObjectURL(await getBlob(`/v1/${job!.name}/view?${query}`));
  };
  let urls: string[] = [];
  // Shows these; a browser keeps pictures until it is told that nobody wants them.
  const keep = (next: string[]): void => {
    urls.forEach((old) => URL.revokeObjectURL(old));
    urls = next;
  };
  const draw = async (): Promise<void> => {
    if (!job || busy || left) return;
    busy = true;
    const iteration = job.snapshotIteration!;
    const made: string[] = [];
    let name = "";
    try {
      if (camera.options.length === 0) {
        const cameras = await camerasOf(job.name);
        camera.append(...(cameras.cameras ?? []).map(({name}) => el("option", {value: name}, name)));
      }
      name = camera.value;  // of both pictures, whatever is chosen meanwhile
      for (const channel of ["CHANNEL_ORIGINAL", "CHANNEL_COLOR"]) made.push(await url(name, channel));
      if (left) return;
      slide.show(made[0]!, made[1]!);
      keep(made.splice(0));
      drawn = iteration;
      time = Date.now();
      about.textContent = `Both are drawn from the scene of ${titleOf(job)}, iteration ${iteration}.`;
      element.hidden = false;
    } catch {
      drawn = -1;  // the next look at the job tries again
    } finally {
      made.forEach((unused) => URL.revokeObjectURL(unused));
      busy = false;
    }
    if (camera.value !== name) void draw();
  };
  return {
    element,
    show(next) {
      job = next;
      const iteration = job.snapshotIteration;
      if (iteration === undefined || iteration === drawn) return;
      if (job.state !== "JOB_STATE_RUNNING" || Date.now() - time > kRefreshMs) void draw();
    },
    leave() {
      left = true;
      keep([]);
    },
  };
}
