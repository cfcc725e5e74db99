// Opens the survey and puts the parts of the page where they belong.

import * as api from "./api";
import { App } from "./app";
import { element } from "./element";
import { shellOf } from "./shell";

async function start(): Promise<void> {
  const app = new App(await api.survey());
  document.title = `${app.survey.name} · linework`;
  shellOf(app);
  await app.reload();
  await whatCanBeUndone(app);
  api.live(
    (news) => {
      if (news.type === "changed") app.take(news);
      else if (news.type === "job") app.emit("job", news);
      else if (news.type === "pictures") app.emit("pictures", news);
      else void app.reload().catch((error: unknown) => app.problem(error));
    },
    (is) => {
      app.emit("connected", is);
      if (!is) void whyAway(app);
      if (is) void app.reconnected().catch((error: unknown) => app.problem(error));
    },
  );
  document.body.dataset.state = "ready";
  void untilReady(app).catch(() => undefined); // a server that goes away meanwhile is told of elsewhere
}

// The server may still be opening the survey for following: everything else works meanwhile
async function untilReady(app: App): Promise<void> {
  let { busy } = app.survey;
  if (busy === "") return;
  app.emit("message", { text: `Still ${busy} …`, kind: "info" });
  while (busy !== "") {
    await new Promise((done) => setTimeout(done, 1000));
    ({ busy } = await api.survey());
  }
  app.emit("message", { text: "Lines can be followed now.", kind: "info" });
}

// Gone, or started anew: then it knows nothing of this session, and says which link to open
async function whyAway(app: App): Promise<void> {
  await api.survey().catch((error: unknown) => {
    if (error instanceof api.ProblemError && error.status !== 0) app.problem(error);
  });
}

async function whatCanBeUndone(app: App): Promise<void> {
  const records = await api.history();
  const can_undo = records.some(({ undoes, undone }) => undoes === 0 && !undone);
  app.emit("undo", { can_undo, can_redo: records.some(({ undone }) => undone) });
}

start().catch((error: unknown) => {
  reportError(error);
  const text = error instanceof Error ? error.message : String(error);
  document.body.replaceChildren(element("p", { class: "failed", role: "alert" }, text));
  document.body.dataset.state = "failed";
});
