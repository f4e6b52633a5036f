/* @NAME@: Coulomb and viscous friction of an axis, followed sample by sample. Made by jaxfric.
 *
 * C99, no allocation, constant memory and time a sample. Units are those of the samples fed in.
 * Problem (L) of Kim, Kim & Ha (2004) over strokes that begin and end at one speed: neither mass
 * nor acceleration is needed. The arithmetic is that of jaxfric.online.Follower.
 *
 *   static @NAME@_state state;
 *   @NAME@_start(&state);
 *   if (@NAME@_add(&state, time, velocity, force, &change)) ...   one call a sample
 *   @NAME@_solve(&state, direction, parameters)   Coulomb and viscous, direction 0 or 1 (backward)
 */
#include <math.h>
#include <string.h>

#define @NAME@_NODES @NODES@
static const double @NAME@_slowest = @SLOWEST@;   /* slip begins */
static const double @NAME@_fastest = @FASTEST@;   /* to begin with: a faster sample raises it */
static const double @NAME@_keep = @KEEP@;   /* slip time after which a stroke weighs 1/e */
static const double @NAME@_height = @HEIGHT@;   /* of the charts */
static const double @NAME@_gap = @GAP@, @NAME@_whole = @WHOLE@, @NAME@_slack = @SLACK@;
enum { @NAME@_SETTLED = @SETTLED@, @NAME@_LEARNING = @LEARNING@ };

typedef struct {
    double weight[@NAME@_NODES], load[@NAME@_NODES], square;
} @NAME@_sums;

typedef struct {
    double number, mean, square, up, down;
} @NAME@_chart;

typedef struct {
    double speed[@NAME@_NODES];
    @NAME@_sums total[2], stroke[2];
    double usual[2], last[3], interval, scale, reference[2][2];
    @NAME@_chart chart[2];
    int count[2], inside[2], rising[2], started, compared, settled;
} @NAME@_state;

/* A change: when, 0 forward or 1 backward, for how many strokes, and how much more friction. */
typedef struct {
    double time, excess, share;
    int side, strokes;
} @NAME@_change;

/* Coulomb and viscous friction of a direction, both positive as friction; 0 if it did not move. */
int @NAME@_solve(const @NAME@_state *s, int side, double parameters[2])
{
    const @NAME@_sums *t = &s->total[side];
    const double sign = 1.0 - 2.0 * side;
    double w = 0.0, wv = 0.0, wvv = 0.0, u = 0.0, uv = 0.0;
    for (int k = 0; k < @NAME@_NODES; k++) {
        const double v = s->speed[k];
        w += t->weight[k];
        wv += t->weight[k] * v;
        wvv += t->weight[k] * v * v;
        u += sign * t->load[k];
        uv += sign * t->load[k] * v;
    }
    const double determinant = w * wvv - wv * wv;
    parameters[0] = parameters[1] = 0.0;
    if (!(determinant > 0.0)) return 0;
    parameters[0] = (wvv * u - wv * uv) / determinant;
    parameters[1] = (w * uv - wv * u) / determinant;
    return 1;
}

/* No reference until so many strokes of each direction are closed. */
static void @NAME@_learn(@NAME@_state *s, int until)
{
    s->rising[0] = s->rising[1] = s->compared = 0;
    memset(s->chart, 0, sizeof s->chart);
    s->settled = until;
}

static void @NAME@_anew(@NAME@_state *s)
{
    for (int side = 0; side < 2; side++) {
        @NAME@_sums *t = &s->total[side];
        double seconds = 0.0;
        for (int k = 0; k < @NAME@_NODES; k++) seconds += t->weight[k];
        const double kept = seconds > 0.0 ? fmin(1.0, 0.1 * s->usual[side] / seconds) : 0.0;
        for (int k = 0; k < @NAME@_NODES; k++) t->weight[k] *= kept, t->load[k] *= kept;
        t->square *= kept;
        s->count[side] = s->inside[side] = 0;
        memset(&s->stroke[side], 0, sizeof s->stroke[side]);
    }
    @NAME@_learn(s, @NAME@_SETTLED);
}

static void @NAME@_reach(@NAME@_state *s, double fastest)
{
    const double ratio = log(fastest / @NAME@_slowest);
    s->scale = (@NAME@_NODES - 1) / ratio;
    for (int k = 0; k < @NAME@_NODES; k++)
        s->speed[k] = @NAME@_slowest * exp(ratio * k / (@NAME@_NODES - 1));
}

void @NAME@_start(@NAME@_state *s)
{
    memset(s, 0, sizeof *s);
    s->settled = @NAME@_SETTLED;
    @NAME@_reach(s, @NAME@_fastest);
}

/* Sums on nodes of twice the step: every second node stays, what is between two is shared. */
static void @NAME@_merge(double *sums, double ratio)
{
    double over = 0.0;
    for (int k = 0; k < @NAME@_NODES; k += 2) {
        const double next = k + 1 < @NAME@_NODES ? sums[k + 1] : 0.0, up = next / (1.0 + ratio);
        sums[k / 2] = sums[k] + over + next - up;
        over = up;
    }
    int k = (@NAME@_NODES + 1) / 2;
    for (sums[k++] = over; k < @NAME@_NODES; k++) sums[k] = 0.0;
}

/* Nodes up to fastest * fastest / slowest; a reference that reaches so far is learned anew. */
static void @NAME@_widen(@NAME@_state *s)
{
    const double ratio = s->speed[1] / s->speed[0], fastest = s->speed[@NAME@_NODES - 1];
    for (int side = 0; side < 2; side++) {
        @NAME@_merge(s->total[side].weight, ratio), @NAME@_merge(s->total[side].load, ratio);
        @NAME@_merge(s->stroke[side].weight, ratio), @NAME@_merge(s->stroke[side].load, ratio);
    }
    @NAME@_reach(s, fastest * fastest / @NAME@_slowest);
    @NAME@_learn(s, (s->count[0] > s->count[1] ? s->count[0] : s->count[1]) + @NAME@_SETTLED);
}

/* A sample's time and impulse between the two nodes beside its speed. */
static void @NAME@_share(@NAME@_state *s, int side, double above, double force, double time)
{
    @NAME@_sums *stroke = &s->stroke[side];
    const double speed = @NAME@_slowest + above;
    int k = (int)(log(speed / @NAME@_slowest) * s->scale);
    if (k > @NAME@_NODES - 2) k = @NAME@_NODES - 2;
    double part = (speed - s->speed[k]) / (s->speed[k + 1] - s->speed[k]);
    part = fmin(fmax(part, 0.0), 1.0) * time;
    stroke->weight[k] += time - part;
    stroke->weight[k + 1] += part;
    stroke->load[k] += (time - part) * force;
    stroke->load[k + 1] += part * force;
    stroke->square += time * force * force;
}

/* The standard normal score of a value by those before it (Wallace 1959). */
static double @NAME@_score(const @NAME@_chart *c, double value)
{
    const double freedom = fmax(c->number - 1.0, 1.0), variance = c->square / freedom;
    if (c->number < @NAME@_LEARNING || !(variance > 0.0)) return 0.0;
    const double off = value - c->mean;
    const double ratio = c->number / (c->number + 1.0) * off * off / variance;
    const double size = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0)
        * sqrt(freedom * log1p(ratio / freedom));
    return off > 0.0 ? size : off < 0.0 ? -size : 0.0;
}

static int @NAME@_charted(@NAME@_chart *c, double value)
{
    const double score = @NAME@_score(c, value), off = value - c->mean;
    c->up = fmax(0.0, c->up + score - @NAME@_slack);
    c->down = fmax(0.0, c->down - score - @NAME@_slack);
    c->number += 1.0;
    c->mean += off / c->number;
    c->square += off * (value - c->mean);
    return fmax(c->up, c->down) > @NAME@_height;
}

/* A stroke into the sums and onto the chart. */
static int @NAME@_close(@NAME@_state *s, int side, double time, @NAME@_change *change)
{
    @NAME@_sums *total = &s->total[side], *stroke = &s->stroke[side];
    const double sign = 1.0 - 2.0 * side, *usual = s->reference[side];
    double seconds = 0.0, load = 0.0, before = 0.0;
    for (int k = 0; k < @NAME@_NODES; k++) {
        seconds += stroke->weight[k];
        load += stroke->load[k];
        before += stroke->weight[k] * sign * (usual[0] + usual[1] * s->speed[k]);
    }
    const int whole = seconds > @NAME@_whole * s->usual[side];
    const double kept = exp(-seconds / @NAME@_keep);
    for (int k = 0; k < @NAME@_NODES; k++) {
        total->weight[k] = kept * total->weight[k] + stroke->weight[k];
        total->load[k] = kept * total->load[k] + stroke->load[k];
    }
    total->square = kept * total->square + stroke->square;
    s->count[side]++;
    s->usual[side] += (seconds - s->usual[side]) / (s->count[side] < 50 ? s->count[side] : 50);
    if (!s->compared) {
        if (s->count[0] >= s->settled && s->count[1] >= s->settled)
            s->compared = @NAME@_solve(s, 0, s->reference[0]) & @NAME@_solve(s, 1, s->reference[1]);
        return 0;
    }
    const double excess = (load - before) / fmax(seconds, 1e-300);
    if (!whole || !isfinite(excess)) return 0;
    @NAME@_chart *c = &s->chart[side];
    const int alarm = @NAME@_charted(c, excess);
    s->rising[side] = fmax(c->up, c->down) > 0.0 ? s->rising[side] + 1 : 0;
    if (!alarm) return 0;
    change->time = time;
    change->side = side;
    change->strokes = s->rising[side];
    change->excess = sign * excess;
    change->share = before != 0.0 ? change->excess / fabs(before / seconds) : NAN;
    @NAME@_anew(s);
    return 1;
}

/* One sample; 1 if friction has changed, which is then in `change`. Non-finite ones are missing. */
int @NAME@_add(@NAME@_state *s, double time, double velocity, double force, @NAME@_change *change)
{
    if (!isfinite(time + velocity + force)) return 0;
    while (fabs(velocity) > s->speed[@NAME@_NODES - 1]) @NAME@_widen(s);
    const double before = s->last[1], load = s->last[2], step = time - s->last[0];
    const int first = !s->started;
    s->started = 1;
    s->last[0] = time, s->last[1] = velocity, s->last[2] = force;
    if (first) return 0;
    const double usual = s->interval > 0.0 ? s->interval : step;
    int changed = 0;
    if (!(step > 0.0 && step <= @NAME@_gap * usual)) {
        for (int side = 0; side < 2; side++) {
            s->inside[side] = 0;
            memset(&s->stroke[side], 0, sizeof s->stroke[side]);
        }
        return 0;
    }
    s->interval = usual + 0.02 * (step - usual);
    for (int side = 0; side < 2; side++) {
        const double sign = 1.0 - 2.0 * side;
        const double left = sign * before - @NAME@_slowest, right = sign * velocity - @NAME@_slowest;
        if (left <= 0.0 && right <= 0.0) continue;
        if (left <= 0.0) {
            s->inside[side] = 1;
            @NAME@_share(s, side, right, force, (1.0 - left / (left - right)) * step);
        } else if (right <= 0.0) {
            if (s->inside[side]) {
                @NAME@_share(s, side, left, load, left / (left - right) * step);
                changed |= @NAME@_close(s, side, time, change);
                memset(&s->stroke[side], 0, sizeof s->stroke[side]);
            }
            s->inside[side] = 0;
        } else if (s->inside[side]) {
            @NAME@_share(s, side, left, load, 0.5 * step);
            @NAME@_share(s, side, right, force, 0.5 * step);
        }
    }
    return changed;
}
