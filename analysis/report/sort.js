"use strict";
/* Sorts tables by a click on a column's header: up, down, then as they were; searches them. */

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
  /* Rows of one kind stay together. */
  const kinds = [...table.tBodies].map((body) => ({ body, first: [...body.rows].filter((row) => row.className !== "group") }));
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
      kinds.forEach(({ body, first }) => {
        const keys = first.map((row) => key(row.cells[column]));
        const words = head.classList.contains("text") && column === 0;
        const places = next ? order(keys, words, next === "descending") : keys.map((_, place) => place);
        body.append(...places.map((place) => first[place]));
      });
    });
  });
}

/* A field above a longer table: rows without all of its words are hidden. */
function searchable(table) {
  const root = document.createElement("label");
  root.className = "search";
  const field = document.createElement("input");
  const count = document.createElement("span");
  field.type = "search";
  count.setAttribute("aria-live", "polite");
  root.append("Search ", field, count);
  table.before(root);
  const rows = [...table.tBodies].flatMap((body) => [...body.rows]).filter((row) => row.className !== "group");
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    const said = (row) => `${row.textContent} ${row.cells[0].title}`.toLowerCase();
    rows.forEach((row) => { row.hidden = !words.every((word) => said(row).includes(word)); });
    count.textContent = words.length ? `${rows.filter((row) => !row.hidden).length} of ${rows.length} rows` : "";
  });
}

if (typeof module !== "undefined") module.exports = { value, order };
else document.querySelectorAll("main table").forEach((table) => {
  if (table.tBodies[0].rows.length > 1) sortable(table);
  if (table.dataset.rows) searchable(table);
});
