// Opens the survey and puts the parts of the page where they belong.

import * as api from "./app/api";
import { App } from "./app/app";
import { element } from "./controls/element";
import { shellOf } from "./shell/shell";

async function start(): Promise<void> {
  const app = new App(await api.survey());
  document.title = `${app.survey.name} · linework`;
  shellOf(app);
  await app.reload();
  const waiting = new Waiting(app);
  api.live(
    (news) => {
      if (news.type === "changed") app.take(news);
      else if (news.type === "job") app.emit("job", news);
      else if (news.type === "pictures") app.emit("pictures", news);
      else if (news.type === "busy") waiting.tell(news.busy);
      else void app.reload().catch((error: unknown) => app.problem(error));
    },
    (is) => {
      app.emit("connected", is);
      if (!is) void whyAway(app);
      if (is) void api.survey().then(({ busy }) => waiting.tell(busy), () => undefined); // who is away is told of elsewhere
      if (is) void app.reconnected().catch((error: unknown) => app.problem(error));
    },
  );
  document.body.dataset.state = "ready";
}

// The server may still be opening the survey for following, or compiling: everything else works meanwhile
class Waiting {
  private busy = "";

  constructor(private readonly app: App) {}

  tell(busy: string): void {
    if (busy === this.busy) return;
    this.busy = busy;
    const text = busy === "" ? "Everything is ready: lines can be followed now." : `Still ${busy} …`;
    this.app.emit("message", { text, kind: "info" });
  }
}

// Gone, or started anew: then it knows nothing of this session, and says which link to open
async function whyAway(app: App): Promise<void> {
  await api.survey().catch((error: unknown) => {
    if (error instanceof api.ProblemError && error.status !== 0) app.problem(error);
  });
}

start().catch((error: unknown) => {
  reportError(error);
  const text = error instanceof Error ? error.message : String(error);
  document.body.replaceChildren(element("p", { class: "failed", role: "alert" }, text));
  document.body.dataset.state = "failed";
});
