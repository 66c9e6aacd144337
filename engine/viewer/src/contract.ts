// What the page knows of the viewer, which it loads only when it is wanted.

import type {OrbitCamera} from "./camera.js";

// A picture is there; then, once, `final`: none better has followed for a while.
export type Drawn = (final: boolean) => void;

export interface SplatView {
  // Draws as soon as it can from where the camera is, as large as the canvas is shown.
  draw(camera: OrbitCamera): void;
  onFailure(action: (error: Error) => void): void;
  stop(): void;
}

export interface ViewerModule {
  // `bytes`: a .compressed.ply. Throws where there is no WebGL 2, and for what is no such file.
  openSplats(canvas: HTMLCanvasElement, bytes: Uint8Array<ArrayBuffer>, drawn: Drawn): Promise<SplatView>;
}

export const hasWebGl = (): boolean => {
  const gl = document.createElement("canvas").getContext("webgl2");
  gl?.getExtension("WEBGL_lose_context")?.loseContext();  // browsers allow few at a time
  return gl !== null;
};
