// What the page says of a job, and of many, step by step; new_job_test.py starts it.

import assert from "node:assert/strict";
import {checked, openPage} from "./steps.mjs";

const {URL: url, JOB: job} = process.env;

const {browser, page, step} = await openPage();

const said = (text) => page.locator("#notice").getByText(text).waitFor();
const newJob = (displayName) => page.evaluate(async (displayName) => {
  const answer = await fetch("/v1/jobs", {method: "POST", body: JSON.stringify({displayName})});
  return (await answer.json()).name;
}, displayName);

await step("a file that cannot be made says why", async () => {
  await page.goto(`${url}/#/${job}`);
  await page.locator(".stages li").first().waitFor();
  for (const [path, name] of [[/\/model\?/, "Download"], [/\/report$/, "Report"]]) {
    await page.route(path, (route) => route.fulfill({status: 400, json: {code: 9, message: `no ${name} today`}}));
    await page.getByRole("link", {name}).press("Enter");  // pictures that come move it from under a mouse
    await said(`no ${name} today`);
    await page.getByRole("link", {name, exact: true}).waitFor();
  }
});

await step("a refusal is seen from the end of the page", async () => {
  const usual = page.viewportSize();
  await page.setViewportSize({width: 390, height: 800});
  await page.route(/\/model\?/, (route) => route.fulfill({status: 400, json: {code: 9, message: "no scene today"}}));
  await page.locator(".compare:visible").waitFor();
  await page.evaluate(() => window.scrollTo(0, document.documentElement.scrollHeight));
  assert.ok(await page.evaluate(() => window.scrollY) > 100);
  await page.getByRole("link", {name: "Download"}).press("Enter");
  await said("no scene today");
  const {y, height} = await page.locator("#notice").boundingBox();
  assert.ok(y >= 0 && y + height <= 800, `the notice is at ${y}`);
  await page.setViewportSize(usual);
});

await step("another photo's place whose picture does not come at once", async () => {
  const picture = page.locator(".compare img").first(), before = await picture.getAttribute("src");
  let broken = 0;
  await page.route(/\/view\?pose\.camera=b/, (route) => ++broken > 1 ? route.continue() : route.abort());
  await page.getByLabel("From the place of photo").selectOption("b.png");
  await page.waitForFunction((src) => document.querySelector(".compare img").getAttribute("src") !== src, before);
  assert.ok(broken > 1);
});

await step("what a finished job shows stays where it is", async () => {
  await page.route(new RegExp(`${job}$`), async (route) => {
    const answer = await (await route.fetch()).json();
    answer.report.notes = ["a note"];
    await route.fulfill({json: checked("Job", answer)});
  });
  const refreshed = () => page.waitForResponse(new RegExp(`${job}$`));
  await page.locator(".notes").getByText("a note").waitFor();
  const parts = await Promise.all([".notes li", ".stages li"].map(
      (part) => page.locator(part).first().elementHandle()));
  const title = await page.evaluateHandle(() => document.querySelector("h1").firstChild);
  for (let i = 0; i < 3; ++i) await refreshed();  // the third answer follows what the second one has shown
  for (const part of [...parts, title]) assert.ok(await part.evaluate((node) => node.isConnected));
});

await step("the log stays where one reads it", async () => {
  let go, asked = 0;
  const more = new Promise((ok) => { go = ok; });
  const time = "2026-01-01T00:00:00Z";
  const entry = (i) => `id: ${i}\ndata: ${JSON.stringify(
      checked("LogEntry", {number: i, time, text: `line ${i}`}))}\n\n`;
  const first = Array.from({length: 60}, (_, i) => entry(i)).join(""), last = `${entry(60)}event: end\ndata: {}\n\n`;
  await page.route(/\/log\?/, async (route) => {
    if (++asked > 1) await more;
    await route.fulfill({contentType: "text/event-stream", body: `retry: 10\n\n${asked > 1 ? last : first}`});
  });
  const log = page.locator(".log");
  await page.getByText("Log", {exact: true}).click();
  await log.getByText("line 59").waitFor();
  assert.ok(await log.evaluate((lines) => lines.scrollHeight - lines.clientHeight - lines.scrollTop < 2));
  await log.evaluate((lines) => { lines.scrollTop = 0; });
  go();
  await log.getByText("line 60").waitFor();
  assert.equal(await log.evaluate((lines) => lines.scrollTop), 0);
});

await step("photos of two pages of the server's list", async () => {
  await page.route(/\/files\?/, (route) => {
    const name = new URL(route.request().url()).searchParams.get("pageToken") ? "z.png" : "y.png";
    return route.fulfill({json: checked("ListFilesResponse", {
      files: [{fileName: name, role: "FILE_ROLE_PHOTO", width: 96, height: 72}],
      nextPageToken: name === "y.png" ? "next" : ""})});
  });
  await page.getByText("Photos", {exact: true}).click();
  for (const name of ["y.png", "z.png"]) await page.getByRole("row", {name}).waitFor();
  await page.getByText("2 photos are of use").waitFor();
});

await step("what is spoken of a job: its state, not each step of it", async () => {
  assert.deepEqual(await page.locator(".heading .state, .standing").evaluateAll((parts) => parts.map(
      (part) => part.closest("[aria-live]")?.className)), ["state", undefined]);
});

await step("formats that plain 3DGS does not have", async () => {
  const offered = () => page.getByLabel("Format").locator("option:enabled").allTextContents();
  assert.ok((await offered()).includes("PLY, all attributes"));
  await page.route(new RegExp(`${job}$`), async (route) => {
    const answer = await (await route.fetch()).json();
    answer.options.method = "METHOD_3DGS";
    await route.fulfill({json: checked("Job", answer)});
  });
  await page.locator("option[value=PLY_FULL]:disabled").waitFor({state: "attached"});
  assert.deepEqual((await offered()).slice(0, 2), ["PLY, normally lit", "SPZ"]);
  assert.ok(!(await offered()).includes("PLY, all attributes"));
});

await step("the photo before somewhere else is the last", async () => {
  await page.getByRole("link", {name: "Fly through"}).click();
  const place = page.getByLabel("Photo's place");
  await place.selectOption("somewhere else");
  await page.getByRole("button", {name: "Previous photo"}).click();
  assert.equal(await place.inputValue(), "c.png");
  await page.getByRole("button", {name: "Next photo"}).click();
  assert.equal(await place.inputValue(), "a.png");
});

await step("an encoder of videos that fails says why", async () => {
  await page.evaluate(() => {
    window.VideoEncoder = class {
      state = "unconfigured";
      encodeQueueSize = 0;
      constructor({error}) { this.fail = error; }
      configure() {
        this.state = "closed";
        window.setTimeout(() => this.fail(new Error("no such codec here")), 0);
      }
      encode() { throw new Error("closed codec"); }
      close() {}
    };
  });
  await page.getByText("A video of a way").click();
  for (let i = 0; i < 2; ++i) await page.getByRole("button", {name: "Add this place"}).click();
  await page.getByRole("button", {name: "Make a video"}).click();
  await page.waitForFunction(() => /codec/.test(document.getElementById("notice").textContent));
  assert.equal(await page.locator("#notice").textContent(), "no such codec here");
});

await step("a key that is let go before the next frame moves the camera", async () => {
  await page.goto(`${url}/#/`);
  assert.equal(await page.evaluate(async () => {
    const {control} = await import("/controls.js");
    const element = document.createElement("canvas");
    let forward = 0;
    control(element, {move: (x, y, z) => { forward += z; }, orbit: () => {}}, () => {});
    for (const kind of ["keydown", "keyup"]) element.dispatchEvent(new KeyboardEvent(kind, {key: "w", code: "KeyW"}));
    return forward > 0;
  }), true);
});

await step("a scene that one has left listens no more", async () => {
  await page.goto(`${url}/#/`);
  assert.deepEqual(await page.evaluate(async () => {
    const {control} = await import("/controls.js");
    const element = document.createElement("canvas");
    let moved = 0;
    const end = control(element, {dolly: () => {}}, () => { ++moved; });
    const roll = () => { element.dispatchEvent(new WheelEvent("wheel", {deltaY: 1})); return moved; };
    const before = roll();
    end();
    return [before, roll()];
  }), [1, 1]);
});

await step("pictures that nobody sees any more are given back", async () => {
  const nowhere = async () => {
    await page.goto(`${url}/#/new`);
    await page.getByRole("heading", {name: "New job"}).waitFor();
  };
  await page.goto("about:blank");  // ends the list: a job's picture that it awaits would be kept
  await nowhere();
  await page.evaluate(() => {
    const made = window.made = new Set(), {createObjectURL, revokeObjectURL} = URL;
    URL.createObjectURL = (blob) => {
      const address = createObjectURL.call(URL, blob);
      made.add(address);
      return address;
    };
    URL.revokeObjectURL = (address) => {
      made.delete(address);
      revokeObjectURL.call(URL, address);
    };
  });
  for (const [address, shown] of [[job, ".compare"], [`${job}/scene`, "a[download$='.jpg']"]]) {
    await page.goto(`${url}/#/${address}`);
    await page.locator(shown).waitFor();
    assert.ok(await page.evaluate(() => window.made.size) > 0);
    await nowhere();
    // One that was on its way goes when it has come.
    await page.waitForFunction(() => window.made.size === 0);
  }
  // The second of two.
  await page.route(/CHANNEL_COLOR/, (route) => route.abort());
  const failed = page.waitForEvent("requestfailed", (request) => request.url().includes("CHANNEL_COLOR"));
  await page.goto(`${url}/#/${job}`);
  await failed;
  await page.waitForFunction(() => window.made.size === 0);
  await nowhere();
});

await step("a video that comes while one looks", async () => {
  const name = await newJob("waits for a video");
  await page.goto(`${url}/#/${name}`);
  await page.getByText("There are no photos.").waitFor();
  await page.route(/\/files\?/, (route) => route.fulfill({json: checked("ListFilesResponse", {
    files: [{fileName: "v.mp4", role: "FILE_ROLE_VIDEO", width: 96, height: 72}]})}));
  await page.getByText("A video of 96\u00d772 px").waitFor();
});

await step("a clone of a job with a title of 200 bytes", async () => {
  const moon = "\u{1f319}";
  await page.goto(`${url}/#/${await newJob(moon.repeat(50))}`);
  await page.getByRole("button", {name: "Clone"}).click();
  await page.getByRole("heading", {name: `${moon.repeat(48)} (copy)`}).waitFor();
});

await step("more jobs than the server lists at once", async () => {
  const asked = [];
  await page.route(/\/v1\/jobs\?/, (route) => {
    const query = new URL(route.request().url()).searchParams;
    const size = Number(query.get("pageSize")), token = query.get("pageToken");
    asked.push(size);
    const jobs = Array.from({length: size}, (_, i) => ({name: `jobs/j${token}${i}`, state: "JOB_STATE_CANCELLED"}));
    return route.fulfill({json: checked("ListJobsResponse", {jobs, nextPageToken: `${token}x`})});
  });
  await page.goto(`${url}/#/`);
  await page.getByRole("button", {name: "Show more"}).waitFor();
  await page.evaluate(() => {
    const more = [...document.querySelectorAll("button")].find((b) => b.textContent === "Show more");
    for (let i = 0; i < 20; ++i) more.click();
  });
  await page.waitForFunction(() => document.querySelectorAll(".card").length === 1050);
  assert.ok(asked.every((size) => size <= 1000), `${asked}`);
});

await browser.close();
process.exit(0);
