// The documents exchanged with the server. Lengths in metres, world coordinates [east, north, up].

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
  picked: boolean; // can be followed in points
  picked_in_images: boolean; // can be followed in images
}

export interface SurveyImage {
  name: string;
  title: string;
  unit: string;
  classes: { title: string; colour: string }[]; // of an image in classes
}

export interface Survey {
  name: string;
  crs: string; // its name, as shown
  bounds: [number, number, number, number];
  middle: Vertex; // where the views start
  heights: [number, number];
  n_points: number;
  n_pairs: number;
  path: Vertex[]; // of the vehicle
  warnings: string[];
  lines_file: string; // file name without its folder
  who: string;
  kinds: Kind[];
  choices: Record<"role" | "pattern" | "form" | "condition", string[]>;
  choices_of: Record<string, Record<string, string[] | undefined> | undefined>; // by attribute and kind: what a line of the kind can have
  images: SurveyImage[];
  tiles: { tile_px: number; origin: Place; resolutions: number[] };
  revision: number;
  busy: string; // what the server is still doing; "" when ready
}

// The edge that a place drawn by hand snaps to
export interface Snapped {
  at: Place;
  up: number;
  sigma_m: number;
  edge: "foot" | "top" | "break" | "shade" | "stripe" | "rail" | "wire";
  heading_deg: number;
}

// What the search area about a place shows
export interface SearchArea {
  points: number;
  upright_normals: number;
  floor: number;
  intensity?: { edges: number[]; counts: number[]; proposed: [number, number] | null; separation: number };
}

// A template of a cross-section
export interface TemplateNode {
  name: string;
  edge: string; // what defines it: of EDGES
  across_m: number; // to the right of the line's direction
  up_m: number;
  kind: string;
  role: string; // "": none
}

export interface Template {
  name: string;
  nodes: TemplateNode[];
}

export interface Lines {
  revision: number;
  lines: Line[]; // all, or those added or changed since the requested revision
  removed: string[];
  can_undo: boolean;
  can_redo: boolean;
}

export interface Changed extends Lines {
  action: string;
  number: number; // number of the edit
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
  | { action: "move"; id: string; vertex: number; to: Place | Vertex } // given a Place, the height is sampled again
  | { action: "insert"; id: string; after: number; to: Place | Vertex }
  | { action: "remove"; id: string; vertex: number }
  | { action: "trim"; id: string; first: number; last: number } // keeps the vertices first to last
  | { action: "draw"; kind: string; xyz: (Place | Vertex)[] }
  | { action: "keep"; trace: string; first: number; last: number; continues?: string } // a followed line
  | { action: "beside"; id: string; kind: string; at: [Place] | [Place, Place] } // along the whole line, or between two places
  | { action: "wire"; xyz: [Place | Vertex, Place | Vertex, Place | Vertex] } // a cable: both ends and a point between them
  | { action: "template"; id: string; template: string } // the lines of a template beside one
  | { action: "partner"; id: string } // the other rail of a median
  | { action: "wires"; id: string; which: "own" | "all" } // the conductor of a wire from pole to pole; those beside it too
  | { action: "dashes"; ids: string[] } // adds the missing dashes, from the paint and the dash pattern
  | { action: "dismiss"; key: string }; // closes an item of the queue without an edit

export interface QueueItem {
  key: string; // stays the same as long as the item concerns the same thing
  // a line of low confidence, one that may be another line measured twice, a line that ends where there is data, a road without a boundary, missing dashes
  // a stretch of road to look over, all lines too short or too sure for an item each, or all with nothing to check, which one key accepts
  type: "line" | "copy" | "gap" | "boundary" | "dashes" | "stretch" | "rest" | "sure";
  ids: string[]; // lines concerned; for a gap, the line that ends and the one that may continue it; none of a stretch
  kind: string; // "" of a stretch
  at: Place; // where to look
  box: [number, number, number, number];
  length_m: number; // length that may be wrong or missing
  confidence: number;
  reason: string;
  proposal: Edit | null; // the edit that would resolve it, if a single one would
}

// What the points show of an item; places are [offset or chainage, value]
export interface Across {
  label: string;
  points: Run[];
  bins: Run[];
  fit: Run[];
  residuals: Run[];
  middle: Run | null; // of what stands or hangs
}

export interface Along {
  label: string;
  values: Run[];
  stretch: Run;
}

export interface Evidence {
  across: Across | null;
  along: Along | null;
  facts: [name: string, value: string][];
}

// Lines in which the fault may be that an edit mended
export interface AlikeLines {
  edit: number; // number of the edit that taught it
  kind: string;
  mend: { action: "reject" | "delete" } | { action: "kind"; kind: string } | { action: "set"; column: string; value: string | boolean } | null;
  n_looked: number;
  items: AlikeItem[]; // the most alike first
}

export interface AlikeItem {
  id: string;
  at: Place;
  box: [number, number, number, number];
  length_m: number;
  reason: string;
  is_very: boolean;
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
  at: Vertex; // position of the left camera
  heading_deg: number;
  left: string; // file name
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
  runs: [number, number][][]; // pixels of the raw (distorted) image, run by run
  bridged: boolean[]; // per run
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
  seconds: number; // since it started; once finished, its duration
  message: string;
  counts: Record<string, number> | null; // lines by kind
  report: boolean;
}

// WebSocket /api/live: broadcast to every page
export type LiveMessage =
  | ({ type: "changed" } & Changed)
  | ({ type: "job" } & Job)
  | { type: "pictures"; done: number; total: number } // tiles rendered ahead; when all are, partly rendered ones are complete
  | { type: "busy"; busy: string } // what the server is still doing; "" when ready
  | { type: "behind" }; // messages were dropped: reload

// WebSocket /api/follow
export type FollowRequest =
  | { type: "pick"; at: Place; kind: string; template?: string; toward?: Place; continues?: { id: string; end: "start" | "end" } }
  | { type: "pick_image"; pair: number; side: "left" | "right"; at_px: [number, number]; kind: string }
  | { type: "bridge"; trace: string; end: "start" | "end"; template?: string } // follow on beyond the gap at an end
  | { type: "interrupt" };

export type FollowMessage =
  | { type: "area"; corners: Place[] } // the search area
  | { type: "grown"; trace: string; lines: Line[] } // first the line so far, then the lines beside it
  | { type: "seen"; trace: string; pair: number; left: [number, number][]; right: [number, number][] }
  | {
      type: "stopped";
      trace: string; // held by the server until the next pick; saved by POST /api/changes {action: "keep"}
      lines: Line[];
      unseen?: string[]; // nodes of the template that the points show nowhere
      left_out?: string; // the template that was interrupted: none of its lines are there; "": none was
      stops: [string, string]; // why it stopped at the start and at the end
      choices: [string[], string[]]; // at each end: "bridge", "continue"
      distance_m: number;
      interrupted: boolean;
    }
  | { type: "refused"; reason: string; advice: string; works: Place | null; works_px: [number, number] | null };

export interface Problem {
  problem: string; // what went wrong and what to do about it, in one line
  status: number;
}
