// A server that falls silent, and a stream that nobody wants any more; new_job_test.py starts it.

import assert from "node:assert/strict";
import {join} from "node:path";
import {openPage} from "./steps.mjs";

const {URL: url, JOB: job, PHOTOS: photos, SERVER: server} = process.env;

const {browser, page, step} = await openPage();
// The page's long waits, for a server that is silent, are short here.
await page.addInitScript(() => {
  const usual = window.setTimeout;
  window.setTimeout = (what, ms, ...more) => usual(what, ms > 15000 ? 3000 : ms, ...more);
});

const away = () => page.locator("#notice").getByText("the server cannot be reached; trying again").waitFor();
const back = () => page.waitForFunction(() => document.getElementById("notice").textContent === "");
const full = () => page.locator("canvas.stage[data-full=true]").waitFor();

// The server stands still, as behind a network that has gone, while `what` is done.
async function whileSilent(what) {
  process.kill(Number(server), "SIGSTOP");
  try {
    await what();
  } finally {
    process.kill(Number(server), "SIGCONT");
  }
}

// The first such request is never answered; how many there were.
async function silentAtFirst(path, method) {
  const asked = [];
  await page.route(path, (route) => {
    if (route.request().method() !== method) return route.continue();
    asked.push(route.request().url());
    return asked.length > 1 ? route.continue() : undefined;
  });
  return asked;
}

await step("a server that falls silent behind a job's page", async () => {
  await page.goto(`${url}/#/${job}`);
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
  await whileSilent(away);
  await back();
});

await step("a stream of events that is silent", async () => {
  const asked = await silentAtFirst(/\/events/, "GET");
  await page.reload();
  await away();
  await page.locator(".stages li").first().waitFor();
  await back();
  assert.equal(asked.length, 2);
});

await step("a file on its way to a server that is silent", async () => {
  await page.goto(`${url}/#/new`);
  await page.getByLabel("Iterations", {exact: true}).fill("20");
  await page.locator("#files").setInputFiles(["a.png", "b.png", "c.png"].map((name) => join(photos, name)));
  await page.getByText("3 photos,").waitFor();
  const asked = await silentAtFirst(/files\/b\.png/, "PUT");
  await page.getByRole("button", {name: "Upload and start"}).click();
  await away();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
  assert.equal(asked.length, 2);
});

await step("a picture that takes long, and one by a server that is silent", async () => {
  await page.goto(`${url}/#/${job}/scene`);
  await full();
  let go, looked = 0;
  const aborted = [], long = new Promise((ok) => { go = ok; });
  page.on("requestfailed", (request) => { if (/:renderView$/.test(request.url())) aborted.push(request); });
  await page.route(/\/v1\/serverInfo$/, (route) => {
    if (++looked > 2) go();
    return looked === 1 ? route.fulfill({status: 429, json: {
      code: 8, message: "busy", details: [{reason: "SERVER_BUSY"}]}}) : route.continue();
  });
  await page.route(/:renderView$/, async (route) => { await long; await route.continue(); });
  const before = await page.locator("canvas.stage").evaluate((c) => Number(c.dataset.drawn));
  await page.getByRole("button", {name: "Next photo"}).click();
  await page.waitForFunction((n) => Number(document.querySelector("canvas.stage").dataset.drawn) > n, before);
  await full();
  assert.deepEqual([aborted.length, looked > 2], [0, true]);
  await page.unrouteAll();
  await whileSilent(async () => {
    await page.getByRole("button", {name: "Next photo"}).click();
    await page.locator("#notice").getByText("the server cannot be reached").waitFor();
  });
  await full();
  await back();
});

await step("a video that cannot be encoded ends its stream", async () => {
  await page.goto(`${url}/#/${job}/scene`);
  await full();
  await page.evaluate(() => {
    window.VideoEncoder = class {
      state = "configured";
      encodeQueueSize = 0;
      configure() {}
      encode() { throw new Error("no such codec here"); }
      close() {}
    };
  });
  await page.getByText("A video of a way").click();
  for (let i = 0; i < 2; ++i) await page.getByRole("button", {name: "Add this place"}).click();
  await page.getByLabel("Seconds").fill("60");
  const ended = page.waitForEvent("requestfailed", (request) => /:renderPath$/.test(request.url()));
  await page.getByRole("button", {name: "Make a video"}).click();
  await page.locator("#notice").getByText("no such codec here").waitFor();
  await ended;
});

await browser.close();
process.exit(0);
