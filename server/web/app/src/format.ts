// Numbers and words for people.

import type {Job, Progress} from "./api.js";

// "12.5s" of a Duration as seconds; NaN if there is none.
export const secondsOf = (duration?: string): number => parseFloat(duration ?? "");

export function timeText(seconds: number): string {
  if (!Number.isFinite(seconds)) return "";
  const s = Math.round(seconds);
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
  return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
}

export function bytesText(bytes: number): string {
  const units = ["B", "KiB", "MiB", "GiB"];
  let i = 0;
  for (; bytes >= 1024 && i < units.length - 1; ++i) bytes /= 1024;
  return `${i ? bytes.toFixed(1) : bytes} ${units[i]}`;
}

export const kTitleBytes = 200;  // the server takes no longer ones

// The most characters that UTF-8 writes in so many bytes.
export function prefixOf(text: string, bytes: number): string {
  return text.slice(0, new TextEncoder().encodeInto(text, new Uint8Array(bytes)).read);
}

// What the server takes for a title: no control characters, no more bytes.
export const asTitle = (text: string): string => prefixOf(
    text.replace(/[\u0000-\u001f\u007f-\u009f\u2028-\u202e\u2066-\u2069]/g, "").trim(), kTitleBytes);

// JOB_STATE_RUNNING and STAGE_FINDING_CAMERAS as "running" and "finding cameras".
export const words = (name = ""): string =>
    name.replace(/^(JOB_STATE|STAGE|CHANNEL|LOG_SEVERITY)_/, "").replaceAll("_", " ").toLowerCase();

// What options of a job are called, where their name in the interface is no plain word.
const kOptionNames: Record<string, string> = {
  tone: "Target of the light",
  white_balance: "White balance",
  depth_source: "Depth maps from",
  schedule_iterations: "Iterations to plan for",
  seed: "Random seed",
  max_gaussians: "Most Gaussians",
  sh_degree: "Colour by direction (degree)",
  max_image_side: "Longest side of a photo",
  frames: "Frames of the video",
  holdout_every: "Photos held out for measuring",
  refine_cameras: "Refine the cameras",
  min_registered: "Least share of photos placed",
  checkpoint_every: "Iterations between checkpoints",
  preview_every: "Iterations between previews",
};

// Of an option that a newer server has, its name in the interface.
export function optionName(name: string): string {
  const plain = name.charAt(0).toUpperCase() + name.slice(1).replaceAll("_", " ");
  return kOptionNames[name] ?? plain;
}

// "shrink larger photos to this, px; 0: never".
export const optionHint = (help: string, zeroMeans = ""): string =>
    zeroMeans ? `${help}; 0: ${zeroMeans}` : help;

export const idOf = (name: string): string => name.slice("jobs/".length);
export const titleOf = (job: Job): string => job.displayName || idOf(job.name);
export const isOver = (job: Job): boolean =>
    /SUCCEEDED|FAILED|CANCELLED/.test(job.state);
export const isActive = (job: Job): boolean => /QUEUED|RUNNING/.test(job.state);

export function shareDone(progress?: Progress): number {
  if (!progress?.iterations) return 0;
  return (progress.iteration ?? 0) / progress.iterations;
}

// The label with how many photos a page has to send to its job.
export const kPhotosChosen = "photos_chosen";

// "120 of 200 photos have come", of a job whose upload goes on or was cut; or nothing.
export function photosAwaited({state, photos = 0, labels}: Job): string {
  const chosen = Number(labels?.[kPhotosChosen]);
  return state === "JOB_STATE_UPLOADING" && photos < chosen ? `${photos} of ${chosen} photos have come` : "";
}

// One line on how a job stands.
export function standing(job: Job): string {
  const progress = job.progress;
  if (job.state === "JOB_STATE_QUEUED") {
    return job.waitsFor ? `waits for ${job.waitsFor}` : `number ${job.queuePosition ?? "?"} in the queue`;
  }
  if (job.state === "JOB_STATE_RUNNING" && progress) {
    const eta = timeText(secondsOf(progress.eta));
    const done = progress.iterations
      ? `${progress.iteration ?? 0} of ${progress.iterations} iterations` : progress.message;
    return [job.cancelRequested ? "stopping" : words(progress.stage), done, eta && `${eta} left`]
        .filter(Boolean).join(", ");
  }
  if (job.state === "JOB_STATE_FAILED") return job.error?.message ?? "";
  if (job.state === "JOB_STATE_SUCCEEDED" && job.report) {
    return `${job.report.registered ?? 0} of ${job.report.photos ?? 0} photos placed, ` +
        `${Number(job.report.gaussians ?? 0).toLocaleString("en")} Gaussians`;
  }
  return photosAwaited(job) || (job.photos ? `${job.photos} photos` : "");  // of a video there are none yet
}
