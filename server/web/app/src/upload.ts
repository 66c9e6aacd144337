// Photos, or a video, from this machine to a job.

import {ApiError, call, nextToken, post, refusal, saidOfRetried, Silence, type JobFile} from "./api.js";
import {notice} from "./dom.js";
import {digestOf} from "./sha256.js";

export interface Chosen {
  file: File;
  name: string;
  role: string;
  skipped?: string[];  // what the server did not use of this archive, with why
}

const kPhoto = /\.(jpe?g|jpe|jfif|png|tiff?|webp|heic|heif|hif|avif|jxl|dng|nef|nrw|cr2|cr3|arw|raf|orf|rw2|pef|srw)$/i;
const kVideo = /\.(mp4|mov|m4v|3gp|mkv|webm|avi|mts|m2ts|ts)$/i;
const kArchive = /\.(zip|tar|tar\.gz|tgz)$/i;
const kAttempts = 9;

// What a file is for, by its path; null: no job has a use for it. Hidden files have none, nor have those
// in hidden folders inside of the chosen one: they are other programs', as thumbnails.
export function roleOf(path: string): string | null {
  const folders = path.replace(/^\//, "").toLowerCase().split("/");
  const name = folders.pop()!;
  if ([...folders.slice(1), name].some((part) => part.startsWith("."))) return null;
  if (folders.some((f) => f === "depth" || f === "depths") && /\.(png|pfm|npy)$/.test(name)) {
    return "FILE_ROLE_DEPTH";
  }
  if (folders.some((f) => f === "mask" || f === "masks") && name.endsWith(".png")) {
    return "FILE_ROLE_MASK";
  }
  if (kPhoto.test(name)) return "FILE_ROLE_PHOTO";
  if (kVideo.test(name)) return "FILE_ROLE_VIDEO";
  if (kArchive.test(name)) return "FILE_ROLE_ARCHIVE";
  if (/^(transforms|sfm_data).*\.json$|^cameras.*\.(sfm|xml)$/.test(name)) return "FILE_ROLE_CAMERAS";
  if (/^(cameras|images|points3d)\.(bin|txt)$/.test(name)) return "FILE_ROLE_COLMAP";
  return null;
}

export function choose(files: {file: File; path: string}[]): Chosen[] {
  return files.flatMap(({file, path}) => {
    const role = roleOf(path);
    // COLMAP's recipe for known poses makes it with nothing in it.
    const noPoints = file.size === 0 && /^points3d\.txt$/i.test(file.name);
    return role && !noPoints ? [{file, name: file.name, role}] : [];
  });
}

// The files of what was dropped, folders' included; `unreadable`: paths of files and folders.
export async function dropped(items: DataTransferItemList): Promise<{
  found: {file: File; path: string}[]; unreadable: string[];
}> {
  const found: {file: File; path: string}[] = [], unreadable: string[] = [];
  const visit = (entry: FileSystemEntry): Promise<void> =>
      read(entry).catch(() => { unreadable.push(entry.fullPath); });
  const read = async (entry: FileSystemEntry): Promise<void> => {
    if (entry.isFile) {
      const file = await new Promise<File>((ok, no) => (entry as FileSystemFileEntry).file(ok, no));
      found.push({file, path: entry.fullPath});
      return;
    }
    const reader = (entry as FileSystemDirectoryEntry).createReader();
    while (true) {  // a folder is read some hundred entries at a time
      const some = await new Promise<FileSystemEntry[]>((ok, no) => reader.readEntries(ok, no));
      if (some.length === 0) return;
      for (const inner of some) await visit(inner);
    }
  };
  // All at once: the list is empty after this turn. What is no file of a disk has no entry.
  const all = [...items].map((item) => ({entry: item.webkitGetAsEntry(), file: item.getAsFile()}));
  for (const {entry, file} of all) {
    if (entry) await visit(entry);
    else if (file) found.push({file, path: file.name});
  }
  return {found, unreadable};
}

// What was not used of archives, if photos are among it.
export function leftOutOf(files: Chosen[]): string[] {
  const names = files.flatMap((chosen) => chosen.skipped ?? []);
  const photo = new RegExp(kPhoto.source.replace("$", " \\("), "i");  // "night/a.jpg (the file is empty)"
  return names.some((name) => photo.test(name)) ? names : [];
}

const stemOf = (name: string): string => name.replace(/\.[^.]*$/, "");

// Whether it is a photo's mask by their names, as the service has it (engine/core/mask.cc).
function isMaskOf(mask: string, photo: string): boolean {
  const whole = stemOf(mask), names = [photo, stemOf(photo)];
  return names.includes(whole) || names.includes(whole.replace(/[_.]mask$/i, ""));
}

// Of the files that a job has, the masks of photos that it lacks, and of no other: it would not start with them.
export function masksAlone(files: JobFile[], lacking: string[]): string[] {
  const names = (role: string): string[] => files.filter((f) => f.role === role).map((f) => f.fileName);
  const photos = names("FILE_ROLE_PHOTO");
  const isOfOne = (mask: string, of: string[]): boolean => of.some((photo) => isMaskOf(mask, photo));
  return names("FILE_ROLE_MASK").filter((mask) => isOfOne(mask, lacking) && !isOfOne(mask, photos));
}

export async function removeFile(job: string, name: string, role: string): Promise<void> {
  const query = new URLSearchParams({role, allowMissing: "true"});
  await call("DELETE", `/v1/${job}/files/${encodeURIComponent(name)}?${query}`);
}

// Sends the bytes from `offset` on; `sent` is told how many are on their way.
function put(job: string, chosen: Chosen, digest: string, offset: number,
             sent: (bytes: number) => void, signal: AbortSignal): Promise<void> {
  return new Promise((ok, no) => {
    signal.throwIfAborted();  // else its listener would never be called
    const size = chosen.file.size;
    const request = new XMLHttpRequest();  // fetch() does not tell how far it is
    request.open("PUT", `/v1/${job}/files/${encodeURIComponent(chosen.name)}?role=${chosen.role}`);
    request.setRequestHeader("Repr-Digest", `sha-256=:${digest}:`);
    if (offset > 0 && offset === size) {  // the server has all of it, perhaps of another job
      request.setRequestHeader("Content-Range", `bytes */${size}`);
    } else if (offset > 0 && offset < size) {
      request.setRequestHeader("Content-Range", `bytes ${offset}-${size - 1}/${size}`);
    } else {
      offset = 0;
    }
    const silence = new Silence(signal, offset === size);
    request.upload.onprogress = (event) => {
      silence.heard();
      sent(offset + event.loaded);
    };
    request.upload.onload = () => {  // now the server reads what came, an archive for long
      silence.asks = true;
      silence.heard();
    };
    request.onload = () => {
      if (request.status >= 300) return no(refusal(request.status, request.responseText));
      const stored = JSON.parse(request.responseText) as {skipped?: string[]; skippedTotal?: number};
      chosen.skipped = stored.skipped ?? [];
      const unnamed = (stored.skippedTotal ?? 0) - chosen.skipped.length;
      if (unnamed > 0) chosen.skipped.push(`and ${unnamed} more`);
      ok();
    };
    request.onerror = () => no(new ApiError(0, "the connection broke"));
    silence.signal.addEventListener("abort", () => {
      no(silence.signal.reason);
      request.abort();
    });
    request.onloadend = () => silence.end();
    request.send(chosen.file.slice(offset));
  });
}

// Whether the same call, or the same file, may arrive later.
const mayRetry = (error: unknown): boolean =>
    error instanceof ApiError && (error.mayComeAgain || error.reason === "OFFSET_INVALID");

// Waits for the next of so many attempts, or for the token that is asked for. Throws `error` if neither
// comes.
async function pause(error: unknown, attempt: number, attempts: number, signal: AbortSignal): Promise<void> {
  if (signal.aborted) throw error;
  if ((error as ApiError).code === 401) {
    await nextToken();
  } else {
    if (!mayRetry(error) || attempt >= attempts) throw error;
    notice(saidOfRetried(error));
    await new Promise((ok) => setTimeout(ok, Math.min(1000 * 2 ** (attempt - 1), 15000)));
  }
  if (signal.aborted) throw error;
  notice("");
}

// Repeats a call, which must be safe to repeat, until it is answered or has been made so often.
export async function persistently<T>(what: () => Promise<T>, signal: AbortSignal,
                                      attempts = kAttempts): Promise<T> {
  for (let attempt = 1; ; ++attempt) {
    try {
      signal.throwIfAborted();
      return await what();
    } catch (error) {
      await pause(error, attempt, attempts, signal);
    }
  }
}

// Sends one file, and what is left of it after a broken connection. Gives up after so many attempts in a
// row that brought no bytes.
async function sendFile(job: string, chosen: Chosen, attempts: number, step: (bytes: number) => void,
                        signal: AbortSignal): Promise<void> {
  const digest = await digestOf(chosen.file);
  for (let attempt = 1, arrived = 0; ; ++attempt) {
    try {
      signal.throwIfAborted();
      const query = {fileName: chosen.name, role: chosen.role, sizeBytes: chosen.file.size,
                     sha256: digest};
      const answer = await post<{files: {stored?: boolean; offset?: string}[]}>(
          `/v1/${job}/files:query`, {files: [query]});
      const offset = Number(answer.files[0]?.offset ?? 0);
      if (offset > arrived) attempt = 1;
      arrived = offset;
      if (!answer.files[0]?.stored) {
        await put(job, chosen, digest, offset, step, signal);
      }
      step(chosen.file.size);
      return;
    } catch (error) {
      await pause(error, attempt, attempts, signal);
    }
  }
}

// Files that a job does not have, with why.
export interface Missing {
  refused: Map<Chosen, string>;  // by the server, which would refuse them again
  lost: Map<Chosen, string>;     // they did not arrive
  unsent: Chosen[];              // since others are refused
}

function whyOf(chosen: Chosen, error: unknown): string {
  const why = error instanceof Error ? error.message : String(error);
  return why.includes(chosen.name) ? why : `${chosen.name}: ${why}`;
}

// Sends all, three at a time: first what a job cannot start with if it is wrong, and no others if one of
// these is refused. Resolves to those that the job does not have.
export async function send(job: string, files: Chosen[], step: (bytes: number) => void,
                           signal: AbortSignal): Promise<Missing> {
  const missing: Missing = {refused: new Map(), lost: new Map(), unsent: []};
  const sent = new Map<Chosen, number>();
  let attempts = kAttempts;
  const work = async (queue: Chosen[]): Promise<void> => {
    for (let chosen = queue.shift(); chosen; chosen = queue.shift()) {
      const own = chosen;
      const tell = (bytes: number): void => {
        sent.set(own, bytes);
        step([...sent.values()].reduce((a, b) => a + b, 0));
      };
      try {
        await sendFile(job, own, attempts, tell, signal);
        attempts = kAttempts;
      } catch (error) {
        if (signal.aborted) throw error;
        const refused = error instanceof ApiError && !mayRetry(error);
        (refused ? missing.refused : missing.lost).set(own, whyOf(own, error));
        if (mayRetry(error)) attempts = 1;  // the next files are not waited for as long, one by one
        tell(own.file.size);
      }
    }
  };
  const sendAll = (queue: Chosen[]): Promise<void[]> => Promise.all([work(queue), work(queue), work(queue)]);
  const goesFirst = ({role}: Chosen): boolean => /CAMERAS|COLMAP|DEPTH/.test(role);
  await sendAll(files.filter(goesFirst));
  const rest = files.filter((chosen) => !goesFirst(chosen));
  if (missing.refused.size > 0) missing.unsent = rest;
  else await sendAll(rest);
  return missing;
}
