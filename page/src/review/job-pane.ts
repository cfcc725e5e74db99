// Extraction jobs: what to extract, progress and results.

import "./job-pane.css";
import * as api from "../app/api";
import type { App } from "../app/app";
import type { Pane } from "../controls/tabs";
import { button, element } from "../controls/element";
import type { Job } from "../app/documents";

// The kinds that each method extracts; the server refuses others
const METHODS: { method: string; title: string; kinds: string[] }[] = [
  {
    method: "auto",
    title: "Automatic",
    kinds: ["lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top", "guardrail", "barrier", "cable"],
  },
  {
    method: "obb",
    title: "Laser: oriented boxes (obb)",
    kinds: ["lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top"],
  },
  { method: "radon", title: "Laser: Radon transform (radon)", kinds: ["guardrail", "barrier", "cable"] },
  { method: "stereo", title: "Stereo images (stereo)", kinds: ["lane_marking", "lane_marking_dash"] },
];

export class JobPane implements Pane {
  readonly element: HTMLElement;
  private readonly method = element("select", { "aria-label": "Method" });
  private readonly kinds = element("fieldset", {}, element("legend", {}, "Kinds"));
  private readonly start: HTMLButtonElement;
  private readonly jobs = element("div", { class: "job-list" });
  private readonly all = new Map<string, Job>();
  private readonly rates = new Map<string, Progress>();

  constructor(private readonly app: App) {
    const { n_points, n_pairs } = app.survey;
    const usable = METHODS.filter(({ method }) =>
      method === "auto" || (method === "stereo" ? n_pairs > 0 : n_points > 0),
    );
    this.method.append(...usable.map(({ method, title }) => element("option", { value: method }, title)));
    this.method.addEventListener("change", () => this.showKinds());
    this.start = button("Extract lines from the survey", "Extract", () => void this.startJob(), { class: "start" });
    this.element = element(
      "div", { class: "job-pane" },
      element("label", {}, "Method", this.method), this.kinds,
      element("p", { class: "quiet" }, "Lines that were accepted, edited, drawn or rejected are kept as they are."),
      this.start, this.jobs, this.chainage(),
    );
    this.showKinds();
    app.on("job", (job) => this.update(job));
    app.on("connected", (connected) => connected && void this.load());
    void this.load();
  }

  // Heights, widths and gaps of the lines as they are saved now, by intervals along the road
  private chainage(): HTMLElement {
    const every = element("select", { "aria-label": "Interval" });
    every.append(...[5, 10, 20, 50, 100].map((m) => element("option", { value: String(m), selected: m === 10 }, `every ${m} m`)));
    const standard = element("select", { "aria-label": "Limits" });
    for (const [value, title] of [["", "no limits"], ["us", "US"], ["uk", "UK"], ["de", "Germany"]] as const)
      standard.append(element("option", { value }, title));
    const link = element("a", { target: "_blank", rel: "noopener", class: "report chainage" }, "Open");
    const renew = (): void => void (link.href = api.chainageUrl(Number(every.value), standard.value));
    every.addEventListener("change", renew);
    standard.addEventListener("change", renew);
    renew();
    return element("fieldset", { class: "chainage" }, element("legend", {}, "Report by chainage"), every, standard, link);
  }

  private showKinds(): void {
    const chosen = METHODS.find(({ method }) => method === this.method.value);
    const checkboxes = this.app.survey.kinds
      .filter(({ kind }) => chosen?.kinds.includes(kind))
      .map(({ kind, title }) =>
        element("label", {}, element("input", { type: "checkbox", name: "kind", value: kind, checked: true }), title),
      );
    this.kinds.replaceChildren(element("legend", {}, "Kinds"), ...checkboxes);
  }

  private async load(): Promise<void> {
    try {
      for (const job of await api.jobs()) this.update(job);
    } catch (error) {
      this.app.reportProblem(error);
    }
  }

  private async startJob(): Promise<void> {
    const kinds = [...this.kinds.querySelectorAll<HTMLInputElement>("input:checked")].map(({ value }) => value);
    if (kinds.length === 0) return this.app.reportProblem(new Error("Select at least one kind to extract."));
    this.start.disabled = true;
    try {
      this.update(await api.startJob(kinds, this.method.value));
    } catch (error) {
      this.app.reportProblem(error);
    }
    this.draw();
  }

  private async cancel(id: string): Promise<void> {
    try {
      this.update(await api.cancelJob(id));
    } catch (error) {
      this.app.reportProblem(error);
    }
  }

  private update(job: Job): void {
    const before = this.all.get(job.id);
    // A request's answer may arrive after a newer live message
    if (before && before.state !== "running" && job.state === "running") return;
    const rate = this.rates.get(job.id) ?? new Progress();
    rate.update(job);
    this.rates.set(job.id, rate);
    this.all.set(job.id, job);
    this.draw();
  }

  private draw(): void {
    this.start.disabled = [...this.all.values()].some(({ state }) => state === "running");
    // The card of a running job is updated in place, so that a button being pressed stays
    const existing = new Map([...this.jobs.children].map((child) => [(child as HTMLElement).dataset["job"] ?? "", child]));
    const cards = [...this.all.values()].reverse().map((job) => {
      const before = existing.get(job.id);
      if (before instanceof HTMLElement && before.dataset["state"] === "running" && job.state === "running") {
        this.progress(before, job);
        return before;
      }
      return this.card(job);
    });
    this.jobs.replaceChildren(...cards);
  }

  private card(job: Job): HTMLElement {
    const card = element("article", { class: "job", "data-job": job.id, "data-state": job.state });
    if (job.state === "running") {
      card.append(
        element("p", { class: "job-step" }), element("progress"), element("p", { class: "job-rate quiet" }),
        button("Cancel this extraction; the lines stay unchanged", "Cancel", () => void this.cancel(job.id)),
      );
      this.progress(card, job);
      return card;
    }
    card.append(element("p", { class: "job-state" }, `${STATES[job.state]} after ${duration(job.seconds)}`));
    if (job.counts) card.append(this.counts(job.counts));
    if (job.message) card.append(element("p", { class: "job-message" }, job.message));
    if (job.report) {
      const link = { href: api.reportUrl(job.id), target: "_blank", rel: "noopener", class: "report" };
      card.append(element("a", link, "Report"));
    }
    return card;
  }

  private progress(card: HTMLElement, job: Job): void {
    const bar = card.querySelector("progress")!;
    if (job.total > 0) {
      bar.max = job.total;
      bar.value = job.done;
    } else bar.removeAttribute("value");
    card.querySelector(".job-step")!.textContent = job.step || "Starting";
    card.querySelector(".job-rate")!.textContent = this.rates.get(job.id)?.text(job) ?? "";
  }

  private counts(counts: Record<string, number>): HTMLElement {
    const rows = Object.entries(counts).map(([kind, n]) => {
      const title = this.app.title(kind);
      return element("tr", {}, element("td", {}, title), element("td", {}, String(n)));
    });
    return element("table", { class: "job-counts" }, element("tbody", {}, ...rows));
  }
}

const STATES = { running: "Running", done: "Done", failed: "Failed", cancelled: "Cancelled" } as const;

const MIN_RATE_PERIOD_S = 1; // a rate over a shorter period is unreliable

// The rate of a job's present step, and the time left
class Progress {
  private step = "";
  private start = { done: 0, seconds: 0 };

  update({ step, done, seconds }: Job): void {
    if (step === this.step && done >= this.start.done) return;
    this.step = step;
    this.start = { done, seconds };
  }

  text({ done, total, unit, seconds }: Job): string {
    const parts = [duration(seconds)];
    if (total > 0) parts.unshift(`${count(done)} of ${count(total)} ${unit}`.trim());
    const passed = seconds - this.start.seconds;
    const rate = passed >= MIN_RATE_PERIOD_S ? (done - this.start.done) / passed : 0;
    if (rate > 0) parts.push(`${count(rate)} ${unit}/s`, `${duration((total - done) / rate)} left`);
    return parts.join(" · ");
  }
}

function duration(seconds: number): string {
  if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.round(seconds - 60 * minutes)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

function count(value: number): string {
  if (value >= 1e6) return `${(value / 1e6).toFixed(1)} million`;
  return value >= 10 ? Math.round(value).toLocaleString("en") : String(Math.round(value * 10) / 10);
}
