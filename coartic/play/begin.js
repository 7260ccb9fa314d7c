"use strict";
/* Begins the figure. On its own page its state is in the address. Elsewhere the data have the `page` to which links
   lead, or null for no links. */
{
  const source = document.getElementById("play-model").textContent;
  const data = JSON.parse(document.getElementById("play-data").textContent);
  const root = document.getElementById("play");
  const own = data.page === undefined;
  const here = () => window.location.hash.slice(1);
  const address = (link) => {
    const found = new URL(data.page || "", window.location.href);
    found.hash = link;
    return found.href;
  };
  const keep = (link) => { if (own) window.history.replaceState(null, "", address(link)); };
  const figure = new Play(root, { ...data, source, keep, address }, own ? here() : "");
  root.querySelector("[data-is=link]").hidden = data.page === null;
  if (own) window.addEventListener("hashchange", () => { if (figure.link !== here()) figure.restore(here()); });
  /* Cells of the report's tables show films when they are clicked. */
  document.addEventListener("DOMContentLoaded", () => (data.cells || []).forEach(([id, choice]) => {
    const cell = document.getElementById(id);
    if (!cell) return;
    const button = document.createElement("button");
    Object.assign(button, { type: "button", className: "film-of", title: "Watch its median run" });
    button.append(...cell.childNodes);
    cell.append(button);
    button.addEventListener("click", () => figure.film(choice));
  }));
}
