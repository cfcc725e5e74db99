// The server's routes, one function each. Everything is same-origin; the session is a cookie.

import type {
  Changed, Edit, EditRecord, FollowNews, FollowOrder, Job, Lines, Live, OperatorKey, Pair, PairLines, Place,
  Problem, QueueItem, Survey,
} from "./documents";

export class ProblemError extends Error {
  constructor(readonly status: number, problem: string) {
    super(problem);
  }
}

async function asked(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, { credentials: "same-origin", ...init });
  } catch {
    throw new ProblemError(0, "The workbench does not answer: is `linework serve` still running?");
  }
  if (response.ok) return response;
  const problem = (await response.json().catch(() => null)) as Problem | null;
  throw new ProblemError(response.status, problem?.problem ?? `The server answered ${response.status}.`);
}

async function got<T>(path: string): Promise<T> {
  return (await (await asked(path)).json()) as T;
}

async function sent<T>(method: string, path: string, body?: unknown, more: HeadersInit = {}): Promise<T> {
  const response = await asked(path, {
    method,
    headers: { "Content-Type": "application/json", ...more },
    body: JSON.stringify(body ?? {}),
  });
  return (await response.json()) as T;
}

export const survey = () => got<Survey>("/api/survey");
export const lines = (since = 0) => got<Lines>(`/api/lines?since=${since}`);
// `revision`: what the page knew when the person acted; 412 if one of the lines has changed since. `key`: of this edit
// alone; sent again under it, the edit is saved once, and the answer is the same
export const change = (edit: Edit, revision: number, key: string) =>
  sent<Changed>("POST", "/api/changes", { revision, edit }, { "Idempotency-Key": key });
export const undo = () => sent<Changed>("POST", "/api/undo");
export const redo = () => sent<Changed>("POST", "/api/redo");
export const history = () => got<EditRecord[]>("/api/history");
export const queue = () => got<QueueItem[]>("/api/queue");
export const heights = (kind: string, places: Place[]) =>
  sent<{ heights: (number | null)[] }>("POST", "/api/heights", { kind, places });

export const tileUrl = (image: string, z: number, col: number, row: number) =>
  `/api/tiles/${image}/${z}/${col}/${row}`;

// Points: n (uint32), origin (3 float64), then xyz (n * 3 float32, from the origin), intensity (n uint8, scaled by
// what the whole survey holds), height above the road (n int16, centimetres, 32767: unknown). Little endian.
export interface Points {
  n: number;
  origin: [number, number, number];
  xyz: Float32Array;
  intensity: Uint8Array;
  above_cm: Int16Array;
}

function unpacked(buffer: ArrayBuffer): Points {
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
  const response = await asked(`/api/points?west=${west}&south=${south}&east=${east}&north=${north}&most=${most}`);
  return unpacked(await response.arrayBuffer());
}

// A slice across `heading_deg`: x is across (positive to the right of the heading), y along it, z up; origin: the place
export async function section(
  at: Place, heading_deg: number, half_width_m: number, thickness_m: number,
): Promise<Points> {
  const query = `east=${at[0]}&north=${at[1]}&heading_deg=${heading_deg}&half_width_m=${half_width_m}&thickness_m=${thickness_m}`;
  return unpacked(await (await asked(`/api/section?${query}`)).arrayBuffer());
}

export const pairs = () => got<Pair[]>("/api/pairs");
export const keys = () => got<OperatorKey[]>("/api/keys");
export const pairLines = (number: number) => got<PairLines>(`/api/pairs/${number}/lines`);
export const imageUrl = (number: number, side: "left" | "right") => `/api/pairs/${number}/${side}`;
export const thumbnailUrl = (number: number) => `/api/pairs/${number}/thumbnail`;

export const jobs = () => got<Job[]>("/api/jobs");
export const startJob = (features: string[], method: string) => sent<Job>("POST", "/api/jobs", { features, method });
export const cancelJob = (id: string) => sent<Job>("DELETE", `/api/jobs/${id}`);
export const reportUrl = (id: string) => `/api/jobs/${id}/report`;

function socket(path: string): WebSocket {
  return new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`);
}

// What happens, for ever: after a break the listener is told by `connected` and has to ask for what it missed
export function live(news: (message: Live) => void, connected: (is: boolean) => void): void {
  const open = socket("/api/live");
  open.onopen = () => connected(true);
  open.onmessage = (event) => news(JSON.parse(event.data as string) as Live);
  open.onclose = () => {
    connected(false);
    setTimeout(() => live(news, connected), 1000);
  };
}

// One WebSocket for following lines; `say` opens it when it is needed
export class Follower {
  private open: WebSocket | null = null;
  constructor(private readonly news: (message: FollowNews) => void, private readonly lost: () => void) {}

  say(order: FollowOrder): void {
    if (this.open === null || this.open.readyState > WebSocket.OPEN) {
      this.open = socket("/api/follow");
      this.open.onmessage = (event) => this.news(JSON.parse(event.data as string) as FollowNews);
      this.open.onclose = () => this.lost();
    }
    const open = this.open;
    const text = JSON.stringify(order);
    if (open.readyState === WebSocket.OPEN) open.send(text);
    else open.addEventListener("open", () => open.send(text), { once: true });
  }
}
