// One job: how it stands, its pictures, curves, stages, photos and log.

import {follow, get, saidOfRetried, type Following, type Job, type JobEvent, type LogEntry} from "./api.js";
import {actions, downloads, type Part} from "./actions.js";
import {chart} from "./chart.js";
import {el, setText, voice} from "./dom.js";
import {downloadLink} from "./download.js";
import {findings} from "./findings.js";
import {History} from "./history.js";
import {isActive, isOver, secondsOf, shareDone, standing, timeText, titleOf, words} from "./format.js";
import {pictures} from "./pictures.js";
import {every, type View} from "./view.js";

const kMostLines = 2000;  // of the log
const kNearPx = 8;        // from its end: who is there goes on with it

function head(refresh: () => void): Part {
  // The state alone is spoken: the line below it changes all the time.
  const title = el("h1", {}), state = el("span", {class: "state", "aria-live": "polite"});
  const line = el("p", {class: "standing"}), bar = el("progress", {max: 1, "aria-label": "Progress"});
  const fly = el("a", {class: "button primary"}, "Fly through");
  const paper = downloadLink("Report");
  const buttons = actions(refresh);
  const element = el("div", {}, el("div", {class: "heading"}, title, state), bar, line,
                     el("div", {class: "row"}, fly, paper, buttons.element));
  return {
    element,
    show(job) {
      setText(title, titleOf(job));
      document.title = `${titleOf(job)} - litags`;
      setText(state, words(job.state));
      state.dataset.state = words(job.state);
      setText(line, standing(job));
      line.classList.toggle("error", job.state === "JOB_STATE_FAILED");
      bar.hidden = !isActive(job);
      bar.value = shareDone(job.progress);
      fly.href = `#/${job.name}/scene`;
      fly.hidden = job.snapshotIteration === undefined;
      paper.href = `/v1/${job.name}/report`;
      paper.download = `${titleOf(job)}.html`;
      paper.hidden = job.state === "JOB_STATE_UPLOADING";
      buttons.show(job);
    },
  };
}

function rows(pairs: [string, string][]): HTMLElement {
  return el("dl", {}, ...pairs.filter(([, value]) => value).map(
      ([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))));
}

function report(): Part {
  const element = el("section", {"aria-label": "Result", hidden: true});
  let shown = "";
  return {
    element,
    show({report: r}) {
      element.hidden = !r;
      if (!r || JSON.stringify(r) === shown) return;
      shown = JSON.stringify(r);
      element.replaceChildren(
          el("h2", {}, "Result"),
          rows([["Photos placed", `${r.registered ?? 0} of ${r.photos ?? 0}`],
                ["Left out", (r.dropped ?? []).join(", ")],
                ["Gaussians", Number(r.gaussians ?? 0).toLocaleString("en")],
                ["Iterations", String(r.iterations ?? 0)],
                ["PSNR of held-out photos", r.psnrHoldout === undefined ? "" : `${r.psnrHoldout.toFixed(2)} dB`],
                ["SSIM of held-out photos", r.ssimHoldout === undefined ? "" : r.ssimHoldout.toFixed(4)],
                ["Time", timeText(secondsOf(r.runTime))]]),
          (r.notes?.length ?? 0) > 0 && el("ul", {class: "notes"}, ...r.notes!.map((n) => el("li", {}, n))) || "");
    },
  };
}

function curves(): {element: HTMLElement; show: (history: History, job: Job) => void} {
  const loss = chart("Loss", "", 0.98), psnr = chart("PSNR of held-out photos", "dB");
  const stages = el("ol", {class: "stages"});
  const element = el("section", {"aria-label": "Course", hidden: true}, el("h2", {}, "Course"),
                     el("div", {class: "charts"}, loss.element, psnr.element), stages);
  return {
    element,
    show(history, job) {
      const times = history.stages(isOver(job) ? undefined : Date.now() / 1000);
      element.hidden = times.length === 0;
      loss.show(history.loss);
      psnr.element.toggleAttribute("hidden", history.psnr.length === 0);
      psnr.show(history.psnr);
      while (stages.children.length > times.length) stages.lastElementChild!.remove();
      times.forEach(({stage, seconds}, i) => {
        const time = timeText(Math.max(0, seconds)), old = stages.children[i];
        const item = el("li", {}, words(stage), " ", el("span", {class: "time"}, time));
        if (!old) stages.append(item);
        else if (!old.isEqualNode(item)) old.replaceWith(item);
      });
    },
  };
}

// Read when it is opened.
function log(name: string): {element: HTMLElement; again: () => void; leave: () => void} {
  const lines = el("ol", {class: "log", tabindex: 0, "aria-label": "Lines of the log"});
  let following: Following | undefined;
  const toEnd = (): void => { lines.scrollTop = lines.scrollHeight; };
  const open = (): void => {
    if (!details.open) return;
    toEnd();
    following ??= follow<LogEntry & {number?: string}>(`/v1/${name}/log?follow=true`, "afterEntry", {
      event: (entry) => {
        const time = new Date(entry.time).toLocaleTimeString();
        const atEnd = lines.scrollHeight - lines.scrollTop - lines.clientHeight < kNearPx;
        lines.append(el("li", {class: words(entry.severity)}, el("time", {}, time), " ", entry.text ?? ""));
        if (lines.children.length > kMostLines) lines.firstElementChild!.remove();
        if (atEnd) toEnd();
      },
      end: () => {}, trouble: () => {},
    });
  };
  const details = el("details", {toggle: open}, el("summary", {}, "Log"), lines);
  return {element: details, again: () => following?.again(), leave: () => following?.stop()};
}

export function jobView(id: string): View {
  const name = `jobs/${id}`;
  const history = new History();
  const refresh = async (): Promise<void> => {
    try {
      const job = await get<Job>(`/v1/${name}`);
      if (left) return;
      parts.forEach((part) => part.show(job));
      course.show(history, job);
      if (!isOver(job)) {  // its streams may have ended before it was resumed
        events.again();
        lines.again();
      }
      element.hidden = false;
      say("");
    } catch (error) {
      if (!left) say(saidOfRetried(error));
    }
  };
  const say = voice();
  let left = false;
  const top = head(() => void refresh()), course = curves(), lines = log(name);
  const parts: Part[] = [top, pictures(), report(), downloads(), findings(name)];
  const element = el("div", {class: "job"}, top.element, parts[1]!.element, course.element,
                     parts[2]!.element, parts[3]!.element, parts[4]!.element, lines.element);
  element.hidden = true;
  const events = follow<JobEvent>(`/v1/${name}/events`, "afterEvent", {
    event: (event) => {
      history.add(event);
      if (event.stateChange) void refresh();
    },
    end: () => void refresh(),
    trouble: voice(),
  });
  const stopLooking = every(2, refresh);
  return {
    title: "Job", element,
    leave: () => {
      left = true;
      events.stop();
      stopLooking();
      lines.leave();
      parts.forEach((part) => part.leave?.());
    },
  };
}
