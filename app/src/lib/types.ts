// Made by tools/page_types.py from src/flightid/app/*schemas.py; not to be edited.

/** The best that a log gives of one axis. */
export interface AxisCard {
  axis: string;
  kind: "model" | "step" | "nothing";
  light: "green" | "amber" | "red" | "unknown";
  headline: string;
  detail: string;
  action: string;
  model: string | null;
  band_rad_s: [number, number] | null;
  coherence: number | null;
  first: boolean;
}

/** Gains of an axis and what they promise. */
export interface AxisGains {
  axis: string;
  by_hand: boolean;
  light: "green" | "amber" | "red" | "unknown";
  sentence: string;
  is_stable: boolean;
  sliders: GainSlider[];
  margins: MarginRow[];
  curves: TimeCurve[];
  loops: NicholsCurve[];
  steps: GainStep[];
  filters: string[];
  findings: ShownFinding[];
  controller: RigController | null;
}

/** A number of a loop on both sides, and their difference, in words with interval and unit. */
export interface ChangeRow {
  loop: string;
  name: string;
  before: string;
  after: string;
  difference: string;
  significant: boolean;
  alone: boolean;
}

/** Both sides. */
export interface CompareRequest {
  before: ComparedSide;
  after: ComparedSide;
}

/** A flight, or a part of it; as the first side also the promise of its study. */
export interface ComparedSide {
  log: string;
  span_s: [number, number] | null;
  promised: boolean;
}

/** A comparison. */
export interface ComparisonPart {
  names: [string, string];
  promised: boolean;
  light: "green" | "amber" | "red" | "unknown";
  rows: ChangeRow[];
  settings: [string, string, string][];
  steps: LoopSteps[];
  findings: ShownFinding[];
  notes: string[];
  following: GainFile | null;
  back: GainFile | null;
}

/** A way to write a PID of its own, with its gains. */
export interface ControllerForm {
  name: string;
  law: string;
  gains: string;
}

/** Handling qualities of a flight, by the decision tree.

Each answer is one of its three questions; the rating lies in what they leave. */
export interface CooperHarperRating {
  controllable: boolean;
  adequate: boolean | null;
  satisfactory: boolean | null;
  rating: number;
  task: string;
  comment: string;
}

/** Words as they are typed. */
export interface Draft {
  text: string;
  name: string;
  before: string;
}

/** All drafts of a folder. */
export interface Drafts {
  folder: string;
  drafts: PlacedDraft[];
}

/** One key and its value; None takes it out. */
export interface Edit {
  path: (string | number)[];
  value: unknown;
}

/** Edits that are made together. */
export interface Edits {
  edits: Edit[];
}

/** Fields of a message with their units. */
export interface FieldGroup {
  message: string;
  instances: number[];
  rate_hz: number | null;
  fields: Record<string, string>;
}

/** What the filters make of the noise of one axis; spectra in dB of 1 (rad/s)² per Hz. */
export interface FilterAxis {
  axis: string;
  ahead: (number | null)[];
  flown: (number | null)[];
  edited: (number | null)[];
  phase_flown_deg: number;
  phase_edited_deg: number;
  noise_flown_percent: number;
  noise_edited_percent: number;
  stages: string[];
}

/** Filters to try, by the autopilot's names; the others stay as flown. */
export interface FilterRequest {
  values: Record<string, number>;
}

/** Filters of a vehicle on the noise of its flight. */
export interface FilterScreen {
  values: FilterValue[];
  refused: Record<string, string>;
  highest: number;
  suggested: Record<string, number>;
  at_hz: number;
  measured: boolean;
  raw: boolean;
  seen_hz: number;
  frequency_hz: number[];
  axes: FilterAxis[];
  findings: ShownFinding[];
  files: GainFile[];
  python: string;
}

/** A parameter of a filter: as flown, and as it is tried. */
export interface FilterValue {
  name: string;
  flown: number;
  known: boolean;
  value: number;
}

/** The fleet file that was written, and what was chosen. */
export interface FleetDraft {
  fleet: FleetItem;
  said: string[];
}

/** A flight of a vehicle; `here` is its log in the workspace, where the page has it. */
export interface FleetFlight {
  log: string;
  flown_at: string;
  light: string;
  address: string;
  outcome: string;
  here: string | null;
}

/** Something that was done to a vehicle, or to all (null). */
export interface FleetHappening {
  date: string;
  what: string;
  vehicle: string | null;
}

/** A parameter of a vehicle over time, with the level behind it and when it changed. */
export interface FleetHistory {
  vehicle: string;
  type: string;
  model: string;
  name: string;
  unit: string;
  label: string;
  time_s: number[];
  values: number[];
  half: number[];
  level: number[];
  low: number[];
  high: number[];
  changed: boolean;
  kind: string;
  words: string;
  changed_s: [number, number] | null;
  events: [number, string][];
  logs: string[];
}

/** A fleet file or a catalogue of the workspace. */
export interface FleetItem {
  id: string;
  path: string;
  is_file: boolean;
}

/** All fleets, and folders that could be one. */
export interface FleetListing {
  fleets: FleetItem[];
  folders: LogFolder[];
}

/** The answers of a fleet, as its report gives them. */
export interface FleetPart {
  title: string;
  words: string;
  verdict: string;
  level: number;
  vehicles: FleetVehicle[];
  types: FleetType[];
  histories: FleetHistory[];
  refused: FleetSheet;
  undated: number;
}

/** One SELECT. */
export interface FleetQuery {
  sql: string;
}

/** Its answer, whole; `seconds` are of the worker. */
export interface FleetRows {
  columns: string[];
  rows: ((string | number | number | boolean | null)[])[];
  seconds: number;
}

/** What the last run of a fleet from the page did. */
export interface FleetRunPart {
  lines: string[];
  said: ShownFinding[];
}

/** A fleet: its file, how far it is, and its jobs. */
export interface FleetScreen {
  fleet: FleetItem;
  text: string;
  events: FleetHappening[];
  outcomes: Record<string, number>;
  found: number | null;
  words: string;
  run: FleetRunPart | null;
  jobs: Job[];
}

/** Rows as they are shown. */
export interface FleetSheet {
  title: string;
  columns: string[];
  units: string[];
  digits: number[];
  rows: ((string | number | number | boolean | null)[])[];
  notes: string[];
}

/** A folder right below the workspace, as `flightid fleet run FOLDER` takes it. */
export interface FleetStart {
  folder: string;
}

/** What is known of one model of one type. */
export interface FleetType {
  name: string;
  model: string;
  reasons: string[];
  labels: Record<string, string>;
  tables: FleetSheet[];
  notes: string[];
  findings: ShownFinding[];
}

/** A vehicle with its light. */
export interface FleetVehicle {
  name: string;
  types: string[];
  flights: number;
  finding: ShownFinding;
}

/** One vehicle: its flights and the histories of its parameters. */
export interface FleetVehiclePart {
  name: string;
  flights: FleetFlight[];
  histories: FleetHistory[];
}

/** Everything known of a log; parts that are being made are None. */
export interface FlightScreen {
  id: string;
  name: string;
  path: string;
  overview: Overview | null;
  review: ReviewPart | null;
  jobs: Job[];
}

/** A flight of the workspace. */
export interface FlownItem {
  id: string;
  vehicle: string;
  title: string;
  law: boolean;
  finished: boolean;
  path: string;
  swept_s: Record<string, number> | null;
  rating: CooperHarperRating | null;
}

/** The set of records that holds a flight. */
export interface FlownRecords {
  id: string;
}

/** A vehicle to fly; `name` is what `load_model` takes in the folder of the page. */
export interface FlyChoice {
  name: string;
  title: string;
  note: string;
  own: boolean;
  gusts: boolean;
  inputs: FlyInput[];
  outputs: Record<string, string>;
  law: string;
  law_sensors: string[];
  rate_hz: number;
}

/** An instant of a flight, as it is shown. */
export interface FlyFrame {
  time_s: number;
  pose: FlyPose;
  number: number;
  outputs: Record<string, number>;
  driven: Record<string, number>;
  added: Record<string, number>;
  late_frames: number;
  sweeping: boolean;
  swept_s: Record<string, number>;
}

/** An input of a vehicle, and the axis of the hand that moves it. */
export interface FlyInput {
  hand: "pitch" | "roll" | "yaw" | "heave";
  name: string;
  unit: string;
  reach: number;
  law_limit: number | null;
}

/** What the socket tells: a frame, a state with its words, or a flight that was kept. */
export interface FlyNews {
  frame: FlyFrame | null;
  state: "ready" | "flying" | "paused" | "ended" | "refused" | null;
  words: string;
  kept: string | null;
}

/** Pause, go on, end. */
export interface FlyOrder {
  do: "pause" | "resume" | "end";
}

/** Attitude, rad, and place, m, from the take-off and above the ground of the scenery. */
export interface FlyPose {
  phi: number;
  theta: number;
  psi: number;
  north_m: number;
  east_m: number;
  height_m: number;
}

/** A study of a flight, as text; `flight` names the kept one that it is of. */
export interface FlySettings {
  text: string;
  flight: string | null;
}

/** Begin a flight; while one is flown, end it and begin anew. */
export interface FlyStart {
  do: string;
  vehicle: string;
  law: boolean;
  gusts: boolean;
  actuator_delay_s: number;
  display_delay_s: number;
  stick_rad_s: number | null;
  seed: number;
  failures: Record<string, "frozen" | "zero" | "biased">;
}

/** Where the hand is; numbers rise, and come back with the frame that has flown it. */
export interface FlyStick {
  do: string;
  number: number;
  stick: Record<string, number>;
}

/** Add a sweep to an input; left out: end it. */
export interface FlySweep {
  do: string;
  input: string | null;
  amplitude: number;
  low_rad_s: number;
  high_rad_s: number;
  duration_s: number;
}

/** Augmentation, gusts and sensors, in flight. */
export interface FlySwitch {
  do: string;
  law: boolean;
  gusts: boolean;
  failures: Record<string, "frozen" | "zero" | "biased">;
}

/** A formula of fields that can be plotted. */
export interface FormulaUnit {
  series: string;
  unit: string;
}

/** A parameter file. */
export interface GainFile {
  name: string;
  text: string;
}

/** A gain with its range; `found` is what the search took, where it searched. */
export interface GainSlider {
  name: string;
  unit: string;
  flown: number | null;
  found: number | null;
  value: number;
  low: number;
  high: number;
}

/** A step on the way to the new gains. */
export interface GainStep {
  gains: Record<string, number>;
  stable: boolean;
  phase_margin_deg: number | null;
  gain_margin_db: number | null;
}

/** Its answer: the axis that moved. */
export interface GainsAnswer {
  request: number;
  error: string | null;
  seconds: number;
  moved: AxisGains | null;
}

/** Gains of a study. */
export interface GainsPart {
  axes: AxisGains[];
  refused: RefusedGains[];
  findings: ShownFinding[];
  n_steps: number;
  left_out: Record<string, string>;
  refusal: string;
  files: GainFile[];
  loops: string[];
  ranges: Record<string, [number, number]>;
  preset: string;
  form: string;
}

/** One axis with other gains, judged at once as a slider moves. */
export interface GainsQuestion {
  request: number;
  kind: string;
  log: string;
  edits: Edit[];
  axis: string;
  values: Record<string, number>;
  responses: boolean;
}

/** Gains of a study as it stands, where they are known, and the work on them. */
export interface GainsScreen {
  etag: string;
  gains: GainsPart | null;
  jobs: Job[];
}

/** Long work: its state, and where it can be asked for again. */
export interface Job {
  id: string;
  kind: "overview" | "review" | "run" | "fleet" | "gains" | "proposal";
  log: string;
  state: "waiting" | "done" | "failed" | "cancelled" | "interrupted";
  reason: string;
  of: string;
  begun_s: number;
  label: string;
  share: number | null;
}

/** A job has changed. */
export interface JobNews {
  job: Job;
}

/** A file or folder of the workspace that is not listed, and why. */
export interface LeftOut {
  path: string;
  reason: string;
}

/** The workspace. */
export interface Listing {
  folder: string;
  version: string;
  logs: LogItem[];
  left_out: LeftOut[];
}

/** A folder of logs of which a fleet can be made. */
export interface LogFolder {
  name: string;
  logs: number;
}

/** A log of the workspace; what an overview tells is there once it was made. */
export interface LogItem {
  id: string;
  name: string;
  path: string;
  size: number;
  changed: string;
  flown: string | null;
  vehicle: string | null;
  firmware: string | null;
  duration_s: number | null;
  sweeps: number | null;
  light: "green" | "amber" | "red" | "unknown" | null;
}

/** Steps of one loop on both sides. */
export interface LoopSteps {
  loop: string;
  before: StepCurve;
  after: StepCurve;
}

/** A number of a loop over all plants, beside that of the flown gains. */
export interface MarginRow {
  loop: string;
  name: string;
  unit: string;
  required: string;
  met: boolean;
  digits: number;
  nominal: number | null;
  low: number | null;
  high: number | null;
  worst: number | null;
  flown: number | null;
  flown_worst: number | null;
  untold: string;
  missed: number | null;
  n_missed: number;
  n_plants: number;
}

/** A line of two versions: of both, of one of them, or a mark for equal lines left out. */
export interface MergeLine {
  side: "same" | "theirs" | "mine" | "gap";
  text: string;
}

/** Two versions of a study side by side, and both together where they allow it. */
export interface MergedStudy {
  mine: string;
  merged: string | null;
  why: string;
  lines: MergeLine[];
}

/** A model of a study, or why there is none; both empty where it has no equations. */
export interface ModelAnswer {
  model: ShownModel | null;
  error: string;
}

/** Measured against predicted with the values of sliders. */
export interface ModelPrediction {
  curves: PredictedCurve[];
  responses: PredictedResponse[];
  refusal: string;
}

/** A model of a study as it would be with these edits. */
export interface ModelRequest {
  model: string;
  edits: Edit[];
}

/** A library model or file to put into model `place` of a study; behind the last: beside. */
export interface ModelUse {
  place: number;
  template: string;
  axis: string | null;
  columns: Record<string, string>;
}

/** A loop broken at the output, for the chart of Nichols. */
export interface NicholsCurve {
  name: string;
  phase_deg: number[];
  gain_db: number[];
}

/** What an inspection finds, laid out for the page. */
export interface Overview {
  name: string;
  vehicle: string;
  firmware: string;
  flown: string;
  duration_s: number;
  airborne: string;
  light: "green" | "amber" | "red" | "unknown";
  sentence: string;
  verdicts: ShownFinding[];
  cards: AxisCard[];
  span_s: [number, number];
  lines: StripLine[];
  blocks: StripBlock[];
  events: StripEvent[];
  has_study: boolean;
}

/** A model file as it is written in the editor; kept where a study shall name it. */
export interface OwnModel {
  name: string;
  text: string;
  keep: boolean;
}

/** What a model file says, or why it is none, with the line where that stands. */
export interface OwnModelAnswer {
  model: ShownModel | null;
  error: string;
  line: number | null;
  template: string;
}

/** Vehicles to fly of the folder, and why others of its models cannot be flown. */
export interface OwnVehicles {
  vehicles: FlyChoice[];
  left_out: Record<string, string>;
}

/** A draft and where it is typed, such as ``study:`` and the hash of a log. */
export interface PlacedDraft {
  place: string;
  draft: Draft | null;
  known: Draft | null;
}

/** A plan of the next flight. */
export interface PlanPart {
  title: string;
  verdict: string;
  light: "green" | "amber" | "red" | "unknown";
  axes: string[];
  carried: string[];
  rows: PlanRow[];
  battery: string;
  logging: string;
  findings: ShownFinding[];
  why: string;
  files: GainFile[];
  refusal: string;
}

/** A plan of the next flight of the vehicle of a log. */
export interface PlanRequest {
  log: string;
  wishes: PlanWishes;
}

/** The sweep of an axis, and what the log will show of it. */
export interface PlanRow {
  axis: string;
  amplitude: number | null;
  size: string;
  unit: string;
  low_hz: number | null;
  high_hz: number | null;
  duration_s: number | null;
  runs: number;
  command_percent: number | null;
  rate_deg_s: number | null;
  attitude_deg: number | null;
  coherence: number | null;
  rests_on: string;
  untold: string;
  settings: Record<string, number>;
}

/** Options of ``flightid plan``; those that are None are as usual. */
export interface PlanWishes {
  axes: string[] | null;
  band_rad_s: [number, number] | null;
  amplitude: number | null;
  duration_s: number | null;
  n_records: number | null;
  control: number | null;
  rate_rad_s: number | null;
  attitude_rad: number | null;
  loop_rate_hz: number | null;
}

/** Plots that stand on the screen Flight: panes, each with fields or formulas of fields. */
export interface PlotLayout {
  name: string;
  panes: string[][];
}

/** One output on one record: extremes by column of what was measured and predicted. */
export interface PredictedCurve {
  record: string;
  output: string;
  unit: string;
  time_s: number[];
  measured: number[];
  predicted: number[];
  theil: number;
  rms_error: number;
}

/** One response of the model at the frequencies of the measured one. */
export interface PredictedResponse {
  output: string;
  input: string;
  unit: string;
  omega_rad_s: number[];
  gain: number[];
  phase_rad: number[];
  measured_gain: number[];
  measured_phase_rad: number[];
  coherence: number[];
}

/** Its answer; `processor_s` is what the worker took for it. */
export interface PredictionAnswer {
  request: number;
  error: string | null;
  seconds: number;
  prediction: ModelPrediction | null;
  processor_s: number;
}

/** A prediction with values of some parameters. */
export interface PredictionQuestion {
  request: number;
  kind: string;
  log: string;
  edits: Edit[];
  model: string;
  values: Record<string, number>;
}

/** The study that `flightid new` writes for records; empty where they carry no model. */
export interface ProposedStudy {
  text: string;
  models: string[];
  said: string[];
  findings: ShownFinding[];
}

/** A request on the socket: what the page shows under edits that are not written yet. */
export interface Question {
  request: number;
  kind: string;
  log: string;
  edits: Edit[];
}

/** An axis that its data do not allow. */
export interface RefusedGains {
  axis: string;
  finding: ShownFinding;
}

/** Take a log or records off the list, or put them back. */
export interface RemovalRequest {
  id: string;
  removed: boolean;
}

/** A log or records that a hand has taken off the list; the files are where they were. */
export interface RemovedItem {
  id: string;
  kind: "log" | "records";
  name: string;
  path: string;
}

/** The answer to a question of that number, or why there is none. */
export interface Reply {
  request: number;
  error: string | null;
  seconds: number;
}

/** Its answer. */
export interface ResponseAnswer {
  request: number;
  error: string | null;
  seconds: number;
  response: ResponsePart | null;
}

/** One response of one estimator. */
export interface ResponseCurve {
  estimator: string;
  output: string;
  input: string;
  unit: string;
  omega_rad_s: number[];
  gain: number[];
  phase_rad: number[];
  coherence: number[];
  random_error: number[];
  gain_low: number[] | null;
  gain_high: number[] | null;
  phase_low_rad: number[] | null;
  phase_high_rad: number[] | null;
  reason: string;
}

/** Responses of one model, as its study says. */
export interface ResponsePart {
  model: string;
  band_rad_s: [number, number] | null;
  minimum_coherence: number;
  estimators: string[];
  curves: ResponseCurve[];
  around: ResponseCurve[];
  findings: ShownFinding[];
}

/** Responses of a model. */
export interface ResponseQuestion {
  request: number;
  kind: string;
  log: string;
  edits: Edit[];
  model: string;
  around: boolean;
  intervals: boolean;
}

/** What the review of the flight adds: steps of its loops, and its verdicts. */
export interface ReviewPart {
  light: "green" | "amber" | "red" | "unknown";
  steps: StepCurve[];
  verdicts: ShownFinding[];
  untold: Record<string, [string, string]>;
}

/** A column as it stands in a file. */
export interface RigColumn {
  name: string;
  unit: string;
  samples: number;
  least: number | null;
  most: number | null;
}

/** A controller around a loop of a rig. */
export interface RigController {
  forms: ControllerForm[];
  remarks: string[];
  sampled: boolean;
  measured: string;
  moved: string;
}

/** What was found in the samples of a channel, and where. */
export interface RigFault {
  channel: string;
  code: string;
  light: "green" | "amber" | "red" | "unknown";
  message: string;
  action: string;
  spans_s: [number, number][];
  deviations: number | null;
}

/** A file: its columns, and the manoeuvres in it or why none can be read. */
export interface RigFile {
  name: string;
  columns: RigColumn[];
  notes: string[];
  manoeuvres: RigManoeuvre[];
  error: string;
  grid_s: number | null;
  grid_column: string;
  grid_unit: string;
}

/** A file to take out of a set of records, or to put back. */
export interface RigFileRequest {
  name: string;
  out: boolean;
}

/** A set of record files. */
export interface RigItem {
  id: string;
  name: string;
  files: number;
  size: number;
  has_study: boolean;
}

/** A record that a file holds. */
export interface RigManoeuvre {
  name: string;
  start_s: number;
  stop_s: number;
  rate_hz: number;
  channels: Record<string, string>;
  faults: RigFault[];
}

/** What `flightid new` is asked: roles of columns where their names do not tell.

`model` is one of the library, in place of structures that are tried; `actuators` are rad/s. */
export interface RigProposal {
  time_column: string | null;
  sample_time_s: number | null;
  resample_to_s: number | null;
  hold: "zero" | "first" | "band_limited" | null;
  inputs: string[];
  outputs: string[];
  excitations: string[];
  model: string | null;
  units: Record<string, string>;
  actuators: Record<string, number>;
  conditioning: Record<string, unknown>[];
  anew: boolean;
}

/** How files are read, where they do not tell: as in `[defaults.record]` of a study. */
export interface RigReading {
  time_column: string | null;
  sample_time_s: number | null;
  resample_to_s: number | null;
  hold: "zero" | "first" | "band_limited" | null;
}

/** A set of record files, and the roles that names and units tell. */
export interface RigScreen {
  id: string;
  files: RigFile[];
  inputs: string[];
  outputs: string[];
  untold: string;
  time: string;
  time_unit: string;
  left_out: string[];
  jobs: Job[];
}

/** What a run of the study made: its report as a tree, figures by their number. */
export interface RunPart {
  etag: string;
  parts: StudyParts;
  folder: string;
  title: string;
  verdict: "green" | "amber" | "red" | "unknown";
  tally: string;
  seconds: number;
  figures: number;
  sections: Record<string, unknown>[];
}

/** The last run that ended, the one that goes on, and files that a zip leaves out. */
export interface RunScreen {
  run: RunPart | null;
  jobs: Job[];
  left_out: string[];
}

/** Two sides in the grammar of model files; a transfer function carries its delay, s. */
export interface ShownEquation {
  left: string;
  right: string;
  delay: string;
}

/** A finding, with the spans of the flight that it speaks of. */
export interface ShownFinding {
  code: string;
  light: "green" | "amber" | "red" | "unknown";
  message: string;
  action: string;
  spans_s: [number, number][];
  first: boolean;
  rank: number;
}

/** A model with equations: what it says of itself. */
export interface ShownModel {
  key: string;
  title: string;
  kind: "transfer" | "state-space";
  axes: string[];
  inputs: Record<string, string>;
  outputs: Record<string, string>;
  equations: ShownEquation[];
  definitions: ShownEquation[];
  measured: ShownEquation[];
  notes: string[];
  parameters: ShownParameter[];
  source: string;
  note: string;
}

/** A parameter under the study's overrides; `start` is what the model's own file says. */
export interface ShownParameter {
  name: string;
  value: number | null;
  start: number | null;
  unit: string;
  low: number | null;
  high: number | null;
  free: boolean;
  tie: string | null;
  note: string;
  changed: boolean;
}

/** The closed rate loop of an axis from ordinary flying. */
export interface StepCurve {
  axis: string;
  loop: string;
  time_s: number[];
  step: number[];
  low: number[];
  high: number[];
  readings: [string, string][];
}

/** Something that lasted. */
export interface StripBlock {
  kind: string;
  axis: string;
  text: string;
  start_s: number;
  stop_s: number;
}

/** An instant with words. */
export interface StripEvent {
  time_s: number;
  kind: string;
  text: string;
}

/** A channel over the whole flight: extremes by column, None where silent. */
export interface StripLine {
  name: string;
  label: string;
  unit: string;
  low: (number | null)[];
  high: (number | null)[];
}

/** What two studies found, each pair of models a section of the report's tree. */
export interface StudyComparison {
  names: [string, string];
  changed: string[];
  light: "green" | "amber" | "red" | "unknown";
  sections: Record<string, unknown>[];
}

/** Two logs, or records, whose studies were run. */
export interface StudyPairRequest {
  before: string;
  after: string;
}

/** What parts of a study are known by: a change of one leaves what rests on others as it is. */
export interface StudyParts {
  models: string;
  gains: string;
  views: string;
}

/** To the version before, or to the next again. */
export interface StudyStep {
  back: boolean;
}

/** A study file, its tag, and what the page reads off it. */
export interface StudyText {
  text: string;
  etag: string;
  parts: StudyParts;
  settings: Record<string, unknown>;
  python: string;
  outside: string[];
  undoable: number;
  redoable: number;
  of_records: boolean;
  state: "readable" | "unreadable" | "no text" | "lost";
  lack: string;
}

/** A time response of the estimate, with the extremes of some plants. */
export interface TimeCurve {
  name: string;
  unit: string;
  time_s: number[];
  estimate: number[];
  low: number[];
  high: number[];
  flown: number[] | null;
}

/** A study as it was begun from, as it was meant here, and as it stands in the file now. */
export interface TwoStudies {
  base: string;
  mine: string;
  theirs: string;
  edits: Edit[];
}

/** The keys of a study that put a model into it. */
export interface UseEdits {
  edits: Edit[];
  name: string;
  error: string;
}

/** A study file to put in place of another. */
export interface WholeText {
  text: string;
}
