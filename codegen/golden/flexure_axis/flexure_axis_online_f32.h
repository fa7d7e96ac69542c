/* flexure_axis_online_f32: feedforward controller of single-axis flexure stage, computed online.
 *
 * Commanded platform pose and its derivatives by time -> drives, one call per sample at 20000 Hz.
 * A drive is held until the next call: give the target, position and derivatives, of the middle of that time.
 * No heap, no globals: the caller owns the state. All numbers are SI.
 *
 * target[3]  platform pose and its derivatives by time: axis [m], d1_axis [m / s], d2_axis [m / s ** 2]
 * drive[1]   drive: axis [V]
 * displacement[1]: stage displacement [m] at the next sample (with status INPUT: the present one; LOST: zero)
 *
 * Limits kept:
 *   -4 V <= commanded drive <= 4 V
 *   -100 um <= stage displacement <= 100 um
 *
 * Arithmetic operations of the physics per call: 13 while all limits hold, 21 at most,
 * and 21 more where flexure_axis_online_f32_step_at makes up for calls that were missed
 * (comparisons and the limiter's own arithmetic not counted). Arithmetic: float.
 * Physics: an example: round numbers, no particular instrument
 * Made by ctrlgen 0.1.0 from device 5f641b21af2d9766 (sha256), whatever the trajectory. Do not edit.
 */
#ifndef FLEXURE_AXIS_ONLINE_F32_H
#define FLEXURE_AXIS_ONLINE_F32_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* For _Static_assert(FLEXURE_AXIS_ONLINE_F32_ABI == 5U, "..."): raised when code written for an older header must be changed. */
#define FLEXURE_AXIS_ONLINE_F32_ABI (5U)
#define FLEXURE_AXIS_ONLINE_F32_VERSION "0.1.0" /* of ctrlgen */
#define FLEXURE_AXIS_ONLINE_F32_DEVICE_HASH (0x5f641b21U) /* the first 32 bits of the SHA-256 of the device's description */
#define FLEXURE_AXIS_ONLINE_F32_RATE_HZ (20000U) /* samples a second */
#define FLEXURE_AXIS_ONLINE_F32_BUILD (0xF8CCA9DAU) /* of device, followed signal, rate, limits and arithmetic; the mark of an initialised state */
#define FLEXURE_AXIS_ONLINE_F32_TARGET_SIZE (3U)
#define FLEXURE_AXIS_ONLINE_F32_DRIVE_SIZE (1U)
#define FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE (1U)
#define FLEXURE_AXIS_ONLINE_F32_STATE_SIZE (0U) /* of the output; x of the state is what the model remembers */

/* Status: 0, or bits of these. The drive is within its limits in every case. */
#define FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT (1U) /* target beyond the displacement range: the nearest target inside was taken */
#define FLEXURE_AXIS_ONLINE_F32_DRIVE (8U)        /* drive at its limit: the motion is left */
#define FLEXURE_AXIS_ONLINE_F32_INPUT (16U)       /* NaN, infinite or absurdly large target, or NULL: drives at zero or the nearest admissible value. Without an output nothing is written, without a state the output alone */
#define FLEXURE_AXIS_ONLINE_F32_LOST (32U)        /* the state was not initialised, is that of another build, or a number of it is NaN, infinite or absurd: drives as with INPUT, state kept, until flexure_axis_online_f32_init */
#define FLEXURE_AXIS_ONLINE_F32_UNSURE (256U)     /* the device may be off the motion by more than 1 thousandth of its range, and pass limits by as much and more: it rings after a jump of the target, a drive that was limited, a late call, settling, or was not known at the start. Clears itself */
#define FLEXURE_AXIS_ONLINE_F32_CLOCK (512U)      /* of flexure_axis_online_f32_step_at: not one sample has passed since the last call */

#define FLEXURE_AXIS_ONLINE_F32_SETTLING (13945U) /* samples under a held drive, after which whatever drives within their limits made the device ring is told no more, with the damping that it has at least: 0.697 s */

/* One a device, written by the functions here alone. They must not be called on it while another call on it is going on, by an interrupt or
 * another thread: neither settle, elapsed, forget nor observe beside step. Calls on different states may run at the same time. */
typedef struct {
    float x[1]; /* velocity_axis [m / s] */
    float z[FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE]; /* displacement_axis [m] */
    float ahead[2]; /* where the motion leads, weighted */
    float ringing; /* how far the device is off it at most, in 1 thousandth of its range; 0.5 or less is told as none */
    uint32_t ready; /* FLEXURE_AXIS_ONLINE_F32_BUILD once flexure_axis_online_f32_init was called */
    uint32_t ticking; /* 1 once flexure_axis_online_f32_step_at was called, at this; each sample since counts */
    uint32_t tick;
} flexure_axis_online_f32_state;

typedef struct {
    float drive[FLEXURE_AXIS_ONLINE_F32_DRIVE_SIZE]; /* axis [V] */
    float displacement[FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE]; /* m */
} flexure_axis_online_f32_output;

/* What flexure_axis_online_f32_init calls. It is linked by a name of this build, rate and hash of device, signal and limits: a program that was
 * compiled with this header and is linked with another build of the same prefix is told so by the linker. */
void flexure_axis_online_f32_init_20000hz_f8cca9da(flexure_axis_online_f32_state *state);

/* A cold device at rest. Also the way out of status LOST: hold the safe drive until the device has settled, then call it.
 * Behind a reset, a brown-out or a watchdog nobody knows whether it is: call flexure_axis_online_f32_forget then. */
static inline void flexure_axis_online_f32_init(flexure_axis_online_f32_state *state)
{
    flexure_axis_online_f32_init_20000hz_f8cca9da(state);
}

/* Drive of the equilibrium at the position of target; the state becomes that equilibrium. Hold the drive until the device has settled: FLEXURE_AXIS_ONLINE_F32_SETTLING samples,
 * until which the status has UNSURE. Call it once a sample for so long, or flexure_axis_online_f32_elapsed with the samples that passed without a call. */
uint32_t flexure_axis_online_f32_settle(flexure_axis_online_f32_state *state, const float target[FLEXURE_AXIS_ONLINE_F32_TARGET_SIZE], flexure_axis_online_f32_output *out);
/* Drive of the motion that target and its derivatives say at this moment; the state becomes that of the motion. A motion beyond a limit
 * of displacement, state or stress is answered as by settle. A drive that was limited is not made up for: UNSURE tells of what that sets ringing, and of targets that do not go on from one another. */
uint32_t flexure_axis_online_f32_step(flexure_axis_online_f32_state *state, const float target[FLEXURE_AXIS_ONLINE_F32_TARGET_SIZE], flexure_axis_online_f32_output *out);

/* Behind flexure_axis_online_f32_init where nothing is known of the device, as after a reset, but that its drives were within their limits. Status UNSURE, which
 * clears itself in FLEXURE_AXIS_ONLINE_F32_SETTLING samples; LOST without flexure_axis_online_f32_init. */
uint32_t flexure_axis_online_f32_forget(flexure_axis_online_f32_state *state);
/* x and z of the state were measured at this moment, each to within an error of 0 or more, before the next step: how far the device is off the
 * motion is known by that. What is known better stays, unless it contradicts. INPUT, and nothing changes: a pointer is NULL, or a
 * number NaN or absurd. Returns UNSURE as a step would, or 0. */
uint32_t flexure_axis_online_f32_observe(flexure_axis_online_f32_state *state, const float x[1], const float z[FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE], const float x_error[1], const float z_error[FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE]);
/* So many samples passed without a call, under this drive: that of the last call, or zeros where the hardware took it away. The device rings
 * about the equilibrium under it. INPUT, and nothing changes: the drive is NULL or out of its limits. Returns UNSURE as a step would, or 0. */
uint32_t flexure_axis_online_f32_elapsed(flexure_axis_online_f32_state *state, uint32_t ticks, const float drive[FLEXURE_AXIS_ONLINE_F32_DRIVE_SIZE]);
/* Step at this tick of a clock that counts samples, whatever calls the program; it may wrap. out must still hold the last drive. CLOCK: samples
 * passed without a call, of which elapsed was not told and which are made up for as by it, or none passed: then drive and state stay as they
 * are, and UNSURE as it was. Every step and every settle in between counts as a sample. A clock that goes back leaves the state unknown,
 * as does one at which fewer samples passed than were stepped; and so does an out without a drive within its
 * limits, which is given the safe one. */
uint32_t flexure_axis_online_f32_step_at(flexure_axis_online_f32_state *state, uint32_t tick, const float target[FLEXURE_AXIS_ONLINE_F32_TARGET_SIZE], flexure_axis_online_f32_output *out);
#ifdef __cplusplus
}
#endif

#else
#if (FLEXURE_AXIS_ONLINE_F32_BUILD != 0xF8CCA9DAU) /* the header that was read first is another one */
#error "two different headers are named flexure_axis_online_f32.h: give one of the controllers a name of its own, by controller = in its scenario.toml"
#endif
#endif
