"use strict";
/* Plays movements tick by tick, over each other or side by side. Data: report/player.py. */

/* ---- Movements: decoding, interpolation, kinematics ---- */

function decode(movement, unit, dof) {
  const rows = [];
  const frames = [];
  let row = 0;
  let frame = new Array(dof).fill(0);
  movement.rows.forEach((step, k) => {
    row += step;
    frame = frame.map((value, joint) => value + movement.frames[k * dof + joint]);
    rows.push(row);
    frames.push(frame.map((value) => value * unit));
  });
  return { ...movement, rows, frames };
}

function configuration(movement, row) {
  const { rows, frames } = movement;
  let k = 1;
  while (k < rows.length - 1 && rows[k] < row) k += 1;
  if (rows.length === 1 || row <= rows[0]) return frames[0];
  const share = Math.min(1, (row - rows[k - 1]) / (rows[k] - rows[k - 1]));
  return frames[k].map((end, joint) => frames[k - 1][joint] + share * (end - frames[k - 1][joint]));
}

/* Shoulder, joints and hand; `first` is the index of the arm's first joint. */
function chain(q, arm, first) {
  let x = q[0] + arm.shoulder[0];
  let y = q[1] + arm.shoulder[1];
  let angle = 0;
  const points = [[x, y]];
  arm.links.forEach((length, k) => {
    angle += q[first + k];
    x += length * Math.cos(angle);
    y += length * Math.sin(angle);
    points.push([x, y]);
  });
  return points;
}

function arms(robot, q) {
  return {
    left: chain(q, robot.left, 2),
    right: chain(q, robot.right, 2 + robot.left.links.length),
  };
}

/* After `spent` ticks: the row shown, ticks so far, goals hit, hand at work. */
function moment(movement, spent) {
  const ticks = Math.min(spent, movement.ticks);
  const seen = movement.rows.at(-1) + 1 - (movement.ticks - ticks);
  const row = Math.max(seen - 1, 0);
  const hit = movement.hits.filter((at) => at < seen).length;
  const hand = { L: "left", R: "right" }[movement.hands[hit]];
  return { ticks, row, hit, hand };
}

/* Ticks spent when a goal is hit, counted from 1. */
function ticksAtHit(movement, goal) {
  const waited = movement.ticks - (movement.rows.at(-1) + 1);
  return movement.hits[goal - 1] + 1 + waited;
}

function degrees(robot) {
  return 2 + robot.left.links.length + robot.right.links.length;
}

/* ---- Drawing ---- */

const SVG = "http://www.w3.org/2000/svg";

function element(name, attributes, parent) {
  const made = name.startsWith("svg:")
    ? document.createElementNS(SVG, name.slice(4))
    : document.createElement(name);
  Object.entries(attributes || {}).forEach(([key, value]) => {
    if (key === "text") made.textContent = value;
    else made.setAttribute(key, value);
  });
  if (parent) parent.appendChild(made);
  return made;
}

function polyline(points) {
  return points.map(([x, y]) => `${x.toFixed(3)},${(-y).toFixed(3)}`).join(" ");
}

/* What is in sight of points, with a margin: left, bottom, right, top. */
function around(points, margin = 0) {
  const [x, y] = [0, 1].map((axis) => points.map((point) => point[axis]));
  const least = (values) => values.reduce((a, b) => Math.min(a, b)) - margin;
  const most = (values) => values.reduce((a, b) => Math.max(a, b)) + margin;
  return [least(x), least(y), most(x), most(y)];
}

/* One robot in a picture, with its trails and what is to be said of it. */
class Mover {
  constructor(task, movement, role) {
    this.task = task;
    this.role = role;
    this.movement = decode(movement, task.unit, degrees(task.robot));
    this.trails = Object.fromEntries(task.hands.map((hand) => [hand, []]));
    const seen = [...task.goals];
    for (let row = 0; row <= this.movement.rows.at(-1); row += 1) {
      const points = arms(task.robot, configuration(this.movement, row));
      task.hands.forEach((hand) => {
        this.trails[hand].push(points[hand].at(-1));
        seen.push(...points[hand]);
      });
    }
    this.seen = around(seen);
  }

  get head() {
    return `${this.movement.name}, ${this.task.label}`;
  }

  draw(svg, size) {
    const group = element("svg:g", { class: this.role }, svg);
    const { goals, radius, below, hands } = this.task;
    this.goals = goals.map(([x, y]) => element("svg:circle", { class: "goal", cx: x, cy: -y, r: radius }, group));
    this.half = size / 100;
    this.marks = {};
    hands.forEach((hand) => {
      this.marks[hand] = { trail: element("svg:polyline", { class: `trail ${hand}` }, group) };
    });
    this.base = element("svg:rect", { class: "base" }, group);
    hands.forEach((hand) => {
      const joints = this.task.robot[hand].links.length + 1;
      this.marks[hand].arm = element("svg:polyline", { class: `arm ${hand}` }, group);
      this.marks[hand].joints = Array.from({ length: joints }, () => hand === "left"
        ? element("svg:rect", { class: "joint left", width: 2 * this.half, height: 2 * this.half }, group)
        : element("svg:circle", { class: "joint right", r: size / 140 }, group));
    });
    goals.forEach(([x, y], k) => element("svg:text", {
      x, y: -y + (below[k] ? radius + size / 90 + size / 36 : -radius - size / 90),
      class: "number", "font-size": size / 26, text: k + 1,
    }, group));
  }

  show(spent) {
    const { robot, goals, hands } = this.task;
    const now = moment(this.movement, spent);
    const q = configuration(this.movement, now.row);
    const points = arms(robot, q);
    const [width, height] = robot.base;
    const place = { x: q[0] - width / 2, y: -q[1] - height / 2, width, height };
    Object.entries(place).forEach(([key, value]) => this.base.setAttribute(key, value));
    hands.forEach((hand) => {
      const { trail, arm, joints } = this.marks[hand];
      trail.setAttribute("points", polyline(this.trails[hand].slice(0, now.row + 1)));
      arm.setAttribute("points", polyline(points[hand]));
      arm.classList.toggle("chosen", now.hand === hand);
      points[hand].forEach(([x, y], k) => {
        const where = hand === "left" ? { x: x - this.half, y: -y - this.half } : { cx: x, cy: -y };
        Object.entries(where).forEach(([key, value]) => joints[k].setAttribute(key, value));
      });
    });
    this.goals.forEach((goal, k) => {
      goal.classList.toggle("hit", k < now.hit);
      goal.classList.toggle("current", k === now.hit);
    });
    const goal = now.hit < goals.length ? `next is goal ${now.hit + 1} with the ${now.hand} hand` : "all goals hit";
    this.words = `tick ${now.ticks}, ${goal}`;
  }
}

/* ---- The player ---- */

/* A movement's name in addresses, whatever else the report has. */
function keyOf(movement) {
  return `${movement.on} ${movement.label || "initial"}`;
}

class Player {
  constructor(root, data) {
    this.data = data;
    this.spent = 0;
    this.playing = false;
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)");
    this.build(root, root.id);
    this.view(0);
    /* Played once when it is first seen, unless less motion is asked for. */
    if (!this.calm.matches && "IntersectionObserver" in window) {
      const seen = new IntersectionObserver((entries) => {
        if (!entries.some((entry) => entry.isIntersecting)) return;
        seen.disconnect();
        if (!this.spent) this.play();
      }, { threshold: 0.6 });
      seen.observe(root);
      ["input", "change"].forEach((kind) => root.addEventListener(kind, () => seen.disconnect()));
    } else this.go(this.pauseAt || this.last);
  }

  build(root, id) {
    const choices = element("div", { class: "controls" }, root);
    element("label", { for: `${id}-view`, text: "Show" }, choices);
    this.views = element("select", { id: `${id}-view` }, choices);
    this.data.views.forEach((view, k) => element("option", { value: k, text: view.name }, this.views));
    element("option", { value: "own", text: "Two movements of your choice" }, this.views);
    this.views.addEventListener("change", () => this.view(this.views.value));
    this.selects = ["First", "Second"].map((name, k) => {
      const own = element("span", { class: "own", hidden: "" }, choices);
      element("label", { for: `${id}-${k}`, text: name }, own);
      const select = element("select", { id: `${id}-${k}` }, own);
      this.data.tasks.forEach((task, at) => {
        const group = element("optgroup", { label: task.label }, select);
        this.data.movements.forEach((movement) => {
          if (movement.task === at) {
            element("option", { value: keyOf(movement), text: `${movement.name} (${movement.ticks} ticks)` }, group);
          }
        });
      });
      select.addEventListener("change", () => this.load(this.selects.map((each) => (
        this.data.movements.findIndex((movement) => keyOf(movement) === each.value)
      ))));
      return select;
    });
    this.watch = element("p", { class: "watch" }, root);
    this.pictures = element("div", { class: "pictures" }, root);
    const controls = element("div", { class: "controls" }, root);
    this.button = element("button", { type: "button", class: "play", text: "Play" }, controls);
    this.button.addEventListener("click", () => (this.playing ? this.pause() : this.play()));
    const step = (text, label, by) => {
      const made = element("button", { type: "button", "aria-label": label, text }, controls);
      made.addEventListener("click", () => { this.pause(); this.go(this.spent + by); });
    };
    step("◂", "One tick back", -1);
    step("▸", "One tick on", 1);
    this.slider = element("input", { type: "range", id: `${id}-tick`, "aria-label": "Tick", min: 0, step: 1, value: 0 }, controls);
    this.slider.addEventListener("input", () => { this.pause(); this.go(Number(this.slider.value)); });
    this.count = element("span", { class: "count" }, controls);
    this.status = element("p", { class: "unseen", role: "status", "aria-live": "polite" }, root);
  }

  view(which) {
    const own = which === "own";
    this.selects.forEach((select) => { select.parentElement.hidden = !own; });
    const view = own ? { watch: "", show: this.shown } : this.data.views[Number(which)];
    this.watch.textContent = view.watch;
    this.stopGoal = view.pause;
    this.load(view.show);
  }

  /* One-armed robots stand in one picture over each other, others side by side. */
  load(show) {
    this.pause();
    this.shown = show.length > 1 ? show : [show[0], show[0]];
    this.shown.forEach((index, k) => { this.selects[k].value = keyOf(this.data.movements[index]); });
    const distinct = [...new Set(show)];
    this.movers = distinct.map((index, k) => {
      const movement = this.data.movements[index];
      return new Mover(this.data.tasks[movement.task], movement, k ? "second" : "first");
    });
    const together = this.movers.every((mover) => mover.task.hands.length === 1);
    const box = around(this.movers.flatMap(({ seen }) => [seen.slice(0, 2), seen.slice(2)]), 0.6);
    this.pictures.replaceChildren();
    this.pictures.classList.toggle("together", together || this.movers.length === 1);
    this.facts = [];
    (together ? [this.movers] : this.movers.map((mover) => [mover])).forEach((movers) => this.picture(movers, box));
    this.last = Math.max(...this.movers.map((mover) => mover.movement.ticks));
    const hits = this.movers.map((mover) => (this.stopGoal ? ticksAtHit(mover.movement, this.stopGoal) : 0));
    this.pauseAt = this.stopGoal ? Math.max(...hits) : 0;
    this.slider.max = this.last;
    this.go(0);
  }

  picture(movers, [left, bottom, right, top]) {
    const root = element("div", { class: "picture" }, this.pictures);
    const svg = element("svg:svg", { role: "img" }, root);
    const size = Math.max(right - left, top - bottom);
    svg.setAttribute("viewBox", `${left} ${-top} ${right - left} ${top - bottom}`);
    svg.setAttribute("aria-label", `Robot: ${movers.map((mover) => mover.head).join("; ")}`);
    svg.style.setProperty("--stroke", size / 300);
    movers.forEach((mover) => {
      mover.draw(svg, size);
      this.facts.push(element("p", { class: `facts ${mover.role}` }, root));
    });
  }

  /* The state is spoken only while nothing moves. */
  go(spent) {
    this.spent = Math.max(0, Math.min(this.last, spent));
    this.movers.forEach((mover, k) => {
      mover.show(this.spent);
      this.facts[k].replaceChildren();
      element("strong", { text: mover.head }, this.facts[k]);
      this.facts[k].append(`: ${mover.words}`);
    });
    this.slider.value = this.spent;
    this.count.textContent = `tick ${this.spent} of ${this.last}`;
    this.slider.setAttribute("aria-valuetext", this.count.textContent);
    if (!this.playing) {
      this.status.textContent = this.movers.map((mover) => `${mover.head}: ${mover.words}`).join("; ");
      this.slider.dispatchEvent(new Event("change", { bubbles: true }));
    }
  }

  play() {
    if (this.spent >= this.last) this.go(0);
    this.playing = true;
    this.button.closest(".player").toggleAttribute("data-playing", true);
    this.button.textContent = "Pause";
    this.status.textContent = "";
    const pace = 60; // ticks a second
    let from = this.spent;
    let start = null;
    let drawn = -Infinity;
    const frame = (time) => {
      if (!this.playing) return;
      if (start === null) start = time;
      // Where less motion is asked for, the picture changes twice a second.
      if (!this.calm.matches || time - drawn >= 500) {
        drawn = time;
        const next = Math.floor(from + ((time - start) / 1000) * pace);
        if (this.pauseAt && this.spent < this.pauseAt && next >= this.pauseAt) {
          this.go(this.pauseAt);
          from = this.pauseAt;
          start = time + 2000; // the moment to look at
        } else if (next > this.spent) this.go(next);
      }
      if (this.spent >= this.last) this.pause();
      else window.requestAnimationFrame(frame);
    };
    window.requestAnimationFrame(frame);
  }

  pause() {
    const moved = this.playing;
    this.playing = false;
    this.button.closest(".player").toggleAttribute("data-playing", false);
    this.button.textContent = "Play";
    if (moved) this.go(this.spent);
  }
}

if (typeof module !== "undefined") {
  module.exports = { decode, configuration, chain, arms, moment, ticksAtHit, degrees };
} else {
  document.querySelectorAll(".player").forEach((root) => {
    const data = document.getElementById(`${root.id}-data`);
    root.querySelectorAll(".without").forEach((note) => note.remove());
    new Player(root, JSON.parse(data.textContent));
  });
}
