// What a job's events say over time: curves and stages.

import type {JobEvent} from "./api.js";
import type {Point} from "./chart.js";

export interface StageTime { stage: string; seconds: number }

export class History {
  loss: Point[] = [];
  psnr: Point[] = [];
  private steps: {stage: string; from: number; to: number}[] = [];

  add(event: JobEvent): void {
    const time = Date.parse(event.time) / 1000;
    const progress = event.progress;
    const last = this.steps[this.steps.length - 1];
    if (last) last.to = time;
    if (event.stateChange) {
      this.steps.push({stage: event.stateChange.state, from: time, to: time});
      return;
    }
    if (!progress) return;
    if (progress.stage && progress.stage !== last?.stage) {
      this.steps.push({stage: progress.stage, from: time, to: time});
    }
    const x = progress.iteration ?? 0;
    // A job that goes on from a checkpoint draws over what came after that.
    if (progress.loss) put(this.loss, {x, y: progress.loss});
    if (progress.psnrHoldout !== undefined) put(this.psnr, {x, y: progress.psnrHoldout});
  }

  // Each stage that took time, in order; between its end and a resume a job does nothing. `now`: until when
  // the last one lasts; seconds since 1970.
  stages(now?: number): StageTime[] {
    return this.steps
        .map((step, i) => ({
          stage: step.stage,
          seconds: (i === this.steps.length - 1 && now ? now : step.to) - step.from,
        }))
        .filter(({stage}) => !/^JOB_STATE_(SUCCEEDED|FAILED|CANCELLED)$/.test(stage))
        .filter(({stage, seconds}) => stage.startsWith("STAGE_") || seconds >= 1);
  }
}

function put(points: Point[], point: Point): void {
  while (points.length > 0 && points[points.length - 1]!.x >= point.x) points.pop();
  points.push(point);
}
