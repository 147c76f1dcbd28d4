type Plotly = { react: (place: HTMLElement, data: object[], layout: object, options: object) => Promise<void>; relayout: (place: HTMLElement, moved: object) => Promise<void>; purge: (place: HTMLElement) => void };
let library: Promise<Plotly> | null = null;

/** The plotting library of the report, fetched when the first picture is drawn. */
export function plotly(): Promise<Plotly> {
  library ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "/plotly.js";
    script.onload = () => resolve((window as unknown as { Plotly: Plotly }).Plotly);
    script.onerror = () => reject(new Error("The plotting library could not be loaded."));
    document.head.append(script);
  });
  return library;
}
