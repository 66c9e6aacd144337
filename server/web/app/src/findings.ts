// The files of a job: what the server found in them, and what is left out and why.

import {call, get, type ApiError, type Job, type JobFile, type PhotoFindings} from "./api.js";
import type {Part} from "./actions.js";
import {el, notice} from "./dom.js";
import {kPhotosChosen, secondsOf, timeText} from "./format.js";
import {masksAlone, removeFile} from "./upload.js";

// "1/30 s, f/1.8, ISO 800", of what EXIF says.
function exposureText(found: PhotoFindings): string {
  const {exposureSeconds: s, fNumber, iso} = found;
  return [s && (s < 0.3 ? `1/${Math.round(1 / s)} s` : `${Number(s.toPrecision(2))} s`),
          fNumber && `f/${fNumber}`, iso && `ISO ${iso}`].filter(Boolean).join(", ");
}

function stopsText(stops: number): string {
  const text = Math.abs(stops).toFixed(1);
  return text === "0.0" ? text : `${stops < 0 ? "\u2212" : "+"}${text}`;
}
const lensText = (found: PhotoFindings): string =>
    found.focalLengthMm ? `${Number(found.focalLengthMm.toFixed(1))} mm` : "";

// From the smallest to the largest; one text where they are the same.
function range(numbers: number[], text: (n: number) => string): string {
  const low = text(Math.min(...numbers)), high = text(Math.max(...numbers));
  return low === high ? low : `${low} to ${high}`;
}

// "35 mm, 50 mm", or how many there are if that would be long.
function distinct(texts: string[], what: string): string {
  const all = [...new Set(texts.filter(Boolean))];
  return all.length <= 3 ? all.join(", ") : `${all.length} ${what}`;
}

// One line on all photos.
function summaryOf(photos: JobFile[], why: Map<string, string>): string {
  const out = photos.filter((p) => why.has(p.fileName)).length, used = photos.length - out;
  const sizes = distinct(photos.map((p) => `${p.width}\u00d7${p.height} px`), "sizes");
  const lenses = distinct(photos.map((p) => lensText(p.found ?? {})), "focal lengths");
  const stops = photos.flatMap((p) => p.found?.stops === undefined ? [] : [p.found.stops]);
  return [`${used} ${used === 1 ? "photo is" : "photos are"} of use` + (out ? `, ${out} left out` : ""),
          sizes, lenses,
          stops.length > 0 && `light: ${range(stops, stopsText)} stops from the middle photo`]
      .filter(Boolean).join("; ");
}

// "A video of 640×480 px, 12 s, 360 frames: its sharpest frames become photos."
function videoText({width, height, foundInVideo: found}: JobFile): string {
  const facts = [`${width}\u00d7${height} px`, found?.duration && timeText(secondsOf(found.duration)),
                 Number(found?.frames ?? 0) > 0 && `${found!.frames} frames`];
  return `A video of ${facts.filter(Boolean).join(", ")}: its sharpest frames become photos.`;
}

// `remove`: how the user takes a photo out, if that is possible.
type Remove = ((photo: string, by: HTMLButtonElement) => void) | undefined;

function removeButton(photo: string, remove: Remove): HTMLElement | undefined {
  if (!remove) return undefined;
  const own: HTMLButtonElement = el("button", {type: "button", "aria-label": `Remove ${photo}`,
                                               click: () => remove(photo, own)}, "Remove");
  return own;
}

function row(photo: JobFile, why: string | undefined, remove: Remove): HTMLElement {
  const found = photo.found ?? {};
  const cells = [`${photo.width}\u00d7${photo.height}`, lensText(found), exposureText(found),
                 found.stops === undefined ? "" : stopsText(found.stops),
                 found.sharpness ? found.sharpness.toFixed(2) : ""];
  return el("tr", why ? {class: "dropped"} : {}, el("th", {scope: "row"}, photo.fileName),
            ...cells.map((text) => el("td", {}, text)),
            el("td", {}, why ? `left out: ${why}` : "used", " ", removeButton(photo.fileName, remove)));
}

function table(photos: JobFile[], why: Map<string, string>, remove: Remove): HTMLElement {
  const head = ["Photo", "Size, px", "Lens", "Exposure", "Light, stops", "Sharpness", "Use"].map(
      (text) => el("th", {scope: "col"}, text));
  return el("div", {class: "wide", tabindex: 0, role: "group", "aria-label": "Table of the photos"},
            el("table", {class: "photos"}, el("thead", {}, el("tr", {}, ...head)),
               el("tbody", {}, ...photos.map((p) => row(p, why.get(p.fileName), remove)))));
}

// All of them: a page of the list ends before it is too large for a message.
export async function filesOf(job: string): Promise<JobFile[]> {
  const files: JobFile[] = [];
  let pageToken = "";
  do {
    const query = new URLSearchParams({pageSize: "10000", pageToken});
    const page = await get<{files?: JobFile[]; nextPageToken?: string}>(`/v1/${job}/files?${query}`);
    files.push(...page.files ?? []);
    pageToken = page.nextPageToken ?? "";
  } while (pageToken);
  return files;
}

// Read when it is opened, and open while the job waits to be started.
export function findings(name: string): Part {
  const body = el("div", {}), summary = el("p", {class: "findings"});
  let job: Job | undefined, files: JobFile[] | undefined, readAt = "";
  const draw = (): void => {
    const photos = (files ?? []).filter((f) => f.role === "FILE_ROLE_PHOTO");
    const video = files?.find((f) => f.role === "FILE_ROLE_VIDEO");
    const why = new Map((job?.report?.dropped ?? []).map((photo) => [photo, "see the notes"]));
    for (const photo of photos) if (photo.found?.leftOut) why.set(photo.fileName, `it ${photo.found.leftOut}`);
    summary.textContent = video ? videoText(video)
      : photos.length ? `${summaryOf(photos, why)}.` : files ? "There are no photos." : "";
    const mayRemove = job?.state === "JOB_STATE_UPLOADING";
    body.replaceChildren(photos.length ? table(photos, why, mayRemove ? remove : undefined) : "");
  };
  // Its masks go first: without them it would be another photo, but a job does not start with a mask of none.
  const takeOut = async (photo: string): Promise<void> => {
    const rest = files!.filter((f) => f.role !== "FILE_ROLE_PHOTO" || f.fileName !== photo);
    for (const mask of masksAlone(rest, [photo])) await removeFile(name, mask, "FILE_ROLE_MASK");
    await removeFile(name, photo, "FILE_ROLE_PHOTO");
    const labels = job!.labels ?? {}, chosen = Number(labels[kPhotosChosen] ?? 0);
    if (!chosen) return;
    job = await call<Job>("PATCH", `/v1/${name}?updateMask=labels`,
                          {labels: {...labels, [kPhotosChosen]: String(chosen - 1)}});
  };
  const remove = (photo: string, by: HTMLButtonElement): void => {
    if (!window.confirm(`Remove ${photo} from this job?`)) return;
    by.disabled = true;  // until the table is drawn without it
    takeOut(photo).then(() => "", (error: unknown) => (error as ApiError).message).then(async (trouble) => {
      if (!details.isConnected) return;
      notice(trouble);
      by.disabled = false;
      readAt = "";
      await load();
      body.querySelector<HTMLElement>(".wide")?.focus();
    });
  };
  const load = async (): Promise<void> => {
    if (!details.open || !job) return;
    const {state, photos = 0} = job, now = `${state} ${photos}`;
    // A job does not count videos: one may come at any time before the start.
    if (now === readAt && (state !== "JOB_STATE_UPLOADING" || photos > 0)) return;
    readAt = now;
    try {
      files = await filesOf(name);
      draw();
    } catch (error) {
      readAt = "";
      if (details.isConnected) notice((error as ApiError).message);
    }
  };
  const details = el("details", {toggle: () => void load()}, el("summary", {}, "Photos"), summary, body);
  return {
    element: details,
    show(next) {
      const first = job === undefined;
      const changed = JSON.stringify(next.report?.dropped) !== JSON.stringify(job?.report?.dropped);
      job = next;
      if (first) details.open = job.state === "JOB_STATE_UPLOADING";
      if (changed) draw();
      void load();
    },
  };
}
