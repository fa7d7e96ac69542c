/* The limiter: brings what a target asks for into every limit of a device, sample by sample. `Controller.step` in
 * ctrlgen/controller/feedforward.py is its twin; docs/limiter.md says how their equality is shown.
 *
 * ctrlgen writes a device's numbers and kernels, resolves the conditions and macros of this text with them, and puts it behind them
 * (ctrlgen/firmware/c/preprocessor.py). limiter_config.h is the same as a header, so that this file is also C as it stands; that of the
 * MEMS hexapod is in codegen/golden/limiter, where compile_flags.txt sends editors and clang-tidy.
 *
 * Sizes: N displacements, NU drives, NX states that the model remembers, of them NS of actuators, M numbers of a target.
 * What a device has is 1, else 0: STATE_LIMITED (limits on states of actuators can be met), BOUNDED (a cheap bound of the shares of
 * composite limits, of which there are SHARES, of FEW coordinates where these are fewer), RATED (drives change only so fast), PASSING (they can lead the device beyond a
 * limit), DIRECT (every displacement is a matrix times the target, and a target that leads into the range is a command), BOUND_FIRST (the
 * cheap bound is known of the target), REDUNDANT (more drives than axes, of which GROUPS can be moved without a push), COUPLED (a displacement moves several
 * channels), MOVING (kernels for the next sample), MOTION (targets with derivatives), GIVEN (constants that are given at the
 * start), PIVOTED (targets of a pivot), ESTIMATED (states that are stepped from sample to sample, which can be believed wrongly), REMEMBERING
 * (how they go on depends on where the stage is), RINGING (a stage with inertia, which may be off its motion; NY numbers tell of that), OBSERVED (these can be measured), VARIED (the
 * time of a sample, state->h, may vary), FILLED (a word of zeros in place of padding). SETTLE_DRIVE_LIMITED and STEP_DRIVE_LIMITED: drives beyond their limits can be needed. SETTLE_EXAMINED_FIRST and
 * STEP_EXAMINED_FIRST: whether a state is lost is asked before it is used. STATE_BY_MODE and DRIVE_BY_MODE: the line search calls one
 * kernel to settle and another to step, as ADVANCE_BY_MODE says of drives within reach. OWN_DRIVES: each drive leads one displacement of its
 * own. U_BOUNDS_ONCE: one function alone reads the limits of drives.
 *
 * BALANCE, COMPOSITE_SHARES, SETTLE_STATE and other macros with arguments call a kernel, which may read fewer of them. Names that end
 * in _TABLE are numbers in braces. EACH_AXIS(F), EACH_STATE(F) and EACH_DRIVE(F) are F(0) F(1) ..., one by one, because a loop costs a
 * small core twice as much. Macros are in upper case, because a device may name a constant as it likes, in lower case.
 */
#include "limiter_config.h"

/* Clips value to low ... high; 1 if a component changed by more than its slack or was NaN. */
static int limit_all(real value[], const real low[], const real high[], const real slack[], int count)
{
    int hit = 0;
    int i;
    for (i = 0; i < count; i++) {
        if (is_nan(&value[i]) != 0) {
            value[i] = low[i];
            hit = 1;
        } else if (value[i] > high[i]) {
            if ((value[i] - high[i]) > slack[i]) {
                hit = 1;
            }
            value[i] = high[i];
        } else if (value[i] <= low[i]) { /* a negative zero too */
            if ((low[i] - value[i]) > slack[i]) {
                hit = 1;
            }
            value[i] = low[i];
        } else {
            /* within its limits */
        }
    }
    return hit;
}

#if !COUPLED || !DIRECT || PASSING
/* Clips a displacement to its range; 1 if it was beyond by more than the slack. */
static int limit_displacement(real value[N])
{
    static const real LOW[N] = Z_LOW_TABLE; /* m */
    static const real HIGH[N] = Z_HIGH_TABLE; /* m */
    static const real SLACK[N] = Z_SLACK_TABLE; /* m */
    return limit_all(value, LOW, HIGH, SLACK, N);
}

#endif
#if STATE_LIMITED
/* Clips the states of actuators to their range; 1 if one was beyond by more than the slack. */
static int limit_state(const limiter_state *state, real value[NS])
{
#if defined(S_LOW_TABLE)
    static const real LOW[NS] = S_LOW_TABLE; /* SI */
#endif
#if defined(S_HIGH_TABLE)
    static const real HIGH[NS] = S_HIGH_TABLE;
#endif
    static const real SLACK[NS] = S_SLACK_TABLE;
    (void)state;
    return limit_all(value, STATE_LOW, STATE_HIGH, SLACK, NS);
}

#endif
#if (SETTLE_DRIVE_LIMITED || STEP_DRIVE_LIMITED) && !OWN_DRIVES
/* 1 if every drive is within its limits or beyond by no more than the slack. */
static int drives_admissible(const limiter_state *state, const real drive[NU])
{
    int admissible = 1;
    int i;
    (void)state;
    for (i = 0; i < NU; i++) {
        if ((is_nan(&drive[i]) != 0) || (drive[i] > U_MOST[i]) || (drive[i] < U_LEAST[i])) {
            admissible = 0;
        }
    }
    return admissible;
}

#endif
#if RATED
#if VARIED
#define FALLS(i) (FALL_RATE[i] * state->h)
#define RISES(i) (RISE_RATE[i] * state->h)
#else
#define FALLS(i) FALL[i]
#define RISES(i) RISE[i]
#endif
/* Goes from the last drives toward drive by the largest common share that every rate allows: 0 untouched, 1 changed, 2 by more than the
 * slack. */
static int limit_rate(const limiter_state *state, real drive[NU], real *share)
{
#if VARIED
    static const real FALL_RATE[NU] = FALL_TABLE; /* SI, in a second */
    static const real RISE_RATE[NU] = RISE_TABLE;
#elif !REDUNDANT
    static const real FALL[NU] = FALL_TABLE; /* SI, in one sample */
    static const real RISE[NU] = RISE_TABLE;
#endif
    real least = REAL(1.0);
    int changed = 0;
    int beyond = 0;
    int i;
    for (i = 0; i < NU; i++) {
        const real change = drive[i] - state->u[i];
#if SETTLE_EXAMINED_FIRST && STEP_EXAMINED_FIRST
        if ((change > RISES(i)) || (change < FALLS(i))) {
#else
        if ((is_nan(&state->u[i]) != 0) || (change > RISES(i)) || (change < FALLS(i))) {
#endif
            const real reached = ((change > REAL(0.0)) ? RISES(i) : FALLS(i)) / change;
            changed = 1;
            least = (reached < least) ? reached : least;
            if ((change > (RISES(i) + U_SLACK[i])) || (change < (FALLS(i) - U_SLACK[i]))) {
                beyond = 1;
            }
        }
    }
    if (changed != 0) {
        for (i = 0; i < NU; i++) {
            drive[i] = state->u[i] + (least * (drive[i] - state->u[i]));
        }
        (void)limit_all(drive, U_LOW, U_HIGH, U_SLACK, NU);
    }
    *share = least;
    return changed + beyond;
}

#endif
#if REDUNDANT
/* The number nearest to t of those by which the drives of a set may move along the null space to be in low ... high. */
static real moved_into(real t, const real drive[NU], const real low[NU], const real high[NU], const int set[], int count)
{
    static const real SHARE[NU] = NULL_SHARE_TABLE; /* 1 over NULL_MOTION */
    real least = -UNLIMITED;
    real most = UNLIMITED;
    real raised;
    int k;
    for (k = 0; k < count; k++) {
        const int i = set[k];
        const real to_low = (low[i] - drive[i]) * SHARE[i];
        const real to_high = (high[i] - drive[i]) * SHARE[i];
        const real first = (to_high < to_low) ? to_high : to_low;
        const real last = (to_high > to_low) ? to_high : to_low;
        least = (first > least) ? first : least;
        most = (last < most) ? last : most;
    }
    raised = (t < least) ? least : t;
    return (raised > most) ? most : raised;
}

/* Of all drives that push as drive, the weighted pseudo-inverse, those of least effort within their limits, and as far as these allow
 * within their rates: u + t w with the smallest |t|, B w = 0. Where there are none, they are beyond a limit. */
static void choose_drives(const limiter_state *state, real drive[NU])
{
    static const real NULL_MOTION[NU] = NULL_MOTION_TABLE; /* w */
    static const int SET[] = GROUP_MEMBERS; /* drives of each group, one group after the other */
    static const int FIRST[] = GROUP_STARTS;
    real free[NU];
#if RATED
    real slowest[NU];
    real fastest[NU];
#endif
    int kept = DRIVE_INSIDE(state, drive);
    int i;
    (void)state;
    for (i = 0; i < NU; i++) {
        free[i] = drive[i];
#if RATED
        slowest[i] = state->u[i] + FALL[i];
        fastest[i] = state->u[i] + RISE[i];
        if (!((drive[i] >= slowest[i]) && (drive[i] <= fastest[i]))) {
            kept = 0;
        }
#endif
    }
    if (kept == 0) {
        int group;
        for (group = 0; group < GROUPS; group++) {
            const int first = FIRST[group];
            const int count = FIRST[group + 1] - first;
            real t = REAL(0.0);
#if RATED
            t = moved_into(t, free, slowest, fastest, &SET[first], count);
#endif
            t = moved_into(t, free, U_LOW, U_HIGH, &SET[first], count);
            for (i = 0; i < count; i++) {
                const int k = SET[first + i];
                drive[k] = free[k] + (t * NULL_MOTION[k]);
            }
        }
    }
}

#endif
#if FEW
/* The squares of how far a displacement uses composite limits. */
static void used_shares(const real wanted[N], real share[SHARES])
{
    real few[FEW];
    FEW_COORDINATES(wanted, few);
    SHARES_OF_FEW(few, share);
}

#endif
#if SHARES
/* Scales a displacement that breaks a composite limit toward home, several times where the limited quantity is not proportional to it: 0
 * untouched, 1 scaled, 2 scaled by more than the slack. */
static int scale_home(const limiter_state *state, real wanted[N])
{
    int hit = 0;
    int round;
    (void)state;
    for (round = 0; round < COMPOSITE_ROUNDS; round++) {
        real share[SHARES];
        real worst;
        int i;
        COMPOSITE_SHARES(state, wanted, share);
        worst = share[0];
#if SHARES > 1
        for (i = 0; i < SHARES; i++) {
            worst = (share[i] > worst) ? share[i] : worst;
        }
#endif
        if (worst > REAL(1.0)) {
            int scaled = 1;
            worst = square_root(worst);
            if (worst > COMPOSITE_SLACK) {
                scaled = 2;
            }
            hit = (scaled > hit) ? scaled : hit;
            for (i = 0; i < N; i++) {
                wanted[i] = wanted[i] / worst;
            }
        }
    }
    return hit;
}

#if BOUNDED && (PASSING || !BOUND_FIRST)
/* The same where a cheap bound does not show that every composite limit is kept. */
static int limit_composite(const limiter_state *state, real wanted[N])
{
    int hit = 0;
    if (!(COMPOSITE_BOUND(wanted) <= REAL(1.0))) {
        hit = scale_home(state, wanted);
    }
    return hit;
}

#define LIMIT_COMPOSITE limit_composite
#else
#define LIMIT_COMPOSITE scale_home
#endif
#endif
#if STATE_LIMITED
/* Clips out->state to its range. The displacement that the device then has is taken where that changes it by more than the slack. */
static uint32_t keep_state(const limiter_state *state, limiter_output *out)
{
    uint32_t status = 0U;
    if (limit_state(state, out->state) != 0) {
        real x[NX];
        int i;
        for (i = 0; i < NS; i++) {
            x[i] = out->state[i];
        }
#if NX > NS
        for (i = NS; i < NX; i++) {
            x[i] = state->x[i];
        }
#endif
        BALANCE(state, x, out->displacement, U_SAFE, out->displacement);
        status = LIMITER_STATE;
    }
    return status;
}

#endif
#if PASSING
/* The limits beyond which the device is, led there by drives that may not change faster, as a status. */
static uint32_t passed(const limiter_state *state)
{
    real z[N];
    uint32_t status = 0U;
    int i;
    for (i = 0; i < N; i++) {
        z[i] = state->z[i];
    }
    if (limit_displacement(z) != 0) {
        status |= LIMITER_DISPLACEMENT;
    }
#if STATE_LIMITED
    {
        real x[NS];
        for (i = 0; i < NS; i++) {
            x[i] = state->x[i];
        }
        if (limit_state(state, x) != 0) {
            status |= LIMITER_STATE;
        }
    }
#endif
#if SHARES
    for (i = 0; i < N; i++) {
        z[i] = state->z[i];
    }
    if (LIMIT_COMPOSITE(state, z) > 1) {
        status |= LIMITER_COMPOSITE;
    }
#endif
    return status;
}

#endif
#if COUPLED
/* Clips a number to low ... high. */
static real clipped(real number, real low, real high)
{
    const real raised = (number > low) ? number : low;
    return (raised < high) ? raised : high;
}

#define CLIP_AXIS(k) value[k] = clipped(beyond[k], LOW[k], HIGH[k]);
#define MEASURE_AXIS(k) off[k] = value[k] - beyond[k];
/* The displacement in range whose followed signal is nearest to that of the displacement beyond, to first order, from beyond clipped to
 * the range: sweeps of projected coordinate descent (C. Hildreth, Naval Res. Logist. Quart. 4 (1957) 79) on |W (value - beyond)|^2,
 * W the slope of the followed signal at home, by H_ij/H_ii of H = W^T W. Axis by axis, because a loop costs a small core twice as much.
 * 1 if beyond was out of range by more than the slack, else value is clipped alone. */
static int nearest_displacement(const real beyond[N], real value[N])
{
#if DIRECT /* then beyond is a number */
    static const real LOW[N] = Z_LOW_TABLE; /* m */
    static const real HIGH[N] = Z_HIGH_TABLE; /* m */
    static const real SLACK[N] = Z_SLACK_TABLE; /* m */
#endif
    real off[N];
    int hit = 0;
#if DIRECT
    int i;
    EACH_AXIS(CLIP_AXIS)
    EACH_AXIS(MEASURE_AXIS)
    for (i = 0; i < N; i++) {
        if ((off[i] > SLACK[i]) || (off[i] < -SLACK[i])) {
            hit = 1;
        }
    }
#else
    hit = limit_displacement(value);
    EACH_AXIS(MEASURE_AXIS)
#endif
    if (hit != 0) {
        int sweep;
        for (sweep = 0; sweep < SWEEPS; sweep++) {
            NEAREST_SWEEP
        }
    }
    return hit;
}

#endif
#if SETTLE_DRIVE_LIMITED || STEP_DRIVE_LIMITED
/* Actuator state (limited) and drives (not limited) that out->displacement needs: with settling at rest, else at the next sample. */
static void wanted_drives(const limiter_state *state, int settling, limiter_output *out)
{
    (void)state;
    (void)settling;
#if NS && STATE_BY_MODE
    if (settling != 0) {
        SETTLE_STATE(state, out->displacement, out->state);
    } else {
        STEP_STATE(state, out->displacement, out->state);
    }
#elif NS
    LIMITED_STATE(state, out->displacement, out->state);
#endif
#if STATE_LIMITED
    if (STATE_INSIDE(state, out->state) == 0) {
        (void)limit_state(state, out->state);
    }
#endif
#if DRIVE_BY_MODE
    if (settling != 0) {
        SETTLE_DRIVE(state, out->displacement, out->state, out->drive);
    } else {
        STEP_DRIVE(state, out->displacement, out->state, out->drive);
    }
#else
    LIMITED_DRIVE(state, out->displacement, out->state, out->drive);
#endif
#if REDUNDANT
    choose_drives(state, out->drive);
#endif
}

#if OWN_DRIVES
#define HOLD_DRIVE(k) held[k] = out->drive[k];
#define TAKE_HELD(k) out->drive[k] = held[k];
#define BEGIN_AT(k) reached[k] = out->displacement[k];
/* Keeps the limits of drives that out->drive does not keep: as far from origin toward out->displacement as every drive can lead the
 * displacement of its own. The drives held within their limits lead to reached, and the slowest of those that were beyond by more than the slack
 * says how much of the line is gone. As drives rise with their displacements, or fall, all lie between those of origin and held, but for the
 * slack; limited is 1 if one does not, because those of origin are inadmissible. */
static uint32_t into_reach(const limiter_state *state, int settling, const real origin[N], limiter_output *out, int *limited)
{
    real held[NU];
    uint32_t status = 0U;
    EACH_DRIVE(HOLD_DRIVE)
    if (limit_all(held, U_LOW, U_HIGH, U_SLACK, NU) == 0) {
        EACH_DRIVE(TAKE_HELD)
    } else {
        real reached[N];
        real x[NX];
        real share = REAL(1.0);
        int i;
#if ADVANCE_BY_MODE
        if (settling != 0) {
            SETTLE_ADVANCE(state, out->displacement, held, x);
        } else {
            STEP_ADVANCE(state, state->z, held, x);
        }
#else
        LIMITED_ADVANCE(state, LIMITED_FROM, held, x);
#endif
        EACH_AXIS(BEGIN_AT) /* analysers that do not follow all of Newton's loop see them set */
        REACHED(state, x, out->displacement, held, reached);
        for (i = 0; i < N; i++) {
            const real whole = out->displacement[i] - origin[i];
            if ((out->drive[i] > (held[i] + U_SLACK[i])) || (out->drive[i] < (held[i] - U_SLACK[i]))) { /* by more than rounding */
                const real gone = reached[i] - origin[i];
                const real most = share * whole;
                if (((whole > REAL(0.0)) && (gone < most)) || ((whole < REAL(0.0)) && (gone > most))) {
                    share = gone / whole;
                }
            }
            reached[i] = whole;
        }
        if (share > REAL(0.0)) {
            share *= REACH_FRACTION;
        } else {
            share = REAL(0.0);
        }
        for (i = 0; i < N; i++) {
            out->displacement[i] = origin[i] + (share * reached[i]);
        }
        wanted_drives(state, settling, out);
        if (DRIVE_INSIDE(state, out->drive) == 0) {
            *limited = limit_all(out->drive, U_LOW, U_HIGH, U_SLACK, NU);
        }
        status = LIMITER_DRIVE;
    }
    return status;
}

#else
#define START_DRIVE(k) at_start[k] = out->drive[k];
#define START_STATE(k) state_at_start[k] = out->state[k];
/* Line search from origin toward out->displacement, whose drives are inadmissible: secants of the drive that is first
 * at its limit. Leaves the farthest admissible displacement found and its drives; 1 if even those of origin are inadmissible. */
static int line_search(const limiter_state *state, int settling, const real origin[N], limiter_output *out)
{
    real direction[N];
    real at_target[NU];
    int i;
    for (i = 0; i < N; i++) {
        direction[i] = out->displacement[i] - origin[i];
        out->displacement[i] = origin[i];
    }
    for (i = 0; i < NU; i++) {
        at_target[i] = out->drive[i];
    }
    wanted_drives(state, settling, out);
    if (drives_admissible(state, out->drive) != 0) {
        real at_start[NU];
#if NS
        real state_at_start[NS];
#endif
        real accepted = REAL(0.0);
        real rejected = REAL(1.0);
        int trial;
        EACH_DRIVE(START_DRIVE)
#if NS
        EACH_STATE(START_STATE)
#endif
        for (trial = 0; trial < SECANT_STEPS; trial++) {
            real share = REAL(1.0);
            real fraction;
            for (i = 0; i < NU; i++) {
                if ((at_target[i] > U_MOST[i]) || (at_target[i] < U_LEAST[i])) {
                    const real limit = (at_target[i] > U_HIGH[i]) ? U_HIGH[i] : U_LOW[i];
                    const real reached = (limit - at_start[i]) / (at_target[i] - at_start[i]);
                    share = (reached < share) ? reached : share;
                }
            }
            share = (share > REAL(0.0)) ? share : REAL(0.0);
            fraction = accepted + ((SECANT_FRACTION * share) * (rejected - accepted));
            for (i = 0; i < N; i++) {
                out->displacement[i] = origin[i] + (fraction * direction[i]);
            }
            wanted_drives(state, settling, out);
            if (drives_admissible(state, out->drive) != 0) {
                accepted = fraction;
                EACH_DRIVE(START_DRIVE)
#if NS
                EACH_STATE(START_STATE)
#endif
            } else {
                rejected = fraction;
                for (i = 0; i < NU; i++) {
                    at_target[i] = out->drive[i];
                }
            }
        }
        for (i = 0; i < N; i++) {
            out->displacement[i] = origin[i] + (accepted * direction[i]);
        }
        for (i = 0; i < NU; i++) {
            out->drive[i] = at_start[i];
        }
#if NS
        for (i = 0; i < NS; i++) {
            out->state[i] = state_at_start[i];
        }
#endif
    }
    return limit_all(out->drive, U_LOW, U_HIGH, U_SLACK, NU);
}

#endif
#endif
#if VARIED
/* A sample of this time begins as the state is. */
static void set_begin(limiter_state *state, real time)
{
    int i;
    state->h = time;
#if NX
    for (i = 0; i < NX; i++) {
        state->x_begun[i] = state->x[i];
    }
#endif
    for (i = 0; i < N; i++) {
        state->z_begun[i] = state->z[i];
    }
}

/* The state is that of now, whatever was stepped. */
static void set_now(limiter_state *state)
{
    state->h = SAMPLE_TIME;
    state->stepping = 0U;
}

#endif
#if RINGING
#include "ringing_count.c"

#endif
#if GIVEN
#include "start_constants.c"
#else
void INIT(limiter_state *state)
{
#if NX && !NS
    static const real X_REST[NX] = REST_TABLE; /* SI */
#endif
    if (state != NULL) {
        int i;
#if NX
        for (i = 0; i < NX; i++) {
            state->x[i] = X_REST[i];
        }
#endif
        for (i = 0; i < N; i++) {
            state->z[i] = REAL(0.0);
        }
#if RATED
        for (i = 0; i < NU; i++) {
            state->u[i] = U_SAFE[i];
        }
#endif
#if ESTIMATED
        state->unsure = 0U;
        state->ticking = 0U;
        state->tick = 0U;
#endif
#if VARIED
        set_begin(state, SAMPLE_TIME);
        state->stepping = 0U;
#endif
#if RINGING
        set_still(state, state->ahead);
        state->ringing = REAL(0.0);
        state->ticking = 0U;
        state->tick = 0U;
#endif
#if FILLED
        state->unused = 0U;
#endif
        state->ready = LIMITER_BUILD;
    }
}

#endif
/* What is answered where nothing is known of the device: the safe drive, under which it comes to rest. */
static void set_safe(limiter_output *out)
{
    int i;
    for (i = 0; i < NU; i++) {
        out->drive[i] = U_SAFE[i];
    }
    for (i = 0; i < N; i++) {
        out->displacement[i] = REAL(0.0);
    }
#if NS
    for (i = 0; i < NS; i++) {
        out->state[i] = X_REST[i];
    }
#endif
}

/* The answer to a lost state, which stays lost until it is initialised. */
static uint32_t set_lost(limiter_state *state, limiter_output *out)
{
    state->ready = 0U;
    set_safe(out);
    return LIMITER_LOST;
}

#if ESTIMATED
#include "estimate_count.c"

#endif
#define SETTLING 1
#include "sample.c"
#undef SETTLING
#if MOVING

#define SETTLING 0
#include "sample.c"
#undef SETTLING
#endif
#if MOTION

#include "motion.c"
#endif
#if PIVOTED

#include "pivot.c"
#endif
#if ESTIMATED

#include "estimate.c"
#endif
#if RINGING

#include "ringing.c"
#endif
#if ESTIMATED || RINGING

#include "step_at.c"
#endif
#if VARIED

#include "timed.c"
#endif
