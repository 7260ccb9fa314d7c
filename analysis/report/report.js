"use strict";
/* The choice of light or dark, kept in the browser where it allows that; folds. */
(() => {
  const root = document.documentElement;
  const button = document.getElementById("theme");
  const store = {
    get() { try { return window.localStorage.getItem("coartic-theme"); } catch { return null; } },
    set(value) { try { window.localStorage.setItem("coartic-theme", value); } catch { /* not kept */ } },
  };
  const system = window.matchMedia("(prefers-color-scheme: dark)");
  const dark = () => (root.dataset.theme ? root.dataset.theme === "dark" : system.matches);
  const name = () => { button.textContent = dark() ? "Light colours" : "Dark colours"; };
  const kept = store.get();
  if (kept === "light" || kept === "dark") root.dataset.theme = kept;
  button.hidden = false;
  button.addEventListener("click", () => {
    root.dataset.theme = dark() ? "light" : "dark";
    store.set(root.dataset.theme);
    name();
  });
  system.addEventListener("change", name);
  name();

  const contents = document.querySelector("#contents details");
  if (window.matchMedia("(max-width: 56rem)").matches) contents.open = false;

  /* A link to something folded away unfolds it. */
  const reveal = () => {
    const target = document.getElementById(decodeURIComponent(window.location.hash.slice(1)));
    for (let at = target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
    if (target) target.scrollIntoView();
  };
  window.addEventListener("hashchange", reveal);

  /* What is folded is printed as well, but for the lists of runs. */
  let folded = [];
  window.addEventListener("beforeprint", () => {
    folded = [...document.querySelectorAll("main details:not([open])")].filter((at) => !at.closest(".runs"));
    folded.forEach((at) => { at.open = true; });
  });
  window.addEventListener("afterprint", () => folded.forEach((at) => { at.open = false; }));
  if (window.location.hash) reveal();

  /* Charts in the place of the drawings of the same data. */
  document.querySelectorAll("figure .chart").forEach((place) => {
    const still = place.parentElement.querySelector(".still");
    const text = place.nextElementSibling.textContent;
    let said = JSON.parse(text);
    place.hidden = false;
    still.hidden = true;
    if (place.clientWidth < 480) { // names and legends give way to what is drawn
      const brief = new Map();
      JSON.parse(text, (key, value) => {
        if (value && value.brief) brief.set(value.name, value.brief);
        return value;
      });
      said = JSON.parse(text, (key, value) => brief.get(value) ?? value);
      Object.assign(said.config.axis, { labelLimit: 132 });
      Object.assign(said.config.legend, { columns: 1 });
      said.config.text = { limit: 118 };
    }
    window.vegaEmbed(place, said, { renderer: "svg", actions: false, tooltip: { theme: "custom" } })
      .catch(() => { place.hidden = true; still.hidden = false; });
  });
})();
