// A new job: photos or a video, options, upload, start.

import {ApiError, call, get, newId, post, type Job, type Options, type ServerInfo} from "./api.js";
import {el, labelled, notice, select} from "./dom.js";
import {filesOf} from "./findings.js";
import {asTitle, bytesText, idOf, kPhotosChosen, optionHint, optionName} from "./format.js";
import {choose, dropped, leftOutOf, masksAlone, persistently, removeFile, send, type Chosen, type Missing} from "./upload.js";
import type {View} from "./view.js";

// Beside the method, what most users would set. The rest is folded.
const kMain = ["iterations", "max_image_side"];
const kOfVideos = ["frames"];

const kWait = "wait until the upload has ended";
const kLeave = "The upload has not ended. Leave the page, and end it?";

const camel = (name: string): string => name.replace(/_(\w)/g, (_, c: string) => c.toUpperCase());

// The fields of JobOptions, made of what the server says of itself.
function optionFields(info: ServerInfo): {main: HTMLElement[]; rest: HTMLElement[];
                                          ofVideos: HTMLElement[]; read: () => Options} {
  const method = select(info.methods.map((m) => [m.method, m.name]), info.methods[0]!.method);
  const controls = new Map<string, HTMLInputElement | HTMLSelectElement>();
  const main = [labelled("Method", method)], rest: HTMLElement[] = [], ofVideos: HTMLElement[] = [];
  for (const option of info.options) {
    if (option.name === "method") continue;
    const key = camel(option.name);
    let control: HTMLInputElement | HTMLSelectElement;
    const usual = info.methods[0]!.defaults[key];
    if (typeof usual === "boolean") {
      control = el("input", {type: "checkbox", checked: usual});
    } else if (option.choices?.length) {
      const prefix = option.name.toUpperCase() + "_";
      control = select([["", "default"], ...option.choices.map(
          (word): [string, string] => [prefix + word.toUpperCase().replaceAll("-", "_"), word])], "");
    } else {
      control = el("input", {type: "number", step: "any", min: option.zeroMeans ? 0 : option.minimum,
                             max: option.maximum});
    }
    controls.set(key, control);
    const place = kMain.includes(option.name) ? main : kOfVideos.includes(option.name) ? ofVideos : rest;
    place.push(labelled(optionName(option.name), control, optionHint(option.help, option.zeroMeans)));
  }
  const showDefaults = (): void => {
    const defaults = info.methods.find((m) => m.method === method.value)?.defaults ?? {};
    for (const [key, control] of controls) {
      if (control instanceof HTMLInputElement) control.placeholder = String(defaults[key] ?? 0);
    }
  };
  method.addEventListener("change", showDefaults);
  showDefaults();
  return {
    main, rest, ofVideos,
    read: () => {
      const values: Options = {method: method.value};
      for (const [key, control] of controls) {
        if (control.closest("[hidden]")) continue;
        if (control instanceof HTMLInputElement && control.type === "checkbox") values[key] = control.checked;
        else if (control.value !== "") values[key] = control.value;
      }
      return values;
    },
  };
}

// Whether all values can be sent. Else the first that cannot is shown, with why.
function valid(form: HTMLFormElement): boolean {
  const controls = [...form.querySelectorAll<HTMLInputElement | HTMLSelectElement>("input, select")];
  const wrong = controls.find((control) => !control.validity.valid && !control.closest("[hidden]"));
  const folded = wrong?.closest("details");
  if (folded) folded.open = true;  // a browser says nothing of a control that it cannot show
  return wrong?.reportValidity() ?? true;
}

// Where files are dropped or picked, unless closed(), which tells the user. `take` also gets the paths of
// what could not be read.
function dropZone(closed: () => boolean,
                  take: (files: {file: File; path: string}[], unreadable: string[]) => void): HTMLElement {
  const click = (event: Event): void => { if (closed()) event.preventDefault(); };
  const picked = (input: HTMLInputElement): void => {
    take([...input.files ?? []].map((file) => ({file, path: file.webkitRelativePath || file.name})), []);
    input.value = "";
  };
  const files: HTMLInputElement = el("input", {type: "file", multiple: true, id: "files", click,
                                               change: () => picked(files)});
  const folder: HTMLInputElement = el("input", {type: "file", webkitdirectory: true, id: "folder", click,
                                                change: () => picked(folder)});
  const zone = el("div", {class: "drop", role: "group", "aria-label": "Photos or a video"},
                  el("p", {}, "Drop photos, a folder, a ZIP file or a video here"),
                  el("div", {class: "row"},
                     el("label", {class: "button"}, "Choose files", files),
                     el("label", {class: "button"}, "Choose a folder", folder)));
  zone.addEventListener("dragover", (event) => { event.preventDefault(); zone.classList.add("over"); });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    if (event.dataTransfer && !closed()) {
      void dropped(event.dataTransfer.items).then(({found, unreadable}) => take(found, unreadable));
    }
  });
  return zone;
}

// The same for a file that is chosen again.
const idOfFile = ({file, name, role}: Chosen): string => [role, name, file.size, file.lastModified].join("/");

const bytesOf = (chosen: Chosen[]): number => chosen.reduce((sum, c) => sum + c.file.size, 0);

// "a.jpg and 2 more".
const oneAndMore = (names: string[]): string =>
    names.length > 1 ? `${names[0]} and ${names.length - 1} more` : names[0]!;

// A job keeps one file of a name and role: of photos in two folders, one would replace the other.
function sameNames(chosen: Chosen[]): string {
  const seen = new Set<string>(), twice = new Set<string>();
  for (const {role, name} of chosen) (seen.has(role + name) ? twice : seen).add(role + name);
  const names = [...new Set(chosen.filter((c) => twice.has(c.role + c.name)).map((c) => c.name))];
  if (names.length === 0) return "";
  return `Different files have the same name: ${oneAndMore(names)}. Rename them, or remove the files and ` +
      "choose one folder.";
}

// What cannot be, whatever is in the files: the server would not take them, or say so after the upload.
function troubleOf(chosen: Chosen[]): string {
  const videos = chosen.filter((c) => c.role === "FILE_ROLE_VIDEO").length;
  const photos = chosen.some((c) => /PHOTO|ARCHIVE/.test(c.role));
  return videos > 1 || (videos === 1 && photos)
    ? "A job takes one video, or photos: remove the files and choose again." : sameNames(chosen);
}

// How many photos a job of these will have, unless that depends on what is in them.
const labelsOf = (chosen: Chosen[]): Record<string, string> => chosen.some((c) => /ARCHIVE|VIDEO/.test(c.role))
  ? {} : {[kPhotosChosen]: String(chosen.filter((c) => c.role === "FILE_ROLE_PHOTO").length)};

// "3 photos, 1 mask".
function countsOf(chosen: Chosen[]): string {
  const kinds: [roles: RegExp, one: string, more: string][] = [
    [/PHOTO/, "photo", "photos"], [/VIDEO/, "video", "videos"], [/ARCHIVE/, "archive", "archives"],
    [/MASK/, "mask", "masks"], [/DEPTH/, "depth map", "depth maps"],
    [/CAMERAS|COLMAP/, "file of cameras", "files of cameras"]];
  return kinds.flatMap(([roles, one, more]) => {
    const count = chosen.filter((c) => roles.test(c.role)).length;
    return count ? [`${count} ${count === 1 ? one : more}`] : [];
  }).join(", ");
}

// What the files are called together: their folder's name, or that of the only file, or nothing.
function nameOf(files: {file: File; path: string}[]): string {
  const folder = files.map(({path}) => path.replace(/^\//, "").split("/")).find((parts) => parts.length > 1)?.[0];
  return asTitle(folder ?? (files.length === 1 ? files[0]!.file.name : ""));
}

// The files of a new job: chosen, dropped, removed. `change` is called after each. Nothing changes while
// `busy`, and the user is told.
function fileChooser(busy: () => boolean, change: () => void): {
  elements: HTMLElement[]; chosen: () => Chosen[]; name: () => string; trouble: () => string;
} {
  let chosen: Chosen[] = [], name = "";
  const summary = el("p", {class: "chosen", "aria-live": "polite"});
  const trouble = el("p", {class: "error", "aria-live": "polite"});
  const closed = (): boolean => {
    if (busy()) notice(kWait);
    return busy();
  };
  const forget = (): void => {
    if (closed()) return;
    chosen = [];
    name = "";
    describe(0, []);
  };
  const clear = el("button", {type: "button", click: forget}, "Remove the files");
  const describe = (left: number, unreadable: string[]): void => {
    const count = chosen.length === 0 ? "No files yet" : `${countsOf(chosen)}, ${bytesText(bytesOf(chosen))}`;
    summary.textContent = [count, left && `${left} other files are left out`,
                           unreadable.length && `could not be read: ${oneAndMore(unreadable)}`]
        .filter(Boolean).join("; ");
    trouble.textContent = troubleOf(chosen);
    clear.hidden = chosen.length === 0;
    change();
  };
  const zone = dropZone(closed, (files, unreadable) => {
    if (closed()) return;  // dropped before the upload, and read in the middle of it
    const more = choose(files);
    name ||= nameOf(files);
    // A file that is chosen again counts once.
    chosen = [...new Map([...chosen, ...more].map((c) => [idOfFile(c), c])).values()];
    describe(files.length - more.length, unreadable);
  });
  summary.textContent = "No files yet";
  clear.hidden = true;
  return {elements: [zone, el("div", {class: "row"}, summary, clear), trouble], chosen: () => chosen,
          name: () => name, trouble: () => troubleOf(chosen)};
}

// Which of `all` files, or of those in archives, the job does not have, which masks go with them, and what can be
// done now.
function whatIsMissing({refused, lost, unsent}: Missing, leftOut: string[], masks: string[], all: number, actions: {
  again: () => void; start: () => void; look: () => void;
}): HTMLElement[] {
  const list = (files: string[], what: string): HTMLElement[] => files.length === 0 ? [] : [
    el("p", {class: "error"}, what), el("ul", {}, ...files.map((why) => el("li", {}, why)))];
  const count = (files: Map<Chosen, string>, what: string): HTMLElement[] =>
      list([...files.values()], `${files.size} of ${all} files ${what}:`);
  const button = (text: string, click: () => void): HTMLElement => el("button", {type: "button", click}, text);
  const buttons = unsent.length > 0 ? [button("Send the others without them", actions.again)] : [
    button("Start without them", actions.start), button("Look at the others first", actions.look)];
  if (lost.size > 0 && unsent.length === 0) buttons.unshift(button("Send them again", actions.again));
  buttons[0]!.className = "primary";
  return [...count(refused, "were refused"), ...count(lost, "did not arrive"),
          ...list(leftOut, "Not used, of what is in the archive:"),
          ...list(masks, "Masks of these photos, which are left out, too:"), el("div", {class: "row"}, ...buttons)];
}

// A job of this form as it was: the same form goes on with the same job.
interface Begun {
  form: string;
  createId: string;
  startId: string;
  job?: string;
}

// Removes a job of a form that has changed since, unless it was started.
async function forget({job}: Begun): Promise<void> {
  if (job && (await get<Job>(`/v1/${job}`)).state === "JOB_STATE_UPLOADING") await call("DELETE", `/v1/${job}`);
}

export function submitView(): View {
  let begun: Begun | undefined;
  const replaced: Begun[] = [];
  let options: ReturnType<typeof optionFields> | undefined;
  let running: AbortController | undefined;
  const title: HTMLInputElement = el("input", {type: "text", autocomplete: "off",
                                               change: () => { title.value = asTitle(title.value); }});
  const main = el("div", {class: "fields"}), rest = el("div", {class: "fields"});
  const ofVideos = el("div", {class: "fields", hidden: true});
  const fields = el("fieldset", {}, ofVideos, el("div", {class: "fields"}, labelled("Title", title)), main,
                    el("details", {}, el("summary", {}, "All options"), rest));
  const bar = el("progress", {max: 1, value: 0, hidden: true, "aria-label": "Upload"});
  const result = el("div", {class: "result", "aria-live": "polite"});
  const go = el("button", {type: "submit", class: "primary", disabled: true}, "Upload and start");
  const look = el("button", {type: "button", disabled: true, click: () => submit(false)}, "Upload and look first");
  const files = fileChooser(() => running !== undefined, () => show());
  const show = (): void => {
    const chosen = files.chosen();
    fields.disabled = running !== undefined;
    go.disabled = look.disabled = chosen.length === 0 || files.trouble() !== "" || !options || fields.disabled;
    title.placeholder = files.name();
    ofVideos.hidden = !chosen.some((c) => c.role === "FILE_ROLE_VIDEO");
    bar.hidden = running === undefined;
  };
  const busy = async (work: (signal: AbortSignal) => Promise<void>): Promise<void> => {
    const {signal} = running = new AbortController();
    const ask = (event: Event): void => event.preventDefault();
    window.addEventListener("beforeunload", ask, {signal});
    bar.value = 0;
    result.replaceChildren();
    show();
    try {
      await work(signal);
    } catch (error) {
      if (!signal.aborted) result.replaceChildren(el("p", {class: "error"}, (error as ApiError).message));
    } finally {
      window.removeEventListener("beforeunload", ask);
      if (!signal.aborted) notice("");
      running = undefined;
      show();
    }
  };
  const open = async (job: Job, start: boolean, signal: AbortSignal): Promise<void> => {
    if (start) await persistently(() => post(`/v1/${job.name}:start`, {requestId: begun!.startId}), signal);
    if (!signal.aborted) location.hash = `#/jobs/${idOf(job.name)}`;
  };
  // Sends what the job lacks of `all` and opens it. If some is missing then, the user decides.
  const sendRest = async (job: Job, all: Chosen[], rest: Chosen[], refused: Missing["refused"], start: boolean,
                          signal: AbortSignal): Promise<void> => {
    const bytes = Math.max(1, bytesOf(rest));
    const missing = await send(job.name, rest, (sent) => { bar.value = sent / bytes; }, signal);
    missing.refused = new Map([...refused, ...missing.refused]);
    const leftOut = leftOutOf(all);
    if (missing.refused.size + missing.lost.size + leftOut.length === 0) return open(job, start, signal);
    const photos = [...missing.refused.keys(), ...missing.lost.keys()].filter((c) => c.role === "FILE_ROLE_PHOTO");
    const masks = missing.unsent.length > 0 ? []
      : masksAlone(await persistently(() => filesOf(job.name), signal), photos.map((c) => c.name));
    const openAnyway = (start: boolean): void => void busy(async (signal) => {
      for (const mask of masks) await persistently(() => removeFile(job.name, mask, "FILE_ROLE_MASK"), signal);
      await open(job, start, signal);
    });
    result.replaceChildren(...whatIsMissing(missing, leftOut, masks, all.length, {
      again: () => void busy((signal) => sendRest(job, all, [...missing.lost.keys(), ...missing.unsent], missing.refused,
                                                  start, signal)),
      start: () => openAnyway(true), look: () => openAnyway(false),
    }));
  };
  // `start` false: the job waits for its owner, who sees what the server found in the files.
  const submit = (start: boolean): void => {
    if (!options || !valid(element)) return;
    const chosen = files.chosen();
    const wanted = {displayName: asTitle(title.value) || files.name(), options: options.read(),
                    labels: labelsOf(chosen)};
    const form = JSON.stringify([wanted, chosen.map(idOfFile)]);
    if (begun && begun.form !== form) replaced.push(begun);
    const own = begun = begun?.form === form ? begun : {form, createId: newId(), startId: newId()};
    void busy(async (signal) => {
      const job = await persistently(() => post<Job>("/v1/jobs", {...wanted, requestId: own.createId}), signal);
      own.job = job.name;
      if (job.state !== "JOB_STATE_UPLOADING") return open(job, false, signal);  // started before
      await sendRest(job, chosen, chosen, new Map(), start, signal);
      // All that they had, the server has for this one, too.
      for (const other of replaced.splice(0)) forget(other).catch(() => {});
    });
  };

  const left = new AbortController();
  // Files that are dropped beside the place for them: the browser would open one in place of the page.
  const beside = (event: DragEvent): void => {
    if (event.defaultPrevented || !event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = "none";
  };
  for (const kind of ["dragover", "drop"] as const) window.addEventListener(kind, beside, {signal: left.signal});
  persistently(() => get<ServerInfo>("/v1/serverInfo"), left.signal, Infinity).then((info) => {
    options = optionFields(info);
    main.replaceChildren(...options.main);
    rest.replaceChildren(...options.rest);
    ofVideos.replaceChildren(...options.ofVideos);
    show();
  }, (error: ApiError) => { if (element.isConnected) notice(error.message); });
  // The browser's own check would end without a word at a control that is folded away.
  const element = el("form", {class: "submit", novalidate: true,
                              submit: (event) => { event.preventDefault(); submit(true); }},
                     el("h1", {}, "New job"), ...files.elements, fields, bar,
                     el("div", {class: "row"}, go, look), result);
  return {
    title: "New job", element, keeps: () => files.chosen().length > 0,
    asks: () => running ? kLeave : "",
    leave: () => {
      left.abort();
      running?.abort();
    },
  };
}
