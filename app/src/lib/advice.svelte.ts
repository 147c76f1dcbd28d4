/** The log or records that the page is on; empty where none is open. */
class Here {
  log = $state("");
  ofRig = $state(false);
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
const COMMAND = /flightid (tune|plan|inspect|flight|compare|response)\b((?: (?:[^;:()\n]*?\.(?:bin|log|ulg|bbl|bfl|tlog|px4log|toml)\b|--controller \w+|--[\w-]+|"[^"]*"|[^\s;,:()]*[./][^\s;,:()]*[^\s;,:().]|(?:LOG|STUDY)\b))*)/gi;

export interface AdvicePart { text: string; href: string | null }

/** What to do, with screens that there are in place of the commands that they stand for. */
export function adviceParts(text: string, log: string, screens: string[]): AdvicePart[] {
  const parts: AdvicePart[] = [];
  let done = 0;
  for (const found of log ? text.matchAll(COMMAND) : []) {
    const [all, verb, rest] = found;
    if (rest.includes("--controller") && !here.ofRig) continue;
    const [screen, title] = SCREEN_OF[verb];
    if (!screens.includes(screen)) continue;
    parts.push({ text: text.slice(done, found.index), href: null }, { text: title, href: `#/${screen}/${log}` });
    done = found.index + all.length;
  }
  return [...parts, { text: text.slice(done), href: null }].filter((each) => each.text);
}
