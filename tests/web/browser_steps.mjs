// What a user does on the page, one step after the other; browser_test.py starts it.

import assert from "node:assert/strict";
import {readFileSync, readdirSync, statSync} from "node:fs";
import {createRequire} from "node:module";
import {basename, join} from "node:path";
import {createInterface} from "node:readline";
import {chromium} from "playwright-core";
import {checked} from "./steps.mjs";

const {URL: url, TOKEN: token, SCREENSHOTS: folder, PATIENCE_MS: patience} = process.env;
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const answers = createInterface({input: process.stdin})[Symbol.asyncIterator]();

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM, args: ["--no-sandbox", "--disable-dev-shm-usage"],
});
const context = await browser.newContext({viewport: {width: 1280, height: 800}, bypassCSP: false});
const page = await context.newPage();
page.setDefaultTimeout(Number(patience));

// Nothing comes from elsewhere, nothing breaks the page's own rules.
const complaints = [];
let away = false;  // the server is restarting: failed requests are its own
page.on("request", (request) => {
  if (!/^(http:\/\/127\.0\.0\.1:|blob:|data:)/.test(request.url())) complaints.push(request.url());
});
page.on("pageerror", (error) => complaints.push(String(error)));
page.on("console", (message) => {
  // Answers that are errors are said to the user; the console repeats them.
  const known = /Failed to load resource|net::ERR/.test(message.text());
  if (message.type() === "error" && !known && !away) complaints.push(message.text());
});

async function check(name, sheet = page) {
  await sheet.screenshot({path: join(folder, `${name}.png`), fullPage: true});
  // Through the debugger, not as the page's script: its policy lets in no other.
  const session = await sheet.context().newCDPSession(sheet);
  const run = async (expression) => {
    const {result, exceptionDetails} = await session.send(
        "Runtime.evaluate", {expression, awaitPromise: true, returnByValue: true});
    assert.equal(exceptionDetails, undefined);
    return result.value;
  };
  await run(axe + "; undefined");
  const violations = JSON.parse(await run(
      "axe.run().then((r) => JSON.stringify(r.violations.map((v) => [v.id, v.nodes.map((n) => n.html)])))"));
  assert.deepEqual(violations, [], `axe finds violations on ${name}`);
  await session.detach();
}

// As a reader has it: from a disk, on a screen of either kind, and narrow.
async function checkReport(path) {
  for (const [name, width, colorScheme] of [["light", 1280, "light"], ["dark", 1280, "dark"],
                                            ["narrow", 360, "light"]]) {
    const reader = await browser.newContext({viewport: {width, height: 800}, colorScheme});
    const sheet = await reader.newPage();
    const asked = [];
    sheet.on("request", (request) => asked.push(request.url().slice(0, 15)));
    sheet.on("console", (message) => complaints.push(message.text()));
    await sheet.goto(`file://${path}`);
    assert.ok(asked.every((address) => /^(file:|data:image\/)/.test(address)), `${asked}`);
    const {wide, broken} = await sheet.evaluate(() => ({
      wide: document.documentElement.scrollWidth > innerWidth,
      broken: [...document.images].filter((image) => image.naturalWidth === 0).length,
    }));
    assert.deepEqual([wide, broken], [false, 0], name);
    await check(`report-${name}`, sheet);
    await reader.close();
  }
}

async function step(name, what) {
  console.log(name);
  await what();
  assert.deepEqual(complaints, []);
}

// As if the files were dropped: the page reads them from the event.
async function drop(path) {
  const files = readdirSync(path).map((name) => ({
    name: basename(name), bytes: [...readFileSync(join(path, name))],
    lastModified: Math.floor(statSync(join(path, name)).mtimeMs),
  }));
  const transfer = await page.evaluateHandle((list) => {
    const data = new DataTransfer();
    for (const {name, bytes, lastModified} of list) {
      data.items.add(new File([new Uint8Array(bytes)], name, {type: "image/png", lastModified}));
    }
    return data;
  }, files);
  await page.locator(".drop").dispatchEvent("drop", {dataTransfer: transfer});
}

const state = (text) => page.locator(".heading .state", {hasText: text}).waitFor();
const drawn = () => page.locator("canvas.stage").evaluate((c) => Number(c.dataset.drawn ?? 0));
const full = () => page.locator("canvas.stage[data-full=true]").waitFor();

// Until several pictures were drawn.
async function held(...keys) {
  const before = await drawn();
  for (const key of keys) await page.keyboard.down(key);
  await page.waitForFunction(
      (n) => Number(document.querySelector("canvas.stage").dataset.drawn) > n + 3, before);
  for (const key of keys) await page.keyboard.up(key);
}

async function redrawn(action) {
  await full();
  const before = await drawn();
  await action();
  await page.waitForFunction(
      (n) => Number(document.querySelector("canvas.stage").dataset.drawn) > n, before);
  await full();
}

await step("a wrong token", async () => {
  await page.goto(url);
  await page.getByLabel("Token").fill("wrong");
  await page.getByRole("button", {name: "Enter"}).click();
  await page.getByText("does not know this token").waitFor();
  await check("1-wrong-token");
});

await step("the right token", async () => {
  await page.getByLabel("Token").fill(token);
  await page.getByRole("button", {name: "Enter"}).click();
  await page.getByText("There are no jobs yet").waitFor();
  await page.getByText("alice").waitFor();
  assert.equal(await page.evaluate(() => document.cookie), "", "scripts can read the token");
  await check("2-no-jobs");
});

await step("photos of two folders with the same names", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await drop(process.env.PHOTOS);
  await drop(process.env.PHOTOS);
  await page.getByText("3 photos,").waitFor();
  await drop(process.env.SLOW);
  await page.getByText("Different files have the same name: b.png and 1 more.").waitFor();
  await page.getByText("6 photos,").waitFor();
  assert.ok(await page.getByRole("button", {name: "Upload and start"}).isDisabled());
  await check("2a-same-names");
  await page.getByRole("button", {name: "Remove the files"}).click();
  await page.getByText("No files yet").waitFor();
  assert.equal(await page.getByText("Different files").count(), 0);
});

await step("photos dropped", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await page.getByLabel("Iterations", {exact: true}).fill("200");
  await drop(process.env.PHOTOS);
  await page.getByText("3 photos").waitFor();
  await page.getByLabel("Title", {exact: true}).fill("By the browser");
  await page.getByText("All options").click();
  await page.getByLabel("Iterations between previews").fill("20");
  await page.getByText("shrink larger photos to this, px; 0: never").waitFor();
  await check("3-new-job");
  // One file's connection breaks more often than the page tries in a row, each time after more bytes.
  let broken = 0;
  const isOfA = (request) => request.postData()?.includes('"a.png"');
  await page.route(/files:query$/, (route) => broken < 10 && isOfA(route.request())
    ? route.fulfill({json: checked("QueryUploadResponse", {files: [{offset: String(++broken)}]})})
    : route.continue());
  await page.route(/files\/a\.png/, (route) =>
      route.request().headers()["content-range"] ? route.abort() : route.continue());
  await page.getByRole("button", {name: "Upload and start"}).click();
  await page.getByRole("heading", {name: "By the browser"}).waitFor();
  assert.equal(broken, 10);
  await page.unrouteAll();
});

await step("its end", async () => {
  await state("succeeded");
  await page.locator(".compare:visible").waitFor();
  await page.getByText("3 of 3", {exact: true}).waitFor();
  await page.getByText("Log", {exact: true}).click();
  await page.getByText("a program says").first().waitFor();
  await page.getByText("Photos", {exact: true}).click();
  await page.locator(".photos").getByText("a.png").waitFor();
  await page.getByRole("slider").press("ArrowRight");
  await page.locator(".chart .curve").first().waitFor();
  await check("4-job");
});

await step("another photo's place while pictures of one are drawn", async () => {
  // The last snapshot's pictures are there, and none follow by themselves.
  await page.locator("section[aria-label=Pictures]").getByText("iteration 200.").waitFor();
  const asked = [];
  let chosen;
  const both = new Promise((ok) => { chosen = ok; });
  await page.route(/\/view\?/, async (route) => {
    const query = new URL(route.request().url()).searchParams;
    asked.push(`${query.get("pose.camera")} ${query.get("settings.channel")}`);
    await both;
    await route.continue();
  });
  const place = page.getByLabel("From the place of photo");
  await place.selectOption("b.png");
  await place.selectOption("c.png");
  const last = page.waitForResponse(/view\?pose\.camera=c\.png&settings\.channel=CHANNEL_COLOR/);
  chosen();
  await last;
  assert.deepEqual(asked, ["b", "c"].flatMap((name) => ["ORIGINAL", "COLOR"].map(
      (channel) => `${name}.png CHANNEL_${channel}`)));
  await page.unrouteAll();
});

// Of a curve with these values, one each 100 iterations: its heights, px, and the numbers of its axis.
const drawnCurve = (values) => page.evaluate(async (all) => {
  const {chart} = await import("/chart.js");
  const {element, show} = chart("PSNR", "dB");
  show(all.map((y, i) => ({x: 100 * i, y})));
  return {
    heights: element.querySelector(".curve").getAttribute("points").split(" ").map((p) => -Number(p.split(",")[1])),
    numbers: [...element.querySelectorAll(".tick.end")].map((text) => text.textContent),
  };
}, values);

await step("curves that rise, or hardly", async () => {
  const {heights} = await drawnCurve(Array.from({length: 120}, (_, i) => 20 + i / 20));
  assert.ok(heights.at(-1) > heights.at(-2), "the newest value is cut off");
  for (const values of [[24.31], [24.31, 24.3102], [24.31, 24.34]]) {
    const {numbers} = await drawnCurve(values);
    assert.ok(numbers.length > 1, `${numbers}`);
    assert.equal(new Set(numbers).size, numbers.length, `${numbers}`);
  }
});

await step("a file to take along", async () => {
  await page.getByLabel("Format").selectOption("SPZ");
  const [download] = await Promise.all([
    page.waitForEvent("download"), page.getByRole("link", {name: "Download"}).click()]);
  assert.equal(download.suggestedFilename(), "By the browser.spz");
  assert.ok(readFileSync(await download.path()).length > 600000);
});

await step("a report to file", async () => {
  const [download] = await Promise.all([
    page.waitForEvent("download"), page.getByRole("link", {name: "Report"}).click()]);
  assert.equal(download.suggestedFilename(), "By the browser.html");
  const report = join(folder, "report.html");
  await download.saveAs(report);
  await checkReport(report);
});

// By the mouse and by a key; the length of one distance gives that of the next.
async function measured() {
  const units = () => page.locator("output").textContent();
  await page.getByLabel("Measure a distance").check();
  const box = await page.locator("canvas.stage").boundingBox();
  await page.mouse.click(box.x + 0.45 * box.width, box.y + 0.5 * box.height);
  await page.getByText("Click the second point").waitFor();
  await page.locator("canvas.stage").press("m");
  await page.getByText("units of the scene", {exact: false}).first().waitFor();
  assert.ok(Number.parseFloat(await units()) > 0, await units());
  await page.locator(".measure circle").nth(1).waitFor();
  const marks = await page.locator(".measure circle").evaluateAll(
      (circles) => circles.map((c) => [c.cx.baseVal.value, c.cy.baseVal.value]));
  for (const [i, share] of [0.45, 0.5].entries()) {  // where they were marked
    assert.ok(Math.abs(marks[i][0] - share * box.width) < 1, `${marks} of ${box.width}`);
    assert.ok(Math.abs(marks[i][1] - 0.5 * box.height) < 1, `${marks} of ${box.height}`);
  }
  await page.getByLabel("Its length").fill("2");
  await page.getByLabel("Its length").press("Tab");
  await page.getByText("2.000 m", {exact: true}).waitFor();
  await measuredWhileItMoves();
}

// The same point twice; the second time the camera has moved before the answer comes.
async function measuredWhileItMoves() {
  const stage = page.locator("canvas.stage");
  await stage.press("m");
  await page.getByText("Click the second point").waitFor();
  let moved;
  const move = new Promise((ok) => { moved = ok; });
  await page.route(/:renderView$/, async (route) => {
    if (route.request().postData().includes("RAW_FLOAT")) await move;
    await route.continue();
  });
  await stage.press("m");
  await redrawn(() => stage.press("w"));
  moved();
  await page.getByText("0.000 m", {exact: true}).waitFor();
  await page.unrouteAll();
}

await step("through the scene", async () => {
  await page.getByRole("link", {name: "Fly through"}).click();
  await full();
  await redrawn(() => page.getByLabel(/^Light/).fill("0.5"));
  await redrawn(() => page.getByLabel(/^Exposure/).fill("1"));
  await redrawn(() => page.getByRole("combobox", {name: "Show", exact: true}).selectOption("CHANNEL_DEPTH"));
  assert.ok(await page.getByLabel(/^Light/).isDisabled());
  await redrawn(() => page.getByRole("combobox", {name: "Show", exact: true}).selectOption("CHANNEL_LIGHT"));
  await redrawn(() => page.getByRole("button", {name: "Next photo"}).click());
  assert.equal(await page.getByLabel("Photo's place").inputValue(), "b.png");
  await redrawn(() => page.locator("canvas.stage").press("w"));
  assert.equal(await page.getByLabel("Photo's place").inputValue(), "");
  await redrawn(() => held("w"));
  await redrawn(() => held("Shift", "Equal"));  // "+", of which Shift is let go first
  const before = await drawn();
  await page.waitForTimeout(500);
  assert.equal(await drawn(), before, "the camera flies on");
  await redrawn(async () => {
    const box = await page.locator("canvas.stage").boundingBox();
    await page.mouse.move(box.x + 100, box.y + 100);
    await page.mouse.down();
    await page.mouse.move(box.x + 200, box.y + 120, {steps: 5});
    await page.mouse.up();
    await page.mouse.wheel(0, 300);
  });
  await measured();
  await redrawn(() => page.getByLabel("Show where photos").check());
  await page.locator(".outlines path").first().waitFor();
  await check("5-scene");
});

await step("a full picture that is refused", async () => {
  let busy = true;
  await page.route(/:renderView$/, (route) => {
    if (!busy || !route.request().postData().includes('"jpegQuality":92')) return route.continue();
    return route.fulfill({status: 503, json: {code: 14, message: "the server is busy"}});
  });
  await page.getByRole("button", {name: "Next photo"}).click();
  await page.getByText("the server is busy").waitFor();
  busy = false;
  await full();
  assert.equal(await page.locator("#notice").textContent(), "");
  await page.unrouteAll();
});

await step("a video of a way through the scene", async () => {
  await page.getByText("A video of a way").click();
  await page.getByRole("button", {name: "Add this place"}).click();
  assert.ok(await page.getByRole("button", {name: "Make a video"}).isDisabled());
  await redrawn(() => page.getByRole("button", {name: "Next photo"}).click());
  await page.getByRole("button", {name: "Add this place"}).click();
  await page.getByText("2 places").waitFor();
  await page.getByLabel("Seconds").fill("3");
  await page.getByRole("button", {name: "Make a video"}).click();
  const [download] = await Promise.all([
    page.waitForEvent("download"), page.getByRole("link", {name: "Save the video"}).click()]);
  assert.equal(download.suggestedFilename(), "By the browser.webm");
  await check("5-tour");
  const player = await browser.newPage();
  const played = await player.evaluate(async (source) => {
    const video = document.createElement("video");
    video.src = source;
    await new Promise((ok, no) => { video.onloadeddata = ok; video.onerror = () => no(video.error); });
    video.currentTime = 2.5;  // behind the second key picture
    await new Promise((ok) => { video.onseeked = ok; });
    return [video.videoWidth, video.videoHeight, video.duration];
  }, `data:video/webm;base64,${readFileSync(await download.path(), "base64")}`);
  await player.close();
  assert.deepEqual(played, [1280, 720, 3]);
});

await step("what is found before the start", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await drop(process.env.DOUBTFUL);
  await page.getByLabel("Title", {exact: true}).fill("Looked at first");
  await page.getByLabel("Iterations", {exact: true}).fill("50");
  await page.getByRole("button", {name: "Upload and look first"}).click();
  await page.getByText("3 photos are of use, 1 left out; 96\u00d772 px; 35 mm").waitFor();
  const row = (name) => page.getByRole("row", {name}).innerText();
  assert.match(await row("d.png"), /35 mm\s+1\/30 s, f\/1.8, ISO 800\s+[+\u2212]?\d\.\d\s+\d\.\d\d\s+used/);
  assert.match(await row("f copy.png"), /left out: it is the same photo as f\.png/);
  await check("5a-found");
  await page.getByRole("button", {name: "Start"}).click();
  await state("succeeded");
  await page.getByRole("button", {name: "Delete"}).click();
  await page.getByRole("dialog").getByRole("button", {name: "Delete"}).click();
  await page.getByRole("heading", {name: "Jobs"}).waitFor();
});

await step("a video dropped", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await drop(process.env.PHOTOS);
  await page.getByText("3 photos").waitFor();
  assert.equal(await page.getByLabel("Frames of the video").isVisible(), false);
  await drop(process.env.VIDEO);
  await page.getByText("A job takes one video, or photos").waitFor();
  assert.ok(await page.getByRole("button", {name: "Upload and start"}).isDisabled());
  await page.getByRole("button", {name: "Remove the files"}).click();
  await drop(process.env.VIDEO);
  await page.getByText("1 video,").waitFor();
  await page.getByLabel("Frames of the video").fill("7");
  await page.getByLabel("Iterations", {exact: true}).fill("50");
  // Without a title, a job is called as its only file.
  assert.equal(await page.getByLabel("Title", {exact: true}).getAttribute("placeholder"), readdirSync(process.env.VIDEO)[0]);
  await check("5b-new-video");
  await page.getByRole("button", {name: "Upload and look first"}).click();
  await page.getByRole("heading", {name: readdirSync(process.env.VIDEO)[0]}).waitFor();
  await page.getByText(/A video of 96\u00d772 px, .*9 frames: its sharpest frames/).waitFor();
  await page.getByRole("button", {name: "Start"}).click();
  await state("succeeded");
  await page.getByText("7 of 7", {exact: true}).waitFor();
  await page.getByRole("button", {name: "Delete"}).click();
  await page.getByRole("dialog").getByRole("button", {name: "Delete"}).click();
  await page.getByRole("heading", {name: "Jobs"}).waitFor();
});

await step("a server that ends in the middle", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await page.getByLabel("Iterations", {exact: true}).fill("20000");
  await page.getByText("All options").click();
  await page.getByLabel("Iterations between checkpoints").fill("20");
  await drop(process.env.SLOW);
  await page.getByLabel("Title", {exact: true}).fill("Slow");
  await page.getByRole("button", {name: "Upload and start"}).click();
  await state("running");
  away = true;
  console.log("RESTART");
  await answers.next();
  await state("running");
  await page.waitForFunction(() => document.getElementById("notice").textContent === "");
  away = false;
  const value = () => page.locator(".job progress").first().evaluate((p) => p.value);
  const before = await value();
  await page.waitForFunction((v) => document.querySelector(".job progress").value > v, before);
  await check("6-running");
});

await step("cancel", async () => {
  await page.getByRole("button", {name: "Cancel"}).click();
  await state("cancelled");
  await page.getByRole("button", {name: "Resume"}).waitFor();
});

await step("resume", async () => {
  await page.getByText("Log", {exact: true}).click();
  await page.locator(".log li").first().waitFor();
  await page.waitForTimeout(1500);  // the streams have ended
  const before = await page.locator(".log li").count();
  const stages = await page.locator(".stages li").count();
  // The first streams after it fail.
  let failing = true;
  await page.route(/\/events/, (route) => !failing ? route.continue() : route.fulfill({
    contentType: "text/event-stream",
    body: 'event: failure\ndata: {"code": 14, "message": "the store is away"}\n\n'}));
  await page.getByRole("button", {name: "Resume"}).click();
  await page.getByText("the store is away").waitFor();
  failing = false;
  await page.waitForFunction((n) => {
    const shown = [...document.querySelectorAll(".stages li")];
    return shown.length > n && /^training/.test(shown.at(-1).textContent);
  }, stages);
  await page.waitForFunction((n) => document.querySelectorAll(".log li").length > n, before);
  await page.unrouteAll();
  assert.doesNotMatch(await page.locator(".stages").innerText(), /cancelled/);
  await check("6a-resumed");
});

await step("more hidden pages than a browser has connections", async () => {
  const address = page.url(), others = [];
  for (let i = 0; i < 7; ++i) {
    const other = await context.newPage();
    other.setDefaultTimeout(Number(patience));
    await other.goto(address);
    await other.locator(".chart .curve").first().waitFor();  // which a hidden page would not get
    await other.evaluate(() => {
      Object.defineProperty(document, "hidden", {get: () => true, configurable: true});
      document.dispatchEvent(new Event("visibilitychange"));
    });
    others.push(other);
  }
  // Seen again, it goes on.
  const [first] = others;
  const curve = () => first.locator(".chart .curve").first().getAttribute("points");
  const before = await curve();
  await first.evaluate(() => {
    delete document.hidden;
    document.dispatchEvent(new Event("visibilitychange"));
  });
  await first.waitForFunction(
      (points) => document.querySelector(".chart .curve").getAttribute("points") !== points, before);
  for (const other of others) await other.close();
  await page.getByRole("button", {name: "Cancel"}).click();
  await state("cancelled");
});

await step("the list, on a phone", async () => {
  await page.setViewportSize({width: 360, height: 740});
  await page.getByRole("link", {name: "Jobs"}).first().click();
  await page.locator(".card").nth(1).waitFor();
  await page.locator(".thumbnail img:visible").first().waitFor();
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 360, `the page is ${wide} px wide`);
  await check("7-phone-list");
  await page.getByLabel("Title contains").fill("browser");
  await page.waitForFunction(() => document.querySelectorAll(".card").length === 1);
  await page.getByRole("link", {name: "By the browser"}).click();
  await page.locator(".compare:visible").waitFor();
  await check("8-phone-job");
  await page.getByRole("link", {name: "Fly through"}).click();
  await full();
  await check("9-phone-scene");
});

await step("a job deleted while it is looked at", async () => {
  await page.getByRole("link", {name: "Job", exact: true}).click();
  await page.getByRole("button", {name: "Delete"}).click();
  await page.getByRole("dialog").getByRole("button", {name: "Delete"}).click();
  await page.getByRole("heading", {name: "Jobs"}).waitFor();
  await page.getByRole("link", {name: "Slow"}).waitFor();
  assert.equal(await page.getByRole("link", {name: "By the browser"}).count(), 0);
});

await step("leave", async () => {
  await page.getByRole("button", {name: "Leave"}).click();
  await page.getByLabel("Token").waitFor();
  await page.reload();
  await page.getByLabel("Token").waitFor();
});

await browser.close();
process.exit(0);
