"use strict";
/* The page on which goals are moved and the robot answers. `Play` is one such figure; its data come
   from coartic/play/page.py, or from a report, which has runs of its own to show. */

const SEEDS = 5;
const TRIALS = 10000; // of a run
const PACE = 90; // ticks a second
const HOLD_S = 0.9; // at a hit
const MOST_GOALS = 6;
const FAR = 12; // length units: no goal is moved farther
const ROLES = ["first", "second"];
const NAMES = {
  alone: "one goal at a time", learner: "the learner", "cma-es": "evolution (CMA-ES)", plan: "the planner", you: "you",
};
const short = (value) => Number(value.toFixed(2)).toString();
const grouped = (count) => count.toLocaleString("en").replace(",", "\u202f");
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/* What the reader has chosen; all of it is in the link. */
const AT_FIRST = {
  preset: 0, who: "learner", reward: "whole", explores: "EC4", ahead: 1, goals: null, others: null, trials: 0, tick: 0,
  own: null, edited: 1,
};

/* As text: goals=6,0.1;6,2&trials=300. A list of others that is empty is written as well. */
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

/* A film of what one robot does: its rows, and ticks at which goals are hit. */
class Mover {
  constructor(problem, trial, role) {
    const { rows, hits } = trajectory(problem, trial);
    Object.assign(this, { problem, trial, role, rows, hits });
  }

  get last() {
    return this.rows.length - 1;
  }

  trail(hand, row) {
    this.trails = this.trails || {};
    this.trails[hand] = this.trails[hand] || this.rows.map((q) => joint_positions(this.problem, q, hand).at(-1));
    return this.trails[hand].slice(0, row + 1);
  }

  seen() {
    const step = Math.max(1, Math.floor(this.rows.length / 40));
    return this.rows.filter((_, k) => k % step === 0 || k === this.last).flatMap((q) => [
      [q[0] - 0.6, q[1] - 0.2], ...this.problem.hands.flatMap((hand) => joint_positions(this.problem, q, hand)),
    ]);
  }
}

class Play {
  constructor(root, data, saved) {
    Object.assign(this, { root, data, held: null, order: 0, busy: false, results: new Map(), playing: false });
    this.find = (name) => root.querySelector(`[data-is="${name}"]`);
    this.stage = new Picture(this.find("stage"));
    this.inset = new Picture(this.find("inset"));
    this.curve = new Picture(this.find("curve"));
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)");
    this.listen();
    this.first = { ...AT_FIRST, ...data.first };
    this.worker = new Worker(URL.createObjectURL(new Blob([data.source], { type: "text/javascript" })));
    this.worker.onmessage = ({ data: message }) => this.hear(message);
    this.fresh = new Set(); // what answers the present question
    root.classList.add("live");
    this.restore(saved);
    // Until somebody does something: it plays as soon as it is seen, or, where less motion is asked for, stands at a hit.
    this.waits = !this.state.tick && this.state.who !== "you";
    ["pointerdown", "keydown", "input"].forEach((kind) => root.addEventListener(kind, () => { this.waits = false; }, true));
    this.answer();
    new ResizeObserver(() => { this.box = null; this.refresh(); }).observe(root);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.refresh());
    new MutationObserver(() => this.refresh()).observe(document.body, { attributeFilter: ["data-theme"] }); // of the site
    new IntersectionObserver((entries) => {
      this.inSight = entries.at(-1).isIntersecting;
      if (this.inSight && this.waits && !this.calm.matches) this.play();
    }, { threshold: 0.3 }).observe(this.find("stage"));
  }

  /* ---- What is asked: tasks, and who answers ---- */

  get preset() {
    return this.data.presets[this.state.preset];
  }

  /* The tasks in view, one or two, which share the start and the first goal. */
  get tasks() {
    const { task } = this.preset;
    const { goals, others } = this.state;
    return [goals, ...(others ? [[goals[0], ...others]] : [])].map((each) => ({
      ...task, goals: each, initial_hands: task.initial_hands.length === each.length ? task.initial_hands : "best-of-all",
    }));
  }

  /* Runs of a results folder, as long as nobody has changed the task. */
  stored(who) {
    const run = (this.preset.runs || []).find(({ id }) => id === who);
    const { goals, others } = this.state;
    const kept = same(goals, this.preset.task.goals) && (!others || same(others, this.preset.others));
    return run && kept ? run : null;
  }

  get rules() {
    const { reward, explores, who } = this.state;
    if (who === "cma-es") return "cma-es";
    const two = this.problems[0].hands.length > 1;
    const rules = two ? CONDITIONS[explores] || CONDITIONS.EC4 : { ...CONDITIONS.EC1, hands: this.problems[0].hands };
    return reward === "movement" ? { ...rules, credit: "subtask" } : rules;
  }

  /* Goals, robot or method have changed: the fast answer at once, the others from the worker. After
     `told`, a goal has moved and the learner makes its next trial beside the planner. */
  ask(told = null) {
    this.told = told;
    if (!(this.state.who in NAMES || this.stored(this.state.who))) {
      this.state.who = "learner";
      this.showControls();
    }
    this.problems = this.tasks.map((task) => problem_of(task));
    this.alone = this.problems.map((problem) => corrective_trial(problem, initial_hands(problem)));
    this.stale = true;
    this.send();
    this.answer();
  }

  send() {
    if (this.busy && this.held) return;
    this.stale = false;
    this.busy = true;
    this.order += 1;
    this.fresh = new Set();
    const { who } = this.state;
    const learns = who === "learner" || who === "cma-es";
    const jobs = [];
    this.tasks.forEach((task, k) => {
      if (!this.alone[k].going) return; // a goal is out of reach
      if (learns && !this.stored(who) && !this.told) {
        const seeds = this.state.others ? SEEDS : 1;
        for (let seed = 0; seed < seeds; seed += 1) {
          jobs.push({ key: `${k} run ${seed}`, task, rules: this.rules, seed, trials: TRIALS, turn: seed && seed + 1 });
        }
      }
      if (who === "plan") jobs.push({ key: `${k} plan`, task, horizon: this.state.ahead, trials: 1 });
      else if (!this.stored(who)) jobs.push({ key: `${k} far`, task, horizon: MOST_GOALS, trials: 1, turn: 1 });
    });
    this.asked = jobs.length;
    if (!jobs.length) this.busy = false;
    this.worker.postMessage({ order: this.order, jobs });
  }

  hear({ order, reports }) {
    if (order !== this.order) return;
    this.busy = false;
    reports.forEach(({ key, made, done, snapshots, rewards }) => {
      // The answer to an earlier question stands until there is one to this.
      if (!this.fresh.has(key)) this.results.set(key, { snapshots: [], rewards: [], made: 0 });
      this.fresh.add(key);
      const result = this.results.get(key);
      result.snapshots.push(...snapshots);
      for (let k = 0; k < rewards.length; k += 1) result.rewards.push(rewards[k]);
      Object.assign(result, { made, done });
    });
    this.answer();
    if (this.stale) this.send();
  }

  /* What was learned after so many trials. */
  snapshot(key, trials = this.shown) {
    const result = this.results.get(key);
    return result ? result.snapshots.findLast((each) => each.trials <= trials) || null : null;
  }

  get shown() {
    return this.state.trials || Infinity;
  }

  /* The solution of a task, as movements; null while there is none. */
  solution(k) {
    const { who } = this.state;
    const stored = this.stored(who);
    if (stored) return stored.films[k].movements;
    if (who === "you") return this.own.map(({ hand, q }, goal) => ({ goal, hand, kind: "learned", target: q }));
    const found = who === "plan" ? this.snapshot(`${k} plan`, Infinity) : this.snapshot(`${k} run 0`);
    return who === "alone" || !found ? null : found.movements;
  }

  /* The films of the answer, made from what is known by now. */
  answer() {
    this.movers = this.problems.map((problem, k) => {
      const movements = this.solution(k);
      const fits = movements && problem.goals.every((_, goal) => movements.some((movement) => movement.goal === goal));
      const trial = fits ? execute(problem, movements.filter((m) => m.goal < problem.goals.length)) : this.alone[k];
      return new Mover(problem, trial, ROLES[k]);
    });
    const planned = this.told && this.fresh.has("0 far") && this.snapshot("0 far", Infinity);
    if (planned) {
      this.movers.push(new Mover(this.problems[0], execute(this.problems[0], planned.movements), "second"));
      this.state.tick = this.meeting;
    }
    const ghost = this.movers.length < 2 && this.state.who !== "alone";
    if (ghost) this.movers.unshift(new Mover(this.problems[0], this.alone[0], "ghost"));
    if (this.waits && this.calm.matches) this.state.tick = this.stops[0] || 0;
    this.plan = this.problems.map((_, k) => (this.stale || !this.fresh.has(`${k} far`) ? null : this.snapshot(`${k} far`, Infinity)));
    this.refresh();
  }

  /* ---- Time: both robots wait for each other at the goal they share, or that is before the moved one ---- */

  get shared() {
    return this.told ? this.told.goal - 1 : 0;
  }

  get main() {
    return this.movers.filter((mover) => mover.role !== "ghost");
  }

  get meeting() {
    return this.main.length > 1 ? Math.max(...this.main.map((mover) => mover.hits[this.shared] || 0)) : 0;
  }

  row(mover, tick) {
    if (this.main.length < 2) return Math.min(tick, mover.last);
    const hit = mover.hits[this.shared] || 0;
    return tick <= this.meeting ? Math.min(tick, hit) : Math.min(hit + tick - this.meeting, mover.last);
  }

  get last() {
    const { meeting } = this;
    return Math.max(...this.movers.map((mover) => (meeting ? mover.last - (mover.hits[this.shared] || 0) + meeting : mover.last)));
  }

  /* Ticks at which a playing film holds. */
  get stops() {
    const { meeting } = this;
    const stops = this.main.flatMap((mover) => mover.hits.map((hit) => (meeting ? hit - mover.hits[this.shared] + meeting : hit)));
    return [...new Set(stops)].sort((a, b) => a - b);
  }

  play() {
    if (this.playing) return;
    this.playing = true;
    if (this.state.tick >= this.last) this.state.tick = 0;
    let [at, before, held] = [this.state.tick, null, 0];
    const frame = (time) => {
      if (!this.playing) return;
      const seconds = before === null ? 0 : Math.min(0.1, (time - before) / 1000);
      before = time;
      if (Math.round(at) !== this.state.tick) at = this.state.tick; // moved by hand
      if (held > 0) held -= seconds;
      else if (this.inSight !== false) {
        const next = at + seconds * PACE;
        const stop = this.stops.find((each) => each > at + 0.5 && each <= next);
        at = stop === undefined ? next : stop;
        if (stop !== undefined) held = HOLD_S;
        if (at >= this.last) {
          if (!this.ending) [this.ending, held] = [true, 1.5];
          else [this.ending, at] = [false, 0];
          at = Math.min(at, this.last);
        }
        this.state.tick = Math.round(at);
        this.refresh();
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    this.refresh();
  }

  pause() {
    this.playing = false;
    this.refresh();
    this.keep();
  }

  /* ---- Pictures ---- */

  /* Draw soon, once for all that has changed. */
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
    const colours = Object.fromEntries(["first", "second", "dim", "ink", "line", "hit", "soft"].map((name) => [name, stage.colour(name)]));
    colours.ghost = colours.dim;
    this.colours = colours;
    const points = [...this.movers.flatMap((mover) => mover.seen()), ...this.problems.flatMap((problem) => problem.goals)];
    if (!this.box || !this.held) this.box = around(points, 0.9);
    if (!this.held) this.glide(); // the place under the pointer stays
    stage.begin(this.view);
    stage.grid(colours.line);
    const tick = Math.min(state.tick, this.last);
    if (!this.editing) this.movers.forEach((mover) => {
      const row = this.row(mover, tick);
      mover.problem.hands.forEach((hand) => stage.trail(mover.trail(hand, row), colours[mover.role], hand === LEFT));
    });
    this.problems.forEach((problem, k) => problem.goals.forEach((goal, g) => {
      if (k && !g) return;
      const mover = this.main[k];
      stage.goal(goal, problem.radius, {
        label: `${g + 1}`, movable: !this.editing, held: this.held && this.held.name === `${k} ${g}`,
        colour: this.problems.length > 1 && g ? colours[ROLES[k]] : colours.ink,
        hit: mover.hits[g] !== undefined && mover.hits[g] <= this.row(mover, tick),
      });
    }));
    if (this.editing) {
      this.own.forEach(({ q }, g) => stage.robot(this.problems[0], q, {
        colour: colours.first, alpha: g === this.state.edited - 1 ? 1 : 0.2, weight: g === this.state.edited - 1 ? 1 : 0.8,
      }));
    } else {
      if (this.meeting && tick > this.meeting) {
        this.main.forEach((mover) => stage.robot(mover.problem, mover.rows[mover.hits[this.shared] || 0], { colour: colours[mover.role], alpha: 0.25, weight: 0.9 }));
      }
      this.movers.forEach((mover) => {
        const row = this.row(mover, tick);
        const hit = mover.hits.filter((at) => at < row).length;
        stage.robot(mover.problem, mover.rows[row], {
          colour: colours[mover.role], chosen: mover.trial.hands[Math.min(hit, mover.trial.hands.length - 1)],
          alpha: mover.role === "ghost" ? 0.55 : 1, weight: mover.role === "ghost" ? 0.8 : 1,
        });
      });
    }
    this.place();
    this.drawInset();
    this.drawCurve();
  }

  /* The view follows the box in a few frames. */
  glide() {
    if (!this.view || this.calm.matches) this.view = this.box;
    else {
      const off = Math.max(...this.box.map((value, k) => Math.abs(value - this.view[k])));
      this.view = off < 0.02 ? this.box : this.view.map((value, k) => value + 0.25 * (this.box[k] - value));
      if (off >= 0.02) this.refresh();
    }
  }

  /* Postures in which the shared goal is hit: of each run thin, their mean thick. */
  postures() {
    if (this.main.length < 2) return null;
    const { who } = this.state;
    if (this.told) return this.main.map((mover, k) => ({ runs: [this.told.before[k]], mean: mover.trial.reached[this.shared] }));
    return this.main.map((mover, k) => {
      const stored = this.stored(who);
      const runs = stored ? [...stored.films[k].reached] : [];
      for (let seed = 0; !stored && (who === "learner" || who === "cma-es") && seed < SEEDS; seed += 1) {
        const found = this.snapshot(`${k} run ${seed}`);
        const complete = this.fresh.has(`${k} run ${seed}`) && (this.results.get(`${k} run ${seed}`).done || found.trials >= this.shown);
        if (seed && found && complete) runs.push(found.reached[0]);
        if (!seed && mover.trial.reached.length) runs.push(mover.trial.reached[0]);
      }
      if (!runs.length && mover.trial.reached.length) runs.push(mover.trial.reached[0]);
      const mean = runs.length ? runs[0].map((_, j) => runs.reduce((sum, q) => sum + q[j], 0) / runs.length) : null;
      return { runs, mean };
    });
  }

  drawInset() {
    const both = this.postures();
    const box = this.find("together");
    box.hidden = !both || !both.every(({ mean }) => mean);
    this.difference = null;
    if (box.hidden) return;
    const { inset, colours } = this;
    const [problem] = this.problems;
    const points = both.flatMap(({ runs, mean }) => [...runs, mean].flatMap((q) => problem.hands.flatMap((hand) => joint_positions(problem, q, hand))));
    inset.begin(around([...points, ...both.map(({ mean }) => [mean[0] - 0.5, mean[1] - 0.1])], 0.25));
    both.forEach(({ runs, mean }, k) => {
      runs.forEach((q) => inset.robot(problem, q, { colour: colours[ROLES[k]], alpha: 0.35, weight: 0.35, joints: false }));
      inset.robot(problem, mean, { colour: colours[ROLES[k]], weight: 1 });
    });
    inset.goal(problem.goals[this.shared], problem.radius, { label: `${this.shared + 1}`, colour: colours.ink, hit: true });
    const distance = apart(both[0].mean, both[1].mean);
    const [n, m] = both.map(({ runs }) => runs.length);
    const squares = both.reduce((sum, { runs, mean }) => sum + runs.reduce((part, q) => part + apart(q, mean) ** 2, 0), 0);
    const spread = n > 1 && m > 1 ? Math.sqrt(squares / (n + m - 2)) : 0;
    this.difference = { distance, n, m, spreads: spread ? distance / spread : null, chance: Math.sqrt(1 / n + 1 / m) };
  }

  /* Ticks needed against trials, on a logarithmic scale: what was learned, and the range of what was tried. */
  drawCurve() {
    const { curve, colours } = this;
    const learns = ["learner", "cma-es"].includes(this.state.who) && !this.stored(this.state.who) && !this.told;
    this.find("learning").hidden = !learns;
    if (!learns) return;
    const runs = this.problems.map((_, k) => this.results.get(`${k} run 0`)).filter(Boolean);
    const known = [...this.alone.map((trial) => -trial.reward), ...this.plan.map((plan) => plan && -plan.reward)].filter(Number.isFinite);
    const learned = runs.flatMap(({ snapshots }) => snapshots.map(({ reward }) => -reward));
    const all = [...known, ...learned].filter(Number.isFinite);
    if (!all.length) return;
    let [low, high] = [Math.min(...all), Math.max(...all)];
    [low, high] = [low - 0.12 * (high - low) - 2, high + 0.25 * (high - low) + 4];
    curve.begin([0, 0, 1, 1]);
    const { context, size: [width, height] } = curve;
    const [left, right, top, bottom] = [40, width - 10, 8, height - 22];
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
    context.save();
    context.beginPath();
    context.rect(left, top, right - left, bottom - top);
    context.clip();
    this.problems.forEach((_, k) => {
      const colour = colours[ROLES[k]];
      const run = this.results.get(`${k} run 0`);
      context.strokeStyle = colour;
      const level = (ticks, dash) => {
        if (!Number.isFinite(ticks)) return;
        context.setLineDash(dash);
        context.lineWidth = 1.2;
        context.beginPath();
        context.moveTo(left, y(ticks));
        context.lineTo(right, y(ticks));
        context.stroke();
        context.setLineDash([]);
      };
      level(-this.alone[k].reward, [2, 4]);
      if (this.plan[k]) level(-this.plan[k].reward, [8, 4]);
      if (!run) return;
      // Each column of the picture has the range of its trials.
      context.globalAlpha = 0.15;
      let [column, least, most] = [-1, Infinity, -Infinity];
      run.rewards.forEach((reward, trial) => {
        const now = Math.floor(x(trial + 1));
        if (now !== column) {
          if (most > -Infinity) context.fillRect(column, y(most), 1.2, Math.max(1, y(least) - y(most)));
          [column, least, most] = [now, Infinity, -Infinity];
          context.fillStyle = colour;
        }
        if (Number.isFinite(reward)) [least, most] = [Math.min(least, -reward), Math.max(most, -reward)];
      });
      context.globalAlpha = 1;
      context.lineWidth = 2.5;
      context.beginPath();
      run.snapshots.forEach(({ trials, reward }, i) => {
        if (i) context.lineTo(x(trials), y(-run.snapshots[i - 1].reward));
        context[i ? "lineTo" : "moveTo"](x(trials), y(-reward));
      });
      context.stroke();
    });
    const at = Math.min(this.shown, Math.max(1, ...runs.map(({ made }) => made)));
    context.fillStyle = colours.ink;
    context.fillRect(x(at) - 0.75, top, 1.5, bottom - top);
    context.restore();
  }

  /* ---- Words ---- */

  say() {
    const { state, main } = this;
    const ticks = (trial) => (trial.going ? `${-trial.reward}` : "–");
    const words = (parts) => parts.filter(Boolean).join(" ");
    const run = this.results.get("0 run 0");
    const learns = ["learner", "cma-es"].includes(state.who) && !this.stored(state.who);
    const at = Math.min(this.shown, run ? run.made : 0);
    const missed = main.findIndex((mover) => !mover.trial.going);
    this.find("score").replaceChildren();
    const score = (role, name, value) => {
      const line = document.createElement("span");
      line.className = role;
      line.textContent = `${name} `;
      const figure = document.createElement("strong");
      figure.textContent = `${value} ticks`;
      line.append(figure);
      this.find("score").append(line);
    };
    const name = this.stored(state.who) ? this.stored(state.who).name : NAMES[state.who];
    const pair = this.told ? ["The learner's next trial", "The planner"] : ["Blue", "Orange"];
    if (main.length > 1) main.forEach((mover, k) => score(mover.role, pair[k], ticks(mover.trial)));
    else {
      score("first", name[0].toUpperCase() + name.slice(1), ticks(main[0].trial));
      if (state.who !== "alone") score("ghost", "One goal at a time", ticks(this.alone[0]));
      if (this.plan[0] && state.who !== "plan") score("plan", "Planner that sees all goals", ticks({ going: Number.isFinite(this.plan[0].reward), ...this.plan[0] }));
    }
    let finding = "";
    if (missed >= 0) finding = `Goal ${main[missed].trial.reached.length + 1} is out of the robot's reach.`;
    else if (this.told) {
      const [learner, planner] = main.map((mover, k) => short(apart(mover.trial.reached[this.shared], this.told.before[k])));
      finding = `Goal ${this.told.goal + 1} has moved. At goal ${this.told.goal} the learner's posture has shifted by ${learner}, the planner's by ${planner || "…"}.`;
    } else if (main.length < 2 && state.who !== "alone") {
      const saved = main[0].trial.reward - this.alone[0].reward;
      finding = `${Math.abs(saved)} tick${Math.abs(saved) === 1 ? "" : "s"} ${saved < 0 ? "more" : "fewer"} than one goal at a time.`;
      if (state.who === "you" && this.plan[0] && main[0].trial.reward >= this.plan[0].reward) finding = "You are as fast as the planner!";
    } else if (main.length > 1 && main[0].trial.hands[0] !== main[1].trial.hands[0]) {
      finding = "They hit goal 1 with different hands.";
    } else if (this.difference) {
      const { spreads, distance, n, m, chance } = this.difference;
      if (spreads === null) {
        finding = distance < 0.005 ? "At goal 1 the two robots stand alike." : `At goal 1 their postures lie ${short(distance)} apart.`;
      } else {
        finding = `At goal 1 their postures lie ${spreads.toFixed(1)} standard deviations apart (${Math.min(n, m)} runs each; by chance: about ${chance.toFixed(1)}).`;
      }
    }
    this.find("finding").textContent = finding;
    const progress = learns ? `${grouped(at)} trials` : "";
    this.find("progress").textContent = progress;
    if (state.who === "you") this.find("hand").value = this.own[state.edited - 1].hand;
    this.find("told").disabled = !this.moved || !this.snapshot("0 run 0") || !this.snapshot("0 far", Infinity);
    const slider = this.find("trials");
    slider.value = at ? (1000 * Math.log(at)) / Math.log(TRIALS) : 0;
    slider.setAttribute("aria-valuetext", progress);
    const tick = this.find("tick");
    tick.max = this.last;
    tick.value = state.tick;
    tick.setAttribute("aria-valuetext", `tick ${state.tick + 1} of ${this.last + 1}`);
    this.find("count").textContent = `${state.tick + 1} of ${this.last + 1} ticks`;
    this.find("play").textContent = this.playing ? "Pause" : "Play";
    this.find("stage").setAttribute("aria-label", words([
      `${main.length > 1 ? "Two robots" : "A robot"} and ${this.problems[0].goals.length} goals; ${name}.`, finding,
    ]));
    const open = this.busy || this.stale || [...this.fresh].some((key) => !this.results.get(key).done) || this.fresh.size < this.asked;
    this.root.toggleAttribute("data-settled", !open);
    const spoken = words([...this.find("score").children].map((line) => `${line.textContent};`).concat(finding));
    if (!this.playing && !open && !this.held && spoken !== this.spoken) {
      this.find("status").textContent = spoken;
      this.spoken = spoken;
    }
  }

  /* ---- Handles ---- */

  /* Buttons lie over what can be dragged: by pointer, finger or arrow keys. */
  place() {
    const wanted = new Map();
    if (this.editing) {
      const { q } = this.own[this.state.edited - 1];
      wanted.set("base", { at: [q[0], q[1]], label: "Base", move: (to) => this.bend("base", to) });
      this.problems[0].hands.forEach((hand) => {
        const chosen = hand === this.own[this.state.edited - 1].hand;
        joint_positions(this.problems[0], q, hand).forEach((at, k, all) => {
          if (k && !(chosen && k === all.length - 1)) {
            wanted.set(`${hand} ${k}`, { at, label: `${HANDS[hand]} arm, ${k === all.length - 1 ? "hand" : `elbow ${k}`}`, move: (to) => this.bend([hand, k], to) });
          }
        });
      });
    } else {
      this.problems.forEach((problem, k) => problem.goals.forEach((goal, g) => {
        if (k && !g) return;
        const whose = this.problems.length > 1 && g ? (k ? " of orange" : " of blue") : "";
        wanted.set(`${k} ${g}`, { at: goal, label: `Goal ${g + 1}${whose}`, move: (to) => this.moveGoal(k, g, to) });
      }));
    }
    const layer = this.find("handles");
    this.handles = this.handles || new Map();
    this.handles.forEach((handle, name) => {
      if (!wanted.has(name)) {
        handle.remove();
        this.handles.delete(name);
      }
    });
    wanted.forEach(({ at, label, move }, name) => {
      let handle = this.handles.get(name);
      if (!handle) {
        handle = document.createElement("button");
        handle.type = "button";
        handle.className = "handle";
        this.drags(handle, name);
        layer.append(handle);
        this.handles.set(name, handle);
      }
      const [x, y] = this.stage.toScreen(at);
      handle.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      handle.classList.toggle("joint", this.editing);
      handle.setAttribute("aria-label", `${label}, at ${short(at[0])}, ${short(at[1])}. Arrow keys move it.`);
      Object.assign(handle, { at, move });
    });
  }

  drags(handle, name) {
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
      const by = event.shiftKey ? 0.02 : 0.1;
      this.showMeeting();
      handle.at = [handle.at[0] + by * way[0], handle.at[1] + by * way[1]];
      handle.move(handle.at);
      this.keep();
    });
  }

  /* While a goal moves, the robots stand at the goal they share. */
  showMeeting() {
    if (this.main.length > 1 && !this.editing) {
      this.playing = false;
      this.state.tick = this.meeting;
    }
  }

  moveGoal(k, g, [x, y]) {
    const place = [x, y].map((value) => Math.round(100 * Math.max(-FAR, Math.min(FAR, value))) / 100);
    if (k) this.state.others = this.state.others.map((goal, i) => (i === g - 1 ? place : goal));
    else this.state.goals = this.state.goals.map((goal, i) => (i === g ? place : goal));
    this.state.own = null;
    this.ask();
    if (this.main.length > 1) this.state.tick = this.meeting;
  }

  /* ---- Postures by hand ---- */

  /* The goal that the button moves, from 0: the third, or the last of fewer. */
  get moved() {
    return Math.min(2, this.state.goals.length - 1);
  }

  get editing() {
    return this.state.who === "you" && !this.playing && !this.watching;
  }

  /* One posture for each goal; at first those of one goal at a time. */
  get own() {
    const [trial] = this.alone;
    const { own } = this.state;
    const [problem] = this.problems;
    const fits = own && own.length === problem.goals.length && own.every((row) => row.length === problem.dof + 1);
    if (fits) return own.map(([hand, ...q]) => ({ hand: problem.hands.includes(hand) ? hand : problem.hands[0], q: Float64Array.from(q) }));
    return problem.goals.map((_, goal) => ({ hand: trial.hands[goal] || problem.hands[0], q: trial.reached[goal] || problem.start }));
  }

  /* Bring a part of the robot to a place; the hand at work stays on its goal if it can. */
  bend(part, to) {
    const [problem] = this.problems;
    const goal = this.state.edited - 1;
    const own = this.own.map((each) => ({ ...each, q: Float64Array.from(each.q) }));
    const { hand, q } = own[goal];
    const joints = (arm, from, end) => Array.from({ length: Math.max(0, end - from) }, (_, k) => arm.first + from + k);
    const mine = problem.arms[hand];
    const free = problem.free.flatMap((each, axis) => (each ? [axis] : []));
    /* By the joints beyond the part that was moved, or else by all. */
    const settle = (from) => [joints(mine, from, mine.links.length), [...free, ...joints(mine, 0, mine.links.length)]].some((some) => {
      const kept = Float64Array.from(q);
      const holds = project(problem, q, problem.goals[goal], hand, some, 0.9 * problem.radius);
      if (!holds) q.set(kept);
      return holds;
    });
    if (part === "base") {
      free.forEach((axis) => { q[axis] = to[axis]; });
      settle(0);
    } else {
      const [moved, k] = part;
      project(problem, q, to, moved, joints(problem.arms[moved], 0, k), 0.01, k);
      if (moved === hand) settle(k);
    }
    this.state.own = own.map((each) => [each.hand, ...Array.from(each.q, (value) => Math.round(1e4 * value) / 1e4)]);
    this.answer();
  }

  /* ---- Controls ---- */

  listen() {
    const on = (name, kind, act) => this.find(name).addEventListener(kind, act);
    const change = (name, value) => {
      this.state[name] = value;
      this.showControls();
      this.ask();
      this.keep();
    };
    on("preset", "change", (event) => {
      const { who, reward } = this.state;
      const live = who in NAMES ? who : this.first.who;
      this.restore(written({ ...this.first, preset: Number(event.target.value), who: live, reward }, this.first));
      this.keep();
    });
    on("who", "change", (event) => {
      this.playing = this.playing && event.target.value !== "you";
      this.watching = false;
      if (event.target.value === "you") this.state.others = null;
      change("who", event.target.value);
    });
    on("stored", "change", (event) => { if (event.target.value) change("who", event.target.value); });
    on("reward", "change", (event) => change("reward", event.target.value));
    on("explores", "change", (event) => change("explores", event.target.value));
    on("ahead", "change", (event) => change("ahead", Number(event.target.value)));
    on("two", "change", (event) => {
      const [first, ...rest] = this.state.goals;
      if (event.target.checked && this.state.who === "you") this.state.who = "learner";
      change("others", event.target.checked ? rest.map(([x, y]) => [x, Math.round(100 * (2 * first[1] - y)) / 100]) : null);
    });
    const count = (by) => {
      const { goals, others } = this.state;
      const grown = (list) => {
        if (by < 0) return list.slice(0, -1);
        const [a, b] = [list.at(-2) || goals[0], list.at(-1) || goals[0]];
        const next = [b[0] + 0.6 * (b[0] - a[0]) + (a === b ? 0.8 : 0.2), b[1] + 0.6 * (b[1] - a[1]) + (a === b ? 0.8 : 0)];
        return [...list, next.map((value) => Math.round(10 * value) / 10)];
      };
      if (others) this.state.others = grown(others);
      this.state.own = null;
      this.state.edited = 1;
      change("goals", grown(goals));
    };
    on("told", "click", () => {
      const goal = this.moved;
      const [learned, plan] = ["0 run 0", "0 far"].map((key) => this.snapshot(key, Infinity));
      const [from, to] = [this.state.goals[goal - 1], this.state.goals[goal]];
      const way = [to[0] - from[0], to[1] - from[1]];
      const length = Math.hypot(...way) || 1;
      this.state.others = null;
      this.state.goals = this.state.goals.with(goal, [to[0] - way[1] / length, to[1] + way[0] / length].map((value) => Math.round(100 * value) / 100));
      this.showControls();
      this.ask({ goal, before: [learned, plan].map(({ reached }) => reached[goal - 1]) });
      this.keep();
    });
    on("more", "click", () => count(1));
    on("fewer", "click", () => count(-1));
    on("posture", "change", (event) => change("edited", Number(event.target.value)));
    on("hand", "change", (event) => {
      this.state.own = this.own.map(({ hand, q }, goal) => [goal === this.state.edited - 1 ? Number(event.target.value) : hand, ...q]);
      this.bend("base", this.own[this.state.edited - 1].q);
      this.keep();
    });
    on("trials", "input", (event) => {
      const trials = Math.max(1, Math.round(Math.exp((Number(event.target.value) / 1000) * Math.log(TRIALS))));
      this.state.trials = trials < TRIALS ? trials : 0;
      this.showMeeting();
      this.answer();
    });
    on("trials", "change", () => this.keep());
    on("play", "click", () => {
      this.watching = this.state.who === "you";
      if (this.playing) {
        this.watching = false;
        this.pause();
      } else this.play();
    });
    on("tick", "input", (event) => {
      this.watching = true;
      this.playing = false;
      this.state.tick = Number(event.target.value);
      this.refresh();
    });
    on("tick", "change", () => this.keep());
    on("png", "click", () => this.save(this.find("stage"), "coartic.png"));
    on("record", "click", () => (this.recorder ? this.recorder.stop() : this.record()));
    this.find("record").hidden = !(window.MediaRecorder && this.find("stage").captureStream);
    on("link", "click", () => this.copyLink());
    // A finger that drags a goal does not scroll the page.
    this.find("handles").addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
  }

  /* Show what a link holds, with the goals of the preset where it has none. */
  restore(link) {
    this.state = read(link, this.first);
    if (!this.data.presets[this.state.preset]) this.state.preset = this.first.preset;
    const { task, others } = this.preset;
    const { state } = this;
    if (!state.goals || !state.goals.length) state.goals = task.goals;
    if (!state.others) state.others = others || null;
    else if (!state.others.length) state.others = null;
    this.results.clear();
    this.box = null;
    this.view = null;
    this.showControls();
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
    const hands = preset.task.hands.length;
    fill("preset", this.data.presets.map(({ label }, k) => [k, label]));
    this.find("preset").value = state.preset;
    const runs = preset.runs || [];
    fill("stored", [["", "–"], ...runs.map(({ id, name, films }) => [id, `${name}: ${films.map(({ ticks }) => ticks).join(" and ")} ticks`])]);
    this.find("stored").value = this.stored(state.who) ? state.who : "";
    this.find("runs").hidden = !runs.length;
    this.root.querySelectorAll('[data-is="who"] input').forEach((input) => { input.checked = input.value === state.who; });
    this.root.querySelectorAll('[data-is="reward"] input').forEach((input) => { input.checked = input.value === state.reward; });
    fill("ahead", state.goals.map((_, k) => [k, k ? `${k} goal${k > 1 ? "s" : ""} ahead` : "no goal ahead"]));
    state.ahead = Math.min(state.ahead, state.goals.length - 1);
    this.find("ahead").value = state.ahead;
    this.find("explores").value = state.explores;
    this.find("two").checked = Boolean(state.others);
    this.find("two").disabled = state.goals.length < 2;
    this.find("told").textContent = `Move goal ${this.moved + 1} now`;
    this.find("more").disabled = state.goals.length >= MOST_GOALS;
    this.find("fewer").disabled = state.goals.length < 2;
    this.find("for-learner").hidden = state.who !== "learner";
    this.find("for-two").hidden = state.who !== "learner" || hands < 2;
    this.find("for-plan").hidden = state.who !== "plan";
    this.find("for-you").hidden = state.who !== "you";
    fill("posture", state.goals.map((_, k) => [k + 1, `goal ${k + 1}`]));
    state.edited = Math.min(state.edited, state.goals.length);
    this.find("posture").value = state.edited;
    this.find("by-hand").hidden = hands < 2;
  }

  /* ---- To keep: link, picture, recording ---- */

  get link() {
    const { goals, others } = this.state;
    const { task, others: second = null } = this.preset;
    return written({
      ...this.state, goals: same(goals, task.goals) ? null : goals, others: same(others, second) ? null : others || [],
    }, this.first);
  }

  keep() {
    this.data.keep(this.link);
  }

  /* Show a stored run from its beginning, as a cell of a table asks for it. */
  film(choice) {
    this.restore(written({ ...this.first, ...choice }, this.first));
    this.root.scrollIntoView({ behavior: this.calm.matches ? "auto" : "smooth" });
    this.find("play").focus({ preventScroll: true });
    this.keep();
    this.play();
  }

  note(words) {
    this.find("note").textContent = words;
  }

  async copyLink() {
    this.keep();
    const address = this.data.address(this.link);
    try {
      await navigator.clipboard.writeText(address);
      this.note("The link is in the clipboard.");
    } catch {
      this.note(`The link is ${address}`);
    }
  }

  save(what, name) {
    const give = (blob) => {
      const address = URL.createObjectURL(blob);
      const anchor = document.createElement("a");
      Object.assign(anchor, { href: address, download: name });
      anchor.click();
      setTimeout(() => URL.revokeObjectURL(address), 60000);
    };
    if (what instanceof Blob) give(what);
    else what.toBlob(give);
  }

  /* What the stage shows, as the browser records it. */
  record() {
    const parts = [];
    const recorder = new MediaRecorder(this.find("stage").captureStream());
    recorder.ondataavailable = ({ data }) => parts.push(data);
    recorder.onstop = () => {
      this.recorder = null;
      this.find("record").textContent = "Record";
      this.save(new Blob(parts, { type: recorder.mimeType }), `coartic.${recorder.mimeType.split(/[/;]/)[1]}`);
      this.note("The recording is saved.");
    };
    let begun = false;
    recorder.onstart = () => {
      begun = true;
      this.find("record").textContent = "Stop and save";
      this.note("Recording the picture.");
    };
    // A recorder begins with a picture that is drawn, on a busy machine a second and many pictures later.
    const draw = () => {
      this.draw();
      if (!begun) requestAnimationFrame(draw);
    };
    this.recorder = recorder;
    recorder.start();
    draw();
  }
}
