import type { Job, ShownFinding } from "./types";

/** Why there are no files; what the light above has said in full is not said again. */
export const noFiles = (refusal: string, reasons: ShownFinding[]) =>
  reasons.some((each) => refusal.includes(each.message) || each.message.includes(refusal)) ? "the reason stands above." : refusal;

/** When files come: not by themselves where their tuning was cancelled or failed. */
export const filesFollow = (work: Job | null | undefined) =>
  work?.state === "cancelled" ? "No files of these gains: their tuning was cancelled." : work?.state === "failed" ? "No files: see above." : "The files follow when the gains have settled.";
