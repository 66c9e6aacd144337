// Gaussians drawn by PlayCanvas; the only file that knows it.

import {
  AppBase, AppOptions, Asset, CameraComponentSystem, Color, Entity, GSPLATDATA_LARGE, GSplatComponentSystem,
  GSplatHandler, Mat4, Quat, SHADERLANGUAGE_GLSL, WebglGraphicsDevice,
} from "playcanvas";

import {add, type OrbitCamera, type V3} from "./camera.js";
import type {Drawn, SplatView} from "./contract.js";

const kNear = 0.02, kFar = 200;  // of the scene's radius

const kRestMs = 200;  // a sort takes less; nothing new after that is the final picture

// PlayCanvas lets a Gaussian fall to zero at 2.8 deviations, which takes 7 % of it. So that what several
// cover is as opaque as with us, alpha is o exp(-r^2 / 2) up to there, and at most 0.99.
const kAlpha = `
void modifySplatColor(vec2 gaussianUV, inout vec4 color) {
  color.a = min(0.99, gaussianColor.a * exp(-4.0 * dot(gaussianUV, gaussianUV)));
}`;

// The projection of engine/render/projection-inl.h. PlayCanvas' own adds 0.3 / 4 px^2 to covariances, draws nothing
// larger than the picture, and does not limit what perspective makes of Gaussians beside it. The view's z is negative
// in front. A quad reaches to sqrt(8) deviations, where its uv are 1.
const kCorner = (added: number): string => `
uniform vec4 viewport_size;  // px, and the inverse
uniform float minPixelSize;
bool initCorner(SplatSource source, SplatCenter center, out SplatCorner corner) {
  vec2 scale = vec2(center.projMat00, center.projMat11);
  vec2 focal = 0.5 * viewport_size.xy * scale;
  vec2 most = 1.3 / scale;  // 15 % of the picture beside it
  vec2 tilt = clamp(center.view.xy / center.view.z, -most, most);
  mat3 axes = mat3(center.modelView) * quatToMat3(getRotation());
  vec3 sizes = getScale();
  vec2 t[3];
  for (int k = 0; k < 3; ++k) t[k] = sizes[k] * focal / center.view.z * (axes[k].xy - tilt * axes[k].z);
  float a = ${added}, b = 0.0, c = ${added};
  for (int k = 0; k < 3; ++k) {
    a += t[k].x * t[k].x;
    b += t[k].x * t[k].y;
    c += t[k].y * t[k].y;
  }
  #if GSPLAT_AA
    // |Cov| by Lagrange's identity: the plain difference loses all digits of long thin ones.
    vec3 minors = vec3(t[0].x * t[1].y - t[0].y * t[1].x, t[0].x * t[2].y - t[0].y * t[2].x,
                       t[1].x * t[2].y - t[1].y * t[2].x);
    float det = dot(minors, minors);
    corner.aaFactor = sqrt(det / (det + ${added} * (a + c - ${added})));
  #endif
  float middle = 0.5 * (a + c), off = length(vec2(0.5 * (a - c), b));
  vec2 along = vec2(b, middle + off - a);
  along = dot(along, along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
  float large = sqrt(8.0 * (middle + off)), small = sqrt(8.0 * max(middle - off, ${added}));
  vec2 perNdc = 2.0 * center.proj.ww * viewport_size.zw;
  if (any(greaterThan(abs(center.proj.xy) - large * perNdc, center.proj.ww))) return false;
  corner.offset = vec3((source.cornerUV.x * large * along +
                        source.cornerUV.y * small * vec2(along.y, -along.x)) * perNdc, 0.0);
  corner.uv = source.cornerUV;
  return true;
}`;

const kMipAdds = 0.1, kAdds = 0.3;  // px^2, of scenes with the 2D Mip filter and of others; engine/render/constants.h

// PlayCanvas leaves out what a few pixels show; with these it draws every Gaussian that we do.
function exact(app: AppBase, antialiased: boolean): void {
  const gsplat = app.scene.gsplat;
  gsplat.alphaClipForward = 1 / 255;
  gsplat.minPixelSize = 0;
  gsplat.minContribution = 0;
  gsplat.colorUpdateAngle = 0;
  gsplat.dataFormat = GSPLATDATA_LARGE;
  gsplat.useTonemap = false;
  gsplat.antiAlias = antialiased;
  const chunks = gsplat.material.getShaderChunks(SHADERLANGUAGE_GLSL);
  chunks.set("gsplatModifyPS", kAlpha);
  chunks.set("gsplatCornerVS", kCorner(antialiased ? kMipAdds : kAdds));
  gsplat.material.update();
}

// What a .compressed.ply of ours says of itself in comments.
function commentsOf(bytes: Uint8Array): {antialiased: boolean; origin: V3} {
  const header = new TextDecoder().decode(bytes.subarray(0, 4096)).split("end_header")[0]!;
  const [x, y, z] = /^comment origin (.*)$/m.exec(header)?.[1]?.split(" ").map(Number) ?? [];
  return {antialiased: /^comment antialiased$/m.test(header), origin: [x ?? 0, y ?? 0, z ?? 0]};
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
  const {antialiased, origin} = commentsOf(bytes);
  exact(app, antialiased);
  const eye = new Entity("eye"), splats = new Entity("splats");
  eye.addComponent("camera", {clearColor: new Color(0, 0, 0)});
  app.root.addChild(eye);
  app.autoRender = false;
  let timer = 0;
  let failure: ((error: Error) => void) | undefined;
  const stop = (): void => { window.clearTimeout(timer); app.destroy(); };
  const taken = (): Error => new Error("the browser took WebGL away");
  canvas.addEventListener("webglcontextlost", () => failure?.(taken()));
  try {
    const asset = await load(app, bytes);
    if (app.graphicsDevice.isContextLost()) throw taken();  // nobody could be told before
    splats.addComponent("gsplat", {asset});
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
      eye.setLocalPosition(...add(camera.eye, origin, -1));  // floats have too few digits for maps' coordinates
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
