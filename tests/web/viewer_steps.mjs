// The scene drawn in the browser, on the page and as a page of its own, against the server's picture of
// the same place; viewer_test.py starts it.

import assert from "node:assert/strict";
import {join} from "node:path";
import {chromium} from "playwright-core";

const {URL: url, HTML: html, CHROMIUM: executablePath, SCREENSHOTS: folder, PATIENCE_MS: patience} = process.env;
// The viewer draws 8 bits of the compressed file and blends in 8 bits. The pictures of two places are below 25 dB.
const kLeastPsnr = 34;

const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const viewport = {width: 640, height: 480};

async function sheetOf(options) {
  const context = await browser.newContext({viewport, ...options});
  const sheet = await context.newPage();
  sheet.setDefaultTimeout(Number(patience));
  const asked = [], complaints = [];
  sheet.on("request", (request) => asked.push(request.url()));
  sheet.on("pageerror", (error) => complaints.push(String(error)));
  sheet.on("console", (message) => { if (message.type() === "error") complaints.push(message.text()); });
  return {sheet, asked, complaints};
}

const {sheet: scale} = await sheetOf({});  // where pictures are compared
async function psnr(a, b) {
  return scale.evaluate(async (pictures) => {
    const [p, q] = await Promise.all(pictures.map(async (base64) => {
      const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
      const bitmap = await createImageBitmap(new Blob([bytes], {type: "image/png"}));
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
      context.drawImage(bitmap, 0, 0);
      return context.getImageData(0, 0, bitmap.width, bitmap.height);
    }));
    if (p.width !== q.width || p.height !== q.height) throw new Error(`${p.width} ${q.width} ${p.height} ${q.height}`);
    let sum = 0, bright = 0;
    for (let i = 0; i < p.data.length; ++i) {
      if (i % 4 === 3) continue;
      sum += (p.data[i] - q.data[i]) ** 2;
      bright += p.data[i];
    }
    const count = 0.75 * p.data.length;
    if (bright / count < 20) throw new Error("the picture is black");
    return 10 * Math.log10(255 ** 2 / (sum / count));
  }, [a, b].map((png) => png.toString("base64")));
}

async function same(name, ours, theirs, least = kLeastPsnr) {
  const db = await psnr(ours, theirs);
  console.log(`${name}: ${db.toFixed(1)} dB`);
  assert.ok(db >= least, `${name}: ${db}`);
}

const {sheet: page, asked, complaints} = await sheetOf({});
await page.goto(url);
const stage = page.locator("canvas.stage");
const full = () => page.locator("canvas.stage[data-full=true]").waitFor();
// What a sheet shows once it does not change any more: a sort may end after the last picture that was drawn.
async function still(sheet, name, options) {
  for (let before, now; ; before = now) {
    now = await sheet.screenshot({path: join(folder, `viewer-${name}.png`), ...options});
    if (before?.equals(now)) return now;
    await sheet.waitForTimeout(300);
  }
}
// Whole pixels, so that the page of its own has the same ones.
async function part() {
  const {x, y, width, height} = await stage.boundingBox();
  return {clip: Object.fromEntries(Object.entries({x, y, width, height}).map(([k, v]) => [k, Math.round(v)]))};
}
const picture = async (name) => still(page, name, await part());
// Not what was there before the last change.
const settled = async () => { await page.waitForTimeout(500); await full(); };

await full();
const first = await picture("server");
assert.ok(!asked.some((address) => address.includes("viewer.js")), "the viewer is loaded before it is wanted");

const drawn = page.getByRole("combobox", {name: "Drawn", exact: true});
await drawn.selectOption("here");
await page.getByText("drawn here").waitFor();
await settled();
assert.ok(await page.getByLabel(/^Light/).isDisabled());
await page.screenshot({path: join(folder, "viewer-page.png")});
await same("at a photo's place", first, await picture("here"));

await stage.focus();
const keys = ["ArrowRight", "w"];
for (const key of keys) await page.keyboard.down(key);
while (await psnr(first, await page.screenshot(await part())) > 25) await page.waitForTimeout(50);
for (const key of keys) await page.keyboard.up(key);
await settled();
// At a photo's place: how far keys lead hangs on the machine's load.
await page.getByLabel("Photo's place").selectOption({index: 3});
await settled();
const other = await picture("here-other");
assert.ok(await psnr(first, other) < 25, "the other photo's place is the same");
await drawn.selectOption("server");
await settled();
await same("at another photo's place", await picture("server-other"), other);
assert.ok(await page.getByLabel(/^Light/).isEnabled());
await drawn.selectOption("here");
await page.getByText("drawn here").waitFor();
await settled();
await same("there again", await picture("here-again"), other);

const origin = new URL(url).origin;
assert.deepEqual(asked.filter((address) => !address.startsWith(origin) && !address.startsWith(`blob:${origin}`)), []);
assert.deepEqual(complaints, []);

// The page of its own, from a disk, without a network, as large as the stage.
const box = await stage.boundingBox();
const alone = await sheetOf({
  offline: true, viewport: {width: Math.round(box.width), height: Math.round(box.height)}});
await alone.sheet.goto(`file://${html}`);
await alone.sheet.locator("canvas[data-full=true]").waitFor();
await alone.sheet.locator("canvas").evaluate((canvas) => canvas.blur());
await alone.sheet.getByLabel("Photo's place").evaluate((select) => { select.hidden = true; });
await alone.sheet.locator("canvas[data-full=true]").waitFor();
await same("the page of its own", first,
           await still(alone.sheet, "alone"));
await alone.sheet.getByLabel("Photo's place").evaluate((select) => { select.hidden = false; });
await alone.sheet.getByLabel("Photo's place").selectOption({index: 2});
await alone.sheet.locator("canvas[data-full=true]").waitFor();
assert.ok(await psnr(first, await still(alone.sheet, "alone-moved")) < 25, "the page of its own does not move");
assert.deepEqual(alone.asked.filter((address) => !/^(file|blob):/.test(address)), []);
assert.deepEqual(alone.complaints, []);

// A browser that takes WebGL away: once the scene is drawn, or while it loads.
const loses = await sheetOf({});
const here = async () => {
  await loses.sheet.goto("about:blank");
  await loses.sheet.goto(url);
  await loses.sheet.locator("canvas.stage[data-full=true]").waitFor();
  await loses.sheet.getByRole("combobox", {name: "Drawn", exact: true}).selectOption("here");
};
const taken = async () => {
  await loses.sheet.getByText("the browser took WebGL away").waitFor();
  assert.equal(await loses.sheet.getByRole("combobox", {name: "Drawn", exact: true}).inputValue(), "server");
  await loses.sheet.locator("canvas.stage[data-full=true]").waitFor();
};
await here();
await loses.sheet.getByText("drawn here").waitFor();
await loses.sheet.evaluate(() => document.querySelector("canvas.here").getContext("webgl2")
  .getExtension("WEBGL_lose_context").loseContext());
await taken();
await loses.sheet.addInitScript(() => {
  const before = HTMLCanvasElement.prototype.getContext, usual = window.Response;
  HTMLCanvasElement.prototype.getContext = function(kind, ...more) {
    const context = before.call(this, kind, ...more);
    if (!this.isConnected || kind !== "webgl2") return context;
    // The scene is read when all have heard of it.
    const lost = new Promise((ok) => this.addEventListener("webglcontextlost", () => window.setTimeout(ok)));
    window.Response = class extends usual {
      constructor(bytes) {
        super(new ReadableStream({async start(stream) {
          await lost;
          stream.enqueue(bytes);
          stream.close();
        }}));
      }
    };
    queueMicrotask(() => context.getExtension("WEBGL_lose_context").loseContext());
    return context;
  };
});
await here();
await taken();
await loses.sheet.goto(`file://${html}`);
await loses.sheet.getByText("the browser took WebGL away").waitFor();
assert.deepEqual(loses.complaints, []);

// A browser without WebGL.
const without = await sheetOf({});
await without.sheet.addInitScript(() => {
  const before = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function(kind, ...more) {
    return kind === "webgl2" ? null : before.call(this, kind, ...more);
  };
});
await without.sheet.goto(url);
await without.sheet.locator("canvas.stage[data-full=true]").waitFor();
assert.ok(await without.sheet.getByRole("combobox", {name: "Drawn", exact: true}).isDisabled());
await without.sheet.goto(`file://${html}`);
await without.sheet.getByText("WebGL", {exact: false}).first().waitFor();
await browser.close();
process.exit(0);
