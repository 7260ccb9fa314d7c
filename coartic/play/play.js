"use strict";
/* The page on which a reader moves goals and the robot reacts. `Play` is one such figure. Its data come from
   coartic/play/page.py, or from a report, which also shows its stored runs. */

const SEEDS = 5; // number of runs of each robot
const TRIALS = 10000; // of a run
const TICKS_PER_S = 90;
const PRACTICE = 1.05; // factor by which the number of trials shown grows from picture to picture, at first
const FIRST_SEEN = 0.05; // where that number begins: the first trial is shown for a second, until it reaches 2
const HOLD_S = 0.9; // pause at a hit
const DRIFTS = [0, 0.03, 0.1, 0.3, 1]; // κ, how far exploration leans towards the next goal
const MAX_GOALS = 6;
const FAR = 12; // largest coordinate of a goal or angle of a joint, length units or rad
const STRIDE = 2; // distance to a new goal, for arms of length 4
const ROLES = ["first", "second"];
const NAMES = {
  alone: "corrective process alone", learner: "the learner", plan: "the planner", you: "you",
};
const PLANNER = "planner, all goals ahead"; // with which others are compared
const short = (value) => Number(value.toFixed(2)).toString();
const grouped = (count) => `${count}`.replace(/\B(?=(\d{3})+$)/g, "\u202f");
const pluralize = (count, what) => `${grouped(count)} ${what}${count === 1 ? "" : "s"}`;
const capital = (words) => words[0].toUpperCase() + words.slice(1);
const bounded = (values) => values.map((value) => Math.max(-FAR, Math.min(FAR, value)));
const ticks_by_goal = ({ hands, movements }) => hands.map((_, at) => movements.reduce((sum, { goal, ticks }) => sum + (goal === at ? ticks : 0), 0));
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/* The reader's choices. The link contains those that differ from the first ones. `mate` moves the second robot if the
   reader moves the first. `announced` has the position from which a goal has just moved. `own` has the reader's
   postures, each with its hand; for a posture without joints the robot chooses. With a tick below 0 the robots stand
   where they hit the goal that they share, or the reader places one. */
const AT_FIRST = {
  open: 0, preset: 0, who: "learner", mate: "learner", reward: "whole", explores: "EC4", drift: 0, ahead: 1, goals: null,
  others: null, announced: null, trials: 0, tick: -1, own: null, edited: 1,
};

/* The state as a string, such as goals=6,0.1;6,2&trials=300. An empty list of others is written as well. */
function written(state, first) {
  const text = (value) => (Array.isArray(value) ? value.map((row) => row.join(",")).join(";") : encodeURIComponent(value));
  return Object.entries(state).filter(([name, value]) => value !== first[name])
    .map(([name, value]) => `${name}=${text(value)}`).join("&");
}

function read(link, first) {
  const state = { ...first };
  new URLSearchParams(link).forEach((text, name) => {
    if (typeof AT_FIRST[name] === "string") state[name] = text;
    else if (typeof AT_FIRST[name] === "number" && Number.isFinite(Number(text))) state[name] = Number(text);
    else if (AT_FIRST[name] === null) {
      const rows = text.split(";").filter(Boolean).map((row) => row.split(",").map(Number));
      if (rows.flat().every(Number.isFinite)) state[name] = rows;
    }
  });
  return state;
}

/* Posture difference of two samples: their means, the distance between the means (length units and rad), and the number
   of runs. */
function posture_difference(samples) {
  const means = samples.map((runs) => runs[0].map((_, j) => runs.reduce((sum, q) => sum + q[j], 0) / runs.length));
  const distance = distance_of(...means);
  return { means, distance, runs: Math.min(...samples.map((runs) => runs.length)) };
}

/* A film of what one robot does: its rows, and ticks at which goals are hit. */
class Mover {
  constructor(problem, trial, role) {
    const { rows, hits } = trajectory(problem, trial);
    const trails = Object.fromEntries(problem.hands.map((hand) => [hand, rows.map((q) => joint_positions(problem, q, hand).at(-1))]));
    Object.assign(this, { problem, trial, role, rows, hits, trails, last: rows.length - 1 });
  }

  seen() {
    const step = Math.max(1, Math.floor(this.rows.length / 40));
    return this.rows.filter((_, k) => k % step === 0 || k === this.last).flatMap((q) => [
      [q[0] - 0.6 * this.problem.scale, q[1] - 0.2 * this.problem.scale], ...this.problem.hands.flatMap((hand) => joint_positions(this.problem, q, hand)),
    ]);
  }
}

class Play {
  constructor(root, data, saved) {
    Object.assign(this, { root, data, held: null, order: 0, busy: false, results: new Map(), handles: new Map(), playing: false });
    this.find = (name) => root.querySelector(`[data-is="${name}"]`);
    this.set = (property, values) => Object.entries(values).forEach(([name, value]) => { this.find(name)[property] = value; });
    this.stage = new Picture(this.find("stage"));
    [this.first_inset, this.inset] = ["first", "inset"].map((name) => new Picture(this.find(name)));
    this.curve = new Picture(this.find("curve"));
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)");
    this.listen();
    this.first = { ...AT_FIRST, ...data.first };
    this.worker = new Worker(URL.createObjectURL(new Blob([data.source], { type: "text/javascript" })));
    this.worker.onmessage = ({ data: message }) => this.hear(message);
    this.fresh = new Set(); // results for the present state
    root.classList.add("live");
    // Show how the robot learned and then play, while in sight; not with reduced motion. The button that shows the
    // movement does not end this, but any other act of the reader does.
    ["pointerdown", "keydown", "input"].forEach((kind) => root.addEventListener(kind, ({ target, key }) => {
      if (target !== this.find("play") && key !== "Tab") this.waits = false;
    }, true));
    this.restore(saved);
    new ResizeObserver(() => { this.box = null; this.refresh(); }).observe(root);
    window.matchMedia("print").addEventListener("change", () => this.draw()); // at once, in the size and colours of the print
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.refresh());
    new MutationObserver(() => this.refresh()).observe(document.body, { attributeFilter: ["data-theme"] }); // of the site
    new IntersectionObserver((entries) => {
      this.inSight = entries.at(-1).isIntersecting;
      this.refresh();
    }, { threshold: 0.3 }).observe(this.find("stage"));
  }

  /* ---- Tasks, and who moves the robots ---- */

  get preset() {
    return this.data.presets[this.state.preset];
  }

  /* The tasks in view, one or two, which share the start and the first goal. */
  get tasks() {
    const { goals, others } = this.state;
    return [goals, ...(others ? [[goals[0], ...others]] : [])].map((each) => this.taskWith(each));
  }

  taskWith(goals) {
    const { task } = this.preset;
    const fits = !/^[LR]+$/.test(task.initial_hands) || task.initial_hands.length === goals.length;
    return { ...task, goals, initial_hands: fits ? task.initial_hands : "best-of-all" };
  }

  /* Who moves a robot. */
  by(k) {
    return k && this.state.who === "you" ? this.state.mate : this.state.who;
  }

  /* The goal that the button moves, from 0: the third, or the last of fewer. */
  get moved() {
    return Math.min(2, this.state.goals.length - 1);
  }

  /* The goal that has just moved, and the task before; null if none has. */
  get announced() {
    const { who, announced, goals, others } = this.state;
    if (!announced || others || who !== "learner" || !this.moved) return null;
    return { goal: this.moved, task: this.taskWith(goals.with(this.moved, announced[0])) };
  }

  /* Runs of a results folder, as long as nobody has changed the task. */
  stored(who) {
    const run = (this.preset.runs || []).find(({ id }) => id === who);
    const { goals, others } = this.state;
    const unchanged = same(goals, this.preset.task.goals) && (!others || same(others, this.preset.others));
    return run && unchanged ? run : null;
  }

  /* The learner's condition. */
  get rules() {
    const { reward, explores, drift } = this.state;
    const [{ hands }] = this.problems;
    const chosen = Object.hasOwn(CONDITIONS, explores) ? explores : "EC4";
    const id = hands.length > 1 ? chosen : "EC1";
    return { ...CONDITIONS[id], id, hands, drift, credit: reward === "movement" ? "subtask" : "overall" };
  }

  /* The same in Python. */
  get python() {
    const { id, hands, drift, credit } = this.rules;
    const fields = [
      ...(same(hands, CONDITIONS[id].hands) ? [] : [`hands=("${HANDS[hands[0]]}",)`]),
      ...(credit === "subtask" ? ['credit="subtask"', 'learned="replay"'] : []),
      ...(drift ? [`drift=${drift}`] : []),
    ];
    return fields.length ? `replace(CONDITIONS["${id}"], ${fields.join(", ")})` : `CONDITIONS["${id}"]`;
  }

  /* Goals, robot or method have changed: show the fast results at once, and ask the worker for the others. */
  ask() {
    const { state } = this;
    const mover = (who) => (Object.hasOwn(NAMES, who) || this.stored(who) ? who : "learner");
    [state.who, state.mate] = [mover(state.who), mover(state.mate === "you" ? "learner" : state.mate)];
    this.problems = this.tasks.map((task) => problem_of(task));
    this.alone = this.problems.map((problem) => corrective_trial(problem, best_hands(problem)));
    this.stale = true;
    this.showControls();
    this.send();
    this.answer();
  }

  send() {
    if (this.busy && this.held) return;
    this.stale = false;
    this.order += 1;
    const { announced } = this;
    const jobs = [];
    const order = (key, task, job) => jobs.push({ key, task, trials: 1, turn: 1, ...job });
    this.tasks.forEach((task, k) => {
      const who = this.by(k);
      if (!this.alone[k].going || this.stored(who)) return; // or a goal is out of reach
      for (let seed = 0; who === "learner" && seed < (announced ? 1 : SEEDS); seed += 1) {
        const job = { rules: this.rules, seed, trials: TRIALS, turn: seed && seed + 1 };
        order(`${k} run ${seed}`, announced ? announced.task : task, job);
      }
      if (who === "plan") order(`${k} plan`, task, { horizon: this.state.ahead, turn: 0 });
      else order(`${k} far`, task, { horizon: MAX_GOALS });
    });
    if (announced) order("0 before", announced.task, { horizon: MAX_GOALS });
    this.asked = new Map(jobs.map((job) => [job.key, JSON.stringify(job)]));
    // Do not compute results again that exist already.
    this.fresh = new Set([...this.asked.keys()].filter((key) => {
      const { done, job } = this.results.get(key) || {};
      return done && job === this.asked.get(key);
    }));
    const left = jobs.filter(({ key }) => !this.fresh.has(key));
    this.busy = left.length > 0;
    this.worker.postMessage({ order: this.order, jobs: left });
  }

  hear({ order, reports }) {
    if (order !== this.order) return;
    this.busy = false;
    reports.forEach(({ key, made, done, snapshots }) => {
      // The results for an earlier state are shown until there are new ones.
      if (!this.fresh.has(key)) this.results.set(key, { snapshots: [], job: this.asked.get(key) });
      this.fresh.add(key);
      const result = this.results.get(key);
      result.snapshots.push(...snapshots);
      Object.assign(result, { made, done });
    });
    this.answer();
    if (this.stale) this.send();
  }

  /* The result of a job for the present state. */
  result(key) {
    return this.asked.has(key) ? this.results.get(key) : undefined;
  }

  /* The solution learned after a number of trials. */
  snapshot(key, trials = this.shown) {
    const result = this.result(key);
    return result ? result.snapshots.findLast((each) => each.trials <= trials) || null : null;
  }

  /* What each run of a robot has learned after the trials shown. Unfinished runs other than the first are left out. */
  practised(k) {
    const keys = Array.from({ length: SEEDS }, (_, seed) => `${k} run ${seed}`);
    const finished = keys.filter((key, seed) => this.fresh.has(key) && (this.results.get(key).done || !seed));
    return finished.map((key) => this.snapshot(key)).filter(Boolean);
  }

  get shown() {
    return this.state.trials || Math.max(1, Math.floor(this.paced));
  }

  /* The solution of a task, as movements; null while there is none. */
  solution(k) {
    const who = this.by(k);
    const stored = this.stored(who);
    if (stored) return stored.films[k].movements;
    if (who === "you") {
      return this.own.map(([hand, ...q], goal) => (q.length
        ? { goal, hand, kind: "learned", target: q } : { goal, hand, kind: "corrective", target: null }));
    }
    if (who === "alone") return null;
    const runs = this.practised(k).sort((a, b) => a.reward - b.reward);
    const median = runs[Math.floor(runs.length / 2)] || this.snapshot(`${k} run 0`);
    const snapshot = who === "plan" ? this.snapshot(`${k} plan`, Infinity) : median;
    return snapshot && snapshot.movements;
  }

  /* Make the films from the results so far. */
  answer() {
    this.movers = this.problems.map((problem, k) => {
      const movements = this.solution(k);
      const fits = movements && problem.goals.every((_, goal) => movements.some((movement) => movement.goal === goal));
      const trial = fits ? execute(problem, movements.filter((m) => m.goal < problem.goals.length)) : this.alone[k];
      return new Mover(problem, trial, ROLES[k]);
    });
    const planned = this.announced && this.fresh.has("0 far") && this.snapshot("0 far", Infinity);
    if (planned) this.movers.push(new Mover(this.problems[0], execute(this.problems[0], planned.movements), "second"));
    const ghost = this.movers.length < 2 && this.state.who !== "alone";
    if (ghost) this.movers.unshift(new Mover(this.problems[0], this.alone[0], "ghost"));
    this.plan = this.problems.map((_, k) => (this.stale || !this.fresh.has(`${k} far`) ? null : this.snapshot(`${k} far`, Infinity)));
    const meets = (mover) => (this.main.length > 1 && mover.hits[this.shared]) || 0;
    this.meeting = Math.max(...this.main.map(meets));
    this.movers.forEach((mover) => Object.assign(mover, { meets: meets(mover), waits: this.meeting - meets(mover) }));
    this.showMovements();
    this.refresh();
  }

  /* A bar for each movement of each robot, over a bar for the same movement before practice. With one robot, and without
     practice, the bar below is that of the corrective process alone. */
  showMovements() {
    const first = this.announced || this.state.who === "alone" ? [] : this.first_trials;
    const trials = this.main.map(({ trial }, k) => [trial, first.length ? execute(this.problems[k], first[k].movements) : this.alone[k]]);
    const shown = !this.announced && this.state.who !== "alone" && trials.flat().every(({ going }) => going);
    this.find("movements").hidden = !shown;
    if (!shown) return;
    const ticks = trials.map((pair) => pair.map(ticks_by_goal));
    const most = Math.max(1, ...ticks.flat(2));
    const element = (kind, className, ...content) => {
      const made = Object.assign(document.createElement(kind), { className });
      made.append(...content);
      return made;
    };
    const bar = (count) => {
      const made = element("span", "");
      made.style.width = `${(100 * count) / most}%`;
      return made;
    };
    const lists = ticks.map(([after, before], k) => element("ol", ROLES[k], ...after.map((count, g) => {
      const more = count - before[g];
      return element("li", "", element("span", "", `goal ${this.labelOf(k, g)} `), element("span", "bars", bar(count), bar(before[g])),
        element("span", "", ` ${count} (${more > 0 ? "+" : more < 0 ? "−" : "±"}${Math.abs(more)})`));
    })));
    const words = first.length ? " after practice; below, in grey, before practice" : "; below, in grey, those of the corrective process alone";
    this.find("movements").replaceChildren(element("p", "note", `Ticks of each movement${words}:`), element("div", "pair", ...lists));
  }

  /* The optimum of the task, if it is known. */
  get optimum() {
    const { goals, others } = this.state;
    return !others && same(goals, this.preset.task.goals) ? this.preset.optimum : null;
  }

  /* The number of a goal, with a letter if each of two robots has its own goal of that number. */
  labelOf(k, g) {
    return `${g + 1}${this.problems.length > 1 && g ? "ab"[k] : ""}`;
  }

  /* ---- Time: both robots wait for each other at the goal they share, or at the goal before the moved one ---- */

  get shared() {
    return this.announced ? this.announced.goal - 1 : 0;
  }

  get main() {
    return this.movers.filter((mover) => mover.role !== "ghost");
  }

  get tick() {
    const { tick } = this.state;
    return tick < 0 ? this.meeting || this.stops[0] || 0 : Math.min(tick, this.last);
  }

  row({ meets, waits, last }) {
    return this.tick <= this.meeting ? Math.min(this.tick, meets) : Math.min(this.tick - waits, last);
  }

  get last() {
    return Math.max(...this.movers.map(({ last, waits }) => last + waits));
  }

  /* Ticks at which a playing film holds. */
  get stops() {
    const stops = this.main.flatMap(({ hits, waits }) => hits.map((hit) => hit + waits));
    return [...new Set(stops)].sort((a, b) => a - b);
  }

  play() {
    if (this.playing) return;
    this.playing = true;
    if (this.state.tick < 0 || this.state.tick >= this.last) this.state.tick = 0;
    let [at, before, held] = [this.state.tick, null, 0];
    const frame = (time) => {
      if (!this.playing) return;
      const seconds = before === null ? 0 : Math.min(0.1, (time - before) / 1000);
      before = time;
      if (Math.round(at) !== this.state.tick) at = this.state.tick; // moved by hand
      if (held > 0) held -= seconds;
      else if (this.inSight !== false) {
        const next = at + seconds * TICKS_PER_S;
        const stop = this.stops.find((each) => each > at + 0.5 && each <= next);
        at = stop === undefined ? next : stop;
        if (stop !== undefined) held = HOLD_S;
        else if (at > this.last) at = 0;
        this.state.tick = Math.round(at);
        this.refresh();
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    this.refresh();
  }

  /* ---- Pictures ---- */

  /* Draw in the next frame, once for all changes. */
  refresh() {
    if (this.waiting || !this.movers) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
      this.say();
    });
  }

  draw() {
    const { stage, state } = this;
    const colours = Object.fromEntries(["first", "second", "dim", "ink", "line", "soft"].map((name) => [name, stage.colour(name)]));
    colours.ghost = colours.dim;
    this.colours = colours;
    const points = [...this.movers.flatMap((mover) => mover.seen()), ...this.problems.flatMap((problem) => problem.goals)];
    const [{ free, start, robot, scale }] = this.problems;
    if (!this.box || !this.held) this.box = around(points, 0.7 * scale);
    if (!this.held) this.glide(); // the position under the pointer stays
    stage.begin(this.view);
    stage.grid(this.unit, colours.line, colours.soft);
    if (free[0] !== free[1]) stage.rail(start, robot.base_size[1] / 2, free[0], colours.line);
    if (!this.editing) this.movers.forEach((mover) => {
      const row = this.row(mover);
      mover.problem.hands.forEach((hand) => [[mover.last, 0.15], [row, 0.5]].forEach(([to, alpha]) => (
        stage.trail(mover.trails[hand].slice(0, to + 1), colours[mover.role], alpha, hand === LEFT))));
    });
    this.problems.forEach((problem, k) => problem.goals.forEach((goal, g) => {
      if (k && !g) return;
      const mover = this.main[k];
      stage.goal(goal, problem.radius, {
        label: this.labelOf(k, g), movable: !this.editing, held: this.held && this.held.name === `${k} ${g}`,
        colour: this.problems.length > 1 && !g ? colours.ink : colours[ROLES[k]],
        hit: mover.hits[g] !== undefined && mover.hits[g] <= this.row(mover),
      });
    }));
    const stands = (mover, look) => stage.robot(mover.problem, mover.rows[mover.meets], { colour: colours[mover.role], ...look });
    if (this.editing) {
      this.main.slice(1).forEach((mover) => stands(mover, { alpha: 0.5 }));
      this.postures.forEach(({ q }, g) => stage.robot(this.problems[0], q, {
        colour: colours.first, alpha: g === state.edited - 1 ? 1 : 0.2, weight: g === state.edited - 1 ? 1 : 0.8,
      }));
    } else {
      if (this.meeting && this.tick > this.meeting) this.main.forEach((mover) => stands(mover, { alpha: 0.2, weight: 0.9 }));
      this.movers.forEach((mover) => {
        const row = this.row(mover);
        const hit = mover.hits.filter((at) => at < row).length;
        stage.robot(mover.problem, mover.rows[row], {
          colour: colours[mover.role], chosen: mover.trial.hands[Math.min(hit, mover.trial.hands.length - 1)],
          alpha: mover.role === "ghost" ? 0.5 : 0.9, weight: { ghost: 0.8, first: this.main.length > 1 ? 1.4 : 1 }[mover.role], // the one below shows
        });
      });
    }
    this.place();
    this.compare();
    if (this.state.open) this.drawCurve();
  }

  /* The view follows the box in a few frames. */
  glide() {
    if (!this.view || this.calm.matches) this.view = this.box;
    else {
      const [off, near] = [Math.max(...this.box.map((value, k) => Math.abs(value - this.view[k]))), 0.02 * this.unit];
      this.view = off < near ? this.box : this.view.map((value, k) => value + 0.25 * (this.box[k] - value));
      if (off >= near) this.refresh();
    }
  }

  /* Postures of each run at the hit of the shared goal; if a goal has moved, before and after that. */
  get postures_met() {
    const { announced, shared } = this;
    return this.main.map(({ trial }, k) => {
      const who = this.by(k);
      if (announced) {
        const before = k ? this.snapshot("0 before", Infinity) : this.snapshot("0 run 0");
        return before ? [before.reached[shared], trial.reached[shared]] : [];
      }
      if (this.stored(who)) return this.stored(who).films[k].reached;
      return who === "learner" ? this.practised(k).map(({ reached }) => reached[0]) : [trial.reached[0]];
    }).map((runs) => runs.filter(Boolean));
  }

  /* What two learners do in their first trial; empty if they are not shown, or until both have made it. */
  get first_trials() {
    if (this.main.length < 2 || this.announced || this.state.who !== "learner") return [];
    const trials = this.problems.map((_, k) => this.snapshot(`${k} run 0`, 1));
    return trials.every((trial) => trial && trial.reached.length) ? trials : [];
  }

  /* Posture difference of the robots at the goal that they share, in words and as pictures, before practice as well. */
  compare() {
    const both = this.main.length > 1 && !this.editing ? this.postures_met : [];
    const shown = both.length > 0 && both.every((runs) => runs.length);
    const first = shown ? this.first_trials.map(({ reached }) => reached.slice(0, 1)) : [];
    this.set("hidden", { inset: !shown, before: !first.length, now: !first.length });
    this.difference = null;
    if (!shown) return;
    this.difference = posture_difference(this.announced ? both.map((runs) => runs.slice(1)) : both);
    if (this.announced) this.difference.shifts = both.map(([before, after]) => distance_of(before, after));
    const { problems: [problem], difference: { means } } = this;
    const { scale, hands } = problem;
    const [x, y] = problem.goals[this.shared];
    const points = [...first, ...both, means].flat().flatMap((q) => [
      [q[0] - 0.5 * scale, q[1] - 0.1 * scale], ...hands.flatMap((hand) => joint_positions(problem, q, hand)),
    ]);
    const box = around([...points, [x + 0.3 * scale, y + 0.2 * scale]], 0.3 * scale);
    if (first.length) this.drawMeeting(this.first_inset, box, first, first.flat());
    this.drawMeeting(this.inset, box, both, means);
  }

  /* Draw postures of both robots at the goal that they share: thin those of runs, thick their means. */
  drawMeeting(picture, box, both, means) {
    const { colours, problems: [problem] } = this;
    picture.begin(box);
    both.forEach((runs, k) => {
      runs.forEach((q) => picture.robot(problem, q, { colour: colours[ROLES[k]], alpha: 0.35, thin: true }));
      picture.robot(problem, means[k], { colour: colours[ROLES[k]], alpha: 0.9, weight: k ? 1 : 1.4 }); // the one below shows
    });
    picture.goal(problem.goals[this.shared], problem.radius, { label: "", colour: colours.ink, hit: true });
    picture.text(`at goal ${this.shared + 1}`, [8, 12], colours.soft, "left", 12);
  }

  /* Ticks needed against trials, on a logarithmic scale. */
  drawCurve() {
    const { curve, colours } = this;
    const learns = this.state.who === "learner" && !this.announced;
    this.find("learning").hidden = !learns;
    if (!learns) return;
    const runs_of = (k) => Array.from({ length: SEEDS }, (_, seed) => this.result(`${k} run ${seed}`)).filter(Boolean);
    const runs = this.problems.flatMap((_, k) => runs_of(k));
    const references = [...this.alone.map((trial) => -trial.reward), ...this.plan.map((plan) => plan && -plan.reward), this.optimum ? -this.optimum : NaN].filter(Number.isFinite);
    const learned = runs.flatMap(({ snapshots }) => snapshots.map(({ reward }) => -reward));
    const all = [...references, ...learned].filter(Number.isFinite);
    if (!all.length) return;
    let [low, high] = [Math.min(...all), Math.max(...all)];
    [low, high] = [low - 0.2 * (high - low) - 2, high + 0.25 * (high - low) + 4];
    curve.begin([0, 0, 1, 1]);
    const { context, size: [width, height] } = curve;
    curve.text("ticks, by trials", [0, 8], colours.soft, "left", 12);
    const [left, right, top, bottom] = [40, width - 10, 20, height - 22];
    const x = (trials) => left + ((right - left) * Math.log(trials)) / Math.log(TRIALS);
    const y = (ticks) => bottom - ((bottom - top) * (ticks - low)) / (high - low);
    for (let trials = 1; trials <= TRIALS; trials *= 10) {
      context.fillStyle = colours.line;
      context.fillRect(x(trials), top, 1, bottom - top);
      curve.text(grouped(trials), [x(trials), height - 10], colours.soft, trials === 1 ? "left" : trials === TRIALS ? "right" : "center", 12);
    }
    const step = [5, 10, 20, 50, 100, 200, 500, 1000].find((each) => (high - low) / each < 5) || 5000;
    for (let ticks = step * Math.ceil(low / step); ticks < high; ticks += step) {
      curve.text(`${ticks}`, [left - 5, y(ticks)], colours.soft, "right", 12);
    }
    const named = []; // heights of the names drawn so far
    this.problems.forEach((_, k) => {
      const colour = colours[ROLES[k]];
      const level = (name, reward, dash, ink) => {
        if (!Number.isFinite(reward)) return;
        context.strokeStyle = ink;
        const at = y(-reward);
        curve.path([[left, at], [right, at]], 1.2, dash);
        const free = [at - 8, at + 9].find((place) => references.every((ticks) => Math.abs(y(ticks) - place) > 6)
          && named.every((other) => Math.abs(other - place) > 12));
        if (free === undefined) return;
        named.push(free);
        curve.text(name, [left + 4, free], ink, "left", 12);
      };
      level(NAMES.alone, this.alone[k].reward, [2, 4], colour);
      level(PLANNER, this.plan[k] && this.plan[k].reward, [8, 4], this.problems.length > 1 ? colour : colours.second);
      level("proven optimum", this.optimum || NaN, [], colour);
      context.strokeStyle = colour;
      runs_of(k).forEach(({ snapshots }) => curve.path(snapshots.flatMap(({ trials, reward }, i) => (
        [snapshots[Math.max(0, i - 1)].reward, reward].map((each) => [x(trials), y(-each)]))), 1.5));
    });
    const at = Math.min(this.shown, Math.max(1, ...runs.map(({ made }) => made)));
    context.fillStyle = colours.ink;
    context.fillRect(x(at) - 0.75, top, 1.5, bottom - top);
  }

  /* ---- Words ---- */

  /* What the page shows, with one robot or two. */
  get lead() {
    const { who, mate } = this.state;
    const [{ goals, hands }] = this.problems;
    const two = this.main.length > 1;
    let seen = `the robot hits ${goals.length > 1 ? `goals 1 to ${goals.length} in turn` : "goal 1"}${hands.length > 1 ? ", with either hand" : ""}.`;
    if (two) seen = "both robots hit goal 1; then blue goes for the blue goals, orange for the orange ones.";
    if (this.announced) seen = `goal ${this.announced.goal + 1} has just moved. Blue is its next trial, orange that of a planner that sees all goals.`;
    if (who === "you") seen = `drag base and elbows of the ${two ? "blue " : ""}robot to place a posture for each goal.${two ? ` Orange: ${this.nameOf(mate)}.` : ""}`;
    return `${capital(this.nameOf(who))}: ${seen}${this.editing ? "" : " Goals can be dragged."}`;
  }

  nameOf(who) {
    return (this.stored(who) || { name: `${NAMES[who]}${who === "plan" ? `, ${this.horizon(this.state.ahead)}` : ""}` }).name;
  }

  /* The number of goals ahead that a planner sees, in words. */
  horizon(ahead) {
    if (!ahead) return "no goal ahead";
    return `${ahead < this.state.goals.length - 1 ? pluralize(ahead, "goal") : "all goals"} ahead`;
  }

  /* The result, and what its words mean. */
  get finding() {
    const { state, main, announced, difference } = this;
    const missed = main.find((mover) => !mover.trial.going);
    if (missed) return [`Goal ${missed.trial.reached.length + 1} is out of the robot's reach.`];
    const far = "A distance counts base and joints together, in length units and radians.";
    if (announced) {
      const [learner, planner] = difference && main.length > 1 ? difference.shifts.map(short) : ["…", "…"];
      return [`At goal ${announced.goal} the learner's posture has shifted by ${learner}, the planner's by ${planner}.`, `${far} Thin: before the goal moved.`];
    }
    if (state.who === "you" && main[0].trial.reward === this.optimum) return ["No solution takes fewer ticks than yours!"];
    if (state.who === "you" && this.plan[0] && main[0].trial.reward >= this.plan[0].reward) return [`You are as fast as the ${PLANNER}!`];
    if (state.who === "you" || (main.length < 2 && state.who !== "alone")) {
      const saved = main[0].trial.reward - this.alone[0].reward;
      const [{ hands, goals }] = this.problems;
      const tried = hands.length ** goals.length <= MAX_SEQUENCES ? "best hands" : "hands";
      const used = hands.length > 1 ? ` (${tried} ${letters_of(this.alone[0].hands)})` : "";
      const runs = this.practised(0).length;
      if (state.who === "learner" && this.shown === 1) return ["In the first trial only the corrective process acts. Practice follows."];
      return [
        `${saved ? `${pluralize(Math.abs(saved), "tick")} ${saved < 0 ? "more than" : "fewer than"}` : "As many ticks as"} the corrective process alone${used}.`,
        runs > 1 && state.who === "learner" ? `Shown is the median of the learner's ${runs} runs.` : "",
      ];
    }
    if (main.length > 1 && main[0].trial.hands[0] !== main[1].trial.hands[0]) return ["They hit goal 1 with different hands."];
    if (!difference) return [""];
    const { distance, runs } = difference;
    if (distance < 0.005) return ["At goal 1 both robots have the same posture."];
    const hasRuns = state.who === "learner" || (this.stored(state.who) && runs > 1);
    if (!hasRuns) return [`At goal 1 the posture difference is ${short(distance)}.`, far];
    const by_chance = this.stored(state.who) && this.preset.by_chance;
    const random = Number.isFinite(by_chance) ? ` (random search: ${short(by_chance)})` : "";
    const saved = this.first_trials.map(({ reward }, k) => main[k].trial.reward - reward);
    const pays = saved.length && Math.min(...saved) > 0 ? `Practice saves blue ${pluralize(saved[0], "tick")} and orange ${saved[1]}. ` : "";
    return [
      `${pays}At goal 1 the posture difference is ${short(distance)}${random}.`,
      `It is the distance between the mean postures (thick; ${pluralize(runs, "run")} each, thin), in length units and rad.${random && " Random search takes the best of as many random trials."}`,
    ];
  }

  /* Who needs how many ticks: role, name and reward. */
  get scores() {
    const { state, main } = this;
    const you = state.who === "you";
    let names = you ? ["Blue: you", `Orange: ${this.nameOf(state.mate)}`] : ["Blue", "Orange"];
    if (this.announced) names = ["The learner's next trial", "The planner"];
    if (main.length < 2) names = [capital(this.nameOf(state.who))];
    const scores = main.map(({ role, trial }, k) => [role, names[k], trial.reward]);
    if (main.length > 1 && !you) return scores;
    if (main.length < 2 && state.who !== "alone") scores.push(["ghost", "Corrective process alone", this.alone[0].reward]);
    if (this.plan[0] && state.who !== "plan") scores.push([main.length > 1 ? "bare" : "second", `${capital(PLANNER)}${main.length > 1 ? " (blue goals)" : ""}`, this.plan[0].reward]);
    if (this.optimum) scores.push(["bare", "Proven optimum", this.optimum]);
    return scores;
  }

  /* The scores as the page shows them, in words. */
  get score_words() {
    const words = (name) => [...this.find(name).children].map((line) => line.textContent).join("; ");
    return this.find("before").hidden ? words("score") : `before practice: ${words("first-score")}; after practice: ${words("score")}`;
  }

  say() {
    const { state } = this;
    const learns = state.who === "learner";
    const run = this.result("0 run 0");
    const at = learns && run ? Math.min(this.shown, run.made) : 0;
    const [finding, meaning = ""] = this.finding;
    const lines = (all) => all.map(([role, name, reward]) => {
      const line = document.createElement("span");
      const figure = document.createElement("strong");
      line.className = role;
      figure.textContent = Number.isFinite(reward) ? pluralize(-reward, "tick") : "–";
      line.append(`${name} `, figure);
      return line;
    });
    const scores = this.scores;
    const first = this.first_trials.map(({ reward }, k) => [...scores[k].slice(0, 2), reward]);
    this.find("score").replaceChildren(...lines(scores));
    this.find("first-score").replaceChildren(...lines(first));
    const drift = state.drift ? `, drift ${state.drift}` : "";
    this.set("textContent", {
      lead: this.lead, finding, meaning, progress: learns ? pluralize(at, "trial") + drift : "", now: `After ${pluralize(at, "trial")}`, play: this.playing ? "Pause" : "Show movement",
      count: this.main.map((mover, k, all) => `${all.length > 1 ? ["blue ", "orange "][k] : ""}${this.row(mover) + 1} of ${k < all.length - 1 ? mover.last + 1 : pluralize(mover.last + 1, "tick")}`).join(", "),
    });
    const stored = this.stored(state.who);
    this.find("film").hidden = !stored;
    if (stored) this.find("film").lastChild.textContent = `coartic draw ${this.data.folder} ${stored.films.map(({ run }) => `--run ${run}`).join(" ")} --out film.gif`;
    if (state.who === "you") [this.find("hand").value] = this.own[state.edited - 1];
    this.find("practice").hidden = !learns;
    const trials = this.find("trials");
    trials.value = at ? (1000 * Math.log(at)) / Math.log(TRIALS) : 0;
    trials.setAttribute("aria-valuetext", pluralize(at, "trial"));
    const tick = this.find("tick");
    tick.max = this.last;
    tick.value = this.tick;
    tick.setAttribute("aria-valuetext", `tick ${this.tick + 1} of ${this.last + 1}`);
    this.find("stage").setAttribute("aria-label", `${this.lead} ${finding}`);
    const open = this.busy || this.stale || [...this.fresh].some((key) => !this.results.get(key).done) || this.fresh.size < this.asked.size || this.paced < TRIALS;
    this.root.toggleAttribute("data-settled", !open);
    const spoken = `${this.score_words}; ${finding}`;
    if (!this.playing && !open && !this.held && spoken !== this.spoken) {
      this.find("status").textContent = spoken;
      this.spoken = spoken;
    }
    if (this.paced < TRIALS && (this.inSight || !this.waits)) {
      this.paced = this.waits ? PRACTICE * this.paced : Infinity;
      requestAnimationFrame(() => this.answer());
    } else if (!open && this.waits && !this.paused && this.inSight && !this.calm.matches) this.play();
  }

  /* ---- Handles ---- */

  /* Buttons cover what can be dragged by pointer, finger or arrow keys. */
  place() {
    const wanted = new Map();
    if (this.editing) {
      const { hand: chosen, q } = this.postures[this.state.edited - 1];
      wanted.set("base", { at: [q[0], q[1]], label: "Base", move: (to) => this.bend("base", to) });
      this.problems[0].hands.forEach((hand) => {
        joint_positions(this.problems[0], q, hand).forEach((at, k, all) => {
          if (k && !(hand === chosen && k === all.length - 1)) {
            wanted.set(`${hand} ${k}`, { at, label: `${HANDS[hand]} arm, ${k === all.length - 1 ? "hand" : `elbow ${k}`}`, move: (to) => this.bend([hand, k], to) });
          }
        });
      });
    } else {
      this.problems.forEach((problem, k) => problem.goals.forEach((goal, g) => {
        if (k && !g) return;
        const whose = this.problems.length > 1 && g ? (k ? " of orange" : " of blue") : "";
        wanted.set(`${k} ${g}`, { at: goal, label: `Goal ${this.labelOf(k, g)}${whose}`, move: (to) => this.moveGoal(k, g, to) });
      }));
    }
    const shown = [...wanted].map(([name, { at, label, move }]) => {
      if (!this.handles.has(name)) this.handles.set(name, this.handle(name));
      const handle = this.handles.get(name);
      const [x, y] = this.stage.toScreen(at);
      handle.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      handle.classList.toggle("joint", this.editing);
      handle.setAttribute("aria-label", `${label}, at ${short(at[0])}, ${short(at[1])}. Arrow keys move it.`);
      return Object.assign(handle, { at, move });
    });
    const layer = this.find("handles");
    const current = [...layer.children];
    if (current.length !== shown.length || shown.some((handle, k) => handle !== current[k])) layer.replaceChildren(...shown);
  }

  handle(name) {
    const handle = Object.assign(document.createElement("button"), { type: "button", className: "handle" });
    const to = (event) => {
      const box = this.find("stage").getBoundingClientRect();
      return this.stage.toWorld([event.clientX - box.left, event.clientY - box.top]);
    };
    handle.addEventListener("pointerdown", (event) => {
      handle.setPointerCapture(event.pointerId);
      const [x, y] = to(event);
      this.held = { name, off: [handle.at[0] - x, handle.at[1] - y] };
      this.showMeeting();
    });
    handle.addEventListener("pointermove", (event) => {
      if (!this.held || this.held.name !== name) return;
      const [x, y] = to(event);
      handle.move([x + this.held.off[0], y + this.held.off[1]]);
    });
    ["pointerup", "pointercancel"].forEach((kind) => handle.addEventListener(kind, () => {
      this.held = null;
      this.ask();
      this.keep();
    }));
    handle.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!way) return;
      event.preventDefault();
      const by = (event.shiftKey ? 0.02 : 0.1) * this.unit;
      this.showMeeting();
      handle.at = [handle.at[0] + by * way[0], handle.at[1] + by * way[1]];
      handle.move(handle.at);
      this.keep();
    });
    return handle;
  }

  /* The robots stand at the goal they share. */
  showMeeting() {
    if (this.main.length < 2 || this.editing) return;
    this.playing = false;
    this.state.tick = -1;
  }

  moveGoal(k, g, to) {
    const { state } = this;
    if (k) state.others = state.others.with(g - 1, this.within(to));
    else state.goals = state.goals.with(g, this.within(to));
    Object.assign(state, { own: null, announced: null });
    this.ask();
  }

  /* ---- Postures by hand ---- */

  get editing() {
    return this.state.who === "you" && this.state.tick < 0;
  }

  /* Of each goal the hand and the joints; at first only the hand. */
  get own() {
    const [{ goals, hands, start }] = this.problems;
    const { own } = this.state;
    const fits = own && own.length === goals.length && own.every((row) => row.length === 1 || row.length === start.length + 1);
    return fits ? own.map(([hand, ...q]) => [hands.includes(hand) ? hand : hands[0], ...q]) : goals.map((_, goal) => [this.alone[0].hands[goal] ?? hands[0]]);
  }

  /* The postures that the reader has placed, or otherwise those in which the robot hits the goals. */
  get postures() {
    const { start } = this.problems[0];
    return this.own.map(([hand, ...q], goal) => ({ hand, q: q.length ? q : [...(this.main[0].trial.reached[goal] || start)] }));
  }

  /* Bring a part of the robot to a position; the chosen hand stays on its goal if it can. */
  bend(part, to) {
    const [problem] = this.problems;
    const goal = this.state.edited - 1;
    const { hand, q } = this.postures[goal];
    const joints = (arm, from, end) => Array.from({ length: Math.max(0, end - from) }, (_, k) => arm.first + from + k);
    const mine = problem.arms[hand];
    const free = problem.free.flatMap((each, axis) => (each ? [axis] : []));
    /* Use the joints beyond the part that was moved, or otherwise all joints. */
    const settle = (from) => [joints(mine, from, mine.links.length), [...free, ...joints(mine, 0, mine.links.length)]].some((some) => {
      const posture = [...q];
      return bring_within(problem, posture, problem.goals[goal], hand, some, 0.9 * problem.radius) && Object.assign(q, posture);
    });
    if (part === "base") {
      if (free.every((axis) => Math.round(1e4 * to[axis]) === Math.round(1e4 * q[axis]))) return; // moved along a locked axis
      free.forEach((axis) => { q[axis] = to[axis]; });
      settle(0);
    } else {
      const [moved, k] = part;
      bring_within(problem, q, to, moved, joints(problem.arms[moved], 0, k), 0.01 * this.unit, k);
      if (moved === hand) settle(k);
    }
    this.state.own = this.own.with(goal, [hand, ...q.map((value) => Math.round(1e4 * value) / 1e4)]);
    this.showControls();
    this.answer();
  }

  /* ---- Controls ---- */

  listen() {
    const on = (name, kind, act) => this.find(name).addEventListener(kind, act);
    const change = (name, value) => {
      Object.assign(this.state, { [name]: value, announced: null });
      if (this.state.who === "you") [this.state.tick, this.playing] = [-1, false];
      this.ask();
      this.keep();
    };
    /* Begin a preset. */
    const choose = (preset) => {
      const { who, mate, reward, drift, open } = this.state;
      const live = Object.hasOwn(NAMES, who) ? who : this.first.who;
      this.restore(written({ ...this.first, preset, who: live, mate, reward, drift, open }, this.first));
      this.keep();
    };
    on("preset", "change", (event) => choose(Number(event.target.value)));
    on("reset", "click", () => {
      this.state.drift = this.first.drift;
      choose(this.state.preset);
    });
    on("more", "toggle", (event) => {
      this.state.open = Number(event.target.open);
      this.refresh();
      this.keep();
    });
    on("who", "change", (event) => {
      const { state } = this;
      if (event.target.value === "you") state.mate = state.who;
      change("who", event.target.value);
    });
    on("stored", "change", (event) => { if (event.target.value) change("who", event.target.value); });
    ["reward", "explores"].forEach((name) => on(name, "change", (event) => change(name, event.target.value)));
    on("drift", "input", (event) => change("drift", DRIFTS[event.target.value]));
    ["ahead", "edited"].forEach((name) => on(name, "change", (event) => change(name, Number(event.target.value))));
    on("two", "change", (event) => {
      const [first, ...rest] = this.state.goals;
      const mirrored = (list, [x, y]) => [...list, this.spot(list, [x, 2 * first[1] - y])];
      change("others", event.target.checked ? rest.reduce(mirrored, [first]).slice(1) : null);
    });
    const count = (by) => {
      const { state } = this;
      const grown = (list) => (by < 0 ? list.slice(0, -1) : [...list, this.spot(list)]);
      state.goals = grown(state.goals);
      if (state.others) state.others = state.goals.length > 1 ? grown([state.goals[0], ...state.others]).slice(1) : null;
      Object.assign(state, { own: null, edited: 1 });
      change("goals", state.goals);
    };
    on("announced", "click", () => {
      const { moved, state } = this;
      const [from, to] = state.goals.slice(moved - 1);
      const path = [to[0] - from[0], to[1] - from[1]];
      const length = Math.hypot(...path) / this.unit || 1;
      Object.assign(state, { goals: state.goals.with(moved, this.within([to[0] - path[1] / length, to[1] + path[0] / length])), others: null, announced: [to], tick: -1 });
      this.playing = false;
      this.ask();
      this.keep();
    });
    on("add", "click", () => count(1));
    on("fewer", "click", () => count(-1));
    on("hand", "change", (event) => change("own", this.own.with(this.state.edited - 1, [Number(event.target.value)])));
    on("trials", "input", (event) => {
      const trials = Math.max(1, Math.round(Math.exp((Number(event.target.value) / 1000) * Math.log(TRIALS))));
      this.state.trials = trials < TRIALS ? trials : 0;
      this.showControls();
      this.showMeeting();
      this.answer();
    });
    on("play", "click", () => {
      if (!this.playing) this.play();
      else {
        [this.playing, this.paused] = [false, true];
        if (this.state.who === "you") this.state.tick = -1;
        this.refresh();
        this.keep();
      }
    });
    on("tick", "input", (event) => {
      this.playing = false;
      this.state.tick = Number(event.target.value);
      this.refresh();
    });
    ["trials", "tick"].forEach((name) => on(name, "change", () => this.keep()));
    on("png", "click", () => this.save());
    on("link", "click", () => this.copyLink());
    on("trials-csv", "click", () => this.download(new Blob([this.csv], { type: "text/csv" }), "trials.csv"));
  }

  /* A power of ten near the robot's size: 1 for arms of length 4. Positions are rounded to a hundredth of it. */
  get unit() {
    return 10 ** Math.round(Math.log10(scale_of(this.preset.task.robot)));
  }

  within(place) {
    const parts = 100 / this.unit;
    return bounded(place).map((value) => Math.round(parts * value) / parts);
  }

  /* A position for one more goal of a list: the wish, or a stride from the last goal in some direction. It is within
     reach of the robot and not too close to another goal. */
  spot(list, wish) {
    const [stride, last, before = [last[0] - 1, last[1]]] = [STRIDE * this.problems[0].scale, list.at(-1), list.at(-2)];
    const angle = Math.atan2(last[1] - before[1], last[0] - before[0]);
    const turned = [2, -2, 3, -3, 1, -1, 4, -4, 0, 5, -5, 6].map((k) => angle + (k * Math.PI) / 6);
    const goals = [...this.state.goals, ...(this.state.others || []), ...list];
    const places = [...(wish ? [wish] : []), ...turned.map((direction) => [last[0] + stride * Math.cos(direction), last[1] + stride * Math.sin(direction)])].map((to) => this.within(to));
    return places.find((place) => {
      const problem = problem_of(this.taskWith([...list, place]));
      return goals.every((goal) => Math.hypot(goal[0] - place[0], goal[1] - place[1]) >= stride / 2) && corrective_trial(problem, initial_hands(problem)).going;
    }) || places[0];
  }

  /* Show the state of a link; without goals in the link, those of the preset. */
  restore(link) {
    this.state = read(link, this.first);
    const { state } = this;
    if (!this.data.presets[state.preset]) state.preset = this.first.preset;
    const { task, others = null } = this.preset;
    const limit = Math.max(MAX_GOALS, task.goals.length);
    const places = (name) => state[name] && state[name].filter((row) => row.length === 2).slice(0, limit).map((place) => this.within(place));
    const [goals, second, announced] = ["goals", "others", "announced"].map(places);
    state.goals = goals && goals.length ? goals : task.goals;
    state.others = second ? (second.length && state.goals.length > 1 ? second : null) : others;
    state.announced = announced && announced.length ? announced : null;
    state.own = state.own && state.own.map(bounded);
    if (!(state.trials >= 1 && state.trials < TRIALS)) state.trials = 0;
    if (!DRIFTS.includes(state.drift)) state.drift = 0;
    [state.tick, state.trials] = [state.tick, state.trials].map(Math.round);
    this.find("more").open = Boolean(state.open);
    this.results.clear();
    this.your_trials = [];
    this.box = null;
    this.view = null;
    [this.playing, this.paused] = [false, false];
    this.waits = state.tick < 0 && state.who !== "you";
    this.paced = this.waits && !state.trials && !this.calm.matches && state.who === "learner" ? FIRST_SEEN : Infinity;
    this.ask();
  }

  /* Controls show the state. */
  showControls() {
    const { state, preset } = this;
    const fill = (name, options) => {
      const select = this.find(name);
      if (select.dataset.has === JSON.stringify(options)) return;
      select.dataset.has = JSON.stringify(options);
      select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
    };
    state.ahead = Math.max(0, Math.min(Math.round(state.ahead), state.goals.length - 1));
    state.edited = Math.max(1, Math.min(Math.round(state.edited), state.goals.length));
    const { who, goals, others, explores, trials, drift, ahead, edited } = state;
    const runs = preset.runs || [];
    const hasOneHand = preset.task.hands.length < 2;
    const changed = !same([goals, others], [preset.task.goals, preset.others || null]);
    fill("preset", this.data.presets.map(({ label }, k) => [k, `${label}${changed && k === state.preset ? " (changed)" : ""}`]));
    fill("stored", [["", "–"], ...runs.map(({ id, name, films }) => [id, `${name}: ${films.map(({ ticks }) => pluralize(ticks, "tick")).join(" and ")}`])]);
    fill("ahead", goals.map((_, k) => [k, this.horizon(k)]));
    fill("edited", goals.map((_, k) => [k + 1, `goal ${k + 1}`]));
    this.set("value", { preset: state.preset, stored: this.stored(who) ? who : "", ahead, edited, explores, drift: DRIFTS.indexOf(drift) });
    this.find("drift").setAttribute("aria-valuetext", `drift ${drift}`);
    this.find("python").textContent = this.python;
    ["who", "reward"].forEach((name) => this.find(name).querySelectorAll("input").forEach((input) => { input.checked = input.value === state[name]; }));
    this.find("two").checked = Boolean(others);
    this.find("announced").textContent = `Move goal ${this.moved + 1} now`;
    const [few, full] = [goals.length < 2, goals.length >= MAX_GOALS];
    this.set("disabled", { reset: !changed && !state.own && !trials && drift === this.first.drift, two: few, fewer: few, announced: few, add: full });
    this.find("goad").textContent = this.optimum ? "Can you reach the proven optimum?" : `Can you beat the ${PLANNER}?`;
    this.find("why").textContent = (few && "The only goal cannot be removed, and has no next goal.") || (full && `A task can have at most ${MAX_GOALS} goals here.`) || "";
    const other = who !== "learner";
    this.set("hidden", {
      runs: !runs.length, "for-learner": other, "for-drift": other, "for-two": other || hasOneHand,
      "for-plan": who !== "plan", "for-you": who !== "you", "by-hand": hasOneHand,
    });
  }

  /* ---- Saving: link, trials and picture ---- */

  get link() {
    const { state, preset: { task, others: second = null } } = this;
    return written({
      ...state, goals: same(state.goals, task.goals) ? null : state.goals, others: same(state.others, second) ? null : state.others || [],
      mate: state.who === "you" ? state.mate : this.first.mate, tick: state.tick < 0 ? -1 : this.tick,
    }, this.first);
  }

  keep() {
    this.data.keep(this.link);
    if (!this.state.own) this.your_trials = [];
    else if (this.editing) this.note();
  }

  /* The reader has placed a posture or chosen a hand: note one more trial. */
  note() {
    const [{ trial }] = this.main;
    const ticks = ticks_by_goal(trial);
    const hits = trial.hands.map((hand, goal) => [goal + 1, HANDS[hand], ticks[goal], ...trial.reached[goal]]);
    if (!same(this.your_trials.at(-1) || null, hits)) this.your_trials.push(hits);
  }

  /* The reader's trials with a row for each hit, in the format of `read_hits`. */
  get csv() {
    const joints = this.problems[0].arms.flatMap(({ links }, hand) => links.map((_, k) => `${HANDS[hand]}_${k + 1}`));
    const rows = this.your_trials.flatMap((hits, trial) => hits.map((hit) => ["you", trial + 1, ...hit]));
    return [["subject", "trial", "goal", "hand", "ticks", "base_x", "base_y", ...joints], ...rows].map((row) => `${row}\n`).join("");
  }

  /* Show a stored run from its beginning, when a cell of a table is clicked. */
  film(choice) {
    this.restore(written({ ...this.first, ...choice }, this.first));
    this.root.scrollIntoView({ behavior: this.calm.matches ? "auto" : "smooth" });
    this.find("play").focus({ preventScroll: true });
    this.keep();
    this.play();
  }

  async copyLink() {
    this.keep();
    const address = this.data.address(this.link);
    let note = "The link was copied to the clipboard.";
    try {
      await navigator.clipboard.writeText(address);
    } catch {
      note = `The link is ${address}`;
    }
    const file = decodeURIComponent(new URL(address).pathname.split("/").at(-1));
    if (address.startsWith("file:")) note += ` It opens only on this machine. To share it, send ${file} as well, and the part of the link from # on.`;
    this.find("note").textContent = note;
  }

  /* Save the stage at twice its size, with the postures at the shared goal and the text below. */
  save() {
    const { stage, first_inset, inset, data, colours } = this;
    const pictures = [stage, first_inset, inset];
    pictures.forEach((each) => { each.density = 2; });
    this.draw();
    const [width, stage_height] = stage.size;
    const insets = [first_inset, inset].filter(({ canvas }) => canvas.checkVisibility());
    const height = stage_height + (insets.length ? inset.size[1] : 0);
    const picture = new Picture(document.createElement("canvas"));
    const { canvas, context } = picture;
    const words = [capital(this.score_words), ...this.finding, `${[this.find("preset").selectedOptions[0].text, this.nameOf(this.state.who), this.find("progress").textContent].filter(Boolean).join(", ")}; coartic ${data.version}`];
    context.font = "28px system-ui, sans-serif";
    const lines = words.flatMap((text) => text.split(" ").reduce((all, word) => {
      const longer = all.length ? `${all.at(-1)} ${word}` : word;
      return all.length && context.measureText(longer).width < 2 * width - 48 ? all.with(-1, longer) : [...all, word];
    }, []));
    Object.assign(canvas, { width: 2 * width, height: 2 * height + 40 * lines.length + 24 });
    context.fillStyle = stage.colour("page");
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(stage.canvas, 0, 0);
    insets.forEach(({ canvas: drawn }, k) => context.drawImage(drawn, k * drawn.width, 2 * stage_height));
    lines.forEach((line, k) => picture.text(line, [24, 2 * height + 32 + 40 * k], colours.ink, "left", 28));
    pictures.forEach((each) => { each.density = 0; });
    this.draw();
    canvas.toBlob((blob) => this.download(blob, "coartic.png"));
  }

  download(blob, file) {
    const address = URL.createObjectURL(blob);
    Object.assign(document.createElement("a"), { href: address, download: file }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60000);
  }
}
