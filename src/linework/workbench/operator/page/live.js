// The operator's keys. A press is shown as saved only when the server has it on its disk; until then it is sent again.

const REFRESH_MS = 500; // how often the state is asked for: twice in the second that a power cut may cost
const AGAIN_MS = 1000; // how long a press that was not saved waits until it is sent again
const MOST_COLUMNS = 6; // of keys: narrower ones are not hit while the van shakes

const element = (id) => document.getElementById(id);
const waiting = new Map(); // presses that are not saved yet, by their identity
let state = null;

async function send(path, document_) {
  const answer = await fetch(path, {
    method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(document_),
    signal: AbortSignal.timeout(5000),
  });
  if (answer.ok) return answer.json();
  const problem = await answer.json().catch(() => ({ problem: `error ${answer.status}` }));
  throw Object.assign(new Error(problem.problem), { status: answer.status });
}

function press(name) {
  const one = { key: name, press: crypto.randomUUID(), at: performance.now(), problem: "" };
  waiting.set(one.press, one);
  show();
  deliver(one);
}

async function deliver(one) {
  try {
    const ago_s = Math.min((performance.now() - one.at) / 1000, 600);
    await send("/api/live/presses", { key: one.key, press: one.press, ago_s });
    waiting.delete(one.press);
    await refresh();
  } catch (error) {
    one.problem = error.message;
    if (error.status >= 400 && error.status < 500 && error.status !== 429) {
      one.failed = true; // sending it again would not help
      setTimeout(() => { waiting.delete(one.press); show(); }, 8000);
    } else {
      setTimeout(() => deliver(one), AGAIN_MS);
    }
    show();
  }
}

async function undo(identity, button) {
  button.disabled = true;
  try {
    await send("/api/live/undo", { press: identity });
  } catch (error) {
    element("lag").textContent = error.message;
    button.disabled = false;
  }
  await refresh();
}

async function refresh() {
  try {
    const answer = await fetch("/api/live", { signal: AbortSignal.timeout(5000) });
    if (!answer.ok) throw new Error((await answer.json()).problem);
    state = await answer.json();
    element("lag").textContent = state.position === null ? "no position" : `${state.lag_s.toFixed(1)} s behind`;
    document.querySelector("header").classList.toggle("bad", state.notices.some((n) => n.lasts));
  } catch (error) {
    element("lag").textContent = `no connection: ${error.message}`;
    document.querySelector("header").classList.add("bad");
  }
  show();
}

function show() {
  if (state === null) return;
  const { pairs } = state;
  const bad = pairs.failed ? `, ${pairs.failed} unreadable` : "";
  element("pairs").textContent = `${pairs.looked} pairs, ${state.pairs_per_s} /s, ${pairs.skipped} skipped${bad}`;
  element("position").textContent = state.sigma_m === null ? "" : `± ${state.sigma_m.toFixed(2)} m`;
  element("driven").textContent = `${(state.driven_m / 1000).toFixed(2)} km`;
  showKeys();
  showPresses();
  element("notices").replaceChildren(...state.notices.map((one) => {
    const item = document.createElement("li");
    item.textContent = one.text;
    if (one.lasts) item.className = "lasts";
    return item;
  }));
}

const label = (one) => (one.span === "" ? one.key : `${one.key}: ${one.span}`);
const place = (one) => (one.place === null ? `${one.time_s.toFixed(1)} s` : `${one.place[4].toFixed(0)} m, ${one.time_s.toFixed(1)} s`);

// Rows are made anew only when one has changed, so that no button is replaced under a finger
let shownPresses = "";

function showPresses() {
  const unsaved = [...waiting.values()].reverse().map((one) =>
    [one.key, one.failed ? one.problem : `not saved yet ${one.problem}`, one.failed ? "failed" : "waiting"]);
  const rows = [...unsaved, ...state.presses.map((one) => [label(one), place(one), "", one.press])];
  const shown = JSON.stringify(rows);
  if (shown === shownPresses) return;
  shownPresses = shown;
  element("presses").replaceChildren(...rows.map((one) => row(...one)));
}

function row(name, detail, kind, identity) {
  const item = document.createElement("li");
  if (kind) item.className = kind;
  const text = document.createElement("span");
  const small = document.createElement("small");
  text.textContent = name;
  small.textContent = detail;
  text.append(small);
  item.append(text);
  if (identity) {
    const button = document.createElement("button");
    button.textContent = "Undo";
    button.dataset.press = identity;
    button.addEventListener("click", () => undo(identity, button));
    item.append(button);
  }
  return item;
}

// Keys are made once, so that none is replaced under a finger
function showKeys() {
  const keys = element("keys");
  if (keys.childElementCount !== state.keys.length) {
    keys.style.setProperty("--columns", Math.min(Math.ceil(Math.sqrt(state.keys.length)) || 1, MOST_COLUMNS));
    keys.replaceChildren(...state.keys.map((key) => {
      const button = document.createElement("button");
      button.dataset.key = key.name;
      // As the finger comes down: a van at 20 m/s is 2 m further when it is lifted
      button.addEventListener("pointerdown", (event) => {
        if (!event.isPrimary || event.button !== 0) return;
        button.classList.add("down");
        press(key.name);
      });
      for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
        button.addEventListener(end, () => button.classList.remove("down"));
      }
      button.addEventListener("keydown", (event) => {
        if (!event.repeat && (event.key === "Enter" || event.key === " ")) press(key.name);
      });
      return button;
    }));
  }
  state.keys.forEach((key, i) => {
    const button = keys.children[i];
    button.textContent = key.span ? `${key.name} ${key.open ? "■" : "▶"}` : key.name;
    button.classList.toggle("span", key.span);
    button.classList.toggle("open", key.open);
    button.setAttribute("aria-pressed", String(key.open));
  });
}

window.addEventListener("contextmenu", (event) => event.preventDefault());
refresh();
setInterval(refresh, REFRESH_MS);
