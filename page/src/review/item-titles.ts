// The items of the queue in words: their titles, and what a key decides.

import type { App } from "../app/app";
import type { QueueItem } from "../app/documents";
import { actionTitle } from "./action-titles";

const TITLES = {
  line: "Uncertain line", copy: "Measured twice", gap: "Gap", boundary: "Missing boundary", dashes: "Dashes to look at", stretch: "Look over the road", rest: "Other lines",
  sure: "Nothing to check",
};

export function itemTitle(app: App, item: QueueItem): string {
  return ["sure", "rest", "stretch", "dashes"].includes(item.type) ? TITLES[item.type] : `${TITLES[item.type]}: ${app.title(item.kind)}`;
}

export function decisionText({ type, kind, ids, proposal }: QueueItem): string {
  const take = proposal ? [`Y: ${actionTitle(proposal.action)}`] : [];
  const own: Record<QueueItem["type"], string[]> = {
    line: ["A: accept it", "X: reject it", ...(kind === "road_marking_other" ? ["1: make it a lane marking"] : [])],
    copy: ["A: accept it", "X: reject the copy"],
    gap: [...(ids.length === 2 ? ["J: join both lines"] : []), "Shift F: follow on from here"],
    boundary: ["Shift F: follow it here"],
    dashes: ["A: accept the line as it is", "Shift D: add dashes by the paint"],
    stretch: ["Click a line that is wrong, then X: reject it", "Shift F, then click: follow one that is missing"],
    rest: ["A: accept them all", "X: reject them all"],
    sure: ["A: accept them all"],
  };
  return [...own[type], ...take, type === "stretch" ? "Q: looked over" : "Q: dismiss", "N: next"].join(" · ");
}
