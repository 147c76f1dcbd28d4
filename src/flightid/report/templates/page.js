"use strict";
(() => {
  const root = document.documentElement;
  const systemDark = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme || (systemDark.matches ? "dark" : "light")) === "dark";
  const plots = [...document.querySelectorAll(".plot")];
  const drawn = new Set();
  const PAPER_PX = 870; // A4 without its margins, narrower than US letter, at the zoom of paper in page.css
  const ASIDE_PX = 1190; // US letter turned, which is narrower than A4 turned
  const PAPER_HEIGHT = 0.85; // of a plot's on a screen, so that two manoeuvres share a page
  const READABLE = 0.6; // of a table's size; below it turned pages are used
  let library = null;

  // Long texts and the arrays are stored as gzip in base64.
  const packed = (holder) => Uint8Array.from(atob(holder.textContent), (letter) => letter.charCodeAt(0));
  const unzipped = (holder) =>
    new Response(new Blob([packed(holder)]).stream().pipeThrough(new DecompressionStream("gzip")));
  const text = async (holder) =>
    holder.dataset.packed === "gzip" ? unzipped(holder).text() : holder.textContent;
  const textNow = (holder) =>
    holder.dataset.packed === "gzip" ? new TextDecoder().decode(inflated(packed(holder))) : holder.textContent;

  // Arrays are differences of bit patterns, their bytes by rank; each is stored once for all plots.
  let stored = null;
  const arrays = () =>
    stored ??= unzipped(document.getElementById("arrays")).arrayBuffer().then((all) => new Uint8Array(all));
  function samples(all, first, length, width) {
    const count = length / width, bytes = new Uint8Array(length);
    for (let i = 0, pattern = 0; i < count; i++) {
      let step = 0;
      for (let rank = width; rank--;) step = step << 8 | all[first + rank * count + i];
      pattern = pattern + step | 0;
      for (let rank = 0; rank < width; rank++) bytes[i * width + rank] = pattern >> 8 * rank;
    }
    return bytes.buffer;
  }
  const filled = (all) => (key, value) => value?.stored
    ? { ...value, bdata: samples(all, ...value.stored, Number(value.dtype.slice(1))) } : value;

  // The page's content policy knows the hash of the library.
  async function unpack() {
    const holder = document.getElementById("library");
    const source = await text(holder);
    holder.remove();
    return started(source);
  }
  function started(source) {
    if (window.Plotly) return window.Plotly;
    const element = document.createElement("script");
    element.textContent = source;
    document.head.append(element);
    if (!window.Plotly) throw new Error("the plotting library did not start");
    return window.Plotly;
  }

  // Black and blue would vanish on a dark page: both lines and their bands are lightened.
  const lighter = [["#3a3f44", "#eef1f4"], ["rgba(58,63,68,", "rgba(238,241,244,"],
    ["#0072b2", "#2f8fdd"], ["rgba(0,114,178,", "rgba(47,143,221,"]];
  const recolour = (text) =>
    isDark() ? lighter.reduce((now, [from, to]) => now.replaceAll(from, to), text) : text;

  // On a phone panels that lie side by side come one below another, column after column.
  const phone = matchMedia("(max-width: 600px)");
  function stack(layout, place) {
    place.parentElement.classList.toggle("wide", "width" in layout);
    if (stacked(layout, place.clientHeight)) place.style.height = `${layout.height}px`;
  }

  // What a plot needs is unpacked ahead of its drawing; what paper, which does not wait, finds packed
  // is unpacked while it is asked for.
  const texts = new Map();
  let plotly = null, all = null;
  async function prepare(place) {
    const name = place.dataset.spec;
    library ??= unpack();
    plotly = await library;
    if (texts.has(name)) return;
    const source = await text(document.querySelector(`script[data-plot="${name}"]`));
    if (source.includes('"stored":')) all = await arrays();
    texts.set(name, source);
  }

  function prepareNow(place) {
    const name = place.dataset.spec;
    plotly ??= window.Plotly ?? started(textNow(document.getElementById("library")));
    if (texts.has(name)) return;
    const source = textNow(document.querySelector(`script[data-plot="${name}"]`));
    if (source.includes('"stored":')) all ??= inflated(packed(document.getElementById("arrays")));
    texts.set(name, source);
  }

  function paint(place, paper = false) {
    const source = texts.get(place.dataset.spec);
    const spec = JSON.parse(paper ? source : recolour(source), filled(all));
    const style = getComputedStyle(root);
    const ink = paper ? "#000" : style.getPropertyValue("--ink").trim();
    spec.layout.font = { ...spec.layout.font, color: ink };
    spec.layout.hoverlabel = { bgcolor: style.getPropertyValue("--raised").trim(), font: { color: ink } };
    spec.layout.modebar = { bgcolor: "rgba(0,0,0,0)", color: style.getPropertyValue("--unknown").trim(),
      activecolor: ink };
    spec.layout.autosize = !paper;
    if (paper) {
      spec.layout.width = PAPER_PX;
      spec.layout.height = Math.round(PAPER_HEIGHT * (spec.layout.height ?? place.clientHeight));
      place.style.height = `${spec.layout.height}px`;
    } else if (phone.matches) stack(spec.layout, place);
    if (!paper && place.clientWidth < 520) {
      spec.layout.margin = { ...spec.layout.margin, l: 52, r: 8 };
      // Long numbers push the title of their axis: the margin goes with them.
      for (const name in spec.layout) if (/^yaxis\d*$/.test(name)) spec.layout[name].automargin = true;
      spec.layout.font.size = 11;
    }
    const options = { responsive: true, displaylogo: false, displayModeBar: paper || place.clientWidth < 520 ? false : "hover", scrollZoom: false,
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
      toImageButtonOptions: { format: "svg", filename: place.id } };
    drawn.add(place);
    return plotly.react(place, spec.data, spec.layout, options);
  }

  async function draw(place) {
    await prepare(place);
    await paint(place);
  }

  const apologise = () => { document.getElementById("plain").hidden = false; };
  const show = (place) => draw(place).catch(apologise);
  const redraw = () => drawn.forEach(show);

  // Paper scrolls nothing, and what is wider than it makes the whole page smaller before it is cut.
  const frames = [...document.querySelectorAll(".scroll")];
  const widths = (px) => {
    frames.forEach((one) => { one.style.width = px && `${px}px`; });
    return frames.map((one) => one.scrollWidth);
  };
  const shrink = () => {
    const shares = widths(PAPER_PX).map((wide) => PAPER_PX / wide);
    const turned = widths(ASIDE_PX).map((wide) => ASIDE_PX / wide);
    widths("");
    frames.forEach((one, k) => {
      const aside = shares[k] < READABLE;
      one.classList.toggle("aside", aside);
      one.firstElementChild.style.zoom = Math.min(1, aside ? turned[k] : shares[k]);
    });
  };
  const enlarge = () => frames.forEach((one) => {
    one.classList.remove("aside");
    one.firstElementChild.style.zoom = "";
  });
  addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((part) => { part.open = true; });
    shrink();
  });
  addEventListener("afterprint", enlarge);

  if (plots.length) {
    const near = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        if (entry.isIntersecting) { near.unobserve(entry.target); show(entry.target); }
      }
    }, { rootMargin: "600px" });
    plots.forEach((place) => near.observe(place));
    const idle = window.requestIdleCallback ?? setTimeout;
    addEventListener("load", () => idle(async () => {
      for (const place of plots) await prepare(place).catch(apologise);
    }));
    // Paper shows all plots at its own width, in ink for white paper, and waits for none of them.
    addEventListener("beforeprint", () => {
      try {
        plots.forEach((place) => { prepareNow(place); paint(place, true); });
      } catch { apologise(); }
    });
    addEventListener("afterprint", redraw);
  }

  const button = document.getElementById("theme");
  button.hidden = false;
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    redraw();
  });
  systemDark.addEventListener("change", redraw);

  const links = new Map([...document.querySelectorAll("nav a")].map((a) => [a.hash.slice(1), a]));
  const reading = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      links.get(entry.target.id)?.classList.toggle("here", entry.isIntersecting);
    }
  }, { rootMargin: "-10% 0px -70% 0px" });
  document.querySelectorAll("main section").forEach((part) => reading.observe(part));
})();
