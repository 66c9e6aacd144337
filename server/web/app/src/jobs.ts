// All jobs, newest first.

import {get, saidOfRetried, type Job} from "./api.js";
import {el, labelled, select, setText, voice} from "./dom.js";
import {idOf, isActive, shareDone, standing, titleOf, words} from "./format.js";
import {thumbnail} from "./thumbnail.js";
import {every, type View} from "./view.js";

const kMostOnPage = 1000;  // the server takes no larger page_size

const kStates: [string, string][] = [
  ["", "all"], ["RUNNING", "running"], ["QUEUED", "queued"], ["UPLOADING", "uploading"],
  ["SUCCEEDED", "succeeded"], ["FAILED", "failed"], ["CANCELLED", "cancelled"],
];

// The services' filter.
export function filterOf(state: string, title: string): string {
  const text = title.trim().replace(/["\\]/g, "\\$&");
  return [state && `state = ${state}`, text && `display_name : "${text}"`].filter(Boolean)
      .join(" AND ");
}

function card(): {element: HTMLElement; show: (job: Job) => void} {
  const picture = thumbnail();
  const link = el("a", {});
  const state = el("span", {class: "state"});
  const line = el("p", {class: "standing"});
  const bar = el("progress", {max: 1});
  const element = el("li", {class: "card"}, picture.element,
                     el("div", {}, el("h2", {}, link), state, bar, line));
  return {
    element,
    show(job) {
      link.href = `#/jobs/${idOf(job.name)}`;
      setText(link, titleOf(job));
      setText(state, words(job.state));
      state.dataset.state = words(job.state);
      setText(line, standing(job));
      bar.hidden = !isActive(job);
      bar.value = shareDone(job.progress);
      bar.setAttribute("aria-label", `Progress of ${titleOf(job)}`);
      picture.show(job);
    },
  };
}

// Leaves those that stay where they are: one may have the focus, or selected text.
function place(list: HTMLElement, shown: HTMLElement[]): void {
  const stay = new Set<Element>(shown);
  for (const old of [...list.children]) if (!stay.has(old)) old.remove();
  shown.forEach((element, i) => {
    const there = list.children[i] ?? null;
    if (there !== element) list.insertBefore(element, there);
  });
}

// The first jobs, and whether there are more.
async function newest(filter: string, count: number): Promise<{jobs: Job[]; more: boolean}> {
  const jobs: Job[] = [];
  let pageToken = "";
  do {
    const pageSize = Math.min(count - jobs.length, kMostOnPage);
    const query = new URLSearchParams({pageSize: String(pageSize), filter, pageToken});
    const page = await get<{jobs?: Job[]; nextPageToken?: string}>(`/v1/jobs?${query}`);
    jobs.push(...page.jobs ?? []);
    pageToken = page.nextPageToken ?? "";
  } while (pageToken && jobs.length < count);
  return {jobs, more: pageToken !== ""};
}

export function jobsView(): View {
  const cards = new Map<string, ReturnType<typeof card>>();
  const list = el("ul", {class: "cards", "aria-label": "Jobs"});
  const none = el("p", {class: "empty", hidden: true}, "There are no jobs yet. ",
                  el("a", {href: "#/new"}, "Make one of your photos."));
  const noneLike = el("p", {class: "empty", hidden: true}, "No job is like this.");
  const more = el("button", {type: "button", hidden: true, click: () => { size += 50; void refresh(); }},
                  "Show more");
  const say = voice();
  let size = 50, left = false;
  const state = select(kStates, "", {change: () => void refresh()});
  const title = el("input", {type: "search", input: () => void refresh()});

  const refresh = async (): Promise<void> => {
    const filter = filterOf(state.value, title.value);
    try {
      const {jobs, more: others} = await newest(filter, size);
      if (left || filter !== filterOf(state.value, title.value)) return;  // another answer is on its way
      for (const job of jobs) {
        if (!cards.has(job.name)) cards.set(job.name, card());
        cards.get(job.name)!.show(job);
      }
      place(list, jobs.map((job) => cards.get(job.name)!.element));
      none.hidden = jobs.length > 0 || filter !== "";
      noneLike.hidden = jobs.length > 0 || filter === "";
      more.hidden = !others;
      say("");
    } catch (error) {
      if (!left) say(saidOfRetried(error));
    }
  };
  const element = el("div", {},
                     el("div", {class: "heading"}, el("h1", {}, "Jobs"),
                        el("a", {class: "button primary", href: "#/new"}, "New job")),
                     el("form", {class: "filters", role: "search", submit: (e) => e.preventDefault()},
                        labelled("State", state), labelled("Title contains", title)),
                     list, none, noneLike, more);
  const stopLooking = every(3, refresh);
  return {title: "Jobs", element, leave: () => { left = true; stopLooking(); }};
}
