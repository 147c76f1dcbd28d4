import type { Job, ShownFinding } from "./types";

/** Why there are no files; what the light above has said in full is not said again. */
export const noFiles = (refusal: string, reasons: ShownFinding[]) =>
  reasons.some((each) => refusal.includes(each.message) || each.message.includes(refusal)) ? "the reason stands above." : refusal;

/** When files come: not by themselves where their tuning was cancelled or failed. */
export const filesFollow = (work: Job | null | undefined) =>
  work?.state === "cancelled" ? "No files of these gains: their tuning was cancelled." : work?.state === "failed" ? "No files: see above." : "The files follow when the gains have settled.";

/** What gains were asked for: how firm, and of a rig the form of its controller. */
interface Asked { preset: string; form: string }

/**
 * Whose numbers a screen shows while those of its study are not there; names stand in back-quotes.
 *
 * `hand` is the axis whose numbers are already of its sliders, and whether of where they stand now.
 */
export function oldNumbers(shown: Asked, wanted: Asked, hand: { axis: string; now: boolean } | null, forms: Record<string, string> = {}): string {
  const form = wanted.form !== "" && shown.form !== wanted.form;
  const named = (each: Asked) => [each.preset, ...(form ? [forms[each.form] ?? each.form] : [])].join(", ");
  if (named(shown) !== named(wanted)) return `The numbers shown are still those of \`${named(shown)}\`; \`${named(wanted)}\` has none yet.`;
  if (hand) return `The numbers of ${hand.axis} ${hand.now ? "are of its sliders as they stand" : "follow its sliders"}; files and other axes are still of the study before its last change.`;
  return "The numbers shown are of the study before its last change.";
}

/** Where gains come from and what they promise, in a sentence. */
export const promised = (byHand: boolean, preset: string, sentence: string) => `${byHand ? "Set by hand" : `Found by the search, ${preset}`}: ${sentence}`;
