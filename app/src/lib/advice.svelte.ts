/** The log that the page is on; empty on records of a rig and where no log is open. */
class Here {
  log = $state("");
}
export const here = new Here();

/** Commands of the terminal that a screen of a log does, and what it is called. */
const SCREEN_OF: Record<string, [string, string]> = {
  tune: ["gains", "Gains"], plan: ["plan", "Plan"], inspect: ["flight", "Flight"], flight: ["flight", "Flight"],
  compare: ["compare", "Compare"], response: ["response", "Response"],
};
/** A command with its files, options and words in capitals; the sentence goes on behind it. */
const COMMAND = /flightid (tune|plan|inspect|flight|compare|response)\b((?: (?:[^;:()\n]*?\.(?:bin|log|ulg|bbl|bfl|tlog|px4log|toml)\b|--[\w-]+|"[^"]*"|[^\s;,:()]*[./][^\s;,:()]*[^\s;,:().]|(?:LOG|STUDY)\b))*)/gi;

export interface AdvicePart { text: string; href: string | null }

/** What to do, with the page's own screens in place of commands that they stand for. */
export function adviceParts(text: string, log: string): AdvicePart[] {
  const parts: AdvicePart[] = [];
  let done = 0;
  for (const found of log ? text.matchAll(COMMAND) : []) {
    const [all, verb, rest] = found;
    if (rest.includes("--controller")) continue;
    const [screen, title] = SCREEN_OF[verb];
    parts.push({ text: text.slice(done, found.index), href: null }, { text: title, href: `#/${screen}/${log}` });
    done = found.index + all.length;
  }
  return [...parts, { text: text.slice(done), href: null }].filter((each) => each.text);
}
