// While a line grows, its next metres come before the 3-D view: drawing a hundred thousand points takes all that a
// small machine has (0.6 s of the 0.8 s to the first metres, without a graphics card).

import type { App } from "../app/app";

const LONGEST_MS = 1500; // a line that grows for long is shown now and then

export class Calm {
  private readonly waiting = new Map<string, () => void>();
  private timer = 0;

  constructor(app: App, private readonly isBusy: () => boolean) {
    app.on("growth", ({ state }) => {
      if (state !== "growing") this.run();
    });
  }

  // Do something when nothing grows; of what has one name, only the last
  when(name: string, run: () => void, isBusy = this.isBusy()): void {
    if (!isBusy) return run();
    this.waiting.set(name, run);
    this.timer ||= window.setTimeout(() => this.run(), LONGEST_MS);
  }

  private run(): void {
    window.clearTimeout(this.timer);
    this.timer = 0;
    const all = [...this.waiting.values()];
    this.waiting.clear();
    for (const run of all) run();
  }
}
