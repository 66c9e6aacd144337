// Photos, or a video, from this machine to a job.

import {ApiError, errorOf, post} from "./api.js";
import {digestOf} from "./sha256.js";

export interface Chosen {
  file: File;
  name: string;
  role: string;
}

const kPhoto = /\.(jpe?g|jpe|jfif|png|tiff?|webp|heic|heif|hif|avif|jxl|dng|nef|nrw|cr2|cr3|arw|raf|orf|rw2|pef|srw)$/i;
const kVideo = /\.(mp4|mov|m4v|3gp|mkv|webm|avi|mts|m2ts|ts)$/i;
const kArchive = /\.(zip|tar|tar\.gz|tgz)$/i;

// What a file is for, by its path; null: no job has a use for it.
export function roleOf(path: string): string | null {
  const folders = path.toLowerCase().split("/");
  const name = folders.pop()!;
  if (name.startsWith(".")) return null;
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
    return role ? [{file, name: file.name, role}] : [];
  });
}

// The files of what was dropped, folders' included.
export async function dropped(items: DataTransferItemList): Promise<{file: File; path: string}[]> {
  const found: {file: File; path: string}[] = [];
  const visit = async (entry: FileSystemEntry): Promise<void> => {
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
  return found;
}

// Sends the bytes from `offset` on; `sent` is told how many are on their way.
function put(job: string, chosen: Chosen, digest: string, offset: number,
             sent: (bytes: number) => void, signal: AbortSignal): Promise<void> {
  return new Promise((ok, no) => {
    const size = chosen.file.size;
    const request = new XMLHttpRequest();  // fetch() does not tell how far it is
    request.open("PUT", `/v1/${job}/files/${encodeURIComponent(chosen.name)}?role=${chosen.role}`);
    request.setRequestHeader("Repr-Digest", `sha-256=:${digest}:`);
    if (offset > 0 && offset < size) {
      request.setRequestHeader("Content-Range", `bytes ${offset}-${size - 1}/${size}`);
    } else {
      offset = 0;
    }
    request.upload.onprogress = (event) => sent(offset + event.loaded);
    request.onload = () => request.status < 300 ? ok() : no(errorOf(request.status, request.responseText));
    request.onerror = () => no(new ApiError(0, "the connection broke"));
    request.onabort = () => no(new ApiError(0, "stopped"));
    signal.addEventListener("abort", () => request.abort());
    request.send(chosen.file.slice(offset));
  });
}

// Whether the same request may succeed later.
const mayRetry = (error: unknown): boolean =>
    error instanceof ApiError && (error.code === 0 || error.code >= 500 || error.transient);

// Sends one file, and what is left of it after a broken connection. Gives up after nine attempts in a
// row that brought no bytes.
async function sendFile(job: string, chosen: Chosen, step: (bytes: number) => void,
                        signal: AbortSignal): Promise<void> {
  const digest = await digestOf(chosen.file, () => {});
  for (let attempt = 0, arrived = 0; ; ++attempt) {
    try {
      const query = {name: chosen.name, role: chosen.role, sizeBytes: chosen.file.size,
                     sha256: digest};
      const answer = await post<{files: {stored?: boolean; offset?: string}[]}>(
          `/v1/${job}/files:query`, {files: [query]});
      const offset = Number(answer.files[0]?.offset ?? 0);
      if (offset > arrived) attempt = 0;
      arrived = offset;
      if (!answer.files[0]?.stored) {
        await put(job, chosen, digest, offset, step, signal);
      }
      step(chosen.file.size);
      return;
    } catch (error) {
      if (signal.aborted || !mayRetry(error) || attempt === 8) throw error;
      await new Promise((ok) => setTimeout(ok, Math.min(1000 * 2 ** attempt, 15000)));
    }
  }
}

// Sends all, three at a time. Resolves to the files that were refused, with why.
export async function send(job: string, files: Chosen[], step: (bytes: number) => void,
                           signal: AbortSignal): Promise<Map<string, string>> {
  const refused = new Map<string, string>();
  const sent = new Map<Chosen, number>();
  const queue = [...files];
  const work = async (): Promise<void> => {
    for (let chosen = queue.shift(); chosen; chosen = queue.shift()) {
      const own = chosen;
      const tell = (bytes: number): void => {
        sent.set(own, bytes);
        step([...sent.values()].reduce((a, b) => a + b, 0));
      };
      try {
        await sendFile(job, own, tell, signal);
      } catch (error) {
        if (signal.aborted) throw error;
        refused.set(own.name, error instanceof Error ? error.message : String(error));
        tell(own.file.size);
      }
    }
  };
  await Promise.all([work(), work(), work()]);
  return refused;
}
