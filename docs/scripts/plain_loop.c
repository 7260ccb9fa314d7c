/* A trial of coartic.motion as a programmer would first write it in C: a loop over control steps.
 *
 * With bounds it skips the steps in which the hand provably stays outside the goal and away from the
 * end of the movement, as coartic.motion.kernels.move.clear_steps does. */

#include <math.h>
#include <string.h>

enum { MAX_ENTRIES = 64 };

typedef struct {
    long first, links;
    double lengths[MAX_ENTRIES], shoulder_x, shoulder_y;
} Arm;

typedef struct {
    double radius, step, arrival, gain, tolerance;
    long iterations;
    double free_x, free_y;
} Rules;

/* Places of shoulder, joints and hand. */
static void place(const double *q, const Arm *arm, double *x, double *y) {
    double angle = 0.0;
    x[0] = q[0] + arm->shoulder_x;
    y[0] = q[1] + arm->shoulder_y;
    for (long k = 0; k < arm->links; k++) {
        angle += q[arm->first + k];
        x[k + 1] = x[k] + arm->lengths[k] * cos(angle);
        y[k + 1] = y[k] + arm->lengths[k] * sin(angle);
    }
}

/* Steps during which the hand stays out of a disc: two bounds on how far it gets. */
static double clear(double dx, double dy, double rim, const double *velocity, double speed, double bend) {
    double distance = hypot(dx, dy), gap = distance - rim - 1e-9;
    if (gap <= 0.0) return 0.0;
    double toward = (velocity[0] * dx + velocity[1] * dy) / distance;
    double curved = 2 * gap / (sqrt(toward * toward + 2 * bend * gap) + toward);
    if (!(curved >= 0.0)) curved = 0.0;
    return floor(fmax(gap / speed, curved) * (1 - 1e-9));
}

/* Moves q to a target; returns the ticks, and whether the goal is hit. */
static long move(double *q, const double *target, long dof, const Arm *arm, const double *goal,
                 int stops, const Rules *rules, int bounds, int *hit) {
    double start[MAX_ENTRIES], x[MAX_ENTRIES], y[MAX_ENTRIES], rate[MAX_ENTRIES];
    double square = 0.0, bend = 0.0, angle_rate = 0.0;
    long tip = arm->links;
    memcpy(start, q, dof * sizeof *q);
    for (long j = 0; j < dof; j++) square += (target[j] - start[j]) * (target[j] - start[j]);
    double distance = sqrt(square), per_step = distance > 0.0 ? rules->step / distance : 0.0;
    long last = (long)ceil(distance / rules->step);
    double base_x = (target[0] - start[0]) * per_step, base_y = (target[1] - start[1]) * per_step;
    double speed = hypot(base_x, base_y);
    for (long k = 0; k < tip; k++) {
        angle_rate += (target[arm->first + k] - start[arm->first + k]) * per_step;
        rate[k] = angle_rate;
        speed += arm->lengths[k] * fabs(angle_rate);
        bend += arm->lengths[k] * angle_rate * angle_rate;
    }
    place(target, arm, x, y);
    double end_x = x[tip], end_y = y[tip];
    for (long k = 0;; k++) {
        double fraction = k * rules->step / distance;
        for (long j = 0; j < dof; j++)
            q[j] = k == last ? target[j] : start[j] + fraction * (target[j] - start[j]);
        place(q, arm, x, y);
        double dx = goal[0] - x[tip], dy = goal[1] - y[tip], to_x = end_x - x[tip], to_y = end_y - y[tip];
        *hit = hypot(dx, dy) <= rules->radius;
        if (*hit || k == last || (stops && hypot(to_x, to_y) <= rules->arrival)) return k + 1;
        if (bounds) {
            double velocity[2] = {base_x, base_y};
            for (long i = 0; i < tip; i++) {
                velocity[0] -= rate[i] * (y[i + 1] - y[i]);
                velocity[1] += rate[i] * (x[i + 1] - x[i]);
            }
            double steps = clear(dx, dy, rules->radius, velocity, speed, bend);
            if (stops) steps = fmin(steps, clear(to_x, to_y, rules->arrival, velocity, speed, bend));
            k = (long)fmin(k + steps, last - 1);
        }
    }
}

/* Descends on the distance to the goal; returns whether q hits. */
static int correct(double *q, const Arm *arm, const double *goal, const Rules *rules) {
    double x[MAX_ENTRIES], y[MAX_ENTRIES];
    long tip = arm->links;
    for (long n = 0; n < rules->iterations; n++) {
        place(q, arm, x, y);
        double error_x = goal[0] - x[tip], error_y = goal[1] - y[tip];
        if (hypot(error_x, error_y) <= rules->tolerance) return 1;
        q[0] += rules->gain * error_x * rules->free_x;
        q[1] += rules->gain * error_y * rules->free_y;
        for (long k = 0; k < tip; k++)
            q[arm->first + k] += rules->gain * ((x[tip] - x[k]) * error_y - (y[tip] - y[k]) * error_x);
    }
    return 0;
}

/* Makes trials one after the other: their ticks, -1 where a trial fails. */
void trials(long count, long goals, long dof, const double *q0, const double *targets, const long *hands,
            const double *centres, const Arm *arms, const Rules *rules, int bounds, long *ticks) {
    double q[MAX_ENTRIES], corrected[MAX_ENTRIES];
    for (long n = 0; n < count; n++) {
        memcpy(q, q0, dof * sizeof *q);
        ticks[n] = 0;
        for (long g = 0; g < goals; g++) {
            const double *target = targets + (n * goals + g) * dof, *goal = centres + 2 * g;
            const Arm *arm = arms + hands[g];
            int hit;
            ticks[n] += move(q, target, dof, arm, goal, 1, rules, bounds, &hit);
            if (hit) continue;
            memcpy(corrected, q, dof * sizeof *q);
            if (correct(corrected, arm, goal, rules))
                ticks[n] += move(q, corrected, dof, arm, goal, 0, rules, bounds, &hit);
            if (!hit) {
                ticks[n] = -1;
                break;
            }
        }
    }
}
