// Gaussians drawn by PlayCanvas; the only file that knows it.

import {
  AppBase, AppOptions, Asset, CameraComponentSystem, Color, Entity, GSPLATDATA_LARGE, GSplatComponentSystem,
  GSplatHandler, Mat4, Quat, SHADERLANGUAGE_GLSL, WebglGraphicsDevice,
} from "playcanvas";

import type {OrbitCamera} from "./camera.js";
import type {Drawn, SplatView} from "./contract.js";

const kNear = 0.02, kFar = 200;  // of the scene's radius

const kRestMs = 200;  // a sort takes less; nothing new after that is the final picture

// PlayCanvas lets a Gaussian fall to zero at 2.8 deviations, which takes 7 % of it. So that what several
// cover is as opaque as with us, alpha is o exp(-r^2 / 2) up to there, and at most 0.99.
const kAlpha = `
void modifySplatColor(vec2 gaussianUV, inout vec4 color) {
  color.a = min(0.99, gaussianColor.a * exp(-4.0 * dot(gaussianUV, gaussianUV)));
}`;

// PlayCanvas leaves out what a few pixels show; with these it draws every Gaussian that we do.
function exact(app: AppBase): void {
  const gsplat = app.scene.gsplat;
  gsplat.alphaClipForward = 1 / 255;
  gsplat.minPixelSize = 0;
  gsplat.minContribution = 0;
  gsplat.colorUpdateAngle = 0;
  gsplat.dataFormat = GSPLATDATA_LARGE;
  gsplat.useTonemap = false;
  gsplat.material.getShaderChunks(SHADERLANGUAGE_GLSL).set("gsplatModifyPS", kAlpha);
  gsplat.material.update();
}

function load(app: AppBase, bytes: Uint8Array<ArrayBuffer>): Promise<Asset> {
  const asset = new Asset("scene", "gsplat", {
    url: "scene.compressed.ply", filename: "scene.compressed.ply",
    contents: new Response(bytes) as unknown as ArrayBuffer,
  });
  return new Promise((done, failed) => {
    asset.once("load", () => done(asset));
    asset.once("error", (why: string) => failed(new Error(`the viewer cannot read the scene: ${why}`)));
    app.assets.add(asset);
    app.assets.load(asset);
  });
}

// PlayCanvas' axes: x right, y up, z back.
function rotationOf(camera: OrbitCamera): Quat {
  const {right, down, forward} = camera.frame();
  const back = forward.map((v) => -v), up = down.map((v) => -v);
  return new Quat().setFromMat4(new Mat4().set([...right, 0, ...up, 0, ...back, 0, 0, 0, 0, 1]));
}

export async function openSplats(canvas: HTMLCanvasElement, bytes: Uint8Array<ArrayBuffer>,
                                 drawn: Drawn): Promise<SplatView> {
  const options = new AppOptions();
  options.graphicsDevice = new WebglGraphicsDevice(canvas, {antialias: false, alpha: false});
  options.componentSystems = [CameraComponentSystem, GSplatComponentSystem];
  options.resourceHandlers = [GSplatHandler];
  const app = new AppBase(canvas);
  app.init(options);
  exact(app);
  const eye = new Entity("eye"), splats = new Entity("splats");
  eye.addComponent("camera", {clearColor: new Color(0, 0, 0)});
  app.root.addChild(eye);
  app.autoRender = false;
  let timer = 0;
  let failure: ((error: Error) => void) | undefined;
  const stop = (): void => { window.clearTimeout(timer); app.destroy(); };
  canvas.addEventListener("webglcontextlost", () => failure?.(new Error("the browser took WebGL away")));
  try {
    splats.addComponent("gsplat", {asset: await load(app, bytes)});
  } catch (error) {
    stop();
    throw error;
  }
  app.root.addChild(splats);
  // A sort that is done shows something new.
  app.systems.gsplat!.on("frame:request", () => { app.renderNextFrame = true; });
  app.systems.gsplat!.on("frame:ready", (_camera: unknown, _layer: unknown, ready: boolean) => {
    if (!ready) app.renderNextFrame = true;
    drawn(false);
    window.clearTimeout(timer);
    timer = window.setTimeout(() => drawn(true), kRestMs);
  });
  app.start();
  return {
    draw(camera) {
      const {clientWidth, clientHeight} = canvas;
      if (clientWidth === 0 || clientHeight === 0) return;
      app.graphicsDevice.maxPixelRatio = devicePixelRatio;
      app.graphicsDevice.resizeCanvas(clientWidth, clientHeight);
      eye.setLocalPosition(...camera.eye);
      eye.setLocalRotation(rotationOf(camera));
      eye.camera!.fov = camera.fovDeg;
      eye.camera!.nearClip = kNear * camera.radius;
      eye.camera!.farClip = kFar * camera.radius;
      window.clearTimeout(timer);  // what is shown is of another place
      app.renderNextFrame = true;
    },
    onFailure(action) { failure = action; },
    stop,
  };
}
