// What files of steps share: answers as the server gives them, and a page in Chromium and its steps, each
// of which ends without an error of the page's own.

import assert from "node:assert/strict";
import {chromium} from "playwright-core";

// Of the services, by gateway.py: the fields of each message, each with its message, values or neither.
const messages = JSON.parse(process.env.MESSAGES);

// The JSON of such a message: a faked answer, which must be one that the server could give.
export function checked(message, json) {
  for (const [field, value] of Object.entries(json)) {
    const kind = messages[message][field];
    assert.notEqual(kind, undefined, `a ${message} has no ${field}`);
    for (const part of [value].flat()) {
      if (Array.isArray(kind)) assert.ok(kind.includes(part), `${field} of a ${message} cannot be ${part}`);
      else if (kind) checked(kind, part);
    }
  }
  return json;
}

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
