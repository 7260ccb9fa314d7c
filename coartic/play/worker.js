/* ---- The worker makes trials in slices of time, so that it receives a new order at once ---- */

const SLICE_MS = 50;

/* A run of the learner or of a planner, as an order describes it. */
class Job {
  constructor({ key, task, rules, seed, horizon, trials, turn = 0 }) {
    const problem = problem_of(task);
    Object.assign(this, { key, trials, turn, made: 0, due: 1, snapshots: [], done: false });
    if (rules) this.method = new Learner(problem, rules, seed);
    else this.method = { learned: () => receding_horizon(problem, horizon), step() {} };
  }

  step() {
    const { method } = this;
    method.step();
    this.made = method.trials || 1;
    this.done = this.made >= this.trials;
    if (this.made >= this.due || this.done) {
      this.due = Math.max(this.made + 1, Math.ceil(1.1 * this.made));
      const learned = method.learned();
      if (learned) this.snapshots.push({ trials: this.made, reward: learned.reward, movements: learned.movements, reached: learned.reached });
    }
  }

  /* The news since the last report. */
  report() {
    const { key, made, done, snapshots } = this;
    this.snapshots = [];
    return { key, made, done, snapshots };
  }
}

if (typeof document === "undefined" && typeof self !== "undefined" && typeof module === "undefined") {
  let [order, jobs] = [0, []];
  const work = (current) => {
    if (current !== order) return;
    const turn = Math.min(...jobs.filter((job) => !job.done).map((job) => job.turn));
    const now = jobs.filter((job) => job.turn === turn);
    const left = () => now.filter((job) => !job.done);
    const end = performance.now() + SLICE_MS;
    for (let open = left(); open.length && performance.now() < end; open = left()) open.forEach((job) => job.step());
    // Later turns are further runs; they are reported only when they are complete.
    if (turn < 2 || !left().length) self.postMessage({ order, reports: now.map((job) => job.report()) });
    if (jobs.some((job) => !job.done)) setTimeout(work, 0, current);
  };
  self.onmessage = ({ data }) => {
    order = data.order;
    jobs = data.jobs.map((job) => new Job(job));
    work(order);
  };
}
