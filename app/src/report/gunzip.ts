// Of reports: gzip unpacked while the caller waits, as paper does not wait for the browser's own stream.
import { gunzipSync } from "fflate";

(globalThis as unknown as Record<string, unknown>).inflated = gunzipSync;
