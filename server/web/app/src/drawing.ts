// Pictures of a scene by the server: small ones while something changes, a full one at rest.

import {ApiError, renderView, type Picture} from "./api.js";

const kRestMs = 180;
const kSmallPixels = 480 * 270;
const kMostPixels = 1920 * 1080;

export interface Wish {
  pose: unknown;
  // Channel, light, exposure and lens.
  settings: Record<string, unknown>;
}

// The size of at most so many pixels with the element's aspect ratio.
function sizeFor(element: HTMLElement, most: number): {width: number; height: number} {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(2, element.clientWidth * ratio), height = Math.max(2, element.clientHeight * ratio);
  const shrink = Math.min(1, Math.sqrt(most / (width * height)));
  return {width: Math.round(width * shrink), height: Math.round(height * shrink)};
}

export class Drawing {
  private wanted = 0;   // number of the newest wish
  private drawn = 0;    // and of the one that the newest picture shows
  private busy = false;
  private timer = 0;
  private stopped = false;
  private full: AbortController | undefined;

  // `wish` says what to draw now; `show` gets each picture, and whether it is the full one.
  constructor(private readonly job: string, private readonly canvas: HTMLCanvasElement,
              private readonly wish: () => Wish,
              private readonly show: (picture: Picture, ms: number, full: boolean) => void,
              private readonly fail: (error: ApiError) => void) {}

  // Something has changed.
  ask(): void {
    ++this.wanted;
    this.full?.abort();
    window.clearTimeout(this.timer);
    void this.next();
  }

  stop(): void {
    this.stopped = true;
    window.clearTimeout(this.timer);
    this.full?.abort();
  }

  // One small picture at a time: those in between are left out.
  private async next(): Promise<void> {
    if (this.busy || this.stopped) return;
    this.busy = true;
    const number = this.wanted;
    await this.draw(kSmallPixels, 70, false);
    this.drawn = number;
    this.busy = false;
    if (this.stopped) return;
    if (this.drawn < this.wanted) {
      void this.next();
    } else {
      window.clearTimeout(this.timer);
      this.timer = window.setTimeout(() => void this.rest(), kRestMs);
    }
  }

  private async rest(): Promise<void> {
    const number = this.wanted;
    this.full = new AbortController();
    await this.draw(kMostPixels, 92, true, this.full.signal, () => number === this.wanted);
    if (this.drawn < this.wanted) void this.next();  // it failed, and is wanted still
  }

  private async draw(pixels: number, quality: number, full: boolean, signal?: AbortSignal,
                     still = (): boolean => true): Promise<void> {
    const {pose, settings} = this.wish();
    const began = performance.now();
    try {
      const picture = await renderView(this.job, {
        pose, settings: {...settings, ...sizeFor(this.canvas, pixels), format: "PICTURE_FORMAT_JPEG",
                         jpegQuality: quality},
      }, signal);
      const bitmap = await createImageBitmap(picture.blob);
      if (!still() || this.stopped) return;
      this.canvas.width = bitmap.width;
      this.canvas.height = bitmap.height;
      this.canvas.getContext("2d")!.drawImage(bitmap, 0, 0);
      bitmap.close();
      this.show(picture, performance.now() - began, full);
    } catch (error) {
      if (signal?.aborted || this.stopped) return;
      this.fail(error instanceof ApiError ? error : new ApiError(0, String(error)));
      // A server that is busy or away is asked again in a moment.
      await new Promise((ok) => setTimeout(ok, 1000));
      if (error instanceof ApiError && error.mayComeAgain) ++this.wanted;
    }
  }
}
