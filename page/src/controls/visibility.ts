// Whether a view is visible: a hidden view neither loads nor draws, and catches up when it appears.

export class Visibility {
  visible = false;
  private onScreen = false;

  // Calls `appeared` when the view becomes visible, and `resized` when its size changes while it is
  constructor(element: HTMLElement, appeared: () => void, resized: () => void) {
    const update = (): void => {
      const now = this.onScreen && !document.hidden;
      if (now === this.visible) return;
      this.visible = now;
      if (now) appeared();
    };
    new IntersectionObserver((entries) => {
      this.onScreen = entries[entries.length - 1]?.isIntersecting ?? false;
      update();
    }).observe(element);
    document.addEventListener("visibilitychange", update);
    new ResizeObserver(() => {
      if (this.visible) resized();
    }).observe(element);
  }
}

// Runs one task at a time; of the tasks requested meanwhile, only the last is run
export class LatestTask {
  private running = false;
  private next: (() => Promise<void>) | null = null;

  async run(task: () => Promise<void>): Promise<void> {
    this.next = task;
    if (this.running) return;
    this.running = true;
    try {
      while (this.next !== null) {
        const now: () => Promise<void> = this.next;
        this.next = null;
        await now();
      }
    } finally {
      this.running = false;
    }
  }
}
