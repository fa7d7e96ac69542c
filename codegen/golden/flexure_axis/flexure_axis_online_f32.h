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
 * Arithmetic operations of the physics per call: 5 while all limits hold, 13 at most
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

/* For _Static_assert(FLEXURE_AXIS_ONLINE_F32_ABI == 3U, "..."): raised when code written for an older header must be changed. */
#define FLEXURE_AXIS_ONLINE_F32_ABI (3U)
#define FLEXURE_AXIS_ONLINE_F32_VERSION "0.1.0" /* of ctrlgen */
#define FLEXURE_AXIS_ONLINE_F32_DEVICE_HASH (0x5f641b21U) /* the first 32 bits of the SHA-256 of the device's description */
#define FLEXURE_AXIS_ONLINE_F32_RATE_HZ (20000U) /* samples a second */
#define FLEXURE_AXIS_ONLINE_F32_BUILD (0x6AF76EF7U) /* of device, followed signal, rate, limits and arithmetic; the mark of an initialised state */
#define FLEXURE_AXIS_ONLINE_F32_TARGET_SIZE (3U)
#define FLEXURE_AXIS_ONLINE_F32_DRIVE_SIZE (1U)
#define FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE (1U)
#define FLEXURE_AXIS_ONLINE_F32_STATE_SIZE (0U) /* of the output; x of the state is what the model remembers */

/* Status: 0, or bits of these. The drive is within its limits in every case. */
#define FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT (1U) /* target beyond the displacement range: the nearest target inside was taken */
#define FLEXURE_AXIS_ONLINE_F32_DRIVE (8U)        /* drive at its limit: the motion is left */
#define FLEXURE_AXIS_ONLINE_F32_INPUT (16U)       /* NaN, infinite or absurdly large target, or NULL: drives at zero or the nearest admissible value. Without an output nothing is written, without a state the output alone */
#define FLEXURE_AXIS_ONLINE_F32_LOST (32U)        /* the state was not initialised, is that of another build, or a number of it is NaN, infinite or absurd: drives as with INPUT, state kept, until flexure_axis_online_f32_init */

typedef struct {
    float x[1]; /* velocity_axis [m / s] */
    float z[FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE]; /* displacement_axis [m] */
    uint32_t ready; /* FLEXURE_AXIS_ONLINE_F32_BUILD once flexure_axis_online_f32_init was called */
} flexure_axis_online_f32_state;

typedef struct {
    float drive[FLEXURE_AXIS_ONLINE_F32_DRIVE_SIZE]; /* axis [V] */
    float displacement[FLEXURE_AXIS_ONLINE_F32_DISPLACEMENT_SIZE]; /* m */
} flexure_axis_online_f32_output;

/* What flexure_axis_online_f32_init calls. It is linked by a name of this build, rate and hash of device, signal and limits: a program that was
 * compiled with this header and is linked with another build of the same prefix is told so by the linker. */
void flexure_axis_online_f32_init_20000hz_6af76ef7(flexure_axis_online_f32_state *state);

/* A cold device at rest. Also the way out of status LOST: hold the safe drive until the device has settled, then call it. */
static inline void flexure_axis_online_f32_init(flexure_axis_online_f32_state *state)
{
    flexure_axis_online_f32_init_20000hz_6af76ef7(state);
}

/* Drive of the equilibrium at the position of target; the state becomes that equilibrium. Hold the drive until the device has settled. */
uint32_t flexure_axis_online_f32_settle(flexure_axis_online_f32_state *state, const float target[FLEXURE_AXIS_ONLINE_F32_TARGET_SIZE], flexure_axis_online_f32_output *out);
/* Drive of the motion that target and its derivatives say at this moment; the state becomes that of the motion. A motion beyond a limit
 * of displacement, state or stress is answered as by settle. It takes nothing from the state: a drive that was limited is not made up for. */
uint32_t flexure_axis_online_f32_step(flexure_axis_online_f32_state *state, const float target[FLEXURE_AXIS_ONLINE_F32_TARGET_SIZE], flexure_axis_online_f32_output *out);
#ifdef __cplusplus
}
#endif

#endif
