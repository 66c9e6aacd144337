// A small picture of a job's scene, from where its first photo was taken.

import {get, getBlob, type Cameras, type Job} from "./api.js";
import {el} from "./dom.js";
import {titleOf} from "./format.js";

const kRefreshMs = 15000;  // of a scene that changes
const pictures = new Map<string, {iteration: number; time: number; url: string}>();

async function load(job: Job): Promise<string> {
  const cameras = await get<Cameras>(`/v1/${job.name}/cameras?pageSize=1`);
  const first = cameras.cameras?.[0]?.name;
  if (!first) return "";
  const query = new URLSearchParams({
    "pose.camera": first, "settings.width": "320", "settings.format": "PICTURE_FORMAT_JPEG",
  });
  return URL.createObjectURL(await getBlob(`/v1/${job.name}/view?${query}`));
}

// Loads when it is scrolled into view: each picture makes the server read a scene.
export function thumbnail(): {element: HTMLElement; show: (job: Job) => void} {
  const image = el("img", {alt: "", hidden: true, width: 320, height: 240});
  const element = el("div", {class: "thumbnail"}, image);
  let job: Job | undefined, seen = false, loading = false;
  const refresh = async (): Promise<void> => {
    const iteration = job?.snapshotIteration;
    if (!job || iteration === undefined || !seen || loading) return;
    const known = pictures.get(job.name);
    if (known) {
      image.src = known.url;
      image.alt = `Picture of ${titleOf(job)}`;
      image.hidden = false;
    }
    if (known?.iteration === iteration) return;
    if (known && Date.now() - known.time < kRefreshMs && job.state === "JOB_STATE_RUNNING") return;
    loading = true;
    try {
      const url = await load(job);
      if (url) {
        if (known) URL.revokeObjectURL(known.url);
        pictures.set(job.name, {iteration, time: Date.now(), url});
        image.src = url;
        image.alt = `Picture of ${titleOf(job)}`;
        image.hidden = false;
      }
    } catch {
      // The list itself says what is wrong.
    } finally {
      loading = false;
    }
  };
  new IntersectionObserver((entries) => {
    seen = entries.some((entry) => entry.isIntersecting);
    void refresh();
  }).observe(element);
  return {element, show: (next) => { job = next; void refresh(); }};
}
