// The server's routes, one function each, and its two WebSockets. Same origin only; the session is a cookie.

import type {
  AlikeLines, Changed, Edit, EditRecord, Evidence, FollowMessage, FollowRequest, Job, Lines, LiveMessage, OperatorKey, Pair,
  PairLines, Place, Problem, QueueItem, SearchArea, Snapped, Survey, Template,
} from "./documents";

export class ProblemError extends Error {
  constructor(readonly status: number, problem: string) {
    super(problem);
  }
}

async function request(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, { credentials: "same-origin", ...init });
  } catch {
    throw new ProblemError(0, "The workbench does not answer. Is `linework serve` still running?");
  }
  if (response.ok) return response;
  const problem = (await response.json().catch(() => null)) as Problem | null;
  throw new ProblemError(response.status, problem?.problem ?? `The server answered with status ${response.status}.`);
}

async function getJson<T>(path: string): Promise<T> {
  return (await (await request(path)).json()) as T;
}

async function sendJson<T>(method: string, path: string, body?: unknown, more: HeadersInit = {}): Promise<T> {
  const response = await request(path, {
    method,
    headers: { "Content-Type": "application/json", ...more },
    body: JSON.stringify(body ?? {}),
  });
  return (await response.json()) as T;
}

export const survey = () => getJson<Survey>("/api/survey");
export const lines = (since = 0) => getJson<Lines>(`/api/lines?since=${since}`);
// `revision`: what the page had when the user acted; 412 if one of the lines has changed since. `key`: unique to the edit;
// an edit resent under the same key is saved once and answered alike
export const change = (edit: Edit, revision: number, key: string) =>
  sendJson<Changed>("POST", "/api/changes", { revision, edit }, { "Idempotency-Key": key });
export const undo = () => sendJson<Changed>("POST", "/api/undo");
export const redo = () => sendJson<Changed>("POST", "/api/redo");
export const history = () => getJson<EditRecord[]>("/api/history");
export const queue = () => getJson<QueueItem[]>("/api/queue");
export const evidence = (kind: string, [east, north]: Place, line: string, beyond: boolean) =>
  getJson<Evidence>(
    `/api/evidence?kind=${encodeURIComponent(kind)}&east=${east}&north=${north}&line=${encodeURIComponent(line)}&beyond=${beyond}`,
  );
export const alike = (edit: number) => getJson<AlikeLines>(`/api/alike?edit=${edit}`);
export const heights = (kind: string, places: Place[]) =>
  sendJson<{ heights: (number | null)[] }>("POST", "/api/heights", { kind, places });

export const searchArea = ([east, north]: Place) =>
  getJson<SearchArea>(`/api/search-area?east=${east}&north=${north}`);

export const snap = (kind: string, [east, north]: Place, reach_m: number, heading_deg: number | null) =>
  getJson<{ found: Snapped | null }>(
    `/api/snap?kind=${encodeURIComponent(kind)}&east=${east}&north=${north}&reach_m=${reach_m}${heading_deg === null ? "" : `&heading_deg=${heading_deg}`}`,
  );

// `version` makes another address: a browser shows an image that it already shows again without asking for it
export const tileUrl = (image: string, z: number, col: number, row: number, version: number) =>
  `/api/tiles/${image}/${z}/${col}/${row}${version ? `?version=${version}` : ""}`;

// Points as sendJson: n (uint32), padding, origin (3 float64), xyz relative to it (n * 3 float32), height above the road
// (n int16, centimetres; 32767: unknown), intensity (n uint8, scaled by the range of the whole survey). Little endian.
export interface Points {
  n: number;
  origin: [number, number, number];
  xyz: Float32Array;
  intensity: Uint8Array;
  above_cm: Int16Array;
}

function unpackPoints(buffer: ArrayBuffer): Points {
  const view = new DataView(buffer);
  const n = view.getUint32(0, true);
  const origin: [number, number, number] = [8, 16, 24].map((at) => view.getFloat64(at, true)) as [number, number, number];
  const xyz = new Float32Array(buffer.slice(32, 32 + 12 * n));
  const above_cm = new Int16Array(buffer.slice(32 + 12 * n, 32 + 14 * n));
  const intensity = new Uint8Array(buffer.slice(32 + 14 * n, 32 + 15 * n));
  return { n, origin, xyz, intensity, above_cm };
}

export async function points(bounds: [number, number, number, number], most: number): Promise<Points> {
  const [west, south, east, north] = bounds;
  const response = await request(`/api/points?west=${west}&south=${south}&east=${east}&north=${north}&most=${most}`);
  return unpackPoints(await response.arrayBuffer());
}

// Points of a cross-section: x to the right of `heading_deg`, y along it, z up, relative to `at`
export async function section(
  at: Place, heading_deg: number, half_width_m: number, thickness_m: number,
): Promise<Points> {
  const query = `east=${at[0]}&north=${at[1]}&heading_deg=${heading_deg}&half_width_m=${half_width_m}&thickness_m=${thickness_m}`;
  return unpackPoints(await (await request(`/api/section?${query}`)).arrayBuffer());
}

// Points along a stretch of a line, or without one of the van's path: x the chainage from `origin`, y the offset to the right
export async function straightened(line: string, from_m: number, to_m: number, half_width_m: number): Promise<Points> {
  const query = `line=${encodeURIComponent(line)}&from_m=${from_m}&to_m=${to_m}&half_width_m=${half_width_m}`;
  return unpackPoints(await (await request(`/api/straightened?${query}`)).arrayBuffer());
}

export interface ExportOrder {
  format: string;
  kinds: string[];
  ids: string[] | null; // null: all lines of the kinds
  coded: boolean; // with the layers and codes of the survey's table
  lanes: boolean;
  location: string; // of lanelets
}

export const codes = () => getJson<{ text: string }>("/api/codes");
export const saveCodes = (text: string) => sendJson<{ text: string }>("PUT", "/api/codes", { text });

export const templates = () => getJson<{ templates: Template[] }>("/api/templates");
// One by its name: the others stay as the file has them now
export const saveTemplate = (one: Template) => sendJson<{ templates: Template[] }>("PUT", "/api/templates", one);
export const removeTemplate = (name: string) =>
  sendJson<{ templates: Template[] }>("DELETE", `/api/templates?name=${encodeURIComponent(name)}`);

export async function exportLines(order: ExportOrder): Promise<{ name: string; blob: Blob; warnings: string[] }> {
  const response = await request("/api/export", {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(order),
  });
  const name = /filename\*=UTF-8''(.*)$/.exec(response.headers.get("Content-Disposition") ?? "")?.[1] ?? `lines.${order.format}`;
  const warnings = decodeURIComponent(response.headers.get("Linework-Warnings") ?? "");
  return { name: decodeURIComponent(name), blob: await response.blob(), warnings: warnings.split("\n").filter(Boolean) };
}

export const pairs = () => getJson<Pair[]>("/api/pairs");
export const keys = () => getJson<OperatorKey[]>("/api/keys");
export const pairLines = (number: number) => getJson<PairLines>(`/api/pairs/${number}/lines`);
export const imageUrl = (number: number, side: "left" | "right") => `/api/pairs/${number}/${side}`;
export const thumbnailUrl = (number: number) => `/api/pairs/${number}/thumbnail`;

export const jobs = () => getJson<Job[]>("/api/jobs");
export const startJob = (features: string[], method: string) => sendJson<Job>("POST", "/api/jobs", { features, method });
export const cancelJob = (id: string) => sendJson<Job>("DELETE", `/api/jobs/${id}`);
export const chainageUrl = (everyM: number, standard: string) => `/api/chainage?every_m=${everyM}&standard=${standard}`;
export const reportUrl = (id: string) => `/api/jobs/${id}/report`;

function socket(path: string): WebSocket {
  return new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`);
}

// Live messages, with reconnection; `connected` reports each loss and return, after which missed messages must be fetched
export function live(received: (message: LiveMessage) => void, connected: (isConnected: boolean) => void): void {
  const open = socket("/api/live");
  open.onopen = () => connected(true);
  open.onmessage = (event) => received(JSON.parse(event.data as string) as LiveMessage);
  open.onclose = () => {
    connected(false);
    setTimeout(() => live(received, connected), 1000);
  };
}

// The WebSocket for following lines, opened on first use
export class Follower {
  private open: WebSocket | null = null;
  constructor(
    private readonly received: (message: FollowMessage) => void, private readonly disconnected: () => void,
  ) {}

  send(request: FollowRequest): void {
    if (this.open === null || this.open.readyState > WebSocket.OPEN) {
      this.open = socket("/api/follow");
      this.open.onmessage = (event) => this.received(JSON.parse(event.data as string) as FollowMessage);
      this.open.onclose = () => this.disconnected();
    }
    const open = this.open;
    const text = JSON.stringify(request);
    if (open.readyState === WebSocket.OPEN) open.send(text);
    else open.addEventListener("open", () => open.send(text), { once: true });
  }
}
