"use strict";
/* Keeps what is chosen and the section in view in the address, so that a view can be sent as a link. */
(() => {
  const controls = [...document.querySelectorAll("select[id], input[id]")];
  const atStart = new Map(controls.map((control) => [control, control.value]));
  const headings = [...document.querySelectorAll("h2[id]")];
  /* Boxes of controls that the reader used; what moves by itself is not kept. */
  const boxOf = (element) => element.closest?.(".play, .tools");
  const used = new Set();

  const read = () => {
    const asked = new URLSearchParams(window.location.search);
    controls.filter((control) => asked.has(control.id)).forEach((control) => {
      used.add(boxOf(control));
      const before = control.value;
      control.value = asked.get(control.id);
      if (control.value !== asked.get(control.id)) control.value = before; // an old link
      else control.dispatchEvent(new Event(control.tagName === "SELECT" ? "change" : "input", { bubbles: true }));
    });
  };

  const write = () => {
    const changed = controls.filter((control) => used.has(boxOf(control))
      && control.value !== atStart.get(control) && !control.closest("[hidden], [data-playing]"));
    const query = new URLSearchParams(changed.map((control) => [control.id, control.value])).toString();
    const typing = document.activeElement.type === "search" && document.activeElement.closest("section");
    const inView = headings.filter((each) => each.getBoundingClientRect().top < window.innerHeight / 2).at(-1);
    const heading = (typing && typing.querySelector("h2")) || inView || changed.at(-1)?.closest(".play");
    const section = heading && heading.closest("section");
    const target = document.getElementById(decodeURIComponent(window.location.hash.slice(1)));
    const within = target && section && section.contains(target); // as a claim is
    const hash = within ? window.location.hash : heading ? `#${heading.id}` : "";
    window.history.replaceState(null, "", window.location.pathname + (query && `?${query}`) + hash);
  };

  /* Waits until nothing changes. */
  let waiting;
  const later = () => {
    clearTimeout(waiting);
    waiting = setTimeout(write, 200);
  };
  /* Whoever unfolds a claim can send a link to it. */
  document.querySelectorAll("tr[id] details").forEach((details) => details.addEventListener("toggle", () => {
    if (details.open) window.history.replaceState(null, "", `#${details.closest("tr").id}`);
  }));
  read();
  ["pointerdown", "keydown", "focusin"].forEach((kind) => window.addEventListener(kind, (event) => used.add(boxOf(event.target))));
  ["input", "change", "scroll"].forEach((kind) => window.addEventListener(kind, later));
})();
