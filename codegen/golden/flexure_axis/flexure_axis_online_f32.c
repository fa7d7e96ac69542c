/* flexure_axis_online_f32: see flexure_axis_online_f32.h. Made by ctrlgen 0.1.0; do not edit. */
#include "flexure_axis_online_f32.h"

#include <stddef.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ > 0)) || defined(_M_FP_FAST)
#error "compile this without -ffast-math, -Ofast, -ffinite-math-only or /fp:fast: they remove the checks for NaN"
#endif

static const float FLEXURE_AXIS_ONLINE_F32_U_LOW[1] = { -4.0f }; /* V */
static const float FLEXURE_AXIS_ONLINE_F32_U_HIGH[1] = { 4.0f }; /* V */
static const float FLEXURE_AXIS_ONLINE_F32_U_SLACK[1] = { 8e-06f }; /* V */
static const float FLEXURE_AXIS_ONLINE_F32_U_SAFE[1] = { 0.0f }; /* V */

/* The bits of a number in memory. Whether a number is one, and how large, is asked of these: a compiler that is told that no number is NaN
 * may leave comparisons of numbers out, never those of integers. */
static uint32_t flexure_axis_online_f32_bits_of(const float *number)
{
    union { float number; uint32_t bits; } v;
    v.number = *number;
    return v.bits;
}

/* 1 if a number in memory is NaN. */
static int flexure_axis_online_f32_is_nan(const float *number)
{
    return ((flexure_axis_online_f32_bits_of(number) & 0x7FFFFFFFU) > 0x7F800000U) ? 1 : 0;
}

#define FLEXURE_AXIS_ONLINE_F32_FORCE_CONSTANT_STIFFNESS_1 (20000.0f) /* (1 / actuator.force_constant) * mechanics.stiffness */
#define FLEXURE_AXIS_ONLINE_F32_FORCE_CONSTANT (10.0f) /* actuator.force_constant */
#define FLEXURE_AXIS_ONLINE_F32_STIFFNESS (200000.0f) /* mechanics.stiffness */
#define FLEXURE_AXIS_ONLINE_F32_DAMPING (30.0f) /* mechanics.damping */
#define FLEXURE_AXIS_ONLINE_F32_STIFFNESS_1 (5e-06f) /* 1 / mechanics.stiffness */

/* Displacement at which the platform pose is `target`, axis [m]. */
static void flexure_axis_online_f32_wanted_displacement(const float target[1], float result[1])
{
    result[0] = target[0];
}

/* Drive that keeps the displacement `wanted` at rest. */
static void flexure_axis_online_f32_wanted_drive(const float wanted[1], float result[1])
{
    result[0] = FLEXURE_AXIS_ONLINE_F32_FORCE_CONSTANT_STIFFNESS_1 * wanted[0];
}

/* States under `drive`, at rest: velocity_axis [m / s]. */
static void flexure_axis_online_f32_wanted_advance(float result[1])
{
    result[0] = 0.0f;
}

/* Displacement at which the platform pose is `target`, axis [m]. */
static void flexure_axis_online_f32_motion_displacement(const float target[3], float result[1])
{
    result[0] = target[0];
}

/* States that the displacement needs during the motion that `target` says: velocity_axis [m / s]. */
static void flexure_axis_online_f32_motion_state(const float target[3], float result[1])
{
    result[0] = target[1];
}

/* Drive of the motion that `target` says. */
static void flexure_axis_online_f32_motion_drive(const float target[3], float result[1])
{
    const float target_0 = target[0];
    const float target_1 = target[1];
    const float target_2 = target[2];
    result[0] = (20000.0f * target_0) + (3.0f * target_1) + (0.05f * target_2);
}

/* Where the motion that `target` says comes from, half a sample before, then where it leads, half a sample after:
 * states and displacements, weighted by what is told of a ringing. */
static void flexure_axis_online_f32_motion_joins(const float target[3], float result[4])
{
    static const float TABLE_1[2] = { 8743.522f, 0.21858805f };
    static const float TABLE_2[2] = { 5.0110615e+06f, 125.27654f };
    float shared1[2];
    float shared2[2];
    int i;
    for (i = 0; i < 2; i++) {
        shared1[i] = TABLE_1[i] * target[i + 1];
    }
    for (i = 0; i < 2; i++) {
        shared2[i] = TABLE_2[i] * target[i];
    }
    result[0] = shared1[0] - shared1[1];
    result[1] = shared2[0] - shared2[1];
    result[2] = shared1[0] + shared1[1];
    result[3] = shared2[0] + shared2[1];
}

/* Displacement at which the forces balance, g(x, z, drive) = 0: the step z - g/(dg/dz) from z. */
static void flexure_axis_online_f32_balance_displacement(const float x[1], const float z[1], const float drive[1], float result[1])
{
    const float t1 = ((FLEXURE_AXIS_ONLINE_F32_FORCE_CONSTANT * drive[0]) - (FLEXURE_AXIS_ONLINE_F32_STIFFNESS * z[0])) - (FLEXURE_AXIS_ONLINE_F32_DAMPING * x[0]);
    result[0] = z[0] + (FLEXURE_AXIS_ONLINE_F32_STIFFNESS_1 * t1);
}

/* 1 if every displacement is inside its limits; 0 for NaN. */
static int flexure_axis_online_f32_displacement_inside(const float value[1])
{
    return (((flexure_axis_online_f32_bits_of(&value[0]) & 0x7FFFFFFFU) <= 0x38D1B717U) /* 1e-04f */) ? 1 : 0;
}

/* 1 if every drive is inside its limits; 0 for NaN. */
static int flexure_axis_online_f32_drive_inside(const float value[1])
{
    return (((flexure_axis_online_f32_bits_of(&value[0]) & 0x7FFFFFFFU) <= 0x40800000U) /* 4.0f */) ? 1 : 0;
}

/* 1 if every component is a number of a plausible size. */
static int flexure_axis_online_f32_is_usable(const float target[3])
{
    return (((flexure_axis_online_f32_bits_of(&target[0]) & 0x7FFFFFFFU) <= 0x41200000U) /* 10.0f */ &&
        ((flexure_axis_online_f32_bits_of(&target[1]) & 0x7FFFFFFFU) <= 0x447A0000U) /* 1000.0f */ &&
        ((flexure_axis_online_f32_bits_of(&target[2]) & 0x7FFFFFFFU) <= 0x47C35000U) /* 100000.0f */) ? 1 : 0;
}

/* 1 if a number of the state is NaN, infinite or far beyond its range: 4 times the largest magnitude of it. Asked first where
 * displacements depend on the state or effects remember, else where a limit is met: until then it would show in the drives, or is
 * written anew. */
static int flexure_axis_online_f32_is_lost(const flexure_axis_online_f32_state *state)
{
    return (((flexure_axis_online_f32_bits_of(&state->x[0]) & 0x7FFFFFFFU) <= 0x59635FA9U) /* 4e+15f */ &&
        ((flexure_axis_online_f32_bits_of(&state->z[0]) & 0x7FFFFFFFU) <= 0x39D1B717U) /* 0.0004f */) ? 0 : 1;
}

/* Clips value to low ... high; 1 if a component changed by more than its slack or was NaN. */
static int flexure_axis_online_f32_limit_all(float value[], const float low[], const float high[], const float slack[], int count)
{
    int hit = 0;
    int i;
    for (i = 0; i < count; i++) {
        if (flexure_axis_online_f32_is_nan(&value[i]) != 0) {
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

/* Clips a displacement to its range; 1 if it was beyond by more than the slack. */
static int flexure_axis_online_f32_limit_displacement(float value[1])
{
    static const float LOW[1] = { -1e-04f }; /* m */
    static const float HIGH[1] = { 1e-04f }; /* m */
    static const float SLACK[1] = { 4e-10f }; /* m */
    return flexure_axis_online_f32_limit_all(value, LOW, HIGH, SLACK, 1);
}

static float flexure_axis_online_f32_magnitude(float of)
{
    return (of < 0.0f) ? -of : of;
}

/* Where a device that stays in its state is led, weighted. */
static void flexure_axis_online_f32_set_still(const flexure_axis_online_f32_state *state, float still[2])
{
    static const float X_WEIGHT[1] = { 8743.522f }; /* in units of what is told, per SI */
    static const float Z_WEIGHT[1] = { 5.0110615e+06f };
    int i;
    for (i = 0; i < 1; i++) {
        still[i] = X_WEIGHT[i] * state->x[i];
    }
    for (i = 0; i < 1; i++) {
        still[1 + i] = Z_WEIGHT[i] * state->z[i];
    }
}

/* UNSURE while the device may ring by more than is told, beside what held drives leave. */
static uint32_t flexure_axis_online_f32_is_ringing(const flexure_axis_online_f32_state *state, float held)
{
    const float size = state->ringing + held;
    return ((flexure_axis_online_f32_is_nan(&size) != 0) || (size > 0.5f)) ? FLEXURE_AXIS_ONLINE_F32_UNSURE : 0U;
}

/* What a break of the motion, and what is left of drives, adds to a ringing. */
static float flexure_axis_online_f32_added(const flexure_axis_online_f32_state *state, const float from[2], float left)
{
    float size = left;
    int i;
    for (i = 0; i < 2; i++) {
        size += flexure_axis_online_f32_magnitude(from[i] - state->ahead[i]);
    }
    return ((flexure_axis_online_f32_is_nan(&size) == 0) && (size <= 0.002f)) ? 0.0f : size;
}

/* A ringing of this size about a motion that leads ahead: the device itself is never farther from rest than unknown. */
static float flexure_axis_online_f32_bounded(float size, const float ahead[2])
{
    static const float HOME_AHEAD[2] = { 0.0f, 0.0f }; /* of rest */
    float most = 42835.184f;
    float left = size;
    int i;
    for (i = 0; i < 2; i++) {
        most += flexure_axis_online_f32_magnitude(ahead[i] - HOME_AHEAD[i]);
    }
    if ((flexure_axis_online_f32_is_nan(&left) == 0) && (left > most)) {
        left = most;
    }
    if ((flexure_axis_online_f32_is_nan(&left) == 0) && (left < 2e-06f)) { /* denormal numbers are slow */
        left = 0.0f;
    }
    return left;
}

/* A sample of a motion that comes from here and leads ahead; the clock of step_at goes on by one. */
static uint32_t flexure_axis_online_f32_follow_on(flexure_axis_online_f32_state *state, const float from[2], const float ahead[2], float left)
{
    static const float HELD[2] = { 0.0011920454f, 7.993895e-06f }; /* what a held drive leaves, per change in a sample */
    const float size = (state->ringing * 0.99918395f) + flexure_axis_online_f32_added(state, from, left);
    float held = 0.0f;
    int i;
    state->tick += 1U;
    state->ringing = flexure_axis_online_f32_bounded(size, ahead);
    for (i = 0; i < 2; i++) {
        held += HELD[i] * flexure_axis_online_f32_magnitude(ahead[i] - from[i]);
        state->ahead[i] = ahead[i];
    }
    return flexure_axis_online_f32_is_ringing(state, held);
}

/* A sample of a motion that ends where the state is. */
static uint32_t flexure_axis_online_f32_stay(flexure_axis_online_f32_state *state)
{
    float still[2];
    flexure_axis_online_f32_set_still(state, still);
    return flexure_axis_online_f32_follow_on(state, still, still, 0.0f);
}

void flexure_axis_online_f32_init_20000hz_f8cca9da(flexure_axis_online_f32_state *state)
{
    static const float X_REST[1] = { 0.0f }; /* SI */
    if (state != NULL) {
        int i;
        for (i = 0; i < 1; i++) {
            state->x[i] = X_REST[i];
        }
        for (i = 0; i < 1; i++) {
            state->z[i] = 0.0f;
        }
        flexure_axis_online_f32_set_still(state, state->ahead);
        state->ringing = 0.0f;
        state->ticking = 0U;
        state->tick = 0U;
        state->ready = FLEXURE_AXIS_ONLINE_F32_BUILD;
    }
}

/* What is answered where nothing is known of the device: the safe drive, under which it comes to rest. */
static void flexure_axis_online_f32_set_safe(flexure_axis_online_f32_output *out)
{
    int i;
    for (i = 0; i < 1; i++) {
        out->drive[i] = FLEXURE_AXIS_ONLINE_F32_U_SAFE[i];
    }
    for (i = 0; i < 1; i++) {
        out->displacement[i] = 0.0f;
    }
}

/* The answer to a lost state, which stays lost until it is initialised. */
static uint32_t flexure_axis_online_f32_set_lost(flexure_axis_online_f32_state *state, flexure_axis_online_f32_output *out)
{
    state->ready = 0U;
    flexure_axis_online_f32_set_safe(out);
    return FLEXURE_AXIS_ONLINE_F32_LOST;
}

/* Without a usable target: the safe drive, as fast as it may change, and the state that it leads to. */
static void flexure_axis_online_f32_settle_safe(flexure_axis_online_f32_state *state, flexure_axis_online_f32_output *out)
{
    int i;
    for (i = 0; i < 1; i++) {
        out->drive[i] = FLEXURE_AXIS_ONLINE_F32_U_SAFE[i];
    }
    for (i = 0; i < 1; i++) {
        out->displacement[i] = state->z[i];
    }
    flexure_axis_online_f32_wanted_advance(state->x);
    flexure_axis_online_f32_balance_displacement(state->x, out->displacement, out->drive, state->z);
}

/* The state becomes that of the next sample. */
static void flexure_axis_online_f32_settle_proceed(flexure_axis_online_f32_state *state, const flexure_axis_online_f32_output *out)
{
    flexure_axis_online_f32_wanted_advance(state->x);
    state->z[0] = out->displacement[0];
}

/* Drives for out->displacement with every limit kept; the state becomes that of the next sample. */
static uint32_t flexure_axis_online_f32_settle_within(flexure_axis_online_f32_state *state, flexure_axis_online_f32_output *out)
{
    uint32_t status = 0U;
    flexure_axis_online_f32_wanted_drive(out->displacement, out->drive);
    if (flexure_axis_online_f32_drive_inside(out->drive) == 0) {
        (void)flexure_axis_online_f32_limit_all(out->drive, FLEXURE_AXIS_ONLINE_F32_U_LOW, FLEXURE_AXIS_ONLINE_F32_U_HIGH, FLEXURE_AXIS_ONLINE_F32_U_SLACK, 1);
    }
    flexure_axis_online_f32_settle_proceed(state, out);
    status |= flexure_axis_online_f32_stay(state);
    return status;
}

/* The same for out->displacement beyond its range. */
static uint32_t flexure_axis_online_f32_settle_beyond(flexure_axis_online_f32_state *state, flexure_axis_online_f32_output *out)
{
    uint32_t status;
    int hit;
    hit = flexure_axis_online_f32_limit_displacement(out->displacement);
    status = flexure_axis_online_f32_settle_within(state, out);
    if (hit != 0) {
        status |= FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT;
    }
    return status;
}

/* The answer to a target that is no command, or to none. */
static uint32_t flexure_axis_online_f32_settle_unusable(flexure_axis_online_f32_state *state, flexure_axis_online_f32_output *out)
{
    uint32_t status = FLEXURE_AXIS_ONLINE_F32_INPUT;
    flexure_axis_online_f32_settle_safe(state, out);
    status |= flexure_axis_online_f32_stay(state);
    return status;
}

uint32_t flexure_axis_online_f32_settle(flexure_axis_online_f32_state *state, const float target[3], flexure_axis_online_f32_output *out)
{
    uint32_t status = FLEXURE_AXIS_ONLINE_F32_INPUT;
    if (out == NULL) {
        /* nothing is written */
    } else if (state == NULL) {
        flexure_axis_online_f32_set_safe(out);
    } else if ((state->ready != FLEXURE_AXIS_ONLINE_F32_BUILD) || (flexure_axis_online_f32_is_lost(state) != 0)) {
        status = flexure_axis_online_f32_set_lost(state, out);
    } else if ((target != NULL) && (flexure_axis_online_f32_is_usable(target) != 0)) {
        flexure_axis_online_f32_wanted_displacement(target, out->displacement);
        if (flexure_axis_online_f32_displacement_inside(out->displacement) != 0) {
            status = flexure_axis_online_f32_settle_within(state, out);
        } else {
            status = flexure_axis_online_f32_settle_beyond(state, out);
        }
    } else {
        status = flexure_axis_online_f32_settle_unusable(state, out);
    }
    return status;
}

/* 1 if every one of count values is within its limits or beyond by no more than the slack; 0 for NaN. */
static int flexure_axis_online_f32_all_within(const float value[], const float low[], const float high[], const float slack[], int count)
{
    int within = 1;
    int i;
    for (i = 0; i < count; i++) {
        if ((flexure_axis_online_f32_is_nan(&value[i]) != 0) || (value[i] > (high[i] + slack[i])) || (value[i] < (low[i] - slack[i]))) {
            within = 0;
        }
    }
    return within;
}

/* The limits that a motion breaks beside those of the drives, as a status; 0 for none. */
static uint32_t flexure_axis_online_f32_motion_broken(const flexure_axis_online_f32_state *at)
{
    static const float LOW[1] = { -1e-04f }; /* m */
    static const float HIGH[1] = { 1e-04f }; /* m */
    static const float SLACK[1] = { 4e-10f }; /* m */
    uint32_t status = 0U;
    if (flexure_axis_online_f32_all_within(at->z, LOW, HIGH, SLACK, 1) == 0) {
        status = FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT;
    }
    return status;
}

/* The drives of the motion whose state is at, within their limits. */
static uint32_t flexure_axis_online_f32_motion_drives(flexure_axis_online_f32_state *at, const flexure_axis_online_f32_state *state, const float target[3], flexure_axis_online_f32_output *out)
{
    static const float U_WEIGHT[1] = { 8.743523f };
    float left = 0.0f;
    float wanted[1];
    float join[2 * 2];
    uint32_t status = 0U;
    int i;
    (void)state;
    flexure_axis_online_f32_motion_joins(target, join); /* before out, which may be the target */
    flexure_axis_online_f32_motion_drive(target, out->drive);
    for (i = 0; i < 1; i++) {
        wanted[i] = out->drive[i];
    }
    if (flexure_axis_online_f32_limit_all(out->drive, FLEXURE_AXIS_ONLINE_F32_U_LOW, FLEXURE_AXIS_ONLINE_F32_U_HIGH, FLEXURE_AXIS_ONLINE_F32_U_SLACK, 1) != 0) {
        status = FLEXURE_AXIS_ONLINE_F32_DRIVE;
    }
    for (i = 0; i < 1; i++) {
        out->displacement[i] = at->z[i];
    }
    for (i = 0; i < 1; i++) {
        left += U_WEIGHT[i] * flexure_axis_online_f32_magnitude(out->drive[i] - wanted[i]);
    }
    status |= flexure_axis_online_f32_follow_on(at, join, &join[2], left);
    at->ready = FLEXURE_AXIS_ONLINE_F32_BUILD;
    return status;
}

uint32_t flexure_axis_online_f32_step(flexure_axis_online_f32_state *state, const float target[3], flexure_axis_online_f32_output *out)
{
    uint32_t status = FLEXURE_AXIS_ONLINE_F32_INPUT;
    if (out == NULL) {
        /* nothing is written */
    } else if (state == NULL) {
        flexure_axis_online_f32_set_safe(out);
    } else if ((state->ready != FLEXURE_AXIS_ONLINE_F32_BUILD) || (flexure_axis_online_f32_is_lost(state) != 0)) {
        status = flexure_axis_online_f32_set_lost(state, out);
    } else if ((target == NULL) || (flexure_axis_online_f32_is_usable(target) == 0)) {
        flexure_axis_online_f32_settle_safe(state, out);
        status |= flexure_axis_online_f32_stay(state);
    } else {
        flexure_axis_online_f32_state at;
        uint32_t broken;
        at = *state;
        flexure_axis_online_f32_motion_displacement(target, at.z);
        flexure_axis_online_f32_motion_state(target, at.x);
        broken = flexure_axis_online_f32_motion_broken(&at);
        if (broken == 0U) {
            status = flexure_axis_online_f32_motion_drives(&at, state, target, out);
            *state = at;
        } else {
            status = broken | flexure_axis_online_f32_settle(state, target, out);
        }
    }
    return status;
}

/* Nothing is known of the device but that its drives were within their limits. */
static void flexure_axis_online_f32_set_unknown(flexure_axis_online_f32_state *state)
{
    static const float HOME[1] = { 0.0f }; /* SI */
    int i;
    for (i = 0; i < 1; i++) {
        state->x[i] = HOME[i];
    }
    for (i = 0; i < 1; i++) {
        state->z[i] = 0.0f;
    }
    flexure_axis_online_f32_set_still(state, state->ahead);
    state->ringing = 42835.184f;
}

uint32_t flexure_axis_online_f32_forget(flexure_axis_online_f32_state *state)
{
    uint32_t status = FLEXURE_AXIS_ONLINE_F32_INPUT;
    if (state == NULL) {
        /* nothing is written */
    } else if (state->ready != FLEXURE_AXIS_ONLINE_F32_BUILD) {
        status = FLEXURE_AXIS_ONLINE_F32_LOST;
    } else {
        flexure_axis_online_f32_set_unknown(state);
        status = FLEXURE_AXIS_ONLINE_F32_UNSURE;
    }
    return status;
}

/* 1 if the state can be corrected; one that is lost stays so. */
static int flexure_axis_online_f32_can_be_corrected(flexure_axis_online_f32_state *state)
{
    if ((state->ready != FLEXURE_AXIS_ONLINE_F32_BUILD) || (flexure_axis_online_f32_is_lost(state) != 0)) {
        state->ready = 0U;
    }
    return (state->ready != 0U) ? 1 : 0;
}

/* What is left of a ringing after so many samples: DECAY to their power, by squares. */
static float flexure_axis_online_f32_left_after(float ringing, uint32_t ticks)
{
    float left = ringing;
    float power = 0.99918395f;
    uint32_t rest = ticks;
    int k;
    for (k = 0; k < 32; k++) {
        if ((rest & 1U) != 0U) {
            left = left * power;
        }
        power = power * power;
        rest >>= 1U;
    }
    return left;
}

uint32_t flexure_axis_online_f32_elapsed(flexure_axis_online_f32_state *state, uint32_t ticks, const float drive[1])
{
    uint32_t status = FLEXURE_AXIS_ONLINE_F32_INPUT;
    if ((state == NULL) || (drive == NULL)) {
        /* nothing is written */
    } else if (flexure_axis_online_f32_can_be_corrected(state) == 0) {
        status = FLEXURE_AXIS_ONLINE_F32_LOST;
    } else if (flexure_axis_online_f32_drive_inside(drive) != 0) {
        if (ticks > 0U) { /* it rings about the equilibrium under this drive */
            int k;
            for (k = 0; k < 3; k++) {
                flexure_axis_online_f32_wanted_advance(state->x);
                flexure_axis_online_f32_balance_displacement(state->x, state->z, drive, state->z);
            }
            if (flexure_axis_online_f32_is_lost(state) != 0) { /* far beyond its range */
                flexure_axis_online_f32_set_unknown(state);
            } else {
                float still[2];
                flexure_axis_online_f32_set_still(state, still);
                state->ringing = flexure_axis_online_f32_bounded(state->ringing + flexure_axis_online_f32_added(state, still, 0.0f), still);
                state->ringing = flexure_axis_online_f32_bounded(flexure_axis_online_f32_left_after(state->ringing, ticks), still);
                for (k = 0; k < 2; k++) {
                    state->ahead[k] = still[k];
                }
            }
        }
        state->tick += ticks; /* told, and not to be made up for again */
        status = flexure_axis_online_f32_is_ringing(state, 0.0f);
    } else {
        status = FLEXURE_AXIS_ONLINE_F32_INPUT; /* no drive that was held */
    }
    return status;
}

/* 1 if an error is one: a number of zero or more that is not absurd. */
static int flexure_axis_online_f32_is_error(const float error[], int count)
{
    int is = 1;
    int i;
    for (i = 0; i < count; i++) {
        if ((flexure_axis_online_f32_is_nan(&error[i]) != 0) || (error[i] < 0.0f) || (error[i] > 1e+18f)) {
            is = 0;
        }
    }
    return is;
}

uint32_t flexure_axis_online_f32_observe(flexure_axis_online_f32_state *state, const float x[1], const float z[1], const float x_error[1], const float z_error[1])
{
    static const float REACH[2] = { 1.1658612f, 1.0022123f }; /* of what is told */
    uint32_t status = FLEXURE_AXIS_ONLINE_F32_INPUT;
    if ((state == NULL) || (x == NULL) || (z == NULL) || (x_error == NULL) || (z_error == NULL)) {
        /* nothing is written */
    } else if (flexure_axis_online_f32_can_be_corrected(state) == 0) {
        status = FLEXURE_AXIS_ONLINE_F32_LOST;
    } else {
        flexure_axis_online_f32_state seen;
        flexure_axis_online_f32_state off;
        int i;
        seen = *state;
        off = *state;
        for (i = 0; i < 1; i++) {
            seen.x[i] = x[i];
            off.x[i] = x_error[i];
        }
        for (i = 0; i < 1; i++) {
            seen.z[i] = z[i];
            off.z[i] = z_error[i];
        }
        if ((flexure_axis_online_f32_is_lost(&seen) == 0) && (flexure_axis_online_f32_is_error(x_error, 1) != 0) && (flexure_axis_online_f32_is_error(z_error, 1) != 0)) {
            float measured[2];
            float error[2];
            float size = 0.0f;
            int apart = 0;
            flexure_axis_online_f32_set_still(&seen, measured);
            flexure_axis_online_f32_set_still(&off, error);
            for (i = 0; i < 2; i++) {
                const float away = flexure_axis_online_f32_magnitude(measured[i] - state->ahead[i]);
                size += away + error[i];
                if (away > (error[i] + (REACH[i] * (state->ringing + 1.0f)))) {
                    apart = 1;
                }
            }
            if ((apart != 0) || (size < state->ringing)) {
                state->ringing = size;
            }
            status = flexure_axis_online_f32_is_ringing(state, 0.0f);
        }
    }
    return status;
}

/* The answer where no sample has passed: state and out stay as they are. An out without drives that can have been held is not that of the
 * last call, and no drive for the hardware. */
static uint32_t flexure_axis_online_f32_wait_for_sample(flexure_axis_online_f32_state *state, flexure_axis_online_f32_output *out)
{
    uint32_t status;
    if (flexure_axis_online_f32_drive_inside(out->drive) != 0) {
        status = flexure_axis_online_f32_is_ringing(state, 0.0f);
    } else {
        flexure_axis_online_f32_set_safe(out);
        status = flexure_axis_online_f32_forget(state);
    }
    return status;
}

uint32_t flexure_axis_online_f32_step_at(flexure_axis_online_f32_state *state, uint32_t tick, const float target[3], flexure_axis_online_f32_output *out)
{
    uint32_t status = 0U;
    uint32_t since = 1U;
    if ((state != NULL) && (out != NULL) && (state->ready == FLEXURE_AXIS_ONLINE_F32_BUILD)) {
        since = (state->ticking != 0U) ? (tick - state->tick) : 1U;
        if (since != 1U) {
            status = FLEXURE_AXIS_ONLINE_F32_CLOCK;
        }
        if ((since > 1U) && ((since >= 2147483648U) || (flexure_axis_online_f32_elapsed(state, since - 1U, out->drive) == FLEXURE_AXIS_ONLINE_F32_INPUT))) {
            (void)flexure_axis_online_f32_forget(state);
        }
        state->ticking = 1U;
        if (since != 0U) {
            state->tick = tick - 1U; /* and one more, as every sample */
        }
    }
    if (since != 0U) {
        status |= flexure_axis_online_f32_step(state, target, out);
    } else {
        status |= flexure_axis_online_f32_wait_for_sample(state, out);
    }
    return status;
}

