/* limiter: feedforward controller of NIST MEMS hexapod nanopositioner, computed online.
 *
 * Commanded platform pose -> heater powers, one call per sample at 1000 Hz.
 * No heap, no globals: the caller owns the state. All numbers are SI.
 *
 * target[6]  platform pose: theta_x [rad], theta_y [rad], theta_z [rad], delta_x [m], delta_y [m], delta_z [m]
 * drive[6]   heater power: 1X [W], 1Y [W], 2X [W], 2Y [W], 3X [W], 3Y [W]
 * displacement[6]: stage displacement [m] at the next sample (with status INPUT: the present one; LOST: zero)
 * state[6]   actuator temperature at the next sample: 1X [K], 1Y [K], 2X [K], 2Y [K], 3X [K], 3Y [K]
 *
 * Limits kept:
 *   0 W <= commanded heater power <= 1 W
 *   22 degC <= actuator temperature <= 550 degC
 *   0 N <= actuator force
 *   0 um <= stage displacement <= 55 um
 *   notch rotation <= 5 deg
 *   wire flexure stress <= 550 MPa
 *
 * Arithmetic operations of the physics per call: 198 while all limits hold, 2819 at most,
 * and 6276 more where limiter_step_at makes up for calls that were missed
 * (comparisons and the limiter's own arithmetic not counted). Arithmetic: float.
 * Physics: S1: Mech. Mach. Theory 80 (2014) 246-264, doi 10.1016/j.mechmachtheory.2014.05.004
 * Made by ctrlgen 0.1.0 from device 39f6d7972ef7d6f4 (sha256), whatever the trajectory. Do not edit.
 */
#ifndef LIMITER_H
#define LIMITER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* For _Static_assert(LIMITER_ABI == 5U, "..."): raised when code written for an older header must be changed. */
#define LIMITER_ABI (5U)
#define LIMITER_VERSION "0.1.0" /* of ctrlgen */
#define LIMITER_DEVICE_HASH (0x39f6d797U) /* the first 32 bits of the SHA-256 of the device's description */
#define LIMITER_RATE_HZ (1000U) /* samples a second */
#define LIMITER_BUILD (0x1714BF56U) /* of device, followed signal, rate, limits and arithmetic; the mark of an initialised state */
#define LIMITER_TARGET_SIZE (6U)
#define LIMITER_DRIVE_SIZE (6U)
#define LIMITER_DISPLACEMENT_SIZE (6U)
#define LIMITER_STATE_SIZE (6U) /* of the output; x of the state is what the model remembers */

/* Status: 0, or bits of these. The drive is within its limits in every case. */
#define LIMITER_DISPLACEMENT (1U) /* target beyond the displacement range: the nearest target inside was taken */
#define LIMITER_COMPOSITE (2U)    /* wire flexure stress: displacement scaled toward home */
#define LIMITER_DRIVE (8U)        /* heater power at its limit: the target is approached as far as one sample allows */
#define LIMITER_INPUT (16U)       /* NaN, infinite or absurdly large target, or NULL: drives at zero or the nearest admissible value. Without an output nothing is written, without a state the output alone */
#define LIMITER_LOST (32U)        /* the state was not initialised, is that of another build, or a number of it is NaN, infinite or absurd: drives as with INPUT, state kept, until limiter_init */
#define LIMITER_UNSURE (256U)     /* what is believed of the states may be wrong, and limits of the device be passed but for those of the drive: it settles, was called late, or was not known at the start. Clears itself */
#define LIMITER_CLOCK (512U)      /* of limiter_step_at: not one sample has passed since the last call */

#define LIMITER_SETTLING (71U) /* samples after which the states are those of the equilibrium under a held drive, to 1 millionth of their range: 0.071 s */
#define LIMITER_FOREVER (0xFFFFFFFFU) /* of state.unsure: not by waiting */

/* One a device, written by the functions here alone. They must not be called on it while another call on it is going on, by an interrupt or
 * another thread: neither settle, elapsed, forget nor observe beside step. Calls on different states may run at the same time. */
typedef struct {
    float x[6]; /* temperature_1X [K], temperature_1Y [K], temperature_2X [K], temperature_2Y [K], temperature_3X [K], temperature_3Y [K] */
    float z[LIMITER_DISPLACEMENT_SIZE]; /* displacement_1X, displacement_1Y, displacement_2X, displacement_2Y, displacement_3X, displacement_3Y [m] */
    uint32_t ready; /* LIMITER_BUILD once limiter_init was called */
    uint32_t unsure; /* samples until what is believed is known, or LIMITER_FOREVER */
    uint32_t ticking; /* 1 once limiter_step_at was called, at this; each sample since counts */
    uint32_t tick;
} limiter_state;

typedef struct {
    float drive[LIMITER_DRIVE_SIZE]; /* 1X [W], 1Y [W], 2X [W], 2Y [W], 3X [W], 3Y [W] */
    float displacement[LIMITER_DISPLACEMENT_SIZE]; /* m */
    float state[LIMITER_STATE_SIZE]; /* 1X [K], 1Y [K], 2X [K], 2Y [K], 3X [K], 3Y [K] */
} limiter_output;

/* What limiter_init calls. It is linked by a name of this build, rate and hash of device, signal and limits: a program that was
 * compiled with this header and is linked with another build of the same prefix is told so by the linker. */
void limiter_init_1000hz_1714bf56(limiter_state *state);

/* A cold device at rest. Also the way out of status LOST: hold the safe drive until the device has settled, then call it.
 * Behind a reset, a brown-out or a watchdog nobody knows whether it is: call limiter_forget then. */
static inline void limiter_init(limiter_state *state)
{
    limiter_init_1000hz_1714bf56(state);
}

/* Drive of the equilibrium at target; the state becomes that equilibrium. Hold the drive until the device has settled: LIMITER_SETTLING samples,
 * until which the status has UNSURE. Call it once a sample for so long, or limiter_elapsed with the samples that passed without a call. */
uint32_t limiter_settle(limiter_state *state, const float target[LIMITER_TARGET_SIZE], limiter_output *out);
/* Drive that brings the device to target at the next sample, held until then. Call once a sample. */
uint32_t limiter_step(limiter_state *state, const float target[LIMITER_TARGET_SIZE], limiter_output *out);

/* The target of the pose that a pivot has: another point of the body, stated by its place at home seen from the point of the target, in the axes
 * of the pose [m]. The body turns about it, and its displacement is that of the pivot: delta = delta_p - (R - I) pivot, exact for every rotation
 * vector up to a full turn. target may be pose. INPUT, and nothing is written: a pointer is NULL, or a number
 * NaN, infinite, absurdly large or an angle beyond a full turn. It takes no state; 99 operations. */
uint32_t limiter_about(const float pivot[3], const float pose[LIMITER_TARGET_SIZE], float target[LIMITER_TARGET_SIZE]);

/* Behind limiter_init where nothing is known of the device, as after a reset: it believes the states farthest from rest to which drives within
 * their limits can have led, so that a device that was heated is not heated beyond its limits. Status UNSURE, which clears itself in
 * 71 samples; LOST without limiter_init. */
uint32_t limiter_forget(limiter_state *state);
/* The actuator temperatures were measured at this moment, to within error, 1X [K], 1Y [K], 2X [K], 2Y [K], 3X [K], 3Y [K]; believed is the end that is farther from rest. What is known better stays; what contradicts
 * a state that was thought to be known makes it unknown, from there on. INPUT, and nothing changes: a number is NaN or farther than error
 * beyond what drives can lead to. Returns UNSURE as the next step will, or 0. */
uint32_t limiter_observe(limiter_state *state, const float measured[LIMITER_STATE_SIZE], float error);
/* So many samples passed without a call, under this drive: that of the last call, or zeros where the hardware took it away. Call it before
 * the next step: a step leads from where the device is at its call. 64 samples are followed one by one; after more the device is believed
 * settled, with UNSURE until it is. INPUT, and nothing changes: the drive is NULL or out of its limits. Returns UNSURE as the next step will, or 0. */
uint32_t limiter_elapsed(limiter_state *state, uint32_t ticks, const float drive[LIMITER_DRIVE_SIZE]);
/* Step at this tick of a clock that counts samples, whatever calls the program; it may wrap. out must still hold the last drive. CLOCK: samples
 * passed without a call, of which elapsed was not told and which are made up for as by it, or none passed: then drive and state stay as they
 * are, and UNSURE as it was. Every step and every settle in between counts as a sample. A clock that goes back leaves the state unknown,
 * as does one at which fewer samples passed than were stepped; and so does an out without a drive within its
 * limits, which is given the safe one. */
uint32_t limiter_step_at(limiter_state *state, uint32_t tick, const float target[LIMITER_TARGET_SIZE], limiter_output *out);
#ifdef __cplusplus
}
#endif

#else
#if (LIMITER_BUILD != 0x1714BF56U) /* the header that was read first is another one */
#error "two different headers are named limiter.h: give one of the controllers a name of its own, by controller = in its scenario.toml"
#endif
#endif
