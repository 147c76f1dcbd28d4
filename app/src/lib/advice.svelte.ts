import { FORMS } from "./forms";
import { raised } from "./unitWords";

/** The log or records that the page is on; empty where none is open. */
class Here {
  log = $state("");
  ofRig = $state(false);
  /** The screen that is open. */
  open = $state("");
  /** Screens that a link leads to: those of this log, without the one that is open. */
  screens = $state<string[]>([]);
}
export const here = new Here();

/** Commands of the terminal that a screen of a log does, and what it is called. */
const SCREEN_OF: Record<string, [string, string]> = {
  tune: ["gains", "Gains"], plan: ["plan", "Plan"], inspect: ["flight", "Flight"], flight: ["flight", "Flight"],
  compare: ["compare", "Compare"], response: ["response", "Response"],
};
/** A command with its files, options and words in capitals; the sentence goes on behind it. */
const COMMAND = /flightid (tune|plan|inspect|flight|compare|response)\b((?: (?:[^;:()\n]*?\.(?:bin|log|ulg|bbl|bfl|tlog|px4log|toml)\b|--(?:axes|controller|filters) [\w,]+|--[\w-]+|"[^"]*"|[^\s;,:()]*[./][^\s;,:()]*[^\s;,:().]|[^\s;,:()]+(?= LOG\b)|(?:LOG|STUDY)\b))*)/gi;

/** A table that a button of Records writes: what it bridges is shown there. */
const BRIDGE = /: write \[\[conditioning\]\] into the study and below it outliers = \{[^}]*\}, which lies between (?:it|them) and all other samples/;

export interface AdvicePart { text: string; href: string | null }

/** Keys of a study by what the page has for them. */
const inWords = (text: string) =>
  text.replace(/: flightid design plans it/, here.ofRig ? "" : ": flightid plan plans it").replace("leave out by_hand", "press As found").replace(/take these as a proposal: output_low = \S+, output_high = [^\s;]+/, () => `take these as a proposal: a button ${here.open === "gains" ? "under Controller" : "of Gains"} does`).replace(/\btake the form (\w+)/, (all, form) => (FORMS[form] ? `take the form “${FORMS[form]}”` : all));

/** What the open screen is asked in place of its own command. */
function onScreen(screen: string, title: string, options: string) {
  const axes = options.match(/--axes (\S+)/)?.[1].split(",").join(", ");
  return screen === "plan" && axes ? `press ${axes} under Asked for` : `the screen ${title}`;
}

/** What to do, with screens that there are in place of the commands that they stand for. */
export function adviceParts(given: string, log: string, screens: string[]): AdvicePart[] {
  const parts: AdvicePart[] = [];
  const text = raised(inWords(given));
  const table = here.ofRig && screens.includes("records") ? BRIDGE.exec(text) : null;
  if (table) {
    const [before, after] = [text.slice(0, table.index), text.slice(table.index + table[0].length)];
    return [...adviceParts(`${before}, by a click under `, log, screens), { text: "Records", href: `#/records/${log}` }, ...adviceParts(after, log, screens)];
  }
  let done = 0;
  for (const found of text.matchAll(COMMAND)) {
    const [all, verb, rest] = found;
    // A log that is still to be flown: it is opened where all are.
    if (verb === "inspect" && rest === " LOG") {
      parts.push({ text: text.slice(done, found.index), href: null }, { text: "Logs", href: "#/" });
      done = found.index + all.length;
      continue;
    }
    if (rest.includes("--controller") && !here.ofRig) continue;
    const [screen, title] = SCREEN_OF[verb];
    const linked = Boolean(log) && screens.includes(screen);
    if (log && !linked && screen !== here.open) continue;
    const named = log ? onScreen(screen, title, rest) : `${title} of the log`;
    parts.push({ text: text.slice(done, found.index), href: null }, linked ? { text: title, href: `#/${screen}/${log}` } : { text: named, href: null });
    done = found.index + all.length;
  }
  return [...parts, { text: text.slice(done), href: null }].filter((each) => each.text);
}
