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
        const int unknown = flexure_axis_online_f32_is_nan(&value[i]);
        const float wanted = (unknown != 0) ? low[i] : value[i];
        const float raised = (wanted > low[i]) ? wanted : low[i];
        const float limited = (raised < high[i]) ? raised : high[i];
        const float moved = limited - wanted;
        if ((unknown != 0) || (moved > slack[i]) || (moved < -slack[i])) {
            hit = 1;
        }
        value[i] = limited;
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

void flexure_axis_online_f32_init_20000hz_6af76ef7(flexure_axis_online_f32_state *state)
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
    uint32_t status = 0U;
    int i;
    (void)state;
    flexure_axis_online_f32_motion_drive(target, out->drive);
    if (flexure_axis_online_f32_limit_all(out->drive, FLEXURE_AXIS_ONLINE_F32_U_LOW, FLEXURE_AXIS_ONLINE_F32_U_HIGH, FLEXURE_AXIS_ONLINE_F32_U_SLACK, 1) != 0) {
        status = FLEXURE_AXIS_ONLINE_F32_DRIVE;
    }
    for (i = 0; i < 1; i++) {
        out->displacement[i] = at->z[i];
    }
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
    } else {
        flexure_axis_online_f32_state at;
        uint32_t broken;
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

