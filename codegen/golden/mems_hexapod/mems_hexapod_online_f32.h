/* mems_hexapod_online_f32: feedforward controller of NIST MEMS hexapod nanopositioner, computed online.
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
 * and 6276 more where mems_hexapod_online_f32_step_at makes up for calls that were missed
 * (comparisons and the limiter's own arithmetic not counted). Arithmetic: float.
 * Physics: S1: Mech. Mach. Theory 80 (2014) 246-264, doi 10.1016/j.mechmachtheory.2014.05.004
 * Made by ctrlgen 0.1.0 from device 39f6d7972ef7d6f4 (sha256), whatever the trajectory. Do not edit.
 */
#ifndef MEMS_HEXAPOD_ONLINE_F32_H
#define MEMS_HEXAPOD_ONLINE_F32_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* For _Static_assert(MEMS_HEXAPOD_ONLINE_F32_ABI == 5U, "..."): raised when code written for an older header must be changed. */
#define MEMS_HEXAPOD_ONLINE_F32_ABI (5U)
#define MEMS_HEXAPOD_ONLINE_F32_VERSION "0.1.0" /* of ctrlgen */
#define MEMS_HEXAPOD_ONLINE_F32_DEVICE_HASH (0x39f6d797U) /* the first 32 bits of the SHA-256 of the device's description */
#define MEMS_HEXAPOD_ONLINE_F32_RATE_HZ (1000U) /* samples a second */
#define MEMS_HEXAPOD_ONLINE_F32_BUILD (0x1714BF56U) /* of device, followed signal, rate, limits and arithmetic; the mark of an initialised state */
#define MEMS_HEXAPOD_ONLINE_F32_TARGET_SIZE (6U)
#define MEMS_HEXAPOD_ONLINE_F32_DRIVE_SIZE (6U)
#define MEMS_HEXAPOD_ONLINE_F32_DISPLACEMENT_SIZE (6U)
#define MEMS_HEXAPOD_ONLINE_F32_STATE_SIZE (6U) /* of the output; x of the state is what the model remembers */

/* Status: 0, or bits of these. The drive is within its limits in every case. */
#define MEMS_HEXAPOD_ONLINE_F32_DISPLACEMENT (1U) /* target beyond the displacement range: the nearest target inside was taken */
#define MEMS_HEXAPOD_ONLINE_F32_COMPOSITE (2U)    /* wire flexure stress: displacement scaled toward home */
#define MEMS_HEXAPOD_ONLINE_F32_DRIVE (8U)        /* heater power at its limit: the target is approached as far as one sample allows */
#define MEMS_HEXAPOD_ONLINE_F32_INPUT (16U)       /* NaN, infinite or absurdly large target, or NULL: drives at zero or the nearest admissible value. Without an output nothing is written, without a state the output alone */
#define MEMS_HEXAPOD_ONLINE_F32_LOST (32U)        /* the state was not initialised, is that of another build, or a number of it is NaN, infinite or absurd: drives as with INPUT, state kept, until mems_hexapod_online_f32_init */
#define MEMS_HEXAPOD_ONLINE_F32_UNSURE (256U)     /* what is believed of the states may be wrong, and limits of the device be passed but for those of the drive: it settles, was called late, or was not known at the start. Clears itself */
#define MEMS_HEXAPOD_ONLINE_F32_CLOCK (512U)      /* of mems_hexapod_online_f32_step_at: not one sample has passed since the last call */

#define MEMS_HEXAPOD_ONLINE_F32_SETTLING (71U) /* samples after which the states are those of the equilibrium under a held drive, to 1 millionth of their range: 0.071 s */
#define MEMS_HEXAPOD_ONLINE_F32_FOREVER (0xFFFFFFFFU) /* of state.unsure: not by waiting */

/* One a device, written by the functions here alone. They must not be called on it while another call on it is going on, by an interrupt or
 * another thread: neither settle, elapsed, forget nor observe beside step. Calls on different states may run at the same time. */
typedef struct {
    float x[6]; /* temperature_1X [K], temperature_1Y [K], temperature_2X [K], temperature_2Y [K], temperature_3X [K], temperature_3Y [K] */
    float z[MEMS_HEXAPOD_ONLINE_F32_DISPLACEMENT_SIZE]; /* displacement_1X, displacement_1Y, displacement_2X, displacement_2Y, displacement_3X, displacement_3Y [m] */
    uint32_t ready; /* MEMS_HEXAPOD_ONLINE_F32_BUILD once mems_hexapod_online_f32_init was called */
    uint32_t unsure; /* samples until what is believed is known, or MEMS_HEXAPOD_ONLINE_F32_FOREVER */
    uint32_t ticking; /* 1 once mems_hexapod_online_f32_step_at was called, at this; each sample since counts */
    uint32_t tick;
} mems_hexapod_online_f32_state;

typedef struct {
    float drive[MEMS_HEXAPOD_ONLINE_F32_DRIVE_SIZE]; /* 1X [W], 1Y [W], 2X [W], 2Y [W], 3X [W], 3Y [W] */
    float displacement[MEMS_HEXAPOD_ONLINE_F32_DISPLACEMENT_SIZE]; /* m */
    float state[MEMS_HEXAPOD_ONLINE_F32_STATE_SIZE]; /* 1X [K], 1Y [K], 2X [K], 2Y [K], 3X [K], 3Y [K] */
} mems_hexapod_online_f32_output;

/* What mems_hexapod_online_f32_init calls. It is linked by a name of this build, rate and hash of device, signal and limits: a program that was
 * compiled with this header and is linked with another build of the same prefix is told so by the linker. */
void mems_hexapod_online_f32_init_1000hz_1714bf56(mems_hexapod_online_f32_state *state);

/* A cold device at rest. Also the way out of status LOST: hold the safe drive until the device has settled, then call it.
 * Behind a reset, a brown-out or a watchdog nobody knows whether it is: call mems_hexapod_online_f32_forget then. */
static inline void mems_hexapod_online_f32_init(mems_hexapod_online_f32_state *state)
{
    mems_hexapod_online_f32_init_1000hz_1714bf56(state);
}

/* Drive of the equilibrium at target; the state becomes that equilibrium. Hold the drive until the device has settled: MEMS_HEXAPOD_ONLINE_F32_SETTLING samples,
 * until which the status has UNSURE. Call it once a sample for so long, or mems_hexapod_online_f32_elapsed with the samples that passed without a call. */
uint32_t mems_hexapod_online_f32_settle(mems_hexapod_online_f32_state *state, const float target[MEMS_HEXAPOD_ONLINE_F32_TARGET_SIZE], mems_hexapod_online_f32_output *out);
/* Drive that brings the device to target at the next sample, held until then. Call once a sample. */
uint32_t mems_hexapod_online_f32_step(mems_hexapod_online_f32_state *state, const float target[MEMS_HEXAPOD_ONLINE_F32_TARGET_SIZE], mems_hexapod_online_f32_output *out);

/* The target of the pose that a pivot has: another point of the body, stated by its place at home seen from the point of the target, in the axes
 * of the pose [m]. The body turns about it, and its displacement is that of the pivot: delta = delta_p - (R - I) pivot, exact for every rotation
 * vector up to a full turn. target may be pose. INPUT, and nothing is written: a pointer is NULL, or a number
 * NaN, infinite, absurdly large or an angle beyond a full turn. It takes no state; 99 operations. */
uint32_t mems_hexapod_online_f32_about(const float pivot[3], const float pose[MEMS_HEXAPOD_ONLINE_F32_TARGET_SIZE], float target[MEMS_HEXAPOD_ONLINE_F32_TARGET_SIZE]);

/* Behind mems_hexapod_online_f32_init where nothing is known of the device, as after a reset: it believes the states farthest from rest to which drives within
 * their limits can have led, so that a device that was heated is not heated beyond its limits. Status UNSURE, which clears itself in
 * 71 samples; LOST without mems_hexapod_online_f32_init. */
uint32_t mems_hexapod_online_f32_forget(mems_hexapod_online_f32_state *state);
/* The actuator temperatures were measured at this moment, to within error, 1X [K], 1Y [K], 2X [K], 2Y [K], 3X [K], 3Y [K]; believed is the end that is farther from rest. What is known better stays; what contradicts
 * a state that was thought to be known makes it unknown, from there on. INPUT, and nothing changes: a number is NaN or farther than error
 * beyond what drives can lead to. Returns UNSURE as the next step will, or 0. */
uint32_t mems_hexapod_online_f32_observe(mems_hexapod_online_f32_state *state, const float measured[MEMS_HEXAPOD_ONLINE_F32_STATE_SIZE], float error);
/* So many samples passed without a call, under this drive: that of the last call, or zeros where the hardware took it away. Call it before
 * the next step: a step leads from where the device is at its call. 64 samples are followed one by one; after more the device is believed
 * settled, with UNSURE until it is. INPUT, and nothing changes: the drive is NULL or out of its limits. Returns UNSURE as the next step will, or 0. */
uint32_t mems_hexapod_online_f32_elapsed(mems_hexapod_online_f32_state *state, uint32_t ticks, const float drive[MEMS_HEXAPOD_ONLINE_F32_DRIVE_SIZE]);
/* Step at this tick of a clock that counts samples, whatever calls the program; it may wrap. out must still hold the last drive. CLOCK: samples
 * passed without a call, of which elapsed was not told and which are made up for as by it, or none passed: then drive and state stay as they
 * are, and UNSURE as it was. Every step and every settle in between counts as a sample. A clock that goes back leaves the state unknown,
 * as does one at which fewer samples passed than were stepped; and so does an out without a drive within its
 * limits, which is given the safe one. */
uint32_t mems_hexapod_online_f32_step_at(mems_hexapod_online_f32_state *state, uint32_t tick, const float target[MEMS_HEXAPOD_ONLINE_F32_TARGET_SIZE], mems_hexapod_online_f32_output *out);
#ifdef __cplusplus
}
#endif

#else
#if (MEMS_HEXAPOD_ONLINE_F32_BUILD != 0x1714BF56U) /* the header that was read first is another one */
#error "two different headers are named mems_hexapod_online_f32.h: give one of the controllers a name of its own, by controller = in its scenario.toml"
#endif
#endif
