// Of reports: gzip unpacked while the caller waits, as paper does not wait for the browser's own stream, and
// panels below each other on a phone, as the page has them.
import { gunzipSync } from "fflate";
import { stack } from "../lib/stack";

Object.assign(globalThis, { inflated: gunzipSync, stacked: stack });
