/* three_stacks_online_f32: see three_stacks_online_f32.h. Made by ctrlgen 0.1.0; do not edit. */
#include "three_stacks_online_f32.h"

#include <stddef.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ > 0)) || defined(_M_FP_FAST)
#error "compile this without -ffast-math, -Ofast, -ffinite-math-only or /fp:fast: they remove the checks for NaN"
#endif

static const float THREE_STACKS_ONLINE_F32_U_LOW[3] = { -100.0f, 0.0f, -20.0f }; /* V */
static const float THREE_STACKS_ONLINE_F32_U_HIGH[3] = { 100.0f, 150.0f, 130.0f }; /* V */
static const float THREE_STACKS_ONLINE_F32_U_SLACK[3] = { 0.0010786516f, 0.00015730337f, 0.00092134834f }; /* V */
static const float THREE_STACKS_ONLINE_F32_U_LEAST[3] = { -100.001076f, -0.00015730337f, -20.000921f }; /* admissible, V */
static const float THREE_STACKS_ONLINE_F32_U_MOST[3] = { 100.001076f, 150.00015f, 130.00092f }; /* admissible, V */
static const float THREE_STACKS_ONLINE_F32_U_SAFE[3] = { 0.0f, 0.0f, 0.0f }; /* V */
static const float THREE_STACKS_ONLINE_F32_FALL[3] = { -5.0f, -1e+18f, -1e+18f }; /* V a sample */
static const float THREE_STACKS_ONLINE_F32_RISE[3] = { 5.0f, 1e+18f, 1e+18f }; /* V a sample */

/* The bits of a number in memory. Whether a number is one, and how large, is asked of these: a compiler that is told that no number is NaN
 * may leave comparisons of numbers out, never those of integers. */
static uint32_t three_stacks_online_f32_bits_of(const float *number)
{
    union { float number; uint32_t bits; } v;
    v.number = *number;
    return v.bits;
}

/* The bits of a number so that they are ordered as numbers are, the negative ones too. */
static uint32_t three_stacks_online_f32_ordered(uint32_t bits)
{
    return ((bits & 0x80000000U) != 0U) ? ~bits : (bits | 0x80000000U);
}

/* 1 if a number in memory is NaN. */
static int three_stacks_online_f32_is_nan(const float *number)
{
    return ((three_stacks_online_f32_bits_of(number) & 0x7FFFFFFFU) > 0x7F800000U) ? 1 : 0;
}

/* Displacement at which the platform pose is `target`, x [m], y [m]. */
static void three_stacks_online_f32_wanted_displacement(const float target[2], float result[2])
{
    result[0] = target[0];
    result[1] = target[1];
}

/* Drive that keeps the displacement `wanted` at rest. */
static void three_stacks_online_f32_wanted_drive(const float wanted[2], float result[3])
{
    const float shared1 = (1e+06f * wanted[0]) + (1e+13f * (wanted[0] * (wanted[0] * wanted[0])));
    const float shared2 = (1e+06f * wanted[1]) + (1e+13f * (wanted[1] * (wanted[1] * wanted[1])));
    const float shared3 = (0.00056179776f * shared1) + (0.00011235955f * shared2);
    const float shared4 = (0.00011235955f * shared1) + (0.0009113608f * shared2);
    result[0] = 8000.0f * shared3;
    result[1] = (2250.0f * shared3) - (2250.0f * shared4);
    result[2] = 4500.0f * shared4;
}

/* Displacement at which the forces balance, g(x, z, drive) = 0: 6 Newton steps z - g/(dg/dz) from z. */
static void three_stacks_online_f32_balance_displacement_step(const float z[2], const float drive[3], float result[2])
{
    const float shared1 = 0.5f * drive[1];
    const float t1 = z[0] * z[0];
    const float t2 = (1e+06f * z[0]) + (1e+13f * (z[0] * t1));
    const float t3 = 1e+06f + (1e+13f * (t1 + (2.0f * t1)));
    const float t4 = ((0.2f * (drive[0] + shared1)) - t2) / t3;
    result[0] = z[0] + t4;
    const float t5 = z[1] * z[1];
    const float t6 = (1e+06f * z[1]) + (1e+13f * (z[1] * t5));
    const float t7 = 1e+06f + (1e+13f * (t5 + (2.0f * t5)));
    const float t8 = ((0.2f * (drive[2] - shared1)) - t6) / t7;
    result[1] = z[1] + t8;
}

/* 6 such steps. */
static void three_stacks_online_f32_balance_displacement(const float z[2], const float drive[3], float result[2])
{
    int i;
    int step;
    for (i = 0; i < 2; i++) {
        result[i] = z[i];
    }
    for (step = 0; step < 6; step++) {
        three_stacks_online_f32_balance_displacement_step(result, drive, result);
    }
}

/* 1 if every displacement is inside its limits; 0 for NaN. */
static int three_stacks_online_f32_displacement_inside(const float value[2])
{
    return (((three_stacks_online_f32_bits_of(&value[0]) & 0x7FFFFFFFU) <= 0x3851B717U) /* 5e-05f */ &&
        ((three_stacks_online_f32_bits_of(&value[1]) & 0x7FFFFFFFU) <= 0x3851B717U) /* 5e-05f */) ? 1 : 0;
}

/* 1 if every drive is inside its limits; 0 for NaN. */
static int three_stacks_online_f32_drive_inside(const float value[3])
{
    return (((three_stacks_online_f32_bits_of(&value[0]) & 0x7FFFFFFFU) <= 0x42C80000U) /* 100.0f */ &&
        (three_stacks_online_f32_bits_of(&value[1]) <= 0x43160000U) /* 150.0f */ &&
        ((three_stacks_online_f32_ordered(three_stacks_online_f32_bits_of(&value[2])) - 0x3E5FFFFFU) <= 0x84A20001U) /* -20.0f ... 130.0f */) ? 1 : 0;
}

/* 1 if every component is a number of a plausible size. */
static int three_stacks_online_f32_is_usable(const float target[2])
{
    return (((three_stacks_online_f32_bits_of(&target[0]) & 0x7FFFFFFFU) <= 0x40A00000U) /* 5.0f */ &&
        ((three_stacks_online_f32_bits_of(&target[1]) & 0x7FFFFFFFU) <= 0x40A00000U) /* 5.0f */) ? 1 : 0;
}

/* 1 if a number of the state is NaN, infinite or far beyond its range: 4 times the largest magnitude of it. Asked first where
 * displacements depend on the state or effects remember, else where a limit is met: until then it would show in the drives, or is
 * written anew. */
static int three_stacks_online_f32_is_lost(const three_stacks_online_f32_state *state)
{
    return (((three_stacks_online_f32_bits_of(&state->z[0]) & 0x7FFFFFFFU) <= 0x3951B717U) /* 0.0002f */ &&
        ((three_stacks_online_f32_bits_of(&state->z[1]) & 0x7FFFFFFFU) <= 0x3951B717U) /* 0.0002f */ &&
        ((three_stacks_online_f32_bits_of(&state->u[0]) & 0x7FFFFFFFU) <= 0x43C80000U) /* 400.0f */ &&
        ((three_stacks_online_f32_bits_of(&state->u[1]) & 0x7FFFFFFFU) <= 0x44160000U) /* 600.0f */ &&
        ((three_stacks_online_f32_bits_of(&state->u[2]) & 0x7FFFFFFFU) <= 0x44020000U) /* 520.0f */) ? 0 : 1;
}

/* Clips value to low ... high; 1 if a component changed by more than its slack or was NaN. */
static int three_stacks_online_f32_limit_all(float value[], const float low[], const float high[], const float slack[], int count)
{
    int hit = 0;
    int i;
    for (i = 0; i < count; i++) {
        if (three_stacks_online_f32_is_nan(&value[i]) != 0) {
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
static int three_stacks_online_f32_limit_displacement(float value[2])
{
    static const float LOW[2] = { -5e-05f, -5e-05f }; /* m */
    static const float HIGH[2] = { 5e-05f, 5e-05f }; /* m */
    static const float SLACK[2] = { 2e-10f, 2e-10f }; /* m */
    return three_stacks_online_f32_limit_all(value, LOW, HIGH, SLACK, 2);
}

/* 1 if every drive is within its limits or beyond by no more than the slack. */
static int three_stacks_online_f32_drives_admissible(const three_stacks_online_f32_state *state, const float drive[3])
{
    int admissible = 1;
    int i;
    (void)state;
    for (i = 0; i < 3; i++) {
        if ((three_stacks_online_f32_is_nan(&drive[i]) != 0) || (drive[i] > THREE_STACKS_ONLINE_F32_U_MOST[i]) || (drive[i] < THREE_STACKS_ONLINE_F32_U_LEAST[i])) {
            admissible = 0;
        }
    }
    return admissible;
}

/* Goes from the last drives toward drive by the largest common share that every rate allows: 0 untouched, 1 changed, 2 by more than the
 * slack. */
static int three_stacks_online_f32_limit_rate(const three_stacks_online_f32_state *state, float drive[3], float *share)
{
    float least = 1.0f;
    int changed = 0;
    int beyond = 0;
    int i;
    for (i = 0; i < 3; i++) {
        const float change = drive[i] - state->u[i];
        if ((three_stacks_online_f32_is_nan(&state->u[i]) != 0) || (change > THREE_STACKS_ONLINE_F32_RISE[i]) || (change < THREE_STACKS_ONLINE_F32_FALL[i])) {
            const float reached = ((change > 0.0f) ? THREE_STACKS_ONLINE_F32_RISE[i] : THREE_STACKS_ONLINE_F32_FALL[i]) / change;
            changed = 1;
            least = (reached < least) ? reached : least;
            if ((change > (THREE_STACKS_ONLINE_F32_RISE[i] + THREE_STACKS_ONLINE_F32_U_SLACK[i])) || (change < (THREE_STACKS_ONLINE_F32_FALL[i] - THREE_STACKS_ONLINE_F32_U_SLACK[i]))) {
                beyond = 1;
            }
        }
    }
    if (changed != 0) {
        for (i = 0; i < 3; i++) {
            drive[i] = state->u[i] + (least * (drive[i] - state->u[i]));
        }
        (void)three_stacks_online_f32_limit_all(drive, THREE_STACKS_ONLINE_F32_U_LOW, THREE_STACKS_ONLINE_F32_U_HIGH, THREE_STACKS_ONLINE_F32_U_SLACK, 3);
    }
    *share = least;
    return changed + beyond;
}

/* The number nearest to t of those by which the drives of a set may move along the null space to be in low ... high. */
static float three_stacks_online_f32_moved_into(float t, const float drive[3], const float low[3], const float high[3], const int set[], int count)
{
    static const float SHARE[3] = { -2.0f, 1.0f, 2.0f }; /* 1 over NULL_MOTION */
    float least = -1e+18f;
    float most = 1e+18f;
    float raised;
    int k;
    for (k = 0; k < count; k++) {
        const int i = set[k];
        const float to_low = (low[i] - drive[i]) * SHARE[i];
        const float to_high = (high[i] - drive[i]) * SHARE[i];
        const float first = (to_high < to_low) ? to_high : to_low;
        const float last = (to_high > to_low) ? to_high : to_low;
        least = (first > least) ? first : least;
        most = (last < most) ? last : most;
    }
    raised = (t < least) ? least : t;
    return (raised > most) ? most : raised;
}

/* Of all drives that push as drive, the weighted pseudo-inverse, those of least effort within their limits, and as far as these allow
 * within their rates: u + t w with the smallest |t|, B w = 0. Where there are none, they are beyond a limit. */
static void three_stacks_online_f32_choose_drives(const three_stacks_online_f32_state *state, float drive[3])
{
    static const float NULL_MOTION[3] = { -0.5f, 1.0f, 0.5f }; /* w */
    static const int SET[] = { 0, 1, 2 }; /* drives of each group, one group after the other */
    static const int FIRST[] = { 0, 3 };
    float free[3];
    float slowest[3];
    float fastest[3];
    int kept = three_stacks_online_f32_drive_inside(drive);
    int i;
    (void)state;
    for (i = 0; i < 3; i++) {
        free[i] = drive[i];
        slowest[i] = state->u[i] + THREE_STACKS_ONLINE_F32_FALL[i];
        fastest[i] = state->u[i] + THREE_STACKS_ONLINE_F32_RISE[i];
        if (!((drive[i] >= slowest[i]) && (drive[i] <= fastest[i]))) {
            kept = 0;
        }
    }
    if (kept == 0) {
        int group;
        for (group = 0; group < 1; group++) {
            const int first = FIRST[group];
            const int count = FIRST[group + 1] - first;
            float t = 0.0f;
            t = three_stacks_online_f32_moved_into(t, free, slowest, fastest, &SET[first], count);
            t = three_stacks_online_f32_moved_into(t, free, THREE_STACKS_ONLINE_F32_U_LOW, THREE_STACKS_ONLINE_F32_U_HIGH, &SET[first], count);
            for (i = 0; i < count; i++) {
                const int k = SET[first + i];
                drive[k] = free[k] + (t * NULL_MOTION[k]);
            }
        }
    }
}

/* The limits beyond which the device is, led there by drives that may not change faster, as a status. */
static uint32_t three_stacks_online_f32_passed(const three_stacks_online_f32_state *state)
{
    float z[2];
    uint32_t status = 0U;
    int i;
    for (i = 0; i < 2; i++) {
        z[i] = state->z[i];
    }
    if (three_stacks_online_f32_limit_displacement(z) != 0) {
        status |= THREE_STACKS_ONLINE_F32_DISPLACEMENT;
    }
    return status;
}

/* Actuator state (limited) and drives (not limited) that out->displacement needs: with settling at rest, else at the next sample. */
static void three_stacks_online_f32_wanted_drives(const three_stacks_online_f32_state *state, int settling, three_stacks_online_f32_output *out)
{
    (void)state;
    (void)settling;
    three_stacks_online_f32_wanted_drive(out->displacement, out->drive);
    three_stacks_online_f32_choose_drives(state, out->drive);
}

/* Line search from origin toward out->displacement, whose drives are inadmissible: secants of the drive that is first
 * at its limit. Leaves the farthest admissible displacement found and its drives; 1 if even those of origin are inadmissible. */
static int three_stacks_online_f32_line_search(const three_stacks_online_f32_state *state, int settling, const float origin[2], three_stacks_online_f32_output *out)
{
    float direction[2];
    float at_target[3];
    int i;
    for (i = 0; i < 2; i++) {
        direction[i] = out->displacement[i] - origin[i];
        out->displacement[i] = origin[i];
    }
    for (i = 0; i < 3; i++) {
        at_target[i] = out->drive[i];
    }
    three_stacks_online_f32_wanted_drives(state, settling, out);
    if (three_stacks_online_f32_drives_admissible(state, out->drive) != 0) {
        float at_start[3];
        float accepted = 0.0f;
        float rejected = 1.0f;
        int trial;
        at_start[0] = out->drive[0];
        at_start[1] = out->drive[1];
        at_start[2] = out->drive[2];
        for (trial = 0; trial < 3; trial++) {
            float share = 1.0f;
            float fraction;
            for (i = 0; i < 3; i++) {
                if ((at_target[i] > THREE_STACKS_ONLINE_F32_U_MOST[i]) || (at_target[i] < THREE_STACKS_ONLINE_F32_U_LEAST[i])) {
                    const float limit = (at_target[i] > THREE_STACKS_ONLINE_F32_U_HIGH[i]) ? THREE_STACKS_ONLINE_F32_U_HIGH[i] : THREE_STACKS_ONLINE_F32_U_LOW[i];
                    const float reached = (limit - at_start[i]) / (at_target[i] - at_start[i]);
                    share = (reached < share) ? reached : share;
                }
            }
            share = (share > 0.0f) ? share : 0.0f;
            fraction = accepted + ((0.99609375f * share) * (rejected - accepted));
            for (i = 0; i < 2; i++) {
                out->displacement[i] = origin[i] + (fraction * direction[i]);
            }
            three_stacks_online_f32_wanted_drives(state, settling, out);
            if (three_stacks_online_f32_drives_admissible(state, out->drive) != 0) {
                accepted = fraction;
                at_start[0] = out->drive[0];
                at_start[1] = out->drive[1];
                at_start[2] = out->drive[2];
            } else {
                rejected = fraction;
                for (i = 0; i < 3; i++) {
                    at_target[i] = out->drive[i];
                }
            }
        }
        for (i = 0; i < 2; i++) {
            out->displacement[i] = origin[i] + (accepted * direction[i]);
        }
        for (i = 0; i < 3; i++) {
            out->drive[i] = at_start[i];
        }
    }
    return three_stacks_online_f32_limit_all(out->drive, THREE_STACKS_ONLINE_F32_U_LOW, THREE_STACKS_ONLINE_F32_U_HIGH, THREE_STACKS_ONLINE_F32_U_SLACK, 3);
}

void three_stacks_online_f32_init_1000hz_47c3030e(three_stacks_online_f32_state *state)
{
    if (state != NULL) {
        int i;
        for (i = 0; i < 2; i++) {
            state->z[i] = 0.0f;
        }
        for (i = 0; i < 3; i++) {
            state->u[i] = THREE_STACKS_ONLINE_F32_U_SAFE[i];
        }
        state->ready = THREE_STACKS_ONLINE_F32_BUILD;
    }
}

/* What is answered where nothing is known of the device: the safe drive, under which it comes to rest. */
static void three_stacks_online_f32_set_safe(three_stacks_online_f32_output *out)
{
    int i;
    for (i = 0; i < 3; i++) {
        out->drive[i] = THREE_STACKS_ONLINE_F32_U_SAFE[i];
    }
    for (i = 0; i < 2; i++) {
        out->displacement[i] = 0.0f;
    }
}

/* The answer to a lost state, which stays lost until it is initialised. */
static uint32_t three_stacks_online_f32_set_lost(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    state->ready = 0U;
    three_stacks_online_f32_set_safe(out);
    return THREE_STACKS_ONLINE_F32_LOST;
}

/* Without a usable target: the safe drive, as fast as it may change, and the state that it leads to. */
static void three_stacks_online_f32_settle_safe(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    float share = 1.0f;
    int i;
    for (i = 0; i < 3; i++) {
        out->drive[i] = THREE_STACKS_ONLINE_F32_U_SAFE[i];
    }
    for (i = 0; i < 2; i++) {
        out->displacement[i] = state->z[i];
    }
    (void)three_stacks_online_f32_limit_rate(state, out->drive, &share);
    for (i = 0; i < 3; i++) {
        state->u[i] = out->drive[i];
    }
    three_stacks_online_f32_balance_displacement(out->displacement, out->drive, state->z);
}

/* Keeps the limits of drives that out->drive does not keep; limited is 1 then if the device does not come to out->displacement. */
static uint32_t three_stacks_online_f32_settle_limit_drives(const three_stacks_online_f32_state *state, three_stacks_online_f32_output *out, int *limited)
{
    static const float HOME[2] = { 0.0f, 0.0f };
    uint32_t status = 0U;
    if (three_stacks_online_f32_drives_admissible(state, out->drive) != 0) {
        (void)three_stacks_online_f32_limit_all(out->drive, THREE_STACKS_ONLINE_F32_U_LOW, THREE_STACKS_ONLINE_F32_U_HIGH, THREE_STACKS_ONLINE_F32_U_SLACK, 3);
    } else {
        *limited = three_stacks_online_f32_line_search(state, 1, HOME, out);
        status = THREE_STACKS_ONLINE_F32_DRIVE;
    }
    return status;
}

/* The state becomes that of the next sample; so do displacement and state of out, to which the device does not come where limited is 1. */
static void three_stacks_online_f32_settle_proceed(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out, int limited)
{
    if (limited != 0) {
        three_stacks_online_f32_balance_displacement(out->displacement, out->drive, out->displacement);
    }
    state->z[0] = out->displacement[0];
    state->z[1] = out->displacement[1];
    state->u[0] = out->drive[0];
    state->u[1] = out->drive[1];
    state->u[2] = out->drive[2];
}

/* Drives for out->displacement with every limit kept; the state becomes that of the next sample. */
static uint32_t three_stacks_online_f32_settle_within(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    uint32_t status = 0U;
    int limited = 0;
    int lost = 0;
    float share = 1.0f;
    int held = 0;
    three_stacks_online_f32_wanted_drive(out->displacement, out->drive);
    three_stacks_online_f32_choose_drives(state, out->drive);
    if (three_stacks_online_f32_drive_inside(out->drive) == 0) {
        if (three_stacks_online_f32_is_lost(state) != 0) {
            status = three_stacks_online_f32_set_lost(state, out);
            lost = 1;
        } else {
            status |= three_stacks_online_f32_settle_limit_drives(state, out, &limited);
        }
    }
    if (lost == 0) {
        held = three_stacks_online_f32_limit_rate(state, out->drive, &share);
        if ((held != 0) && (three_stacks_online_f32_is_lost(state) != 0)) {
            status = three_stacks_online_f32_set_lost(state, out);
            lost = 1;
            held = 0;
        }
    }
    if (held > 1) {
        int i;
        for (i = 0; i < 2; i++) {
            out->displacement[i] = state->z[i] + (share * (out->displacement[i] - state->z[i]));
        }
        limited = 1;
        status |= THREE_STACKS_ONLINE_F32_RATE;
    }
    if (lost == 0) {
        three_stacks_online_f32_settle_proceed(state, out, limited);
    }
    if (held > 1) {
        status |= three_stacks_online_f32_passed(state);
    }
    return status;
}

/* The same for out->displacement beyond its range. */
static uint32_t three_stacks_online_f32_settle_beyond(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    uint32_t status;
    int hit;
    hit = three_stacks_online_f32_limit_displacement(out->displacement);
    status = three_stacks_online_f32_settle_within(state, out);
    if ((hit != 0) && (status != THREE_STACKS_ONLINE_F32_LOST)) {
        status |= THREE_STACKS_ONLINE_F32_DISPLACEMENT;
    }
    return status;
}

/* The answer to a target that is no command, or to none. */
static uint32_t three_stacks_online_f32_settle_unusable(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    uint32_t status = THREE_STACKS_ONLINE_F32_INPUT;
    if (three_stacks_online_f32_is_lost(state) != 0) {
        status = three_stacks_online_f32_set_lost(state, out);
    } else {
        three_stacks_online_f32_settle_safe(state, out);
    }
    return status;
}

uint32_t three_stacks_online_f32_settle(three_stacks_online_f32_state *state, const float target[2], three_stacks_online_f32_output *out)
{
    uint32_t status = THREE_STACKS_ONLINE_F32_INPUT;
    if (out == NULL) {
        /* nothing is written */
    } else if (state == NULL) {
        three_stacks_online_f32_set_safe(out);
    } else if (state->ready != THREE_STACKS_ONLINE_F32_BUILD) {
        status = three_stacks_online_f32_set_lost(state, out);
    } else if (target == NULL) {
        status = three_stacks_online_f32_settle_unusable(state, out);
    } else { /* whether a target is a command is asked where it leads beyond the range alone: what is none, NaN too, does */
        three_stacks_online_f32_wanted_displacement(target, out->displacement);
        if (three_stacks_online_f32_displacement_inside(out->displacement) != 0) {
            status = three_stacks_online_f32_settle_within(state, out);
        } else if (three_stacks_online_f32_is_usable(target) != 0) {
            status = three_stacks_online_f32_settle_beyond(state, out);
        } else {
            status = three_stacks_online_f32_settle_unusable(state, out);
        }
    }
    return status;
}

/* Without a usable target: the safe drive, as fast as it may change, and the state that it leads to. */
static void three_stacks_online_f32_step_safe(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    float share = 1.0f;
    int i;
    for (i = 0; i < 3; i++) {
        out->drive[i] = THREE_STACKS_ONLINE_F32_U_SAFE[i];
    }
    for (i = 0; i < 2; i++) {
        out->displacement[i] = state->z[i];
    }
    (void)three_stacks_online_f32_limit_rate(state, out->drive, &share);
    for (i = 0; i < 3; i++) {
        state->u[i] = out->drive[i];
    }
    three_stacks_online_f32_balance_displacement(out->displacement, out->drive, state->z);
}

/* Keeps the limits of drives that out->drive does not keep; limited is 1 then if the device does not come to out->displacement. */
static uint32_t three_stacks_online_f32_step_limit_drives(const three_stacks_online_f32_state *state, three_stacks_online_f32_output *out, int *limited)
{
    uint32_t status = 0U;
    if (three_stacks_online_f32_drives_admissible(state, out->drive) != 0) {
        (void)three_stacks_online_f32_limit_all(out->drive, THREE_STACKS_ONLINE_F32_U_LOW, THREE_STACKS_ONLINE_F32_U_HIGH, THREE_STACKS_ONLINE_F32_U_SLACK, 3);
    } else {
        *limited = three_stacks_online_f32_line_search(state, 0, state->z, out);
        status = THREE_STACKS_ONLINE_F32_DRIVE;
    }
    return status;
}

/* The state becomes that of the next sample; so do displacement and state of out, to which the device does not come where limited is 1. */
static void three_stacks_online_f32_step_proceed(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out, int limited)
{
    if (limited != 0) {
        three_stacks_online_f32_balance_displacement(out->displacement, out->drive, out->displacement);
    }
    state->z[0] = out->displacement[0];
    state->z[1] = out->displacement[1];
    state->u[0] = out->drive[0];
    state->u[1] = out->drive[1];
    state->u[2] = out->drive[2];
}

/* Drives for out->displacement with every limit kept; the state becomes that of the next sample. */
static uint32_t three_stacks_online_f32_step_within(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    uint32_t status = 0U;
    int limited = 0;
    int lost = 0;
    float share = 1.0f;
    int held = 0;
    three_stacks_online_f32_wanted_drive(out->displacement, out->drive);
    three_stacks_online_f32_choose_drives(state, out->drive);
    if (three_stacks_online_f32_drive_inside(out->drive) == 0) {
        if (three_stacks_online_f32_is_lost(state) != 0) {
            status = three_stacks_online_f32_set_lost(state, out);
            lost = 1;
        } else {
            status |= three_stacks_online_f32_step_limit_drives(state, out, &limited);
        }
    }
    if (lost == 0) {
        held = three_stacks_online_f32_limit_rate(state, out->drive, &share);
        if ((held != 0) && (three_stacks_online_f32_is_lost(state) != 0)) {
            status = three_stacks_online_f32_set_lost(state, out);
            lost = 1;
            held = 0;
        }
    }
    if (held > 1) {
        int i;
        for (i = 0; i < 2; i++) {
            out->displacement[i] = state->z[i] + (share * (out->displacement[i] - state->z[i]));
        }
        limited = 1;
        status |= THREE_STACKS_ONLINE_F32_RATE;
    }
    if (lost == 0) {
        three_stacks_online_f32_step_proceed(state, out, limited);
    }
    if (held > 1) {
        status |= three_stacks_online_f32_passed(state);
    }
    return status;
}

/* The same for out->displacement beyond its range. */
static uint32_t three_stacks_online_f32_step_beyond(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    uint32_t status;
    int hit;
    hit = three_stacks_online_f32_limit_displacement(out->displacement);
    status = three_stacks_online_f32_step_within(state, out);
    if ((hit != 0) && (status != THREE_STACKS_ONLINE_F32_LOST)) {
        status |= THREE_STACKS_ONLINE_F32_DISPLACEMENT;
    }
    return status;
}

/* The answer to a target that is no command, or to none. */
static uint32_t three_stacks_online_f32_step_unusable(three_stacks_online_f32_state *state, three_stacks_online_f32_output *out)
{
    uint32_t status = THREE_STACKS_ONLINE_F32_INPUT;
    if (three_stacks_online_f32_is_lost(state) != 0) {
        status = three_stacks_online_f32_set_lost(state, out);
    } else {
        three_stacks_online_f32_step_safe(state, out);
    }
    return status;
}

uint32_t three_stacks_online_f32_step(three_stacks_online_f32_state *state, const float target[2], three_stacks_online_f32_output *out)
{
    uint32_t status = THREE_STACKS_ONLINE_F32_INPUT;
    if (out == NULL) {
        /* nothing is written */
    } else if (state == NULL) {
        three_stacks_online_f32_set_safe(out);
    } else if (state->ready != THREE_STACKS_ONLINE_F32_BUILD) {
        status = three_stacks_online_f32_set_lost(state, out);
    } else if (target == NULL) {
        status = three_stacks_online_f32_step_unusable(state, out);
    } else { /* whether a target is a command is asked where it leads beyond the range alone: what is none, NaN too, does */
        three_stacks_online_f32_wanted_displacement(target, out->displacement);
        if (three_stacks_online_f32_displacement_inside(out->displacement) != 0) {
            status = three_stacks_online_f32_step_within(state, out);
        } else if (three_stacks_online_f32_is_usable(target) != 0) {
            status = three_stacks_online_f32_step_beyond(state, out);
        } else {
            status = three_stacks_online_f32_step_unusable(state, out);
        }
    }
    return status;
}

