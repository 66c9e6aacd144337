// A scene drawn in the browser, by a viewer that is loaded when it is first wanted.

import {ApiError, getBytes, type Job} from "./api.js";
import type {OrbitCamera} from "./camera.js";
import type {SplatView, ViewerModule} from "./contract.js";
import {el} from "./dom.js";

const kModule = "/viewer.js";

export class Here {
  readonly canvas = el("canvas", {class: "here", hidden: true, "aria-hidden": "true"});
  private view: Promise<SplatView> | undefined;
  private shown = false;
  private left = false;

  // `drawn` gets the size of each picture; once more, with `final`, for one that none better follows.
  constructor(private readonly job: Job, private readonly camera: OrbitCamera,
              private readonly drawn: (size: string, final: boolean) => void,
              private readonly fail: (error: Error) => void) {}

  get on(): boolean { return this.shown; }

  show(shown: boolean): void {
    this.shown = shown;
    this.canvas.hidden = !shown;
    if (shown) this.draw();
  }

  draw(): void {
    this.view ??= this.open();
    this.view.then((view) => { if (this.shown && !this.left) view.draw(this.camera); },
                   (error: Error) => {
      this.view = undefined;
      if (this.shown && !this.left) this.fail(error);
    });
  }

  leave(): void {
    this.left = true;
    this.view?.then((view) => view.stop(), () => {});
  }

  // As trained with the 2D Mip filter, which the viewer knows; some scenes are without.
  private async scene(): Promise<Uint8Array<ArrayBuffer>> {
    const path = `/v1/${this.job.name}/model?format=MODEL_FORMAT_COMPRESSED_PLY`;
    try {
      return await getBytes(`${path}&antialiased=true`);
    } catch (error) {
      if (!(error instanceof ApiError && error.reason === "CHANNEL_UNAVAILABLE")) throw error;
      return getBytes(path);
    }
  }

  private async open(): Promise<SplatView> {
    const [module, bytes] = await Promise.all([
      (import(kModule) as Promise<ViewerModule>).catch(() => {
        throw new Error("the viewer cannot be loaded: the server is away, or was built without it");
      }),
      this.scene(),
    ]);
    const view = await module.openSplats(this.canvas, bytes, (final) => {
      if (this.shown) this.drawn(`${this.canvas.width} x ${this.canvas.height}`, final);
    });
    view.onFailure((error) => {
      this.view = undefined;
      view.stop();
      this.fail(error);
    });
    return view;
  }
}
