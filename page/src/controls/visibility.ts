// Whether a view can be seen: what is hidden does not load or draw, and catches up when it is shown.

export class Shown {
  is = false;
  private visible = false;

  // `appeared` is called when the view comes into sight, `resized` when its size changes while it is seen
  constructor(element: HTMLElement, appeared: () => void, resized: () => void) {
    const settle = (): void => {
      const now = this.visible && !document.hidden;
      if (now === this.is) return;
      this.is = now;
      if (now) appeared();
    };
    new IntersectionObserver((entries) => {
      this.visible = entries[entries.length - 1]?.isIntersecting ?? false;
      settle();
    }).observe(element);
    document.addEventListener("visibilitychange", settle);
    new ResizeObserver(() => {
      if (this.is) resized();
    }).observe(element);
  }
}

// Runs one `load` at a time; of those asked for meanwhile only the last is done
export class Latest {
  private running = false;
  private next: (() => Promise<void>) | null = null;

  async ask(load: () => Promise<void>): Promise<void> {
    this.next = load;
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
