// A new job on the page with what cannot be sent; new_job_test.py starts it.

import assert from "node:assert/strict";
import {copyFileSync, readdirSync, rmSync, statSync} from "node:fs";
import {join} from "node:path";
import {openPage} from "./steps.mjs";

const {URL: url, PHOTOS: photos, ARCHIVE: archive, MASKED: masked, FOUR: four} = process.env;

const {browser, page, step} = await openPage();
const sent = [], ranges = new Map();  // requests; the Content-Range of each file
page.on("request", (request) => {
  const {pathname} = new URL(request.url());
  sent.push(`${request.method()} ${pathname}`);
  if (request.method() === "PUT") ranges.set(pathname.split("/").at(-1), request.headers()["content-range"]);
});

const choose = (files) => page.locator("#files").setInputFiles(files);
const start = page.getByRole("button", {name: "Upload and start"});
const look = page.getByRole("button", {name: "Upload and look first"});
const share = page.getByLabel("Least share of photos placed");
const options = page.locator("details");
const fold = async (open) => {
  if (await options.evaluate((details) => details.open) !== open) await page.getByText("All options").click();
};

await step("the skip link keeps the page and its files", async () => {
  await page.goto(`${url}/#/new`);
  await share.waitFor({state: "attached"});
  await choose(readdirSync(photos).map((name) => join(photos, name)));
  await page.getByText("4 photos,").waitFor();
  await page.locator("a.skip").focus();
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.activeElement.id === "main");
  assert.equal(await page.evaluate(() => location.hash), "#/new");
  await page.getByText("4 photos,").waitFor();
});

await step("a photo that is dropped beside the place for photos", async () => {
  const kept = () => page.evaluate(() => ["dragover", "drop"].map((kind) => {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File(["x"], "e.png"));
    const event = new DragEvent(kind, {bubbles: true, cancelable: true, dataTransfer});
    document.getElementById("main").dispatchEvent(event);
    return event.defaultPrevented;
  }));
  assert.deepEqual(await kept(), [true, true]);
  await page.getByText("4 photos,").waitFor();
});

// As a folder is dropped, whose name is longer than a title in the middle of a character.
await step("a folder with one in it that cannot be read, and a hidden one", async () => {
  await page.getByRole("button", {name: "Remove the files"}).click();
  await page.evaluate(() => {
    const file = (fullPath) => ({isFile: true, fullPath,
                                 file: (ok) => ok(new File(["x"], fullPath.split("/").at(-1)))});
    const folder = (fullPath, entries) => ({isFile: false, fullPath, createReader: () => {
      const parts = [entries, []];
      return {readEntries: (ok, no) => entries ? ok(parts.shift()) : no(new Error("not allowed"))};
    }});
    const root = `/a${"\u{1f319}".repeat(60)}`;
    const entry = folder(root, [folder(`${root}/private`), file(`${root}/a.jpg`),
                                folder(`${root}/.thumbs`, [file(`${root}/.thumbs/b.jpg`)])]);
    const event = new Event("drop", {cancelable: true});
    event.dataTransfer = {items: [{webkitGetAsEntry: () => entry, getAsFile: () => null}]};
    document.querySelector(".drop").dispatchEvent(event);
  });
  await page.getByText(/^1 photo, 1 B; 1 other files are left out; could not be read: .*\/private$/).waitFor();
  assert.equal(await page.getByLabel("Title", {exact: true}).getAttribute("placeholder"),
               `a${"\u{1f319}".repeat(49)}`);
  await page.getByRole("button", {name: "Remove the files"}).click();
  await choose(readdirSync(photos).map((name) => join(photos, name)));
  await page.getByText("4 photos,").waitFor();
});

await step("an option that is wrong, folded away", async () => {
  for (const wrong of ["50", "e"]) {  // out of range; no number
    for (const button of [start, look]) {
      await fold(true);
      await share.fill("");
      await share.pressSequentially(wrong);
      await fold(false);
      await button.click();
      assert.ok(await options.evaluate((details) => details.open));
      assert.ok(await share.evaluate((control) => control === document.activeElement));
      assert.ok(await start.isEnabled());
    }
  }
  assert.ok(!sent.includes("POST /v1/jobs"));
  await share.fill("0.5");
});

await step("an option that is wrong, of a video that was removed", async () => {
  await choose({name: "v.mp4", mimeType: "video/mp4", buffer: Buffer.from("no video")});
  await page.getByLabel("Frames of the video").fill("-5");
  await page.getByRole("button", {name: "Remove the files"}).click();
  await choose(readdirSync(photos).map((name) => join(photos, name)));
  await page.getByText("4 photos,").waitFor();
});

await step("a file that is refused for good is sent once", async () => {
  await start.click();
  await page.getByText("1 of 4 files were refused:").waitFor();
  assert.equal(sent.filter((request) => /^PUT .*\/large\.png$/.test(request)).length, 1);
  await page.getByRole("button", {name: "Start without them"}).click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
});

await step("a photo that is refused takes its mask along", async () => {
  for (const [button, then] of [["Start without them", "succeeded"], ["Look at the others first", "uploading"]]) {
    await page.getByRole("link", {name: "New job", exact: true}).first().click();
    await page.locator("#folder").setInputFiles(masked);
    await page.getByText("4 photos, 4 masks,").waitFor();
    sent.length = 0;
    await start.click();
    await page.getByText("1 of 8 files were refused:").waitFor();
    await page.getByText("Masks of these photos, which are left out, too:").waitFor();
    assert.deepEqual(await page.locator(".result ul").last().locator("li").allTextContents(), ["bad.png"]);
    await page.getByRole("button", {name: button}).click();
    await page.locator(".heading .state", {hasText: then}).waitFor();
    assert.deepEqual(sent.filter((request) => /^DELETE/.test(request)).map((request) => request.split("/").at(-1)),
                     ["bad.png"]);
  }
  page.once("dialog", (dialog) => dialog.accept());  // 3 of 4 photos have come
  await page.getByRole("button", {name: "Start", exact: true}).click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
});

await step("a photo that is removed before the start takes its mask along", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await page.locator("#folder").setInputFiles(four);
  await page.getByText("4 photos, 4 masks,").waitFor();
  await look.click();
  const remove = page.getByRole("button", {name: "Remove c.png"});
  await remove.waitFor();
  sent.length = 0;
  page.once("dialog", (dialog) => dialog.dismiss());
  await remove.click();
  page.once("dialog", (dialog) => dialog.accept());
  await remove.click();
  await page.getByText("3 photos are of use").waitFor();
  assert.deepEqual(await page.locator(".photos tbody th").allTextContents(), ["a.png", "b.png", "d.png"]);
  assert.deepEqual(sent.filter((request) => /^DELETE/.test(request)).map((request) => request.split("/").at(-1)),
                   ["c.png", "c.png"]);  // the mask, then the photo
  await page.waitForFunction(() => document.activeElement.matches(".wide"));  // who goes by keys stays in the table
  await page.locator(".standing", {hasText: /^3 photos$/}).waitFor();  // and none that has not come
  await page.getByRole("button", {name: "Start", exact: true}).click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
  await page.getByRole("button", {name: "Remove a.png"}).waitFor({state: "detached"});
  await page.getByRole("row", {name: "a.png"}).waitFor();
});

await step("files that do not arrive are no refusals, and can be sent again", async () => {
  const gone = join(photos, "gone.png");
  copyFileSync(join(photos, "a.png"), gone);
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await choose(["a.png", "b.png", "c.png", "gone.png"].map((name) => join(photos, name)));
  await page.getByText("4 photos,").waitFor();
  rmSync(gone);
  await page.route(/files\/b\.png/, (route) => route.abort());
  await page.evaluate(() => {  // no pauses between attempts, which are at most 15 s
    window.patient = window.setTimeout;
    window.setTimeout = (what, ms) => window.patient(what, ms > 15000 ? ms : 0);
  });
  await start.click();
  await page.getByText("2 of 4 files did not arrive:").waitFor();
  await page.getByText("b.png: the connection broke").waitFor();
  await page.getByText(/^gone\.png: ./).waitFor();
  assert.equal(await page.getByText("refused").count(), 0);
  // The server has this photo, of the job before.
  assert.equal(ranges.get("a.png"), `bytes */${statSync(join(photos, "a.png")).size}`);
  await page.evaluate(() => { window.setTimeout = window.patient; });
  await page.unrouteAll();
  await page.getByRole("button", {name: "Send them again"}).click();
  await page.getByText("1 of 4 files did not arrive:").waitFor();
  await page.getByRole("button", {name: "Start without them"}).click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
});

await step("no photo is sent beside cameras that are refused, and none without being asked", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  const file = (name, text) => ({name, mimeType: "text/plain", buffer: Buffer.from(text)});
  await choose(["a.png", "b.png", "c.png"].map((name) => join(photos, name)));
  await choose([file("cameras.txt", "no camera"), file("points3D.txt", "")]);
  await page.getByText("3 photos, 1 file of cameras,").waitFor();
  sent.length = 0;
  await start.click();
  await page.getByText("1 of 4 files were refused:").waitFor();
  assert.ok(!sent.some((request) => /\.png$/.test(request)));
  await page.getByRole("button", {name: "Send the others without them"}).click();
  await page.getByText("1 of 4 files were refused:").waitFor();
  await page.getByRole("button", {name: "Start without them"}).click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
});

await step("a photo that is left out of an archive", async () => {
  await page.getByRole("link", {name: "New job", exact: true}).first().click();
  await choose(archive);
  for (let i = 0; i < 2; ++i) {  // said again, though the server has the archive
    await start.click();
    await page.getByText("Not used, of what is in the archive:").waitFor();
    await page.getByText(/^bad\.png \(.+\)$/).waitFor();
  }
  await page.getByRole("button", {name: "Start without them"}).click();
  await page.locator(".heading .state", {hasText: "succeeded"}).waitFor();
});

await browser.close();
process.exit(0);
