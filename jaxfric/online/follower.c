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
static const double @NAME@_fastest = @FASTEST@;   /* to begin with: faster samples raise it */
static const double @NAME@_keep = @KEEP@;   /* slip time after which a stroke weighs 1/e */
static const double @NAME@_height = @HEIGHT@;   /* of the charts */
static const double @NAME@_gap = @GAP@, @NAME@_whole = @WHOLE@, @NAME@_slack = @SLACK@;
static const double @NAME@_above = @ABOVE@, @NAME@_rate = @RATE@, @NAME@_rounding = @ROUNDING@;
enum { @NAME@_SETTLED = @SETTLED@, @NAME@_LEARNING = @LEARNING@ };
enum { @NAME@_SPAN = @SPAN@, @NAME@_BEGIN = @BEGIN@, @NAME@_FEWEST = @FEWEST@ };

typedef struct {
    double weight[@NAME@_NODES], load[@NAME@_NODES], square;
} @NAME@_sums;

typedef struct {
    double number, mean, square, up, down;
} @NAME@_chart;

/* Mean speed and mean force of the last strokes of a direction. */
typedef struct {
    double speed[@NAME@_SPAN], force[@NAME@_SPAN];
    int count;
} @NAME@_recent;

typedef struct {
    double speed[@NAME@_NODES];
    @NAME@_sums total[2], stroke[2];
    double usual[2], last[3], interval, scale, reference[2][2], limit[2];
    @NAME@_chart chart[2];
    @NAME@_recent recent[2];
    int count[2], inside[2], rising[2], farther[2], started, compared, settled, beyond;
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
    s->compared = 0;
    s->settled = until;
}

/* What is identified now becomes the reference of a direction, up to the fastest node. */
static void @NAME@_refer(@NAME@_state *s, int side)
{
    @NAME@_solve(s, side, s->reference[side]);
    memset(&s->chart[side], 0, sizeof s->chart[side]);
    s->rising[side] = s->farther[side] = 0;
    s->limit[side] = s->speed[@NAME@_NODES - 1];
}

/* What was before stays until the first new stroke of a direction. */
static void @NAME@_anew(@NAME@_state *s)
{
    memset(s->count, 0, sizeof s->count), memset(s->inside, 0, sizeof s->inside);
    memset(s->stroke, 0, sizeof s->stroke), memset(s->recent, 0, sizeof s->recent);
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

/* Sums at the nodes of before, shared between those beside them. */
static void @NAME@_moved(const @NAME@_state *s, const double before[@NAME@_NODES], double *sums)
{
    double old[@NAME@_NODES];
    memcpy(old, sums, sizeof old);
    memset(sums, 0, sizeof old);
    for (int i = 0, k = 0; i < @NAME@_NODES; i++) {
        while (k < @NAME@_NODES - 2 && s->speed[k + 1] <= before[i]) k++;
        const double part = (before[i] - s->speed[k]) / (s->speed[k + 1] - s->speed[k]);
        const double up = fmin(fmax(part, 0.0), 1.0) * old[i];
        sums[k] += old[i] - up;
        sums[k + 1] += up;
    }
}

/* Nodes that reach beyond a speed; what is known of friction stays. */
static void @NAME@_widen(@NAME@_state *s, double speed)
{
    double before[@NAME@_NODES];
    memcpy(before, s->speed, sizeof before);
    @NAME@_reach(s, @NAME@_above * speed);
    for (int side = 0; side < 2; side++) {
        @NAME@_moved(s, before, s->total[side].weight), @NAME@_moved(s, before, s->total[side].load);
        @NAME@_moved(s, before, s->stroke[side].weight), @NAME@_moved(s, before, s->stroke[side].load);
    }
    if (!s->compared)
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

/* The standard normal as improbable as Student's t of that square (Wallace 1959). */
static double @NAME@_normal(double square, double freedom)
{
    const double size = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
    return size * sqrt(freedom * log1p(square / freedom));
}

/* The score of a value by those before it. */
static double @NAME@_score(const @NAME@_chart *c, double value)
{
    const double freedom = fmax(c->number - 1.0, 1.0), variance = c->square / freedom;
    if (c->number < @NAME@_LEARNING || !(variance > 0.0)) return 0.0;
    const double off = value - c->mean;
    const double size = @NAME@_normal(c->number / (c->number + 1.0) * off * off / variance, freedom);
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

/* Strokes after a change among the last ones, 0 if there is none; by how much more force, and the
 * force before. Their mean force is a line of their mean speed and a step (Hawkins & al. 2003). */
static int @NAME@_split(const @NAME@_recent *r, double *shift, double *before)
{
    const int n = r->count;
    double speed = 0.0, force = 0.0, fastest = 0.0, largest = 0.0, spread = 0.0, both = 0.0;
    if (n < @NAME@_BEGIN) return 0;
    for (int k = 0; k < n; k++) {
        speed += r->speed[k] / n, force += r->force[k] / n;
        fastest = fmax(fastest, r->speed[k]), largest = fmax(largest, fabs(r->force[k]));
    }
    for (int k = 0; k < n; k++) {
        const double off = r->speed[k] - speed;
        spread += off * off, both += off * (r->force[k] - force);
    }
    const double fine = @NAME@_rounding * fastest, least = @NAME@_rounding * largest;
    const int varied = spread > n * fine * fine;
    const double slope = varied ? both / spread : 0.0;
    double square = 0.0, step = 0.0, alike = 0.0, best = -1.0;
    int after = 0;
    for (int k = 0; k < n; k++)
        square += pow(r->force[k] - force - slope * (r->speed[k] - speed), 2.0);
    for (int k = n - 1; k >= @NAME@_FEWEST; k--) {
        const double size = (double)k * (n - k) / n, off = r->speed[k] - speed;
        step += r->force[k] - force - slope * off;
        alike += off;
        const double told = varied ? size - alike * alike / spread : size;
        if (n - k < @NAME@_FEWEST || !(told > @NAME@_rounding * size)) continue;
        const double gained = step * step / told, left = fmax(square - gained, n * least * least);
        const double ratio = left > 0.0 ? gained / left : 0.0;
        if (ratio > best) best = ratio, after = n - k, *shift = step / told;
    }
    const int moments = n - 2 * @NAME@_FEWEST + 1;
    if (!after) return 0;
    const double score = @NAME@_normal((n - 3) * best, n - 3);
    if (!(moments * erfc(score / sqrt(2.0)) < @NAME@_rate)) return 0;
    *before = 0.0;
    for (int k = 0; k < n - after; k++) *before += r->force[k] / (n - after);
    return after;
}

static void @NAME@_append(@NAME@_recent *r, double speed, double force)
{
    if (r->count == @NAME@_SPAN) {
        memmove(r->speed, r->speed + 1, (@NAME@_SPAN - 1) * sizeof *r->speed);
        memmove(r->force, r->force + 1, (@NAME@_SPAN - 1) * sizeof *r->force);
        r->count--;
    }
    r->speed[r->count] = speed, r->force[r->count++] = force;
}

/* Whether a stroke is faster than any that the reference was identified for. */
static int @NAME@_is_farther(@NAME@_state *s, int side)
{
    int k = 0;
    double more = 0.0;
    while (k < @NAME@_NODES && s->speed[k] < s->limit[side] * (1.0 + 1e-9)) k++;
    for (k++; k < @NAME@_NODES; k++) more += s->stroke[side].weight[k];
    if (!(more > 0.0)) return 0;
    if (++s->farther[side] >= @NAME@_SETTLED) @NAME@_refer(s, side);
    return 1;
}

/* A change, from which on all is identified anew. */
static int @NAME@_changed(@NAME@_state *s, int side, double time, int strokes, double excess,
    double before, @NAME@_change *change)
{
    change->time = time, change->side = side, change->strokes = strokes;
    change->excess = (1.0 - 2.0 * side) * excess;
    change->share = before != 0.0 ? change->excess / fabs(before) : NAN;
    @NAME@_anew(s);
    return 1;
}

/* A stroke into the sums and onto the chart. */
static int @NAME@_close(@NAME@_state *s, int side, double time, @NAME@_change *change)
{
    @NAME@_sums *total = &s->total[side], *stroke = &s->stroke[side];
    const double sign = 1.0 - 2.0 * side, *usual = s->reference[side];
    double seconds = 0.0, load = 0.0, before = 0.0, way = 0.0, shift, level;
    for (int k = 0; k < @NAME@_NODES; k++) {
        seconds += stroke->weight[k];
        load += stroke->load[k];
        way += stroke->weight[k] * s->speed[k];
        before += stroke->weight[k] * sign * (usual[0] + usual[1] * s->speed[k]);
    }
    const int whole = seconds > @NAME@_whole * s->usual[side];
    const double kept = s->count[side] ? exp(-seconds / @NAME@_keep) : 0.0;
    for (int k = 0; k < @NAME@_NODES; k++) {
        total->weight[k] = kept * total->weight[k] + stroke->weight[k];
        total->load[k] = kept * total->load[k] + stroke->load[k];
    }
    total->square = kept * total->square + stroke->square;
    s->count[side]++;
    s->usual[side] += (seconds - s->usual[side]) / (s->count[side] < 50 ? s->count[side] : 50);
    if (whole) {
        @NAME@_append(&s->recent[side], way / seconds, load / seconds);
        const int after = @NAME@_split(&s->recent[side], &shift, &level);
        if (after) return @NAME@_changed(s, side, time, after, shift, level, change);
    }
    if (!s->compared) {
        if (s->count[0] < s->settled || s->count[1] < s->settled) return 0;
        s->compared = 1;
        @NAME@_refer(s, 0), @NAME@_refer(s, 1);
        return 0;
    }
    if (@NAME@_is_farther(s, side)) return 0;
    const double excess = (load - before) / fmax(seconds, 1e-300);
    if (!whole || !isfinite(excess)) return 0;
    @NAME@_chart *c = &s->chart[side];
    const int alarm = @NAME@_charted(c, excess);
    s->rising[side] = fmax(c->up, c->down) > 0.0 ? s->rising[side] + 1 : 0;
    if (!alarm) return 0;
    return @NAME@_changed(s, side, time, s->rising[side], excess, before / seconds, change);
}

/* One sample; 1 if friction has changed, which is then in `change`. Non-finite ones are missing. */
int @NAME@_add(@NAME@_state *s, double time, double velocity, double force, @NAME@_change *change)
{
    if (!isfinite(time + velocity + force)) return 0;
    if (fabs(velocity) > s->speed[@NAME@_NODES - 1]) {
        s->beyond = !s->beyond;
        if (s->beyond) return 0;   /* a lone one counts as missing */
        @NAME@_widen(s, fabs(velocity));
    }
    s->beyond = 0;
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
