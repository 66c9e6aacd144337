// The page: which view is shown, and who looks.

import {call, get, tokenEntered, whenUnauthorized, type ServerInfo} from "./api.js";
import {el, notice} from "./dom.js";
import {jobView} from "./job.js";
import {jobsView} from "./jobs.js";
import {loginView} from "./login.js";
import {sceneView} from "./scene.js";
import {submitView} from "./submit.js";
import type {View} from "./view.js";

const main = document.getElementById("main")!;
let shown: View | undefined;
let kept: View | undefined;  // goes on behind the question for a token

function viewOf(hash: string): View {
  const [page, id, part] = hash.replace(/^#\//, "").split("/");
  if (page === "new") return submitView();
  if (page === "jobs" && id && /^[0-9a-z]+$/.test(id)) {
    return part === "scene" ? sceneView(id) : jobView(id);
  }
  return jobsView();
}

function show(view: View, keep?: View): void {
  for (const old of [shown, kept]) if (old !== view && old !== keep) old?.leave?.();
  const first = shown === undefined;
  kept = keep;
  shown = view;
  document.title = `${view.title} - litags`;
  main.replaceChildren(view.element);
  for (const link of document.querySelectorAll("nav a")) {
    if (link.getAttribute("href") === (location.hash || "#/")) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  // Where one reads on after a link; the first page leaves the focus to the browser.
  if (!first) main.focus({preventScroll: true});
  window.scrollTo(0, 0);
}

function route(view = viewOf(location.hash)): void {
  notice("");
  show(view);
  void who();
}

// The name of the client, if the server knows names.
async function who(): Promise<void> {
  const place = document.getElementById("who")!;
  const info = await get<ServerInfo>("/v1/serverInfo").catch(() => undefined);
  const name = info?.client?.name;
  const leave = async (): Promise<void> => {
    await call("DELETE", "/v1/session");
    ask();
  };
  const click = (): void => { if (mayLeave()) leave().catch((error: Error) => notice(error.message)); };
  place.replaceChildren(name ? el("span", {}, `${name} `) : "",
                        name ? el("button", {type: "button", click}, "Leave") : "");
}

// Whether what is shown may go: the user is asked, if that ends something.
function mayLeave(): boolean {
  const question = shown?.asks?.() || kept?.asks?.();
  return !question || window.confirm(question);
}

function ask(keep?: View): void {
  if (shown?.title === "Token") return;
  document.getElementById("who")!.replaceChildren();
  show(loginView(() => { route(kept); tokenEntered(); }), keep);
  main.querySelector("input")!.focus();
}

whenUnauthorized(() => ask(shown?.keeps?.() ? shown : undefined));
// Not by its address: every hash is the address of a view.
document.querySelector("a.skip")!.addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
window.addEventListener("hashchange", (event) => {
  if (mayLeave()) route();
  else window.history.pushState(null, "", event.oldURL);
});
route();
