// A page in Chromium and its steps, each of which ends without an error of the page's own.

import assert from "node:assert/strict";
import {chromium} from "playwright-core";

// step(name, what) says the name, does it, and takes its routes back.
export async function openPage() {
  const {CHROMIUM: executablePath, PATIENCE_MS: patience} = process.env;
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-dev-shm-usage"]});
  const page = await browser.newPage();
  page.setDefaultTimeout(Number(patience));
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(String(error)));
  const step = async (name, what) => {
    console.log(name);
    await what();
    await page.unrouteAll({behavior: "ignoreErrors"});
    assert.deepEqual(complaints, []);
  };
  return {browser, page, step};
}
