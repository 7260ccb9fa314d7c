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

  if (window.location.hash) reveal();

  /* Charts in the place of the drawings of the same data. */
  document.querySelectorAll("figure .chart").forEach((place) => {
    const still = place.parentElement.querySelector(".still");
    const text = place.nextElementSibling.textContent;
    const said = JSON.parse(text);
    place.hidden = false;
    still.hidden = true;
    if (place.clientWidth < 480) { // names give way to what is drawn
      Object.assign(said.config.axis, { labelLimit: 165, labelFontSize: 10 });
      said.config.text = { limit: 130 };
    }
    window.vegaEmbed(place, said, { renderer: "svg", actions: false, tooltip: { theme: "custom" } })
      .catch(() => { place.hidden = true; still.hidden = false; });
  });
})();
