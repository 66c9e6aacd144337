// A new job: photos, options, upload, start.

import {ApiError, get, post, type Job, type Options, type ServerInfo} from "./api.js";
import {el, labelled, notice, select} from "./dom.js";
import {bytesText, idOf} from "./format.js";
import {choose, dropped, send, type Chosen} from "./upload.js";
import type {View} from "./view.js";

// Beside the method, what most users would set. The rest is folded.
const kMain = ["iterations", "max_image_side"];

const camel = (name: string): string => name.replace(/_(\w)/g, (_, c: string) => c.toUpperCase());
const text = (name: string): string => name.charAt(0).toUpperCase() + name.slice(1).replaceAll("_", " ");

// The fields of JobOptions, made of what the server says of itself.
function optionFields(info: ServerInfo): {main: HTMLElement[]; rest: HTMLElement[];
                                          read: () => Options} {
  const method = select(info.methods.map((m) => [m.method, m.name]), info.methods[0]!.method);
  const controls = new Map<string, HTMLInputElement | HTMLSelectElement>();
  const main = [labelled("Method", method)], rest: HTMLElement[] = [];
  for (const option of info.options) {
    if (option.name === "method") continue;
    const key = camel(option.name);
    let control: HTMLInputElement | HTMLSelectElement;
    if (option.choices?.length) {
      const prefix = option.name.toUpperCase() + "_";
      control = select([["", "default"], ...option.choices.map(
          (word): [string, string] => [prefix + word.toUpperCase().replaceAll("-", "_"), word])], "");
    } else {
      control = el("input", {type: "number", step: "any", min: option.zeroMeans ? 0 : option.minimum,
                             max: option.maximum});
    }
    controls.set(key, control);
    (kMain.includes(option.name) ? main : rest).push(labelled(text(option.name), control, option.help));
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
    main, rest,
    read: () => ({
      method: method.value,
      ...Object.fromEntries([...controls].filter(([, c]) => c.value !== "").map(([k, c]) => [k, c.value])),
    }),
  };
}

// Where files are dropped or picked.
function dropZone(take: (files: {file: File; path: string}[]) => void): HTMLElement {
  const picked = (input: HTMLInputElement): void => {
    take([...input.files ?? []].map((file) => ({file, path: file.webkitRelativePath || file.name})));
    input.value = "";
  };
  const files: HTMLInputElement = el("input", {type: "file", multiple: true, id: "files",
                                               change: () => picked(files)});
  const folder: HTMLInputElement = el("input", {type: "file", webkitdirectory: true, id: "folder",
                                                change: () => picked(folder)});
  const zone = el("div", {class: "drop", role: "group", "aria-label": "Photos"},
                  el("p", {}, "Drop photos, a folder or a ZIP file here"),
                  el("div", {class: "row"},
                     el("label", {class: "button"}, "Choose files", files),
                     el("label", {class: "button"}, "Choose a folder", folder)));
  zone.addEventListener("dragover", (event) => { event.preventDefault(); zone.classList.add("over"); });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    zone.classList.remove("over");
    if (event.dataTransfer) void dropped(event.dataTransfer.items).then(take);
  });
  return zone;
}

export function submitView(): View {
  let chosen: Chosen[] = [];
  let options: ReturnType<typeof optionFields> | undefined;
  let running: AbortController | undefined;
  const summary = el("p", {class: "chosen", "aria-live": "polite"}, "No files yet.");
  const title = el("input", {type: "text", maxlength: 200, autocomplete: "off"});
  const main = el("div", {class: "fields"}), rest = el("div", {class: "fields"});
  const bar = el("progress", {max: 1, value: 0, hidden: true, "aria-label": "Upload"});
  const result = el("div", {class: "result", "aria-live": "polite"});
  const go = el("button", {type: "submit", class: "primary", disabled: true}, "Upload and start");

  const describe = (left = 0): void => {
    const bytes = chosen.reduce((sum, c) => sum + c.file.size, 0);
    const count = (role: string): number => chosen.filter((c) => c.role === `FILE_ROLE_${role}`).length;
    const parts = [[count("PHOTO"), "photos"], [count("ARCHIVE"), "archives"], [count("MASK"), "masks"],
                   [count("DEPTH"), "depth maps"], [count("CAMERAS") + count("COLMAP"), "files of cameras"]];
    summary.textContent = chosen.length === 0 ? "No files yet."
      : parts.filter(([n]) => n).map(([n, what]) => `${n} ${what}`).join(", ") +
        `, ${bytesText(bytes)}` + (left ? `; ${left} other files are left out` : "");
    go.disabled = chosen.length === 0 || running !== undefined;
  };
  const zone = dropZone((files) => {
    const more = choose(files);
    const names = new Set(more.map((c) => c.role + c.name));
    chosen = [...chosen.filter((c) => !names.has(c.role + c.name)), ...more];
    describe(files.length - more.length);
  });

  const submit = async (): Promise<void> => {
    running = new AbortController();
    bar.hidden = false;
    result.replaceChildren();
    describe();
    const bytes = chosen.reduce((sum, c) => sum + c.file.size, 0);
    try {
      const job = await post<Job>("/v1/jobs", {
        displayName: title.value.trim(), options: options?.read() ?? {},
        requestId: [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16)).join(""),
      });
      const refused = await send(job.name, chosen, (sent) => { bar.value = sent / bytes; }, running.signal);
      if (refused.size > 0) return offer(job, refused);
      await post(`/v1/${job.name}:start`);
      location.hash = `#/jobs/${idOf(job.name)}`;
    } catch (error) {
      if (!running.signal.aborted) result.replaceChildren(el("p", {class: "error"}, (error as ApiError).message));
    } finally {
      running = undefined;
      bar.hidden = true;
      describe();
    }
  };
  // Some files were refused: the others may do.
  const offer = (job: Job, refused: Map<string, string>): void => {
    const start = async (): Promise<void> => {
      try {
        await post(`/v1/${job.name}:start`);
        location.hash = `#/jobs/${idOf(job.name)}`;
      } catch (error) {
        notice((error as ApiError).message);
      }
    };
    result.replaceChildren(
        el("p", {class: "error"}, `${refused.size} of ${chosen.length} files were refused:`),
        el("ul", {}, ...[...refused].map(([, why]) => el("li", {}, why))),
        el("button", {type: "button", class: "primary", click: () => void start()}, "Start without them"));
  };

  get<ServerInfo>("/v1/serverInfo").then((info) => {
    options = optionFields(info);
    main.replaceChildren(...options.main);
    rest.replaceChildren(...options.rest);
  }, (error: ApiError) => notice(error.message));
  const element = el("form", {class: "submit", submit: (event) => { event.preventDefault(); void submit(); }},
                     el("h1", {}, "New job"), zone, summary,
                     el("div", {class: "fields"}, labelled("Title", title)), main,
                     el("details", {}, el("summary", {}, "All options"), rest), bar,
                     el("div", {class: "row"}, go), result);
  return {title: "New job", element, leave: () => running?.abort()};
}
