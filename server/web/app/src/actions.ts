// What can be done with a job: buttons and downloads.

import {call, newId, post, type ApiError, type Job} from "./api.js";
import {el, labelled, notice, select} from "./dom.js";
import {downloadLink} from "./download.js";
import {idOf, isOver, kTitleBytes, photosAwaited, prefixOf, titleOf} from "./format.js";

// Formats of ExportModel, with how their files end.
const kFormats: [format: string, text: string, ending: string][] = [
  ["PLY", "PLY, normally lit", ".ply"], ["SPZ", "SPZ", ".spz"], ["SOG", "SOG", ".sog"],
  ["COMPRESSED_PLY", "compressed PLY", ".compressed.ply"], ["SPLAT", "splat", ".splat"],
  ["GLB", "glTF", ".glb"], ["USDA", "OpenUSD", ".usda"], ["SPZ_V4", "SPZ, version 4", ".spz"],
  ["PLY_FULL", "PLY, all attributes", ".ply"], ["LITAGS", "litags, for the library", ".litags"],
  ["HTML", "a page that shows it", ".html"], ["COLMAP", "COLMAP model", ".zip"],
  ["POINTS", "points, PLY", ".points.ply"], ["LAS", "points, LAS", ".las"],
  ["MESH_GLB", "mesh, glTF", ".mesh.glb"], ["MESH_PLY", "mesh, PLY", ".mesh.ply"],
];

const kOfLitags = ["PLY_FULL"];  // plain 3DGS knows nothing of light

export interface Part { element: HTMLElement; show: (job: Job) => void; leave?: () => void }

export function actions(refresh: () => void): Part {
  let job: Job | undefined;
  const act = async (by: HTMLButtonElement, what: () => Promise<unknown>): Promise<void> => {
    by.disabled = true;  // until the answer is there
    try {
      notice("");
      await what();
    } catch (error) {
      notice((error as ApiError).message);
    }
    by.disabled = false;
    if (element.isConnected) refresh();
  };
  const button = (text: string, what: (job: Job) => Promise<unknown>, style = ""): HTMLButtonElement => {
    const own: HTMLButtonElement = el(
        "button", {type: "button", class: style, click: () => { if (job) void act(own, () => what(job!)); }}, text);
    return own;
  };
  // Unless the user has gone elsewhere meanwhile.
  const go = (hash: string): void => { if (element.isConnected) location.hash = hash; };
  let queueId = newId();  // of Start or Resume as the job stands: another click is the same call
  const start = button("Start", async (j) => {
    const few = photosAwaited(j);
    if (few && !window.confirm(`${few}. Start without the others?`)) return;
    await post(`/v1/${j.name}:start`, {requestId: queueId});
  }, "primary");
  const cancel = button("Cancel", (j) => post(`/v1/${j.name}:cancel`));
  const resume = button("Resume", (j) => post(`/v1/${j.name}:resume`, {requestId: queueId}), "primary");
  let cloneId = newId();  // kept until it is answered: another click is the same call
  const clone = button("Clone", async (j) => {
    const copy = " (copy)";
    const made = await post<Job>(`/v1/${j.name}:clone`, {
      requestId: cloneId, displayName: prefixOf(titleOf(j), kTitleBytes - copy.length) + copy});
    cloneId = newId();
    go(`#/jobs/${idOf(made.name)}`);
  });
  const sure = el("dialog", {"aria-labelledby": "sure"},
                  el("p", {id: "sure"}, "Delete this job with its photos and its scene?"),
                  el("div", {class: "row"},
                     button("Delete", async (j) => {
                       sure.close();  // a refusal is said behind it
                       await call("DELETE", `/v1/${j.name}`);
                       go("#/");
                     }, "danger"),
                     el("button", {type: "button", click: () => sure.close()}, "Keep")));
  const remove = el("button", {type: "button", class: "danger", click: () => sure.showModal()}, "Delete");
  const element = el("div", {class: "row actions"}, start, cancel, resume, clone, remove, sure);
  return {
    element,
    show(next) {
      if (next.state !== job?.state || next.endTime !== job.endTime) queueId = newId();
      job = next;
      start.hidden = job.state !== "JOB_STATE_UPLOADING";
      cancel.hidden = isOver(job);
      cancel.disabled = job.cancelRequested === true;
      resume.hidden = !/FAILED|CANCELLED/.test(job.state);
      remove.disabled = job.state === "JOB_STATE_RUNNING";
    },
  };
}

export function downloads(): Part {
  let job: Job | undefined;
  const link = downloadLink("Download");
  const format = select(kFormats.map(([name, text]) => [name, text]), "PLY", {change: () => point()});
  const point = (): void => {
    if (!job) return;
    link.href = `/v1/${job.name}/model?format=MODEL_FORMAT_${format.value}`;
    link.download = titleOf(job) + kFormats.find(([name]) => name === format.value)![2];
  };
  const element = el("section", {"aria-label": "Download", hidden: true}, el("h2", {}, "Scene as a file"),
                     el("div", {class: "row end"}, labelled("Format", format), link));
  return {
    element,
    show(next) {
      job = next;
      element.hidden = job.snapshotIteration === undefined;
      for (const option of format.options) {
        option.hidden = option.disabled = job.options?.method === "METHOD_3DGS" && kOfLitags.includes(option.value);
      }
      point();
    },
  };
}
