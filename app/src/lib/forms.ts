/** What the page calls the forms of a PID by the words of a study's `controller`. */
export const FORMS: Record<string, string> = { p: "P", pi: "PI", pd: "PD", pid: "PID", pi_d: "PI-D: D on the output alone", i_pd: "I-PD: P and D on the output", two_dof: "PID, share of the set-point chosen" };
