/* three_stacks_online_f32: feedforward controller of stage, computed online.
 *
 * Commanded platform pose -> drives, one call per sample at 1000 Hz.
 * No heap, no globals: the caller owns the state. All numbers are SI.
 *
 * target[2]  platform pose: x [m], y [m]
 * drive[3]   drive: a [V], b [V], c [V]
 * displacement[2]: stage displacement [m] at the next sample (with status INPUT: the present one; LOST: zero)
 *
 * Limits kept:
 *   -100 V <= drive of a <= 100 V
 *   0 V <= drive of b <= 150 V
 *   -20 V <= drive of c <= 130 V
 *   -50 um <= travel of x <= 50 um
 *   -50 um <= travel of y <= 50 um
 *   -5 V/ms <= rate of a <= 5 V/ms
 *
 * Arithmetic operations of the physics per call: 21 while all limits hold, 321 at most
 * (comparisons and the limiter's own arithmetic not counted). Arithmetic: float.
 * Physics: a user's model
 * Made by ctrlgen 0.1.0 from device 75df1da7a65296aa (sha256), whatever the trajectory. Do not edit.
 */
#ifndef THREE_STACKS_ONLINE_F32_H
#define THREE_STACKS_ONLINE_F32_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* For _Static_assert(THREE_STACKS_ONLINE_F32_ABI == 5U, "..."): raised when code written for an older header must be changed. */
#define THREE_STACKS_ONLINE_F32_ABI (5U)
#define THREE_STACKS_ONLINE_F32_VERSION "0.1.0" /* of ctrlgen */
#define THREE_STACKS_ONLINE_F32_DEVICE_HASH (0x75df1da7U) /* the first 32 bits of the SHA-256 of the device's description */
#define THREE_STACKS_ONLINE_F32_RATE_HZ (1000U) /* samples a second */
#define THREE_STACKS_ONLINE_F32_BUILD (0x47C3030EU) /* of device, followed signal, rate, limits and arithmetic; the mark of an initialised state */
#define THREE_STACKS_ONLINE_F32_TARGET_SIZE (2U)
#define THREE_STACKS_ONLINE_F32_DRIVE_SIZE (3U)
#define THREE_STACKS_ONLINE_F32_DISPLACEMENT_SIZE (2U)
#define THREE_STACKS_ONLINE_F32_STATE_SIZE (0U) /* of the output; x of the state is what the model remembers */

/* Status: 0, or bits of these. The drive is within its limits in every case, and changes no faster than it may, but for LOST. */
#define THREE_STACKS_ONLINE_F32_DISPLACEMENT (1U) /* target beyond the displacement range: the nearest target inside was taken */
#define THREE_STACKS_ONLINE_F32_DRIVE (8U)        /* drive at its limit: the target is approached as far as one sample allows */
#define THREE_STACKS_ONLINE_F32_INPUT (16U)       /* NaN, infinite or absurdly large target, or NULL: drives at zero or the nearest admissible value. Without an output nothing is written, without a state the output alone */
#define THREE_STACKS_ONLINE_F32_LOST (32U)        /* the state was not initialised, is that of another build, or a number of it is NaN, infinite or absurd: drives as with INPUT, state kept, until three_stacks_online_f32_init */
#define THREE_STACKS_ONLINE_F32_RATE (128U)       /* drive changes as fast as it may: the target is reached later. Bits of limits beside it: also those that the device passes, because no drive can turn back faster */

/* One a device, written by the functions here alone. They must not be called on it while another call on it is going on, by an interrupt or
 * another thread: not even settle beside step. Calls on different states may run at the same time. */
typedef struct {
    float z[THREE_STACKS_ONLINE_F32_DISPLACEMENT_SIZE]; /* displacement_x, displacement_y [m] */
    float u[THREE_STACKS_ONLINE_F32_DRIVE_SIZE]; /* last drive: a [V], b [V], c [V] */
    uint32_t ready; /* THREE_STACKS_ONLINE_F32_BUILD once three_stacks_online_f32_init was called */
} three_stacks_online_f32_state;

typedef struct {
    float drive[THREE_STACKS_ONLINE_F32_DRIVE_SIZE]; /* a [V], b [V], c [V] */
    float displacement[THREE_STACKS_ONLINE_F32_DISPLACEMENT_SIZE]; /* m */
} three_stacks_online_f32_output;

/* What three_stacks_online_f32_init calls. It is linked by a name of this build, rate and hash of device, signal and limits: a program that was
 * compiled with this header and is linked with another build of the same prefix is told so by the linker. */
void three_stacks_online_f32_init_1000hz_47c3030e(three_stacks_online_f32_state *state);

/* A cold device at rest, its drives off. Also the way out of status LOST: hold the safe drive until the device has settled, then call it. */
static inline void three_stacks_online_f32_init(three_stacks_online_f32_state *state)
{
    three_stacks_online_f32_init_1000hz_47c3030e(state);
}

/* Drive of the equilibrium at target; the state becomes that equilibrium. Call it once a sample
 * while its status has the bit RATE: until then drive and state are on the way there. Hold the drive until the device has settled. */
uint32_t three_stacks_online_f32_settle(three_stacks_online_f32_state *state, const float target[THREE_STACKS_ONLINE_F32_TARGET_SIZE], three_stacks_online_f32_output *out);
/* Drive that brings the device to target at the next sample, held until then. Call once a sample. */
uint32_t three_stacks_online_f32_step(three_stacks_online_f32_state *state, const float target[THREE_STACKS_ONLINE_F32_TARGET_SIZE], three_stacks_online_f32_output *out);
#ifdef __cplusplus
}
#endif

#else
#if (THREE_STACKS_ONLINE_F32_BUILD != 0x47C3030EU) /* the header that was read first is another one */
#error "two different headers are named three_stacks_online_f32.h: give one of the controllers a name of its own, by controller = in its scenario.toml"
#endif
#endif
