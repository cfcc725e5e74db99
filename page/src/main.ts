// Opens the survey, builds the page and keeps it up to date with the server.

import * as api from "./app/api";
import { App } from "./app/app";
import { element } from "./controls/element";
import { buildShell } from "./shell/shell";

async function start(): Promise<void> {
  const app = new App(await api.survey());
  document.title = `${app.survey.name} · linework`;
  buildShell(app);
  await app.reload();
  const preparation = new Preparation(app);
  api.live(
    (message) => {
      if (message.type === "changed") void app.apply(message);
      else if (message.type === "job") app.emit("job", message);
      else if (message.type === "pictures") app.emit("tiles", message);
      else if (message.type === "busy") preparation.update(message.busy);
      else void app.reload().catch((error: unknown) => app.reportProblem(error));
    },
    (connected) => {
      app.emit("connected", connected);
      if (!connected) return void explainLoss(app);
      void api.survey().then(({ busy }) => preparation.update(busy), () => undefined); // a loss is reported elsewhere
      void app.reconnected().catch((error: unknown) => app.reportProblem(error));
    },
  );
  document.body.dataset.state = "ready";
}

// Reports what the server is still preparing for following (opening the survey, compiling); all else works meanwhile
class Preparation {
  private busy = "";

  constructor(private readonly app: App) {}

  update(busy: string): void {
    if (busy === this.busy) return;
    this.busy = busy;
    const text = busy === "" ? "Ready: lines can be followed now." : `Still ${busy} …`;
    this.app.emit("message", { text, kind: "info" });
  }
}

// A restarted server does not know this session, and its answer says which link to open
async function explainLoss(app: App): Promise<void> {
  await api.survey().catch((error: unknown) => {
    if (error instanceof api.ProblemError && error.status !== 0) app.reportProblem(error);
  });
}

start().catch((error: unknown) => {
  reportError(error);
  const text = error instanceof Error ? error.message : String(error);
  document.body.replaceChildren(element("p", { class: "failed", role: "alert" }, text));
  document.body.dataset.state = "failed";
});
