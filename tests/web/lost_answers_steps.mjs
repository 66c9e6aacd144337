// Answers of the server that do not arrive, or come late; new_job_test.py starts it.

import assert from "node:assert/strict";
import {join} from "node:path";
import {checked, openPage} from "./steps.mjs";

const {URL: url, JOB: job, PHOTOS: photos} = process.env;

const {browser, page, step} = await openPage();

const said = (text) => page.locator("#notice").getByText(text).waitFor();
const start = page.getByRole("button", {name: "Upload and start"});
const title = page.getByLabel("Title", {exact: true});
const choose = (...names) => page.locator("#files").setInputFiles(names.map((name) => join(photos, name)));
// How many jobs have this title.
const jobsOf = (displayName) => page.evaluate(async (displayName) => {
  const {jobs = []} = await (await fetch("/v1/jobs?pageSize=1000")).json();
  return jobs.filter((job) => job.displayName === displayName).length;
}, displayName);

// A page for a new job, with these photos.
async function newJob(displayName, ...names) {
  await page.goto(`${url}/#/new`);
  await page.reload();
  await page.getByLabel("Iterations", {exact: true}).fill("20");
  await title.fill(displayName);
  await choose(...names);
  await page.getByText(`${names.length} photos,`).waitFor();
}

// The server gets the first such call, the page no answer to the first `times`.
async function loseAnswers(path, times) {
  const calls = [];
  await page.route(path, async (route) => {
    if (route.request().method() !== "POST" || calls.length === times) return route.continue();
    calls.push(route.request().postData());
    if (calls.length === 1) await route.fetch();
    return route.abort();
  });
  return calls;
}

// Such calls wait: `asked` is there once one was made, release(how) answers them.
async function hold(path, method) {
  let told, released = false;
  const held = [], asked = new Promise((ok) => { told = ok; });
  await page.route(path, (route) => {
    if (released || route.request().method() !== method) return route.continue();
    held.push(route);
    return told();
  });
  return {asked, release: async (how = (route) => route.continue()) => {
    released = true;
    await Promise.all(held.map((route) => how(route)));
  }};
}

// Until the page gives up, without pauses between its attempts, which are at most 15 s.
async function startInVain() {
  await page.evaluate(() => {
    window.patient = window.setTimeout;
    window.setTimeout = (what, ms) => window.patient(what, ms > 15000 ? ms : 0);
  });
  await start.click();
  await page.locator(".result").getByText("the server cannot be reached").waitFor();
  await page.evaluate(() => { window.setTimeout = window.patient; });
}

await step("a job and its start whose answers are lost", async () => {
  await newJob("Lost", "a.png", "b.png", "c.png");
  const made = await loseAnswers(/\/v1\/jobs$/, 1);
  const started = await loseAnswers(/:start$/, 9);  // as often as the page tries
  await startInVain();
  assert.deepEqual([made.length, started.length], [1, 9]);
  await start.click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
  assert.equal(await jobsOf("Lost"), 1);
});

await step("a start that is refused, and one more photo", async () => {
  await newJob("Few", "a.png", "b.png");
  for (let i = 0; i < 2; ++i) {
    await start.click();
    await page.locator(".result").getByText("3").waitFor();
  }
  assert.equal(await jobsOf("Few"), 1);
  await choose("c.png");
  await page.getByText("3 photos,").waitFor();
  await start.click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
  while (await jobsOf("Few") > 1) await page.waitForTimeout(50);  // the first one goes
});

await step("a start whose answer is lost, and another form", async () => {
  await newJob("Ran", "a.png", "b.png", "c.png");
  await loseAnswers(/:start$/, 9);
  await startInVain();
  await title.fill("Ran too");
  await start.click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
  assert.deepEqual([await jobsOf("Ran"), await jobsOf("Ran too")], [1, 1]);
});

await step("titles that the server would not take", async () => {
  await newJob("\u0436".repeat(120), "a.png", "b.png", "c.png");
  await start.click();
  await page.getByRole("heading", {name: "\u0436".repeat(100), exact: true}).waitFor();
  await page.goto(`${url}/#/new`);
  await page.evaluate(() => {
    const path = "/my\u202a odd\t\u2028folder\u2069", children = [[{
      isFile: true, fullPath: `${path}/a.jpg`, file: (ok) => ok(new File(["x"], "a.jpg"))}], []];
    const entry = {isFile: false, fullPath: path, createReader: () => ({readEntries: (ok) => ok(children.shift())})};
    const event = new Event("drop", {cancelable: true});
    event.dataTransfer = {items: [{webkitGetAsEntry: () => entry, getAsFile: () => null}]};
    document.querySelector(".drop").dispatchEvent(event);
  });
  await page.getByText("1 photo,").waitFor();
  assert.equal(await title.getAttribute("placeholder"), "my oddfolder");
});

await step("nothing is changed or left by mistake during an upload", async () => {
  await newJob("Kept", "a.png", "b.png", "c.png");
  const {asked, release} = await hold(/files:query$/, "POST");
  const dialogs = [], choosers = [];
  const dismiss = (dialog) => { dialogs.push(dialog.type()); return dialog.dismiss(); };
  const chooser = (opened) => choosers.push(opened);
  page.on("dialog", dismiss);
  page.on("filechooser", chooser);
  await start.click();
  await asked;
  const drop = () => page.evaluate(() => {
    const event = new Event("drop", {cancelable: true});
    event.dataTransfer = {items: [{webkitGetAsEntry: () => null, getAsFile: () => new File(["x"], "e.png")}]};
    document.querySelector(".drop").dispatchEvent(event);
  });
  const picked = {name: "d.png", mimeType: "image/png", buffer: Buffer.from("x")};
  for (const change of [drop, () => page.locator("#files").setInputFiles(picked),
                        () => page.getByText("Choose files").click(), () => page.getByText("Choose a folder").click(),
                        () => page.getByRole("button", {name: "Remove the files"}).click()]) {
    await page.evaluate(() => { document.getElementById("notice").textContent = ""; });
    await change();
    await said("wait until the upload has ended");
  }
  for (const control of [title, page.getByLabel("Iterations", {exact: true})]) assert.ok(await control.isDisabled());
  await page.evaluate(() => { window.setTimeout(() => location.reload()); });
  while (dialogs.length < 1) await page.waitForTimeout(50);
  await page.getByRole("link", {name: "Jobs", exact: true}).click();
  while (dialogs.length < 2) await page.waitForTimeout(50);
  await page.waitForFunction(() => location.hash === "#/new");
  assert.equal(await title.inputValue(), "Kept");
  await page.getByText("3 photos,").waitFor();
  await release();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
  assert.equal(await jobsOf("Kept"), 1);
  await page.reload();
  assert.deepEqual([dialogs, choosers], [["beforeunload", "confirm"], []]);
  page.off("dialog", dismiss);
  page.off("filechooser", chooser);
});

await step("leaving during an upload ends it", async () => {
  await newJob("Left", "a.png", "b.png", "c.png");
  const {asked, release} = await hold(/files:query$/, "POST");
  const sent = [];
  const listen = (request) => {
    if (/\/files\/|:start$/.test(request.url())) sent.push(request.url());
  };
  await start.click();
  await asked;
  page.on("request", listen);
  const asks = page.waitForEvent("dialog").then((dialog) => dialog.accept());
  await page.getByRole("link", {name: "Jobs", exact: true}).click();
  await asks;
  await page.getByRole("heading", {name: "Jobs"}).waitFor();
  await release();
  await page.waitForTimeout(500);  // what would follow is sent at once
  page.off("request", listen);
  assert.deepEqual(sent, []);
  const {name, state} = await page.evaluate(async () => {
    const {jobs} = await (await fetch("/v1/jobs?pageSize=1000")).json();
    return jobs.find((job) => job.displayName === "Left");
  });
  assert.equal(state, "JOB_STATE_UPLOADING");
  // Its page knows how many were to come, and asks before a start without them.
  await page.goto(`${url}/#/${name}`);
  await page.getByText("0 of 3 photos have come").waitFor();
  const started = [], starts = (request) => { if (/:start$/.test(request.url())) started.push(request.url()); };
  page.on("request", starts);
  for (const answer of ["dismiss", "accept"]) {
    const asked = page.waitForEvent("dialog").then(async (dialog) => {
      assert.equal(dialog.message(), "0 of 3 photos have come. Start without the others?");
      assert.deepEqual(started, []);
      await dialog[answer]();
    });
    await page.getByRole("button", {name: "Start", exact: true}).click();
    await asked;
  }
  await said(/photos/);
  assert.equal(started.length, 1);
  page.off("request", starts);
});

await step("answers that come after leaving change nothing", async () => {
  await page.goto(`${url}/#/${job}`);
  const heading = (name) => page.getByRole("heading", {name, exact: true}).waitFor();
  await heading("by HTTP");
  const about = (path) => new RegExp(`${job}${path}(\\?|$)`);
  // From the page that asks for `path` to `next`, before it is answered.
  const leave = async (path, from, next) => {
    const {asked, release} = await hold(about(path), "GET");
    await page.goto(`${url}/#/${from}`);
    await asked;
    await page.getByRole("link", {name: next, exact: true}).first().click();
    await heading(next === "Jobs" ? "Jobs" : "New job");
    return release;
  };
  let release = await leave("", job, "Jobs");
  await release();
  await page.waitForTimeout(200);
  assert.equal(await page.title(), "Jobs - litags");
  const none = async (path, from) => {
    release = await leave(path, from, "New job");
    await release((route) => route.abort());
    await page.waitForTimeout(200);
    assert.equal(await page.locator("#notice").textContent(), "", `of ${from}`);
  };
  await none("", job);
  await none("/cameras", `${job}/scene`);
  const list = await hold(/\/v1\/jobs\?/, "GET");
  await page.goto(`${url}/#/`);
  await list.asked;
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await heading("New job");
  await list.release((route) => route.abort());
  await page.waitForTimeout(200);
  assert.equal(await page.locator("#notice").textContent(), "");
});

await step("a start on the job's page whose answer is lost", async () => {
  await newJob("Looked at", "a.png", "b.png", "c.png");
  await page.getByRole("button", {name: "Upload and look first"}).click();
  await page.getByRole("heading", {name: "Looked at"}).waitFor();
  const go = page.getByRole("button", {name: "Start", exact: true});
  await go.waitFor();
  // The page goes on showing what it knew.
  await page.route(/\/v1\/jobs\/\w+$/, (route) => route.abort());
  const ids = [];
  await page.route(/:start$/, async (route) => {
    ids.push(route.request().postDataJSON().requestId);
    if (ids.length > 1) return route.continue();
    await route.fetch();
    return route.abort();
  });
  await go.click();
  await said("the server cannot be reached");
  const answer = page.waitForResponse(/:start$/);
  await go.click();
  assert.equal((await answer).status(), 200);
  assert.ok(ids[0]);
  assert.equal(ids[1], ids[0]);
  await page.unrouteAll({behavior: "ignoreErrors"});
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
});

const copies = () => jobsOf("by HTTP (copy)");

await step("a clone whose answer is lost", async () => {
  await page.goto(`${url}/#/${job}`);
  await loseAnswers(/:clone$/, 1);
  const clone = page.getByRole("button", {name: "Clone"});
  await clone.click();
  await said("the server cannot be reached");
  await clone.click();
  await page.getByRole("heading", {name: "by HTTP (copy)"}).waitFor();
  assert.equal(await copies(), 1);
});

await step("a clone that is made after one has gone elsewhere", async () => {
  await page.goto(`${url}/#/${job}`);
  let release;
  const held = new Promise((ok) => { release = ok; });
  await page.route(/:clone$/, async (route) => { await held; await route.continue(); });
  const clone = page.getByRole("button", {name: "Clone"});
  await clone.click();
  assert.ok(await clone.isDisabled());
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  const answer = page.waitForResponse(/:clone$/);
  release();
  await (await answer).finished();
  while (await copies() < 2) await page.waitForTimeout(50);
  assert.equal(await page.evaluate(() => location.hash), "#/new");
});

await step("a job that cannot be deleted says why", async () => {
  await page.goto(`${url}/#/${job}`);
  await page.route(new RegExp(`${job}$`), (route) => route.request().method() === "DELETE"
    ? route.fulfill({status: 400, json: {code: 9, message: "not today"}}) : route.continue());
  await page.getByRole("button", {name: "Delete"}).click();
  const dialog = page.getByRole("dialog");
  await dialog.getByRole("button", {name: "Delete"}).click();
  await said("not today");
  assert.ok(await dialog.isHidden());
  // The page's stream of events, opened anew, takes back its own words only.
  const opened = page.waitForResponse(/\/events/);
  await page.evaluate(() => document.dispatchEvent(new Event("visibilitychange")));
  await opened;
  await page.waitForTimeout(200);
  await said("not today");
});

// As a server with tokens, which has taken back the one of this page, answers the first such call.
for (const [name, path, method] of [["a question", /files:query$/, "POST"], ["a file", /files\/b\.png/, "PUT"]]) {
  await step(`a token that is taken back during an upload, told to ${name}`, async () => {
    await newJob(`With ${name}`, "a.png", "b.png", "c.png");
    let refused = 0;
    await page.route(path, (route) => route.request().method() !== method || ++refused > 1 ? route.continue()
      : route.fulfill({status: 401, json: {code: 16, message: "the token is unknown"}}));
    let entered = 0;
    await page.route(/\/v1\/session$/, async (route) => {
      ++entered;
      await page.waitForTimeout(300);
      await route.fulfill({body: "{}"});
    });
    await start.click();
    await page.getByLabel("Token").fill("another");
    await page.getByRole("button", {name: "Enter"}).dblclick();
    await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
    assert.deepEqual([entered, await jobsOf(`With ${name}`)], [1, 1]);
  });
}

await step("leaving while the server is away", async () => {
  await page.route(/\/v1\/serverInfo$/, async (route) => {
    const info = await (await route.fetch()).json();
    await route.fulfill({json: checked("ServerInfo", {...info, client: {name: "alice"}})});
  });
  await page.route(/\/v1\/session$/, (route) => route.abort());
  await page.goto(`${url}/#/new`);
  await page.reload();
  await page.getByRole("button", {name: "Leave"}).click();
  await said("the server cannot be reached");
});

await step("a full picture whose connection breaks inside of it", async () => {
  const full = () => page.locator("canvas.stage[data-full=true]").waitFor();
  await page.goto(`${url}/#/${job}/scene`);
  await full();
  await page.evaluate(() => {
    const usual = window.usual = window.fetch;
    window.fetch = async (path, options) => {
      const response = await usual(path, options);
      if (options?.body?.includes('"jpegQuality":92')) {
        response.blob = () => Promise.reject(new TypeError("network error"));
      }
      return response;
    };
  });
  await page.getByRole("button", {name: "Next photo"}).click();
  await said("the connection broke");
  await page.evaluate(() => { window.fetch = window.usual; });
  await full();
  assert.equal(await page.locator("#notice").textContent(), "");
});

await step("a scene whose first answer is that the server is busy", async () => {
  await page.goto(`${url}/#/`);
  let busy = true;
  await page.route(/\/cameras\?/, (route) => busy ? route.fulfill({status: 429, json: {
    code: 8, message: "too many wait", details: [{"@type": "type.googleapis.com/google.rpc.RetryInfo"}]}})
    : route.continue());
  await page.goto(`${url}/#/${job}/scene`);
  await said("too many wait");
  busy = false;
  await page.locator("canvas.stage[data-full=true]").waitFor();
  assert.equal(await page.locator("#notice").textContent(), "");
});

await step("options that come late", async () => {
  let away = true;
  await page.route(/\/v1\/serverInfo$/, (route) => away
    ? route.fulfill({status: 503, json: {code: 14, message: "the server starts"}}) : route.continue());
  await page.goto(`${url}/#/new`);
  await said("the server starts");
  await choose("a.png", "b.png", "c.png");
  await page.getByText("3 photos,").waitFor();
  assert.ok(await start.isDisabled());
  away = false;
  await page.getByRole("combobox", {name: "Method", exact: true}).waitFor();
  assert.ok(await start.isEnabled());
});

await browser.close();
process.exit(0);
