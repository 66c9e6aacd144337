// Flies through a scene on the page and says how fast that is; measure_flight.py starts it.

import {chromium} from "playwright-core";

const {URL: url, CHROMIUM: executablePath, SECONDS: seconds, PATIENCE_MS: patience} = process.env;
const kSwingMs = 400;  // to one side, then to the other: what is looked at stays in view
const kPresses = 20;

const browser = await chromium.launch({
  executablePath, args: ["--no-sandbox", "--disable-dev-shm-usage"],
});
const page = await browser.newPage({viewport: {width: 1280, height: 800}});
page.setDefaultTimeout(Number(patience));
await page.goto(url);
await page.locator("canvas[data-full=true]").waitFor();
await page.locator("canvas").focus();

// When each picture was there, since the page began, and its size.
await page.evaluate(() => {
  const canvas = document.querySelector("canvas");
  window.pictures = [];
  new MutationObserver(() => window.pictures.push({
    at: performance.now(), full: canvas.dataset.full === "true", size: `${canvas.width}x${canvas.height}`,
  })).observe(canvas, {attributeFilter: ["data-drawn"]});
  addEventListener("keydown", () => { window.pressed = performance.now(); }, true);
  addEventListener("keyup", () => { window.released = performance.now(); }, true);
});
const full = () => page.waitForFunction(() => window.pictures.at(-1)?.full);
const taken = () => page.evaluate(() => ({
  pictures: window.pictures.splice(0), pressed: window.pressed, released: window.released}));
const quantile = (numbers, share) => [...numbers].sort((a, b) => a - b)[Math.floor(share * (numbers.length - 1))];
const ms = (numbers) => `${quantile(numbers, 0.5).toFixed(0)} ms, at most ${quantile(numbers, 0.95).toFixed(0)} ms in 95 %`;

// Moving.
const until = Date.now() + 1000 * Number(seconds);
for (let side = 0; Date.now() < until; side = 1 - side) {
  const key = side ? "ArrowLeft" : "ArrowRight";
  await page.keyboard.down(key);
  await page.waitForTimeout(kSwingMs);
  await page.keyboard.up(key);
}
await full();
const moving = (await taken()).pictures.filter((p) => !p.full);
const pauses = moving.slice(1).map((p, i) => p.at - moving[i].at);
console.log(`moving, ${moving[0].size} px: ${(1000 / quantile(pauses, 0.5)).toFixed(1)} pictures a second; ` +
    `from one to the next ${ms(pauses)}`);

// From rest.
const first = [], rest = [];
let size = "";
for (let i = 0; i < kPresses; ++i) {
  await page.keyboard.down(i % 2 ? "ArrowLeft" : "ArrowRight");
  await page.waitForFunction(() => window.pictures.length > 0);
  await page.keyboard.up(i % 2 ? "ArrowLeft" : "ArrowRight");
  await full();
  const {pictures, pressed, released} = await taken();
  first.push(pictures[0].at - pressed);
  rest.push(pictures.at(-1).at - released);
  size = pictures.at(-1).size;
}
console.log(`from a key to its first picture: ${ms(first)}`);
console.log(`from the key's release to the full picture, ${size} px: ${ms(rest)}`);
await browser.close();
