/* What codegen/limiter is compiled with where it is compiled as it stands: the macros, tables and kernels of one device,
 * NIST MEMS hexapod nanopositioner. Made by ctrlgen 0.1.0; do not edit. */
#include "limiter.h"

#include <stddef.h>

typedef float real;

#define EACH_AXIS(F) F(0) \
    F(1) \
    F(2) \
    F(3) \
    F(4) \
    F(5)
#define EACH_STATE(F) F(0) \
    F(1) \
    F(2) \
    F(3) \
    F(4) \
    F(5)
#define EACH_DRIVE(F) F(0) \
    F(1) \
    F(2) \
    F(3) \
    F(4) \
    F(5)
#define REAL(x) x ## f
#define STATE_LIMITED 0
#define BOUNDED 0
#define DIRECT 1
#define BOUND_FIRST 1
#define RATED 0
#define PASSING 0
#define REDUNDANT 0
#define COUPLED 1
#define MOVING 1
#define MOTION 0
#define NY 0
#define PIVOTED 1
#define U_BOUNDS_ONCE 0
#define REST_GIVEN 0
#define CHANGING 0
#define DOUBLE 0
#define FILLED 0
#define ESTIMATED 1
#define REMEMBERING 0
#define RINGING 0
#define OBSERVED 0
#define VARIED 0
#define STATE_BY_MODE 0
#define DRIVE_BY_MODE 0
#define OWN_DRIVES 1
#define ADVANCE_BY_MODE 0
#define SETTLE_DRIVE_LIMITED 0
#define SETTLE_EXAMINED_FIRST 0
#define STEP_DRIVE_LIMITED 1
#define STEP_EXAMINED_FIRST 0
#define N 6
#define NU 6
#define NS 6
#define NX 6
#define M 6
#define SHARES 12
#define FEW 4
#define COMPOSITE_ROUNDS 1
#define SWEEPS 3
#define SECANT_STEPS 3
#define GROUPS 0
#define GIVEN 0
#define INIT limiter_init_1000hz_1714bf56
#define INIT_WITH limiter_init_with_1000hz_1714bf56
#define Z_LOW_TABLE { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }
#define Z_HIGH_TABLE { 5.5e-05f, 5.5e-05f, 5.5e-05f, 5.5e-05f, 5.5e-05f, 5.5e-05f }
#define Z_SLACK_TABLE { 4e-11f, 4e-11f, 4e-11f, 4e-11f, 4e-11f, 4e-11f }
#define S_LOW_TABLE { 295.15f, 295.15f, 295.15f, 295.15f, 295.15f, 295.15f }
#define S_HIGH_TABLE { 823.15f, 823.15f, 823.15f, 823.15f, 823.15f, 823.15f }
#define S_SLACK_TABLE { 0.0004f, 0.0004f, 0.0004f, 0.0004f, 0.0004f, 0.0004f }
#define U_LOW_TABLE { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }
#define U_HIGH_TABLE { 1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f }
#define U_SLACK_TABLE { 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f }
#define REST_TABLE { 295.15f, 295.15f, 295.15f, 295.15f, 295.15f, 295.15f }
#define HOME_TABLE { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }
#define COMPOSITE_SLACK 1.000004f
#define COMPOSITE_SLACK_SQUARED 1.000008f
#define SECANT_FRACTION 0.99609375f
#define REACH_FRACTION 0.99993896f
#define UNLIMITED 1e+18f
#define STATE_LOW LOW
#define STATE_HIGH HIGH
#define NEAREST_SWEEP value[0] = clipped(beyond[0] - ((1.1193434f * off[1]) - (0.2363756f * off[2]) - (0.16930602f * off[3]) - \
        (0.2363756f * off[4]) - (0.45906138f * off[5])), 0.0f, 5.5e-05f); \
    off[0] = value[0] - beyond[0]; \
    value[1] = clipped(beyond[1] - ((0.49971864f * off[0]) - (0.20494296f * off[2]) - (0.25956145f * off[3]) - \
        (0.07558483f * off[4]) - (0.25956145f * off[5])), 0.0f, 5.5e-05f); \
    off[1] = value[1] - beyond[1]; \
    value[2] = clipped(beyond[2] - (-(0.2363756f * off[0]) - (0.45906138f * off[1]) + (1.1193434f * off[3]) - \
        (0.2363756f * off[4]) - (0.16930602f * off[5])), 0.0f, 5.5e-05f); \
    off[2] = value[2] - beyond[2]; \
    value[3] = clipped(beyond[3] - (-(0.07558483f * off[0]) - (0.25956145f * off[1]) + (0.49971864f * off[2]) - \
        (0.20494296f * off[4]) - (0.25956145f * off[5])), 0.0f, 5.5e-05f); \
    off[3] = value[3] - beyond[3]; \
    value[4] = clipped(beyond[4] - (-(0.2363756f * off[0]) - (0.16930602f * off[1]) - (0.2363756f * off[2]) - \
        (0.45906138f * off[3]) + (1.1193434f * off[5])), 0.0f, 5.5e-05f); \
    off[4] = value[4] - beyond[4]; \
    value[5] = clipped(beyond[5] - (-(0.20494296f * off[0]) - (0.25956145f * off[1]) - (0.07558483f * off[2]) - \
        (0.25956145f * off[3]) + (0.49971864f * off[4])), 0.0f, 5.5e-05f); \
    off[5] = value[5] - beyond[5];
#define LIMITED_STATE STEP_STATE
#define LIMITED_DRIVE STEP_DRIVE
#define LIMITED_ADVANCE STEP_ADVANCE
#define LIMITED_FROM state->z
#define KNOWN_TABLE { 0.00055f, 0.00055f, 0.00055f, 0.00055f, 0.00055f, 0.00055f }
#define START_TABLE { 845.15f, 845.15f, 845.15f, 845.15f, 845.15f, 845.15f }
#define REACH_LOW_TABLE { 295.15f, 295.15f, 295.15f, 295.15f, 295.15f, 295.15f }
#define REACH_HIGH_TABLE { 845.15f, 845.15f, 845.15f, 845.15f, 845.15f, 845.15f }
#define KNOWN_STATE_TABLE { 0.00055f, 0.00055f, 0.00055f, 0.00055f, 0.00055f, 0.00055f }
#define SIDE_TABLE { 1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f }
#define UNKNOWN_TICKS 71U
#define HALVING_TICKS 4U
#define EXACT_TICKS 64
#define BACKWARD 2147483648U
#define SETTLING_SWEEPS 3
#define DOUBLED 32
#define GROWTH 3636.3635f
#define BALANCE(state, x, z, drive, result) balance_displacement(x, z, result)
#define REACHED(state, x, z, drive, result) reached_displacement(x, result)
#define OF_PIVOT(pose, pivot, result) of_pivot(pose, pivot, result)
#define FEW_COORDINATES(wanted, result) few_coordinates(wanted, result)
#define SHARES_OF_FEW(few, result) few_shares(few, result)
#define SETTLE_DISPLACEMENT(state, target, result) wanted_displacement(target, result)
#define SETTLE_STATE(state, wanted, result) wanted_state(wanted, result)
#define SETTLE_DRIVE(state, wanted, limited, result) wanted_drive(limited, result)
#define SETTLE_ADVANCE(state, z, drive, result) wanted_advance(drive, result)
#define STEP_DISPLACEMENT(state, target, result) wanted_displacement(target, result)
#define STEP_STATE(state, wanted, result) wanted_state(wanted, result)
#define STEP_DRIVE(state, wanted, limited, result) step_drive(state->x, limited, result)
#define STEP_ADVANCE(state, z, drive, result) step_advance(state->x, drive, result)
#define COMPOSITE_SHARES(state, wanted, result) used_shares(wanted, result)
#define TARGET_BOUND(target) target_bound(target)
#define STATE_INSIDE(state, value) state_inside(value)
#define DRIVE_INSIDE(state, value) drive_inside(value)

static const float U_LOW[6] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }; /* W */
static const float U_HIGH[6] = { 1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f }; /* W */
static const float U_SLACK[6] = { 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f }; /* W */
static const float U_SAFE[6] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }; /* W */
static const float X_REST[6] = { 295.15f, 295.15f, 295.15f, 295.15f, 295.15f, 295.15f }; /* temperature_1X [K], temperature_1Y [K], temperature_2X [K], temperature_2Y [K], temperature_3X [K], temperature_3Y [K] */

/* The bits of a number in memory. Whether a number is one, and how large, is asked of these: a compiler that is told that no number is NaN
 * may leave comparisons of numbers out, never those of integers. */
static uint32_t bits_of(const float *number)
{
    union { float number; uint32_t bits; } v;
    v.number = *number;
    return v.bits;
}

/* 1 if a number in memory is NaN. */
static int is_nan(const float *number)
{
    return ((bits_of(number) & 0x7FFFFFFFU) > 0x7F800000U) ? 1 : 0;
}

/* Square root as IEEE 754 has it: rounded correctly, not a number for a negative one. The core's own instruction where it has one, or
   the caller's CTRLGEN_SQRT(a), which must be rounded correctly too. Elsewhere, and with CTRLGEN_PORTABLE_SQRT, Newton steps and a
   correction of the last digit in integers, S being the digits of the root and R those of a less S squared: the same bits. */
static float square_root(float a)
{
    float y = a;
#if defined(CTRLGEN_SQRT)
    y = CTRLGEN_SQRT(a);
#elif defined(__GNUC__) && !defined(CTRLGEN_PORTABLE_SQRT) && defined(__ARM_FP) && !defined(__aarch64__) && ((__ARM_FP & 4) != 0) && !defined(__SOFTFP__)
    __asm__("vsqrt.f32 %0, %1" : "=t"(y) : "t"(a));
#elif defined(__GNUC__) && !defined(CTRLGEN_PORTABLE_SQRT) && defined(__aarch64__)
    __asm__("fsqrt %s0, %s1" : "=w"(y) : "w"(a));
#elif defined(__GNUC__) && !defined(CTRLGEN_PORTABLE_SQRT) && defined(__SSE2__)
    __asm__("sqrtss %1, %0" : "=x"(y) : "x"(a));
#else
    union { float number; uint32_t bits; } v;
    v.number = a;
    if ((a > 0.0f) && (v.bits < 0x7F800000U)) {
        const float up = (a < 1.1754944e-38f) ? 1.6777216e+07f : 1.0f; /* where there are fewer digits */
        const float h = 0.5f * (a * up);
        uint32_t exponent;
        uint32_t S;
        uint32_t R;
        v.number = a * up;
        exponent = ((v.bits >> 23U) + 127U) >> 1U;
        R = ((v.bits & 0x7FFFFFU) | 0x800000U) << ((24U) - ((uint32_t)(v.bits >> 23U) & 1U));
        v.bits = 0x5F3759DFU - (v.bits >> 1U);
        y = v.number;
        y = y * (1.5f - ((h * y) * y));
        y = y * (1.5f - ((h * y) * y));
        v.number = (a * up) * y;
        v.number = v.number + ((0.5f * y) * ((a * up) - (v.number * v.number)));
        S = (v.bits - (exponent << 23U)) + 0x800000U;
        R = R - (S * S);
        if (((S - R) & 0x80000000U) != 0U) {
            S = S + 1U;
        } else if (((R + S) == 0U) || (((R + S) & 0x80000000U) != 0U)) {
            S = S - 1U;
        } else {
            /* rounded correctly already */
        }
        v.bits = (exponent << 23U) + (S - 0x800000U);
        y = v.number * ((up > 1.0f) ? 0.00024414062f : 1.0f);
    } else if (a < 0.0f) {
        v.bits = 0x7FC00000U;
        y = v.number;
    } else {
        /* zero, infinity and what is not a number are their own roots */
    }
#endif
    return y;
}

/* (1 / (actuator.thermal_resistance / actuator.time_constant)) * (1 / actuator.time_constant) */
#define THERMAL_RESISTANCE_TIME_CONSTANT_1 (0.0018181818f)
#define AMBIENT (295.15f) /* actuator.ambient */
#define THERMAL_RESISTANCE (550.0f) /* actuator.thermal_resistance */
/* -(((exp(-(0.001 / actuator.time_constant)) - 1) * actuator.time_constant) / actuator.time_constant) */
#define TIME_CONSTANT_1 (0.18126924f)
/* (-1) / f(actuator.time_constant, actuator.thermal_resistance) */
#define TIME_CONSTANT_THERMAL_RESISTANCE_1 (0.010030283f)
#define LEVER_LONG_1 (1e-06f) /* stage.lever_long^2 */
#define LEVER_LONG (0.001f) /* stage.lever_long */
/* f(actuator, stage, stage.lever_long, stage.lever_short, stage.notch.theta_z_per_M_z) */
#define ACTUATOR_STAGE_1 (1895.5361f)
/* (((2 * (stage.lever_long / stage.lever_short)) * stage.half_stage_stiffness) / stage.lever_long) / stage.lever_long */
#define LEVER_LONG_LEVER_SHORT_1 (1.03154e+12f)
#define EXPANSION (3e-06f) /* actuator.expansion */
#define EXPANSION_SLOPE (3e-09f) /* actuator.expansion_slope */
/* sin(actuator.beam_angle) * (actuator.thickness * (actuator.beam_width * (actuator.young * 30))) */
#define BEAM_ANGLE_THICKNESS_1 (177.2821f)

/* Restoring force [N] of an axis: F = F^l + F^n [N] on the bar for a stage displacement `d` [m]. Source: S1 eq. (12).
 * F^l = (K^t_14 / r + r N / (c e_4^2)) d [N] on the actuator bar, `d` [m] the stage displacement. r = e_4/e_3 is the
 * lever ratio, N the number of notches, each rotating by d/e_4, and c = theta_z/M_z the rotational compliance of one.
 * Source: S1 eq. (9), referred to the bar by virtual work. F^n = 2 r k_a sin(phi) cos(phi) delta_y [N] on the bar,
 * sin(phi) = d/e_4, r = e_4/e_3. The axial stiffness k_a of one half stage, rotated by phi, resists the parasitic
 * shortening delta_y of eq. (10). Source: S1 eq. (11), with K^n the rotated axial stiffness. */
static inline float restoring_force(float z)
{
    const float t1 = z * z;
    const float t2 = square_root(LEVER_LONG_1 - t1);
    const float t3 = (z * t2) * (t1 / (LEVER_LONG + t2));
    return (ACTUATOR_STAGE_1 * z) + (LEVER_LONG_LEVER_SHORT_1 * t3);
}

/* Actuator force [N] of an axis: F = 2 n alpha(T) (T - T_amb) E w_1 h sin(theta) [N] on the actuator bar, `T` [K].
 * Source: S1 eq. (4), where T-bar is the average temperature above ambient. alpha(T) = alpha_0 + alpha_1 (T - 0 degC)
 * [1/K], `T` [K]. Source: S1 Table 1. */
static inline float actuator_force(float x)
{
    const float t1 = (EXPANSION + (EXPANSION_SLOPE * (x - 273.15f))) * (x - AMBIENT);
    return BEAM_ANGLE_THICKNESS_1 * t1;
}

/* Displacement at which the platform pose is `target`, theta_x [rad], theta_y [rad], theta_z [rad], delta_x [m],
 * delta_y [m], delta_z [m]. */
static void wanted_displacement(const float target[6], float result[6])
{
    const float target_0 = target[0];
    const float target_1 = target[1];
    const float target_2 = target[2];
    const float target_3 = target[3];
    const float target_4 = target[4];
    const float target_5 = target[5];
    result[0] = (0.0041873017f * target_2) + (0.64624566f * target_5) - (0.0026423377f * target_0) - (0.0037076124f *
        target_1) + target_3;
    result[1] = (-(0.002447848f * target_2)) + (1.1192472f * target_5) + (0.0006915413f * target_0) + (0.0026864675f *
        target_1) + target_4;
    result[2] = (0.0041873017f * target_2) + (0.64624566f * target_5) - (0.0018897178f * target_0) + (0.0041421377f *
        target_1) - (0.5f * target_3) - (0.8660254f * target_4);
    result[3] = (-(0.002447848f * target_2)) + (1.1192472f * target_5) + (0.0019807783f * target_0) - (0.0019421261f *
        target_1) + (0.8660254f * target_3) - (0.5f * target_4);
    result[4] = (0.0041873017f * target_2) + (0.64624566f * target_5) + (0.0045320555f * target_0) - (0.00043452534f *
        target_1) - (0.5f * target_3) + (0.8660254f * target_4);
    result[5] = (-(0.002447848f * target_2)) + (1.1192472f * target_5) - (0.0026723198f * target_0) - (0.00074434135f *
        target_1) - (0.8660254f * target_3) - (0.5f * target_4);
}

/* States that the displacement needs at rest: temperature_1X [K], temperature_1Y [K], temperature_2X [K],
 * temperature_2Y [K], temperature_3X [K], temperature_3Y [K]. By polynomials of degree 8, proved over the
 * displacement's range to be off by less than a change of the displacement by 5e-12 m. */
static void wanted_state(const float wanted[6], float result[6])
{
    int i;
    for (i = 0; i < 6; i++) {
        const float t1 = ((1.2613037e+31f - (4.833216e+34f * wanted[i])) * wanted[i]) - 1.2093228e+27f;
        const float t2 = (((t1 * wanted[i]) + 6.092703e+22f) * wanted[i]) - 6.985244e+18f;
        const float t3 = (((t2 * wanted[i]) + 1.0284698e+15f) * wanted[i]) - 1.1892917e+10f;
        result[i] = (((t3 * wanted[i]) + 3.4873372e+06f) * wanted[i]) + 295.15f;
    }
}

/* Heater power that keeps the actuator temperatures `state` at rest. */
static void wanted_drive(const float state[6], float result[6])
{
    result[0] = THERMAL_RESISTANCE_TIME_CONSTANT_1 * (state[0] - AMBIENT);
    result[1] = THERMAL_RESISTANCE_TIME_CONSTANT_1 * (state[1] - AMBIENT);
    result[2] = THERMAL_RESISTANCE_TIME_CONSTANT_1 * (state[2] - AMBIENT);
    result[3] = THERMAL_RESISTANCE_TIME_CONSTANT_1 * (state[3] - AMBIENT);
    result[4] = THERMAL_RESISTANCE_TIME_CONSTANT_1 * (state[4] - AMBIENT);
    result[5] = THERMAL_RESISTANCE_TIME_CONSTANT_1 * (state[5] - AMBIENT);
}

/* States under `drive`, at rest: temperature_1X [K], temperature_1Y [K], temperature_2X [K], temperature_2Y [K],
 * temperature_3X [K], temperature_3Y [K]. */
static void wanted_advance(const float drive[6], float result[6])
{
    int i;
    for (i = 0; i < 6; i++) {
        result[i] = AMBIENT + (THERMAL_RESISTANCE * drive[i]);
    }
}

/* Heater power that leads from x to the actuator temperatures `state` within one sample of 0.001 s. */
static void step_drive(const float x[6], const float state[6], float result[6])
{
    const float t1 = state[0] - (x[0] - (TIME_CONSTANT_1 * (x[0] - AMBIENT)));
    result[0] = TIME_CONSTANT_THERMAL_RESISTANCE_1 * t1;
    const float t2 = state[1] - (x[1] - (TIME_CONSTANT_1 * (x[1] - AMBIENT)));
    result[1] = TIME_CONSTANT_THERMAL_RESISTANCE_1 * t2;
    const float t3 = state[2] - (x[2] - (TIME_CONSTANT_1 * (x[2] - AMBIENT)));
    result[2] = TIME_CONSTANT_THERMAL_RESISTANCE_1 * t3;
    const float t4 = state[3] - (x[3] - (TIME_CONSTANT_1 * (x[3] - AMBIENT)));
    result[3] = TIME_CONSTANT_THERMAL_RESISTANCE_1 * t4;
    const float t5 = state[4] - (x[4] - (TIME_CONSTANT_1 * (x[4] - AMBIENT)));
    result[4] = TIME_CONSTANT_THERMAL_RESISTANCE_1 * t5;
    const float t6 = state[5] - (x[5] - (TIME_CONSTANT_1 * (x[5] - AMBIENT)));
    result[5] = TIME_CONSTANT_THERMAL_RESISTANCE_1 * t6;
}

/* States under `drive`, one sample of 0.001 s later: temperature_1X [K], temperature_1Y [K], temperature_2X [K],
 * temperature_2Y [K], temperature_3X [K], temperature_3Y [K]. */
static void step_advance(const float x[6], const float drive[6], float result[6])
{
    int i;
    for (i = 0; i < 6; i++) {
        const float t1 = TIME_CONSTANT_1 * ((THERMAL_RESISTANCE * drive[i]) - (x[i] - AMBIENT));
        result[i] = x[i] + t1;
    }
}

/* Displacement at which the forces balance, g(x, z, drive) = 0: 6 Newton steps z - g/(dg/dz) from z. */
static void balance_displacement(const float x[6], const float z[6], float result[6])
{
    int i;
    for (i = 0; i < 6; i++) {
        float value = z[i];
        int step;
        for (step = 0; step < 6; step++) {
            const float t1 = value * value;
            const float t2 = square_root(LEVER_LONG_1 - t1);
            const float t3 = LEVER_LONG + t2;
            const float t4 = t1 / t3;
            const float t5 = value / t2;
            const float t6 = (LEVER_LONG_LEVER_SHORT_1 * t2) - (LEVER_LONG_LEVER_SHORT_1 * (value * t5));
            const float t7 = (2.0f * (value / t3)) + ((t4 / t3) * t5);
            const float t8 = (t4 * t6) + (LEVER_LONG_LEVER_SHORT_1 * ((value * t2) * t7));
            const float t9 = (actuator_force(x[i]) - restoring_force(value)) / (ACTUATOR_STAGE_1 + t8);
            value = value + t9;
        }
        result[i] = value;
    }
}

/* Displacement at which the forces balance the states x, in its range. By polynomials of degree 14, proved to be off by
 * less than 1.4e-11 m. */
static void reached_displacement(const float x[6], float result[6])
{
    int i;
    for (i = 0; i < 6; i++) {
        const float t1 = (x[i] < 570.51404f) ? x[i] : 570.51404f;
        const float t2 = (0.007263112f * t1) - 3.1437075f;
        const float t3 = (((1.4363897e-07f * t2) - 1.470263e-07f) * t2) - 4.9233313e-07f;
        const float t4 = (((t3 * t2) + 6.4914235e-07f) * t2) + 3.3420187e-07f;
        const float t5 = (((t4 * t2) - 7.3694144e-07f) * t2) + 2.8842484e-07f;
        const float t6 = (((t5 * t2) - 3.107978e-07f) * t2) + 5.6502876e-07f;
        const float t7 = (((t6 * t2) - 2.7599822e-07f) * t2) - 6.6491344e-07f;
        const float t8 = (((t7 * t2) + 2.5708155e-06f) * t2) - 6.729473e-06f;
        result[i] = (((t8 * t2) + 2.5750805e-05f) * t2) + 3.4055425e-05f;
    }
}

/* As many coordinates of the displacement as these limits depend on. */
static void few_coordinates(const float wanted[6], float result[4])
{
    const float wanted_0 = wanted[0];
    const float wanted_1 = wanted[1];
    const float wanted_2 = wanted[2];
    const float wanted_3 = wanted[3];
    const float wanted_4 = wanted[4];
    const float wanted_5 = wanted[5];
    result[0] = wanted_0 + (0.5f * wanted_4) + (0.8660254f * wanted_5);
    result[1] = wanted_1 - (0.8660254f * wanted_4) + (0.5f * wanted_5);
    result[2] = wanted_2 + (0.5f * wanted_4) - (0.8660254f * wanted_5);
    result[3] = wanted_3 + (0.8660254f * wanted_4) + (0.5f * wanted_5);
}

/* The square of each wire flexure stress over its limit at displacement with these coordinates `few`. */
static void few_shares(const float few[4], float result[12])
{
    static const float TABLE_1[6][4] = {
        { 7.163396e+09f, -8.725365e+09f, -1.0396979e+10f, -4.441134e+09f },
        { 1.3912608e+09f, -1.1251239e+10f, -1.1180811e+10f, 1.8204311e+09f },
        { 2.0934612e+09f, 8.624482e+09f, 7.163396e+09f, -8.725365e+09f },
        { 6.4256225e+09f, 6.1723305e+09f, 1.3912608e+09f, -1.1251239e+10f },
        { -1.0396979e+10f, -4.441134e+09f, 2.0934612e+09f, 8.624482e+09f },
        { -1.1180811e+10f, 1.8204311e+09f, 6.4256225e+09f, 6.1723305e+09f }
    };
    static const float TABLE_2[6][4] = {
        { 1.1599883e+11f, 1.5950956e+11f, 7.835179e+11f, -1.2846023e+11f },
        { 5.0045413e+11f, -6.161432e+11f, -8.0449085e+10f, -1.7690893e+11f },
        { 2.0036921e+11f, -5.625638e+11f, 1.1599883e+11f, 1.5950956e+11f },
        { 5.9039056e+11f, 1.0655088e+11f, 5.0045413e+11f, -6.161432e+11f },
        { 7.835179e+11f, -1.2846023e+11f, 2.0036921e+11f, -5.625638e+11f },
        { -8.0449085e+10f, -1.7690893e+11f, 5.9039056e+11f, 1.0655088e+11f }
    };
    static const float TABLE_3[12][4] = {
        { -4.4585724e+12f, 1.102723e+12f, 1.3200545e+11f, 1.7759255e+12f },
        { 2.3661778e+12f, 2.4000602e+12f, 1.4819732e+12f, -1.1901199e+12f },
        { 1.4880515e+12f, 1.02434066e+12f, 3.1952187e+12f, -3.3340386e+12f },
        { -1.7746715e+12f, 6.861064e+11f, 8.951435e+11f, 3.2527894e+12f },
        { 1.0806304e+12f, 1.4966203e+12f, 3.0024456e+12f, -3.4103414e+12f },
        { -1.883654e+12f, 7.064584e+11f, 1.1220354e+12f, 3.5960072e+12f },
        { 9.697803e+11f, 1.4594866e+12f, -5.4737345e+11f, 2.2814135e+12f },
        { -3.9721988e+12f, 1.851032e+12f, 3.843818e+12f, -2.6561623e+12f },
        { 2.2969296e+12f, 6.93611e+11f, 7.789762e+11f, 1.5153417e+12f },
        { -4.2271263e+12f, 1.9982296e+12f, 3.5889726e+12f, -2.5090518e+12f },
        { -4.4247045e+12f, 8.9836945e+11f, 7.435699e+11f, 1.6559757e+12f },
        { 2.5495121e+12f, 2.7678878e+12f, 1.5541005e+12f, -1.2738329e+12f }
    };
    static const float TABLE_4[12][4] = {
        { 1.3734536e+11f, -3.5444797e+12f, -2.7926258e+12f, -1.9302325e+12f },
        { 3.50037e+12f, 6.7848587e+12f, 4.059425e+12f, -1.6124403e+12f },
        { 2.8585063e+11f, 3.333003e+12f, 3.0894944e+12f, 1.6695599e+12f },
        { 3.4239317e+12f, -2.704245e+12f, -4.1205613e+12f, -6.4245046e+12f },
        { 1.1551834e+12f, 2.0573224e+12f, 3.2989472e+12f, 1.4659148e+12f },
        { 3.1706516e+12f, -2.4079872e+12f, -4.07338e+12f, -6.234046e+12f },
        { 1.0833221e+12f, 2.1930641e+12f, -1.4129366e+12f, -2.6369178e+12f },
        { 3.8327186e+11f, -7.5461276e+11f, -3.1277734e+11f, 8.53514e+11f },
        { 1.5938316e+12f, 2.529548e+12f, -1.3767377e+12f, -2.0435721e+12f },
        { -8.9809656e+11f, -1.5306036e+11f, 8.487993e+11f, 4.6308487e+10f },
        { 4.1998467e+11f, -3.6188638e+12f, -1.2494657e+12f, -2.0487497e+12f },
        { 3.358615e+12f, 6.647834e+12f, 3.6755997e+12f, -1.5404901e+12f }
    };
    float shared1[6];
    float shared2[6];
    int i;
    const float few_0 = few[0];
    const float few_1 = few[1];
    const float few_2 = few[2];
    const float few_3 = few[3];
    for (i = 0; i < 6; i++) {
        const float t1 = (TABLE_1[i][0] * few_0) + (TABLE_1[i][1] * few_1) + (TABLE_1[i][2] * few_2) + (TABLE_1[i][3] *
            few_3);
        shared1[i] = (t1 < 0.0f) ? -t1 : t1;
    }
    for (i = 0; i < 6; i++) {
        const float t2 = (TABLE_2[i][0] * few_0) + (TABLE_2[i][1] * few_1) + (TABLE_2[i][2] * few_2) + (TABLE_2[i][3] *
            few_3);
        shared2[i] = 3.0f * (t2 * t2);
    }
    for (i = 0; i < 12; i++) {
        const float t3 = (TABLE_3[i][0] * few_0) + (TABLE_3[i][1] * few_1) + (TABLE_3[i][2] * few_2) + (TABLE_3[i][3] *
            few_3);
        const float t4 = (TABLE_4[i][0] * few_0) + (TABLE_4[i][1] * few_1) + (TABLE_4[i][2] * few_2) + (TABLE_4[i][3] *
            few_3);
        const float t5 = ((t3 * t3) + (t4 * t4)) + 0.3025f;
        const float t6 = square_root(t5) + shared1[i / 2];
        result[i] = 3.3057851e-18f * ((t6 * t6) + shared2[i / 2]);
    }
}

/* A cheap upper bound of the root of the largest of these shares at the displacement of a `target` that leads into the
 * range: no more than 1 means that every limit is kept. */
static float target_bound(const float target[6])
{
    const float t1 = 78.29389f * target[0];
    const float t2 = (t1 < 0.0f) ? -t1 : t1;
    const float t3 = 88.22619f * target[1];
    const float t4 = (t3 < 0.0f) ? -t3 : t3;
    const float t5 = 50.573242f * target[2];
    const float t6 = (t5 < 0.0f) ? -t5 : t5;
    const float t7 = 21314.357f * target[5];
    const float t8 = (t7 < 0.0f) ? -t7 : t7;
    return (((t2 + t4) + t6) + t8) + 1.0020003e-06f;
}

/* Pose of the stated point where `pose` is that of the `pivot`: delta = delta_p - (R - I) pivot, R the rotation by
 * theta. */
static void of_pivot(const float pose[6], const float pivot[3], float result[6])
{
    float next[6];
    int i;
    const float shared1 = ((pose[0] * pose[0]) + (pose[1] * pose[1])) + (pose[2] * pose[2]);
    const float shared2 = (pose[1] * pivot[2]) - (pose[2] * pivot[1]);
    const float shared3 = (pose[0] * pivot[1]) - (pose[1] * pivot[0]);
    const float shared4 = (pose[2] * pivot[0]) - (pose[0] * pivot[2]);
    const float shared5 = 0.25f * shared1;
    const float t1 = ((1.1309962e-31f - (3.0403125e-35f * shared1)) * shared5) - 9.18369e-29f;
    const float t2 = (((t1 * shared5) + 6.4469503e-26f) * shared5) - 3.8681703e-23f;
    const float t3 = (((t2 * shared5) + 1.9572942e-20f) * shared5) - 8.220635e-18f;
    const float t4 = (((t3 * shared5) + 2.8114574e-15f) * shared5) - 7.6471636e-13f;
    const float t5 = (((t4 * shared5) + 1.6059044e-10f) * shared5) - 2.5052108e-08f;
    const float t6 = (((t5 * shared5) + 2.7557319e-06f) * shared5) - 0.0001984127f;
    const float t7 = (((t6 * shared5) + 0.008333334f) * shared5) - 0.16666667f;
    const float shared6 = (t7 * shared5) + 1.0f;
    const float t8 = ((3.279889e-30f - (9.4249695e-34f * shared1)) * shared5) - 2.4795963e-27f;
    const float t9 = (((t8 * shared5) + 1.6117376e-24f) * shared5) - 8.896791e-22f;
    const float t10 = (((t9 * shared5) + 4.1103176e-19f) * shared5) - 1.5619207e-16f;
    const float t11 = (((t10 * shared5) + 4.7794773e-14f) * shared5) - 1.1470745e-11f;
    const float t12 = (((t11 * shared5) + 2.0876756e-09f) * shared5) - 2.755732e-07f;
    const float t13 = (((t12 * shared5) + 2.4801588e-05f) * shared5) - 0.0013888889f;
    const float t14 = (((t13 * shared5) + 0.041666668f) * shared5) - 0.5f;
    const float shared7 = shared6 * ((t14 * shared5) + 1.0f);
    const float shared8 = 0.5f * (shared6 * shared6);
    for (i = 0; i < 3; i++) {
        next[i] = pose[i];
    }
    const float t15 = shared8 * ((pose[1] * shared3) - (pose[2] * shared4));
    next[3] = pose[3] - ((shared7 * shared2) + t15);
    const float t16 = shared8 * ((pose[2] * shared2) - (pose[0] * shared3));
    next[4] = pose[4] - ((shared7 * shared4) + t16);
    const float t17 = shared8 * ((pose[0] * shared4) - (pose[1] * shared2));
    next[5] = pose[5] - ((shared7 * shared3) + t17);
    for (i = 0; i < 6; i++) {
        result[i] = next[i];
    }
}

/* 1 if every displacement is inside its limits; 0 for NaN. */
static int displacement_inside(const float value[6])
{
    return ((bits_of(&value[0]) <= 0x3866AFCDU) /* 5.5e-05f */ &&
        (bits_of(&value[1]) <= 0x3866AFCDU) /* 5.5e-05f */ &&
        (bits_of(&value[2]) <= 0x3866AFCDU) /* 5.5e-05f */ &&
        (bits_of(&value[3]) <= 0x3866AFCDU) /* 5.5e-05f */ &&
        (bits_of(&value[4]) <= 0x3866AFCDU) /* 5.5e-05f */ &&
        (bits_of(&value[5]) <= 0x3866AFCDU) /* 5.5e-05f */) ? 1 : 0;
}

/* 1 if every heater power is inside its limits; 0 for NaN. */
static int drive_inside(const float value[6])
{
    return ((bits_of(&value[0]) <= 0x3F800000U) /* 1.0f */ &&
        (bits_of(&value[1]) <= 0x3F800000U) /* 1.0f */ &&
        (bits_of(&value[2]) <= 0x3F800000U) /* 1.0f */ &&
        (bits_of(&value[3]) <= 0x3F800000U) /* 1.0f */ &&
        (bits_of(&value[4]) <= 0x3F800000U) /* 1.0f */ &&
        (bits_of(&value[5]) <= 0x3F800000U) /* 1.0f */) ? 1 : 0;
}

/* 1 if every component is a number of a plausible size. */
static int is_usable(const float target[6])
{
    return (((bits_of(&target[0]) & 0x7FFFFFFFU) <= 0x427E73F3U) /* 63.61323f */ &&
        ((bits_of(&target[1]) & 0x7FFFFFFFU) <= 0x427E73F3U) /* 63.61323f */ &&
        ((bits_of(&target[2]) & 0x7FFFFFFFU) <= 0x427E73F3U) /* 63.61323f */ &&
        ((bits_of(&target[3]) & 0x7FFFFFFFU) <= 0x3DCCCCCDU) /* 0.1f */ &&
        ((bits_of(&target[4]) & 0x7FFFFFFFU) <= 0x3DCCCCCDU) /* 0.1f */ &&
        ((bits_of(&target[5]) & 0x7FFFFFFFU) <= 0x3DCCCCCDU) /* 0.1f */) ? 1 : 0;
}

/* 1 if a pose and its pivot are numbers of a plausible size, and angles at most a full turn. */
static int can_turn(const float pose[6], const float pivot[3])
{
    return (((bits_of(&pose[0]) & 0x7FFFFFFFU) <= 0x40C90FDBU) /* 6.2831855f */ &&
        ((bits_of(&pose[1]) & 0x7FFFFFFFU) <= 0x40C90FDBU) /* 6.2831855f */ &&
        ((bits_of(&pose[2]) & 0x7FFFFFFFU) <= 0x40C90FDBU) /* 6.2831855f */ &&
        ((bits_of(&pose[3]) & 0x7FFFFFFFU) <= 0x3DCCCCCDU) /* 0.1f */ &&
        ((bits_of(&pose[4]) & 0x7FFFFFFFU) <= 0x3DCCCCCDU) /* 0.1f */ &&
        ((bits_of(&pose[5]) & 0x7FFFFFFFU) <= 0x3DCCCCCDU) /* 0.1f */ &&
        ((bits_of(&pivot[0]) & 0x7FFFFFFFU) <= 0x447A0000U) /* 1000.0f */ &&
        ((bits_of(&pivot[1]) & 0x7FFFFFFFU) <= 0x447A0000U) /* 1000.0f */ &&
        ((bits_of(&pivot[2]) & 0x7FFFFFFFU) <= 0x447A0000U) /* 1000.0f */) ? 1 : 0;
}

/* 1 if a number of the state is NaN, infinite or far beyond its range: 4 times the largest magnitude of it. Asked first where
 * displacements depend on the state or effects remember, else where a limit is met: until then it would show in the drives, or is
 * written anew. */
static int is_lost(const limiter_state *state)
{
    return (((bits_of(&state->x[0]) & 0x7FFFFFFFU) <= 0x454DC99AU) /* 3292.6f */ &&
        ((bits_of(&state->x[1]) & 0x7FFFFFFFU) <= 0x454DC99AU) /* 3292.6f */ &&
        ((bits_of(&state->x[2]) & 0x7FFFFFFFU) <= 0x454DC99AU) /* 3292.6f */ &&
        ((bits_of(&state->x[3]) & 0x7FFFFFFFU) <= 0x454DC99AU) /* 3292.6f */ &&
        ((bits_of(&state->x[4]) & 0x7FFFFFFFU) <= 0x454DC99AU) /* 3292.6f */ &&
        ((bits_of(&state->x[5]) & 0x7FFFFFFFU) <= 0x454DC99AU) /* 3292.6f */ &&
        ((bits_of(&state->z[0]) & 0x7FFFFFFFU) <= 0x3966AFCDU) /* 0.00022f */ &&
        ((bits_of(&state->z[1]) & 0x7FFFFFFFU) <= 0x3966AFCDU) /* 0.00022f */ &&
        ((bits_of(&state->z[2]) & 0x7FFFFFFFU) <= 0x3966AFCDU) /* 0.00022f */ &&
        ((bits_of(&state->z[3]) & 0x7FFFFFFFU) <= 0x3966AFCDU) /* 0.00022f */ &&
        ((bits_of(&state->z[4]) & 0x7FFFFFFFU) <= 0x3966AFCDU) /* 0.00022f */ &&
        ((bits_of(&state->z[5]) & 0x7FFFFFFFU) <= 0x3966AFCDU) /* 0.00022f */) ? 0 : 1;
}
