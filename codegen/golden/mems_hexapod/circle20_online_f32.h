/* circle20_online_f32: feedforward controller of NIST MEMS hexapod nanopositioner, computed online.
 *
 * Commanded platform pose -> heater powers, one call per sample at 1000 Hz.
 * No heap, no globals: the caller owns the state. All numbers are SI.
 *
 * target[6]  platform pose: theta_x [rad], theta_y [rad], theta_z [rad], delta_x [m], delta_y [m], delta_z [m]
 * drive[6]   heater power: 1X [W], 1Y [W], 2X [W], 2Y [W], 3X [W], 3Y [W]
 * displacement[6]: stage displacement [m] at the next sample (with status INPUT: the present one)
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
 * Arithmetic operations of the physics per call: 315 while all limits hold, 3535 at most
 * (comparisons and the limiter's own arithmetic not counted). Arithmetic: float.
 * Physics: S1: Mech. Mach. Theory 80 (2014) 246-264, doi 10.1016/j.mechmachtheory.2014.05.004
 * Made by ctrlgen 0.1.0 from device 39f6d7972ef7d6f4, scenario 6b3b4ab03afed2d5 (sha256). Do not edit.
 */
#ifndef CIRCLE20_ONLINE_F32_H
#define CIRCLE20_ONLINE_F32_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Status: 0, or bits of these. The drive is within its limits in every case. */
#define CIRCLE20_ONLINE_F32_DISPLACEMENT (1U) /* target beyond the displacement range: the nearest target inside was taken */
#define CIRCLE20_ONLINE_F32_COMPOSITE (2U)    /* wire flexure stress: displacement scaled toward home */
#define CIRCLE20_ONLINE_F32_DRIVE (8U)        /* heater power at its limit: the target is approached as far as one sample allows */
#define CIRCLE20_ONLINE_F32_INPUT (16U)       /* NaN, infinite or absurdly large target, or NULL pointer: drives at zero or the nearest admissible value */

typedef struct {
    float x[6]; /* temperature_1X [K], temperature_1Y [K], temperature_2X [K], temperature_2Y [K], temperature_3X [K], temperature_3Y [K] */
    float z[6]; /* displacement_1X, displacement_1Y, displacement_2X, displacement_2Y, displacement_3X, displacement_3Y [m] */
} circle20_online_f32_state;

typedef struct {
    float drive[6];        /* 1X [W], 1Y [W], 2X [W], 2Y [W], 3X [W], 3Y [W] */
    float displacement[6]; /* m */
    float state[6];        /* 1X [K], 1Y [K], 2X [K], 2Y [K], 3X [K], 3Y [K] */
} circle20_online_f32_output;

/* A cold device at rest. */
void circle20_online_f32_init(circle20_online_f32_state *state);

/* Drive of the equilibrium at target; the state becomes that equilibrium. Hold the drive until the device has settled. */
uint32_t circle20_online_f32_settle(circle20_online_f32_state *state, const float target[6], circle20_online_f32_output *out);
/* Drive that brings the device to target at the next sample, held until then. Call once a sample. */
uint32_t circle20_online_f32_step(circle20_online_f32_state *state, const float target[6], circle20_online_f32_output *out);
#ifdef __cplusplus
}
#endif

#endif
