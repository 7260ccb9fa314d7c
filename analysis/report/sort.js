"use strict";
/* Sorts tables by a click on a column's header: up, down, then as they were. */

const POWERS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/* The number a cell begins with, as text.py writes it; NaN where it begins with none. */
function value(text) {
  const found = text.replace(/[\u202f\u2009,](?=\d{3})/g, "").replace(/^[<>[\s]+/, "").replace(/−/g, "-")
    .match(/^(-?)(∞|\d+(?:\.\d+)?)(?: × 10(⁻?)([⁰¹²³⁴⁵⁶⁷⁸⁹]+))?/);
  if (!found) return NaN;
  const [, sign, size, below, power] = found;
  const exponent = power ? Number([...power].map((raised) => POWERS.indexOf(raised)).join("")) : 0;
  const amount = size === "∞" ? Infinity : Number(`${size}e${below ? "-" : ""}${exponent}`);
  return sign ? -amount : amount;
}

/* Whether to compare as numbers or as words; what is missing comes last, up and down. */
function order(keys, words, down) {
  const missing = (key) => key === "" || key === "–";
  const rank = new Map(keys.map((key) => [key, words ? NaN : value(key)]));
  const compare = (a, b) => {
    if (missing(a) || missing(b)) return missing(a) - missing(b);
    const [x, y] = [rank.get(a), rank.get(b)];
    const way = down ? -1 : 1;
    if (x === y) return 0;
    if (Number.isNaN(x) || Number.isNaN(y)) return way * a.localeCompare(b, "en", { numeric: true });
    return way * (x < y ? -1 : 1);
  };
  return keys.map((_, place) => place).sort((i, j) => compare(keys[i], keys[j]) || i - j);
}

function sortable(table) {
  const body = table.tBodies[0];
  const first = [...body.rows];
  const heads = [...table.tHead.rows[0].cells];
  /* Without small print: the value alone. */
  const key = (cell) => {
    const copy = cell.cloneNode(true);
    copy.querySelectorAll("small, span").forEach((small) => small.remove());
    return copy.textContent.trim();
  };
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const next = { none: "ascending", ascending: "descending" }[head.getAttribute("aria-sort") || "none"];
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      if (next) head.setAttribute("aria-sort", next);
      const keys = first.map((row) => key(row.cells[column]));
      const words = head.classList.contains("text") && column === 0;
      const places = next ? order(keys, words, next === "descending") : keys.map((_, place) => place);
      body.append(...places.map((place) => first[place]));
    });
  });
}

if (typeof module !== "undefined") module.exports = { value, order };
else document.querySelectorAll("main table").forEach((table) => { if (table.tBodies[0].rows.length > 1) sortable(table); });
