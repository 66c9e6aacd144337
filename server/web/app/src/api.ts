// The services by HTTP, and the parts of their messages that the page uses.

import type {Cameras} from "./camera.js";
export type {Camera, Cameras, Vector} from "./camera.js";

export interface Progress {
  stage?: string;
  message?: string;
  iteration?: number;
  iterations?: number;
  loss?: number;
  psnrHoldout?: number;
  gaussians?: string;
  iterationsPerSecond?: number;
  eta?: string;
}

export interface Report {
  photos?: number;
  registered?: number;
  dropped?: string[];
  notes?: string[];
  gaussians?: string;
  iterations?: number;
  runTime?: string;
  psnrHoldout?: number;
  ssimHoldout?: number;
}

export type Options = Record<string, string | number | boolean>;

export interface Job {
  name: string;
  displayName?: string;
  state: string;
  cancelRequested?: boolean;
  options?: Options;
  labels?: Record<string, string>;
  photos?: number;
  createTime?: string;
  startTime?: string;
  endTime?: string;
  progress?: Progress;
  snapshotIteration?: number;
  error?: {message?: string};
  report?: Report;
  waitsFor?: string;
  queuePosition?: number;
}

export interface PhotoFindings {
  focalLengthMm?: number;
  exposureSeconds?: number;
  iso?: number;
  fNumber?: number;
  stops?: number;
  leftOut?: string;
  sharpness?: number;
}

export interface JobFile {
  fileName: string;
  role?: string;
  width?: number;
  height?: number;
  found?: PhotoFindings;
  foundInVideo?: {duration?: string; frames?: string};
}

export interface JobEvent {
  number: string;
  time: string;
  stateChange?: {state: string; message?: string};
  progress?: Progress;
  snapshot?: {iteration?: number};
}

export interface LogEntry {
  time: string;
  severity?: string;
  text?: string;
}

export interface ServerInfo {
  version: string;
  methods: {method: string; name: string; defaults: Options}[];
  options: {
    name: string; help: string; minimum?: number; maximum?: number; zeroMeans?: string;
    choices?: string[];
  }[];
  client?: {name?: string; jobs?: string; bytes?: string};
}

// What a call fails with. `code` 0: the server could not be reached.
export class ApiError extends Error {
  // `transient`: the server says that the same call may succeed later.
  constructor(readonly code: number, message: string, readonly reason = "", readonly transient = false) {
    super(message);
  }

  // Whether the same call may succeed later, as it is.
  get mayComeAgain(): boolean { return this.code === 0 || this.code >= 500 || this.transient; }
}

const kUnreachable = "the server cannot be reached";

// What a call says that is made again by itself.
export function saidOfRetried(error: unknown): string {
  const {code, message} = error as ApiError;
  return code === 0 ? `${message}; trying again` : message;
}

let onUnauthorized = (): void => {};
export function whenUnauthorized(action: () => void): void { onUnauthorized = action; }

const waiting: (() => void)[] = [];  // for a token
export const nextToken = (): Promise<void> => new Promise((ok) => { waiting.push(ok); });
export const tokenEntered = (): void => waiting.splice(0).forEach((ok) => ok());

export function errorOf(code: number, text: string): ApiError {
  try {
    const status = JSON.parse(text) as {message?: string; details?: {"@type"?: string; reason?: string}[]};
    const details = status.details ?? [];
    const transient = details.some((detail) => detail["@type"]?.endsWith("/google.rpc.RetryInfo"));
    return new ApiError(code, status.message ?? text, details[0]?.reason, transient);
  } catch {
    return new ApiError(code, `the server answered ${code}`);
  }
}

// As errorOf(); the user is asked for a token, if that is what is missing.
export function refusal(code: number, text: string): ApiError {
  if (code === 401) onUnauthorized();
  return errorOf(code, text);
}

// A server that says nothing for so long is away: of a stream without events it says every 15 s that it is there.
const kSilentMs = 40000;

// Aborts `signal` when the server has fallen silent, and with `outer`. With `asks` a silence may be the server's
// work: it is asked whether it is there.
export class Silence {
  private readonly stop = new AbortController();
  private timer = 0;
  readonly signal = this.stop.signal;

  constructor(private readonly outer?: AbortSignal, public asks = false) {
    outer?.addEventListener("abort", this.leave);
    this.heard();
    if (outer?.aborted) this.leave();
  }

  // The server, or the way to it, shows that it is there.
  heard(): void {
    window.clearTimeout(this.timer);
    if (!this.signal.aborted) this.timer = window.setTimeout(() => this.silent(), kSilentMs);
  }

  // What has not come by now is not wanted any more.
  end(reason?: unknown): void {
    window.clearTimeout(this.timer);
    this.outer?.removeEventListener("abort", this.leave);
    this.stop.abort(reason);
  }

  private readonly leave = (): void => this.end(this.outer?.reason);

  private silent(): void {
    const away = (): void => this.end(new ApiError(0, kUnreachable));
    // A refusal with a reason is of the service itself, not of a proxy before it.
    if (this.asks) get<unknown>("/v1/serverInfo").catch((error: ApiError) => { if (!error.reason) throw error; })
        .then(() => this.heard(), away);
    else away();
  }
}

// What is read of an answer's body, whose connection may break, too.
const whole = <T>(read: Promise<T>, signal: AbortSignal): Promise<T> => read.catch(() => {
  throw signal.aborted ? signal.reason : new ApiError(0, "the connection broke");
});

async function request(method: string, path: string, body: unknown, signal: AbortSignal): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, {
      method, signal, credentials: "same-origin",
      ...(body === undefined ? {} : {
        body: JSON.stringify(body), headers: {"Content-Type": "application/json"},
      }),
    });
  } catch {
    throw signal.aborted ? signal.reason : new ApiError(0, kUnreachable);
  }
  if (response.ok) return response;
  throw (path === "/v1/session" ? errorOf : refusal)(response.status, await whole(response.text(), signal));
}

// The answer as `read` reads it.
async function answer<T>(silence: Silence, read: (response: Response) => Promise<T>, method: string, path: string,
                         body?: unknown): Promise<T> {
  try {
    const response = await request(method, path, body, silence.signal);
    return await whole(read(response), silence.signal);
  } finally {
    silence.end();
  }
}

export const call = <T>(method: string, path: string, body?: unknown): Promise<T> =>
    answer(new Silence(), (response) => response.json() as Promise<T>, method, path, body);
export const get = <T>(path: string): Promise<T> => call<T>("GET", path);
export const post = <T>(path: string, body: unknown = {}): Promise<T> =>
    call<T>("POST", path, body);

// All pages of ListCameras.
export async function camerasOf(job: string): Promise<Cameras> {
  const all: Cameras["cameras"] = [];
  for (let pageToken = "";;) {
    const query = new URLSearchParams({pageSize: "10000", pageToken});
    const page = await get<Cameras & {nextPageToken?: string}>(`/v1/${job}/cameras?${query}`);
    all.push(...page.cameras ?? []);
    if (!page.nextPageToken) return {...page, cameras: all};
    pageToken = page.nextPageToken;
  }
}

// Makes a repeated call the same call.
export const newId = (): string =>
    [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");

// Files and pictures: the server may work on them for long.
export const getBlob = (path: string): Promise<Blob> =>
    answer(new Silence(undefined, true), (response) => response.blob(), "GET", path);
export const getBytes = async (path: string): Promise<Uint8Array<ArrayBuffer>> => new Uint8Array(
    await answer(new Silence(undefined, true), (response) => response.arrayBuffer(), "GET", path));

// A picture, and what the server says of it.
export interface Picture {
  blob: Blob;
  about: {width: number; height: number; iteration?: number; valueMin?: number; valueMax?: number};
}

export const renderView = (job: string, view: unknown, signal?: AbortSignal): Promise<Picture> =>
    answer(new Silence(signal, true), async (response) => ({
      blob: await response.blob(), about: JSON.parse(response.headers.get("Litags-Answer")!) as Picture["about"],
    }), "POST", `/v1/${job}:renderView`, view);

// The events of a stream. `opened` is called once it is there. The connection ends with the loop over them.
async function* eventsOf<T>(method: string, path: string, body: unknown, signal: AbortSignal,
                            opened = (): void => {}): AsyncGenerator<T> {
  const silence = new Silence(signal);
  try {
    const response = await request(method, path, body, silence.signal);
    opened();
    const reader = response.body!.pipeThrough(new TextDecoderStream()).getReader();
    const next = () => whole(reader.read(), silence.signal);
    let text = "", ended = false;
    for (let got = await next(); !got.done; got = await next()) {
      silence.heard();
      const parts = (text + got.value).split("\n\n");
      text = parts.pop()!;
      for (const part of parts) {
        const data = /^data: (.*)$/m.exec(part)?.[1];
        const name = /^event: (.*)$/m.exec(part)?.[1];
        if (name === "failure") throw errorOf(0, data ?? "");
        ended = name === "end";
        if (data && !ended) yield JSON.parse(data) as T;
      }
    }
    if (!ended) throw new ApiError(0, "the connection broke");
  } finally {
    silence.end();
  }
}

// The events of a call, which is not made again when the connection breaks.
export const postEvents = <T>(path: string, body: unknown, signal: AbortSignal): AsyncGenerator<T> =>
    eventsOf("POST", path, body, signal);

export interface Following {
  // The job goes on, as after Resume: a stream that has ended is opened again.
  again: () => void;
  stop: () => void;
}

// Follows a stream of events until it ends. One that broke, failed or fell silent is opened again after the
// event seen last. Not by EventSource, which does not tell that the server is there. A hidden page has no
// stream: browsers open six connections to a server, over all pages.
export function follow<T extends {number?: string}>(
    path: string, resumeField: string, on: {
      event: (event: T) => void; end: () => void; trouble: (message: string) => void;
    }): Following {
  let reading: AbortController | undefined;
  let last = "";
  let timer = 0;
  let failures = 0;  // since the last event
  let stopped = false;
  const close = (): void => {
    window.clearTimeout(timer);
    timer = 0;
    reading?.abort();
    reading = undefined;
  };
  const read = async (signal: AbortSignal): Promise<void> => {
    const after = last ? `${path.includes("?") ? "&" : "?"}${resumeField}=${last}` : "";
    for await (const event of eventsOf<T>("GET", path + after, undefined, signal, () => on.trouble(""))) {
      if (signal.aborted) return;
      failures = 0;
      if (event.number) last = event.number;
      on.event(event);
    }
  };
  const open = (): void => {
    close();
    if (stopped || document.hidden) return;
    const {signal} = reading = new AbortController();
    read(signal).then(() => {
      if (signal.aborted) return;
      close();
      on.end();
    }, (error: unknown) => {
      if (signal.aborted) return;
      if (!(error instanceof ApiError)) throw error;
      close();
      on.trouble(saidOfRetried(error));
      if (error.mayComeAgain) timer = window.setTimeout(open, Math.min(1000 * 2 ** ++failures, 15000));
    });
  };
  const seen = (): void => document.hidden ? close() : open();
  document.addEventListener("visibilitychange", seen);
  open();
  return {
    again: () => { if (!reading && !timer) open(); },
    stop: () => {
      stopped = true;
      close();
      document.removeEventListener("visibilitychange", seen);
    },
  };
}
