// How fast a step of a job goes, and how long it still takes.

import type { Job } from "../app/documents";

// A rate from less than this says little
const TELLING_S = 1;

export class Pace {
  private step = "";
  private began = { done: 0, seconds: 0 };

  take({ step, done, seconds }: Job): void {
    if (step === this.step && done >= this.began.done) return;
    this.step = step;
    this.began = { done, seconds };
  }

  words({ done, total, unit, seconds }: Job): string {
    const parts = [duration(seconds)];
    if (total > 0) parts.unshift(`${count(done)} of ${count(total)} ${unit}`.trim());
    const passed = seconds - this.began.seconds;
    const rate = passed >= TELLING_S ? (done - this.began.done) / passed : 0;
    if (rate > 0) parts.push(`${count(rate)} ${unit}/s`, `${duration((total - done) / rate)} left`);
    return parts.join(" · ");
  }
}

export function duration(seconds: number): string {
  if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.round(seconds - 60 * minutes)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

function count(value: number): string {
  if (value >= 1e6) return `${(value / 1e6).toFixed(1)} million`;
  return value >= 10 ? Math.round(value).toLocaleString("en") : String(Math.round(value * 10) / 10);
}
