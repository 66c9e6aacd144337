// A video of a way through the scene: the server renders the pictures, the browser encodes them.

import {postEvents, type ApiError} from "./api.js";
import {el, labelled, notice} from "./dom.js";
import {webm, type Packet} from "./webm.js";

const kRate = 30;         // pictures a second
const kKeyEvery = 2;      // seconds; between two of them one cannot jump
const kBitsPerPixel = 0.15;
const kSize = {width: 1280, height: 720};
const kMostWaiting = 8;   // pictures in the encoder

interface Frame { frame?: number; frames: number; view: {data: string} }

function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  const text = atob(base64);
  return Uint8Array.from(text, (c) => c.charCodeAt(0));
}

// Encodes pictures in their order; `end` gives the file.
class Film {
  private readonly packets: Packet[] = [];
  private error: Error | undefined;
  private count = 0;
  private readonly encoder = new VideoEncoder({
    output: (chunk) => {
      const bytes = new Uint8Array(chunk.byteLength);
      chunk.copyTo(bytes);
      this.packets.push({ms: chunk.timestamp / 1000, key: chunk.type === "key", bytes});
    },
    error: (error) => { this.error = error; },
  });

  constructor() {
    this.encoder.configure({
      codec: "vp09.00.31.08", ...kSize, framerate: kRate, latencyMode: "quality",
      bitrate: kBitsPerPixel * kSize.width * kSize.height * kRate,
    });
  }

  async add(picture: Blob): Promise<void> {
    const bitmap = await createImageBitmap(picture);
    try {
      if (this.error) throw this.error;  // an encoder that has failed would only say that it is closed
      const frame = new VideoFrame(bitmap, {timestamp: Math.round(1e6 * this.count / kRate)});
      this.encoder.encode(frame, {keyFrame: this.count++ % (kKeyEvery * kRate) === 0});
      frame.close();
    } finally {
      bitmap.close();
    }
    while (this.encoder.encodeQueueSize > kMostWaiting) await new Promise((ok) => setTimeout(ok, 5));
    if (this.error) throw this.error;
  }

  async end(): Promise<Blob> {
    await this.encoder.flush();
    this.encoder.close();
    return webm(this.packets, kSize.width, kSize.height, 1000 * this.count / kRate);
  }
  stop(): void { if (this.encoder.state !== "closed") this.encoder.close(); }
}

// `place`: the pose of now; `settings`: how pictures are shown now.
export function touring(job: string, title: string, place: () => unknown,
                        settings: () => Record<string, unknown>): {element: HTMLElement; leave: () => void} {
  let places: unknown[] = [], running: AbortController | undefined, url = "";
  const list = el("p", {class: "hint", "aria-live": "polite"});
  const seconds = el("input", {type: "number", min: 1, max: 60, value: 4});
  const bar = el("progress", {max: 1, value: 0, hidden: true, "aria-label": "Video"});
  const make = el("button", {type: "button", click: () => void film()}, "Make a video");
  const clear = el("button", {type: "button", click: () => { places = []; show(); }}, "Forget the places");
  const link = el("a", {class: "button", hidden: true}, "Save the video");
  const show = (): void => {
    list.textContent = typeof VideoEncoder === "undefined"
      ? "This browser encodes no videos here: that needs https or this machine itself. litags path --video does."
      : places.length === 0 ? "Fly to places and add them; the video goes from one to the next."
      : `${places.length} ${places.length === 1 ? "place" : "places"}`;
    make.disabled = places.length < 2 || running !== undefined || typeof VideoEncoder === "undefined";
    clear.hidden = places.length === 0;
    bar.hidden = running === undefined;
  };
  const film = async (): Promise<void> => {
    const stop = running = new AbortController(), made = new Film();
    const frames = Math.max(2, Math.min(1800, Math.round(kRate * seconds.valueAsNumber) || 0));
    link.hidden = true;
    show();
    try {
      const events = postEvents<Frame>(`/v1/${job}:renderPath`, {
        keyframes: {poses: places}, frames,
        settings: {...settings(), ...kSize, format: "PICTURE_FORMAT_JPEG", jpegQuality: 95},
      }, stop.signal);
      for await (const {frame, view} of events) {
        await made.add(new Blob([bytesOf(view.data)], {type: "image/jpeg"}));
        bar.value = ((frame ?? 0) + 1) / frames;
      }
      URL.revokeObjectURL(url);
      link.href = url = URL.createObjectURL(await made.end());
      link.download = `${title}.webm`;
      link.hidden = false;
    } catch (error) {
      if (!stop.signal.aborted) notice((error as ApiError).message);
    } finally {
      made.stop();
      running = undefined;
      show();
    }
  };
  const element = el("details", {class: "tour"}, el("summary", {}, "A video of a way through the scene"),
                     el("div", {class: "row end"},
                        el("button", {type: "button", click: () => { places.push(place()); show(); }}, "Add this place"),
                        labelled("Seconds", seconds), make, clear, link), list, bar);
  show();
  return {element, leave: () => { running?.abort(); URL.revokeObjectURL(url); }};
}
