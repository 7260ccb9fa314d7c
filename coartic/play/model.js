"use strict";
/* coartic's model for browsers and Node.

   A comment before a function names the module of its counterpart in the Python package. Both do the same operations in
   the same order, so that numbers are equal bit by bit (normal random numbers are equal to 5e-15). The planner, a local
   search, has no such counterpart. A configuration is an array: x and y of the base, the joints of the left arm, the
   joints of the right arm. Hands are 0 (left) and 1 (right), goals are counted from 0. */

const HANDS = ["left", "right"];
const [LEFT, RIGHT, NO_HAND] = [0, 1, 2];
const BASE_DOF = 2;
const MAX_LINKS = 100;
const MAX_SEQUENCES = 4096; // largest number of hand sequences that are all tried

/* coartic/motion/kernels/slots.py; `task` is a task of the package as plain data. The model is the default of coartic/model.py. */
function problem_of(task) {
  const { robot, goals, radius, start: { base, left, right } } = task;
  const model = { step: 0.01, arrival_tolerance: radius / 10, gain: 0.05, correction_tolerance: radius / 10, max_iterations: 20000 };
  const arm = (first, links, [shoulder_x, shoulder_y]) => ({ first, links, shoulder_x, shoulder_y });
  return {
    task, robot, goals, radius, model, scale: scale_of(robot), start: [...base, ...left, ...right],
    hands: task.hands.map((hand) => HANDS.indexOf(hand)).sort(),
    arms: [
      arm(BASE_DOF, robot.left_links, robot.left_shoulder),
      arm(BASE_DOF + robot.left_links.length, robot.right_links, robot.right_shoulder),
    ],
    free: ["x", "y"].map((axis) => !task.locked_base.includes(axis)),
  };
}

/* coartic/robot.py */
function scale_of({ left_links, right_links }) {
  return Math.min(...[left_links, right_links].map((links) => links.reduce((sum, length) => sum + length))) / 4;
}

/* For each coordinate whether it moves if these hands move: the base and their arms. */
function movable({ start, free, arms }, hands) {
  return start.map((_, j) => (j < BASE_DOF ? free[j] : hands.includes(j < arms[RIGHT].first ? LEFT : RIGHT)));
}

/* ---- Kinematics ---- */

/* coartic/motion/kernels/trigonometry.py */
const MAX_ANGLE = 1e5;
const [HIGH, MIDDLE, LOW] = [1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21];
const PER_QUARTER = 2 / Math.PI;
const factorial = (n) => (n < 2 ? 1 : n * factorial(n - 1));
const [S3, S5, S7, S9, S11, S13, S15, S17] = [3, 5, 7, 9, 11, 13, 15, 17].map((n) => ((n - 1) % 4 ? -1 : 1) / factorial(n));
const [C4, C6, C8, C10, C12, C14, C16] = [4, 6, 8, 10, 12, 14, 16].map((n) => (n % 4 ? -1 : 1) / factorial(n));
const TO_WHOLE = 6755399441055744; // 1.5 * 2**52: adding and subtracting it rounds to an integer, halves to even

/* coartic/robot.py: fill xs, ys with shoulder, joints and hand. */
function chain(q, arm, xs, ys) {
  const { first, links } = arm;
  let x = q[0] + arm.shoulder_x;
  let y = q[1] + arm.shoulder_y;
  let angle = 0;
  xs[0] = x;
  ys[0] = y;
  for (let k = 0; k < links.length; k += 1) {
    angle += q[first + k];
    let cosine;
    let sine;
    if (Math.abs(angle) < MAX_ANGLE) {
      const quarters = (angle * PER_QUARTER + TO_WHOLE) - TO_WHOLE;
      const r = ((angle - quarters * HIGH) - quarters * MIDDLE) - quarters * LOW;
      const z = r * r;
      const z2 = z * z;
      const z4 = z2 * z2;
      let odd = (S3 + z * S5) + z2 * (S7 + z * S9);
      odd += z4 * ((S11 + z * S13) + z2 * (S15 + z * S17));
      let even = (C4 + z * C6) + z2 * (C8 + z * C10);
      even += z4 * ((C12 + z * C14) + z2 * C16);
      const s = r + (r * z) * odd;
      const c = 1 - (0.5 * z - z2 * even);
      const quarter = quarters & 3;
      cosine = quarter & 1 ? s : c;
      sine = quarter & 1 ? c : s;
      if ((quarter + 1) & 2) cosine = -cosine;
      if (quarter & 2) sine = -sine;
    } else {
      cosine = Math.cos(angle);
      sine = Math.sin(angle);
    }
    x += links[k] * cosine;
    y += links[k] * sine;
    xs[k + 1] = x;
    ys[k + 1] = y;
  }
}

const xs = new Float64Array(MAX_LINKS + 1);
const ys = new Float64Array(MAX_LINKS + 1);

/* coartic/robot.py: positions of shoulder, joints and hand. */
function joint_positions(problem, q, hand) {
  const arm = problem.arms[hand];
  chain(q, arm, xs, ys);
  return Array.from({ length: arm.links.length + 1 }, (_, k) => [xs[k], ys[k]]);
}

/* coartic/robot.py: derivatives of a point of an arm, its hand or an elbow, by joints: a row for each. Fills xs, ys. */
function jacobian(problem, q, hand, joints, tip = problem.arms[hand].links.length) {
  const arm = problem.arms[hand];
  chain(q, arm, xs, ys);
  return joints.map((j) => {
    if (j < BASE_DOF) return j ? [0, 1] : [1, 0];
    const k = j - arm.first;
    return k >= 0 && k < tip ? [-(ys[tip] - ys[k]), xs[tip] - xs[k]] : [0, 0];
  });
}

/* coartic/learner/kernel.py */
function distance_to_goal(problem, q, number, hand) {
  const arm = problem.arms[hand];
  chain(q, arm, xs, ys);
  const dx = problem.goals[number][0] - xs[arm.links.length];
  const dy = problem.goals[number][1] - ys[arm.links.length];
  return Math.sqrt(dx * dx + dy * dy);
}

/* ---- Movement ---- */

const CLEARANCE = 1e-9; // for rounding
const between = [];

/* coartic/motion/kernels/move.py: move, changing `q` itself; return the ticks, negative for a miss. The hand moves by at
   most `speed` per step; steps at which it is certainly outside both discs are skipped. */
function move(problem, q, target, number, hand, stop_on_arrival) {
  const { model, radius } = problem;
  const [goal_x, goal_y] = problem.goals[number];
  const arm = problem.arms[hand];
  const { first, links } = arm;
  const tip = links.length;
  const dof = q.length;
  let square = 0;
  for (let j = 0; j < dof; j += 1) {
    const delta = target[j] - q[j];
    square += delta * delta;
  }
  const distance = Math.sqrt(square);
  const last = Math.ceil(distance / model.step);
  let [turned, path] = [0, Math.hypot(target[0] - q[0], target[1] - q[1])];
  for (let k = 0; k < tip; k += 1) {
    turned += target[first + k] - q[first + k];
    path += links[k] * Math.abs(turned);
  }
  const speed = (path * model.step) / distance;
  let [end_x, end_y] = [0, 0];
  if (stop_on_arrival) {
    chain(target, arm, xs, ys);
    end_x = xs[tip];
    end_y = ys[tip];
  }
  let step = 0;
  for (;;) {
    const fraction = step === last ? 0 : step * model.step / distance;
    const here = step === last ? target : between;
    if (here === between) {
      for (let j = 0; j < BASE_DOF; j += 1) between[j] = q[j] + fraction * (target[j] - q[j]);
      for (let j = first; j < first + tip; j += 1) between[j] = q[j] + fraction * (target[j] - q[j]);
    }
    chain(here, arm, xs, ys);
    const to_goal = Math.sqrt((goal_x - xs[tip]) ** 2 + (goal_y - ys[tip]) ** 2);
    let clear = to_goal - radius;
    let stop = step === last;
    if (stop_on_arrival) {
      const to_end = Math.sqrt((end_x - xs[tip]) ** 2 + (end_y - ys[tip]) ** 2);
      if (to_end <= model.arrival_tolerance) stop = true;
      clear = Math.min(clear, to_end - model.arrival_tolerance);
    }
    const hit = to_goal <= radius;
    if (stop || hit) {
      for (let j = 0; j < dof; j += 1) q[j] = step === last ? target[j] : q[j] + fraction * (target[j] - q[j]);
      return hit ? step + 1 : -(step + 1);
    }
    step = Math.min(step + 1 + Math.floor(Math.max(0, Math.min(last, (clear - CLEARANCE) / speed))), last);
  }
}

/* coartic/motion/kernels/correct.py: correct, changing `q` itself; return whether **A** converges. */
function correct(problem, q, number, hand) {
  const { model } = problem;
  const [free_x, free_y] = problem.free;
  const [goal_x, goal_y] = problem.goals[number];
  const arm = problem.arms[hand];
  const tip = arm.links.length;
  for (let iteration = 0; ; iteration += 1) {
    chain(q, arm, xs, ys);
    const error_x = goal_x - xs[tip];
    const error_y = goal_y - ys[tip];
    const error = error_x * error_x + error_y * error_y;
    if (Math.sqrt(error) <= model.correction_tolerance) return true;
    if (iteration >= model.max_iterations || !(error < Infinity)) return false;
    const x = q[0];
    const y = q[1];
    if (free_x) q[0] += model.gain * error_x;
    if (free_y) q[1] += model.gain * error_y;
    let moved = q[0] !== x || q[1] !== y;
    for (let k = 0, j = arm.first; k < tip; k += 1, j += 1) {
      const before = q[j];
      q[j] = before + model.gain * (-(ys[tip] - ys[k]) * error_x + (xs[tip] - xs[k]) * error_y);
      if (q[j] !== before) moved = true;
    }
    if (!moved) return false; // a stationary point
  }
}

const RANK = 1e-12; // squared ratio of singular values up to which the smaller one counts as 0

/* coartic/motion/kernels/correct.py: project joint changes, in place, onto the null space of a Jacobian, a row for each joint. */
function project(v, rows) {
  let [a, b, c, along_x, along_y] = [0, 0, 0, 0, 0];
  rows.forEach(([x, y], i) => {
    [a, b, c] = [a + x * x, b + x * y, c + y * y];
    [along_x, along_y] = [along_x + x * v[i], along_y + y * v[i]];
  });
  const larger = 0.5 * (a + c) + Math.sqrt(0.25 * (a - c) * (a - c) + b * b);
  const determinant = a * c - b * b;
  let [back_x, back_y] = [0, 0];
  if (determinant > RANK * larger * larger) {
    back_x = (c * along_x - b * along_y) / determinant;
    back_y = (a * along_y - b * along_x) / determinant;
  } else if (larger > 0) {
    const [u_x, u_y] = a > c ? [larger - c, b] : [b, larger - a];
    const share = (u_x * along_x + u_y * along_y) / (larger * (u_x * u_x + u_y * u_y));
    [back_x, back_y] = [share * u_x, share * u_y];
  }
  rows.forEach(([x, y], i) => { v[i] -= x * back_x + y * back_y; });
}

/* ---- Trials ---- */

/* A trial from the start: the movements made, and the configurations at the hits. */
class Trial {
  constructor(problem) {
    this.problem = problem;
    this.q = problem.start.slice();
    this.movements = [];
    this.reached = [];
    this.hands = [];
    this.ticks = 0;
    this.going = true;
  }

  /* Make a movement and note it; return whether it hits. */
  moves(goal, hand, kind, target) {
    const signed = move(this.problem, this.q, target, goal, hand, kind !== "corrective");
    const ticks = Math.abs(signed);
    this.ticks += ticks;
    this.movements.push({ goal, hand, kind, target, ticks });
    return signed > 0;
  }

  /* coartic/motion/kernels/trial.py: **A** corrects a goal that was missed; return whether it hits. */
  corrects(goal, hand) {
    const target = this.q.slice();
    this.going = correct(this.problem, target, goal, hand);
    return this.going && this.moves(goal, hand, "corrective", target);
  }

  looks(goal, hand) {
    return distance_to_goal(this.problem, this.q, goal, hand) <= this.problem.radius;
  }

  /* Note that the goal is hit. */
  ends(goal, hand) {
    const q = this.q.slice();
    if (!this.movements.length || this.movements.at(-1).goal !== goal) {
      this.movements.push({ goal, hand, kind: "corrective", target: q, ticks: 0 });
    }
    this.reached.push(q);
    this.hands.push(hand);
  }

  /* coartic/motion/kernels/trial.py: reach for a goal, with a target or only by **A**. */
  reaches(goal, hand, target) {
    const hit = target ? this.moves(goal, hand, "learned", target) : this.looks(goal, hand);
    this.going = hit || this.corrects(goal, hand);
    if (this.going) this.ends(goal, hand);
  }

  get reward() {
    return this.going ? -this.ticks : -Infinity;
  }
}

/* coartic/motion/kernels/trial.py, one trial: a joint whose target is NaN keeps its value; a goal without
   any target (null) is left to **A**. */
function make_trial(problem, hands, targets) {
  const trial = new Trial(problem);
  for (let goal = 0; trial.going && goal < problem.goals.length; goal += 1) {
    const requested = targets[goal];
    const target = requested && requested.map((value, j) => (Number.isNaN(value) ? trial.q[j] : value));
    trial.reaches(goal, hands[goal], target);
  }
  return trial;
}

/* coartic/motion/execution.py */
function corrective_trial(problem, hands) {
  return make_trial(problem, hands, hands.map(() => null));
}

/* coartic/motion/execution.py: execute movements, each with goal, hand, kind and target. */
function execute(problem, movements) {
  const trial = new Trial(problem);
  for (let goal = 0; trial.going && goal < problem.goals.length; goal += 1) {
    const due = movements.filter((movement) => movement.goal === goal);
    const { hand } = due[0];
    let hit = trial.looks(goal, hand);
    [...due, { kind: "corrective" }].forEach(({ kind, target }, place) => {
      if (!trial.going || (hit && (place > 0 || kind === "corrective"))) return;
      hit = target ? trial.moves(goal, hand, kind, target) : trial.corrects(goal, hand);
    });
    trial.going = hit;
    if (trial.going) trial.ends(goal, hand);
  }
  return trial;
}

/* coartic/pictures/trajectories.py: the configuration at every tick, and the row in which each goal is hit. */
function trajectory(problem, trial) {
  const { step } = problem.model;
  const rows = [];
  const hits = [];
  let q = problem.start;
  trial.movements.forEach(({ goal, target, ticks }) => {
    if (ticks) {
      const distance = Math.sqrt(target.reduce((square, value, j) => square + (value - q[j]) ** 2, 0));
      const last = Math.ceil(distance / step);
      for (let k = 0; k < ticks; k += 1) {
        const [from, fraction] = [q, (k * step) / distance];
        rows.push(k === last ? target : target.map((value, j) => from[j] + fraction * (value - from[j])));
      }
    }
    if (rows.length) q = rows.at(-1);
    hits[goal] = Math.max(rows.length - 1, 0);
  });
  if (!trial.going) hits.length = trial.reached.length;
  return { rows: rows.length ? rows : [problem.start], hits };
}

/* coartic/motion/execution.py: all hand sequences. */
function hand_sequences(problem) {
  return problem.goals.reduce(
    (sequences) => sequences.flatMap((sequence) => problem.hands.map((hand) => [...sequence, hand])),
    [[]],
  );
}

const letters_of = (hands) => hands.map((hand) => "LR"[hand]).join("");

/* coartic/motion/execution.py: the hands that the task names, or that its policy finds. */
function initial_hands(problem, named = problem.task.initial_hands) {
  if (/^[LR]+$/.test(named)) return [...named].map((letter) => "LR".indexOf(letter));
  const single = problem.hands.map((hand) => problem.goals.map(() => hand));
  const changes = (hands) => hands.filter((hand, k) => k && hand !== hands[k - 1]).length;
  const ranked = (named === "best-of-all" ? hand_sequences(problem) : single)
    .map((hands) => ({ hands, reward: corrective_trial(problem, hands).reward, changes: changes(hands) }))
    .sort((a, b) => (b.reward === a.reward ? a.changes - b.changes : b.reward - a.reward));
  return ranked[0].hands;
}

/* The hands with which the corrective process alone is fastest, or the initial hands if there are too many to try. */
function best_hands(problem) {
  return initial_hands(problem, problem.hands.length ** problem.goals.length > MAX_SEQUENCES ? undefined : "best-of-all");
}

/* ---- Random numbers of numpy.random.default_rng(seed), so that a seed gives the same run ----
   Uniform numbers are equal to the last bit, normal numbers to 5e-15, because the tables are computed here. */

/* NumPy's SeedSequence for a seed below 2**128: `count` words of 32 bits. */
function generate_state(seed, count) {
  const entropy = [];
  for (let rest = BigInt(seed); rest > 0n || !entropy.length; rest >>= 32n) entropy.push(Number(rest & 0xffffffffn));
  const shifted = (value) => (value ^ (value >>> 16)) >>> 0;
  const hashing = (constant, factor) => {
    let hash = constant;
    return (value) => {
      const mixed = value ^ hash;
      hash = Math.imul(hash, factor);
      return shifted(Math.imul(mixed, hash));
    };
  };
  const hashed = hashing(0x43b0d7e5, 0x931e8875);
  const pool = [0, 1, 2, 3].map((k) => hashed(entropy[k] || 0));
  const mix = (to, value) => { pool[to] = shifted(Math.imul(pool[to], 0xca01f9dd) - Math.imul(hashed(value), 0x4973f715)); };
  for (let from = 0; from < 4; from += 1) for (let to = 0; to < 4; to += 1) if (from !== to) mix(to, pool[from]);
  const made = hashing(0x8b51f9dd, 0x58f38ded);
  return Array.from({ length: count }, (_, k) => made(pool[k % 4]));
}

/* Ziggurat of 256 layers (Doornik 2005, as in NumPy). */
const ZIGGURAT_R = 3.6541528853610088;
const ziggurat = (() => {
  const area = 0.004928673233974655;
  const density = (x) => Math.exp(-0.5 * x * x);
  const x = new Float64Array(256);
  x[255] = ZIGGURAT_R;
  x[0] = area / density(ZIGGURAT_R);
  for (let i = 254; i > 0; i -= 1) x[i] = Math.sqrt(-2 * Math.log(area / x[i + 1] + density(x[i + 1])));
  const inside = x.map((value, i) => (i === 1 ? 0 : Math.floor((x[(i || 256) - 1] / value) * 2 ** 52)));
  return { wide: x.map((value) => value * 2 ** -52), inside, height: x.map((value, i) => (i ? density(value) : 1)) };
})();

const LIMB = 2 ** 24;
const limbs_of = (value) => [0n, 24n, 48n, 72n, 96n, 120n].map((shift) => Number((value >> shift) & 0xffffffn));
const PCG_FACTOR = limbs_of(0x2360ed051fc65da44385df649fccf645n);
const made = new Float64Array(6);

/* numpy.random.default_rng: PCG64 (O'Neill 2014), with its 128 bits in limbs of 24 bits. */
class Generator {
  constructor(seed) {
    const words = generate_state(seed, 8).map(BigInt);
    const long = (k) => (words[k + 1] << 96n) | (words[k] << 64n) | (words[k + 3] << 32n) | words[k + 2];
    const mask = (1n << 128n) - 1n;
    this.increment = limbs_of(((long(4) << 1n) | 1n) & mask);
    this.state = new Float64Array(6);
    const sum = (long(0) + ((long(4) << 1n) | 1n)) & mask; // a step from 0, then the seed
    this.state.set(limbs_of(sum));
    this.high = 0;
    this.low = 0;
    this.next();
  }

  /* Draw the next 64 bits: `high` and `low`. */
  next() {
    const { state, increment } = this;
    let carry = 0;
    for (let k = 0; k < 6; k += 1) {
      let sum = increment[k] + carry;
      for (let i = 0; i <= k; i += 1) sum += state[i] * PCG_FACTOR[k - i];
      carry = Math.floor(sum / LIMB);
      made[k] = sum - carry * LIMB;
    }
    state.set(made);
    const [n0, n1, n2, n3, n4, n5] = state;
    const top = n4 | (n5 << 24) | 0;
    const word = (n2 >>> 16) | (n3 << 8); // bits 64 to 95
    const low = (n0 | (n1 << 24)) ^ word;
    const high = ((n1 >>> 8) | (n2 << 16)) ^ top;
    const by = top >>> 26;
    const [a, b] = by & 32 ? [high, low] : [low, high];
    const shift = by & 31;
    this.low = (shift ? (a >>> shift) | (b << (32 - shift)) : a) >>> 0;
    this.high = (shift ? (b >>> shift) | (a << (32 - shift)) : b) >>> 0;
  }

  random() {
    this.next();
    return (this.high * 2097152 + (this.low >>> 11)) * 2 ** -53;
  }

  standard_normal() {
    for (;;) {
      this.next();
      const layer = this.low & 0xff;
      const negative = this.low & 0x100;
      const whole = (this.high & 0x1fffffff) * 8388608 + (this.low >>> 9);
      const bit = this.low & 0x20000;
      const x = negative ? -whole * ziggurat.wide[layer] : whole * ziggurat.wide[layer];
      if (whole < ziggurat.inside[layer]) return x;
      if (layer === 0) {
        for (;;) {
          const beyond = -Math.log1p(-this.random()) / ZIGGURAT_R;
          const y = -Math.log1p(-this.random());
          if (y + y > beyond * beyond) return bit ? -(ZIGGURAT_R + beyond) : ZIGGURAT_R + beyond;
        }
      }
      const { height } = ziggurat;
      if ((height[layer - 1] - height[layer]) * this.random() + height[layer] < Math.exp(-0.5 * x * x)) return x;
    }
  }
}

/* ---- The learner ---- */

/* coartic/learner/conditions.py */
const condition = (hands, modify_other, hand_exploration) => ({
  hands, modify_other, hand_exploration, epsilon: 0.2, noise_sd: 0.05, credit: "overall", drift: 0,
});
const CONDITIONS = {
  EC1: condition([RIGHT], false, "none"),
  EC2: condition([LEFT, RIGHT], true, "closest"),
  EC3: condition([LEFT, RIGHT], false, "random"),
  EC4: condition([LEFT, RIGHT], true, "random"),
};
const EQUALLY_NEAR = 1e-9;

/* coartic/learner/kernel.py */
class Learner {
  constructor(problem, rules, seed) {
    Object.assign(this, { problem, rules, first_hands: initial_hands(problem) });
    this.rng = new Generator(seed);
    this.trials = 0;
    this.best = null;
    this.values = problem.goals.map(() => [LEFT, RIGHT, NO_HAND].map(() => [-Infinity, -Infinity]));
    this.targets = problem.goals.map(() => [LEFT, RIGHT, NO_HAND].map(() => [null, null]));
    this.explored = [LEFT, RIGHT].map((chosen) => movable(problem, rules.modify_other ? [LEFT, RIGHT] : [chosen]));
  }

  random_hand() {
    return this.rules.hands[Math.floor(this.rng.random() * this.rules.hands.length)];
  }

  closest_hand(q, number) {
    const [left, right] = HANDS.map((_, hand) => distance_to_goal(this.problem, q, number, hand));
    if (Math.abs(left - right) <= EQUALLY_NEAR) return this.random_hand();
    return left < right ? LEFT : RIGHT;
  }

  greedy_hand(number, previous) {
    const values = this.values[number][previous];
    return this.rules.hands.reduce((best, hand) => (values[hand] > values[best] ? hand : best), this.rules.hands[0]);
  }

  choose_hand(q, number, previous, explore) {
    const { hand_exploration, epsilon } = this.rules;
    if (explore && hand_exploration !== "none" && this.rng.random() < epsilon) {
      return hand_exploration === "random" ? this.random_hand() : this.closest_hand(q, number);
    }
    return this.greedy_hand(number, previous);
  }

  /* The preferred posture at `q` with the chosen hand: halfway to the stored target of the next goal. */
  prefer(q, number, hand) {
    if (number + 1 === this.problem.goals.length) return q;
    const next = this.greedy_hand(number + 1, hand);
    const stored = this.targets[number + 1][hand][next];
    return stored ? q.map((value, j) => (this.explored[next][j] ? 0.5 * (value + stored[j]) : value)) : q;
  }

  /* Move the mean t of exploration by κ N(t) (p − t). The rows of an explored idle arm are 0, so that it moves by κ (p − t). */
  drift(target, preferred, hand) {
    const joints = target.flatMap((_, j) => (this.explored[hand][j] ? [j] : []));
    const v = joints.map((j) => preferred[j] - target[j]);
    project(v, jacobian(this.problem, target, hand, joints));
    joints.forEach((j, i) => { target[j] += this.rules.drift * v[i]; });
  }

  /* q^t = mean + η, with the mean from q*(s, a); null if no target is stored. */
  set_target(q, number, previous, hand, explore) {
    const stored = this.targets[number][previous][hand];
    if (!stored) return null;
    const { rng, rules: { noise_sd, drift } } = this;
    const explored = this.explored[hand];
    const target = stored.map((value, j) => (explored[j] ? value : q[j]));
    if (explore && drift > 0) this.drift(target, this.prefer(q, number, hand), hand);
    return target.map((value, j) => (explore && explored[j] ? value + noise_sd * rng.standard_normal() : value));
  }

  make_trial(explore) {
    const trial = new Trial(this.problem);
    const first = this.trials === 0;
    let previous = NO_HAND;
    for (let goal = 0; trial.going && goal < this.problem.goals.length; goal += 1) {
      const hand = first ? this.first_hands[goal] : this.choose_hand(trial.q, goal, previous, explore);
      const target = first ? null : this.set_target(trial.q, goal, previous, hand, explore);
      trial.reaches(goal, hand, target);
      previous = hand;
    }
    return trial;
  }

  update_tables(trial) {
    for (let goal = this.problem.goals.length - 1; goal >= 0; goal -= 1) {
      let credit = trial.reward;
      if (this.rules.credit === "subtask") {
        credit = 0;
        trial.movements.forEach((movement) => { if (movement.goal === goal) credit -= movement.ticks; });
      }
      const previous = goal ? trial.hands[goal - 1] : NO_HAND;
      const hand = trial.hands[goal];
      if (credit > this.values[goal][previous][hand]) {
        this.values[goal][previous][hand] = credit;
        this.targets[goal][previous][hand] = trial.reached[goal];
      }
    }
  }

  /* Make the next trial, and learn from it. */
  step() {
    const trial = this.make_trial(true);
    this.trials += 1;
    if (trial.going) {
      this.update_tables(trial);
      if (!this.best || trial.reward > this.best.reward) this.best = trial;
    }
    return trial;
  }

  /* A greedy trial without noise. */
  replay() {
    return this.make_trial(false);
  }

  /* coartic/learner/learning_run.py: the solution learned so far, or null. */
  learned() {
    if (this.rules.credit === "overall") return this.best;
    const replay = this.trials ? this.replay() : null;
    return replay && replay.going ? replay : null;
  }
}

/* ---- A plan that looks ahead (as coartic/baselines/receding_horizon.py, by a local search) ---- */

/* The displacement from a point of an arm, its hand or an elbow, to a position, and the point's derivatives by joints. */
function pull_of(problem, q, place, hand, joints, tip = problem.arms[hand].links.length) {
  const rows = jacobian(problem, q, hand, joints, tip);
  const dx = place[0] - xs[tip];
  const dy = place[1] - ys[tip];
  return { dx, dy, distance: Math.sqrt(dx * dx + dy * dy), rows };
}

/* Move `q`, by some joints, to a near posture with that point within `radius` of a position; return whether it succeeds. */
function bring_within(problem, q, place, hand, joints, radius, tip) {
  for (let round = 0; round < 60; round += 1) {
    const { dx, dy, distance, rows } = pull_of(problem, q, place, hand, joints, tip);
    if (distance <= radius + 1e-9) return true;
    const share = (distance - radius) / distance;
    let [a, b, c] = [1e-9, 0, 1e-9];
    rows.forEach(([x, y]) => { a += x * x; b += x * y; c += y * y; });
    const determinant = a * c - b * b;
    const u = (share * (c * dx - b * dy)) / determinant;
    const v = (share * (a * dy - b * dx)) / determinant;
    const size = Math.sqrt(rows.reduce((sum, [x, y]) => sum + (x * u + y * v) ** 2, 0));
    const limit = Math.min(1, 0.5 / size);
    rows.forEach(([x, y], i) => { q[joints[i]] += limit * (x * u + y * v); });
  }
  return false;
}

const distance_of = (a, b) => Math.sqrt(a.reduce((square, value, j) => square + (value - b[j]) ** 2, 0));

/* The shortest joint-space path from `q` through goals `from` to `to` (excluded) with these hands, starting from
   guessed postures: a taut string whose corners slide on the discs. Null if none is found. */
function pulled_taut(problem, q, from, hands, guess, rounds) {
  const joints = movable(problem, problem.hands).flatMap((moves, j) => (moves ? [j] : []));
  const radius = problem.radius * (1 - 1e-3);
  const corners = guess.map((corner) => corner.slice());
  const strides = corners.map(() => 1);
  if (!corners.every((corner, k) => bring_within(problem, corner, problem.goals[from + k], hands[k], joints, radius))) return null;
  for (let round = 0; round < rounds && Math.max(...strides) > 1e-3; round += 1) {
    corners.forEach((here, k) => {
      const before = k ? corners[k - 1] : q;
      const after = corners[k + 1];
      const w = 1 / (distance_of(here, before) + 1e-6);
      const v = after ? 1 / (distance_of(here, after) + 1e-6) : 0;
      const way = here.map((value, j) => (w * before[j] + (after ? v * after[j] : 0)) / (w + v) - value);
      const { dx, dy, distance, rows } = pull_of(problem, here, problem.goals[from + k], hands[k], joints);
      if (distance > radius - 1e-6) { // on the rim the corner slides along it
        const inward = rows.map(([x, y]) => x * dx + y * dy);
        const share = inward.reduce((sum, value, i) => sum + value * way[joints[i]], 0)
          / inward.reduce((sum, value) => sum + value * value, 1e-12);
        if (share < 0) inward.forEach((value, i) => { way[joints[i]] -= share * value; });
      }
      const there = here.map((value, j) => value + strides[k] * way[j]);
      const around = (corner) => distance_of(corner, before) + (after ? distance_of(corner, after) : 0);
      const shorter = bring_within(problem, there, problem.goals[from + k], hands[k], joints, radius) && around(there) < around(here) - 1e-9;
      strides[k] = shorter ? Math.min(1, 1.5 * strides[k]) : strides[k] / 2;
      if (shorter) corners[k] = there;
    });
  }
  const length = corners.reduce((sum, corner, k) => sum + distance_of(corner, k ? corners[k - 1] : q), 0);
  return { corners, length, hands };
}

/* The best of such paths over hand sequences, from the corrective process's postures and seven others. */
function shortest_plan(problem, q, from, to) {
  const window = { ...problem, goals: problem.goals.slice(from, to), start: q };
  const rng = new Generator(from);
  let plans = [];
  hand_sequences(window).forEach((hands) => {
    const alone = corrective_trial(window, hands);
    for (let n = 0; alone.going && n < 8; n += 1) {
      const spread = n ? 0.6 : 0;
      const guess = alone.reached.map((posture) => posture.map((value) => value + (spread && spread * rng.standard_normal())));
      problem.free.forEach((free, axis) => { if (!free) guess.forEach((posture) => { posture[axis] = q[axis]; }); });
      const plan = pulled_taut(problem, q, from, hands, guess, 40);
      if (plan) plans.push(plan);
    }
  });
  plans = plans.sort((a, b) => a.length - b.length).slice(0, 6)
    .map((plan) => pulled_taut(problem, q, from, plan.hands, plan.corners, 400)).filter(Boolean);
  return plans.sort((a, b) => a.length - b.length)[0] || null;
}

const THROUGH = 0.06; // in joint space

/* coartic/baselines/receding_horizon.py: `horizon` goals in view beyond the one to be hit. */
function receding_horizon(problem, horizon) {
  const trial = new Trial(problem);
  const count = problem.goals.length;
  while (trial.going && trial.reached.length < count) {
    const goal = trial.reached.length;
    const end = Math.min(goal + horizon + 1, count);
    const plan = shortest_plan(problem, trial.q, goal, end);
    const followed = end < count ? 1 : end - goal;
    trial.going = plan !== null;
    for (let k = 0; trial.going && k < followed; k += 1) {
      // Through the rim: the target lies beyond the corner, so that the movement ends with the first step inside.
      const corner = plan.corners[k];
      const beyond = THROUGH / (distance_of(corner, trial.q) + 1e-9);
      const target = corner.map((value, j) => value + beyond * (value - trial.q[j]));
      const hits = move(problem, trial.q.slice(), target, goal + k, plan.hands[k], true) > 0; // else a step passes over the goal
      trial.reaches(goal + k, plan.hands[k], hits ? target : corner);
    }
  }
  return trial;
}

if (typeof module !== "undefined") {
  module.exports = {
    CONDITIONS, Generator, Learner, execute, initial_hands, letters_of, make_trial, problem_of,
    receding_horizon, trajectory,
  };
}
