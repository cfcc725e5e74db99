// Extraction from the page: what to look for, how far it is, what was found.

import "./job-pane.css";

import * as api from "../app/api";
import type { App, Pane } from "../app/app";
import { button, element } from "../controls/element";
import { duration, Pace } from "./job-pace";
import type { Job } from "../app/documents";

// What each method looks for; the server refuses anything else
const METHODS: { method: string; title: string; kinds: string[] }[] = [
  {
    method: "auto",
    title: "Automatic: what suits each kind",
    kinds: ["lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top", "guardrail", "barrier", "cable"],
  },
  {
    method: "obb",
    title: "Laser: boxes along edges (obb)",
    kinds: ["lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top"],
  },
  { method: "radon", title: "Laser: Radon peaks (radon)", kinds: ["guardrail", "barrier", "cable"] },
  { method: "stereo", title: "Stereo images (stereo)", kinds: ["lane_marking", "lane_marking_dash"] },
];

export class JobPane implements Pane {
  readonly element: HTMLElement;
  private readonly method = element("select", { "aria-label": "Method" });
  private readonly kinds = element("fieldset", {}, element("legend", {}, "Look for"));
  private readonly start: HTMLButtonElement;
  private readonly jobs = element("div", { class: "job-list" });
  private readonly all = new Map<string, Job>();
  private readonly paces = new Map<string, Pace>();

  constructor(private readonly app: App) {
    const { n_points, n_pairs } = app.survey;
    const usable = METHODS.filter(({ method }) =>
      method === "auto" || (method === "stereo" ? n_pairs > 0 : n_points > 0),
    );
    this.method.append(...usable.map(({ method, title }) => element("option", { value: method }, title)));
    this.method.addEventListener("change", () => this.offer());
    this.start = button("Extract lines from the survey", "Extract", () => void this.begin(), { class: "start" });
    this.element = element(
      "div", { class: "job-pane" },
      element("label", {}, "Method", this.method), this.kinds,
      element("p", { class: "quiet" }, "What you accepted, edited, drew or rejected stays as it is."),
      this.start, this.jobs,
    );
    this.offer();
    app.on("job", (job) => this.take(job));
    app.on("connected", (is) => is && void this.load());
    void this.load();
  }

  private offer(): void {
    const chosen = METHODS.find(({ method }) => method === this.method.value);
    const boxes = this.app.survey.kinds
      .filter(({ kind }) => chosen?.kinds.includes(kind))
      .map(({ kind, title }) =>
        element("label", {}, element("input", { type: "checkbox", name: "kind", value: kind, checked: true }), title),
      );
    this.kinds.replaceChildren(element("legend", {}, "Look for"), ...boxes);
  }

  private async load(): Promise<void> {
    try {
      for (const job of await api.jobs()) this.take(job);
    } catch (error) {
      this.app.problem(error);
    }
  }

  private async begin(): Promise<void> {
    const ticked = [...this.kinds.querySelectorAll<HTMLInputElement>("input:checked")].map(({ value }) => value);
    if (ticked.length === 0) return this.app.problem(new Error("Nothing to look for: tick one kind at least."));
    this.start.disabled = true;
    try {
      this.take(await api.startJob(ticked, this.method.value));
    } catch (error) {
      this.app.problem(error);
    }
    this.tell();
  }

  private async cancel(id: string): Promise<void> {
    try {
      this.take(await api.cancelJob(id));
    } catch (error) {
      this.app.problem(error);
    }
  }

  private take(job: Job): void {
    const before = this.all.get(job.id);
    // The answer to a click may come after news that is newer
    if (before && before.state !== "running" && job.state === "running") return;
    const pace = this.paces.get(job.id) ?? new Pace();
    pace.take(job);
    this.paces.set(job.id, pace);
    this.all.set(job.id, job);
    this.tell();
  }

  private tell(): void {
    this.start.disabled = [...this.all.values()].some(({ state }) => state === "running");
    // What runs is not made anew at each step: a button that is being pressed stays
    const there = new Map([...this.jobs.children].map((child) => [(child as HTMLElement).dataset["job"] ?? "", child]));
    const cards = [...this.all.values()].reverse().map((job) => {
      const before = there.get(job.id);
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
        button("Stop this extraction; the lines stay as they are", "Cancel", () => void this.cancel(job.id)),
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
    card.querySelector(".job-step")!.textContent = job.step || "starting";
    card.querySelector(".job-rate")!.textContent = this.paces.get(job.id)?.words(job) ?? "";
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
