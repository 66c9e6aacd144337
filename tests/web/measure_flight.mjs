// Flies through a scene on the page and says how fast that is; measure_flight.py starts it.

import {chromium} from "playwright-core";

const {URL: url, CHROMIUM: executablePath, SECONDS: seconds, PATIENCE_MS: patience} = process.env;
const kSwingMs = 400;  // to one side, then to the other: what is looked at stays in view
const kPresses = 20;
const kRestMs = 600;  // longer than any pause between pictures of one motion

const browser = await chromium.launch({
  executablePath, args: ["--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader",
                         "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage({viewport: {width: 1280, height: 800}});
page.setDefaultTimeout(Number(patience));
await page.goto(url);
await page.locator("canvas.stage[data-full=true]").waitFor();

// When each picture was there, since the page began, and its size.
await page.evaluate(() => {
  const stage = document.querySelector("canvas.stage"), here = document.querySelector("canvas.here");
  window.pictures = [];
  new MutationObserver(() => {
    const canvas = here.hidden ? stage : here;
    window.last = performance.now();
    window.pictures.push({at: window.last, size: `${canvas.width}x${canvas.height}`});
  }).observe(stage, {attributeFilter: ["data-drawn"]});
  addEventListener("keydown", () => { window.pressed = performance.now(); }, true);
  addEventListener("keyup", () => { window.released = performance.now(); }, true);
});
// No picture for a while, and the last one is final.
const full = () => page.waitForFunction((ms) =>
    document.querySelector("canvas.stage").dataset.full === "true" &&
    performance.now() - Math.max(window.last ?? 0, window.released ?? 0) > ms, kRestMs);
const taken = () => page.evaluate(() => ({
  pictures: window.pictures.splice(0), pressed: window.pressed, released: window.released}));
const quantile = (numbers, share) => [...numbers].sort((a, b) => a - b)[Math.floor(share * (numbers.length - 1))];
const ms = (numbers) => `${quantile(numbers, 0.5).toFixed(0)} ms, at most ${quantile(numbers, 0.95).toFixed(0)} ms in 95 %`;

async function measure() {
  await page.locator("canvas.stage").focus();
  await taken();
  // Moving.
  const until = Date.now() + 1000 * Number(seconds), moving = [];
  for (let side = 0; Date.now() < until; side = 1 - side) {
    const key = side ? "ArrowLeft" : "ArrowRight";
    await page.keyboard.down(key);
    await page.waitForTimeout(kSwingMs);
    await page.keyboard.up(key);
    moving.push(...(await taken()).pictures);
  }
  const sizes = moving.map(({size}) => size), common = quantile(sizes, 0.5);
  const pauses = moving.slice(1).map((p, i) => p.at - moving[i].at);
  // The browser may hand several pictures to the graphics card at once; over all of the time it cannot.
  const ends = (moving.at(-1).at - moving[0].at) / 1000;
  console.log(`moving, mostly ${common} px: ${(pauses.length / ends).toFixed(1)} pictures a second; ` +
      `from one to the next ${ms(pauses)}`);
  // From rest.
  await page.waitForTimeout(kRestMs);
  await full();
  const first = [], rest = [];
  let size = "";
  for (let i = 0; i < kPresses; ++i) {
    await taken();
    await page.keyboard.down(i % 2 ? "ArrowLeft" : "ArrowRight");
    await page.waitForFunction(() => window.pictures.length > 0);
    await page.keyboard.up(i % 2 ? "ArrowLeft" : "ArrowRight");
    await page.waitForFunction(() => window.pictures.at(-1).at > window.released);
    await full();
    const {pictures, pressed, released} = await taken();
    first.push(pictures[0].at - pressed);
    rest.push(pictures.at(-1).at - released);
    size = pictures.at(-1).size;
  }
  console.log(`from a key to its first picture: ${ms(first)}`);
  console.log(`from the key's release to the full picture, ${size} px: ${ms(rest)}`);
}

console.log("drawn by the server");
await full();
await measure();
console.log("drawn in the browser, by WebGL in software");
const began = Date.now();
await taken();
await page.getByRole("combobox", {name: "Drawn", exact: true}).selectOption("here");
await page.waitForFunction(() => window.pictures.length > 0);
console.log(`from the choice to the first picture: ${Date.now() - began} ms`);
await full();
await measure();
await browser.close();
