"use strict";
/* Sorts tables by a click on a header, and shows the rows that are searched or filtered for. */
(() => {
  /* The number that a cell begins with; NaN where it begins with none. */
  const number = (text) => {
    const found = text.replace(/[\u202f,](?=\d{3})/g, "").replace("−", "-").match(/^[<> ]*(-?)(∞|\d+(?:\.\d+)?(?:e-?\d+)?)/);
    if (!found) return NaN;
    return (found[1] ? -1 : 1) * (found[2] === "∞" ? Infinity : Number(found[2]));
  };
  const key = (row, column) => row.cells[column].textContent.trim();
  const compare = (a, b) => {
    const [x, y] = [number(a), number(b)];
    if (!Number.isNaN(x) && !Number.isNaN(y)) return x - y;
    return a.localeCompare(b, "en", { numeric: true });
  };

  document.querySelectorAll("table:not(.matrix)").forEach((table) => {
    const body = table.tBodies[0];
    const rows = [...body.rows];
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const next = { ascending: "descending", descending: "none" }[head.ariaSort] || "ascending";
        [...table.tHead.rows[0].cells].forEach((other) => other.removeAttribute("aria-sort"));
        let ordered = rows;
        if (next !== "none") {
          head.setAttribute("aria-sort", next);
          const missing = (row) => key(row, column) === "";
          const sign = next === "ascending" ? 1 : -1;
          ordered = [...rows].sort((a, b) => missing(a) - missing(b) || sign * compare(key(a, column), key(b, column)));
        }
        body.append(...ordered);
        table.dispatchEvent(new Event("sorted"));
      });
    });
  });

  document.querySelectorAll("[data-table]").forEach((tools) => {
    const table = document.getElementById(tools.dataset.table);
    const search = tools.querySelector("[type=search]");
    const status = tools.querySelector("output");
    const more = tools.querySelector("[data-is=more]");
    let most = Number(tools.dataset.most) || Infinity;
    const show = () => {
      const words = (search ? search.value : "").toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      [...table.tBodies[0].rows].forEach((row) => {
        const text = row.textContent.toLowerCase();
        row.hidden = !words.every((word) => text.includes(word));
        shown += !row.hidden;
        /* On paper all rows are printed. */
        row.classList.toggle("later", words.length === 0 && shown > most);
      });
      if (more) more.hidden = words.length > 0 || most === Infinity;
      status.textContent = search ? `${words.length ? shown : Math.min(shown, most)} of ${table.tBodies[0].rows.length} rows` : "";
    };
    tools.addEventListener("input", show);
    table.addEventListener("sorted", show);
    if (more) {
      more.addEventListener("click", () => {
        most = Infinity;
        show();
      });
    }
    /* Rows in sight, for a spreadsheet: tabs between cells, a plain minus, thousands not apart, and an apostrophe before
       text that it would take for a formula. */
    tools.querySelector("[data-is=copy]").addEventListener("click", async () => {
      const rows = [...table.rows].filter((row) => !row.hidden);
      const plain = (cell) => cell.innerText.replace(/\u202f/g, "").replace(/−/g, "-").replace(/\s+/g, " ").trim().replace(/^(?=[=+@]|-(?!\d))/, "'");
      await navigator.clipboard.writeText(rows.map((row) => [...row.cells].map(plain).join("\t")).join("\n"));
      status.textContent = `${rows.length - 1} rows are in the clipboard`;
    });
    tools.hidden = false;
    show();
  });

  /* A link to a part that is folded unfolds it. */
  const reveal = () => {
    const target = document.querySelector(":target");
    const folded = target && target.closest("details");
    if (!folded) return;
    folded.open = true;
    target.scrollIntoView({ block: "center", inline: "start" });
  };
  window.addEventListener("hashchange", reveal);
  /* Figures, and short tables that are not too wide for paper, are printed, folded or not. */
  window.addEventListener("beforeprint", () => document.querySelectorAll("details.folded").forEach((each) => {
    each.open ||= each.querySelector("figure") || [...each.querySelectorAll("table")].every(({ rows }) => rows.length <= 16 && rows[0].cells.length <= 14);
  }));
  reveal();
})();
