// A new job on the page with what cannot be sent; new_job_test.py starts it.

import assert from "node:assert/strict";
import {readdirSync} from "node:fs";
import {join} from "node:path";
import {chromium} from "playwright-core";

const {URL: url, PHOTOS: photos, CHROMIUM: executablePath, PATIENCE_MS: patience} = process.env;

const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-dev-shm-usage"]});
const page = await browser.newPage();
page.setDefaultTimeout(Number(patience));
const complaints = [];
page.on("pageerror", (error) => complaints.push(String(error)));
const sent = [];
page.on("request", (request) => sent.push(`${request.method()} ${new URL(request.url()).pathname}`));

async function step(name, what) {
  console.log(name);
  await what();
  assert.deepEqual(complaints, []);
}

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

await browser.close();
process.exit(0);
