"use strict";
/* Begins the page's figure; its state is in the address. */
{
  const source = document.getElementById("play-model").textContent;
  const data = JSON.parse(document.getElementById("play-data").textContent);
  let kept = "";
  const keep = (link) => {
    kept = link;
    window.history.replaceState(null, "", `${window.location.pathname}${window.location.search}${link && "#"}${link}`);
  };
  const begin = () => new Play(document.getElementById("play"), { ...data, source, keep }, window.location.hash.slice(1));
  const figure = begin();
  window.addEventListener("hashchange", () => {
    if (window.location.hash.slice(1) === kept) return;
    figure.state = read(window.location.hash.slice(1));
    figure.restore();
  });
}
