// The list of jobs, which is renewed while somebody is at it; new_job_test.py starts it.

import assert from "node:assert/strict";
import {checked, openPage} from "./steps.mjs";

const {URL: url} = process.env;

const {browser, page, step} = await openPage();

await step("the list is renewed around what has the focus and what is selected", async () => {
  await page.goto(`${url}/#/`);
  await page.locator(".card").first().waitFor();
  const selected = await page.evaluate(() => {
    const link = window.link = document.querySelector(".card a"), [text] = link.childNodes;
    link.focus();
    document.getSelection().setBaseAndExtent(text, 0, text, 4);
    return document.getSelection().toString();
  });
  assert.equal(selected.length, 4);
  const renewed = async () => {
    for (let i = 0; i < 2; ++i) await page.waitForResponse(/\/v1\/jobs\?/);
    await page.waitForTimeout(200);
    assert.deepEqual(await page.evaluate(() => [document.activeElement === window.link,
                                                document.getSelection().toString()]), [true, selected]);
  };
  await renewed();
  const count = await page.locator(".card").count();
  const made = await page.evaluate(async () => (await (await fetch("/v1/jobs", {
    method: "POST", body: JSON.stringify({displayName: "Made elsewhere"})})).json()).name);
  await page.locator(".card").nth(count).waitFor();
  assert.equal(await page.locator(".card a").first().textContent(), "Made elsewhere");
  await renewed();
  await page.evaluate((name) => fetch(`/v1/${name}`, {method: "DELETE"}), made);
  await page.waitForFunction((n) => document.querySelectorAll(".card").length === n, count);
  await renewed();
});

await step("a title is found by its quotes and backslashes", async () => {
  const title = 'a 5" \\ lens';
  const made = await page.evaluate(async (displayName) => (await (await fetch("/v1/jobs", {
    method: "POST", body: JSON.stringify({displayName})})).json()).name, title);
  await page.getByLabel("Title contains").fill(title);
  await page.waitForFunction((text) => {
    const links = [...document.querySelectorAll(".card a")];
    return links.length === 1 && links[0].textContent === text;
  }, title);
  await page.evaluate((name) => fetch(`/v1/${name}`, {method: "DELETE"}), made);
  await page.getByLabel("Title contains").fill("");
  await page.locator(".card").nth(1).waitFor();
});

await step("a list of no job is renewed around its link", async () => {
  await page.getByLabel("Title contains").fill("no such title");
  await page.getByText("No job is like this.").waitFor();
  await page.route(/\/v1\/jobs\?/, (route) => route.fulfill({json: checked("ListJobsResponse", {jobs: []})}));
  await page.getByLabel("Title contains").fill("");
  const link = page.getByRole("link", {name: "Make one of your photos."});
  await link.focus();
  for (let i = 0; i < 2; ++i) await page.waitForResponse(/\/v1\/jobs\?/);
  await page.waitForTimeout(200);
  assert.ok(await link.evaluate((element) => element === document.activeElement));
});

await browser.close();
process.exit(0);
