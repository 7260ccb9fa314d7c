"use strict";
/* Plays movements tick by tick. Data: analysis/report/player.py. */

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

/* After `spent` ticks: the row shown, reward so far, goals hit, hand at work. */
function moment(movement, spent) {
  const ticks = Math.min(spent, movement.ticks);
  const seen = movement.rows.at(-1) + 1 - (movement.ticks - ticks);
  const row = Math.max(seen - 1, 0);
  const hit = movement.hits.filter((at) => at < seen).length;
  const hand = { L: "left", R: "right" }[movement.hands[hit]];
  return { ticks, row, hit, hand };
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

/* One side: a choice of movement, its picture and what is to be said of it. */
class Panel {
  constructor(parent, choices, id, side, changed) {
    this.side = side;
    const choice = element("span", {}, choices);
    element("label", { for: `${id}-${side}`, text: side === "left" ? "First " : "Second " }, choice);
    this.select = element("select", { id: `${id}-${side}` }, choice);
    this.select.addEventListener("change", changed);
    const root = element("div", { class: "panel" }, parent);
    this.svg = element("svg:svg", { role: "img" }, root);
    this.facts = element("p", { class: "facts" }, root);
  }

  offer(task, wanted, first) {
    this.select.replaceChildren();
    const add = (parent, value, text) => element("option", { value, text }, parent);
    const group = element("optgroup", { label: "Initial: corrective process alone" }, this.select);
    task.initials.forEach((initial, k) => add(group, `i${k}`, `initial ${initial.hands} (−${initial.ticks})`));
    if (!task.initials.length) group.remove();
    const methods = element("optgroup", { label: "Methods" }, this.select);
    task.movements.forEach((movement, k) => add(methods, `m${k}`, `${movement.name} (−${movement.ticks})`));
    const same = task.movements.findIndex((movement) => movement.label === wanted);
    if (same >= 0) this.select.value = `m${same}`;
    else if (this.side === "left" && task.initials.length) this.select.value = "i0";
    else this.select.value = `m${first}`;
  }

  get label() {
    return this.movement && this.movement.label;
  }

  load(task) {
    const list = this.select.value[0] === "i" ? task.initials : task.movements;
    const dof = degrees(task.robot);
    this.task = task;
    this.movement = decode(list[Number(this.select.value.slice(1))], task.unit, dof);
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
    const { label, run, runs, hands, ticks } = this.movement;
    this.svg.setAttribute("aria-label",
      `Robot on ${task.label}: ${label || "initial movement"}, hands ${hands}, reward −${ticks}`);
    const of = run ? `${runs > 1 ? `nearest the median of ${runs} runs: ` : "run "}${run}` : "corrective process alone, no learning";
    this.facts.title = of;
    this.head = label ? this.movement.name : `initial ${hands}`;
  }

  draw([left, bottom, right, top]) {
    const { goals, radius, below, hands } = this.task;
    const size = Math.max(right - left, top - bottom);
    this.svg.setAttribute("viewBox", `${left} ${-top} ${right - left} ${top - bottom}`);
    this.svg.style.setProperty("--stroke", size / 260);
    this.svg.replaceChildren();
    this.goals = goals.map(([x, y]) =>
      element("svg:circle", { class: "goal", cx: x, cy: -y, r: radius }, this.svg));
    this.marks = {};
    hands.forEach((hand) => {
      this.marks[hand] = { trail: element("svg:polyline", { class: `trail ${hand}` }, this.svg) };
    });
    this.base = element("svg:rect", { class: "base" }, this.svg);
    hands.forEach((hand) => {
      const joints = this.task.robot[hand].links.length + 1;
      this.marks[hand].arm = element("svg:polyline", { class: `arm ${hand}` }, this.svg);
      this.marks[hand].joints = Array.from({ length: joints }, () => hand === "left"
        ? element("svg:rect", { class: "joint left", width: size / 46, height: size / 46 }, this.svg)
        : element("svg:circle", { class: "joint right", r: size / 130 }, this.svg));
    });
    this.half = size / 92;
    goals.forEach(([x, y], k) => element("svg:text", {
      x, y: -y + (below[k] ? radius + size / 90 + size / 36 : -radius - size / 90),
      class: "number", "font-size": size / 26, text: k + 1,
    }, this.svg));
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
        if (hand === "left") {
          joints[k].setAttribute("x", x - this.half);
          joints[k].setAttribute("y", -y - this.half);
        } else {
          joints[k].setAttribute("cx", x);
          joints[k].setAttribute("cy", -y);
        }
      });
    });
    this.goals.forEach((goal, k) => {
      goal.classList.toggle("hit", k < now.hit);
      goal.classList.toggle("current", k === now.hit);
    });
    this.words = now.hit < goals.length
      ? `reward ${reward(now.ticks)}, goal ${now.hit + 1} with the ${now.hand} hand`
      : `reward ${reward(now.ticks)}, all goals hit`;
    this.facts.replaceChildren();
    element("strong", { text: this.head }, this.facts);
    this.facts.append(`: ${this.words}`);
  }
}

function reward(ticks) {
  return ticks ? `−${ticks}` : "0";
}

/* ---- The player ---- */

class Player {
  constructor(root, data) {
    this.data = data;
    this.spent = 0;
    this.playing = false;
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)");
    this.build(root, root.id);
    this.choose();
    /* Played once when it is first seen, unless less motion is asked for. */
    if (!this.calm.matches && "IntersectionObserver" in window) {
      const seen = new IntersectionObserver((entries) => {
        if (!entries.some((entry) => entry.isIntersecting)) return;
        seen.disconnect();
        if (!this.spent) this.play();
      }, { threshold: 0.6 });
      seen.observe(root);
    } else this.go(this.last);
  }

  build(root, id) {
    const both = element("div", { class: "panels" }, root);
    const load = () => this.load();
    const folded = element("details", { class: "choices" });
    element("summary", { text: "Choose task, movements, speed" }, folded);
    const choices = element("div", { class: "controls" }, folded);
    const first = element("span", {}, choices);
    element("label", { for: `${id}-task`, text: "Task " }, first);
    this.task = element("select", { id: `${id}-task` }, first);
    this.data.tasks.forEach((task, k) => element("option", { value: k, text: task.label }, this.task));
    this.task.value = this.data.first ? this.data.first.task : 0;
    this.task.addEventListener("change", () => this.choose());
    this.panels = ["left", "right"].map((side) => new Panel(both, choices, id, side, load));
    const controls = element("div", { class: "controls" }, root);
    this.button = element("button", { type: "button", class: "play", text: "Play" }, controls);
    this.button.addEventListener("click", () => (this.playing ? this.pause() : this.play()));
    const step = (text, label, by) => {
      const made = element("button", { type: "button", "aria-label": label, text }, controls);
      made.addEventListener("click", () => { this.pause(); this.go(this.spent + by); });
    };
    step("◂", "One tick back", -1);
    step("▸", "One tick on", 1);
    const ticks = element("span", { class: "ticks" }, controls);
    this.slider = element("input", { type: "range", "aria-label": "Tick", min: 0, step: 1, value: 0 }, ticks);
    this.slider.addEventListener("input", () => { this.pause(); this.go(Number(this.slider.value)); });
    this.count = element("span", { class: "count" }, ticks);
    const speed = element("span", {}, choices);
    element("label", { for: `${id}-speed`, text: "Speed " }, speed);
    this.speed = element("select", { id: `${id}-speed` }, speed);
    [15, 30, 60, 120, 240].forEach((rate) => element("option", { value: rate, text: `${rate} ticks/s` }, this.speed));
    this.speed.value = "60";
    root.append(folded);
    this.status = element("p", { class: "unseen", role: "status", "aria-live": "polite" }, root);
  }

  choose() {
    const at = Number(this.task.value);
    const first = this.data.first && this.data.first.task === at ? this.data.first.movement : 0;
    this.panels.forEach((panel) => panel.offer(this.data.tasks[at], panel.label, first));
    this.load();
  }

  load() {
    const task = this.data.tasks[Number(this.task.value)];
    this.pause();
    this.panels.forEach((panel) => panel.load(task));
    const corners = this.panels.flatMap(({ seen }) => [seen.slice(0, 2), seen.slice(2)]);
    const box = around(corners, 0.4);
    this.panels.forEach((panel) => panel.draw(box));
    this.last = Math.max(...this.panels.map((panel) => panel.movement.ticks));
    this.slider.max = this.last;
    this.go(0);
  }

  /* The state is spoken only while nothing moves. */
  go(spent) {
    this.spent = Math.max(0, Math.min(this.last, spent));
    this.panels.forEach((panel) => panel.show(this.spent));
    this.slider.value = this.spent;
    this.count.textContent = `${this.spent} of ${this.last}`;
    this.slider.setAttribute("aria-valuetext", `tick ${this.spent} of ${this.last}`);
    if (!this.playing) {
      this.status.textContent = this.panels.map((panel) => `${panel.side}: ${panel.words}`).join("; ");
    }
  }

  play() {
    if (this.spent >= this.last) this.go(0);
    this.playing = true;
    this.button.textContent = "Pause";
    this.status.textContent = "";
    const from = this.spent;
    let start = null;
    let drawn = -Infinity;
    const rate = () => Number(this.speed.value);
    let pace = rate();
    let base = from;
    const frame = (time) => {
      if (!this.playing) return;
      if (start === null || pace !== rate()) {
        base = this.spent;
        pace = rate();
        start = time;
      }
      // Where less motion is asked for, the picture changes twice a second.
      if (!this.calm.matches || time - drawn >= 500) {
        drawn = time;
        this.go(Math.floor(base + ((time - start) / 1000) * pace));
      }
      if (this.spent >= this.last) this.pause();
      else window.requestAnimationFrame(frame);
    };
    window.requestAnimationFrame(frame);
  }

  pause() {
    const moved = this.playing;
    this.playing = false;
    this.button.textContent = "Play";
    if (moved) this.go(this.spent);
  }
}

if (typeof module !== "undefined") {
  module.exports = { decode, configuration, chain, arms, moment, degrees };
} else {
  document.querySelectorAll(".player").forEach((root) => {
    const data = document.getElementById(`${root.id}-data`);
    root.querySelectorAll(".without").forEach((note) => note.remove());
    new Player(root, JSON.parse(data.textContent));
  });
}
