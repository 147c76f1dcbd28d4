import "uplot/dist/uPlot.min.css";
import "./page.css";
import { mount } from "svelte";
import App from "./App.svelte";
import { drafts } from "./lib/drafts";

// What was typed before is there when the first field is drawn.
drafts.load().finally(() => mount(App, { target: document.getElementById("page")! }));
