// What the server says, document by document. Lengths in metres, world coordinates [east, north, up].

export type Place = [number, number];
export type Vertex = [number, number, number];
export type Run = [number, number];

export interface Line {
  id: string;
  kind: string;
  role: string;
  pattern: string;
  form: string;
  double: boolean;
  method: string;
  source: string;
  width_m: number | null;
  height_m: number | null;
  clearance_m: number | null;
  disagreement_mean_m: number | null;
  disagreement_rms_m: number | null;
  confidence: number;
  time_start_s: number | null;
  time_end_s: number | null;
  review: "" | "accepted" | "edited" | "drawn" | "rejected";
  condition: string;
  note: string;
  xyz: Vertex[];
  sigma_xy_m: (number | null)[];
  sigma_z_m: (number | null)[];
  bridged: Run[]; // [first, last] vertex of every bridged run
  length_m: number;
  bridged_m: number;
}

export interface Kind {
  kind: string;
  title: string;
  colour: string; // "#rrggbb"
  picked: boolean; // a place can be picked on it in points
  picked_in_images: boolean;
}

export interface Survey {
  name: string;
  crs: string; // for people
  bounds: [number, number, number, number];
  middle: Vertex; // where one looks first
  heights: [number, number];
  n_points: number;
  n_pairs: number;
  path: Vertex[];
  warnings: string[];
  lines_file: string; // name only
  who: string;
  kinds: Kind[];
  choices: Record<"role" | "pattern" | "form" | "condition", string[]>;
  images: { name: string; title: string; unit: string }[];
  tiles: { tile_px: number; origin: Place; resolutions: number[] };
  revision: number;
  busy: string; // what the server is still doing, "" when ready
}

export interface Lines {
  revision: number;
  lines: Line[]; // all, or those that came or changed since the revision asked for
  removed: string[];
  can_undo: boolean;
  can_redo: boolean;
}

export interface Changed extends Lines {
  action: string;
  number: number; // of the edit
}

export type Edit =
  | { action: "accept" | "reject" | "restore"; ids: string[] }
  | { action: "delete"; ids: string[] }
  | { action: "split"; id: string; at: Place }
  | { action: "join"; ids: [string, string] }
  | { action: "smooth"; id: string }
  | { action: "reverse"; id: string }
  | { action: "kind"; ids: string[]; kind: string }
  | { action: "set"; ids: string[]; column: string; value: string | boolean }
  | { action: "move"; id: string; vertex: number; to: Place | Vertex } // of a Place the height is re-sampled
  | { action: "insert"; id: string; after: number; to: Place | Vertex }
  | { action: "remove"; id: string; vertex: number }
  | { action: "trim"; id: string; first: number; last: number } // keeps these vertices
  | { action: "draw"; kind: string; xyz: (Place | Vertex)[] }
  | { action: "keep"; trace: string; first: number; last: number; continues?: string } // a followed line
  | { action: "beside"; id: string; kind: string; at: [Place] | [Place, Place] } // as long as the line, or from one to the other
  | { action: "wire"; xyz: [Place | Vertex, Place | Vertex, Place | Vertex] } // a cable: both ends, and a place between
  | { action: "dashes"; ids: string[] } // adds the dashes that lines lack, as paint and rhythm say
  | { action: "dismiss"; key: string }; // nothing to do about an item of the queue

export interface QueueItem {
  key: string; // the same as long as it is about the same thing
  // an unsure line, a line that ends in view of data, a stretch without a boundary, missing dashes
  type: "line" | "gap" | "boundary" | "dashes";
  ids: string[]; // lines it is about; of a gap: the one that ends, and the one that may go on
  kind: string;
  at: Place; // where to look
  box: [number, number, number, number];
  length_m: number; // how much may be wrong or missing
  confidence: number;
  reason: string;
  proposal: Edit | null; // what would settle it, if one thing would
}

export interface EditRecord {
  number: number;
  time_utc: string;
  who: string;
  action: string;
  ids: string[];
  undoes: number;
  undone: boolean;
}

export interface Pair {
  number: number;
  time_s: number;
  chainage_m: number;
  at: Vertex; // of the left camera
  heading_deg: number;
  left: string; // name of the file
  right: string;
}

export interface OperatorKey {
  time_s: number;
  chainage_m: number;
  at: Vertex;
  key: string;
  note: string;
}

export interface PairLine {
  id: string;
  kind: string;
  runs: [number, number][][]; // pixels of the image as it was taken, piece by piece
  bridged: boolean[]; // per piece
}

export interface PairLines {
  number: number;
  width: number;
  height: number;
  left: PairLine[];
  right: PairLine[];
}

export interface Job {
  id: string;
  state: "running" | "done" | "failed" | "cancelled";
  step: string;
  done: number;
  total: number;
  unit: string;
  seconds: number; // since it began; when it is over: how long it took
  message: string;
  counts: Record<string, number> | null; // lines by kind
  report: boolean;
}

// WebSocket /api/live: what happens, to every page
export type Live =
  | ({ type: "changed" } & Changed)
  | ({ type: "job" } & Job)
  | { type: "pictures"; done: number; total: number } // tiles made ahead: when all are, those shown in part are whole
  | { type: "busy"; busy: string } // what the server is still doing, "" when ready
  | { type: "behind" }; // ask for everything anew

// WebSocket /api/follow
export type FollowOrder =
  | { type: "pick"; at: Place; kind: string; toward?: Place; continues?: { id: string; end: "start" | "end" } }
  | { type: "pick_image"; pair: number; side: "left" | "right"; at_px: [number, number]; kind: string }
  | { type: "bridge"; trace: string; end: "start" | "end" } // go on beyond the gap at an end
  | { type: "interrupt" };

export type FollowNews =
  | { type: "area"; corners: Place[] } // the search area
  | { type: "grown"; trace: string; lines: Line[] } // the line so far (first), and what runs beside it
  | { type: "seen"; trace: string; pair: number; left: [number, number][]; right: [number, number][] }
  | {
      type: "stopped";
      trace: string; // kept by the server until the next pick: POST /api/changes {action: "keep"}
      lines: Line[];
      stops: [string, string]; // why it starts and ends where it does
      choices: [string[], string[]]; // at each end: "bridge", "continue"
      distance_m: number;
      interrupted: boolean;
    }
  | { type: "refused"; reason: string; advice: string; works: Place | null; works_px: [number, number] | null };

export interface Problem {
  problem: string; // what is wrong and what to do, in one line
  status: number;
}
