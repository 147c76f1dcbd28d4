import type { Component } from "svelte";
import Compare from "../screens/Compare.svelte";
import Fleet from "../screens/Fleet.svelte";
import Flight from "../screens/Flight.svelte";
import Fly from "../screens/Fly.svelte";
import Gains from "../screens/Gains.svelte";
import Library from "../screens/Library.svelte";
import Model from "../screens/Model.svelte";
import Plan from "../screens/Plan.svelte";
import Records from "../screens/Records.svelte";
import Report from "../screens/Report.svelte";
import Response from "../screens/Response.svelte";
import Verify from "../screens/Verify.svelte";
import type { Study } from "./study.svelte";

/** What every screen is given: the log of the address, its study, and the rest of the address. */
export interface Given {
  log: string;
  study: Study | null;
  name: string;
  /** What stands behind the name: a vehicle of a fleet. */
  inner: string;
}

/** A screen: its word in the address, what it is called, and when its link is there. */
export interface Screen {
  name: string;
  title: string;
  component: Component<any>;
  /** Whether it is of one log: its address holds the log, and it is made anew for another. */
  ofLog: boolean;
  /** Whether it can be drawn only where the study is there. */
  needsStudy: boolean;
  shows: (given: Given) => boolean;
}

/** One that cannot be read has the screens of what it was: each tells why, and has its text. */
const hasModels = ({ log, study }: Given) => Boolean(log && (study?.models.length || study?.lackedModels));
/** One without a model still tells filters, fields and a plan. */
const hasStudy = ({ log, study }: Given) => Boolean(log && (study?.file || study?.lack));

/** Whether the address is that of records of a rig, which have no flight. */
export const ofRecords = ({ study }: Given) => location.hash.startsWith("#/records/") || Boolean(study?.file?.settings.record || study?.lack?.of_records);

/** In the order of the links; the first is where the address says nothing else. */
export const SCREENS: Screen[] = [
  { name: "logs", title: "Logs", component: Library, ofLog: false, needsStudy: false, shows: () => true },
  { name: "flight", title: "Flight", component: Flight, ofLog: true, needsStudy: false, shows: (given) => Boolean(given.log) && !ofRecords(given) },
  { name: "response", title: "Response", component: Response, ofLog: true, needsStudy: true, shows: hasModels },
  { name: "gains", title: "Gains", component: Gains, ofLog: true, needsStudy: true, shows: hasModels },
  { name: "compare", title: "Compare", component: Compare, ofLog: true, needsStudy: false, shows: (given) => Boolean(given.log) && (!ofRecords(given) || hasModels(given)) },
  { name: "plan", title: "Plan", component: Plan, ofLog: true, needsStudy: false, shows: (given) => Boolean(given.log) && !ofRecords(given) },
  { name: "records", title: "Records", component: Records, ofLog: true, needsStudy: false, shows: (given) => Boolean(given.log) && ofRecords(given) },
  { name: "model", title: "Model", component: Model, ofLog: true, needsStudy: true, shows: hasModels },
  { name: "verify", title: "Verify", component: Verify, ofLog: true, needsStudy: true, shows: hasModels },
  { name: "report", title: "Report", component: Report, ofLog: true, needsStudy: true, shows: hasStudy },
  { name: "fleet", title: "Fleet", component: Fleet, ofLog: false, needsStudy: false, shows: () => true },
  { name: "fly", title: "Fly", component: Fly, ofLog: false, needsStudy: false, shows: () => true },
];
